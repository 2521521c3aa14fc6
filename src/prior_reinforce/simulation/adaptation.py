"""What a report of a simulated task shows: what was seen, and each goal's trials and film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from prior_reinforce.arrays import Point
from prior_reinforce.environment import Rollout, Task
from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.perception.base import Perception
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.readings import Reading
from prior_reinforce.report import AdaptationRecord, record_film
from prior_reinforce.simulation.protocol import GoalTrials

if TYPE_CHECKING:
    from prior_reinforce.perception.vlm import VisionLanguageModel


class RecordingPerception(Perception):
    """A perception by pictures that leaves every picture, with boxes, and every answer on disk."""

    def __init__(self, perception: VisionLanguageModel, folder: Path, stem: str) -> None:
        """Keep readings of what comes one after another in a folder, called `stem` and a number."""
        self._perception = perception
        self._folder = folder
        self._stem = stem
        self._n_readings = 0
        self.latest: Path | None = None
        """The latest picture."""

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


def goal_record(
    task: Task,
    demonstrations: Demonstrations,
    result: GoalTrials,
    number: int,
    *,
    film_in: Path | None,
    seed: int,
) -> AdaptationRecord:
    """Return what the report tells of a goal by its number, with a film of its last trial.

    It is in `film_in`, None draws none; `seed` is what `reach_goals` executed the trials with.
    """
    last, film, caption = result.trials[-1], None, "no film was asked for"
    if film_in is not None:
        disturbances = np.random.default_rng([seed, 0, len(result.trials)])
        try:
            frames = task.film(last.plan, result.goal, disturbances)
            film = record_film(frames, film_in, f"goal{number}")
            caption = f"trial {last.number}, {'which reached the goal' if last.hit else 'a miss'}"
        except RenderingUnavailableError as error:
            caption = f"no film: {error}"
    return AdaptationRecord(
        number=number,
        demonstrations=demonstrations,
        goal=result.goal,
        tolerance=task.tolerance,
        trials=result.trials,
        outcomes=tuple(rollout.outcome for rollout in result.rollouts),
        film=film,
        film_caption=caption,
    )
