"""The paper's generator: a diffusion model of action plans, conditioned on the outcome.

What it generates is a function of the condition, which the adapter needs: see `denoiser`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.base import Report
from prior_reinforce.generators.config import UNetConfig
from prior_reinforce.generators.network import Learned, NetworkGenerator
from prior_reinforce.plans.codec import Representation
from prior_reinforce.registry import build
from prior_reinforce.settings import Count, NonNegative

if TYPE_CHECKING:
    from torch import Tensor, nn

    from prior_reinforce.generators.unet import ConditionalUNet

Preset = Literal["laptop", "paper"]
Prediction = Literal["epsilon", "v", "sample"]
"""What the network is trained to tell from x_t: the noise, the velocity of Salimans and Ho (2022,
"Progressive Distillation for Fast Sampling of Diffusion Models"), or the clean sample."""
Sampler = Literal["mean_shift", "ddim", "ddpm"]


PAPER: dict[str, Any] = {
    "representation": "frames",
    "margin": 0.0,
    "trend": "zero",
    "network": {},  # the reference's
    "prediction": "epsilon",
    "sampler": "ddpm",
    "sampling_steps": 100,
    "training_steps": 5000,
    "batch_size": 256,
    "fill_batch": False,
    "stratified": False,
    "learning_rate": 2e-4,
    "warmup_steps": 500,
    "ema_limit": 0.9999,
}
"""Where the paper's settings differ from the laptop's.

Diffusion Policy's published low-dimensional training ([Chi2023] in docs/references.md) with the
paper's learning rate: raw frames, widths 256, 512 and 1024, AdamW, cosine with 500 steps of
warm-up, EMA, 100-step DDPM on the noise. A batch there is one pass over the demonstrations, as they
are fewer than its 256; its 5,000 epochs so are 5,000 steps.
"""


@dataclass(frozen=True)
class DiffusionConfig(UNetConfig):
    """Everything that decides what `DiffusionGenerator` learns; the defaults are the laptop's.

    docs/decisions-generator.md tells what was tried for each, with figures.
    """

    prediction: Prediction = "v"
    """What the network predicts."""
    noise_levels: Count = 100
    """T, steps of the squared-cosine noise schedule."""
    sampler: Sampler = "mean_shift"
    """How codes are generated, see `denoiser`."""
    sampling_steps: Count = 6
    """Noise levels visited by mean shift or DDIM; DDPM visits all."""
    noise_draws: Annotated[int, msgspec.Meta(ge=2, multiple_of=2)] = 8
    """K, noise draws over which a step of mean shift averages; even: a draw and its opposite."""
    shared_noise: bool = True
    """All conditions share what noise a sampler draws, so that near conditions have near plans; if
    not, each has its own, as where plans are sampled at random."""
    batch_size: Count = 24
    """Samples a step, at least one of each demonstration where there is room."""
    fill_batch: bool = True
    """Repeat demonstrations, at other noise levels, until the batch is full."""
    stratified: bool = True
    """Spread a batch's noise levels evenly, instead of drawing them independently."""
    warmup_steps: Annotated[int, msgspec.Meta(ge=0)] = 50
    """Steps in which the learning rate rises linearly."""
    ema_power: NonNegative = 0.75
    """After n steps the averaged weights decay by 1 - (1 + n) ** -power a step."""
    ema_limit: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.995
    """Upper bound of that decay."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        super().__post_init__()
        if self.sampling_steps > self.noise_levels:
            raise ConfigurationError(
                f"sampling_steps must be at most noise_levels ({self.noise_levels}), "
                f"got {self.sampling_steps}"
            )

    @classmethod
    def preset(cls, name: Preset) -> Self:
        """Return the settings of that name: `laptop`, the default, or `paper`, see `PAPER`.

        Raises:
            ConfigurationError: There is no such preset.
        """
        if name not in ("laptop", "paper"):
            raise ConfigurationError(f"no preset {name!r}; use 'laptop' or 'paper'")
        made: Self = build(cls, PAPER if name == "paper" else {})
        return made


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
        self, *, sampler: Sampler | None = None, shared_noise: bool | None = None
    ) -> DiffusionGenerator:
        """Return a generator with the same network, sampled otherwise; it needs no training.

        Args:
            sampler: Replaces the one of the settings.
            shared_noise: Replaces that of the settings.

        Raises:
            NotFittedError: It is not fitted.
        """
        other = DiffusionGenerator.unpack(self.pack())
        other.config = replace(
            self.config,
            sampler=self.config.sampler if sampler is None else sampler,
            shared_noise=self.config.shared_noise if shared_noise is None else shared_noise,
        )
        return other.to(self._device)

    def _build(self, channels: int, length: int, outcome_dim: int) -> ConditionalUNet:
        from prior_reinforce.generators.unet import ConditionalUNet

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
        return sample(learned.network, conditions, shape, self.config, seed=learned.seed)
