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
"""Version of what `state` gives, part of the key, so that states kept before are not resumed."""
_Arrays = TypeVar("_Arrays")


class Expectation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What is expected of a trial before it is executed; empty where nothing is."""

    p_hit: float | None = None
    """Probability that it reaches the goal."""
    trials: float | None = None
    """Trials until the goal is reached, this one included; None if nobody knows."""
    error: tuple[float, ...] | None = None
    """Expected error, outcome minus goal, k numbers in the outcomes' units, or an array of them;
    None if unknown."""
    sd: tuple[float, ...] | None = None
    """Its standard deviation, likewise."""
    remark: str = ""
    """What a person should know beforehand, in one line, such as that a symmetry does not hold."""
    nearer: bool = False
    """Whether the plan is moved less far than readings say, because an object was lost."""
    beyond: bool = False
    """Whether no plan may be moved so far that it reaches the goal."""

    @property
    def large_error(self) -> Point:
        """How large an error may well be, (k,): two standard deviations; 0 if nothing is known."""
        if self.error is None or self.sd is None:
            return np.zeros(1)
        return np.asarray(np.abs(self.error) + 2.0 * np.array(self.sd))

    def __post_init__(self) -> None:
        """Keep plain numbers of whatever arrays were given, since journals write them down."""
        for name in ("p_hit", "trials", "error", "sd"):
            if (given := getattr(self, name)) is not None:
                plain = np.asarray(given, np.float64).tolist()
                value = tuple(plain) if isinstance(plain, list) else plain
                msgspec.structs.force_setattr(self, name, value)


@dataclass(frozen=True, eq=False)
class State:
    """What an adapter knows, as data that can be kept in a file: no code in it."""

    facts: dict[str, Any]
    """Of JSON types."""
    arrays: dict[str, np.ndarray]
    """Of numbers."""
    key: str = ""
    """`Adapter.key`, which `Adapter.state` adds to what a member says."""

    def build(self, kind: type[_Arrays]) -> _Arrays:
        """Make an object that is nothing but arrays of its fields' names."""
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
            told = json.loads(str(arrays.pop("facts")))
            return cls(told["facts"], arrays, told["key"])


def next_key(
    key: str,
    what: str,
    condition: Point | None = None,
    goal: Point | None = None,
    reading: Reading | None = None,
) -> str:
    """Return `Adapter.key` after one thing more was told.

    Args:
        key: Before.
        what: `observe` or `change_hardware`.
        condition: c, where it is about a trial.
        goal: g, likewise.
        reading: As it was observed.
    """
    digest = hashlib.sha256(f"{key} {what}".encode())
    told = [condition, goal]
    if reading is not None:
        told += [reading.error_seen, reading.low, reading.high, reading.sd]
        told += [reading.missed_by_at_least]
        digest.update(repr((reading.hit, reading.lost)).encode())
    for values in told:
        digest.update(b"-" if values is None else np.asarray(values, np.float64).tobytes())
    return digest.hexdigest()


class Adapter(ABC):
    """A condition adapter, correcting what the generator is asked for from trial to trial.

    It only ever receives perceived outcomes. It has no notion of a trial's number: to forget an
    amended or voided trial, the session starts it afresh and observes again (at most a dozen).

    The checks stand here; a member implements `_start`, `_propose` and `_observe`, or
    `_observe_reading`, which receive fresh, finite vectors of the right length, and only after
    `start`.
    """

    carries_over: ClassVar[bool] = False
    """Whether trials of earlier goals serve it, so that a session gives it those unless told
    otherwise."""
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
        what = type(self).__qualname__, version, getattr(self, "config", None)
        return next_key("", f"{what} {demonstrations.sha256}")

    @property
    def key(self) -> str:
        """Digest of version, settings, demonstrations, and all that it was told since its start.

        Adapters with one key propose the same; empty before `start`, and where telling was cut off,
        so that nobody knows what it knows. `first_key` and `next_key` say what it would be.
        """
        return self._key

    def state(self) -> State | None:
        """Return what `resume` needs, so that no trial need be told again; None where few do.

        Raises:
            NotFittedError: Before `start`.
        """
        if self._outcome_dim is None:
            raise NotFittedError(f"{type(self).__name__} knows nothing yet; call start first")
        state = self._state()
        return None if state is None else replace(state, key=self._key)

    def resume(self, demonstrations: Demonstrations, state: State) -> None:
        """Begin with what `state` returned of an adapter with the same settings.

        Args:
            demonstrations: Those that it was started with.
            state: Its `state`.
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
        """Take in one trial: what was perceived of outcome minus goal for this condition.

        Args:
            condition: c. Copied.
            goal: g, which the reading is about. Copied.
            reading: What was perceived; an array is a number of unknown origin.

        Raises:
            NotFittedError: Before `start`.
            InvalidFeedbackError: Wrong shape, or not finite.
        """
        checked = self._checked(condition, "condition", InvalidFeedbackError)
        about = self._checked(goal, "goal", InvalidFeedbackError)
        seen = reading.error_seen if isinstance(reading, Reading) else reading
        error = self._checked(seen, "perceived error", InvalidFeedbackError)
        if not isinstance(reading, Reading):
            reading = Reading.estimated(error)
        key, self._key = next_key(self._key, "observe", checked, about, reading), ""
        self._observe_reading(checked, about, reading)
        self._key = key

    @property
    def symmetry_doubted(self) -> bool:
        """Whether trials have left the symmetry that the demonstrations state, if they do."""
        return False

    def expect(self, condition: ArrayLike, goal: ArrayLike, tolerance: ArrayLike) -> Expectation:
        """Return what is expected of a trial; an empty one from adapters that expect nothing.

        Args:
            condition: c, mostly what was proposed.
            goal: g.
            tolerance: epsilon of each component, or one for all, in the outcomes' units.

        Raises:
            NotFittedError: Before `start`.
            InvalidGoalError: Wrong shape, or not finite.
            ConfigurationError: An adapter of one's own returned something else.
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
        """Take note that the hardware changes between the trials before and those to come.

        Most tell no difference between what was learned and what has changed.
        """
        key, self._key = next_key(self._key, "change_hardware"), ""
        self._change_hardware()
        self._key = key

    @abstractmethod
    def _start(self, demonstrations: Demonstrations) -> None:
        """See `start`."""

    @abstractmethod
    def _propose(self, goal_seen: Point) -> Point:
        """See `propose`; the goal may be returned itself."""

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        """Take in one trial as a number: the perceived outcome r = g + e; both may be kept."""
        raise NotImplementedError(
            f"{type(self).__name__} takes in no trials: write _observe, or _observe_reading"
        )

    def _observe_reading(self, condition: Point, goal: Point, reading: Reading) -> None:
        """See `observe`; for adapters that know what to do with more than a number.

        Others get the number, and are not called for a trial without one (a bare "a miss").
        """
        if reading.has_number:
            self._observe(condition, goal + reading.error_seen)

    def _change_hardware(self) -> None:  # noqa: B027  # most know no difference
        """See `change_hardware`."""

    def _state(self) -> State | None:
        """See `state`; for adapters to which it takes long to be told."""
        return None

    def _resume(self, state: State) -> None:
        """See `resume`; the adapter was started."""
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
