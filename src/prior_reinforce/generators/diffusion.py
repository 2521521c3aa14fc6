"""Diffusion models of plans, conditioned on the outcome (paper, Stage 1).

A U-Net denoises codes of plans (`denoiser`), given the outcome that is wished for. What it
generates is a function of the condition, which the adapter needs. Around the network:

- `trend=affine`: it learns what an affine function of the outcome leaves of the codes;
  `trend=zero`: all of them, as in the paper.
- `exact=yes` (`Corrected`): plans are a closed-form spline plus the network's deviation from the
  spline through its own plans. They are exact at the demonstrations, whatever the network has
  learned, and the trend cancels.
- `timing` (`Timed`): it learns shapes, and when they are played.

By its name, `diffusion`, it comes with all three, and an untrained network in its place then hits
as many first throws of the paper's tasks (docs/decisions-generator.md). What a network has learned
shows with `exact=no,trend=zero` only, beside the control `training_steps=0`, which learns nothing.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.base import Report
from prior_reinforce.generators.config import DiffusionConfig, Preset, Sampler
from prior_reinforce.generators.network import Learned, NetworkGenerator
from prior_reinforce.plans.codec import Representation

if TYPE_CHECKING:
    from torch import Tensor, nn


class DiffusionGenerator(NetworkGenerator):
    """Conditional diffusion over whole plans (paper, Stage 1)."""

    name: ClassVar[str] = "diffusion"
    config_type: ClassVar[type[DiffusionConfig]] = DiffusionConfig
    config: DiffusionConfig

    def __init__(
        self,
        config: DiffusionConfig | None = None,
        *,
        preset: Preset | None = None,
        representation: Representation | None = None,
        device: str = "cpu",
        threads: int = 1,
        states: Path | None = None,
    ) -> None:
        """Choose settings.

        Args:
            config: All settings; the laptop's when neither this nor `preset` is given.
            preset: Settings by name instead.
            representation: Replaces the one of the settings.
            device: See `NetworkGenerator`.
            threads: See `NetworkGenerator`.
            states: See `NetworkGenerator`.

        Raises:
            ConfigurationError: Both `config` and `preset`, or a device that is not there.
        """
        if config is not None and preset is not None:
            raise ConfigurationError(f"give a config or a preset, not both: got preset={preset!r}")
        config = config or DiffusionConfig.preset(preset or "laptop")
        if representation is not None:
            config = replace(config, representation=representation)
        super().__init__(config, device=device, threads=threads, states=states)

    def sampled(
        self,
        *,
        sampler: Sampler | None = None,
        shared_noise: bool | None = None,
        seed: int | None = None,
    ) -> DiffusionGenerator:
        """Return a generator with the same network, sampled otherwise; it needs no training.

        Args:
            sampler: Replaces the one of the settings.
            shared_noise: Replaces that of the settings.
            seed: Of the noise, instead of the fit's. With another one for every trial and
                `shared_noise=False`, plans are generated anew each time, as the paper does without
                an adapter.

        Raises:
            NotFittedError: It is not fitted.
        """
        self._fitted_to()
        other = copy.copy(self)
        assert self._learned is not None
        other.config = replace(
            self.config,
            sampler=self.config.sampler if sampler is None else sampler,
            shared_noise=self.config.shared_noise if shared_noise is None else shared_noise,
        )
        if seed is not None:
            other._learned = replace(self._learned, seed=seed)
        return other

    @property
    def _in_span(self) -> bool:
        return self.config.coordinates == "span"

    def _build(self, channels: int, length: int, outcome_dim: int) -> nn.Module:
        from prior_reinforce.generators.perceptron import ConditionalPerceptron
        from prior_reinforce.generators.unet import ConditionalUNet

        if self._in_span:
            return ConditionalPerceptron(channels, outcome_dim, self.config.perceptron)
        return ConditionalUNet(channels, outcome_dim, self.config.network)

    def _train(
        self,
        network: nn.Module,
        codes: Tensor,
        conditions: Tensor,
        seed: int,
        progress: Report,
        state: Path | None,
    ) -> nn.Module:
        from prior_reinforce.generators.denoiser import train

        return train(network, codes, conditions, self.config, seed, progress, state=state)

    def _codes(self, learned: Learned, conditions: Tensor) -> Tensor:
        from prior_reinforce.generators.denoiser import sample

        shape = learned.codec.channels, learned.codec.length
        if learned.span is not None:
            shape = len(learned.span.directions), 1
        return sample(learned.network, conditions, shape, self.config, seed=learned.seed)
