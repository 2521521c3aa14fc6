"""The report of adaptations: pictures drawn, numbers put into words, one page written."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.report.curves import draw_errors, draw_plans
from prior_reinforce.report.html import data_uri, render, write_text
from prior_reinforce.report.pictures import draw_aims, draw_landings, draw_overview, draw_table
from prior_reinforce.report.record import AdaptationRecord
from prior_reinforce.report.style import save_png, trial_colour
from prior_reinforce.report.summary import (
    TrialRow,
    describe,
    headline,
    knows_truth,
    outcome_line,
    title_of,
    trial_rows,
)
from prior_reinforce.report.wording import say_length, say_place

LARGEST_INLINE_VIDEO = 3_000_000
"""[bytes]; a larger film lies beside the page instead of inside it, so that the page opens fast."""


@dataclass(frozen=True)
class Picture:
    """A picture on the page."""

    source: str
    alt: str
    caption: str
    wide: bool = False


@dataclass(frozen=True)
class GoalSection:
    """All that the page shows of one goal."""

    anchor: str
    title: str
    place: str
    tolerance: str
    outcome: str
    reached: bool
    rows: list[TrialRow]
    colours: list[str]
    pictures: list[Picture]
    strip: str
    video: str
    film_caption: str


def write_report(
    folder: str | os.PathLike[str],
    adaptations: Sequence[AdaptationRecord],
    *,
    title: str,
    facts: Mapping[str, str] | None = None,
    region: ArrayLike | None = None,
) -> Path:
    """Write `report.html`, whole in one file, and its pictures as PNGs beside it.

    Args:
        folder: Where to write; made if need be. A film elsewhere is copied here when it is too
            large to go into the page.
        adaptations: Goals in the order to be shown, at least one.
        title: Of the page.
        facts: What made these results: generator, adapter, perception, seeds, version.
        region: Reachable region of goals, lower and upper corner, shape (2, k).

    Returns:
        Path of the page.

    Raises:
        ConfigurationError: No adaptations, or a region of wrong shape.
    """
    if not adaptations:
        raise ConfigurationError("a report needs at least one adaptation, got none")
    box = None if region is None else np.array(region, dtype=float)
    for record in adaptations:
        if box is not None and box.shape != (2, record.outcome_dim):
            raise ConfigurationError(
                f"region must have shape (2, {record.outcome_dim}), lower and upper corner, got "
                f"{box.shape}"
            )
    folder = Path(folder)
    sections = [
        _section(folder, record, number, box) for number, record in enumerate(adaptations, start=1)
    ]
    page = render(
        "page.html",
        title=title,
        headline=headline(adaptations),
        overview=_overview(folder, adaptations, box),
        sections=sections,
        any_truth=any(knows_truth(record) for record in adaptations),
        facts=dict(facts or {}),
    )
    return write_text(folder / "report.html", page)


def _overview(
    folder: Path, records: Sequence[AdaptationRecord], region: np.ndarray | None
) -> Picture | None:
    """Draw all goals on one table; None where they have no table in common."""
    demonstrations = records[0].demonstrations
    if len(records) == 1 or any(r.demonstrations is not demonstrations for r in records):
        return None
    return _picture(
        draw_overview(records, region),
        folder / "overview.png",
        alt=" ".join(
            f"{title_of(r, i)}: {outcome_line(r)}." for i, r in enumerate(records, start=1)
        ),
        caption="The table as seen from behind the robot. An arrow leads from each goal to where "
        "a trial was seen to land.",
    )


def _section(
    folder: Path, record: AdaptationRecord, number: int, region: np.ndarray | None
) -> GoalSection:
    title = title_of(record, number)
    stem = f"goal-{number}"
    story = describe(record)
    truth = " Hollow marks: where it truly landed." if knows_truth(record) else ""
    tolerance = say_length(record, record.tolerance)
    pictures = [
        _picture(
            draw_table(record, region),
            folder / f"{stem}-table.png",
            alt=f"The whole table. {story}",
            caption="The whole table, as seen from behind the robot.",
        ),
        _picture(
            draw_landings(record),
            folder / f"{stem}-landings.png",
            alt=f"Close-up of the goal with all landing points. {story}",
            caption="Close up: where each trial was seen to land. Arrows are the errors; the "
            f"circle is {tolerance} around the goal.{truth}",
        ),
        _picture(
            draw_aims(record),
            folder / f"{stem}-aims.png",
            alt="Where each trial was aimed. "
            + " ".join(f"Trial {row.number}: {row.aim}." for row in trial_rows(record)),
            caption="On the same scale: where each trial was aimed. This is the condition given "
            "to the generator, moved after every trial.",
        ),
        _picture(
            draw_errors(record),
            folder / f"{stem}-errors.png",
            alt="Distance from the goal by trial. "
            + " ".join(f"Trial {row.number}: {row.off}." for row in trial_rows(record)),
            caption="Distance from the goal, trial by trial.",
        ),
        _picture(
            draw_plans(record),
            folder / f"{stem}-plans.png",
            alt=f"Plans of all trials over time, {record.demonstrations.action_dim} action "
            f"dimensions: {', '.join(record.demonstrations.format.names)}.",
            caption="The plans of all trials, over those demonstrated. Small changes of the whole "
            "motion move the landing point.",
            wide=True,
        ),
    ]
    n = len(record.trials)
    return GoalSection(
        anchor=stem,
        title=title,
        place=say_place(record, record.goal),
        tolerance=tolerance,
        outcome=outcome_line(record),
        reached=record.trials_to_hit is not None,
        rows=trial_rows(record),
        colours=[trial_colour(i, n, hit=t.hit) for i, t in enumerate(record.trials)],
        pictures=pictures,
        strip="" if record.film is None else data_uri(record.film.strip),
        video="" if record.film is None else _video(folder, record.film.video),
        film_caption=record.film_caption,
    )


def _picture(figure: Figure, path: Path, *, alt: str, caption: str, wide: bool = False) -> Picture:
    return Picture(data_uri(save_png(figure, path)), alt, caption, wide)


def _video(folder: Path, video: Path) -> str:
    """Address of a film: its bytes where they are few, else a file beside the page."""
    if video.stat().st_size <= LARGEST_INLINE_VIDEO:
        return data_uri(video)
    beside = folder / video.name
    if beside.resolve() != video.resolve():
        shutil.copyfile(video, beside)
    return video.name
