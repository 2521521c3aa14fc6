"""Colours, figures and picture files, shared by every picture of every report.

Colours are told apart by anyone: vermilion and bluish green of the Okabe-Ito palette (Okabe and
Ito 2008, "Color Universal Design"), trials in one hue from light to dark, the rest in grey; and
nothing is said by colour alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from prior_reinforce.files import in_place
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.speeds import largest_of_unit

INK = "#1f2933"
INK_SOFT = "#616e7c"
LINE = "#cbd2d9"
DEMONSTRATION = "#9aa5b1"
REGION = "#f3f5f7"
GOAL = "#d55e00"
HIT = "#009e73"
_TRIAL_FIRST = "#8db7e3"
_TRIAL_LAST = "#16406f"

TimedMotion = tuple[Float[np.ndarray, " _"], Float[np.ndarray, "_ _"], Mapping[str, Any]]
"""Times [s], frames, and settings of `Axes.plot`."""
PICTURE_DPI = 200
"""Twice a screen's resolution; sharp on paper at the size drawn."""

_PLACE_DIGITS = 9
"""Of a figure's width: far below a pixel, far above rounding."""

_RC: Any = {  # matplotlib releases differ in how they type this
    "font.family": "DejaVu Sans",  # comes with matplotlib, so pictures look alike everywhere
    "font.size": 10.5,
    "axes.unicode_minus": True,
    "axes.titley": 1.0,  # at the frame, or ticks are measured thrice to see whether they reach it
    "text.color": INK,
    "text.parse_math": False,  # a title may hold dollar signs
    "text.usetex": False,  # whatever a matplotlibrc of the folder wants run
    "svg.fonttype": "path",  # whatever fonts the reader has
    "svg.hashsalt": "prior-reinforce",
}


@contextmanager
def drawing() -> Iterator[None]:
    """Draw in this style, whatever matplotlib is set to; decorates every function that draws."""
    with rc_context(_RC):
        yield


def trial_colour(position: int, n: int, *, hit: bool = False) -> str:
    """Colour of trial `position` (from 0) of n: light to dark in order; green where it hit."""
    if hit:
        return HIT
    share = position / (n - 1) if n > 1 else 1.0
    first, last = np.array(to_rgb(_TRIAL_FIRST)), np.array(to_rgb(_TRIAL_LAST))
    return to_hex(tuple(first + share * (last - first)))


def text_on(colour: str) -> str:
    """Ink or white, whichever is easier to read on a colour."""
    red, green, blue = to_rgb(colour)
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 0.55 else "white"


def new_figure(width: float, height: float, *, laid_out: bool = True) -> Figure:
    """Make an empty figure, in [inch], outside matplotlib's list of figures.

    Matplotlib arranges panels and labels, unless `laid_out` is False: then the caller does.
    """
    layout: Any = "constrained" if laid_out else None
    figure = Figure(figsize=(width, height), dpi=PICTURE_DPI, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def calm_axes(axes: Axes, *, grid: bool = True) -> None:
    """Remove the upper and right spines, and draw the others, ticks and labels in grey."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(LINE)
    axes.tick_params(colors=INK_SOFT, labelcolor=INK_SOFT, length=3, labelsize=9.5)
    axes.xaxis.label.set(color=INK_SOFT, fontsize=10)
    axes.yaxis.label.set(color=INK_SOFT, fontsize=10)
    axes.set_axisbelow(True)
    if grid:
        axes.grid(color="#edf0f2", linewidth=0.8)


def draw_joint(
    axes: Axes,
    form: PlanFormat,
    j: int,
    motions: Iterable[TimedMotion],
    note: str = "",
    **title: Any,
) -> None:
    """Draw column j of motions over time, and its name, unit and a note above it.

    `title` are settings of `Axes.set_title`.
    """
    for times, motion, look in motions:
        axes.plot(times, motion[:, j], **look)
    axes.set_title(f"{form.names[j]} [{form.units[j]}]{note}", **title)


def widen(
    axes: Axes, drawn: Float[np.ndarray, "n H D"], units: Sequence[str], j: int, share: float
) -> None:
    """Leave room around a joint that hardly moves, so that a sensor's noise does not look wild.

    The axis spans at least this share of the largest motion in the joint's unit.
    """
    least = share * largest_of_unit(np.ptp(drawn, axis=(0, 1)), units)[j]
    low, high = axes.get_ylim()
    if high - low < least:
        axes.set_ylim((low + high - least) / 2, (low + high + least) / 2)


def add_legend(
    figure: Figure, marks: Mapping[str, Any], side: str = "left", ncols: int = 3, **more: Any
) -> None:
    """Add a legend above all panels of a figure that is not laid out yet: marks by their meaning.

    It stands at a side, `left` or `center`; `more` are further settings of `Figure.legend`.
    """
    place: Any = f"outside upper {side}"
    grey: Any = {"frameon": False, "fontsize": 9, "labelcolor": INK_SOFT, "ncols": ncols}
    figure.legend(list(marks.values()), list(marks), loc=place, **grey, **more)


def lay_out(figure: Figure) -> None:
    """Compute the layout once and freeze it; `savefig` would draw everything twice.

    Places are rounded: the solver orders its variables by where they lie in memory, so its last
    digits differ from one time to the next, and an SVG names its clip paths by all of them.
    """
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        for axes in figure.axes:
            axes.set_position(np.round(axes.get_position(original=True).bounds, _PLACE_DIGITS))
        with rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
            figure.set_layout_engine(None)  # "none" would be drawn twice as well


def save_figure(figure: Figure, path: Path, digest: str | None = None) -> Path:
    """Write a PNG or an SVG, as its name says, whole or not at all: one figure, the same bytes.

    An SVG says the digest of what it shows, if given, as its description.
    """
    with drawing(), in_place(path) as unfinished:
        lay_out(figure)
        kind = path.suffix.lower()[1:]
        said: dict[str, str | None] = {"Software": None}
        if kind == "svg":
            said = {"Date": None, "Creator": None, "Description": digest}
        figure.savefig(unfinished, format=kind, dpi=PICTURE_DPI, metadata=said)
    return path
