"""When a plan moves: velocity profiles that different action dimensions can share."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import gaussian_filter1d

# Ours: velocities below this part of the values are rounding, not motion.
_CONSTANT = 1e-12


def velocity_profiles(plans: np.ndarray, units: tuple[str, ...], smoothing: float) -> np.ndarray:
    """Return smoothed velocities, scaled so that the dimensions of every unit count alike.

    Dimensions of one unit share one scale, their pooled root mean square over all plans: a joint
    that only jitters stays small beside one that throws. A unit in which nothing moves gives zeros.

    Args:
        plans: Plans, shape (N, H, D).
        units: Unit of each dimension, length D.
        smoothing: Standard deviation of the Gaussian they are smoothed with, in frames.

    Returns:
        Central differences, smoothed and scaled, shape (N, H, D), pure numbers.
    """
    velocities = np.gradient(plans, axis=1)
    if smoothing > 0:
        velocities = gaussian_filter1d(velocities, smoothing, axis=1, mode="reflect")
    profiles = np.zeros_like(velocities)
    for unit in dict.fromkeys(units):
        members = [d for d, other in enumerate(units) if other == unit]
        pooled = math.sqrt(float(np.mean(velocities[..., members] ** 2)))
        if pooled > _CONSTANT * float(np.abs(plans[..., members]).max()):
            profiles[..., members] = velocities[..., members] / pooled
    return profiles
