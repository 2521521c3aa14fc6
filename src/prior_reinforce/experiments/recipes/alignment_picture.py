"""The picture of timeline alignment: one joint of all demonstrations, before and after."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from prior_reinforce.report.style import (
    INK,
    calm_axes,
    drawing,
    new_figure,
    save_png,
    trial_colour,
)


@drawing()
def draw_alignment(
    before: np.ndarray, after: np.ndarray, joint: str, dt: float, path: Path
) -> Path:
    """Draw two panels on one time axis.

    Args:
        before: Positions of one joint, shape (N, H).
        after: The same, aligned; shape (N, H') with H' >= H.
        joint: Label of the vertical axis.
        dt: Time of a frame, in [s].
        path: PNG to write.

    Returns:
        The path.
    """
    figure = new_figure(8.0, 5.6)
    for axes, plans, title in zip(
        figure.subplots(2, 1, sharex=True, sharey=True),
        (before, after),
        ("as recorded", "aligned in time"),
        strict=True,
    ):
        calm_axes(axes)
        for i, plan in enumerate(plans):
            axes.plot(
                dt * np.arange(len(plan)), plan, color=trial_colour(i, len(plans)), linewidth=1.8
            )
        axes.set_title(title, loc="left", fontsize=12, color=INK)
        axes.set_ylabel(joint)
    figure.axes[-1].set_xlabel("time [s]")
    figure.axes[-1].set_xlim(0, dt * (max(before.shape[1], after.shape[1]) - 1))
    return save_png(figure, path)
