"""The forward noising process of diffusion, and the steps that undo it.

Notation (Ho et al. 2020, "Denoising Diffusion Probabilistic Models"): step t counts 0 ... T-1,
x_t = sqrt(abar_t) x_0 + sqrt(1 - abar_t) eps, and abar_{-1} = 1 is the clean sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from jaxtyping import Float, Int
from typing_extensions import assert_never

from prior_reinforce.generators.network.config import Prediction
from prior_reinforce.generators.network.threads import torch

# Nichol and Dhariwal 2021, "Improved Denoising Diffusion Probabilistic Models", section 3.2.
_COSINE_OFFSET = 0.008
_LARGEST_BETA = 0.999

Codes = Float[torch.Tensor, "B C T"]
Steps = Int[torch.Tensor, " B"]
"""t of each sample of a batch."""


@dataclass(frozen=True, eq=False)
class NoiseSchedule:
    """How much of the sample is left at every step."""

    signal: Float[torch.Tensor, " T"]
    """abar_t, the share of the variance that is signal, float64, falling."""

    @classmethod
    def squared_cosine(cls, n_steps: int) -> NoiseSchedule:
        """The schedule that Diffusion Policy calls `squaredcos_cap_v2`.

        abar_t is the product of 1 - beta_i over i <= t, with
        beta_i = min(1 - f(i + 1) / f(i), 0.999) and f(i) = cos^2((i / T + 0.008) / 1.008 * pi / 2).
        """
        time = torch.arange(n_steps + 1, dtype=torch.float64) / n_steps
        f = torch.cos((time + _COSINE_OFFSET) / (1 + _COSINE_OFFSET) * math.pi / 2) ** 2
        beta = torch.clamp(1 - f[1:] / f[:-1], max=_LARGEST_BETA)
        return cls(signal=torch.cumprod(1 - beta, dim=0))

    @property
    def n_steps(self) -> int:
        """T, the number of noise levels."""
        return self.signal.shape[0]

    def signal_at(self, step: int) -> float:
        """Return abar of one step; 1 for the clean sample, step -1."""
        return 1.0 if step < 0 else float(self.signal[step])

    def add_noise(self, clean: Codes, noise: Codes, steps: Steps) -> Codes:
        """Return x_t for clean samples x_0 and unit noise eps."""
        keep, add = self._mix(steps, clean)
        return keep * clean + add * noise

    def target(self, clean: Codes, noise: Codes, steps: Steps, prediction: Prediction) -> Codes:
        """Return what the network has to predict at x_t."""
        if prediction == "epsilon":
            return noise
        if prediction == "sample":
            return clean
        if prediction == "v":
            keep, add = self._mix(steps, clean)
            return keep * noise - add * clean
        assert_never(prediction)

    def clean_estimate(
        self, noisy: Codes, predicted: Codes, step: int, prediction: Prediction
    ) -> Codes:
        """Return the estimate of x_0 that a prediction at x_t amounts to, at one t for all."""
        if prediction == "sample":
            return predicted
        signal = self.signal_at(step)
        keep, add = math.sqrt(signal), math.sqrt(1 - signal)
        if prediction == "v":
            return keep * noisy - add * predicted
        if prediction == "epsilon":
            return (noisy - add * predicted) / keep
        assert_never(prediction)

    def ddpm_step(
        self, noisy: Codes, clean: Codes, step: int, noise: Float[torch.Tensor, "#B C T"]
    ) -> Codes:
        """Draw x_{t-1} given x_t and the (clipped) estimate of x_0 (Ho et al., equations 6 and 7).

        The variance is the posterior's ("fixed small"); the last step, t = 0, adds none. The unit
        Gaussian noise may be one for all.
        """
        signal, previous = self.signal_at(step), self.signal_at(step - 1)
        alpha = signal / previous
        beta = 1 - alpha
        mean = (
            math.sqrt(previous) * beta / (1 - signal) * clean
            + math.sqrt(alpha) * (1 - previous) / (1 - signal) * noisy
        )
        if step == 0:
            return mean
        return mean + math.sqrt(beta * (1 - previous) / (1 - signal)) * noise

    def _mix(
        self, steps: Steps, like: Codes
    ) -> tuple[Float[torch.Tensor, "B 1 1"], Float[torch.Tensor, "B 1 1"]]:
        signal = self.signal.to(steps.device)[steps].view(-1, 1, 1)
        return signal.sqrt().to(like.dtype), (1 - signal).sqrt().to(like.dtype)


def mean_shift_levels(n_training_steps: int, n_levels: int) -> tuple[int, ...]:
    """The noise levels of annealed mean shift, falling from 95 % of T, denser towards 0.

    Ours: a level's own spread is what the estimate can resolve, so the last one has to be low; the
    first ones only choose among modes.
    """
    fractions = [(i / n_levels) ** 2 for i in range(n_levels, 0, -1)]
    return tuple(int(0.95 * f * n_training_steps) for f in fractions)
