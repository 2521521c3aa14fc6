"""`record`: demonstrations taken at the arm, ready to be learned from."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from typing_extensions import Self

from prior_reinforce.bench.importing.options import ReadOptions
from prior_reinforce.bench.importing.outcomes import OUTCOMES_FILE, SD, write_outcome_table
from prior_reinforce.bench.robots.executors.base import Guiding
from prior_reinforce.bench.robots.executors.drive import arms_columns, guiding_of
from prior_reinforce.bench.robots.executors.lock import executing_lock
from prior_reinforce.bench.robots.executors.watch import State, Take, Watch
from prior_reinforce.bench.workspace.manifest import Manifest
from prior_reinforce.bench.workspace.workspace import Workspace
from prior_reinforce.commands.base import OnWorkspace
from prior_reinforce.commands.importing import Import
from prior_reinforce.commands.trials import arm_of
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    InvalidFeedbackError,
)
from prior_reinforce.files import named_disk_errors
from prior_reinforce.plans.motions import PlanFormat
from prior_reinforce.wording import plain, read_uncertain_place

RECORDINGS = "recordings"
_MOTIONS: tuple[Literal["measured", "commanded"], ...] = ("measured", "commanded")
_SUFFIXES = (".npz", ".png")
_FEWEST = 10
"""States of a take; ours: a tenth of a second, which nobody means."""
_SILENT = 10.0
"""How long an arm may be silent, in [s]; ours."""
_QUESTIONS: dict[Guiding, str] = {
    "as it is": "",
    "let go": "hold the arm: its torque goes off, and what nobody holds falls; do you hold it?",
    "led": "the arm goes at once where its leader is, and follows it; may it?",
}
"""What a person is asked before an arm is guided."""
_KEYS = "space or enter starts and ends a take, d drops the last, n names it, q imports them"


@dataclass(frozen=True)
class Record(OnWorkspace):
    """Record demonstrations at the manifest's arm, and import them.

    For example:
        prior-reinforce record hoop
        prior-reinforce record hoop --takes 6 --seconds 3
    """

    motion: Literal["measured", "commanded"] | None = None
    """What is learned: where the arm was measured, or what its leader told it. If not given: what
    it was told, if it is led: an arm that lags will lag as much again when it executes that."""
    takes: int | None = None
    """Record so many by the clock, without keys: whoever guides the arm has no hand free."""
    seconds: float = 3.0
    """Length of each of those."""
    pause: float = 5.0
    """Before each of those, to bring the arm to where it starts, in seconds."""
    append: bool = False
    """Keep the demonstrations in use and add these to them."""
    executor: str | None = None
    """The executor that [arm] names, where it is your own: module:Class."""
    yes: bool = False
    """The arm's torque goes off, or a leader moves it at once: do not ask whether it may."""

    def run_on(self, workspace: Workspace, words: Sequence[str]) -> None:
        """Record, ask where each landed, import."""
        if self.takes is None and not sys.stdin.isatty():
            raise ConfigurationError("without a terminal there are no keys; say how many --takes")
        if not (self.seconds > 0 and self.pause >= 0 and (self.takes is None or self.takes > 0)):
            raise ConfigurationError(
                "--takes and --seconds must be more than 0, and --pause 0 or more, got "
                f"{self.takes}, {self.seconds:g} and {self.pause:g}"
            )
        workspace.state.refuse_open_trial("recording demonstrations")
        manifest, arm = workspace.manifest, arm_of(workspace, self.executor)
        if arm is None:
            raise ConfigurationError(
                f"{workspace.folder} names no arm; add [arm] with its executor to the manifest"
            )
        question = _QUESTIONS[guiding_of(arm)]
        if question and not (self.yes or _says_yes(question)):
            raise ConfigurationError(
                f"nobody said yes to {question!r}; nothing was done: say --yes"
            )
        with (
            executing_lock(workspace.folder, manifest.arm) as lock,
            Watch(arm, lock) as watch,
            _Terminal() as terminal,
        ):
            channels = arms_columns(manifest.format, watch.arm)
            folder = _new_folder(workspace.folder / RECORDINGS)
            asks = self.takes is None
            session = _Session(manifest, folder, channels, self.motion, terminal, asks=asks)
            print(f"{watch.arm.model} is read", flush=True)
            if self.takes is None:
                _by_keys(watch, session, terminal)
            else:
                self._by_the_clock(watch, session)
            taken = session.finished()
        if not taken:
            raise InvalidDemonstrationsError("nothing was recorded; record again")
        options = ReadOptions(format="npz", units=manifest.format.units)
        Import(options=options, append=self.append).run_on(workspace, [str(folder)])

    def _by_the_clock(self, watch: Watch, session: _Session) -> None:
        """Wait, take, end, by the arm's own time."""
        for _ in range(self.takes or 0):
            first = _state(watch).t
            print(f"{session.next_name} begins in {self.pause:g} s", flush=True)
            while (state := _state(watch)).t < first + self.pause:
                pass
            session.toggle()
            while state.t < first + self.pause + self.seconds:
                session.add(state)
                state = _state(watch)
            session.toggle()


