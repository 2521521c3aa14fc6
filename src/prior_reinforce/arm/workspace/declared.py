"""Section [symmetry] of a manifest: how a demonstrated motion may be moved, in a person's words."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from prior_reinforce.arm.robots.limits import RobotLimits, match_joints
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Symmetry, declare_symmetry

WAYS = {
    "carried": "the arm carries the object until it leaves: turned about the base",
    "X Y": "the object lies at this place, to be pushed or struck: turned about it",
    "anywhere": "the motion may happen anywhere on the table: shifted (poses alone)",
    "none": "neither; along one line, the motion is played faster or slower",
}
"""What may be said of the object, and what follows."""


class DeclaredSymmetry(Struct, frozen=True, forbid_unknown_fields=True):
    """What a person says of a task; see `plans.symmetry.declare_symmetry`."""

    object: Literal["carried", "anywhere", "none"] | tuple[float, float]
    """Where the object is before it leaves; (x, y) in the table frame."""
    distance: Literal["tempo", "amplitude", "learned"] = "tempo"
    """How a motion reaches farther: played faster, made larger, or as demonstrations tell."""
    release_frame: Annotated[float, Meta(ge=0)] | None = None
    """Where a clock lets go, and not the motion."""
    steps: tuple[str, ...] = ()
    """Columns of grippers and triggers."""
    stays: tuple[str, ...] = ()
    """Columns that a turn or a shift leaves as they are."""
    start: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the hand before plans of increments."""
    no_box: bool = False
    """A turned motion may sweep anywhere: no box for the tool tip is wanted."""

    @property
    def turns(self) -> bool:
        """Whether motions are turned, and so sweep other parts of the room."""
        return self.object not in ("anywhere", "none")

    def symmetry(
        self, form: PlanFormat, outcomes: OutcomeFormat, robot: RobotLimits | None
    ) -> Symmetry:
        """Make it for plans and outcomes of these formats.

        ConfigurationError if plans or outcomes are not such that this can be done.
        """
        about: Literal["base"] | tuple[float, float] | None = None
        if self.turns:
            about = "base" if isinstance(self.object, str) else self.object
        joints: list[int] = []
        ranges: list[tuple[float, float]] = []
        chain = None if robot is None else robot.chain
        if robot is not None and chain is not None:
            joints = [*match_joints(form, robot).values()]
            ranges = [*zip(robot.lower.tolist(), robot.upper.tolist(), strict=True)]
            if len(joints) < len(robot.joint_names):
                raise ConfigurationError(
                    f"a symmetry needs all joints of {robot.robot} in the plan, which has "
                    f"{', '.join(form.names)}; take [symmetry] out"
                )
        symmetry = declare_symmetry(
            form,
            outcomes.outcome_dim,
            about=about,
            distance="shift" if self.object == "anywhere" else self.distance,
            chain=chain,
            joints=joints,
            ranges=ranges,
            start=self.start,
            release_frame=self.release_frame,
            steps=self.steps,
            stays=self.stays,
        )
        symmetry.check_units(outcomes.units, form.units)
        return symmetry


def read_object(said: str) -> str | tuple[float, float]:
    """Return the `object` that a person says: `carried`, `0.43 0`, `anywhere` or `none`.

    ConfigurationError if it is none of these.
    """
    words = said.replace(",", " ").split()
    if len(words) == 1 and words[0] in WAYS:
        return words[0]
    try:
        x, y = (float(word) for word in words)
    except ValueError as error:
        ways = "; ".join(f"{name} ({means})" for name, means in WAYS.items())
        raise ConfigurationError(f"where is the object? got {said!r}; say {ways}") from error
    return x, y
