"""The generator, adapter and demonstrations that a session uses, loaded when first needed."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from msgspec.structs import replace

from prior_reinforce.adapters.base import Adapter, Expectation, next_key
from prior_reinforce.adapters.memory import REPEAT_DISTANCE
from prior_reinforce.arrays import Frames, Point
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidPlanError,
    OutOfReachError,
    RobotLimitError,
    WorkspaceError,
)
from prior_reinforce.formats import in_tolerances
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.reach import farthest_between, refusal
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Polar
from prior_reinforce.session.events import Asked
from prior_reinforce.session.trials import Goal, Log, SessionState, Verdict
from prior_reinforce.wording import say_place

_RIVAL = "rival"
"""Name of the model that is learned about the rival of the declared axis."""


def check_parts(generator: object, adapter: object, demonstrations: object) -> None:
    """Do nothing if each is an object of its kind, or a function that loads one.

    ConfigurationError for a class, a name, or two that are exchanged.
    """
    kinds = (
        (generator, Generator, "pr.make_generator({!r})"),
        (adapter, Adapter, "pr.make_adapter({!r})"),
        (demonstrations, Demonstrations, "pr.Demonstrations(plans, outcomes, format)"),
    )
    for given, kind, call in kinds:
        if isinstance(given, type):
            raise ConfigurationError(
                f"{given.__name__} is a class; give an object, for instance {given.__name__}()"
            )
        if not (isinstance(given, kind) or callable(given)):
            made = f": {call.format(given)}" * isinstance(given, str)
            raise ConfigurationError(f"{given!r:.60} is no {kind.__name__}; give one{made}")


class InUse:
    """Generator, adapter and demonstrations while the log names the same; loaded when needed."""

    def __init__(self, given: Any, names: tuple[str, ...]) -> None:
        self._given = given
        self.names = names
        """Of the model, of whatever else is loaded, and of the adapter."""

    @cached_property
    def generator(self) -> Generator:
        """The generator pi."""
        return _loaded(self._given[0])

    @cached_property
    def adapter(self) -> Adapter:
        """The adapter M."""
        return _loaded(self._given[1])

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations D_prior."""
        return _loaded(self._given[2])

    @cached_property
    def rival(self) -> InUse | None:
        """The same by the rival that the symmetry states, learned now; None where there is none."""
        declared = self.demonstrations.symmetry
        if declared is None or declared.rival is None:
            return None
        shown = self.demonstrations.with_symmetry(declared.rival)
        learned = copy.deepcopy(self.generator).fit(shown, seed=0)
        return InUse((learned, copy.deepcopy(self.adapter), shown), (_RIVAL, *self.names[1:]))

    def believed(self, state: SessionState, log: Log) -> InUse:
        """This, or its rival where trials speak against the symmetry; the adapter is informed."""
        doubted = self.informed(state, log).symmetry_doubted
        if not doubted or self.rival is None:
            return self
        self.rival.informed(state, log)
        return self.rival

    def load(self) -> tuple[Generator, Adapter]:
        """What a new trial needs."""
        return self.generator, self.adapter

    def informed(self, state: SessionState, log: Log) -> Adapter:
        """The adapter, after it was told all that counts for the goal of now.

        It goes on from what it knows, or from what the log kept of it, if that is the beginning of
        what it is to be told, and starts again if not: a trial may have been voided or amended, or
        another session have used the adapter.
        """
        adapter, told = self.adapter, list(_told(state, self.names[0]))
        shown = self.generator.with_symmetry_used(self.demonstrations)
        keys = [adapter.first_key(shown)]
        for what, arguments in told:
            keys.append(next_key(keys[-1], what, *arguments))
        if adapter.key not in keys:
            kept = log.kept_adapter()
            if kept is not None and kept.key in keys:
                adapter.resume(shown, kept)
            else:
                adapter.start(shown)
        for what, arguments in told[keys.index(adapter.key) :]:
            getattr(adapter, what)(*arguments)
        return adapter

    def _expected(self, state: SessionState, condition: Point) -> Expectation:
        """What the adapter expects of the next trial."""
        goal = latest_goal(state)
        return self.adapter.expect(condition, goal.goal, goal.tolerance)

    def _asked(
        self, state: SessionState, condition: Point, verdict: Verdict | None, limited: str = ""
    ) -> Asked:
        """The event of the next trial; `limited` says why it falls short of what was wanted."""
        expected = self._expected(state, condition)
        remarks = filter(None, (limited, self._remark(state, expected)))
        beyond = bool(limited) or (expected.beyond and not expected.nearer)
        return Asked(
            trial=len(state.trials) + 1,
            goal=latest_goal(state).number,
            condition=condition.tolist(),
            model=self.names[0],
            gate=None if verdict is None else verdict.as_json(),
            expected=replace(expected, remark="; ".join(remarks), beyond=beyond),
        )

    def _remark(self, state: SessionState, expected: Expectation) -> str:
        """What a person should know before a trial."""
        if expected.nearer:
            goal = latest_goal(state)
            n = [
                trial.number
                for trial in state.readings_for(goal, self.names[0])
                if trial.reading and trial.reading.lost
                if np.array_equal(state.goal_of(trial).goal, goal.goal)
            ][-1]
            return (
                f"kept nearer to the demonstration, since trial {n} was lost; void {n} if that was "
                "no fault of the motion"
            )
        return expected.remark or self._taken_back()

    def _taken_back(self) -> str:
        """What is said where the declared axis was left; nothing where it was not."""
        if self.names[0] != _RIVAL:
            return ""
        symmetry = self.demonstrations.symmetry
        assert symmetry is not None
        about = f" about {symmetry.chart.centre}" if isinstance(symmetry.chart, Polar) else ""
        return (
            "outcomes did not follow the symmetry that was declared: from now on its rival is used "
            f"({symmetry.name}{about}); declare that one"
        )

    def passing(
        self,
        state: SessionState,
        wanted: Point,
        plan: Frames,
        verdict_on: Callable[[Frames, Point, str], Verdict | None],
        *,
        may_repeat: bool,
    ) -> tuple[Asked, Frames, Any]:
        """The next trial, its plan and verdict: as wanted, or the last that passes towards that.

        OutOfReachError if plans do not reach the goal, and this one was tried and missed, unless it
        may be repeated; RobotLimitError if it does not pass, and the goal's own plan does not
        either, or the last that passes was tried and missed.
        """

        def check(plan: Frames, condition: Point) -> str:
            try:
                verdict_on(plan, condition, "")
            except RobotLimitError as error:
                return str(error)
            return ""

        goal, generator = latest_goal(state).goal, self.generator
        nearer = f"demonstrate nearer to {say_place(goal, self.demonstrations.outcome_format)}"
        try:
            verdict = verdict_on(plan, wanted, self._say_no_plan(state, wanted))
        except RobotLimitError as error:
            if np.array_equal(wanted, goal) or refusal(generator, goal, check):
                raise
            nearest = farthest_between(generator, goal, wanted, check)
            if n := _missed(state, nearest):
                said = f"{error.problem}; trial {n} went as far as passes, and missed: {nearer}"
                raise RobotLimitError(said) from error
            (plan,) = generator.generate(nearest[None])
            own = error.__cause__  # the verdict's
            assert isinstance(own, RobotLimitError)
            limited = f"moved only as far as passes, which may not do ({own.problem}); {nearer}"
            verdict = verdict_on(plan, nearest, self._say_no_plan(state, nearest))
            return self._asked(state, nearest, verdict, limited), plan, verdict
        if not may_repeat and (n := _missed(state, wanted)):
            expected = self._expected(state, wanted)
            if expected.beyond:
                raise OutOfReachError(f"trial {n} made the same plan and missed: {expected.remark}")
        return self._asked(state, wanted, verdict), plan, verdict

    def _say_no_plan(self, state: SessionState, condition: Point) -> str:
        """Say for which goal there is no plan, and whether it is simply too far."""
        goal = latest_goal(state).goal
        form = self.demonstrations.outcome_format
        place, at = (say_place(point, form) for point in (goal, condition))
        said = f"no plan for the goal {place}"
        if at != place:
            said += f", for which the plan would aim at {at}"
        if np.any(self.demonstrations.far_outside(goal)):
            said += ", which lies far outside the demonstrations (choose one nearer to them)"
        return said


