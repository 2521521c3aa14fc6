"""Symmetries of motions: what may be done to a whole plan, and what that does to its outcome.

The field's terms: plans and outcomes are acted on by the same group, SO(2) (turns about a vertical
axis) or SE(2) (shifts and turns on a table), and a generator that respects it is *equivariant*;
bringing demonstrations to one place of the group before anything is learned is *canonicalisation*.
Playing a motion faster is *temporal scaling* (dynamic movement primitives), and learning from
trials what such a scaling does to the outcome is *task-level learning* (Aboaf, Atkeson and
Reinkensmeyer, 1988). Temporal scaling is no symmetry: its law is unknown, and is learned.
"""

from prior_reinforce.plans.symmetry.anchors import Anchors
from prior_reinforce.plans.symmetry.axis import Axis, find_axis, hand_paths
from prior_reinforce.plans.symmetry.charts import Cartesian, Chart, LogDistance, Polar
from prior_reinforce.plans.symmetry.declared import declare_symmetry
from prior_reinforce.plans.symmetry.moves import (
    Amplitude,
    Delay,
    Learned,
    Move,
    Shift,
    Tempo,
    TurnIncrements,
    TurnJoint,
    TurnPath,
    TurnPoses,
)
from prior_reinforce.plans.symmetry.symmetry import (
    EXTRAPOLATED,
    Symmetry,
    scale_alone,
    shift,
    turn_and_scale,
)

__all__ = [
    "EXTRAPOLATED",
    "Amplitude",
    "Anchors",
    "Axis",
    "Cartesian",
    "Chart",
    "Delay",
    "Learned",
    "LogDistance",
    "Move",
    "Polar",
    "Shift",
    "Symmetry",
    "Tempo",
    "TurnIncrements",
    "TurnJoint",
    "TurnPath",
    "TurnPoses",
    "declare_symmetry",
    "find_axis",
    "hand_paths",
    "scale_alone",
    "shift",
    "turn_and_scale",
]
