"""`record`: demonstrations taken at the arm, ready to be learned from."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, Literal

import numpy as np
from typing_extensions import Self

from prior_reinforce.arm.executing.base import GuidedState, Guiding
from prior_reinforce.arm.executing.drive import arms_columns, guiding_of
from prior_reinforce.arm.executing.lock import executing_lock
from prior_reinforce.arm.executing.watch import Take, Watch
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.outcomes import OUTCOMES_FILE, Place, keep_places
from prior_reinforce.arm.workspace.folder import RECORDINGS
from prior_reinforce.arm.workspace.manifest import Manifest
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import warn
from prior_reinforce.commands.base import OnWorkspace
from prior_reinforce.commands.importing import Import
from prior_reinforce.commands.outcome_questions import ask_place
from prior_reinforce.commands.questions import agrees
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    WorkspaceError,
)
from prior_reinforce.files import named_disk_errors
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.terminal import plain

Which = Literal["measured", "commanded"]
_MOTIONS: tuple[Which, ...] = ("measured", "commanded")
_SUFFIXES = (".npz", ".png")
_FEWEST = 10
"""States of a take; ours: a tenth of a second, which nobody means."""
_LONGEST_NAME = 200
"""Of a take, in bytes; ours: file systems take 255, its ending included."""
_SILENT = 10.0
"""How long an arm may be silent, in [s]; ours."""
_QUESTIONS: dict[Guiding, tuple[str, str]] = {
    "as it is": ("", ""),
    "let go": (
        "hold the arm: its torque goes off, and an arm that nobody holds falls. Do you hold it?",
        "yes",
    ),
    "led": (
        "the arm will move at once and FAST to where its leader is, then follow it. NOT checked: "
        "the way there, self-collision, the table. Ctrl-C ends it. Is the area clear?",
        "follow",
    ),
}
"""What a person is asked before an arm is guided, and what to type for it."""
_KEYS = "space or enter starts and ends a take, d drops the last, n names it, q imports them"


@dataclass(frozen=True)
class Record(OnWorkspace):
    """Record demonstrations at the manifest's arm, and import them.

    For example:
        prior-reinforce record hoop
        prior-reinforce record hoop --takes 6 --seconds 3
    """

    motion: Which | None = None
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
    yes: bool = False
    """The arm's torque goes off, or a leader moves it at once: do not ask whether it may."""

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        if self.takes is None and not sys.stdin.isatty():
            raise ConfigurationError("without a terminal there are no keys; say how many --takes")
        if not (self.seconds > 0 and self.pause >= 0 and (self.takes is None or self.takes > 0)):
            raise ConfigurationError(
                "--takes and --seconds must be more than 0, and --pause 0 or more, got "
                f"{self.takes}, {self.seconds:g} and {self.pause:g}"
            )
        workspace.state.refuse_open_trial("recording demonstrations")
        manifest, arm = workspace.manifest, workspace.manifest.driven_by
        if arm is None:
            raise ConfigurationError(
                f"{workspace.folder} names no arm; add [arm] with its executor to the manifest"
            )
        guiding = guiding_of(arm)
        question, answer = _QUESTIONS[guiding]
        asked = sys.stdin.isatty()
        if question and not (self.yes or (asked and agrees(question, answer))):
            raise ConfigurationError(
                f'nobody said {answer} to "{question}"; nothing was done: say --yes'
            )
        print(f"connecting to {arm.executor}; this may take half a minute", flush=True)
        with (
            executing_lock(workspace.folder, manifest.arm) as lock,
            Watch(arm, lock) as watch,
            _Terminal() as terminal,
        ):
            channels = arms_columns(manifest.format, watch.arm)
            folder = _new_folder(workspace.folder / RECORDINGS)
            asks = self.takes is None
            session = _Session(manifest, folder, channels, self.motion, terminal, asks)
            then = "it follows its leader" if guiding == "led" else "move it by hand"
            print(f"reading {watch.arm.model}; {then} now", flush=True)
            options = ReadOptions(format="npz", units=manifest.format.units)
            words = (str(workspace.folder), str(folder))
            imports = Import(words=words, options=options, append=self.append)
            with _said_if_it_fails(session, imports):
                if asks:
                    _by_keys(watch, session)
                else:
                    self._by_the_clock(watch, session)
            if session.open is not None:
                session.discard()
        if not session.taken:
            with suppress(OSError):
                folder.rmdir()
            raise InvalidDemonstrationsError("nothing was recorded; record again")
        with _said_if_it_fails(session, imports, KeyboardInterrupt):
            imports.read_into(workspace, folder)

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


def _by_keys(watch: Watch, session: _Session) -> None:
    """Takes from key to key."""
    print(_KEYS, flush=True)
    while True:
        if (state := watch.next(0.02)) is not None:
            session.add(state)
        pressed = session.terminal.key()
        if pressed in (" ", "\r", "\n"):
            session.toggle()
        elif pressed == "d":
            session.discard()
        elif pressed == "n":
            session.name_last()
        elif pressed in ("q", "\x04"):
            return
        if pressed and session.open is None:
            watch.forget()


@contextmanager
def _said_if_it_fails(
    session: _Session, imports: Import, by: type[BaseException] = BaseException
) -> Iterator[None]:
    """Say which takes are kept, and how they are imported, where recording ends early."""
    try:
        yield
    except by:
        if session.taken:
            kept = ", ".join(session.taken)
            warn(f"kept in {session.folder}: {kept}; next: {imports.as_typed()}")
        raise


def _state(watch: Watch) -> GuidedState:
    """The next state; ConfigurationError if none comes."""
    state = watch.next(_SILENT)
    if state is None:
        raise ConfigurationError(f"the arm said nothing for {_SILENT:g} s; record again")
    return state


