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
    """Raise ConfigurationError unless each is an object of its kind, or a function that loads one.

    So for a class, a name, or exchanged arguments.
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


class Parts:
    """Generator, adapter and demonstrations of one name in the log, loaded when first needed."""

    def __init__(self, given: Any, names: tuple[str, ...]) -> None:
        self._given = given
        self.names = names
        """Names of the model, of whatever else is loaded, and of the adapter."""

    @cached_property
    def generator(self) -> Generator:
        """The generator pi."""
        return _load(self._given[0])

    @cached_property
    def adapter(self) -> Adapter:
        """The adapter M."""
        return _load(self._given[1])

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """The demonstrations D_prior."""
        return _load(self._given[2])

    @cached_property
    def rival(self) -> Parts | None:
        """Parts learned now with the rival of the declared symmetry; None if it has no rival."""
        declared = self.demonstrations.symmetry
        if declared is None or declared.rival is None:
            return None
        demonstrations = self.demonstrations.with_symmetry(declared.rival)
        generator = copy.deepcopy(self.generator).fit(demonstrations, seed=0)
        given = generator, copy.deepcopy(self.adapter), demonstrations
        return Parts(given, (_RIVAL, *self.names[1:]))

    def trusted(self, state: SessionState, log: Log) -> Parts:
        """Return these parts, or the rival if trials contradict the symmetry; update adapters."""
        if not self.update_adapter(state, log).symmetry_doubted or self.rival is None:
            return self
        self.rival.update_adapter(state, log)
        return self.rival

    def load(self) -> tuple[Generator, Adapter]:
        """Load what a new trial needs."""
        return self.generator, self.adapter

    def update_adapter(self, state: SessionState, log: Log) -> Adapter:
        """Return the adapter after all observations that count for the latest goal.

        It continues from its own state, or from the one in the log, if that follows from the first
        of these observations. Otherwise it starts again: a trial may have been voided or amended,
        or another session may have used the adapter.
        """
        adapter, calls = self.adapter, list(_adapter_calls(state, self.names[0]))
        demonstrations = self.generator.with_symmetry_used(self.demonstrations)
        keys = [adapter.first_key(demonstrations)]
        for method, arguments in calls:
            keys.append(next_key(keys[-1], method, *arguments))
        if adapter.key not in keys:
            kept = log.kept_adapter()
            if kept is not None and kept.key in keys:
                adapter.resume(demonstrations, kept)
            else:
                adapter.start(demonstrations)
        for method, arguments in calls[keys.index(adapter.key) :]:
            getattr(adapter, method)(*arguments)
        return adapter

    def _expect(self, state: SessionState, condition: Point) -> Expectation:
        """Prediction of the next trial by the adapter."""
        goal = latest_goal(state)
        return self.adapter.expect(condition, goal.goal, goal.tolerance)

    def _asked_event(
        self, state: SessionState, condition: Point, verdict: Verdict | None, limited: str = ""
    ) -> Asked:
        """Event of the next trial; `limited` says why its plan falls short of the wanted one."""
        expected = self._expect(state, condition)
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
        """What a person should know before the next trial."""
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
        return expected.remark or self._rival_remark()

    def _rival_remark(self) -> str:
        """Say that the rival of the declared symmetry is used, if it is."""
        if self.names[0] != _RIVAL:
            return ""
        symmetry = self.demonstrations.symmetry
        assert symmetry is not None
        about = f" about {symmetry.chart.centre}" if isinstance(symmetry.chart, Polar) else ""
        return (
            "outcomes did not follow the symmetry that was declared: from now on its rival is used "
            f"({symmetry.name}{about}); declare that one"
        )

    def next_trial(
        self,
        state: SessionState,
        wanted: Point,
        plan: Frames,
        verdict_on: Callable[[Frames, Point, str], Verdict | None],
        *,
        may_repeat: bool,
    ) -> tuple[Asked, Frames, Any]:
        """Return the next trial, its plan and verdict: of the wanted condition, if its plan passes.

        Else of the farthest condition from the goal towards the wanted one whose plan passes.
        OutOfReachError if plans do not reach the goal, and this one was tried and missed, unless it
        may be repeated; RobotLimitError if no plan passes, not even that for the goal as condition,
        or if the farthest one that passes was tried and missed.
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
            verdict = verdict_on(plan, wanted, self._refusal(state, wanted))
        except RobotLimitError as error:
            if np.array_equal(wanted, goal) or refusal(generator, goal, check):
                raise
            passing = farthest_between(generator, goal, wanted, check)
            if n := _miss_of_same_plan(state, passing):
                problem = f"{error.problem}; trial {n} went as far as passes, and missed: {nearer}"
                raise RobotLimitError(problem) from error
            (plan,) = generator.generate(passing[None])
            cause = error.__cause__  # raised by the verdict
            assert isinstance(cause, RobotLimitError)
            limited = f"moved only as far as passes, which may not do ({cause.problem}); {nearer}"
            verdict = verdict_on(plan, passing, self._refusal(state, passing))
            return self._asked_event(state, passing, verdict, limited), plan, verdict
        if not may_repeat and (n := _miss_of_same_plan(state, wanted)):
            expected = self._expect(state, wanted)
            if expected.beyond:
                raise OutOfReachError(f"trial {n} made the same plan and missed: {expected.remark}")
        return self._asked_event(state, wanted, verdict), plan, verdict

    def _refusal(self, state: SessionState, condition: Point) -> str:
        """Say for which goal there is no plan, and whether it is far from the demonstrations."""
        goal = latest_goal(state).goal
        form = self.demonstrations.outcome_format
        place, at = (say_place(point, form) for point in (goal, condition))
        text = f"no plan for the goal {place}"
        if at != place:
            text += f", for which the plan would aim at {at}"
        if np.any(self.demonstrations.far_outside(goal)):
            text += ", which lies far outside the demonstrations (choose one nearer to them)"
        return text


