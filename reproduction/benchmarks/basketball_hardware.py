"""What V1's demonstrations do on the other hardware of Basketball Shot.

    python reproduction/benchmarks/basketball_hardware.py [--repetitions 32] [--seed 0] \
        [--picture three.png]

prints, for V1, V2 and V3: how far the twelve plans of both prior sets land from where they land on
V1 (undisturbed), how far the same plan, repeated with disturbances, spreads, and how many balls are
lost; the last column is for a map of 20 x 9 throws that reaches beyond the region on every side.
With --picture it draws one demonstration on all three, at V1's outcome and as it lands.
"""

from __future__ import annotations

import argparse
import copy
import os
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from prior_reinforce.environment import Rollout
from prior_reinforce.simulation.tasks.basketball import HARDWARE, BasketballShot
from reproduction.demonstrations import basketball as making

DRAWN = 5
"""The demonstration of set A that the picture shows: one to the middle of the region."""


def read(rollouts: list[Rollout]) -> tuple[np.ndarray, int]:
    """Outcomes, shape (n, 2), in [m], and the number of lost balls."""
    return (
        np.array([rollout.outcome for rollout in rollouts]),
        sum(not rollout.valid for rollout in rollouts),
    )


def throws_map(task: BasketballShot) -> np.ndarray:
    """A map of the family of throws in reach and direction, shape (180, H, 7), in [rad]."""
    return np.stack(
        [
            making.throw(
                0.3,
                1.0,
                (1.0 + making.SWING_PER_REACH * reach) * making.SWING,
                making.READY + reach * making.LEAN + direction * np.eye(7)[0],
                task.format.dt,
            )
            for reach in np.linspace(-0.18, 0.2, 20)
            for direction in np.linspace(-0.3, 0.3, 9)
        ]
    )


def draw(path: Path) -> None:
    """One demonstration on V1, V2 and V3, with the goal where it landed on V1."""
    plan = BasketballShot().demonstrations("A").plans[DRAWN]
    promised = BasketballShot().rollout(plan[None], None)[0].outcome
    columns = []
    for hardware in HARDWARE:
        task = hardware()
        (rollout,) = task.rollout(plan[None], None)
        ready, frame = task._start(plan[0], np.zeros(2)), rollout.key_frame
        assert frame is not None
        states = (ready[1 : 1 + task.model.nq], frame.state)
        columns.append(
            np.vstack(
                [_photograph(task, state, promised, close=k == 0) for k, state in enumerate(states)]
            )
        )
    picture = Image.fromarray(np.hstack(columns))
    for k in range(len(HARDWARE)):
        ImageDraw.Draw(picture).text((400 * k + 14, 10), f"V{k + 1}", fill="black", font_size=32)
    picture.save(path, optimize=True)


def _photograph(
    task: BasketballShot, state: np.ndarray, goal: np.ndarray, *, close: bool
) -> np.ndarray:
    """The spoon from the side (close) or the table from above; shape (height, width, 3)."""
    model = copy.copy(task.model)
    data = mujoco.MjData(model)
    data.qpos[:] = state
    data.mocap_pos[model.body("goal").mocapid[0]] = [*goal, 0.0]
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    if close:
        camera.lookat[:] = data.body("tool/tool").xpos + np.array([0.0, 0.0, 0.14])
        camera.distance, camera.azimuth, camera.elevation = 0.55, 90.0, -8.0
    else:
        camera.lookat[:] = [*(goal - [0.03, 0.0]), 0.08]
        camera.distance, camera.azimuth, camera.elevation = 0.60, 140.0, -40.0
    with mujoco.Renderer(model, 300, 400) as renderer:
        renderer.update_scene(data, camera)
        picture: np.ndarray = renderer.render()
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    if options.picture:
        draw(options.picture)
        return
    original = BasketballShot()
    plans = np.concatenate(
        [original.demonstrations(name).plans for name in original.demonstration_sets]
    )
    on_v1, _ = read(original.rollout(plans, None))
    print(
        "| | shift along x | along y | distance, largest | repeated: sd x, y | lost | map, lost |"
    )
    print("|---|---|---|---|---|---|---|")
    for hardware in HARDWARE:
        task = hardware()
        landed, _ = read(task.rollout(plans, None))
        shift = 100 * (landed - on_v1)
        distance = np.linalg.norm(shift, axis=1)
        rng = np.random.default_rng(options.seed)
        repeated, lost = read(task.rollout(np.repeat(plans, options.repetitions, axis=0), rng))
        spread = 100 * repeated.reshape(len(plans), -1, 2).std(axis=1)
        reached, lost_map = read(task.rollout(throws_map(task), None))
        far = np.linalg.norm(reached, axis=1)
        print(
            f"| {task.name} | {shift[:, 0].mean():.1f} cm, sd {shift[:, 0].std():.1f} "
            f"| {shift[:, 1].mean():.1f} cm, sd {shift[:, 1].std():.1f} "
            f"| {distance.mean():.1f} cm, {distance.max():.1f} "
            f"| {spread[:, 0].mean():.2f}, {spread[:, 1].mean():.2f} cm "
            f"({spread.min():.2f} to {spread.max():.2f}) "
            f"| {lost} of {len(repeated)} "
            f"| {far.min():.2f} to {far.max():.2f} m, {lost_map} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
