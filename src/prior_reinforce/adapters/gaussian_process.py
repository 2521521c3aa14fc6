"""The paper's condition adapter: a Gaussian process from perceived outcomes to conditions."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Annotated, ClassVar

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.adapters.marginal_likelihood import maximise
from prior_reinforce.adapters.normalisation import Normalisation
from prior_reinforce.arrays import Point, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.settings import Checked, Positive

Jitter = Annotated[float, msgspec.Meta(ge=1e-6)]
"""alpha. Below 1e-6, the rounding of a kernel matrix of amplitude 1e5 comes near the diagonal term,
and the likelihood loses its fifth decimal."""
_CONVENTION_DISTANCE = 2.0
"""Distance from the demonstrations' mean of the added points c = r if they are too few, in their
spreads (ours): of 1, 1.5 and 2 the one that took fewest trials
(reproduction/docs/decisions-adapter.md)."""
_CONVENTION_ERROR = 0.02
"""Largest error of the first condition between demonstrations without added points, in their
spreads (ours): 3 mm where 0.25 m x 0.5 m can be reached."""


@dataclass(frozen=True)
class GaussianProcessConfig(Checked):
    """Settings of `GaussianProcessAdapter`; lengths in normalised units (see `Normalisation`).

    The paper asks for "a small diagonal regularization term" without a size. Ours has two sizes,
    because the two kinds of points have different errors. A trial has the error of perception. That
    a demonstration's condition equals its outcome is a convention; between demonstrations the
    generator deviates from it, by an amount that trials show: the mean square of c - r over those
    remembered. One size for both either chases noise or hardly moves
    (reproduction/docs/decisions-adapter.md has the figures).
    """

    memory_size: int | None = 2
    """m, number of latest trials kept beside all demonstrations; None keeps every trial."""
    trial_jitter: Jitter = 1e-3
    """alpha of the trials, added to the kernel's diagonal: 3 % of the demonstrations' spread,
    squared, which is 5 mm where 0.25 m x 0.5 m can be reached."""
    demonstration_jitter_bounds: tuple[Jitter, Jitter] = (1e-3, 0.3)
    """Least and greatest alpha of the demonstrations. The least is used before any trial: the first
    condition is then the goal to 0.2 mm inside their hull. The greatest (half of their spread,
    squared) keeps the demonstrations useful after one lost object."""
    amplitude_bounds: tuple[Positive, Positive] = (1e-5, 1e5)
    """Least and greatest kernel constant; scikit-learn's defaults."""
    length_scale_bounds: tuple[Positive, Positive] = (1e-5, 1e5)
    """Least and greatest length scale; scikit-learn's defaults."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: A setting is outside its range.
        """
        super().__post_init__()
        if self.memory_size is not None and self.memory_size < 1:
            raise ConfigurationError(
                f"memory_size must be at least 1 trial, got {self.memory_size}; "
                "None keeps all trials, and FrozenAdapter learns from none"
            )
        for name in ("demonstration_jitter_bounds", "amplitude_bounds", "length_scale_bounds"):
            low, high = getattr(self, name)
            if not low <= high:
                raise ConfigurationError(
                    f"{name} must be two numbers, the smaller first, got {(low, high)}"
                )