def _told(state: SessionState, model: str) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """What an adapter is to be told for the goal of now: its methods, and their arguments."""
    goal, hardware = latest_goal(state), 0
    for trial in [*state.readings_for(goal, model), None]:
        about = goal if trial is None else state.goal_of(trial)
        for each in state.goals[hardware : about.number]:
            if each.new_hardware is not None:
                yield "change_hardware", ()
        hardware = max(hardware, about.number)
        if trial is not None:
            assert trial.reading is not None
            reading = trial.reading
            if reading.said and reading.hit is None and not trial.hit:
                reading = reading.with_hit(False)  # whoever watched it and names no hit saw a miss
            yield "observe", (trial.condition, about.goal, reading.within(about.tolerance))


def _missed(state: SessionState, condition: Point) -> int:
    """Number of a trial for the goal of now that made the same plan and was seen to miss, or 0."""
    tolerance = latest_goal(state).tolerance
    return next(
        (
            trial.number
            for trial in state.current
            if trial.reading is not None and trial.reading.has_number and not trial.hit
            if in_tolerances(trial.condition - condition, tolerance) < REPEAT_DISTANCE
        ),
        0,
    )


def latest_goal(state: SessionState) -> Goal:
    """The goal that is worked on; WorkspaceError if none is set."""
    if state.goal is None:
        raise WorkspaceError("no goal is set; set one (Session.set_goal, or: prior-reinforce goal)")
    return state.goal


def _loaded(given: Any) -> Any:
    """What was given, or what the loader that was given returns; a network is callable too."""
    return given() if callable(given) and not isinstance(given, (Generator, Adapter)) else given


def generated(generators: Sequence[Generator], conditions: Sequence[Point]) -> list[Frames]:
    """Return a plan for each condition, with one call of each generator.

    InvalidPlanError if a generator gives what is no number.
    """
    plans: dict[int, Frames] = {}
    for generator in {id(each): each for each in generators}.values():
        own = [i for i, each in enumerate(generators) if each is generator]
        made = generator.generate(np.stack([conditions[i] for i in own]))
        if not np.all(np.isfinite(made)):
            raise InvalidPlanError(
                "the generator gives plans that hold no numbers (nan or inf); learn again"
            )
        plans.update(zip(own, made, strict=True))
    return [plans[i] for i in range(len(generators))]
