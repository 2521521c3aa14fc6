"""Goals of a simulated task, worked through one after another and told in a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.lab.experiments.protocol import GoalTrials
from prior_reinforce.perception.base import Perception
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading, as_tolerance
from prior_reinforce.report import AdaptationRecord, Film, record_film, write_report
from prior_reinforce.wording import say_tolerance

if TYPE_CHECKING:
    from prior_reinforce.perception.vlm import VisionLanguageModel

FilmOrWhyNot = tuple[Film | None, str]
"""A film with its caption, or the line that says why there is none."""


class RecordingPerception(Perception):
    """A perception by pictures that leaves every picture, with boxes, and every answer on disk.

    Attributes:
        latest: The latest picture; None where there is none.
    """

    def __init__(self, perception: VisionLanguageModel, folder: Path, stem: str) -> None:
        """Keep the readings of what comes one after another: a goal's trials, or demonstrations.

        Args:
            perception: Who looks.
            folder: For the pictures; made when there is one.
            stem: Of the files' names; a number from 1 follows.
        """
        self._perception = perception
        self._folder = folder
        self._stem = stem
        self._n_readings = 0
        self.latest: Path | None = None

    def perceive(self, rollout: Rollout, goal: Point, rng: np.random.Generator) -> Reading:
        """Look, and keep what was shown and said, also where it failed."""
        self._n_readings += 1
        before, self.latest = self._perception.last_reading, None
        try:
            return self._perception.perceive(rollout, goal, rng)
        finally:
            reading = self._perception.last_reading
            if reading is not None and reading is not before:
                self._folder.mkdir(parents=True, exist_ok=True)
                stem = f"{self._stem}{self._n_readings}"
                reading.save(self._folder, stem)
                self.latest = self._folder / f"{stem}.png"


def recording(perception: Perception, folder: Path, stem: str) -> Perception:
    """The same perception, its readings kept where it reads pictures; see `RecordingPerception`."""
    if not hasattr(perception, "last_reading"):
        return perception
    return RecordingPerception(perception, folder, stem)  # type: ignore[arg-type]


def film_last_trial(
    task: Task, result: GoalTrials, seed: int, folder: Path, name: str
) -> FilmOrWhyNot:
    """Film the last trial of a goal as `run_goals` executed it with this seed."""
    last = result.trials[-1]
    assert last.plan is not None
    try:
        frames = task.film(
            last.plan, result.goal, np.random.default_rng([seed, 0, len(result.trials)])
        )
        film = record_film(frames, folder, name)
    except RenderingUnavailableError as error:
        return None, f"no film: {error}"
    return film, f"trial {last.number}, " + ("which reached the goal" if last.hit else "a miss")


def report_adaptation(
    folder: Path,
    task: Task,
    demonstrations: Demonstrations,
    results: Sequence[GoalTrials],
    films: Sequence[FilmOrWhyNot],
    facts: Mapping[str, str],
) -> Path:
    """Write the report of goals that were worked through on a task, with a film each.

    `facts` says what else is known of the run, by its heading.

    Returns:
        Path of the page.
    """
    units = demonstrations.outcome_units
    names = demonstrations.outcome_names
    tolerance = say_tolerance(as_tolerance(task.tolerance, names, units), names, units)
    records = [
        AdaptationRecord(
            number=i,
            demonstrations=demonstrations,
            goal=result.goal,
            tolerance=task.tolerance,
            trials=result.trials,
            outcomes=tuple(rollout.outcome for rollout in result.rollouts),
            film=film,
            film_caption=caption,
        )
        for i, (result, (film, caption)) in enumerate(zip(results, films, strict=True), start=1)
    ]
    return write_report(
        folder,
        records,
        title=f"{task.name}: {len(results)} new goal" + ("s" if len(results) > 1 else ""),
        facts={
            "Task": f"{task.name}, tolerance {tolerance}",
            **facts,
            "Version": version("prior-reinforce"),
        },
        region=task.region,
    )
