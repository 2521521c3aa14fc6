"""Settings of the generators with a network; reading them needs no torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import msgspec
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.network.codec import Representation
from prior_reinforce.registry import build
from prior_reinforce.settings import Checked, Count, NonNegative, Positive

Activation = Literal["mish", "silu"]
Prediction = Literal["epsilon", "v", "sample"]
"""What the network predicts from x_t: the noise, the velocity of Salimans and Ho (2022,
"Progressive Distillation for Fast Sampling of Diffusion Models"), or the clean sample."""
Sampler = Literal["mean_shift", "ddpm"]


@dataclass(frozen=True)
class UNetSize(Checked):
    """Everything that sets the size of a `ConditionalUNet`; the defaults are the reference's."""

    widths: tuple[Count, ...] = (256, 512, 1024)
    """Channels of each level; time is halved between two levels."""
    kernel: Count = 5
    """Frames that a convolution sees; odd."""
    groups: Count = 8
    """Of every group normalisation; divides each width."""
    step_width: Annotated[int, msgspec.Meta(ge=4, multiple_of=2)] = 256
    """Size of the embedding of the noise level; even, at least 4."""
    condition_width: Count = 256
    """Both layers of the condition's MLP."""
    activation: Activation = "mish"
    """Everywhere. SiLU is as good and takes a quarter of Mish's time on a CPU."""

    def __post_init__(self) -> None:
        """Check the sizes.

        ConfigurationError if one is outside its range, or they do not fit together.
        """
        super().__post_init__()
        if not self.widths or any(width % self.groups for width in self.widths):
            raise ConfigurationError(
                f"widths must be positive multiples of groups ({self.groups}), got {self.widths}"
            )
        if self.kernel % 2 == 0:
            raise ConfigurationError(f"kernel must be odd, got {self.kernel}")

    @property
    def length_multiple(self) -> int:
        """The number of frames must be a multiple of this."""
        return int(2 ** (len(self.widths) - 1))


@dataclass(frozen=True)
class PerceptronSize(Checked):
    """Everything that sets the size of a `ConditionalPerceptron`."""

    members: Count = 4
    """E, networks that are averaged."""
    width: Count = 256
    """Of every layer."""
    depth: Count = 3
    """Residual layers."""
    step_width: Annotated[int, msgspec.Meta(ge=4, multiple_of=2)] = 64
    """Size of the embedding of the noise level; even, at least 4."""


_LAPTOP = UNetSize(widths=(64, 128, 128), step_width=64, condition_width=64, activation="silu")


@dataclass(frozen=True)
class UNetConfig(Checked):
    """Settings of all generators with a network; the defaults are sized for a laptop."""

    representation: Representation = "splines"
    """Code plans by spline control points where they fit, or by raw frames."""
    frames_per_point: Count = 4
    """Frames for each spline control point."""
    margin: NonNegative = 0.05
    """How far plans may leave the demonstrated range of a dimension, as a fraction of it."""
    smoothing_s: NonNegative = 0.0
    """Standard deviation [s] of a Gaussian over time through which raw frames of a generated plan
    pass, a low-pass as every arm's controller is one: -3 dB at 0.13 Hz / s, 5 Hz of 0.025."""
    network: UNetSize = _LAPTOP
    """Size of the U-Net, where it is one."""
    training_steps: Annotated[int, msgspec.Meta(ge=0)] = 500
    """Optimiser steps. 0 is the control: a network that has learned nothing."""
    learning_rate: Positive = 1e-3
    """Peak of the cosine schedule."""
    warmup_steps: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Steps in which the learning rate rises linearly."""
    weight_decay: NonNegative = 1e-6
    """Of AdamW."""


PAPER: dict[str, Any] = {
    "coordinates": "time",
    "representation": "frames",
    "margin": 0.0,
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
"""Where the paper's settings differ from the defaults.

Diffusion Policy's published low-dimensional training ([Chi2023] in docs/references.md) with the
paper's learning rate: raw frames, widths 256, 512 and 1024, AdamW, cosine with 500 steps of
warm-up, EMA, 100-step DDPM on the noise. A batch there is one pass over the demonstrations, as they
are fewer than its 256; its 5,000 epochs so are 5,000 steps.
"""


@dataclass(frozen=True)
class DiffusionConfig(UNetConfig):
    """Settings of `DiffusionGenerator`; the defaults suit a laptop.

    reproduction/docs/decisions-generator.md lists what was tried for each, with figures.
    """

    coordinates: Literal["span", "time"] = "span"
    """Denoise coordinates of plans in the space that the demonstrations span (`span`), by a
    perceptron; or their codes over time, by the U-Net, as in the paper."""
    perceptron: PerceptronSize = PerceptronSize()
    """Size of the perceptron."""
    training_steps: Annotated[int, msgspec.Meta(ge=0)] = 1500
    """Optimiser steps. 0 is the control: a network that has learned nothing."""
    prediction: Prediction = "v"
    """What the network predicts."""
    noise_levels: Count = 100
    """T, steps of the squared-cosine noise schedule."""
    sampler: Sampler = "mean_shift"
    """How codes are generated, see `denoiser`."""
    sampling_steps: Count = 3
    """Noise levels visited by mean shift; DDPM visits all."""
    noise_draws: Annotated[int, msgspec.Meta(ge=2, multiple_of=2)] = 8
    """K, noise draws over which a step of mean shift averages; even: a draw and its opposite."""
    shared_noise: bool = True
    """Share a sampler's noise among all conditions, so that near conditions have near plans; if
    not, each has its own, as if plans were sampled at random."""
    batch_size: Count = 48
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
        """Check the settings; ConfigurationError if one is outside its range."""
        super().__post_init__()
        if self.sampling_steps > self.noise_levels:
            raise ConfigurationError(
                f"sampling_steps must be at most noise_levels ({self.noise_levels}), "
                f"got {self.sampling_steps}"
            )

    def decay(self, n: int) -> float:
        """Return the decay of the averaged weights after n steps."""
        return min(1.0 - (1.0 + n) ** -self.ema_power, self.ema_limit)

    @classmethod
    def paper(cls) -> Self:
        """Return the settings of `diffusion-paper`, our reading of the paper's."""
        made: Self = build(cls, PAPER)
        return made
