"""The denoising network, trained on a handful of codes, and three ways to run it.

The adapter needs the same plan for the same condition, and near plans for near conditions. So
noise comes from the fit's seed and is shared by all conditions. With `shared_noise=False` each has
its own, as where plans are sampled at random; still the same condition has the same plan.

Notation:
    B  batch    C  numbers of a code at one position    T  positions    n  conditions    k  outcome
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from jaxtyping import Float, Int

from prior_reinforce.generators.config import DiffusionConfig
from prior_reinforce.generators.noise_schedule import NoiseSchedule, mean_shift_levels
from prior_reinforce.generators.threads import torch

_SLACK = 0.5
"""How far coordinates in the demonstrations' span may leave their range, as a fraction of half of
it; plans keep to the margin besides. Ours: at the ends of the region a straight line leaves it by a
third."""
_BEYOND = 0.5
"""How far weights of a mixture go beyond a convex one, so that ends of the region are learned, too.
Ours: 0.3 hits fewer first throws."""
_DDIM_STEPS, _POLISHED = 20, (0.23, 0.1)
"""Of DDIM, down to the first level of mean shift after it, parts of T. Ours: 3.6 trials a goal of
`zoo-sidearm`, one set, tuning goals; 5.1 with DDPM."""
_PURE = 0.1
"""Share of samples that are demonstrations as they are. Ours."""

Denoise = Callable[[torch.Tensor, torch.Tensor, torch.Tensor], torch.Tensor]
"""A network: noisy codes (B, C, T), levels (B,) and conditions (B, k) to a prediction."""


def loss(
    network: Denoise,
    codes: Float[torch.Tensor, "N C T"],
    conditions: Float[torch.Tensor, "N k"],
    config: DiffusionConfig,
    rng: torch.Generator,
) -> Callable[[], torch.Tensor]:
    """Return what draws a batch and tells how far the network is off, mean square.

    Args:
        network: Of one member, or of several, each with a prediction of its own.
        codes: x_0 of the demonstrations, on the network's device.
        conditions: Scaled outcomes, on the same device.
        config: Batch, noise levels and what is predicted.
        rng: Source of noise and noise levels.
    """
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    alike = None
    if config.mixtures:
        alike = torch.cdist(codes.flatten(1), codes.flatten(1)).argsort(dim=1)[:, : config.mixtures]

    def loss_of_step() -> torch.Tensor:
        rows, levels = draw_batch(len(codes), config, rng)
        noise = torch.randn((len(rows), *codes.shape[1:]), generator=rng).to(codes.device)
        rows, levels = rows.to(codes.device), levels.to(codes.device)
        clean, given = codes[rows], conditions[rows]
        if alike is not None:
            clean, given = mixed(codes, conditions, alike[rows], rng)
        noisy = schedule.add_noise(clean, noise, levels)
        target = schedule.target(clean, noise, levels, config.prediction)
        errors = network(noisy, levels, given) - target  # of each member, if several
        return errors.square().mean()

    return loss_of_step


def draw_batch(
    n: int, config: DiffusionConfig, rng: torch.Generator
) -> tuple[Int[torch.Tensor, " B"], Int[torch.Tensor, " B"]]:
    """Draw which demonstrations and which noise levels make a batch.

    Returns:
        Rows in 0 ... N-1, each as often as any other to within one, and levels.
    """
    size = config.batch_size if config.fill_batch else min(config.batch_size, n)
    passes = math.ceil(size / n)
    rows = torch.cat([torch.randperm(n, generator=rng) for _ in range(passes)])[:size]
    if not config.stratified:
        return rows, torch.randint(config.noise_levels, (size,), generator=rng)
    strata = torch.randperm(size, generator=rng)
    position = (strata + torch.rand(size, generator=rng)) / size
    return rows, (position * config.noise_levels).long().clamp(max=config.noise_levels - 1)


def mixed(
    codes: Float[torch.Tensor, "N C T"],
    conditions: Float[torch.Tensor, "N k"],
    alike: Int[torch.Tensor, "B m"],
    rng: torch.Generator,
) -> tuple[Float[torch.Tensor, "B C T"], Float[torch.Tensor, "B k"]]:
    """Mix demonstrations that move alike, and their outcomes in the same way [Zhang2018, "mixup"].

    A network that has seen one demonstration at each outcome tells ways apart by the outcome, and
    mixes them in between. With mixtures within each way it sees both ways over the whole region:
    which one is generated is then decided by the noise. Ours in that only neighbours are mixed.

    Args:
        codes: Of the demonstrations.
        conditions: Their scaled outcomes.
        alike: Which are mixed in each sample; the first is its own.
        rng: Source of the weights: a flat Dirichlet distribution, widened by `_BEYOND`.
    """
    drawn = -torch.rand(alike.shape, generator=rng).clamp(min=1e-9).log()
    weights = (1 + _BEYOND) * drawn / drawn.sum(dim=1, keepdim=True) - _BEYOND / alike.shape[1]
    pure = torch.rand(len(alike), generator=rng) < _PURE
    weights[pure] = torch.eye(alike.shape[1])[0]
    weights = weights.to(codes.device)
    return (
        torch.einsum("bm,bmct->bct", weights, codes[alike]),
        torch.einsum("bm,bmk->bk", weights, conditions[alike]),
    )


@torch.no_grad()
def sample(
    network: Denoise,
    conditions: Float[torch.Tensor, "n k"],
    shape: tuple[int, int],
    config: DiffusionConfig,
    *,
    seed: int,
) -> Float[torch.Tensor, "n C T"]:
    """Return one code for each condition.

    Args:
        network: Trained with the same config.
        conditions: Scaled conditions, on the network's device.
        shape: (C, T) of a code.
        config: Sampler and its settings.
        seed: Of the noise.
    """
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    rows = [b""] if config.shared_noise else [row.tobytes() for row in conditions.cpu().numpy()]
    sources = [_source(seed, row) for row in rows]
    return _SAMPLERS[config.sampler](
        _Denoiser(network, conditions, shape, config, schedule, sources)
    )


def _source(seed: int, condition: bytes) -> torch.Generator:
    """Noise of a seed; where a condition is given, that condition's own."""
    if condition:
        digest = hashlib.sha256(f"{seed} ".encode() + condition).digest()
        seed = int.from_bytes(digest[:7], "big")
    return torch.Generator().manual_seed(seed)


