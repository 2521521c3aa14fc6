"""What a report tells of one goal: the goal, its trials, and what is known beside them.

Notation (docs/notation.md):
    g tilde  `goal`      (k,)  mostly [m], table frame
    r tilde  `landings`  (k,)  goal plus perceived error
    r        `outcomes`  (k,)  true outcome, known in simulation only
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from prior_reinforce.errors import ConfigurationError, InvalidGoalError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.report.film import Film
from prior_reinforce.session import Session
from prior_reinforce.trials import Stage, Trial
from prior_reinforce.wording import WORDS


@dataclass(frozen=True, eq=False)
class AdaptationRecord:
    """One goal and all its trials, ready to be reported."""

    demonstrations: Demonstrations
    """D_prior, what the generator was fitted to."""
    goal: np.ndarray
    """g tilde, shape (k,), in the outcomes' units."""
    tolerance: float
    """epsilon, in the same units."""
    trials: tuple[Trial, ...]
    """All trials in order, voided and pending ones too."""
    title: str = ""
    """What to call this goal; `Goal 1`, `Goal 2`, ... where empty."""
    outcomes: tuple[np.ndarray | None, ...] | None = None
    """True outcome of each trial, shape (k,), where known; None as a whole on a real arm."""
    film: Film | None = None
    """Film of a trial, usually of the one that reached the goal."""
    film_caption: str = ""
    """What the film shows; or, without a film, the one line that says why there is none."""

    def __post_init__(self) -> None:
        """Copy the arrays and check that everything fits together.

        Raises:
            InvalidGoalError: The goal has a wrong shape, or is not finite.
            ConfigurationError: As many outcomes as trials are needed, each of shape (k,).
        """
        goal = np.array(self.goal, dtype=float)
        if goal.shape != (self.outcome_dim,) or not np.all(np.isfinite(goal)):
            raise InvalidGoalError(
                f"a goal must be {self.outcome_dim} finite numbers, as the demonstrations' "
                f"outcomes, got {goal.tolist()}"
            )
        object.__setattr__(self, "goal", goal)
        object.__setattr__(self, "trials", tuple(self.trials))
        if self.outcomes is None:
            return
        outcomes = tuple(None if r is None else np.array(r, dtype=float) for r in self.outcomes)
        if len(outcomes) != len(self.trials):
            raise ConfigurationError(
                f"{len(self.trials)} trials need as many true outcomes, got {len(outcomes)}; "
                "give None where one is not known"
            )
        for trial, outcome in zip(self.trials, outcomes, strict=True):
            if outcome is None:
                continue
            if outcome.shape != goal.shape or not np.all(np.isfinite(outcome)):
                raise ConfigurationError(
                    f"true outcome of trial {trial.number} must be {goal.size} finite numbers, "
                    f"got {outcome.tolist()}; give None where it is not known"
                )
        object.__setattr__(self, "outcomes", outcomes)

    @classmethod
    def from_session(
        cls,
        session: Session,
        *,
        title: str = "",
        outcomes: tuple[np.ndarray | None, ...] | None = None,
        film: Film | None = None,
        film_caption: str = "",
    ) -> AdaptationRecord:
        """Take down how a session stands now."""
        return cls(
            demonstrations=session.demonstrations,
            goal=session.goal,
            tolerance=session.tolerance,
            trials=session.trials,
            title=title,
            outcomes=outcomes,
            film=film,
            film_caption=film_caption,
        )

    @property
    def outcome_dim(self) -> int:
        """k, the number of components of an outcome."""
        return self.demonstrations.outcome_dim

    @property
    def in_metres(self) -> bool:
        """Whether all components are lengths, so that centimetres can be shown."""
        return all(unit == "m" for unit in self.demonstrations.outcome_units)

    @property
    def in_words(self) -> bool:
        """Whether the words of `feedback` (long, left, high) describe these outcomes."""
        return self.in_metres and self.outcome_dim <= len(WORDS)

    @property
    def landings(self) -> tuple[np.ndarray | None, ...]:
        """Perceived outcome r tilde of each trial, shape (k,); None unless told.

        A hit that a coarse eye called further off than the tolerance was within it all the same,
        and is put at its edge.
        """
        return tuple(
            None if trial.error_seen is None else self.goal + self._error_drawn(trial)
            for trial in self.trials
        )

    def _error_drawn(self, trial: Trial) -> np.ndarray:
        error = np.asarray(trial.error_seen)
        distance = np.linalg.norm(error)
        if not trial.hit or distance <= self.tolerance:
            return error
        return error * (self.tolerance / distance)

    @property
    def true_outcomes(self) -> tuple[np.ndarray | None, ...]:
        """True outcome of each trial that counts, shape (k,); None where not known or voided."""
        if self.outcomes is None:
            return (None,) * len(self.trials)
        return tuple(
            outcome if trial.stage is Stage.TOLD else None
            for trial, outcome in zip(self.trials, self.outcomes, strict=True)
        )

    @property
    def trials_to_hit(self) -> int | None:
        """Stage-2 trials up to and with the first hit; None while the goal is not reached.

        Voided trials are not counted (paper, Evaluation Protocol: N counts trials to first reach).
        """
        told = [trial for trial in self.trials if trial.stage is Stage.TOLD]
        for count, trial in enumerate(told, start=1):
            if trial.hit:
                return count
        return None

    @property
    def n_told(self) -> int:
        """Trials that count so far."""
        return sum(trial.stage is Stage.TOLD for trial in self.trials)
