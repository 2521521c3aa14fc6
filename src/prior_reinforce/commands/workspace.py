"""Commands on a workspace as a whole: make one, set a goal, see where it stands, report."""

from __future__ import annotations

import json
import math
import re
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
import tyro

from prior_reinforce.adapters import ADAPTERS, DEFAULT_ADAPTER
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.arm.robots.presets import PRESETS
from prior_reinforce.arm.robots.urdf import bases_on_axis
from prior_reinforce.arm.workspace.declared import WAYS, read_object
from prior_reinforce.arm.workspace.folder import require_new
from prior_reinforce.arm.workspace.manifest import MANIFEST_FILE, Manifest
from prior_reinforce.arm.workspace.template import NewWorkspace
from prior_reinforce.arm.workspace.view import trials_table
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands.base import Json, OnWorkspace, Words, print_json, print_next
from prior_reinforce.commands.questions import answer_to, until_read
from prior_reinforce.errors import ConfigurationError, UnclearFlangeError
from prior_reinforce.files import named_disk_errors
from prior_reinforce.formats import in_tolerances
from prior_reinforce.parsing import unit_of_all
from prior_reinforce.plans.kinematics import UPRIGHT, first_axis, leaning
from prior_reinforce.units import UNITS
from prior_reinforce.wording import say_beyond, say_place, say_tolerance

AdapterChoice = Annotated[
    str, tyro.conf.arg(help=f"How the condition is corrected: {ADAPTERS.help}.")
]


