"""What a driver says of the motion it was given: files in the folder that stands for `{result}`.

`result.json` says how it went, `executed.npz` which path was measured. Both are optional: a driver
that writes none speaks by its exit status alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from jaxtyping import Float

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import open_npz
from prior_reinforce.plans.interpolation import interp_columns, join_frames
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

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
    """Largest distance of a column from the plan's first frame, by unit."""
    tracking_rms: dict[str, float] = {}
    """Its distance from the plan on the way, root mean square, by unit."""
    tracking_max: dict[str, float] = {}
    """The largest such distance; only where the path was measured, as the next."""
    end_error: dict[str, float] = {}
    """The largest from the plan's last frame, at the end of what was measured."""
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

    @property
    def succeeded(self) -> bool:
        """Whether the plan was executed to its end."""
        return self.outcome == "done"


def read_driver_result(folder: Path) -> DriverResult | None:
    """Read `result.json` of a result folder; None where there is none.

    FileFormatError if it is no such file.
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


def measure_tracking(folder: Path, plan: Plan) -> dict[str, dict[str, float]]:
    """How far the measured path (`read_path`) was from the plan; empty where there is none.

    Returns `start_error`, `tracking_rms`, `tracking_max` and `end_error` of `MotionResult`, each by
    unit over the columns in it.
    """
    path = read_path(folder, plan.format)
    if path is None:
        return {}
    t, q = path
    off = np.abs(q - join_frames(plan.actions, plan.format.dt)(np.clip(t, 0.0, plan.times[-1])))
    start, end = np.abs(q[0] - plan.actions[0]), np.abs(q[-1] - plan.actions[-1])
    own = {unit: np.array(plan.format.units) == unit for unit in plan.format.units}
    return {
        "start_error": {unit: float(start[of].max()) for unit, of in own.items()},
        "tracking_rms": {u: float(np.sqrt(np.mean(off[:, of] ** 2))) for u, of in own.items()},
        "tracking_max": {unit: float(off[:, of].max()) for unit, of in own.items()},
        "end_error": {unit: float(end[of].max()) for unit, of in own.items()},
    }


def read_path(
    folder: Path, form: PlanFormat
) -> tuple[Float[np.ndarray, " T"], Float[np.ndarray, "T D"]] | None:
    """Read `executed.npz`: `t` in [s] from the motion's start, `q` in the plan's units.

    None where there is none; FileFormatError if it is no such file.
    """
    path = folder / PATH_FILE
    if not path.is_file() or path.is_symlink():
        return None
    with open_npz(path, "write t (T,) and q (T, D) with numpy.savez") as archive:
        t, q = np.asarray(archive["t"], float), np.asarray(archive["q"], float)
        is_path = len(t) > 0 and q.shape == (len(t), form.action_dim)
        if not (is_path and np.isfinite(t).all() and np.isfinite(q).all()):
            raise ValueError(f"t {t.shape} and q {q.shape} are not one finite row a sample")
    return t, q


def lag_behind(
    t: Float[np.ndarray, " T"], goals: Float[np.ndarray, "T d"], measured: Float[np.ndarray, "T d"]
) -> float:
    """How far a measured motion is behind its goals at times `t`, in [s], to a millisecond.

    The shift of the goals in time, up to 0.3 s, that fits best (least squares).
    """

    def misfit(shift: float) -> float:
        return float(np.sum((measured - interp_columns(t - shift, t, goals)) ** 2))

    return float(min(np.arange(301) * 1e-3, key=misfit))
