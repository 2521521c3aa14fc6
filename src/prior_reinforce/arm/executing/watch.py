"""Reading an arm while a person guides it: the program that reads, and the takes that are cut.

    python -m prior_reinforce.arm.executing.watch ARM

The program runs by itself, as whatever drives an arm does. Its output is lines of JSON: the arm,
then a `GuidedState` at every cycle. It ends with its input.
"""

from __future__ import annotations

import os
import queue
import select
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arm.executing.base import ArmDescription, ArmSettings, GuidedState
from prior_reinforce.arm.executing.drive import make_executor, program
from prior_reinforce.arm.executing.lock import MARK, ExecutingLock
from prior_reinforce.arm.executing.result import lag_behind
from prior_reinforce.errors import ConfigurationError, PriorReinforceError
from prior_reinforce.files import named_disk_errors
from prior_reinforce.plans.plan_format import PlanFormat


@dataclass(eq=False)
class Take:
    """One demonstration."""

    name: str
    states: list[GuidedState] = field(default_factory=list)

    @property
    def t(self) -> Float[np.ndarray, " T"]:
        """Times from its beginning, in [s]."""
        return np.array([state.t - self.states[0].t for state in self.states])

    def motion(
        self, kind: Literal["measured", "commanded"], channels: list[int]
    ) -> Float[np.ndarray, "T D"]:
        """Its measured or its commanded motion, of some of the arm's channels."""
        return np.array([getattr(state, kind) for state in self.states])[:, channels]

    def lag(self, channels: list[int]) -> float:
        """How far the measured motion is behind the commanded one, in [s]."""
        commanded, measured = self.motion("commanded", channels), self.motion("measured", channels)
        return lag_behind(self.t, commanded, measured)

    def save(self, folder: Path, form: PlanFormat, channels: list[int], kind: str) -> Path:
        """Write it as `NAME.npz`, as `import` reads it; both motions are in it, `q` is learned."""
        both: dict[str, Any] = {k: self.motion(k, channels) for k in ("measured", "commanded")}
        path = folder / f"{self.name}.npz"
        with named_disk_errors(folder):
            np.savez(path, t=self.t, q=both[kind], joint_names=np.array(form.names), **both)
        return path


class Watch:
    """An arm that is being read by the program; use it in a `with` block."""

    def __init__(self, arm: ArmSettings, lock: ExecutingLock) -> None:
        """Start the program, and wait until the arm has answered; ConfigurationError if it has not.

        The lock is the right to move it, as a leader may; the program holds it too, so that it is
        stopped as any motion is.
        """
        self._process = subprocess.Popen(
            [*program(__name__), msgspec.json.encode(arm).decode()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=lock.descriptors,
            env=os.environ | {MARK: " ".join(lock.names)},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input, self._output = self._process.stdin, self._process.stdout
        self._listener = threading.Thread(target=self._listen, daemon=True)
        try:
            self.arm = msgspec.json.decode(self._line(), type=ArmDescription)
        except BaseException:
            self.__exit__()
            raise
        self._states: queue.SimpleQueue[GuidedState | PriorReinforceError] = queue.SimpleQueue()
        self._listener.start()

    def _line(self) -> bytes:
        line = self._output.readline()
        if not line:
            raise ConfigurationError("the program that reads the arm ended without a word")
        if line.startswith(b'{"error"'):
            raise ConfigurationError(msgspec.json.decode(line)["error"])
        return line

    def _listen(self) -> None:
        decoder = msgspec.json.Decoder(GuidedState, dec_hook=lambda _, row: np.array(row))
        try:
            while True:
                self._states.put(decoder.decode(self._line()))
        except (PriorReinforceError, msgspec.MsgspecError, ValueError) as error:
            self._states.put(ConfigurationError(str(error)))

    def next(self, time_limit: float) -> GuidedState | None:
        """The next state; None if none came within the limit, in [s].

        ConfigurationError if the arm does not answer any more.
        """
        try:
            state = self._states.get(timeout=time_limit)
        except queue.Empty:
            return None
        if isinstance(state, PriorReinforceError):
            raise state
        return state

    def forget(self) -> None:
        """Pass over what has come so far."""
        while not self._states.empty():
            self.next(0.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End the program, which lets go of the arm."""
        self._input.close()
        try:
            self._process.wait(15.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._listener.ident is not None:
            self._listener.join()
        self._output.close()


def main() -> None:
    """Read an arm until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the end of the input tells

    def say(content: object) -> None:
        text = msgspec.json.encode(content, enc_hook=lambda array: array.tolist())
        sys.stdout.buffer.write(text + b"\n")
        sys.stdout.buffer.flush()

    with suppress(BrokenPipeError):
        try:
            executor = make_executor(msgspec.json.decode(sys.argv[1], type=ArmSettings))
            try:
                say(executor.describe())
                for state in executor.guide():
                    say(state)
                    if select.select([sys.stdin], [], [], 0)[0]:
                        break
            finally:
                executor.close()
        except PriorReinforceError as error:
            say({"error": str(error)})