def _by_keys(watch: Watch, session: _Session, terminal: _Terminal) -> None:
    """Takes from key to key."""
    print(_KEYS, flush=True)
    while True:
        if (state := watch.next(0.02)) is not None:
            session.add(state)
        pressed = terminal.key()
        if pressed in (" ", "\r", "\n"):
            session.toggle()
        elif pressed == "d":
            session.discard()
        elif pressed == "n":
            session.name_last()
        elif pressed in ("q", "\x04"):
            return
        if pressed and not session.taking:
            watch.forget()


def _state(watch: Watch) -> State:
    """The next state.

    Raises:
        ConfigurationError: None comes.
    """
    state = watch.next(_SILENT)
    if state is None:
        raise ConfigurationError(f"the arm said nothing for {_SILENT:g} s; record again")
    return state


class _Session:
    """The takes of one recording."""

    def __init__(
        self,
        manifest: Manifest,
        folder: Path,
        channels: list[int],
        motion: Literal["measured", "commanded"] | None,
        terminal: _Terminal,
        *,
        asks: bool,
    ) -> None:
        self._asks = asks  # by the clock, the next take comes at once, and `import` asks
        self._manifest, self._folder, self._channels = manifest, folder, channels
        self._motion, self._terminal = motion, terminal
        self._open: Take | None = None
        self._places: dict[str, tuple[float, ...]] = {}
        self._taken: list[str] = []
        self._number = 0

    @property
    def taking(self) -> bool:
        """Whether a take is being recorded."""
        return self._open is not None

    @property
    def next_name(self) -> str:
        """Of the next take."""
        return f"take-{self._number + 1}"

    def add(self, state: State) -> None:
        """One more state, of a take if there is one."""
        if self._open is not None:
            self._open.states.append(state)

    def toggle(self) -> None:
        """Begin a take, or end it: it is written, drawn, and asked about."""
        take, self._open = self._open, None
        if take is None:
            self._open = Take(self.next_name)
            print(f"{self._open.name} ...", flush=True)
            return
        if len(take.states) < _FEWEST:
            print(f"{take.name} was too short, and is not kept", flush=True)
            return
        self._number += 1
        measured, commanded = (take.motion(k, self._channels) for k in _MOTIONS)
        led = not np.array_equal(measured, commanded)
        kind = self._motion or ("commanded" if led else "measured")
        form = self._manifest.format
        with named_disk_errors(self._folder):
            take.save(self._folder, form, self._channels, kind)
            picture = self._folder / f"{take.name}.png"
            _draw(take, form, self._channels, kind, picture)
        self._taken.append(take.name)
        print(f"{take.name}: {take.t[-1]:.2f} s, its {kind} motion; picture: {picture}", flush=True)
        if led:
            lag = take.lag(self._channels)
            print(f"the arm was {1e3 * lag:.0f} ms behind what it was told: lag = {lag:.3f}")
        if self._asks:
            self._ask_place(take.name)

    def discard(self) -> None:
        """Drop the take that is being recorded, or else the last."""
        if self._open is not None:
            print(f"{self._open.name} is dropped", flush=True)
            self._open = None
        elif self._taken:
            name = self._taken.pop()
            self._places.pop(name, None)
            for suffix in _SUFFIXES:
                (self._folder / f"{name}{suffix}").unlink(missing_ok=True)
            self._keep()
            print(f"{name} is dropped", flush=True)

    def name_last(self) -> None:
        """Give the last take another name."""
        if not self._taken or self._open is not None:
            return
        old = self._taken[-1]
        new = plain(self._terminal.line(f"another name for {old}: ")).strip()
        if not new or "/" in new or new.startswith(".") or (self._folder / f"{new}.npz").exists():
            print(f"it stays {old}", flush=True)
            return
        for suffix in _SUFFIXES:
            (self._folder / f"{old}{suffix}").rename(self._folder / f"{new}{suffix}")
        self._taken[-1] = new
        if old in self._places:
            self._places[new] = self._places.pop(old)
            self._keep()

    def finished(self) -> list[str]:
        """The names of all takes; one that is being recorded is not kept."""
        if self._open is not None:
            self.discard()
        return self._taken

    def _ask_place(self, name: str) -> None:
        """Ask where the object of a take landed; what is skipped, `import` asks for."""
        names, units = self._manifest.outcome_names, self._manifest.outcome_units
        question = f"where did it land, {' '.join(names)} [{', '.join(dict.fromkeys(units))}]? "
        while True:
            text = self._terminal.line(question).strip()
            if text.lower() in ("", "s", "skip"):
                return
            try:
                place, sd = read_uncertain_place(text, names, units)
            except InvalidFeedbackError as error:
                print(error, flush=True)
                continue
            self._places[name] = (*place.tolist(), sd)
            self._keep()
            return

    def _keep(self) -> None:
        """Write the table of outcomes beside the recordings, as `import` reads it."""
        names, units = self._manifest.outcome_names, self._manifest.outcome_units
        rows = {name: tuple(map(repr, place)) for name, place in self._places.items()}
        heads = (*names, SD), (*units, units[0])
        with named_disk_errors(self._folder):
            write_outcome_table(self._folder / OUTCOMES_FILE, rows, *heads)


