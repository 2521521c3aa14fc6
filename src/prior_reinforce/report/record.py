"""What a report tells of one goal: the goal, its trials, and what is known beside them.

Notation (docs/notation.md):
    g tilde  `goal`      (k,)  mostly [m], table frame
    r tilde  `landings`  (k,)  goal plus perceived error
    r        `outcomes`  (k,)  true outcome, known in simulation only
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.arrays import Point, as_goal
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.formats import OutcomeFormat, in_tolerances
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.session.trials import Stage, Trial, told_trials, trials_to_hit

Box = Float[np.ndarray, "2 k"]
"""Lower and upper corner of a region of outcomes."""


def drawn_scale(form: OutcomeFormat) -> float:
    """Number that turns outcomes into what is drawn: metres become centimetres."""
    return 100.0 if set(form.units) == {"m"} else 1.0


@dataclass(frozen=True)
class Film:
    """Where a film lies on disk."""

    video: Path
    """The mp4."""
    strip: Path
    """PNG of its key moments."""


@dataclass(frozen=True)
class CheckRow:
    """What the gate said in one check, of the plan that came nearest to its limit."""

    check: str
    """For instance `velocity`."""
    status: str
    """`pass`, `warn`, `refuse` or `unchecked`."""
    trial: int
    """Whose plan it was."""
    text: str
    """The gate's own line."""


@dataclass(frozen=True, eq=False)
class AdaptationRecord:
    """One goal and all its trials, ready to be reported."""

    demonstrations: Demonstrations
    """D_prior, what the generator was fitted to."""
    goal: Point
    """g tilde, in the outcomes' units."""
    tolerance: ArrayLike
    """epsilon, as `Session` takes it."""
    trials: tuple[Trial, ...]
    """All trials in order, voided and open ones too; one without a plan is not drawn over time."""
    title: str = ""
    """What to call this goal; `Goal` and its number where empty."""
    number: int | None = None
    """What number it goes by; its place in the report where None."""
    lines: Mapping[int, str] = field(default_factory=dict)
    """What became of the plan of trials that wait to be told, by the trial's number, where it was
    executed: `executed, but aborted: ...`."""
    warnings: Mapping[int, str] = field(default_factory=dict)
    """Why what was seen of a trial might mislead, by the trial's number: `but aborted: ...`."""
    outcomes: tuple[Point | None, ...] | None = None
    """True outcome of each trial where known; None as a whole on a real arm."""
    notes: tuple[str, ...] = ()
    """What else is known of this goal: when it was set, what was changed on the hardware, what was
    told otherwise first."""
    measured: Mapping[int, tuple[Float[np.ndarray, " T"], Float[np.ndarray, "T D"]]] = field(
        default_factory=dict
    )
    """Path that the arm took, by the trial's number: times in [s], columns in the plan's units."""
    photographs: tuple[tuple[str, Path], ...] = ()
    """Pictures of trials, PNG or JPEG, each with its caption."""
    checks: tuple[CheckRow, ...] = ()
    """What the gate said of the plans; empty where no robot is named."""
    film: Film | None = None
    """Film of a trial, usually of the one that reached the goal."""
    film_caption: str = ""
    """What the film shows; or, without a film, the one line that says why there is none."""

    def __post_init__(self) -> None:
        """Check that everything fits together.

        InvalidGoalError if the goal has a wrong shape, or is not finite; ConfigurationError if
        there are not as many outcomes as trials, or the tolerance is none.
        """
        object.__setattr__(self, "goal", as_goal(self.goal, self.format.names))
        if self.outcomes is not None and len(self.outcomes) != len(self.trials):
            raise ConfigurationError(
                f"{len(self.trials)} trials need as many true outcomes, got {len(self.outcomes)}; "
                "give None where one is not known"
            )

    @cached_property
    def format(self) -> OutcomeFormat:
        """What the outcomes' numbers mean, with the tolerance."""
        return self.demonstrations.outcome_format.within(self.tolerance)

    @property
    def told(self) -> tuple[Trial, ...]:
        """The trials that count, as in `told_trials`."""
        return told_trials(self.trials)

    @property
    def trials_to_hit(self) -> int | None:
        """Stage-2 trials up to and with the first hit; None while the goal is not reached."""
        return trials_to_hit(self.trials)

    @property
    def distance_unit(self) -> str:
        """Of distances from the goal: that of all components, or `tolerances` where they differ."""
        is_one = len({*self.format.tolerance}) == 1
        return (self.unit() if is_one else "") or "tolerances"

    @property
    def edge(self) -> float:
        """The greatest distance that counts as reached, in `distance_unit`."""
        return 1.0 if self.distance_unit == "tolerances" else self.format.tolerance[0] * self.scale

    def distance(self, error: Point) -> float:
        """How far an error is from the goal, in `distance_unit`."""
        return self.edge * in_tolerances(error, self.format.tolerance)

    def distance_seen(self, trial: Trial) -> float | None:
        """How far off a trial was seen to be, in `distance_unit`; None where nobody told."""
        reading = trial.reading
        return None if reading is None or reading.is_open else self.distance(reading.error_seen)

    @property
    def directions(self) -> frozenset[int]:
        """Numbers of trials whose landing stands for a direction alone: nobody said how far."""
        placed = zip(self.trials, self.landings, strict=True)
        return frozenset(
            trial.number
            for trial, landing in placed
            if landing is not None and not trial.hit and self.distance_seen(trial) is None
        )

    @property
    def landings(self) -> tuple[Point | None, ...]:
        """Perceived outcome r tilde of each trial; None unless told with more than "a miss".

        A hit that a coarse eye called further off than the tolerance was within it all the same,
        and is put at its edge; one of which nothing else was told, at the goal.
        """
        return tuple(self._landing(trial) for trial in self.trials)

    @property
    def true_outcomes(self) -> tuple[Point | None, ...]:
        """True outcome of each trial that counts; None where not known or not told."""
        outcomes = self.outcomes or (None,) * len(self.trials)
        return tuple(
            outcome if trial.stage is Stage.TOLD else None
            for trial, outcome in zip(self.trials, outcomes, strict=True)
        )

    @property
    def scale(self) -> float:
        """Number that turns the outcomes' unit into the one drawn: metres become centimetres."""
        return drawn_scale(self.format)

    def unit(self, *components: int) -> str:
        """Unit drawn for some components, or for distances over all; empty where they differ."""
        units = self.format.units
        drawn = {units[i] for i in components} or set(units)
        return "cm" if self.scale == 100 else drawn.pop() if len(drawn) == 1 else ""

    def _landing(self, trial: Trial) -> Point | None:
        if trial.reading is None or not trial.reading.has_number:
            return None
        error = trial.reading.error_seen
        off = in_tolerances(error, self.format.tolerance)
        return self.goal + error / (max(off, 1.0) if trial.hit else 1.0)
