"""Base class of generators with a network between scaled conditions and codes of plans.

Diffusion and U-Net regression share it: conditions are scaled, a network maps them to codes, and
the codec decodes these to plans. Torch and its dependents are imported only where a network is
used: most commands use none, and importing torch takes longer than they do.
"""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.arrays import Plans, Points
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.extras import check_installed
from prior_reinforce.files import sha256
from prior_reinforce.generators.base import ConditionScale, Generator, OnProgress
from prior_reinforce.generators.network.codec import PlanCodec
from prior_reinforce.generators.network.config import UNetConfig
from prior_reinforce.generators.network.span import Span
from prior_reinforce.generators.saving import Tensors, without_prefix
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.registry import build

if TYPE_CHECKING:
    import torch
    from torch import Tensor, nn

_CHUNK = 128
"""Plans generated at once; bounds the memory of a dense grid of conditions."""
_PREFIX = "network."


@dataclass(frozen=True, eq=False)
class FittedNetwork:
    """The result of a fit, from which plans are generated, and which is saved."""

    codec: PlanCodec
    scale: ConditionScale
    span: Span | None
    """The space in which codes have coordinates; None: the network generates codes themselves."""
    network: nn.Module
    """In evaluation mode, on the device to compute on."""
    seed: int
    """Of the fit."""


