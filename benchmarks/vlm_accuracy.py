"""How far the error seen by a vision-language model is from the true one, over many pictures.

    python benchmarks/vlm_accuracy.py basketball-v1 [--pictures 200] [--outliers 0.1] [--seed 0]
    python benchmarks/vlm_accuracy.py basketball-v1 --base-url http://host:8000/v1 \
        --model zai-org/GLM-4.5V --family glm-4.5v

The trials are the shipped demonstrations' plans, executed in physics with disturbances; half of the
goals are drawn from the whole region, half within 10 cm of the outcome, where objects hide each
other. Without --base-url the answers come from the stand-in, which finds the objects by colour in
the very picture it is sent: that measures everything but the model's eyesight. With it, the same
pictures measure a real model.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np

from prior_reinforce.errors import PerceptionFailedError
from prior_reinforce.perception import VisionLanguageModel, VisionLanguageModelConfig, scene_of
from prior_reinforce.perception.stand_in_server import StandInServer
from prior_reinforce.rollouts import Rollout
from prior_reinforce.tasks import make_task
from prior_reinforce.tasks.base import Task

NEAR = 0.10  # [m]


def trials(task: Task, n: int, rng: np.random.Generator) -> Iterator[tuple[Rollout, np.ndarray]]:
    """Yield n trials that reached the plane of the outcome, each with a goal, shape (2,)."""
    plans = np.concatenate([task.demonstrations(name).plans for name in task.demonstration_sets])
    low, high = task.region
    made = 0
    while made < n:
        for rollout in task.rollout(plans[rng.permutation(len(plans))], rng):
            if not rollout.valid or made == n:
                continue
            goal = task.sample_goals(1, rng)[0]
            if made % 2:
                goal = np.clip(rollout.outcome + rng.uniform(-NEAR, NEAR, 2), low, high)
            made += 1
            yield rollout, goal


def measure(
    perception: VisionLanguageModel, task: Task, arguments: argparse.Namespace
) -> tuple[np.ndarray, list[str], float]:
    """Return how far each error seen is from the truth [m], the failures, and s a picture."""
    rng = np.random.default_rng(arguments.seed)
    misses, failures = [], []
    spent = 0.0
    for i, (rollout, goal) in enumerate(trials(task, arguments.pictures, rng)):
        miss = np.inf
        began = time.perf_counter()
        try:
            seen = perception.perceive(rollout, goal, rng)
            miss = float(np.linalg.norm(seen - (rollout.outcome - goal)))
            misses.append(miss)
        except PerceptionFailedError as error:
            failures.append(f"picture {i}: {error}")
        spent += time.perf_counter() - began
        doubtful = miss > arguments.save_above
        if arguments.save is not None and doubtful and perception.last_reading is not None:
            arguments.save.mkdir(parents=True, exist_ok=True)
            perception.last_reading.save(arguments.save, f"{task.name}-{i:03}")
    return np.array(misses), failures, spent / arguments.pictures


def show(title: str, misses: np.ndarray, failures: list[str], seconds: float) -> None:
    """Print one line of figures, and the failures below it."""
    centimetres = 100 * misses
    print(
        f"{title:28} {len(misses):4} read  miss [cm]: median {np.median(centimetres):.2f}  "
        f"95 % {np.quantile(centimetres, 0.95):.2f}  worst {centimetres.max():.2f}  "
        f"within 1 cm {(centimetres <= 1).mean():.1%}  operator asked {len(failures)}  "
        f"({seconds:.2f} s a picture)"
    )
    for failure in failures:
        print(f"    {failure}")


def main() -> None:
    """Measure one task, with the stand-in or with a real endpoint."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task")
    parser.add_argument("--pictures", type=int, default=200)
    parser.add_argument("--outliers", type=float, default=0.0, help="share of wrong answers")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--family", default="glm-4.5v")
    parser.add_argument("--base-url", help="a real endpoint, in place of the stand-in")
    parser.add_argument("--model", default="zai-org/GLM-4.5V")
    parser.add_argument("--server", default="vllm", choices=["vllm", "zai", "plain"])
    parser.add_argument("--api-key-variable")
    parser.add_argument("--save", type=Path, help="folder for pictures and answers")
    parser.add_argument("--save-above", type=float, default=0.01, help="save misses above, in m")
    arguments = parser.parse_args()

    task = make_task(arguments.task)
    with contextlib.ExitStack() as stack:
        url = arguments.base_url
        if url is None:
            stand_in = StandInServer(
                arguments.family, outlier_rate=arguments.outliers, seed=arguments.seed
            )
            url = stack.enter_context(stand_in).base_url
        config = VisionLanguageModelConfig(
            base_url=url,
            model=arguments.model,
            family=arguments.family,
            server=arguments.server,
            api_key_variable=arguments.api_key_variable,
        )
        perception = VisionLanguageModel(scene_of(task.name), config)
        stack.callback(perception.close)
        title = f"{task.name}, {100 * arguments.outliers:g} % outliers"
        show(title, *measure(perception, task, arguments))


if __name__ == "__main__":
    main()
