"""A Bayesian condition adapter with interval observations and the full history of trials.

Ours; the paper's adapter is in `gaussian_process`.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from prior_reinforce.adapters.base import Adapter, Expectation, State
from prior_reinforce.adapters.displaced_trials import DisplacedTrials
from prior_reinforce.adapters.displacement import BayesianConfig
from prior_reinforce.adapters.moved_trials import MovedTrials
from prior_reinforce.arrays import Point, Points
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading


class BayesianAdapter(Adapter):
    """Infers outcomes of plans from intervals and words, and proposes the best next condition.

    Demonstrations that carry a symmetry (`plans.symmetry`), one or more, are moved: the model is in
    `moved_trials` and `moved`. Without a symmetry plans are generated as learned: the model is in
    `displaced_trials`.

    64 trials are remembered; then the older of the two closest together is forgotten
    (`adapters.memory`). Proposals depend on the observations alone, not on earlier proposals.

    Source: ours, because words are intervals; taken as numbers, they bring an adapter to a halt.
    Constants: fields of our own tasks, of the zoo and of other people's arms; figures in
    reproduction/docs/decisions-adapter.md.
    """

    config_type: ClassVar[type[BayesianConfig]] = BayesianConfig
    carries_over: ClassVar[bool] = True
    _trials: DisplacedTrials | MovedTrials

    def __init__(self, config: BayesianConfig | None = None) -> None:
        """Take the settings, or the defaults."""
        self.config = config or BayesianConfig()

    @property
    def symmetry_odds(self) -> dict[str, float] | None:
        """Probabilities that the symmetry holds `as stated`, `the other way`, or not (`none`).

        None if the demonstrations state no symmetry.
        """
        return self._trials.odds

    @property
    def symmetry_doubted(self) -> bool:
        """Whether evidence contradicts the symmetry that the demonstrations state.

        It does if the symmetry more probably works the other way or not at all, if all outcomes
        seem shifted before a first goal was reached, or if objects are lost again and again. Then
        starting again with another axis costs a trial or two less than continuing.
        """
        return self._trials.doubted

    def _start(self, demonstrations: Demonstrations) -> None:
        trials = DisplacedTrials if demonstrations.symmetry is None else MovedTrials
        self._trials = trials(self.config, demonstrations)

    def _state(self) -> State:
        return self._trials.state()

    def _resume(self, state: State) -> None:
        self._trials.resume(state)

    def _change_hardware(self) -> None:
        self._trials.change_hardware()

    def _observe_reading(self, condition: Point, goal: Point, reading: Reading) -> None:
        self._trials.observe(condition, goal, reading)

    def _propose(self, goal_seen: Point) -> Point:
        return self._trials.propose(goal_seen)

    def _expect(self, condition: Point, goal: Point, tolerance: Point) -> Expectation:
        return self._trials.expect(condition, goal, tolerance)

    def p_hit(
        self, conditions: Points, goals: Points, tolerance: ArrayLike
    ) -> Float[np.ndarray, " n"]:
        """Return the probability that each condition's outcome is within the tolerance of its goal.

        Args:
            conditions: Shape (n, k), in the outcomes' units.
            goals: Shape (n, k).
            tolerance: Of each component, or one for all, in the outcomes' units.
        """
        radius = np.broadcast_to(np.asarray(tolerance, dtype=float), goals.shape[1])
        return self._trials.p_hit(conditions, goals, radius)

    def displacement(self, conditions: Points, *, hardware: bool = True) -> Points:
        """Return the expected displacement of outcomes from these conditions.

        Args:
            conditions: Shape (n, k), in the outcomes' units.
            hardware: Include changes since the day of the demonstrations; otherwise only errors of
                labels and generator.

        Returns:
            Outcome minus condition, shape (n, k), in the outcomes' units.
        """
        return self._trials.displacement(conditions, hardware=hardware)

    def gain(
        self, candidates: Points, over: Float[np.ndarray, "m k"], *, demonstrations: bool = False
    ) -> Float[np.ndarray, " n"]:
        """Return by what share a reading at each candidate would lower the variance elsewhere.

        Args:
            candidates: Conditions of possible trials, shape (n, k), in the outcomes' units.
            over: Conditions whose displacements are of interest, shape (m, k).
            demonstrations: Add demonstrations with these outcomes instead of trials; the generator
                then mixes differently, which can also raise the variance.

        Returns:
            Share of the mean variance over those conditions that is removed; of a trial exact for a
            number read to 0.1 spreads, about as fine as a word by eye.
        """
        return self._trials.gain(candidates, over, demonstrations=demonstrations)
