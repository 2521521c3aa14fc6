"""What every attack is held against: one line, no traceback, no hang, nothing changed by a refusal.

An attack is a function of a `random` source; the same seed makes the same attack.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import traceback
import unicodedata
from collections.abc import Callable, Iterator
from pathlib import Path

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.cli import main
from prior_reinforce.errors import PriorReinforceError
from tests.arm.workspace.planar import demonstrations, manifest

REMEDY = re.compile(
    r"add|ask|calibrate again|call|check|choose|close|convert|copy|correct|demonstrate|drop|"
    r"expected|export|give|help|import (?:again|all|without)|it (?:has|holds) |known|"
    r"learn (?:it|again)|leave [\w ]{0,14}out|load it|looks like|make|mean|measure|mend|"
    r"missing|move the|must|name|need|put|record|remove|rename|resample|restore|run:|save it|say|"
    r"see|set one|spread|tell|unknown; |use|valid|void|wait|want|write",
    re.IGNORECASE,
)
"""What a refusal says must be done, in one of these words."""
LONGEST = 1200
"""Characters of a refusal that somebody still reads."""
LIMIT_S = 30.0
"""For one attack; nothing here takes a second on a quiet machine."""
HELD = "held"

NASTY = [
    *("", " ", "nan", "inf", "-inf", "-1", "0", "1e308", "1e309", "9" * 400, "-0.0", "1_000"),
    *("\x1b[2J", "a\nb", "a\rb", "\x00", "\u202e", "\ufeff", "ü", "球", "\udcff", "$\\frac$"),
    *("../x", "..", ".", "/", "//", "~", "a/b/c", "x" * 300, "a/" * 3000, "planar", "-", "--"),
    *("'", '"', "{", "}", "{plan}", "{trial}", "%s", "%n", "[red]", "<b>", "&", ";", "|", "$(x)"),
    *("None", "True", "[]", "{}", "null", "0.9", "0.05", "hit", "5cm long", "1", "2", "3"),
]


def prepare(folder: Path) -> Path:
    """A workspace with one open trial; beside it `learned`, the same without a goal."""
    with Workspace.create(folder / "learned", manifest()) as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")
        workspace.learn("interpolation")
    shutil.copytree(folder / "learned", folder / "asked")
    with Workspace(folder / "asked") as workspace:
        workspace.set_goal([0.9, 0.05])
        workspace.session().ask()
    return folder / "asked"


def program(module: str, *args: object) -> str:
    """Call an attack that is a program of its own: one that has used threads cannot be forked."""
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-m", f"tests.attacks.{module}", *map(str, args)],
        cwd=root,
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    return HELD if done.returncode == 0 else (done.stderr.splitlines() or [done.stdout])[-1]


class HangError(BaseException):
    """An attack took longer than its limit."""


@contextlib.contextmanager
def limited(seconds: float = LIMIT_S) -> Iterator[None]:
    """End what takes too long, from the main thread."""

    def expire(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, expire)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def tree(folder: Path) -> dict[str, str]:
    """Every file of a folder by its content."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            found[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def command(folder: Path, *args: str) -> str:
    """Call a command in a folder; `held`, or how it broke."""
    before, here = tree(folder), Path.cwd()
    out, err = io.StringIO(), io.StringIO()
    os.chdir(folder)
    try:
        with limited(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = main(list(args))
    except HangError:
        return "hang"
    except SystemExit as end:
        status = end.code or 0
    except BaseException as error:
        return _broken(error)
    finally:
        os.chdir(here)
    refusal = [line for line in err.getvalue().split("\n") if "warning: " not in line and line]
    if status not in (0, 1, 2):
        return f"status {status}"
    if status == 2 and len(refusal) != 1:
        return f"{len(refusal)} lines"
    if status == 2 and not REMEDY.search(refusal[0]):
        return f"no remedy: {refusal[0]:.80}"
    if status == 2 and len(refusal[0]) > LONGEST:
        return f"a refusal of {len(refusal[0])} characters"
    if status == 2 and tree(folder) != before:
        return "changed by a refusal"
    said = out.getvalue() + err.getvalue()
    if any(unicodedata.category(c) in ("Cc", "Cs") and c not in "\n" for c in said):
        return "control characters"
    if "allow_pickle" in said:
        return "advice to load unsafely"
    return HELD


def call(function: Callable[[], object]) -> str:
    """Call something of the library; `held` if it returns, or refuses in one line."""
    try:
        with limited():
            function()
    except HangError:
        return "hang"
    except PriorReinforceError as error:
        return HELD if "allow_pickle" not in str(error) else "advice to load unsafely"
    except BaseException as error:
        return _broken(error)
    return HELD


def _broken(error: BaseException) -> str:
    return f"traceback: {type(error).__name__}: {where(error)}"


def where(error: BaseException) -> str:
    """The last place in our own code."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "prior_reinforce" in frame.filename] or frames
    return f"{Path(ours[-1].filename).name}:{ours[-1].lineno} {str(error)[:80]!r}"


ODD = (
    b"", b"nan", b"1e400", b"-inf", b"\xff\xfe", b"\0", b'"', b";", b",", b"\t", b"\n", b"abc",
    b"2026-13-45", b"99999999999999999999", b"1.234,5", b"=SUM(A1)", "µ°".encode(), b"--", b"../x",
)  # fmt: skip
"""What a cell or a line of a file should not be."""


def damage(rng: random.Random, content: bytes) -> bytes:
    """The bytes of a file after something happened to it."""
    data = bytearray(content)
    how = rng.randrange(11)
    at = rng.randrange(len(data) + 1)
    lines = content.split(b"\n")
    if how == 0:
        del data[at:]
    elif how == 1 and data:
        data[at % len(data)] ^= 1 << rng.randrange(8)
    elif how == 2:
        data[at:at] = rng.randbytes(rng.randrange(1, 50))
    elif how == 3:
        data[at : at + rng.randrange(1, 200)] = b""
    elif how == 4:
        data[at : at + 8] = rng.choice([b"\x00", b"\xff"]) * 8
    elif how == 5:
        written = rng.choice(ODD)
        data[at : at + len(written)] = written
    elif how == 6:
        data = data[:at] + data[at // 2 :]
    elif how == 7:
        rng.shuffle(lines)
        data = bytearray(b"\n".join(lines))
    elif how == 8:
        lines[rng.randrange(len(lines))] = rng.choice(ODD)
        data = bytearray(b"\n".join(lines))
    elif how == 9:
        data *= 2
    else:
        data = bytearray(rng.randbytes(rng.randrange(100)))
    return bytes(data)


def wait_until(what: Callable[[], object], seconds: float = 20.0) -> bool:
    """Whether something comes true within a time."""
    deadline = time.monotonic() + seconds
    while not what():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True
