"""The interface of M: a perceived goal in, the condition to try out (paper, Stage 2)."""

from __future__ import annotations

import hashlib
import json
import os
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point, as_vector
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidFeedbackError,
    InvalidGoalError,
    NotFittedError,
)
from prior_reinforce.files import open_npz
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading

_STATE = 4
"""Version of the data that `state` returns; part of the key, so that no older state is resumed."""
_Arrays = TypeVar("_Arrays")


class Expectation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Prediction of a trial before it is executed; empty if the adapter predicts nothing."""

    p_hit: float | None = None
    """Probability that the trial reaches the goal."""
    trials: float | None = None
    """Expected trials until the goal is reached, this one included; None if unknown."""
    error: tuple[float, ...] | None = None
    """Expected error, outcome minus goal, k numbers in the outcomes' units, or an array of them;
    None if unknown."""
    sd: tuple[float, ...] | None = None
    """Standard deviation of the error, likewise."""
    remark: str = ""
    """What a person should know before the trial, in one line, such as a symmetry in doubt."""
    nearer: bool = False
    """Whether the plan is moved less far than readings suggest, because an object was lost."""
    beyond: bool = False
    """Whether the goal is farther than a plan may be moved."""

    @property
    def large_error(self) -> Point:
        """Largest plausible error, (k,): |mean| plus two standard deviations; 0 if unknown."""
        if self.error is None or self.sd is None:
            return np.zeros(1)
        return np.asarray(np.abs(self.error) + 2.0 * np.array(self.sd))

    def __post_init__(self) -> None:
        """Convert arrays to plain numbers, which journals can write."""
        for name in ("p_hit", "trials", "error", "sd"):
            if (given := getattr(self, name)) is not None:
                plain = np.asarray(given, np.float64).tolist()
                value = tuple(plain) if isinstance(plain, list) else plain
                msgspec.structs.force_setattr(self, name, value)


@dataclass(frozen=True, eq=False)
class State:
    """What an adapter has learned, as plain data for a file."""

    facts: dict[str, Any]
    """Values of JSON types."""
    arrays: dict[str, np.ndarray]
    """Arrays of numbers."""
    key: str = ""
    """`Adapter.key`; set by `Adapter.state`."""

    def build(self, kind: type[_Arrays]) -> _Arrays:
        """Make a dataclass whose fields are all arrays of the same names."""
        return kind(*(self.arrays[field.name] for field in fields(kind)))  # type: ignore[arg-type]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an `.npz`: the arrays, and a JSON text of the rest."""
        text = json.dumps({"facts": self.facts, "key": self.key})
        with open(path, "wb") as file:
            np.savez(file, **self.arrays, facts=np.array(text))  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> State:
        """Read what `save` wrote.

        Raises:
            FileFormatError: The file is no such `.npz`.
        """
        with open_npz(Path(path), "delete it: trials are then told again") as archive:
            arrays = {name: archive[name] for name in archive.files}
            data = json.loads(str(arrays.pop("facts")))
            return cls(data["facts"], arrays, data["key"])


def next_key(
    key: str,
    method: str,
    condition: Point | None = None,
    goal: Point | None = None,
    reading: Reading | None = None,
) -> str:
    """Return `Adapter.key` after one more call.

    Args:
        key: Key before the call.
        method: `observe` or `change_hardware`.
        condition: c of the trial, for `observe`.
        goal: g, likewise.
        reading: Likewise.
    """
    digest = hashlib.sha256(f"{key} {method}".encode())
    arrays = [condition, goal]
    if reading is not None:
        arrays += [reading.error_seen, reading.low, reading.high, reading.sd]
        arrays += [reading.missed_by_at_least]
        digest.update(repr((reading.hit, reading.lost)).encode())
    for values in arrays:
        digest.update(b"-" if values is None else np.asarray(values, np.float64).tobytes())
    return digest.hexdigest()


