"""The paper's generator: a diffusion model of action plans, conditioned on the outcome.

What it generates is a function of the condition, which the adapter needs: see `diffusion_sampling`.
Torch, and what is built on it, is imported where a network is used: most commands use none, and
importing torch takes longer than all that they do.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError, FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import ConditionScale
from prior_reinforce.generators.diffusion_config import DiffusionConfig, Preset
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.generators.threads import torch_threads
from prior_reinforce.generators.timed import StartTimeCodec
from prior_reinforce.plans.codec import Representation
from prior_reinforce.plans.motions import Demonstrations

if TYPE_CHECKING:
    from prior_reinforce.generators.coded_network import CodedNetwork
    from prior_reinforce.generators.unet import ConditionalUNet


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
        self.config = config
        self._device = _available(device)
        self._threads = threads
        self._fitted: CodedNetwork[ConditionalUNet] | None = None
        self._seed = 0

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Learn from all demonstrations; see `Generator.fit`."""
        from prior_reinforce.generators.coded_network import CodedNetwork, as_tensor
        from prior_reinforce.generators.diffusion_training import train

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
                as_tensor(codes, self._device),
                as_tensor(scale.scale(demonstrations.outcomes_seen), self._device),
                self.config,
                seed=seed,
                progress=progress,
            )
        self._fitted = CodedNetwork(codec, scale, network, self._device)
        self._seed = seed
        return self

    @property
    def codec(self) -> StartTimeCodec:
        """How plans are coded, decided by `fit`."""
        return self._require().codec

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """Sample one plan for each condition; see `Generator.generate`."""
        from prior_reinforce.generators.diffusion_sampling import sample

        fitted = self._require()
        shape = (fitted.codec.channels, fitted.codec.length)
        return fitted.generate(
            conditions,
            lambda scaled: sample(fitted.network, scaled, shape, self.config, seed=self._seed),
        )

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        fitted = self._require()
        write_model(
            folder,
            self.name,
            {
                "config": self.config.to_json(),
                "codec": fitted.codec.settings(),
                "seed": self._seed,
            },
            fitted.tensors(),
        )

    @classmethod
    def load(cls, folder: str | os.PathLike[str], *, device: str = "cpu") -> Self:
        """Read what `save` wrote, on whichever device it was learned; see `Generator.load`.

        Args:
            folder: Of the model.
            device: Where torch computes, `cpu` or `cuda`.

        Raises:
            ConfigurationError: The device is not there.
            FileFormatError: Files are missing, truncated, or of another generator.
        """
        from prior_reinforce.generators.coded_network import CodedNetwork
        from prior_reinforce.generators.unet import ConditionalUNet

        _available(device)
        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(DiffusionConfig.from_json(saved.settings["config"]), device=device)
            size = generator.config.network
            generator._fitted = CodedNetwork.restore(
                saved.settings["codec"],
                saved.tensors,
                lambda codec, k: ConditionalUNet(codec.channels, k, size),
            )
            generator._seed = int(saved.settings["seed"])
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise FileFormatError(
                f"{folder} does not hold a complete {cls.name} generator: {error!r}; learn again"
            ) from error
        # Not within the try: a device that is full is no damaged model.
        generator._fitted = generator._fitted.to(device)
        return generator

    def _require(self) -> CodedNetwork[ConditionalUNet]:
        if self._fitted is None:
            raise NotFittedError("this DiffusionGenerator has learned nothing yet; call fit first")
        return self._fitted


def _available(device: str) -> str:
    """The device, if torch can compute there."""
    if device == "cpu":
        return device
    import torch

    try:
        parsed = torch.device(device)
    except RuntimeError as error:
        raise ConfigurationError(f"no device {device!r}; use 'cpu' or 'cuda'") from error
    if parsed.type not in ("cpu", "cuda"):
        raise ConfigurationError(f"no device {device!r}; use 'cpu' or 'cuda'")
    if parsed.type == "cuda" and (parsed.index or 0) >= torch.cuda.device_count():
        raise ConfigurationError(f"device {device!r} is not available here; use 'cpu'")
    return device
