"""A zoo of small tasks of many kinds, to choose settings on, and to report on others.

Computed, not drawn: other arms, other releases, other plans, other outcomes than those of the
Panda's tasks; about a millisecond a rollout. Their demonstrations are made by one generator of
human variation (`human`).
"""

from __future__ import annotations

from prior_reinforce.registry import Member

_THROWS = "prior_reinforce.tasks.zoo.throws"
_PUSHES = "prior_reinforce.tasks.zoo.pushes"

MEMBERS = {
    "zoo-lob": Member(f"{_THROWS}:Lob", "a ball let go by a clock"),
    "zoo-scoop": Member(f"{_THROWS}:Scoop", "a ball that leaves a scoop"),
    "zoo-push": Member(f"{_PUSHES}:Push", "a puck pushed by increments"),
    "zoo-gripper": Member(f"{_THROWS}:GripperThrow", "a throw with a gripper channel"),
    "zoo-slide": Member(f"{_PUSHES}:Slide", "a disc on a worn table"),
}
"""The zoo's tasks by name, for the registry of all tasks."""
