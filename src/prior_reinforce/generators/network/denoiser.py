"""Loss and samplers of the denoising network, which is trained on a handful of codes.

The adapter needs the same plan for the same condition, and near plans for near conditions. So
noise comes from the fit's seed and is shared by all conditions. With `shared_noise=False` each has
its own, as if plans were sampled at random; still the same condition has the same plan.

Notation:
    B  batch    C  numbers of a code at one position    T  positions    n  conditions    k  outcome
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from jaxtyping import Float, Int

from prior_reinforce.generators.network.config import DiffusionConfig
from prior_reinforce.generators.network.noise_schedule import NoiseSchedule, mean_shift_levels
from prior_reinforce.generators.network.threads import torch

_SLACK = 0.5
"""How far coordinates in the demonstrations' span may leave their range, as a fraction of half of
it; plans are clipped to the margin as well. Ours: at the ends of the region a straight line leaves
it by a third."""
Denoise = Callable[[torch.Tensor, torch.Tensor, torch.Tensor], torch.Tensor]
"""A network: noisy codes (B, C, T), levels (B,) and conditions (B, k) to a prediction."""
Draw = Callable[[torch.Tensor], "tuple[torch.Tensor, torch.Tensor]"]
"""Numbers of demonstrations (B,) to clean codes (B, C, T) and their conditions (B, k)."""


def loss(
    network: Denoise,
    codes: Float[torch.Tensor, "N C T"],
    conditions: Float[torch.Tensor, "N k"],
    config: DiffusionConfig,
    rng: torch.Generator,
    draw: Draw | None = None,
) -> Callable[[], torch.Tensor]:
    """Return a function that draws a batch and computes the network's mean squared error.

    The network has one member or several, each with its own prediction. `codes` are x_0 of the
    demonstrations and `conditions` their scaled outcomes, both on its device. `draw` makes the
    samples of a batch; the demonstrations themselves when None.
    """
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)

    def loss_of_step() -> torch.Tensor:
        rows, levels = draw_batch(len(codes), config, rng)
        noise = torch.randn((len(rows), *codes.shape[1:]), generator=rng).to(codes.device)
        rows, levels = rows.to(codes.device), levels.to(codes.device)
        clean, given = (codes[rows], conditions[rows]) if draw is None else draw(rows)
        noisy = schedule.add_noise(clean, noise, levels)
        target = schedule.target(clean, noise, levels, config.prediction)
        errors = network(noisy, levels, given) - target  # of each member, if several
        return errors.square().mean()

    return loss_of_step


def draw_batch(
    n: int, config: DiffusionConfig, rng: torch.Generator
) -> tuple[Int[torch.Tensor, " B"], Int[torch.Tensor, " B"]]:
    """Draw a batch: numbers of n demonstrations, and noise levels.

    Each demonstration occurs as often as any other to within one.
    """
    size = config.batch_size if config.fill_batch else min(config.batch_size, n)
    passes = math.ceil(size / n)
    rows = torch.cat([torch.randperm(n, generator=rng) for _ in range(passes)])[:size]
    if not config.stratified:
        return rows, torch.randint(config.noise_levels, (size,), generator=rng)
    strata = torch.randperm(size, generator=rng)
    position = (strata + torch.rand(size, generator=rng)) / size
    return rows, (position * config.noise_levels).long().clamp(max=config.noise_levels - 1)


@torch.no_grad()
def sample(
    network: Denoise,
    conditions: Float[torch.Tensor, "n k"],
    shape: tuple[int, int],
    config: DiffusionConfig,
    *,
    seed: int,
    sampler: Callable[[Denoiser], torch.Tensor] | None = None,
) -> Float[torch.Tensor, "n C T"]:
    """Generate one code (C, T) for each scaled condition, by a network trained with `config`.

    The `sampler` is the config's by default.
    """
    schedule = NoiseSchedule.squared_cosine(config.noise_levels)
    rows = [b""] if config.shared_noise else [row.tobytes() for row in conditions.cpu().numpy()]
    sources = [_source(seed, row) for row in rows]
    run = sampler or _SAMPLERS[config.sampler]
    return run(Denoiser(network, conditions, shape, config, schedule, sources))


def _source(seed: int, condition: bytes) -> torch.Generator:
    """Return the source of noise of a seed, and of a condition unless it is empty."""
    if condition:
        digest = hashlib.sha256(f"{seed} ".encode() + condition).digest()
        seed = int.from_bytes(digest[:7], "big")
    return torch.Generator().manual_seed(seed)


@dataclass(frozen=True)
class Denoiser:
    """A trained network with conditions, and the state of its sampler."""

    network: Denoise
    conditions: Float[torch.Tensor, "n k"]
    shape: tuple[int, int]
    """(C, T) of a code."""
    config: DiffusionConfig
    schedule: NoiseSchedule
    sources: Sequence[torch.Generator]
    """Of noise: one for all conditions, or one each."""

    def noise(self, count: int) -> Float[torch.Tensor, "n {count} C T"]:
        """Draw noise for `count` codes of each condition."""
        shape = count, *self.shape
        drawn = torch.stack([torch.randn(shape, generator=source) for source in self.sources])
        return drawn.to(self.conditions.device).expand(len(self.conditions), *shape)

    def clean(
        self, noisy: Float[torch.Tensor, "B C T"], level: int
    ) -> Float[torch.Tensor, "B C T"]:
        """Return the network's estimate of x_0, clipped to the demonstrated range and its margin.

        All `noisy` codes, with the copies for one condition in a row, have the same noise level.
        """
        conditions = self.conditions.repeat_interleave(len(noisy) // len(self.conditions), dim=0)
        levels = torch.full((len(noisy),), level, device=noisy.device)
        predicted = self.network(noisy, levels, conditions)
        bound = 1 + (_SLACK if self.config.coordinates == "span" else self.config.margin)
        estimate = self.schedule.clean_estimate(noisy, predicted, level, self.config.prediction)
        return estimate.clamp(-bound, bound)


def _annealed_mean_shift(denoiser: Denoiser) -> torch.Tensor:
    """Climb to a mode of the learned distribution by annealed mean shift.

    An estimate x_0 is noised, at a few falling levels, with the same K draws for every condition,
    and replaced by the mean of the K clean estimates. The mean over noise of E[x_0 | x_t] is a
    mean-shift step at the scale of that noise [Comaniciu2002], so the estimate starts at the mean
    of all plans for the condition and ends at a mode. Ours; DDIM from x_T = 0 gives the network
    inputs with less noise than it was trained on, and has two to three times the error
    (reproduction/docs/decisions-generator.md).
    """
    config, conditions = denoiser.config, denoiser.conditions
    levels = mean_shift_levels(config.noise_levels, config.sampling_steps)
    mean = torch.zeros((len(conditions), *denoiser.shape), device=conditions.device)
    return mean_shift(denoiser, mean, levels)


def mean_shift(denoiser: Denoiser, x: torch.Tensor, levels: Sequence[int]) -> torch.Tensor:
    """Take a mean-shift step from x at each noise level."""
    draws = denoiser.config.noise_draws
    half = denoiser.noise(draws // 2)
    # Antithetic draws: terms that are odd in the noise cancel.
    noise = torch.cat([half, -half], dim=1).flatten(0, 1)
    for level in levels:
        steps = torch.full((len(noise),), level, device=x.device)
        noisy = denoiser.schedule.add_noise(x.repeat_interleave(draws, dim=0), noise, steps)
        x = denoiser.clean(noisy, level).view(len(x), draws, *denoiser.shape).mean(dim=1)
    return x


def _ddpm(denoiser: Denoiser) -> torch.Tensor:
    """DDPM [Ho2020] over all levels, as the paper samples."""
    x = denoiser.noise(1)[:, 0]
    for step in range(denoiser.config.noise_levels - 1, -1, -1):
        clean = denoiser.clean(x, step)
        x = denoiser.schedule.ddpm_step(x, clean, step, denoiser.noise(1)[:, 0])
    return x


_SAMPLERS: dict[str, Callable[[Denoiser], torch.Tensor]] = {
    "mean_shift": _annealed_mean_shift,
    "ddpm": _ddpm,
}
