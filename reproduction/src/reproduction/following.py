"""Time courses of a hand that changes its pace, and of an arm that follows another motion."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.signal import cont2discrete, lfilter, lfiltic


def warped(part: Float[np.ndarray, " t"], warp: Float[np.ndarray, " w"]) -> Float[np.ndarray, " t"]:
    """A map of [0, 1] onto itself, by sine waves of these relative changes of pace.

    It is monotone where their absolute values sum up to less than 1.
    """
    waves = np.pi * np.arange(1, len(warp) + 1)
    return np.asarray(part + np.sin(part[:, None] * waves) @ (warp / waves))


def follow(path: Float[np.ndarray, "H D"], dt: float, bandwidth: float) -> Float[np.ndarray, "H D"]:
    """Low-pass a path, a row each dt [s], with a critically damped second-order filter, from rest.

    The filter's bandwidth is in [Hz].
    """
    numerator, denominator = _low_pass(dt, bandwidth)
    rest = [lfiltic(numerator, denominator, [x] * 2, [x] * 2) for x in path[0]]
    return lfilter(numerator, denominator, path, axis=0, zi=np.column_stack(rest))[0]


@lru_cache  # to find it takes twice as long as to apply it
def _low_pass(
    dt: float, bandwidth: float
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Numerator and denominator of the filter of `follow`; not to be written to."""
    w = 2 * np.pi * bandwidth
    numerator, denominator, _ = cont2discrete(([w * w], [1.0, 2 * w, w * w]), dt, method="bilinear")
    return numerator.ravel(), denominator
