"""What a driver says of the motion it was given: files in the folder that stands for `{result}`.

`result.json` says how it went, `executed.npz` which path was measured. Both are optional: a driver
that writes none speaks by its exit status alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import open_npz
from prior_reinforce.plans.interpolation import join_frames
from prior_reinforce.plans.motions import Plan

Outcome = Literal["done", "not_moved", "aborted", "unknown"]
"""`done`: the whole plan was executed. `not_moved`: the arm stands where it stood. `aborted`: it
moved, or may have, and not as planned. `unknown`: nobody is left who could say."""
RESULT_FILE, PATH_FILE = "result.json", "executed.npz"
NOT_MOVED_STATUS = 75
"""Exit status for `not_moved`: EX_TEMPFAIL of sysexits.h, "the user is invited to retry"."""
_LARGEST_RESULT = 100_000
"""Of `result.json`, in bytes; ours: a reason is a sentence."""


_Distance = Annotated[float, msgspec.Meta(ge=0)]


class DriverResult(msgspec.Struct, frozen=True):
    """`result.json`."""

    outcome: Literal["done", "not_moved", "aborted"]
    reason: str = ""
    """Why it was not done."""
    start_error: dict[str, _Distance] | _Distance = {}
    """Largest distance of a column from the plan's first frame when the motion began, by unit; a
    number is that of the joints, in [rad]."""
    tracking_rms: dict[str, _Distance] | _Distance = {}
    """Root mean square of the columns' distances from the plan, likewise."""


class MotionResult(msgspec.Struct, frozen=True, kw_only=True):
    """What became of a motion that a command was to make."""

    outcome: Outcome
    """What the driver says, unless how the command ended says otherwise."""
    reason: str = ""
    """Why it was not done."""
    start_error: dict[str, float] = {}
    """The driver's distance from the plan's first frame, by unit."""
    tracking_rms: dict[str, float] = {}
    """The driver's distance from the plan, root mean square, by unit."""
    exit_status: int | None = None
    """Status the command ended with; minus the signal's number if a signal ended it; None where
    nobody knows."""
    timed_out: bool = False
    """Whether it was stopped at its time limit. The arm may have moved."""
    interrupted: bool = False
    """Whether it was stopped by a signal (Ctrl-C). The arm may have moved."""
    seconds: float = 0.0
    """How long it ran."""
    output_tail: str = ""
    """The end of what it wrote to its output and error streams, in order."""


def read_driver_result(folder: Path) -> DriverResult | None:
    """Read `result.json` of a result folder; None where there is none.

    Raises:
        FileFormatError: It is no such file.
    """
    path = folder / RESULT_FILE
    if not path.is_file() or path.is_symlink():
        return None
    try:
        with path.open("rb") as file:
            return msgspec.json.decode(file.read(_LARGEST_RESULT), type=DriverResult)
    except (OSError, ValueError, RecursionError) as error:
        raise FileFormatError(
            f"{path} cannot be read ({error}); it must be JSON with outcome = done, not_moved or "
            "aborted"
        ) from error


def by_unit(distance: dict[str, float] | float) -> dict[str, float]:
    """Distances by unit; a number is one in [rad]."""
    return distance if isinstance(distance, dict) else {"rad": distance}


def measure_tracking(folder: Path, plan: Plan) -> dict[str, float]:
    """How far the measured path was from the plan, root mean square over samples and columns.

    Args:
        folder: Where the driver may have put `executed.npz`: `t` (T,) in [s] from the motion's
            start, `q` (T, D) in the plan's units.
        plan: What was to be executed.

    Returns:
        By unit, over the columns in it; empty where there is no such file.

    Raises:
        FileFormatError: It is no such file.
    """
    path = folder / PATH_FILE
    if not path.is_file() or path.is_symlink():
        return {}
    with open_npz(path, "write t (T,) and q (T, D) with numpy.savez") as archive:
        t, q = np.asarray(archive["t"], float), np.asarray(archive["q"], float)
        if not (
            len(t) > 0
            and q.shape == (len(t), plan.format.action_dim)
            and np.all(np.isfinite(t))
            and np.all(np.isfinite(q))
        ):
            raise ValueError(f"t {t.shape} and q {q.shape} are not one finite row a sample")
    planned = join_frames(plan.actions, plan.format.dt)(np.clip(t, 0.0, plan.times[-1]))
    squares, units = np.mean((q - planned) ** 2, axis=0), np.array(plan.format.units)
    return {unit: float(np.sqrt(squares[units == unit].mean())) for unit in plan.format.units}
