"""Questions at the terminal; one that lets something move is answered only after it is shown."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from typing import TypeVar

from prior_reinforce.errors import ConfigurationError, InvalidFeedbackError
from prior_reinforce.terminal import plain

T = TypeVar("T")
_SHOWN = 0.5
"""How long a question is on the screen before an answer counts, in [s] (ours): nobody reads it and
types in less, and a network may bring what was typed before so late."""


def answer_to(question: str) -> str:
    """Ask the person at the terminal for data, on standard error; it may be typed or piped ahead.

    EOFError if no answer comes.
    """
    with redirect_stdout(sys.stderr):
        return input(question)


def until_read(ask: Callable[[], str], read: Callable[[str], T]) -> T:
    """Ask until an answer can be read; what is wrong with one is said.

    EOFError if `ask` gets no answer.
    """
    while True:
        said = ask()
        try:
            return read(said)
        except (ConfigurationError, InvalidFeedbackError) as error:
            print(plain(str(error)), flush=True)


def answer_after(question: str, prompt: str) -> str:
    """Return what the person at the terminal types after the question is shown, in lower case.

    The question is written to the terminal that answers it, whatever is redirected; what was typed
    before the prompt appears is thrown away. ConfigurationError if the input is no terminal, or
    what is typed ahead cannot be thrown away; EOFError if no answer comes.
    """
    try:
        import termios
    except ImportError as error:
        raise ConfigurationError(
            "this system cannot throw away what was typed before a question (Python has no termios "
            "here); answer it by an option such as --yes, or use Linux or macOS"
        ) from error
    if not sys.stdin.isatty():
        raise ConfigurationError(
            "a person answers this at a terminal, and a pipe is none; run it in one, or answer "
            "it by an option such as --yes"
        )
    sys.stdout.flush()
    sys.stderr.flush()
    terminal = sys.stdin.fileno()
    _show(terminal, f"{question}\n")
    termios.tcdrain(terminal)
    time.sleep(_SHOWN)
    termios.tcflush(terminal, termios.TCIFLUSH)
    _show(terminal, prompt)
    typed = b""
    while not typed.endswith(b"\n"):
        some = b""
        with suppress(OSError):  # the terminal is gone
            some = os.read(terminal, 4096)  # past the buffer of sys.stdin, which holds older lines
        if not some:
            raise EOFError
        typed += some
    return " ".join(typed.decode(errors="replace").split()).lower()


def agrees(question: str, answer: str = "yes") -> bool:
    """Whether the person at the terminal types `answer` in full; what is neither is asked again."""
    prompt = f'type "{answer}" if so, or press Enter if not: '
    with suppress(EOFError):
        typed = answer_after(question, prompt)
        if typed not in (answer, "", "n", "no"):
            typed = answer_after(f'got "{plain(typed)}", which is not "{answer}" in full', prompt)
        return typed == answer
    return False


def _show(terminal: int, text: str) -> None:
    """Write to the terminal that the input comes from.

    ConfigurationError if it is open for reading alone.
    """
    try:
        with open(terminal, "w", closefd=False, errors="replace") as screen:
            screen.write(text)
    except OSError as error:
        raise ConfigurationError(
            f"the question cannot be shown on the terminal ({error.strerror}); answer it by "
            "an option such as --yes, or do not redirect the input"
        ) from error
