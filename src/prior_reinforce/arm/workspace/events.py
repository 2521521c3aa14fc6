"""What can happen in a workspace, as typed events: trials, learning, and motions of the arm."""

from __future__ import annotations

import msgspec

from prior_reinforce.arm.executing.base import Motion
from prior_reinforce.arm.executing.result import MotionResult
from prior_reinforce.session.events import Amended, Asked, Event, GoalSet, Told, Voided


class DemonstrationsImported(Event, frozen=True):
    """Demonstrations were imported, in place of earlier ones."""

    n: int
    sha256: str
    source: str


class ModelTrained(Event, frozen=True):
    """A generator was fitted to the demonstrations, and is in use from now on."""

    model: str
    """Hash of the model, the name of its folder."""
    generator: str
    """Its choice, for instance `diffusion`."""
    seed: int
    demonstrations_sha256: str
    """Of the demonstrations that it was fitted to."""
    remarks: tuple[str, ...] = ()
    """What the fit could not do."""


class KeptPlan(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file of a plan."""

    file: str
    sha256: str


class PlanAsked(Asked, frozen=True, kw_only=True, tag="asked"):
    """A plan was given out, and is in a file."""

    plan: KeptPlan


class Moving(Event, frozen=True):
    """The arm is about to move for a trial: a plan is given to a command or an executor."""

    trial: int
    motion: Motion
    """`trial` executes it; to its start or to rehearse is no trial."""
    by: str
    """Program without its arguments, or name of the executor; empty where the motion was found in
    `folder` only."""
    folder: str
    """Name of the folder for what it writes; empty if it was never made."""
    speed: float = 1.0
    """Share of the plan's own speed."""


class Moved(Event, MotionResult, frozen=True, kw_only=True):
    """That motion ended. Only one for a `trial` that did not stand still executed it."""

    trial: int
    motion: Motion


WorkspaceEvent = (
    GoalSet
    | PlanAsked
    | Told
    | Amended
    | Voided
    | DemonstrationsImported
    | ModelTrained
    | Moving
    | Moved
)
