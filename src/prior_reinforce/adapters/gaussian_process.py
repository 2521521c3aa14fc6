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
"""How far from the demonstrations' mean c = r is added where they are too few, in their spreads
(ours): of 1, 1.5 and 2 the one that took fewest trials (reproduction/docs/decisions-adapter.md)."""
_CONVENTION_ERROR = 0.02
"""By how much the first condition may miss a goal between demonstrations before that is done, in
their spreads (ours): 3 mm where 0.25 m x 0.5 m can be reached."""


@dataclass(frozen=True)
class GaussianProcessConfig(Checked):
    """Settings of `GaussianProcessAdapter`; lengths in normalised units (see `Normalisation`).

    The paper asks for "a small diagonal regularization term" without a size. Ours has two sizes,
    because the two kinds of point are wrong by different amounts. A trial is wrong by what
    perception adds, and tells what is true where it landed. That a demonstration's condition equals
    its outcome is a convention; between the demonstrations the generator strays from it, and by how
    much is what trials show: the mean square of c - r over those remembered. One size for both
    either chases noise or hardly moves (reproduction/docs/decisions-adapter.md has the figures).
    """

    memory_size: int | None = 2
    """m, the number of latest trials kept beside all demonstrations; None keeps every trial."""
    trial_jitter: Jitter = 1e-3
    """alpha of the trials, added to the kernel's diagonal: 3 % of the demonstrations' spread,
    squared, which is 5 mm where 0.25 m x 0.5 m can be reached."""
    demonstration_jitter_bounds: tuple[Jitter, Jitter] = (1e-3, 0.3)
    """Least and greatest alpha of the demonstrations. The least is used before any trial, and makes
    the first condition the goal to 0.2 mm inside their hull; the greatest (half of their spread,
    squared) keeps one lost object from making the demonstrations worthless."""
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

    With nothing but demonstrations the fit is close to the identity: inside their hull, the first
    condition is the goal to about a millimetre. That takes enough of them: of two or three points,
    a kernel that calls them unrelated is likelier than one that sees the identity, and the first
    condition would be up to half a metre off. So where it is off between demonstrations, they are
    joined by 2k points around their mean at which c = r as well: that a condition is its outcome is
    a convention everywhere, and trials show how far it holds.

    Outside, the correction seen in trials fades over a length scale, and beyond several of them a
    condition returns to the demonstrations' mean, which is the prior: goals there need
    demonstrations, not trials. An offset that is the same everywhere (a moved table) is not in this
    prior either: a trial corrects near its own outcome only, and a far miss may be asked for again.

    After `start` and every `observe`, what was fitted can be read as in scikit-learn:
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
    """What is added to the diagonal; scikit-learn's `alpha`."""
    memory_outcomes_: Points
    """Perceived outcomes in normalised units: demonstrations and what joins them where they are
    few, then trials by age."""
    memory_conditions_: Points
    """Their conditions in normalised units."""

    def __init__(self, config: GaussianProcessConfig | None = None) -> None:
        """Take the settings, or the defaults."""
        self.config = config or GaussianProcessConfig()

    def _start(self, demonstrations: Demonstrations) -> None:
        self._normalisation = Normalisation.of(demonstrations)
        self._demonstrated = demonstrations.outcomes_seen
        # Data forgetting (paper, Stage 2): the latest m trials only, so that one corrupted
        # observation does not bias the adapter for good.
        self._trials: deque[tuple[Point, Point]] = deque(maxlen=self.config.memory_size)
        self._refit()
        if self._strays_between_demonstrations():
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

    def _strays_between_demonstrations(self) -> bool:
        """Whether the first condition is off on the way from one of them to another.

        Of a single one it is: there is no other.
        """
        own = self.memory_outcomes_
        if len(own) == 1:
            return True
        i, j = np.nonzero(~np.eye(len(own), dtype=bool))
        # Half-way alone says nothing of two points: there symmetry makes it right.
        goals = np.vstack([(1 - share) * own[i] + share * own[j] for share in (0.25, 0.5)])
        off = self._kernel(goals, own) @ self._weights - goals
        return bool(np.abs(off).max() > _CONVENTION_ERROR)

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
        strayed = np.square(conditions - outcomes)[n_demonstrations:]
        of_demonstrations = np.clip(np.mean(strayed), low, high) if n_trials else low
        return np.repeat(
            [of_demonstrations, self.config.trial_jitter], [n_demonstrations, n_trials]
        )