@dataclass(eq=False)
class _Session:
    """The takes of one recording."""

    manifest: Manifest
    folder: Path
    channels: list[int]
    """The arm's, of each column of a plan."""
    motion: Which | None
    terminal: _Terminal
    asks: bool
    """Whether to ask where each landed: by the clock, the next take comes at once."""
    open: Take | None = None
    """The take that is being recorded."""
    taken: dict[str, Place | None] = field(default_factory=dict)
    """Where the object of each take landed, if that was said."""
    number: int = 0

    @property
    def next_name(self) -> str:
        """Of the next take; one that another was given is passed over."""
        names = (f"take-{number}" for number in count(self.number + 1))
        return next(name for name in names if name not in self.taken)

    def add(self, state: GuidedState) -> None:
        """One more state, of a take if there is one."""
        if self.open is not None:
            self.open.states.append(state)

    def toggle(self) -> None:
        """Begin a take, or end it: it is written, drawn, and asked about."""
        take, self.open = self.open, None
        if take is None:
            self.open = Take(self.next_name)
            print(f"{self.open.name} ...", flush=True)
            return
        if len(take.states) < _FEWEST:
            print(f"{take.name} was too short, and is not kept", flush=True)
            return
        self.number += 1
        measured, commanded = (take.motion(k, self.channels) for k in _MOTIONS)
        led = not np.array_equal(measured, commanded)
        kind = self.motion or ("commanded" if led else "measured")
        form = self.manifest.format
        with named_disk_errors(self.folder):
            take.save(self.folder, form, self.channels, kind)
        self.taken[take.name] = None
        picture = self.folder / f"{take.name}.png"
        said = f"picture: {picture}"
        try:
            _draw(take, form, self.channels, kind, picture)
        except (OSError, WorkspaceError) as error:  # the take is kept without it
            said = f"no picture: {error}"
        print(f"{take.name}: {take.t[-1]:.2f} s, its {kind} motion; {said}", flush=True)
        if led:
            lag = take.lag(self.channels)
            print(f"the arm was {1e3 * lag:.0f} ms behind what it was told: lag = {lag:.3f}")
        if self.asks:
            self._ask_place(take.name)

    def discard(self) -> None:
        """Drop the take that is being recorded, or else the last."""
        if self.open is not None:
            print(f"{self.open.name} is dropped", flush=True)
            self.open = None
        elif self.taken:
            name, _ = self.taken.popitem()
            for suffix in _SUFFIXES:
                (self.folder / f"{name}{suffix}").unlink(missing_ok=True)
            self._keep()
            print(f"{name} is dropped", flush=True)

    def name_last(self) -> None:
        """Give the last take another name."""
        if not self.taken or self.open is not None:
            return
        old = [*self.taken][-1]
        new = plain(self.terminal.line(f"another name for {old}: ")).strip()
        why = ""
        if "/" in new or new.startswith(".") or len(new.encode()) > _LONGEST_NAME:
            why = f": {new:.40} is no name of a file"
        elif new and (self.folder / f"{new}.npz").exists():
            why = f": there is a {new} already"
        if why or not new:
            print(f"it stays {old}{why}", flush=True)
            return
        for suffix in _SUFFIXES:
            path = self.folder / f"{old}{suffix}"
            if path.exists() or suffix != ".png":  # there may be no picture
                path.rename(self.folder / f"{new}{suffix}")
        self.taken[new] = self.taken.pop(old)
        if self.taken[new] is not None:
            self._keep()

    def _ask_place(self, name: str) -> None:
        """Ask where the object of a take landed; what is skipped, `import` asks for."""
        form = self.manifest.outcome_format
        question = (
            f"where did it land, {' '.join(form.names)} [{', '.join(dict.fromkeys(form.units))}]? "
        )
        place = ask_place(lambda: self.terminal.line(question), form, "", "s", "skip")
        if not isinstance(place, str):
            self.taken[name] = place
            self._keep()

    def _keep(self) -> None:
        """Write the table of outcomes beside the recordings."""
        places = {name: place for name, place in self.taken.items() if place is not None}
        keep_places(self.folder / OUTCOMES_FILE, places, self.manifest.outcome_format)


class _Terminal:
    """Keys as they are pressed, and lines; without a terminal there are no keys."""

    def __init__(self) -> None:
        self._before: list[Any] | None = None

    def __enter__(self) -> Self:
        if sys.stdin.isatty():
            import termios  # not on Windows, where other commands go on
            import tty

            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin, termios.TCSADRAIN)  # which keeps what was typed ahead
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            import termios

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


def _draw(take: Take, form: PlanFormat, channels: list[int], kind: Which, path: Path) -> None:
    """A take over time: what will be learned, and in grey the other motion."""
    from prior_reinforce.report import style

    other = next(motion for motion in _MOTIONS if motion != kind)
    drawn: list[style.TimedMotion] = [
        (take.t, take.motion(other, channels), {"color": style.INK_SOFT, "alpha": 0.5}),
        (take.t, take.motion(kind, channels), {"linewidth": 1.5}),
    ]
    with style.drawing():
        columns = min(form.action_dim, 3)
        rows = -(-form.action_dim // columns)
        figure = style.new_figure(3.0 * columns, 1.9 * rows)
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True).ravel()
        for j in range(form.action_dim):
            style.calm_axes(panels[j])
            style.draw_joint(panels[j], form, j, drawn, fontsize=9)
        for spare in panels[form.action_dim :]:
            spare.set_axis_off()
        style.save_figure(figure, path)
