"""U-Net regression: the diffusion generator's network without diffusion, the paper's "UNet".

    theta, x = argmin mean_i |U_theta(x, 0, r_i) - code(A_i)|^2,    A(c) = decode(U_theta(x, 0, c))

One forward pass maps an outcome to a plan. The network, the codec and the scaling of conditions are
those of `diffusion`; where that one feeds a noisy code, this feeds a constant x that is learned
with the weights. (Fed with zeros, convolutions know time only from the padding at the ends.)

Notation:
    x      learned input   (C, T)     [-]
    codes  coded plans     (N, C, T)  [-], in [-1, 1]
    r, c   outcomes seen, conditions, scaled  (., k)  [-]
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from typing_extensions import Self

from prior_reinforce.errors import FileFormatError, NotFittedError
from prior_reinforce.generators.base import FitProgress, Generator
from prior_reinforce.generators.conditions import ConditionScale
from prior_reinforce.generators.regression_config import UNetRegressionConfig
from prior_reinforce.generators.saving import read_model, write_model
from prior_reinforce.generators.threads import torch_threads
from prior_reinforce.generators.timed import StartTimeCodec
from prior_reinforce.plans.motions import Demonstrations

if TYPE_CHECKING:
    from prior_reinforce.generators.coded_network import CodedNetwork
    from prior_reinforce.generators.regression_network import RegressionNetwork


class UNetRegression(Generator):
    """Supervised regression of plans on outcomes by a U-Net (paper, "UNet")."""

    name: ClassVar[str] = "regression"

    def __init__(
        self, config: UNetRegressionConfig | None = None, *, threads: int | None = None
    ) -> None:
        """Choose settings.

        Args:
            config: All settings; the defaults when None.
            threads: Cores to train on; all when None. The last digits depend on it. Plans are
                generated on one core, so that a model means the same ones on any number.
        """
        self.config = config or UNetRegressionConfig()
        self._threads = threads
        self._fitted: CodedNetwork[RegressionNetwork] | None = None

    def fit(
        self,
        demonstrations: Demonstrations,
        *,
        seed: int,
        progress: Callable[[FitProgress], None] | None = None,
    ) -> Self:
        """Learn from all demonstrations; the seed draws initial weights. See `Generator.fit`."""
        from prior_reinforce.generators.coded_network import CodedNetwork, as_tensor
        from prior_reinforce.generators.regression_network import train

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
                as_tensor(codes, "cpu"),
                as_tensor(scale.scale(demonstrations.outcomes_seen), "cpu"),
                self.config,
                seed,
                progress,
            )
        self._fitted = CodedNetwork(codec, scale, network, "cpu")
        return self

    @property
    def codec(self) -> StartTimeCodec:
        """How plans are coded, decided by `fit`."""
        return self._require().codec

    def generate(self, conditions: np.ndarray) -> np.ndarray:
        """One forward pass for each condition; see `Generator.generate`."""
        fitted = self._require()
        return fitted.generate(conditions, fitted.network)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write `config.json` and `model.safetensors`; see `Generator.save`."""
        fitted = self._require()
        write_model(
            folder,
            self.name,
            {"config": asdict(self.config), "codec": fitted.codec.settings()},
            fitted.tensors(),
        )

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Self:
        """Read what `save` wrote; see `Generator.load`."""
        from prior_reinforce.generators.coded_network import CodedNetwork
        from prior_reinforce.generators.regression_network import RegressionNetwork

        saved = read_model(folder, expected=cls.name)
        try:
            generator = cls(UNetRegressionConfig.from_json(saved.settings["config"]))
            size = generator.config.network
            generator._fitted = CodedNetwork.restore(
                saved.settings["codec"],
                saved.tensors,
                lambda codec, k: RegressionNetwork(codec.channels, codec.length, k, size),
            )
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise FileFormatError(
                f"{folder} holds no complete {cls.name} generator ({error!r}); learn it again"
            ) from error
        return generator

    def _require(self) -> CodedNetwork[RegressionNetwork]:
        if self._fitted is None:
            raise NotFittedError("this UNetRegression has learned nothing yet; call fit first")
        return self._fitted