def _adapter_calls(state: SessionState, model: str) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Calls of the adapter's methods, with arguments, that count for the latest goal."""
    goal, n_announced = latest_goal(state), 0
    for trial in [*state.readings_for(goal, model), None]:
        of_trial = goal if trial is None else state.goal_of(trial)
        for each in state.goals[n_announced : of_trial.number]:
            if each.new_hardware is not None:
                yield "change_hardware", ()
        n_announced = max(n_announced, of_trial.number)
        if trial is not None:
            assert trial.reading is not None
            reading = trial.reading
            if reading.said and reading.hit is None and not trial.hit:
                reading = reading.with_hit(False)  # whoever watched it and names no hit saw a miss
            yield "observe", (trial.condition, of_trial.goal, reading.within(of_trial.tolerance))


def _miss_of_same_plan(state: SessionState, condition: Point) -> int:
    """Number of a trial for the latest goal that missed with the same plan, or 0."""
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
    """Return the latest goal; WorkspaceError if none is set."""
    if state.goal is None:
        raise WorkspaceError("no goal is set; set one (Session.set_goal, or: prior-reinforce goal)")
    return state.goal


def _load(given: Any) -> Any:
    """Return an object, or what its loader returns; a network is callable and no loader."""
    return given() if callable(given) and not isinstance(given, (Generator, Adapter)) else given


def generate_plans(generators: Sequence[Generator], conditions: Sequence[Point]) -> list[Frames]:
    """Return a plan for each condition, with one call of each generator.

    InvalidPlanError if a plan has numbers that are not finite.
    """
    plans: dict[int, Frames] = {}
    for generator in {id(each): each for each in generators}.values():
        own = [i for i, each in enumerate(generators) if each is generator]
        new = generator.generate(np.stack([conditions[i] for i in own]))
        if not np.all(np.isfinite(new)):
            raise InvalidPlanError(
                "the generator gives plans that hold no numbers (nan or inf); learn again"
            )
        plans.update(zip(own, new, strict=True))
    return [plans[i] for i in range(len(generators))]