class _Terminal:
    """Keys as they are pressed, and lines; without a terminal there are no keys."""

    def __init__(self) -> None:
        self._before: list[Any] | None = None

    def __enter__(self) -> Self:
        if sys.stdin.isatty():
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin, termios.TCSADRAIN)  # which keeps what was typed ahead
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)

    def key(self) -> str:
        """A key that was pressed, or nothing."""
        if self._before is None or not select.select([sys.stdin], [], [], 0)[0]:
            return ""
        return os.read(sys.stdin.fileno(), 1).decode("latin-1") or "q"  # the terminal is gone

    def line(self, question: str) -> str:
        """A line, typed as usual; nothing where the input has ended."""
        self.__exit__()
        try:
            with suppress(EOFError):
                return input(question)
            return ""
        finally:
            self.__enter__()


def _new_folder(recordings: Path) -> Path:
    """A folder for what is recorded now; what was recorded before stays."""
    with named_disk_errors(recordings.parent):
        recordings.mkdir(exist_ok=True)
        numbers = [int(path.name) for path in recordings.iterdir() if path.name.isdecimal()]
        folder = recordings / str(max(numbers, default=0) + 1)
        folder.mkdir()
    return folder


def _says_yes(question: str) -> bool:
    """Whether a person at a terminal says yes."""
    if not sys.stdin.isatty():
        return False
    with suppress(EOFError):
        return input(f"{question} (yes/no) ").strip().lower() in ("y", "yes")
    return False


def _draw(take: Take, form: PlanFormat, channels: list[int], kind: str, path: Path) -> None:
    """A take over time: what will be learned, and in grey the other motion."""
    from prior_reinforce.report.style import INK_SOFT, calm_axes, drawing, new_figure, save_figure

    with drawing():
        columns = min(form.action_dim, 3)
        rows = -(-form.action_dim // columns)
        figure = new_figure(3.0 * columns, 1.9 * rows)
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
        for other in sorted(_MOTIONS, key=lambda name: name == kind):
            style: Any = {"linewidth": 1.5} if other == kind else {"color": INK_SOFT, "alpha": 0.5}
            for axes, values in zip(panels, take.motion(other, channels).T, strict=False):
                axes.plot(take.t, values, **style)
        for axes, name, unit in zip(panels, form.names, form.units, strict=False):
            calm_axes(axes)
            axes.set_title(f"{name} [{unit}]", fontsize=9)
        for spare in panels[form.action_dim :]:
            spare.set_axis_off()
        save_figure(figure, path)
