"""What a model saw, kept for the operator; and the operator, asked where it saw nothing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import ClassVar

import numpy as np
from rich.console import Console

from prior_reinforce.errors import InvalidFeedbackError, PerceptionFailedError
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.rollouts import Rollout
from prior_reinforce.wording import from_words, say_place


class KeptSight(Perception):
    """A model's perception that leaves every picture, with boxes, and every answer on disk.

    Attributes:
        latest: The latest picture; None where there is none.
    """

    name: ClassVar[str] = "vlm"

    def __init__(self, model: VisionLanguageModel, folder: Path, stem: str) -> None:
        """Keep the readings of what comes one after another: a goal's trials, or demonstrations.

        Args:
            model: Who looks.
            folder: For the pictures; made when there is one.
            stem: Of the files' names; a number from 1 follows.
        """
        self._model = model
        self._folder = folder
        self._stem = stem
        self._n_readings = 0
        self.latest: Path | None = None

    def perceive(self, rollout: Rollout, goal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Look as the model does, and keep what it was shown and said, also where it failed."""
        self._n_readings += 1
        before, self.latest = self._model.last_reading, None
        try:
            return self._model.perceive(rollout, goal, rng)
        finally:
            reading = self._model.last_reading
            if reading is not None and reading is not before:
                self._folder.mkdir(parents=True, exist_ok=True)
                stem = f"{self._stem}{self._n_readings}"
                reading.save(self._folder, stem)
                self.latest = self._folder / f"{stem}.png"


def keeping(sight: Perception, folder: Path, stem: str) -> Perception:
    """The same sight, its readings kept as `KeptSight` says where it is a model's."""
    return KeptSight(sight, folder, stem) if isinstance(sight, VisionLanguageModel) else sight


class Operator:
    """The person at the terminal; nobody and nothing else may make up a number."""

    def __init__(self, console: Console, sight: Perception) -> None:
        """Remember where to talk, and whose pictures to show."""
        self._console = console
        self._sight = sight

    def look(
        self, failure: PerceptionFailedError, rollout: Rollout, goal: np.ndarray, rng: object
    ) -> np.ndarray:
        """Ask for the error of an execution that perception could not see.

        Args:
            failure: Why not.
            rollout: What came of it; not looked at.
            goal: g, shape (k,), in [m].
            rng: Not used.

        Returns:
            Error seen, shape (k,), in [m].

        Raises:
            PerceptionFailedError: There is no terminal to ask at, or no answer.
        """
        if not sys.stdin.isatty():
            raise PerceptionFailedError(
                f"{failure}; there is no terminal to ask at: run in one, or choose another "
                "--perception"
            ) from failure
        self._console.print(f"  not seen: {failure}", highlight=False, markup=False)
        if isinstance(self._sight, KeptSight) and self._sight.latest is not None:
            self._console.print(f"  picture: {self._sight.latest}", highlight=False, markup=False)
        place = say_place(goal, "xyz", ["m"] * len(goal))
        while True:
            try:
                text = input(
                    f"  what was the error, seen from {place}? for instance "
                    '"5cm long, 2cm left", or hit: '
                )
            except EOFError as error:
                raise PerceptionFailedError(f"{failure}; no answer came") from error
            try:
                return from_words(text, len(goal))
            except InvalidFeedbackError as error:
                self._console.print(f"  {error}", highlight=False, markup=False)
