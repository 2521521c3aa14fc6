"""Commands on a workspace as a whole: make one, set a goal, see where it stands, report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.wording import say_place
from prior_reinforce.workspace.manifest import TEMPLATE
from prior_reinforce.workspace.status import describe, next_step
from prior_reinforce.workspace.workspace import Workspace

Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WORKSPACE")]


def print_next(workspace: Workspace) -> None:
    """Say which command comes next."""
    print(f"next: {next_step(workspace, workspace.session())}")


@dataclass(frozen=True)
class New:
    """Make a workspace: a folder with a commented manifest."""

    folder: Folder
    """Folder to make."""
    name: str | None = None
    """Name of the task; the folder's name if not given."""
    action_names: tuple[str, ...] = tuple(f"joint{i}" for i in range(1, 8))
    """Names of the action dimensions."""
    action_units: tuple[str, ...] = ("rad",)
    """Unit of each action dimension; a single one holds for all."""
    dt: float = 0.0125
    """Time between two frames of a plan, in seconds."""
    outcome_names: tuple[str, ...] = ("x", "y")
    """Names of the outcome's components."""
    outcome_units: tuple[str, ...] = ("m",)
    """Unit of each component; a single one holds for all."""
    tolerance: float = 0.015
    """Largest distance from the goal that counts as reached, in the outcome's units."""
    robot: Literal["panda", "fr3", "none"] = "panda"
    """Whose limits hold; write the limits of another arm into the manifest."""

    def run(self) -> None:
        """Write the folder."""
        manifest = TEMPLATE.format(
            name=_quoted(self.name or self.folder.resolve().name)[1:-1],
            names=_list(self.action_names),
            units=_list(_spread(self.action_units, len(self.action_names))),
            dt=self.dt,
            outcome_names=_list(self.outcome_names),
            outcome_units=_list(_spread(self.outcome_units, len(self.outcome_names))),
            tolerance=self.tolerance,
            robot=self.robot,
        )
        with Workspace.create(self.folder, manifest) as workspace:
            print(f"workspace made in {self.folder}; look through {self.folder / 'workspace.toml'}")
            print_next(workspace)


@dataclass(frozen=True)
class Goal:
    """Set the goal that the next trials are for."""

    folder: Folder
    """Workspace."""
    goal: Annotated[tuple[float, ...], tyro.conf.Positional]
    """Its place in the outcome's units, for instance 0.92 0.10 (metres ahead, metres left)."""
    memory: Literal["goal", "workspace"] = "goal"
    """Which trials the adapter learns from: this goal's, or earlier goals' as well."""
    adapter: Annotated[
        str, tyro.conf.arg(help=f"How the condition is corrected: {ADAPTERS.help}.")
    ] = "gp"

    def run(self) -> None:
        """Set it."""
        with Workspace(self.folder) as workspace:
            goal = workspace.set_goal(
                self.goal, carry_over=self.memory == "workspace", adapter=self.adapter
            )
            manifest = workspace.manifest
            place = say_place(goal.goal, manifest.outcome_names, manifest.outcome_units)
            print(f"goal {goal.number}: {place}")
            print_next(workspace)


@dataclass(frozen=True)
class Status:
    """Say where a workspace stands and what to do next."""

    folder: Folder
    """Workspace."""

    def run(self) -> None:
        """Print ten lines."""
        with Workspace(self.folder) as workspace:
            print(describe(workspace))


@dataclass(frozen=True)
class Log:
    """Print the journal, one JSON object a line."""

    folder: Folder
    """Workspace."""

    def run(self) -> None:
        """Print it."""
        with Workspace(self.folder) as workspace:
            events = workspace.events
        for event in events:
            print(
                json.dumps({"id": event.id, "time": event.time, "kind": event.kind, **event.data})
            )


@dataclass(frozen=True)
class Report:
    """Write a page with every goal, its trials, and the plans that were executed."""

    folder: Folder
    """Workspace."""
    out: Path | None = None
    """Folder for the page and its pictures; `report` in the workspace if not given."""

    def run(self) -> None:
        """Write it."""
        from prior_reinforce.workspace.report import report_workspace

        with Workspace(self.folder) as workspace:
            page = report_workspace(workspace, self.out or self.folder / "report")
        print(f"report: {page}")


def _quoted(text: str) -> str:
    """A text in quotes, as TOML wants it: JSON's, but for one control character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _list(values: tuple[str, ...]) -> str:
    return "[" + ", ".join(_quoted(value) for value in values) + "]"


def _spread(values: tuple[str, ...], n: int) -> tuple[str, ...]:
    return values * n if len(values) == 1 else values
