"""Real units that take a second or less, and some that show how one ends."""

import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from prior_reinforce.generators import GENERATORS, DiffusionConfig, DiffusionGenerator
from prior_reinforce.generators.network.config import UNetSize
from reproduction.evaluation import Training, Trials, ZeroShot
from reproduction.units import Unit


class BriefDiffusion(DiffusionGenerator):
    """A tiny network after a few steps."""

    name = "brief-diffusion"

    def __init__(self, config=None, **options):
        size = UNetSize(widths=(16, 32), step_width=16, condition_width=16)
        brief = {"network": size, "training_steps": 10, "sampling_steps": 2}
        super().__init__(replace(config or DiffusionConfig(), **brief), **options)


GENERATORS.add("brief-diffusion", BriefDiffusion)


def trainings():
    return [
        Training("basketball-v1", "A", "nearest", seed=0),
        Training("basketball-v1", "A", "interpolation", seed=0, perception="eye"),
        Training("basketball-v1", "A", "brief-diffusion", seed=0),
    ]


def real_units():
    """A generator of each kind is learned, thrown, and adapted."""
    nearest, smooth, diffusion = trainings()
    return [
        smooth.perceived,
        *trainings(),
        Trials(nearest, "basketball-v1", "gp-two-term", "amplified", goals=3, rounds=2),
        Trials(smooth, "basketball-v1", "proportional", "eye", goals=2, unseen=True, rounds=1),
        Trials(diffusion, "basketball-v1", "gp-two-term-all", "eye", goals=2, rounds=2),
        ZeroShot(nearest, spacing=0.2),
    ]


@dataclass(frozen=True)
class Roots(Unit):
    """Eigenvalues of a random matrix, slowly; numbers whose last digits threads would change."""

    seed: int

    def __str__(self):
        return f"roots {self.seed}"

    def run(self, folder: Path):
        matrix = np.random.default_rng(self.seed).normal(size=(200, 200))
        return {
            "product": float((matrix @ matrix.T).sum()),
            "roots": np.linalg.svd(matrix)[1][:9].tolist(),
        }

    def rows(self, result):
        return [dict(result)]


@dataclass(frozen=True)
class Ends(Unit):
    """A unit that does not end well."""

    how: str

    def __str__(self):
        return f"one that {self.how}s"

    def run(self, folder: Path):
        if self.how == "raise":
            raise ArithmeticError("0 is no divisor\nsecond line")
        if self.how == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        return {"value": float("nan")}


def results(folder: Path) -> dict[str, bytes]:
    """Every file, the unfinished ones too."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
