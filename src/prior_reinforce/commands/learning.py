"""Stage 1 on the command line: learn from a workspace's demonstrations, or a simulated task's."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from prior_reinforce.commands.live import fit_progress, say
from prior_reinforce.commands.simulated import GeneratorChoice, OnTask, learn
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.files import claim_folder
from prior_reinforce.generators import make_generator


@dataclass(frozen=True)
class FromTask(OnTask):
    """What is learned from where there is no workspace, and where to."""

    out: Path = Path("runs/model")
    """Folder for the model."""


@dataclass(frozen=True)
class Learn:
    """Learn outcome -> plan from demonstrations (Stage 1): a workspace's, or a simulated task's."""

    folder: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="[WORKSPACE]")] = (
        None
    )
    """Workspace whose demonstrations to learn from; without it, the simulated task's."""
    generator: GeneratorChoice = "auto"
    align: bool = False
    """Align the demonstrations in time first; short for the generator's setting timing=align."""
    seed: int = 0
    """Seed of the training."""
    device: str = "cpu"
    """Where a network is trained: cpu, or cuda for a GPU."""
    simulated: Annotated[FromTask, tyro.conf.arg(name="")] = field(default_factory=FromTask)

    def run(self) -> None:
        """Fit and save."""
        choice = self.generator
        if self.align:  # what auto takes for one pattern, aligned
            choice = f"{'interpolation' if choice == 'auto' else choice},timing=align"
        make_generator(choice, device=self.device)  # a wrong setting is reported first
        if self.folder is None:
            self._learn_from_task(choice)
        elif self.simulated == FromTask():
            self._learn_in_workspace(self.folder, choice)
        else:
            raise ConfigurationError(
                "--task, --demonstrations and --out are a simulated task's; a workspace has its "
                "own, drop one of the two"
            )

    def _learn_in_workspace(self, folder: Path, choice: str) -> None:
        from prior_reinforce.bench.workspace.workspace import Workspace
        from prior_reinforce.commands.workspace import print_next

        with Workspace(folder) as workspace:
            with fit_progress(Console()) as progress:
                learned = workspace.learn(
                    choice, seed=self.seed, device=self.device, progress=progress
                )
            for remark in learned.remarks:
                print(remark)
            print(f"model {learned.model} is in use")
            print_next(workspace)

    def _learn_from_task(self, choice: str) -> None:
        source, console = self.simulated, Console()
        _, demonstrations = source.open()
        claim_folder(source.out)
        generator = make_generator(choice, device=self.device)
        learn(demonstrations, source.out, generator, seed=self.seed, console=console)
        say(console, f"model of {demonstrations.n} demonstrations saved in {source.out}")
