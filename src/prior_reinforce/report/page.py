"""The report of goals: pictures drawn, numbers put into words, one page written."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

import prior_reinforce
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.files import sha256, write
from prior_reinforce.report import summary
from prior_reinforce.report.html import data_uri, render
from prior_reinforce.report.record import AdaptationRecord, Box
from prior_reinforce.wording import in_words, say_place, say_tolerance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGEST_INLINE_FILE = 3_000_000
"""[bytes]; a larger film or photograph lies beside the page, so that the page opens fast."""

LARGEST_PAGE = 6_000_000
"""[bytes] of pictures in the page, the latest goals' first; those of earlier goals stay beside."""

_OF_A_GOAL = re.compile(r"goal-\d+-(?:table|landings|aims|errors|plans)\.svg")
_HEAD = re.compile(
    r'<svg [^>]*width="([\d.]+)pt".*<dc:description>(\w+)</dc:description>', re.DOTALL
)
"""Width of a picture in [points], and the digest of what it was drawn from."""


def write_report(
    folder: str | os.PathLike[str],
    adaptations: Sequence[AdaptationRecord],
    *,
    title: str,
    facts: Mapping[str, str] | None = None,
    region: ArrayLike | None = None,
    note: str = "",
    reach: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write `report.html` and its pictures as SVGs beside it, whole in one file while it is small.

    A picture that an earlier report left there is drawn again only if what it shows has changed,
    so that goals that are over cost nothing; those of goals that this one has not are removed.

    Returns the path of the page. ConfigurationError for no adaptations, two of one number, or a
    region of wrong shape.

    Args:
        folder: Made if need be. A film elsewhere is copied here if it is too large for the page.
        adaptations: Goals in the order to be shown.
        title: Of the page.
        facts: What made these results: generator with its remarks, adapter, perception, seeds.
        region: Region of goals, lower and upper corner, shape (2, k).
        note: What else is to be said under the headline.
        reach: Picture (PNG) of the goals that can be reached, if there is one.
        progress: Called with the number of goals drawn, and of all, after each.
    """
    if not adaptations:
        raise ConfigurationError("a report needs at least one adaptation, got none")
    box = None if region is None else np.array(region, dtype=float)
    for k in {record.goal.size for record in adaptations}:
        if box is not None and box.shape != (2, k):
            raise ConfigurationError(
                f"region must have shape (2, {k}), lower and upper corner, got {box.shape}"
            )
    if len(set(summary.numbers(adaptations))) < len(adaptations):
        raise ConfigurationError(
            f"two goals go by one number in {summary.numbers(adaptations)}; number all or none"
        )
    folder, several = Path(folder), len(adaptations) > 1
    code = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    drawn_by = prior_reinforce.__version__, version("matplotlib"), sha256(code)
    first = adaptations[0].demonstrations
    overview = by_goal = None
    sections = []
    for number, called, record in zip(
        summary.numbers(adaptations), summary.titles(adaptations), adaptations, strict=True
    ):
        sections.append(_section(folder, record, f"goal-{number}", called, box, drawn_by))
        if progress is not None:
            progress(len(sections), len(adaptations))
    if several:
        from prior_reinforce.report.curves import draw_trials_by_goal

        draw = partial(draw_trials_by_goal, adaptations)
        by_goal = _picture(draw, folder / "trials-by-goal.svg", _digest([adaptations, drawn_by]))
    if several and all(record.demonstrations is first for record in adaptations):
        from prior_reinforce.report.places import draw_table

        draw = partial(draw_table, adaptations, box)
        overview = _picture(draw, folder / "overview.svg", _digest([adaptations, box, drawn_by]))
    pictures = [picture for s in reversed(sections) for picture in s["pictures"].values()]
    room = LARGEST_PAGE
    for picture in (*filter(None, (overview, by_goal)), *pictures):
        room -= picture["path"].stat().st_size * 4 // 3
        picture["source"] = data_uri(picture["path"]) if room > 0 else picture["path"].name
    page = render(
        "page.html",
        title=title,
        headline=summary.headline(adaptations),
        overview=overview,
        by_goal=by_goal,
        sections=sections,
        note=note,
        reach={"source": data_uri(reach), "wide": False} if reach else None,
        from_behind=first.outcome_dim > 1 and in_words(first.outcome_format),
        any_truth=any(_knows_truth(record) for record in adaptations),
        words=summary.explain_words(adaptations[0]),
        any_called=any(row.off.startswith(summary.CALLED) for s in sections for row in s["rows"]),
        facts=dict(facts or {}),
    )
    drawn = {f"{s['anchor']}-{name}.svg" for s in sections for name in s["pictures"]}
    if (folder / "report.html").exists():  # an earlier one, whose pictures are not to be mixed in
        for old in folder.glob("goal-*.*"):
            if _OF_A_GOAL.fullmatch(old.name) and old.name not in drawn:
                old.unlink(missing_ok=True)
    return write(folder / "report.html", page)


def _section(
    folder: Path,
    record: AdaptationRecord,
    stem: str,
    title: str,
    region: Box | None,
    drawn_by: tuple[str, ...],
) -> Mapping[str, Any]:
    """All that the page shows of one goal; see `page.html`."""
    from prior_reinforce.report.curves import draw_errors, draw_plans
    from prior_reinforce.report.places import draw_close_up, draw_table
    from prior_reinforce.report.style import trial_colour

    n, digest = len(record.trials), _digest([record, region, drawn_by])
    draw: dict[str, Callable[[], Figure]] = {"table": partial(draw_table, [record], region)}
    if record.told:
        draw["landings"] = partial(draw_close_up, record)
        draw["errors"] = partial(draw_errors, record)
    if record.trials:
        draw["aims"] = partial(draw_close_up, record, aims=True)
        draw["plans"] = partial(draw_plans, record)
    return {
        "record": record,
        "anchor": stem,
        "title": title,
        "place": say_place(record.goal, record.format),
        "tolerance": say_tolerance(record.format),
        "outcome": summary.outcome_line(record),
        "rows": summary.trial_rows(record),
        "colours": [trial_colour(i, n, hit=trial.hit) for i, trial in enumerate(record.trials)],
        "knows_truth": _knows_truth(record),
        "expects": any(trial.expected.p_hit is not None for trial in record.trials),
        "photographs": [(said, _file(folder, picture)) for said, picture in record.photographs],
        "strip": record.film and data_uri(record.film.strip),
        "video": record.film and _file(folder, record.film.video),
        "pictures": {
            name: _picture(drawn, folder / f"{stem}-{name}.svg", digest)
            for name, drawn in draw.items()
        },
    }


def _picture(draw: Callable[[], Figure], path: Path, digest: str) -> dict[str, Any]:
    """A picture's file, drawn unless an earlier one shows the same."""
    from prior_reinforce.report.style import save_figure

    if (found := _head(path)) is None or found[2] != digest:
        found = _head(save_figure(draw(), path, digest))
    assert found is not None  # as it was just written
    return {"path": path, "wide": float(found[1]) > 6 * 72}


def _head(path: Path) -> re.Match[str] | None:
    if not path.is_file():
        return None
    with path.open(encoding="utf-8", errors="replace") as file:
        return _HEAD.search(file.read(1000))


def _digest(shown: object) -> str:
    """Fingerprint of what a picture shows."""

    def plain(value: object) -> object:
        return value.tobytes() if isinstance(value, np.ndarray) else str(value)

    return sha256(msgspec.msgpack.encode(shown, enc_hook=plain))


def _knows_truth(record: AdaptationRecord) -> bool:
    return any(outcome is not None for outcome in record.true_outcomes)


def _file(folder: Path, path: Path) -> str:
    """Address of a film or a photograph: its bytes where they are few, else a file beside it."""
    if path.stat().st_size <= LARGEST_INLINE_FILE:
        return data_uri(path)
    beside = folder / path.name
    if beside.resolve() != path.resolve():
        shutil.copyfile(path, beside)
    return path.name
