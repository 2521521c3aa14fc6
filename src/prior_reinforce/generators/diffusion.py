"""The paper's generator: a diffusion model of action plans, conditioned on the outcome.

What it generates is a function of the condition, which the adapter needs: see `diffusion_sampling`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import torch
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError, FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import ConditionScale, as_conditions
from prior_reinforce.generators.diffusion_config import DiffusionConfig, Preset
from prior_reinforce.generators.diffusion_sampling import sample
from prior_reinforce.generators.diffusion_training import train
from prior_reinforce.generators.representation import Representation
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.generators.start_time import StartTimeCodec
from prior_reinforce.generators.threads import torch_threads
from prior_reinforce.generators.unet import ConditionalUNet
from prior_reinforce.motions import Demonstrations

_CHUNK = 128
"""Plans sampled at once; bounds the memory of a dense grid of conditions."""


class DiffusionGenerator(Generator):
    """Conditional diffusion over whole plans (paper, Stage 1)."""

    name: ClassVar[str] = "diffusion"

    def __init__(
        self,
        config: DiffusionConfig | None = None,
        *,
        preset: Preset | None = None,
        representation: Representation | None = None,
        device: str = "cpu",
        threads: int | None = None,
    ) -> None:
        """Choose settings.

        Args:
            config: All settings; the laptop's when neither this nor `preset` is given.
            preset: Settings by name instead.
            representation: Replaces the one of the settings.
            device: Where torch computes, `cpu` or `cuda`.
            threads: Cores to train on; all when None. The last digits depend on it. Sampling is
                on one core, so that a model means the same plans on any number.

        Raises:
            ConfigurationError: Both `config` and `preset`, or a device that is not there.
        """
        if config is not None and preset is not None:
            raise ConfigurationError(f"give a config or a preset, not both: got preset={preset!r}")
        config = config or DiffusionConfig.preset(preset or "laptop")
        if representation is not None:
            config = replace(config, representation=representation)
        if device.startswith("cuda") and not torch.cuda.is_available():
            raise ConfigurationError(f"device {device!r} is not available here; use 'cpu'")
        self.config = config
        self._device = torch.device(device)
        self._threads = threads
        self._fitted: _Fitted | None = None

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Learn from all demonstrations; see `Generator.fit`."""
        codec, codes = StartTimeCodec.fit(
            demonstrations,
            start_times=self.config.start_times,
            representation=self.config.representation,
            frames_per_point=self.config.frames_per_point,
            length_multiple=self.config.network.length_multiple,
            margin=self.config.margin,
        )
        scale = ConditionScale.fit(demonstrations.outcomes_seen)
        with torch_threads(self._threads):
            network = train(
                self._tensor(codes),
                self._tensor(scale.scale(demonstrations.outcomes_seen)),
                self.config,
                seed=seed,
                progress=progress,
            )
        self._fitted = _Fitted(codec, scale, network, seed)
        return self

    @property
    def codec(self) -> StartTimeCodec:
        """How plans are coded, decided by `fit`."""
        return self._require().codec

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Sample one plan for each condition; see `Generator.generate`."""
        fitted = self._require()
        conditions = as_conditions(conditions, len(fitted.scale.low))
        scaled = self._tensor(fitted.scale.scale(conditions))
        plans = [np.empty((0, fitted.codec.horizon, fitted.codec.action_dim))]
        with torch_threads(1):
            for chunk in torch.split(scaled, _CHUNK):
                if len(chunk):
                    shape = (fitted.codec.channels, fitted.codec.length)
                    codes = sample(fitted.network, chunk, shape, self.config, seed=fitted.seed)
                    plans.append(fitted.codec.decode(codes.double().cpu().numpy()))
        return np.concatenate(plans)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        fitted = self._require()
        weights = fitted.network.state_dict()
        write_model(
            folder,
            self.name,
            {
                "config": self.config.to_json(),
                "codec": fitted.codec.settings(),
                "seed": fitted.seed,
            },
            {
                **{f"network.{name}": value.cpu().numpy() for name, value in weights.items()},
                "plan_range": fitted.codec.motion.plan_range,
                "code_range": fitted.codec.motion.code_range,
                "condition_range": np.stack([fitted.scale.low, fitted.scale.high]),
            },
        )

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote, onto the CPU; see `Generator.load`."""
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(DiffusionConfig.from_json(saved.settings["config"]))
            generator._fitted = _Fitted.restore(saved.settings, saved.tensors, generator.config)
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise FileFormatError(
                f"{folder} does not hold a complete {cls.name} generator: {error!r}; learn again"
            ) from error
        return generator

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(values, dtype=torch.float32, device=self._device)

    def _require(self) -> _Fitted:
        if self._fitted is None:
            raise NotFittedError("this DiffusionGenerator has learned nothing yet; call fit first")
        return self._fitted


class _Fitted:
    """What `fit` makes and `save` keeps."""

    def __init__(
        self, codec: StartTimeCodec, scale: ConditionScale, network: ConditionalUNet, seed: int
    ) -> None:
        self.codec = codec
        self.scale = scale
        self.network = network
        self.seed = seed

    @classmethod
    def restore(
        cls, settings: dict[str, Any], tensors: dict[str, np.ndarray], config: DiffusionConfig
    ) -> _Fitted:
        codec = StartTimeCodec.restore(
            settings["codec"], tensors["plan_range"], tensors["code_range"]
        )
        low, high = tensors["condition_range"]
        with torch.random.fork_rng(devices=[]):
            network = ConditionalUNet(codec.channels, len(low), config.network)
        weights = {
            name.removeprefix("network."): torch.from_numpy(value)
            for name, value in tensors.items()
            if name.startswith("network.")
        }
        if {name: tuple(value.shape) for name, value in weights.items()} != {
            name: tuple(value.shape) for name, value in network.state_dict().items()
        }:
            raise ValueError("its tensors are not those of the network in its config")
        network.load_state_dict(weights)
        network.eval().requires_grad_(False)
        return cls(codec, ConditionScale(low, high), network, int(settings["seed"]))
