"""Stage 1 on the command line: learn, and find what was learned again."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from prior_reinforce.commands.progress import fit_progress
from prior_reinforce.commands.task_options import Simulated
from prior_reinforce.commands.workspace import opened, print_next
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.experiments.methods import make_generator
from prior_reinforce.generators import DiffusionConfig, DiffusionGenerator, load_generator
from prior_reinforce.generators.base import Generator
from prior_reinforce.motions import Demonstrations

_RECORD = "training.json"


@dataclass(frozen=True)
class TrainingRecord:
    """What a saved model was learned from; stands beside its weights."""

    demonstrations_sha256: str
    """Hash of the demonstrations' plans and outcomes."""
    seed: int
    """Seed of the fit."""


def learn(
    demonstrations: Demonstrations,
    folder: Path,
    *,
    generator: Generator,
    seed: int,
    console: Console,
) -> Generator:
    """Fit a generator under a progress line and save it to a folder."""
    with fit_progress(console) as progress:
        generator = generator.fit(demonstrations, seed=seed, progress=progress)
    generator.save(folder)
    record = TrainingRecord(demonstrations.sha256, seed)
    (folder / _RECORD).write_text(json.dumps(asdict(record), indent=2) + "\n")
    return generator


def load_learned(
    folder: Path, demonstrations: Demonstrations, *, own: str | None = None
) -> Generator:
    """Load a model that was learned from these demonstrations.

    Args:
        folder: Made by `learn`.
        demonstrations: What it must have been learned from.
        own: `module:Class` of the generator, where it is none of ours. It is never taken from the
            folder: a model is data, and names no code to run.

    Raises:
        FileFormatError: The folder holds no model.
        ConfigurationError: The model was learned from other demonstrations.
    """
    path = folder / _RECORD
    try:
        record = TrainingRecord(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError) as error:
        raise FileFormatError(
            f"no learned model in {folder} ({error}); make one with: prior-reinforce learn "
            f"--out {folder}"
        ) from error
    if record.demonstrations_sha256 != demonstrations.sha256:
        raise ConfigurationError(
            f"the model in {folder} was learned from other demonstrations; learn anew with "
            "prior-reinforce learn, or name the set it was learned from"
        )
    return load_generator(folder) if own is None else type(make_generator(own)).load(folder)


@dataclass(frozen=True)
class Learn(Simulated):
    """Learn outcome -> plan from demonstrations (Stage 1): a workspace's, or a simulated task's."""

    folder: Annotated[Path | None, tyro.conf.Positional] = None
    """Workspace whose demonstrations to learn from; without it, the simulated task's."""
    out: Path = Path("runs/model")
    """Folder for the model of a simulated task; a workspace keeps its own."""
    config: DiffusionConfig = field(default_factory=DiffusionConfig)
    """The diffusion generator's settings."""

    def run(self) -> None:
        """Fit and save."""
        console = Console()
        if self.folder is not None:
            with opened(self.folder) as workspace:
                with fit_progress(console) as progress:
                    model = workspace.learn(self.config, seed=self.seed, progress=progress)
                print(f"model {model} is in use")
                print_next(workspace)
            return
        _, demonstrations = self.open()
        learn(
            demonstrations,
            self.out,
            generator=DiffusionGenerator(self.config),
            seed=self.seed,
            console=console,
        )
        console.print(f"model of {demonstrations.n} demonstrations saved in {self.out}")