@dataclass(frozen=True)
class _Denoiser:
    """A trained network with the conditions it is asked about."""

    network: Denoise
    conditions: Float[torch.Tensor, "n k"]
    shape: tuple[int, int]
    """(C, T) of a code."""
    config: DiffusionConfig
    schedule: NoiseSchedule
    sources: Sequence[torch.Generator]
    """Of noise: one for all conditions, or one each."""

    def noise(self, count: int) -> Float[torch.Tensor, "n {count} C T"]:
        """Draw so much for each condition."""
        shape = count, *self.shape
        drawn = torch.stack([torch.randn(shape, generator=source) for source in self.sources])
        return drawn.to(self.conditions.device).expand(len(self.conditions), *shape)

    def clean(
        self, noisy: Float[torch.Tensor, "B C T"], level: int
    ) -> Float[torch.Tensor, "B C T"]:
        """The network's estimate of x_0, clipped to the range of what was learned and its margin.

        Args:
            noisy: Codes, a condition's copies one after another.
            level: Of the noise in all of them.
        """
        conditions = self.conditions.repeat_interleave(len(noisy) // len(self.conditions), dim=0)
        levels = torch.full((len(noisy),), level, device=noisy.device)
        predicted = self.network(noisy, levels, conditions)
        bound = 1 + (_SLACK if self.config.coordinates == "span" else self.config.margin)
        estimate = self.schedule.clean_estimate(noisy, predicted, level, self.config.prediction)
        return estimate.clamp(-bound, bound)


def _mean_shift(denoiser: _Denoiser) -> torch.Tensor:
    """Climb to a mode of what was learned: annealed mean shift.

    An estimate x_0 is noised, at a few falling levels, with the same K draws for every condition,
    and replaced by the mean of the K clean estimates. The mean over noise of E[x_0 | x_t] is a
    mean-shift step at the scale of that noise [Comaniciu2002], so the estimate starts at the mean
    of all plans for the condition and ends at a mode. Ours; DDIM from x_T = 0 shows the network
    inputs with less noise than it was trained on, and has two to three times the error
    (docs/decisions-generator.md).
    """
    config, conditions = denoiser.config, denoiser.conditions
    levels = mean_shift_levels(config.noise_levels, config.sampling_steps)
    mean = torch.zeros((len(conditions), *denoiser.shape), device=conditions.device)
    return _climbed(denoiser, mean, levels)


def _climbed(denoiser: _Denoiser, x: torch.Tensor, at: Sequence[int]) -> torch.Tensor:
    """Take a mean-shift step at each of some levels."""
    draws = denoiser.config.noise_draws
    half = denoiser.noise(draws // 2)
    # Opposite draws cancel what is odd in the noise.
    noise = torch.cat([half, -half], dim=1).flatten(0, 1)
    for level in at:
        levels = torch.full((len(noise),), level, device=x.device)
        noisy = denoiser.schedule.add_noise(x.repeat_interleave(draws, dim=0), noise, levels)
        x = denoiser.clean(noisy, level).view(len(x), draws, *denoiser.shape).mean(dim=1)
    return x


def _ddim(denoiser: _Denoiser) -> torch.Tensor:
    """DDIM [Song2021] from one noise for all conditions, then mean shift at low noise.

    The noise decides which of several ways is taken, the same at near conditions; the steps of mean
    shift average out what else it does, and are too small to leave the way. Ours in the latter.
    """
    schedule, top = denoiser.schedule, denoiser.schedule.n_steps - 1
    polished = [int(part * schedule.n_steps) for part in _POLISHED]
    levels = [round(top - (top - polished[0]) * i / _DDIM_STEPS) for i in range(_DDIM_STEPS + 1)]
    x = denoiser.noise(1)[:, 0]
    for level, below in itertools.pairwise(levels):
        signal, next_signal = schedule.signal_at(level), schedule.signal_at(below)
        clean = denoiser.clean(x, level)
        noise = (x - math.sqrt(signal) * clean) / math.sqrt(1 - signal)
        x = math.sqrt(next_signal) * clean + math.sqrt(1 - next_signal) * noise
    return _climbed(denoiser, denoiser.clean(x, levels[-1]), polished)


def _ddpm(denoiser: _Denoiser) -> torch.Tensor:
    """DDPM [Ho2020] over all levels, as the paper samples."""
    x = denoiser.noise(1)[:, 0]
    for step in range(denoiser.config.noise_levels - 1, -1, -1):
        clean = denoiser.clean(x, step)
        x = denoiser.schedule.ddpm_step(x, clean, step, denoiser.noise(1)[:, 0])
    return x


_SAMPLERS: dict[str, Callable[[_Denoiser], torch.Tensor]] = {
    "mean_shift": _mean_shift,
    "ddim": _ddim,
    "ddpm": _ddpm,
}