@dataclass(frozen=True, kw_only=True)
class New(NewWorkspace):
    """Make a workspace: a folder with a commented manifest.

    For example:
        prior-reinforce new hoop --symmetry carried --box -0.8 -0.7 0.4 0.6 0.7 1.4
        prior-reinforce new hoop --robot ur5e
        prior-reinforce new hoop --robot my_arm.urdf --gripper percent
        prior-reinforce new hoop --robot my_arm.urdf --base torso_lift_link
        prior-reinforce new hoop --robot none
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="WORKSPACE")]
    """Folder to make."""
    robot: Annotated[
        str,
        tyro.conf.arg(
            help=f"Whose limits hold: {', '.join(PRESETS)}, the path of a .urdf, or none."
        ),
    ] = "panda"
    tolerance: tuple[float, ...] = ()

    def run(self) -> None:
        """Write the folder."""
        with named_disk_errors(self.folder):
            require_new(self.folder)  # before anything is asked
        try:
            asked = self._with_flange()._asked()
        except EOFError as error:
            raise ConfigurationError(
                "no answer came, and nothing was made; answer, or say --symmetry, --box and --tip"
            ) from error
        text = asked.manifest(self.folder.resolve().name)
        try:
            workspace = Workspace.create(self.folder, text)
        except ConfigurationError as error:  # whose place is in a file that is not made
            place = re.compile(rf"{re.escape(str(self.folder / MANIFEST_FILE))}(:\d+)?: ")
            raise ConfigurationError(f"nothing was made: {place.sub('', str(error))}") from error
        with workspace:
            print(f"workspace made in {self.folder}; look through {self.folder / 'workspace.toml'}")
            if workspace.manifest.robot is not None:
                print(_say_robot(workspace.manifest.robot))
            if (moved := workspace.manifest.symmetry) is not None:
                where = moved.object if isinstance(moved.object, str) else "X Y"
                enough = "several demonstrations tell the rest"
                if moved.distance != "learned":
                    enough = "one demonstration is enough"
                print(f"symmetry: {WAYS[where]}; {enough}, see docs/symmetry.md")
                if moved.turns:
                    asked._print_first_axis(workspace.manifest)
            print_next(workspace)

    def _with_flange(self) -> New:
        """The same with what a person at a terminal says of the flange, where it is not clear."""
        if not sys.stdin.isatty() or not self.robot.lower().endswith((".urdf", ".xml")):
            return self
        try:
            self.described(Path(self.robot))
            return self
        except UnclearFlangeError as error:
            unclear = error
        print(unclear)

        def read(said: str) -> New:
            if not (tip := said.strip() or unclear.proposed):
                raise unclear
            asked = replace(self, tip=tip)
            asked.described(Path(self.robot))  # a slip is asked about again
            return asked

        proposed = f" [{unclear.proposed}]" * bool(unclear.proposed)
        question = f"link that is the flange, or Ctrl-C to run new with other options{proposed}: "
        return until_read(partial(answer_to, question), read)

    def _asked(self) -> New:
        """The same with what a person at a terminal says of the object, and of the box."""
        if self.symmetry is not None or not sys.stdin.isatty():
            return self
        for way, means in WAYS.items():
            print(f"  {way:<9} {means}")
        question = "where is the object before it leaves? one demonstration is then enough [none]: "

        def read(said: str) -> tuple[str, str | tuple[float, float]]:
            said = said.strip() or "none"
            return said, read_object(said)

        said, where = until_read(partial(answer_to, question), read)
        asked = replace(self, symmetry=said)
        if where in ("anywhere", "none") or self.robot == "none" or self.box or self.no_box:
            return asked
        corners = answer_to(
            "a turned motion sweeps other parts of the room: two corners of the box that the tool "
            'tip must stay in, x y z x y z in metres, or "no box": '
        )
        if corners.strip().lower() == "no box":
            return replace(asked, no_box=True)
        try:
            low_x, low_y, low_z, x, y, z = map(float, corners.replace(",", " ").split())
        except ValueError as error:
            raise ConfigurationError(f"six numbers or no box, got {corners!r}") from error
        return replace(asked, box=(low_x, low_y, low_z, x, y, z))

    def _print_first_axis(self, manifest: Manifest) -> None:
        """Say where the arm's first axis stands, and leans, if turns could miss goals by it."""
        robot, form = manifest.robot, manifest.outcome_format
        if robot is None or robot.chain is None:
            return
        along, (x, y) = first_axis(robot.chain)
        lean, off, joint = leaning(along), math.hypot(x, y), robot.joint_names[0]
        if lean > UPRIGHT:
            return  # it turns about no place
        within = min(
            epsilon * (UNITS[unit].factor if unit in UNITS else 1.0)
            for epsilon, unit in zip(form.tolerance[:2], form.units, strict=False)
        )
        if 2.0 * off > within:  # half a turn about the one place or the other
            path, at = Path(self.robot), f"({round(x, 3) + 0.0:.3f}, {round(y, 3) + 0.0:.3f}) m"
            frame, bases = bases_on_axis(path, self.tip, self.base, self.held(), within / 2.0)
            remedy = f"add {at} to them"
            remedy += f", or make the workspace with --base {bases[0]}" if bases else ""
            print(
                f"WARNING: {joint} turns about {at} in the frame at {frame}, and outcomes, goals "
                f"and the box are understood there; if yours are measured from that axis, {remedy} "
                f"(turned motions would else be off by up to {2.0 * off:.3f} m)"
            )
        ends = [*robot.chain.origins[1:], robot.chain.flange]
        reach = sum(math.hypot(*end[:3]) for end in ends)
        if lean * reach > within:
            print(
                f"WARNING: the axis of {joint} leans by {math.degrees(lean):.1f} degrees from the "
                f"vertical: a motion turned by it is off by up to {lean * reach:.3f} m for each "
                f"radian at the arm's full length ({reach:.2f} m), which trials correct; where the "
                "lean is none of the real arm's, mend the URDF"
            )


def _say_robot(robot: RobotLimits) -> str:
    said = f"robot {robot.robot}: {', '.join(robot.joint_names)}; limits from {robot.source}"
    unknown = [key for key in ("acceleration", "jerk") if getattr(robot, key) is None]
    if not unknown:
        return said
    return (
        f"{said}; no limits of {' and '.join(unknown)} are known: plans are compared with the "
        "demonstrations in these"
    )


