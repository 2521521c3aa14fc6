"""A trained network between the scale of its conditions and the codec of its plans.

What diffusion and U-Net regression have in common once they are fitted: conditions are scaled, a
network makes codes of them, and the codec turns these into plans.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
import torch
from torch import nn
from typing_extensions import Self

from prior_reinforce.generators.conditions import ConditionScale, as_conditions
from prior_reinforce.generators.threads import torch_threads
from prior_reinforce.generators.timed import StartTimeCodec

_CHUNK = 128
"""Plans generated at once; bounds the memory of a dense grid of conditions."""
_PREFIX = "network."

Network = TypeVar("Network", bound=nn.Module)


@dataclass(frozen=True, eq=False)
class CodedNetwork(Generic[Network]):
    """What `fit` makes, `generate` runs and `save` keeps."""

    codec: StartTimeCodec
    scale: ConditionScale
    network: Network
    """In evaluation mode, on the device to compute on."""
    device: str

    def generate(
        self, conditions: np.ndarray, codes: Callable[[torch.Tensor], torch.Tensor]
    ) -> np.ndarray:
        """Return plans (n, H, D) for conditions (n, k), on one core.

        Args:
            conditions: c, in the units of the outcomes.
            codes: Makes codes (B, C, T) of scaled conditions (B, k).

        Raises:
            InvalidGoalError: Wrong shape, or not finite.
        """
        conditions = as_conditions(conditions, len(self.scale.low))
        scaled = as_tensor(self.scale.scale(conditions), self.device)
        plans = [np.empty((0, self.codec.horizon, self.codec.action_dim))]
        # One core: a plan's last digits would depend on the number of threads.
        with torch_threads(1), torch.no_grad():
            for chunk in torch.split(scaled, _CHUNK):
                if len(chunk):
                    plans.append(self.codec.decode(codes(chunk).double().cpu().numpy()))
        return np.concatenate(plans)

    def tensors(self) -> dict[str, np.ndarray]:
        """Every number that `restore` needs beside the codec's settings, by name."""
        weights = self.network.state_dict()
        return {
            **{f"{_PREFIX}{name}": value.cpu().numpy() for name, value in weights.items()},
            "plan_range": self.codec.motion.plan_range,
            "code_range": self.codec.motion.code_range,
            "condition_range": np.stack([self.scale.low, self.scale.high]),
        }

    @classmethod
    def restore(
        cls,
        codec_settings: dict[str, Any],
        tensors: dict[str, np.ndarray],
        build: Callable[[StartTimeCodec, int], Network],
    ) -> Self:
        """Rebuild it from what was saved, on the CPU.

        Args:
            codec_settings: `StartTimeCodec.settings`.
            tensors: What `tensors` gave.
            build: Makes the network, of any weights, for a codec and k.

        Raises:
            KeyError, TypeError, ValueError: Something is missing, or does not fit.
        """
        codec = StartTimeCodec.restore(codec_settings, tensors["plan_range"], tensors["code_range"])
        low, high = tensors["condition_range"]
        with torch.random.fork_rng(devices=[]):
            network = build(codec, len(low))
        weights = {
            name.removeprefix(_PREFIX): torch.from_numpy(value)
            for name, value in tensors.items()
            if name.startswith(_PREFIX)
        }
        if {name: value.shape for name, value in weights.items()} != {
            name: value.shape for name, value in network.state_dict().items()
        }:
            raise ValueError("its tensors are not those of the network in its config")
        network.load_state_dict(weights)
        network.eval().requires_grad_(False)
        return cls(codec, ConditionScale(low, high), network, "cpu")

    def to(self, device: str) -> Self:
        """The same on another device."""
        return replace(self, network=self.network.to(device), device=device)


def as_tensor(values: np.ndarray, device: str) -> torch.Tensor:
    """Return numbers as networks compute them: float32, on their device."""
    return torch.as_tensor(values, dtype=torch.float32, device=device)