class Adapter(ABC):
    """A condition adapter: corrects the condition given to the generator from trial to trial.

    It receives perceived outcomes only, and knows no trial numbers: after a trial was amended or
    voided, the session starts it again and repeats the observations (at most a dozen).

    This class checks arguments. A member implements `_start`, `_propose`, and `_observe` or
    `_observe_reading`; they receive fresh, finite vectors of the right length, after `start` only.
    """

    carries_over: ClassVar[bool] = False
    """Whether trials of earlier goals help; a session then passes them by default."""
    _outcome_dim: int | None = None
    _key: str = ""

    def start(self, demonstrations: Demonstrations) -> None:
        """Begin anew with D_M = {(c_i, r_i) | c_i = r_i} (Algorithm 1), forgetting all trials."""
        self._key = ""
        self._start(demonstrations)
        self._outcome_dim = demonstrations.outcome_dim
        self._key = self.first_key(demonstrations)

    def first_key(self, demonstrations: Demonstrations) -> str:
        """Return `key` as it is after `start`, without starting."""
        import prior_reinforce

        version = prior_reinforce.__version__, _STATE
        settings = type(self).__qualname__, version, getattr(self, "config", None)
        return next_key("", f"{settings} {demonstrations.sha256}")

    @property
    def key(self) -> str:
        """Digest of version, settings, demonstrations, and all calls since `start`.

        Adapters of equal key propose the same. Empty before `start`, and after a call that failed:
        the state is then unknown. `first_key` and `next_key` give a key without the calls.
        """
        return self._key

    def state(self) -> State | None:
        """Return what `resume` needs instead of the trials; None if observing again is cheap.

        Raises:
            NotFittedError: Before `start`.
        """
        if self._outcome_dim is None:
            raise NotFittedError(f"{type(self).__name__} knows nothing yet; call start first")
        state = self._state()
        return None if state is None else replace(state, key=self._key)

    def resume(self, demonstrations: Demonstrations, state: State) -> None:
        """Take up the state of another adapter with the same settings.

        Args:
            demonstrations: Those that the other was started with.
            state: The `state` of the other.
        """
        self.start(demonstrations)
        self._key = ""
        self._resume(state)
        self._key = state.key

    def propose(self, goal_seen: ArrayLike) -> Point:
        """Return the condition to try next for a goal: c = M(g).

        Args:
            goal_seen: Perceived goal, in the outcomes' units.

        Returns:
            Condition, in the same units, a fresh array. Proposing changes nothing.

        Raises:
            NotFittedError: Before `start`.
            InvalidGoalError: Wrong shape, or not finite.
        """
        return self._propose(self._checked(goal_seen, "goal", InvalidGoalError))

    def observe(self, condition: ArrayLike, goal: ArrayLike, reading: Reading | ArrayLike) -> None:
        """Take in one trial: the perceived error of this condition.

        Args:
            condition: c. Copied.
            goal: g of the trial. Copied.
            reading: Perceived outcome minus goal; an array is a number of unknown origin.

        Raises:
            NotFittedError: Before `start`.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        c = self._checked(condition, "condition", InvalidFeedbackError)
        g = self._checked(goal, "goal", InvalidFeedbackError)
        seen = reading.error_seen if isinstance(reading, Reading) else reading
        error = self._checked(seen, "perceived error", InvalidFeedbackError)
        if not isinstance(reading, Reading):
            reading = Reading.estimated(error)
        key, self._key = next_key(self._key, "observe", c, g, reading), ""
        self._observe_reading(c, g, reading)
        self._key = key

    @property
    def symmetry_doubted(self) -> bool:
        """Whether trials contradict the symmetry that the demonstrations state, if any."""
        return False

    def expect(self, condition: ArrayLike, goal: ArrayLike, tolerance: ArrayLike) -> Expectation:
        """Predict a trial; the expectation is empty if the adapter predicts nothing.

        Args:
            condition: c, usually the proposed one.
            goal: g.
            tolerance: epsilon of each component, or one for all, in the outcomes' units.

        Raises:
            NotFittedError: Before `start`.
            InvalidGoalError: Wrong shape, or not finite.
            ConfigurationError: A user's adapter returned something else.
        """
        expected = self._expect(
            self._checked(condition, "condition", InvalidGoalError),
            self._checked(goal, "goal", InvalidGoalError),
            np.broadcast_to(np.asarray(tolerance, np.float64), self._outcome_dim or 0),
        )
        if not isinstance(expected, Expectation):
            name = type(self).__name__
            raise ConfigurationError(f"{name}._expect must return an Expectation, got {expected!r}")
        return expected

    def change_hardware(self) -> None:
        """Take note that the hardware changes between the last trial and the next.

        Most adapters ignore it.
        """
        key, self._key = next_key(self._key, "change_hardware"), ""
        self._change_hardware()
        self._key = key

    @abstractmethod
    def _start(self, demonstrations: Demonstrations) -> None:
        """See `start`."""

    @abstractmethod
    def _propose(self, goal_seen: Point) -> Point:
        """See `propose`; may return the goal itself."""

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        """Take in one trial: the perceived outcome r = g + e; both arrays may be kept."""
        raise NotImplementedError(
            f"{type(self).__name__} takes in no trials: write _observe, or _observe_reading"
        )

    def _observe_reading(self, condition: Point, goal: Point, reading: Reading) -> None:
        """See `observe`; for adapters that use more than a number.

        By default `_observe` gets the number, and trials without one ("a miss") are ignored.
        """
        if reading.has_number:
            self._observe(condition, goal + reading.error_seen)

    def _change_hardware(self) -> None:  # noqa: B027  # most ignore it
        """See `change_hardware`."""

    def _state(self) -> State | None:
        """See `state`; for adapters whose observations are expensive."""
        return None

    def _resume(self, state: State) -> None:
        """See `resume`; called after `start`."""
        raise NotImplementedError(f"{type(self).__name__} keeps no state: tell it the trials")

    def _expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation:
        """See `expect`."""
        return Expectation()

    def _checked(
        self,
        values: ArrayLike,
        name: str,
        problem: type[InvalidGoalError] | type[InvalidFeedbackError],
    ) -> Point:
        if self._outcome_dim is None:
            raise NotFittedError(
                f"{type(self).__name__} knows no demonstrations yet; call start(demonstrations) "
                "first"
            )
        return as_vector(
            values,
            self._outcome_dim,
            problem,
            name=name,
            size=f"the demonstrations' outcomes have {self._outcome_dim} components",
            remedy="void a trial nobody saw",
        )
