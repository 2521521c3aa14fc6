"""What a driver says of the motion it was given: files in the folder that stands for `{result}`.

`result.json` says how it went, `executed.npz` which path was measured. Both are optional: a driver
that writes none speaks by its exit status alone.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

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


class DriverResult(msgspec.Struct, frozen=True):
    """`result.json`."""

    outcome: Literal["done", "not_moved", "aborted"]
    reason: str = ""
    """Why it was not done."""
    start_error: float | None = None
    """Largest distance of a joint from the plan's first frame when the motion began, in [rad]."""
    tracking_rms: float | None = None
    """Root mean square of the joints' distances from the plan, in [rad]."""


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
            said = msgspec.json.decode(file.read(_LARGEST_RESULT), type=DriverResult)
        for number in (said.start_error, said.tracking_rms):
            if number is not None and not (math.isfinite(number) and number >= 0):
                raise ValueError(f"{number} is no distance")
    except (OSError, ValueError, RecursionError) as error:
        raise FileFormatError(
            f"{path} cannot be read ({error}); it must be JSON with outcome = done, not_moved or "
            "aborted"
        ) from error
    return said


def measure_tracking(folder: Path, plan: Plan) -> float | None:
    """How far the measured path was from the plan, root mean square over samples and columns.

    Args:
        folder: Where the driver may have put `executed.npz`: `t` (T,) in [s] from the motion's
            start, `q` (T, D) in the plan's units.
        plan: What was to be executed.

    Returns:
        In the plan's unit; None where there is no such file.

    Raises:
        FileFormatError: It is no such file.
    """
    path = folder / PATH_FILE
    if not path.is_file() or path.is_symlink():
        return None
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
    return float(np.sqrt(np.mean((q - planned) ** 2)))