class NetworkGenerator(Generator):
    """A generator whose codes come from a network; a subclass defines the network and its loss."""

    config_type: ClassVar[type[UNetConfig]]
    config: UNetConfig

    def __init__(
        self,
        config: UNetConfig | None = None,
        *,
        device: str = "cpu",
        threads: int = 1,
        states: Path | None = None,
    ) -> None:
        """Choose settings.

        Args:
            config: All settings; the defaults when None.
            device: Where torch computes, `cpu` or `cuda`.
            threads: Threads to train on. The last digits depend on it, and two are slower than one
                beside other work; `fit` refuses more than one if torch was imported first. Plans
                are always generated on one, so that a model gives the same ones everywhere.
            states: Folder in which a training keeps its state, so that it continues after it was
                killed; None: it begins anew.

        Raises:
            ConfigurationError: A device that is not there, or no thread.
            MissingExtraError: The extra [diffusion] is not installed.
        """
        check_installed("torch")
        if threads < 1:
            raise ConfigurationError(f"threads must be at least 1, got {threads}")
        self.config = config or self.config_type()
        self._device = _available(device)
        self._threads, self._states = threads, states
        self._learned: FittedNetwork | None = None

    @property
    def _in_span(self) -> bool:
        """Whether the network generates coordinates in the demonstrations' span (`Span`)."""
        return False

    @abstractmethod
    def _build(self, channels: int, length: int, outcome_dim: int) -> nn.Module:
        """Make the untrained network for codes (C, T) of conditions (k,)."""

    @abstractmethod
    def _loss(
        self, network: nn.Module, codes: Tensor, conditions: Tensor, rng: torch.Generator
    ) -> Callable[[], Tensor]:
        """Return a function that computes the loss on a batch of codes and conditions (N, k)."""

    def _optimiser(self, rng: torch.Generator) -> Mapping[str, Any]:
        """Return settings for `training.optimise`; the loss may draw from `rng`."""
        return {}

    @abstractmethod
    def _codes(self, learned: FittedNetwork, conditions: Tensor) -> Tensor:
        """Generate codes (n, C, T) for scaled conditions (n, k)."""

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        from prior_reinforce.generators.network.threads import torch, torch_threads
        from prior_reinforce.generators.network.training import build, optimise

        outcomes = demonstrations.outcomes_seen
        codec = PlanCodec.fit(
            demonstrations,
            representation=self.config.representation,
            frames_per_point=self.config.frames_per_point,
            length_multiple=self.config.network.length_multiple,
            margin=self.config.margin,
            smoothing=self.config.smoothing_s,
        )
        scale = ConditionScale.fit(outcomes)
        scaled, codes = scale.scale(outcomes), codec.encode(demonstrations.plans)
        span = Span.fit(codes) if self._in_span else None
        if span is not None:
            codes = span.encode(codes)
        shape = *codes.shape[1:], outcomes.shape[1]
        state = None
        if self._states is not None:
            settings = json.dumps([self.name, asdict(self.config), seed]).encode()
            digest = sha256(settings + codes.tobytes() + scaled.tobytes())
            self._states.mkdir(parents=True, exist_ok=True)
            state = self._states / f"{digest[:16]}.safetensors"
        with torch_threads(self._threads):
            network = build(lambda: self._build(*shape), seed).to(self._device)
            clean, conditions = self._tensor(codes), self._tensor(scaled)
            untrained = FittedNetwork(codec, scale, span, network.eval(), seed)
            before = self._relative_error(untrained, clean, conditions)
            rng = torch.Generator().manual_seed(seed)
            loss, how = self._loss(network.train(), clean, conditions, rng), self._optimiser(rng)
            network = optimise(network, loss, self.config, progress, state=state, **how)
            self._learned = replace(untrained, network=network)
            after = self._relative_error(self._learned, clean, conditions)
        if state is not None:
            state.unlink(missing_ok=True)
        self.remarks = (
            f"network: {self.config.training_steps} steps; it misses the demonstrations by "
            f"{after} of how they differ, untrained by {before}",
        )

    def _relative_error(self, learned: FittedNetwork, codes: Tensor, conditions: Tensor) -> str:
        """Return the rms error of the demonstrations' codes, relative to their spread."""
        from prior_reinforce.generators.network.threads import torch

        with torch.no_grad():
            error = (self._codes(learned, conditions) - codes).square().sum()
            spread = (codes - codes.mean(dim=0)).square().sum().clamp(min=1e-12)
        return f"{float((error / spread).sqrt()):.1%}"

    def _generate(self, conditions: Points) -> Plans:
        from prior_reinforce.generators.network.threads import torch, torch_threads

        assert self._learned is not None
        learned, codec = self._learned, self._learned.codec
        scaled = learned.scale.scale(conditions)
        plans = [np.empty((0, codec.horizon, len(codec.kinds)))]
        # A plan's last digits depend on the number of threads.
        with torch_threads(1), torch.no_grad():
            for first in range(0, len(scaled), _CHUNK):
                chunk = scaled[first : first + _CHUNK]
                codes = self._codes(learned, self._tensor(chunk)).double().cpu().numpy()
                if learned.span is not None:
                    codes = learned.span.decode(codes)
                plans.append(codec.decode(codes))
        return np.concatenate(plans)

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """Settings, codec and seed; weights, and the ranges that map to [-1, 1]."""
        assert self._learned is not None
        learned = self._learned
        weights = learned.network.state_dict()
        return (
            {
                "config": asdict(self.config),
                "codec": learned.codec.settings(),
                "seed": learned.seed,
            },
            {
                **{f"{_PREFIX}{name}": value.cpu().numpy() for name, value in weights.items()},
                "plan_range": learned.codec.plan_range,
                "code_range": learned.codec.code_range,
                "condition_range": learned.scale.range,
                **({} if learned.span is None else vars(learned.span)),
            },
        )

    @classmethod
    def from_state(cls, settings: Mapping[str, Any], tensors: Tensors) -> Self:
        """Rebuild it on the CPU, wherever it was learned; see `Generator.from_state`."""
        from prior_reinforce.generators.network.threads import torch
        from prior_reinforce.generators.network.training import build as build_network

        generator = cls(build(cls.config_type, settings["config"]))
        codec = PlanCodec.restore(settings["codec"], tensors["plan_range"], tensors["code_range"])
        scale = ConditionScale(tensors["condition_range"])
        span = Span(tensors["origin"], tensors["directions"]) if generator._in_span else None
        shape = *(span or codec).shape, scale.range.shape[1]
        network = build_network(lambda: generator._build(*shape), seed=0)
        weights = {
            name: torch.from_numpy(value)
            for name, value in without_prefix(_PREFIX, tensors).items()
        }
        network.load_state_dict(weights)  # refuses missing, unknown and misshapen tensors
        network.eval().requires_grad_(False)
        generator._learned = FittedNetwork(codec, scale, span, network, int(settings["seed"]))
        return generator

    def to(self, device: str) -> Self:
        """Compute on another device from now on; see `Generator.to`."""
        self._device = _available(device)
        if self._learned is not None:
            self._learned.network.to(device)
        return self

    def _tensor(self, values: np.ndarray) -> Tensor:
        """Convert numbers for the network: float32, on its device."""
        from prior_reinforce.generators.network.threads import torch

        return torch.as_tensor(values, dtype=torch.float32, device=self._device)


def _available(device: str) -> str:
    """Return the device; ConfigurationError if torch cannot compute there."""
    if device == "cpu":
        return device
    from prior_reinforce.generators.network.threads import torch

    try:
        parsed = torch.device(device)
    except RuntimeError:
        parsed = None
    if parsed is None or parsed.type not in ("cpu", "cuda"):
        raise ConfigurationError(f"no device {device!r}; use 'cpu' or 'cuda'")
    if parsed.type == "cuda" and (parsed.index or 0) >= torch.cuda.device_count():
        raise ConfigurationError(f"device {device!r} is not available here; use 'cpu'")
    return device
