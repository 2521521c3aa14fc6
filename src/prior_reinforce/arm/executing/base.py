"""What drives one kind of arm: the contract of every executor.

An executor works in its arm's own columns, order and units. It holds a plan against this arm's
limits, streams it, and says what was measured. Everything else is done once for all of them in
`drive.py`, in a process of its own: a plan's columns are matched to the arm's, the start pose is
compared, a slow approach and a rehearsal are plans like any other, and what came of it is written
down. A new arm is one file with one class, and a line in `EXECUTORS` if it comes with us.
"""

from __future__ import annotations

import itertools
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.plans.motions import Plan

_BLEND = 0.2
"""Within this time, in [s], a motion goes from where the arm stands over to its plan. Ours: of the
2 mrad that may be left, 0.3 rad/s^2."""
START_TOLERANCE = 0.005
"""Of a joint from a plan's first frame, in [rad], at which a motion is begun. Ours: what a servo at
rest is off, and the whole of what a path may be off its plan."""
_MOVED = 0.002
"""Distance of a joint from where it stood that counts as having moved, in [rad]. Ours: ten times
what a joint that is held shows."""
GUIDED_RATE = 200.0
"""Most states a second that are read of a guided arm. Ours: ten a frame of the shortest plans."""
Motion = Literal["trial", "rehearsal", "approach"]
"""What an arm is moved for: a trial; its plan at a fraction of the speed, which is no trial; or the
slow way to its first frame."""
Guiding = Literal["as it is", "let go", "led"]
"""What being guided does to an arm: nothing; its torque goes off, and it falls unless somebody
holds it; or a leader moves it at once."""


def begin_at(plan: Plan, pose: Float[np.ndarray, " d"]) -> Plan:
    """The plan from where the arm stands: a motion of its own, to be checked as what is sent.

    The plan is in the arm's own columns, and the pose is nearly its first frame.
    """
    s = np.clip(plan.times / min(_BLEND, plan.times[-1]), 0, 1)[:, None]
    left = 1 - s**3 * (10 - 15 * s + 6 * s**2)
    frames = plan.actions + left * (pose - plan.actions[0])
    frames[0] = pose
    return replace(plan, actions=frames)


@dataclass(frozen=True)
class ArmSettings:
    """The arm of a workspace: `[arm]` of its manifest."""

    executor: str
    """A name of `EXECUTORS`."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """For its `config_type`: `host`, `port`."""


@dataclass(frozen=True)
class ArmDescription:
    """An arm, as it answers."""

    model: str
    """For instance `fr3`."""
    firmware: str
    """As the arm says; empty where it does not."""
    columns: tuple[str, ...]
    """Name of each of its d channels; a plan's column is matched by `is_joint`."""
    units: tuple[str, ...]
    """Unit of each channel."""
    rate: float
    """Set points and measurements a second."""
    checked: tuple[str, ...]
    """What `check` refuses a plan for, in a few words each: `velocity at each position`."""
    unchecked: tuple[str, ...]
    """What neither it nor the arm checks: `self-collision`, `people`."""


@dataclass(frozen=True, eq=False)
class MeasuredPath:
    """What an arm measured while it moved."""

    t: Float[np.ndarray, " T"]
    """Time from the plan's first frame, in [s]."""
    q: Float[np.ndarray, "T d"]
    """Position of each channel, in its unit; no rows where nothing was measured."""
    fault: str = ""
    """Why the plan was not executed to its end, in the arm's words."""
    moved: bool = True
    """Whether the arm moved, or may have."""

    @classmethod
    def of(
        cls, rows: Sequence[tuple[float, list[float]]], d: int, fault: str = "", moved: bool = True
    ) -> Self:
        """What is in rows of t and q, of d channels; there may be none."""
        q = np.array([q for _, q in rows]).reshape(len(rows), d)
        return cls(np.array([t for t, _ in rows]), q, fault, moved)

    def left(self, before: Float[np.ndarray, " d"], after: Float[np.ndarray, " d"]) -> bool:
        """Whether an arm of joints left a pose, on the path or by where it stands after it."""
        return bool(np.abs(np.vstack([self.q, after]) - before).max() > _MOVED)


@dataclass(frozen=True, eq=False)
class GuidedState:
    """Where an arm is that somebody guides."""

    t: float
    """Time since it began, in [s]."""
    commanded: Float[np.ndarray, " d"]
    """What it is told, by a leader arm, say; what is measured, if nobody tells it anything."""
    measured: Float[np.ndarray, " d"]
    """Where it is."""


class Executor(ABC):
    """One arm, connected. Nothing moves but in `run`."""

    config_type: ClassVar[type[Any]]
    """Frozen dataclass of its settings; a field without a default must stand in the manifest."""

    @abstractmethod
    def __init__(self, config: Any) -> None:
        """Connect.

        Raises:
            ConfigurationError: The arm cannot be reached, or its settings cannot be used.
            MissingExtraError: Its library is not installed.
        """

    @abstractmethod
    def describe(self) -> ArmDescription:
        """Say which arm it is."""

    @abstractmethod
    def where(self) -> Float[np.ndarray, " d"]:
        """Position of each channel, in its unit: where a motion would have to begin.

        Raises:
            ConfigurationError: The arm is in no state to move: a stop button is pressed, say.
        """

    @abstractmethod
    def check(self, plan: Plan) -> None:
        """Do nothing if the arm could execute a plan.

        Args:
            plan: In the arm's own columns.

        Raises:
            RobotLimitError: It breaks a limit of this arm with this firmware.
        """

    @abstractmethod
    def run(self, plan: Plan) -> MeasuredPath:
        """Execute a plan once, never again by itself, and wait until the arm is at rest.

        Args:
            plan: In the arm's own columns, from where the arm stands (`begin_at`). What else is
                sent was checked, too: what runs ahead of the plan, or is sampled from it.

        Returns:
            What was measured; a fault of the arm is in it and raises nothing.
        """

    @abstractmethod
    def stop(self) -> None:
        """Bring the arm to rest: `run` ends soon after, with a fault.

        Called from a signal's handler while `run` goes on, in the same thread: set a flag.
        """

    @classmethod
    def guiding(cls, config: Any) -> Guiding:
        """What `guide` does to an arm with these settings: a person is asked first."""
        return "as it is"

    def guide(self) -> Iterator[GuidedState]:
        """Let a person guide the arm, and say where it is, at a steady rate, until nobody asks.

        By default nothing is let go: the arm is in a state in which it can be guided by itself.
        One that lets it go or moves it says so in `guiding`.

        Raises:
            ConfigurationError: The arm does not answer any more.
        """
        period, start = 1 / min(self.describe().rate, GUIDED_RATE), time.monotonic()
        for cycle in itertools.count():
            time.sleep(max(0.0, start + cycle * period - time.monotonic()))
            q = self.where()
            yield GuidedState(time.monotonic() - start, q, q)

    def close(self) -> None:
        """Let go of the arm, which is at rest; by default nothing is to be done."""
        return