class GaussianProcessAdapter(Adapter):
    """Regression of conditions on perceived outcomes, refitted after every trial (paper, Stage 2).

    A constant x RBF kernel shared by all components, zero prior mean in normalised units, and the
    hyperparameters of greatest marginal likelihood, found exactly instead of by 50 restarts.

    Before any trial the fit is close to the identity: inside the hull of the demonstrations, the
    first condition is the goal to about a millimetre. Two or three demonstrations are not enough:
    a kernel that calls them unrelated is likelier than one that gives the identity, and the first
    condition would be up to half a metre off. If it is off between demonstrations, 2k points with
    c = r are added around their mean: that a condition is its outcome is a convention everywhere,
    and trials show how far it holds.

    Outside the hull, the correction seen in trials fades over a length scale, and beyond several of
    them a condition returns to the demonstrations' mean, which is the prior: goals there need
    demonstrations, not trials. The prior has no constant offset either (a moved table): a trial
    corrects near its own outcome only, and a far miss may be proposed again.

    After `start` and every `observe`, the fit can be read as in scikit-learn:
    `GaussianProcessRegressor(ConstantKernel() * RBF(), alpha=jitter_).fit(memory_outcomes_,
    memory_conditions_)` poses the same problem.
    """

    config_type: ClassVar[type[GaussianProcessConfig]] = GaussianProcessConfig

    log_marginal_likelihood_: float
    """log p(conditions | outcomes), summed over components; scikit-learn's
    `log_marginal_likelihood_value_`."""
    amplitude_: float
    """The kernel's constant; scikit-learn's `ConstantKernel.constant_value`."""
    length_scale_: float
    """Length scale in normalised units; scikit-learn's `RBF.length_scale`."""
    jitter_: Float[np.ndarray, " n"]
    """Diagonal term of each pair; scikit-learn's `alpha`."""
    memory_outcomes_: Points
    """Perceived outcomes in normalised units: demonstrations and points added to few of them, then
    trials by age."""
    memory_conditions_: Points
    """Their conditions in normalised units."""

    def __init__(self, config: GaussianProcessConfig | None = None) -> None:
        """Take the settings, or the defaults."""
        self.config = config or GaussianProcessConfig()

    def _start(self, demonstrations: Demonstrations) -> None:
        self._normalisation = Normalisation.of(demonstrations)
        self._demonstrated = demonstrations.outcomes_seen
        # Data forgetting (paper, Stage 2): only the latest m trials are kept, so that one corrupted
        # observation does not bias the adapter forever.
        self._trials: deque[tuple[Point, Point]] = deque(maxlen=self.config.memory_size)
        self._refit()
        if self._off_between_demonstrations():
            axes = _CONVENTION_DISTANCE * np.eye(demonstrations.outcome_dim)
            around = self._normalisation.undo(np.vstack([axes, -axes]))
            self._demonstrated = np.vstack([self._demonstrated, around])
            self._refit()

    def _observe(self, condition: Point, outcome_seen: Point) -> None:
        self._trials.append((condition, outcome_seen))
        self._refit()

    def _propose(self, goal_seen: Point) -> Point:
        """The posterior mean at the goal, a r(g)' (a R + diag(alpha))^-1 C."""
        goal = self._normalisation.apply(goal_seen)[None, :]
        mean = self._kernel(goal, self.memory_outcomes_) @ self._weights
        return self._normalisation.undo(mean[0])

    def _off_between_demonstrations(self) -> bool:
        """Whether the first condition is off between demonstrations, or there is only one."""
        r = self.memory_outcomes_
        if len(r) == 1:
            return True
        i, j = np.nonzero(~np.eye(len(r), dtype=bool))
        # Half-way between two points is not enough: symmetry makes the condition right there.
        goals = np.vstack([(1 - share) * r[i] + share * r[j] for share in (0.25, 0.5)])
        error = self._kernel(goals, r) @ self._weights - goals
        return bool(np.abs(error).max() > _CONVENTION_ERROR)

    def _refit(self) -> None:
        conditions, outcomes = (
            self._normalisation.apply(np.vstack([self._demonstrated, *trials]))
            for trials in ([c for c, _ in self._trials], [r for _, r in self._trials])
        )
        jitter = self._jitter(outcomes, conditions)
        self._kernel, self.log_marginal_likelihood_ = maximise(
            outcomes,
            conditions,
            jitter=jitter,
            amplitude_bounds=self.config.amplitude_bounds,
            length_scale_bounds=self.config.length_scale_bounds,
        )
        self._weights = self._kernel.weights(outcomes, conditions, jitter)
        self.amplitude_, self.length_scale_ = self._kernel.amplitude, self._kernel.length_scale
        self.jitter_, self.memory_outcomes_, self.memory_conditions_ = jitter, outcomes, conditions

    def _jitter(self, outcomes: Points, conditions: Points) -> Float[np.ndarray, " n"]:
        """Return alpha of every remembered pair, all in normalised units."""
        n_trials, n_demonstrations = len(self._trials), len(self._demonstrated)
        low, high = self.config.demonstration_jitter_bounds
        square = np.square(conditions - outcomes)[n_demonstrations:]
        jitter = np.clip(np.mean(square), low, high) if n_trials else low
        return np.repeat([jitter, self.config.trial_jitter], [n_demonstrations, n_trials])
