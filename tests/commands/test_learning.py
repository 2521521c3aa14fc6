"""Learning tells when its main feature is lost, and says nothing otherwise."""

import io
from dataclasses import replace

import pytest
from rich.console import Console

from prior_reinforce.commands.learning import learn
from prior_reinforce.generators import (
    DiffusionConfig,
    DiffusionGenerator,
    NearestNeighbours,
    UNetRegression,
    UNetRegressionConfig,
)
from prior_reinforce.generators.unet_size import UNetSize
from prior_reinforce.tasks import make_task

TINY = UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=8)
DIFFUSION = DiffusionConfig(network=TINY, training_steps=1)
REGRESSION = UNetRegressionConfig(network=TINY, training_steps=1)


def told(generator, folder, *, frames: int) -> str:
    """What `learn` prints for basketball's set A, of which only so many frames were recorded."""
    demonstrations = make_task("basketball-v1").demonstrations("A")
    demonstrations = replace(demonstrations, plans=demonstrations.plans[:, :frames])
    text = io.StringIO()
    console = Console(file=text, width=400)
    learn(demonstrations, folder, generator=generator, seed=0, console=console)
    return text.getvalue()


@pytest.mark.parametrize(
    "generator",
    [DiffusionGenerator(DIFFUSION, threads=1), UNetRegression(REGRESSION, threads=1)],
    ids=["diffusion", "regression"],
)
def test_a_recording_cut_off_in_mid_swing_is_told_in_one_line(generator, tmp_path):
    lines = [line for line in told(generator, tmp_path, frames=80).splitlines() if "rest" in line]
    assert len(lines) == 1
    assert "start times are not learned" in lines[0]
    assert "demonstration" in lines[0]
    assert "last frame" in lines[0]


@pytest.mark.parametrize(
    ("generator", "frames"),
    [
        (DiffusionGenerator(DIFFUSION, threads=1), 140),
        (DiffusionGenerator(replace(DIFFUSION, start_times=False), threads=1), 80),
        (NearestNeighbours(), 80),
    ],
    ids=["all is well", "switched off", "knows no start times"],
)
def test_nothing_is_told_where_nothing_is_lost(generator, frames, tmp_path):
    assert "start times" not in told(generator, tmp_path, frames=frames)
