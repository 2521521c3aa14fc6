"""Events: transitions of channels that otherwise rest, each with a time of its own.

A gripper is not warped with the arm. Its path is split at its transitions into parts, which are
aligned on the common phase, and the time of each is one number of the plan (`timeline`). Ours.

Notation:
    t    time of a plan             [frames]
    tau  phase, common to all plans [frames]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from prior_reinforce.arrays import Plans
from prior_reinforce.plans.signals import Signals, active_runs


@dataclass(frozen=True)
class Step:
    """A channel with its own timing, split at its M transitions."""

    channel: int
    phases: tuple[int, ...]
    """Common phase of each transition, in whole frames."""
    levels: tuple[float, ...] = ()
    """The values of a switch, which takes no others; empty for other channels."""

    def split(
        self, values: Float[np.ndarray, " H"], times: Int[np.ndarray, " M"], tau: np.ndarray
    ) -> Float[np.ndarray, "L M"]:
        """Split a channel at transitions (frames) into its first part and subsequent changes."""
        borders = np.concatenate([[0], (times[1:] + times[:-1]) // 2, [len(values) - 1]])
        parts = []
        for m, phase in enumerate(self.phases):
            at = np.clip(tau - phase + times[m], borders[m], borders[m + 1])
            parts.append(at_samples(values, at) - (values[borders[m]] if m else 0.0))
        return np.stack(parts, axis=1)

    def join(
        self, parts: Float[np.ndarray, "L M"], samples: Float[np.ndarray, "M H"]
    ) -> Float[np.ndarray, " H"]:
        """Add up the parts, each at its own samples; a switch is rounded to its nearest value."""
        values = sum(at_samples(p, at) for p, at in zip(parts.T, samples, strict=True))
        if not self.levels:
            return np.asarray(values)
        levels = np.array(self.levels)
        return levels[np.abs(np.asarray(values)[:, None] - levels).argmin(axis=1)]


def at_samples(
    values: Float[np.ndarray, " L"], samples: Float[np.ndarray, " H"]
) -> Float[np.ndarray, " H"]:
    """Interpolate values linearly at fractional samples: a step never overshoots."""
    return np.interp(samples, np.arange(len(values)), values)


def transitions(
    values: Float[np.ndarray, "N H"], sigma: float = 0.0
) -> Float[np.ndarray, "N M"] | None:
    """Return the middle of each transition of a `step` or `switch`, in frames.

    M times for each demonstration, in order; None if demonstrations differ in M.
    """
    changes = np.abs(np.diff(values, axis=1))
    times = [
        [float(np.average(np.arange(a, b) + 0.5, weights=change[a:b])) for a, b in runs]
        for change, runs in zip(changes, active_runs(list(changes), sigma), strict=True)
    ]
    return np.array(times) if len({len(each) for each in times}) == 1 else None


def find_transitions(plans: Plans, signals: Signals) -> dict[int, Float[np.ndarray, "N M"]]:
    """Return the transitions of each channel with its own timing.

    If all channels jump, none has, since the jumps are then the motion.
    """
    found = {
        int(d): times
        for d in np.flatnonzero(signals.jumps)
        if (times := transitions(plans[:, :, d], signals.noise[d])) is not None
    }
    return found if len(found) < plans.shape[2] else {}
