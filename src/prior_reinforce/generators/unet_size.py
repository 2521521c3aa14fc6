"""The size of the U-Net, apart from the network: settings are read without torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from prior_reinforce.errors import ConfigurationError

Activation = Literal["mish", "silu"]


@dataclass(frozen=True)
class UNetSize:
    """Everything that sets the size of a `ConditionalUNet`; the defaults are the reference's."""

    widths: tuple[int, ...] = (256, 512, 1024)
    """Channels of each level; time is halved between two levels."""
    kernel: int = 5
    """Frames that a convolution sees; odd."""
    groups: int = 8
    """Of every group normalisation; divides each width."""
    step_width: int = 256
    """Size of the embedding of the noise level; even, at least 4."""
    condition_width: int = 256
    """Both layers of the condition's MLP."""
    activation: Activation = "mish"
    """Everywhere. SiLU is as good and takes a quarter of Mish's time on a CPU."""

    def __post_init__(self) -> None:
        """Check the sizes.

        Raises:
            ConfigurationError: One is outside its range, or they do not fit together.
        """
        if self.groups < 1:
            raise ConfigurationError(f"groups must be at least 1, got {self.groups}")
        if not self.widths or any(width < 1 or width % self.groups for width in self.widths):
            raise ConfigurationError(
                f"widths must be positive multiples of groups ({self.groups}), got {self.widths}"
            )
        if self.kernel < 1 or self.kernel % 2 == 0:
            raise ConfigurationError(f"kernel must be odd and positive, got {self.kernel}")
        if self.step_width < 4 or self.step_width % 2:
            raise ConfigurationError(
                f"step_width must be even and at least 4, got {self.step_width}"
            )
        if self.condition_width < 1:
            raise ConfigurationError(
                f"condition_width must be at least 1, got {self.condition_width}"
            )
        if self.activation not in get_args(Activation):
            raise ConfigurationError(
                f"activation must be one of {get_args(Activation)}, got {self.activation!r}"
            )

    @property
    def length_multiple(self) -> int:
        """The number of frames must be a multiple of this."""
        return int(2 ** (len(self.widths) - 1))
