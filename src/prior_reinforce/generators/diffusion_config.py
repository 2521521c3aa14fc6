"""Settings of the diffusion generator: the laptop's and the paper's."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.unet_size import UNetSize
from prior_reinforce.plans.codec import Representation

Preset = Literal["laptop", "paper"]
Prediction = Literal["epsilon", "v", "sample"]
"""What the network is trained to tell from x_t: the noise, the velocity of Salimans and Ho (2022,
"Progressive Distillation for Fast Sampling of Diffusion Models"), or the clean sample."""
Sampler = Literal["mean_shift", "ddim", "ddpm"]


@dataclass(frozen=True)
class DiffusionConfig:
    """Everything that decides what `DiffusionGenerator` learns; the defaults are the laptop's.

    docs/decisions-generator.md tells what was tried for each, with figures.
    """

    representation: Representation = "splines"
    """Code plans by spline control points where they fit, or by raw frames."""
    frames_per_point: int = 4
    """Frames for each spline control point."""
    start_times: bool = True
    """Generate when the motion starts as a number of its own, where demonstrations rest at both
    ends, instead of leaving it to the frames."""
    margin: float = 0.05
    """How far plans may leave the demonstrated range of a dimension, as a fraction of it."""
    network: UNetSize = field(
        default_factory=lambda: UNetSize(
            widths=(64, 128, 128), step_width=64, condition_width=64, activation="silu"
        )
    )
    """Size of the U-Net."""
    prediction: Prediction = "v"
    """What the network predicts."""
    noise_levels: int = 100
    """T, steps of the squared-cosine noise schedule."""
    sampler: Sampler = "mean_shift"
    """How codes are generated, see `diffusion_sampling`."""
    sampling_steps: int = 6
    """Noise levels visited by mean shift or DDIM; DDPM visits all."""
    noise_draws: int = 8
    """K, noise draws over which a step of mean shift averages; even."""
    training_steps: int = 1000
    """Optimiser steps."""
    batch_size: int = 24
    """Samples a step, at least one of each demonstration where there is room."""
    fill_batch: bool = True
    """Repeat demonstrations, at other noise levels, until the batch is full."""
    stratified: bool = True
    """Spread a batch's noise levels evenly, instead of drawing them independently."""
    learning_rate: float = 1e-3
    """Peak of the cosine schedule."""
    warmup_steps: int = 50
    """Steps in which the learning rate rises linearly."""
    weight_decay: float = 1e-6
    """Of AdamW, whose betas are 0.95 and 0.999."""
    ema_power: float = 0.75
    """After n steps the averaged weights decay by 1 - (1 + n) ** -power a step."""
    ema_limit: float = 0.995
    """Upper bound of that decay."""

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            ConfigurationError: One is outside its range.
        """
        for name, choices in (
            ("representation", get_args(Representation)),
            ("prediction", get_args(Prediction)),
            ("sampler", get_args(Sampler)),
        ):
            if getattr(self, name) not in choices:
                raise ConfigurationError(
                    f"{name} must be one of {choices}, got {getattr(self, name)!r}"
                )
        for name in (
            "frames_per_point", "noise_levels", "sampling_steps", "training_steps", "batch_size",
        ):  # fmt: skip
            if getattr(self, name) < 1:
                raise ConfigurationError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.sampling_steps > self.noise_levels:
            raise ConfigurationError(
                f"sampling_steps must be at most noise_levels ({self.noise_levels}), "
                f"got {self.sampling_steps}"
            )
        if self.noise_draws < 2 or self.noise_draws % 2:
            raise ConfigurationError(
                f"noise_draws must be even and at least 2 (a draw and its opposite), "
                f"got {self.noise_draws}"
            )
        if not self.learning_rate > 0:
            raise ConfigurationError(f"learning_rate must be positive, got {self.learning_rate}")
        for name in ("margin", "warmup_steps", "weight_decay", "ema_power"):
            if not getattr(self, name) >= 0:
                raise ConfigurationError(f"{name} must not be negative, got {getattr(self, name)}")
        if not 0 <= self.ema_limit < 1:
            raise ConfigurationError(f"ema_limit must be in [0, 1), got {self.ema_limit}")

    @classmethod
    def preset(cls, name: Preset) -> Self:
        """Return the settings of that name.

        `laptop` is the default. `paper` is Diffusion Policy's published low-dimensional training
        ([Chi2023] in docs/references.md) with the paper's learning rate: raw frames, widths 256,
        512 and 1024, AdamW, cosine with 500 steps of warm-up, EMA, 100-step DDPM on the noise. A
        batch there is one pass over the demonstrations, as they are fewer than its 256; its 5,000
        epochs so are 5,000 steps.

        Raises:
            ConfigurationError: There is no such preset.
        """
        if name == "laptop":
            return cls()
        if name != "paper":
            raise ConfigurationError(f"no preset {name!r}; use 'laptop' or 'paper'")
        return cls(
            representation="frames",
            start_times=False,
            margin=0.0,
            network=UNetSize(),
            prediction="epsilon",
            sampler="ddpm",
            sampling_steps=100,
            training_steps=5000,
            batch_size=256,
            fill_batch=False,
            stratified=False,
            learning_rate=2e-4,
            warmup_steps=500,
            ema_limit=0.9999,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the settings as JSON types."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """Rebuild the settings from what `to_json` gave."""
        network = dict(values["network"])
        network["widths"] = tuple(network["widths"])
        return cls(**{**values, "network": UNetSize(**network)})
