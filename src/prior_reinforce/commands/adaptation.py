"""Working through goals on a simulated task, trial by trial, with a live view and a report."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rich.console import Console

from prior_reinforce.commands.live import LiveView
from prior_reinforce.commands.operator import Operator, keeping
from prior_reinforce.commands.task_options import Simulated
from prior_reinforce.errors import RenderingUnavailableError
from prior_reinforce.experiments.methods import make_adapter
from prior_reinforce.experiments.protocol import GoalTrials, run_goals
from prior_reinforce.experiments.sight import MODEL
from prior_reinforce.generators import Generator
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.vlm import VisionLanguageModel
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.report import AdaptationRecord, Film, record_film, write_report
from prior_reinforce.tasks.base import Task

SEEN = "seen"
"""Folder beside the report for what a model saw and said."""


@dataclass(frozen=True)
class Adaptation(Simulated):
    """How goals are worked through, and where the report goes."""

    perception: str = "eye"
    """How a trial's error is seen: exact, eye, amplified, vlm (a vision-language model, --vlm.*),
    camera (the same way without a model: objects found by colour), or one's own as
    module:Class."""
    vlm: VisionLanguageModelConfig = field(default_factory=VisionLanguageModelConfig)
    """Endpoint and model for --perception vlm (docs/perception.md)."""
    adapter: str = "gp"
    """How the condition is corrected: gp (m = 2), gp-all (m = infinity), proportional, frozen, or
    one's own as module:Class."""
    rounds: int = 10
    """Trials at most."""
    out: Path = Path("runs/adapt")
    """Folder for the report."""
    film: bool = True
    """Draw the last trial as a film."""


def adapt(
    settings: Adaptation,
    task: Task,
    demonstrations: Demonstrations,
    generator: Generator,
    sight: Perception,
    goals: np.ndarray,
    console: Console,
    *,
    outcomes: str = "as recorded",
) -> list[GoalTrials]:
    """Work through the goals one after another, with a live view, and write the report.

    `outcomes` says in the report how those of the demonstrations are known.
    """
    view = LiveView(console, demonstrations.n)
    results: list[GoalTrials] = []
    films: list[tuple[Film | None, str]] = []
    for i, goal in enumerate(goals):
        view.goal(i + 1, len(goals), goal)
        seed = settings.seed + i
        kept = keeping(sight, settings.out / SEEN, f"goal{i + 1}-trial")
        (result,) = run_goals(
            task,
            generator,
            lambda: make_adapter(settings.adapter),
            kept,
            demonstrations,
            goal[None],
            rounds=settings.rounds,
            seed=seed,
            on_round=lambda _, so_far: view.trial(so_far[0]),
            on_failed_reading=Operator(console, kept).look,
        )
        view.end(result)
        results.append(result)
        films.append(_film(settings, task, result, seed, i + 1, console))
    view.summary(results)
    page = write_report(
        settings.out,
        [
            AdaptationRecord(
                title=f"Goal {i}",
                demonstrations=demonstrations,
                goal=result.goal,
                tolerance=task.tolerance,
                trials=result.trials,
                outcomes=tuple(rollout.outcome for rollout in result.rollouts),
                film=film,
                film_caption=caption,
            )
            for i, (result, (film, caption)) in enumerate(zip(results, films, strict=True), start=1)
        ],
        title=f"{task.name}: {len(goals)} new goal" + ("s" if len(goals) > 1 else ""),
        facts={
            "Task": f"{task.name}, tolerance {task.tolerance * 100:g} cm",
            "Demonstrations": f"{demonstrations.n}, {settings.demonstrations}, outcomes {outcomes}",
            "Generator": generator.name,
            "Adapter": settings.adapter,
            "Perception": _seen_by(settings),
            "Seed": str(settings.seed),
            "Version": version("prior-reinforce"),
        },
        region=task.region,
    )
    console.print(f"report: {page}", soft_wrap=True)
    if isinstance(sight, VisionLanguageModel):
        console.print(
            f"what the model saw, with boxes, and all that it said: {settings.out / SEEN}"
        )
    return results


def _seen_by(settings: Adaptation) -> str:
    if settings.perception == MODEL:
        return f"{MODEL}, {settings.vlm.model} at {settings.vlm.base_url}"
    return settings.perception


def _film(
    settings: Adaptation, task: Task, result: GoalTrials, seed: int, number: int, console: Console
) -> tuple[Film | None, str]:
    """Film the last trial as it was executed, with a caption that says why where none is drawn."""
    last = result.trials[-1]
    if not settings.film:
        return None, "no film was asked for"
    try:
        frames = task.film(last.plan, result.goal, np.random.default_rng([seed, 0, last.number]))
        film = record_film(frames, settings.out, f"goal{number}")
    except RenderingUnavailableError as error:
        console.print(f"no film: {error}")
        return None, f"no film: {error}"
    return film, f"trial {last.number}, " + ("which reached the goal" if last.hit else "a miss")