def print_goal(workspace: Workspace, typed: str) -> None:
    """Say which goal the next trials are for, and that typed numbers had no unit, if so."""
    goal = workspace.state.goals[-1]
    place, within = say_place(goal.goal, goal.format), say_tolerance(goal.format)
    shared = unit_of_all(typed, goal.format.units)
    no_unit = f"; numbers without a unit are {UNITS[shared].plural}" if shared in UNITS else ""
    print(f"goal {goal.number}: {place}; within {within}{no_unit}")
    shown, form = workspace.demonstrations, goal.format
    near = shown.nearest_inside(goal.goal)
    beyond = np.abs(goal.goal - near)
    warned = shown.symmetry is not None or np.any(shown.far_outside(goal.goal))
    if not warned and in_tolerances(beyond, goal.tolerance) > 1.0:
        print(
            f"it lies {say_beyond(beyond, form)} outside what was demonstrated; the nearest inside "
            f"is {say_place(near, form)}"
        )


@dataclass(frozen=True)
class Goal(OnWorkspace):
    """Set the goal that the next trials are for.

    For example:
        prior-reinforce goal hoop 0.92 0.10
        prior-reinforce goal hoop "92cm ahead, 10cm left" --new-hardware "another ball"
    """

    words: Annotated[Words, tyro.conf.arg(metavar="[WORKSPACE] PLACE")] = ()
    """The workspace (the current folder's if not given) and the goal: 0.92 0.10 (metres ahead,
    metres left, or the outcome's units), 92cm 10cm, or "92cm ahead, 10cm left"."""
    memory: Literal["goal", "workspace"] | None = None
    """Which trials the adapter learns from: this goal's, or earlier goals' as well; by default
    earlier ones too where they serve the adapter, as they do bayes."""
    adapter: AdapterChoice = DEFAULT_ADAPTER
    new_hardware: str | None = None
    """What was changed on the hardware since the last trial, a note: another ball, a new gripper.
    What was known is then believed less, and the next reading more."""

    takes_words = True

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        typed = " ".join(words)
        workspace.set_goal(
            typed,
            carry_over=None if self.memory is None else self.memory == "workspace",
            adapter=self.adapter,
            new_hardware=self.new_hardware,
        )
        print_goal(workspace, typed)
        print_next(workspace)


@dataclass(frozen=True)
class Status(OnWorkspace):
    """Say where a workspace stands and what to do next.

    For example:
        prior-reinforce status hoop
        prior-reinforce status hoop --json
    """

    json: Json = False

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        view = workspace.status()
        if self.json:
            print_json(view)
        else:
            print(view.text)


@dataclass(frozen=True)
class Trials(OnWorkspace):
    """Print every trial: what was asked for, what was seen.

    For example:
        prior-reinforce trials hoop
        prior-reinforce trials hoop --csv > trials.csv
    """

    csv: bool = False
    """As a table with a column for each number."""
    json: Json = False

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if self.csv and self.json:
            raise ConfigurationError("--csv or --json: drop one of the two")
        view = workspace.status()
        if self.json:
            print_json(view.trials)
        elif self.csv:
            print(trials_table(view), end="")
        else:
            for trial in view.trials:
                aim = say_place(trial.condition, view.outcome_format)
                said = f"aims at {aim}: {trial.line}"
                print(f"goal {trial.goal}  trial {trial.number:<4}{said}")


@dataclass(frozen=True)
class Log(OnWorkspace):
    """Print the journal, one JSON object a line.

    For example:
        prior-reinforce log hoop | grep told
    """

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        for entry in workspace.events:
            event = msgspec.to_builtins(entry.event)
            print(json.dumps({"id": entry.id, "time": entry.time, **event}))


@dataclass(frozen=True)
class Report(OnWorkspace):
    """Write a page with every goal, its trials, and the plans that were executed.

    For example:
        prior-reinforce report hoop --out shown-on-monday
    """

    out: Path | None = None
    """Folder for the page and its pictures; `report` in the workspace if not given."""

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        from rich.console import Console

        if self.out is not None and self.out.suffix.lower() in (".html", ".htm", ".pdf"):
            raise ConfigurationError(
                f"--out is a folder for the page and its pictures, got {self.out}; give --out "
                f"{self.out.with_suffix('')}"
            )
        from prior_reinforce.commands.live import drawing_progress

        with drawing_progress(Console()) as progress:
            page = workspace.report(self.out, progress=progress)
        print(f"report: {page}")
