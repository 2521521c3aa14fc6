"""`demo`: demonstrations seen, learned from, and kept for `adapt`."""

from __future__ import annotations

import numpy as np
import pytest
from tests.perception.vision_server import VisionServer

from prior_reinforce.cli import main
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.tasks import make_task


@pytest.mark.slow
def test_what_the_demo_learned_serves_adapt_together_with_what_it_saw(tmp_path, capsys):
    folder = tmp_path / "demo"
    quick = ["--generator", "nearest", "--no-film", "--out"]
    assert main(["demo", "--goals", "1", *quick, str(folder)]) in (0, 1)
    assert "executing 6 demonstrations once, seen by eye" in capsys.readouterr().out
    seen = Demonstrations.load(folder / "demonstrations.npz").outcomes_seen
    recorded = make_task("basketball-v1").demonstrations("A").outcomes_seen
    assert 0.01 < np.abs(seen - recorded).max() < 0.08

    other = ["--rounds", "1", "--no-film", "--out", str(tmp_path / "adapt")]
    adapt = ["adapt", "--task", "basketball-v3", "--model", str(folder / "model"), *other]
    assert main(adapt) == 2
    assert "name what it was learned from with --demonstrations" in capsys.readouterr().err
    assert main([*adapt, "--demonstrations", str(folder / "demonstrations.npz")]) in (0, 1)


@pytest.mark.slow
def test_what_a_model_saw_of_the_demonstrations_is_kept(tmp_path):
    with VisionServer() as server:
        endpoint = ["--perception", "vlm", "--vlm.base-url", server.base_url]
        quick = ["--generator", "nearest", "--goals", "1", "--no-film", "--out", str(tmp_path)]
        assert main(["demo", *endpoint, *quick]) in (0, 1)
    pictures = {path.name for path in (tmp_path / "seen").glob("demonstration*.png")}
    assert pictures == {f"demonstration{number}.png" for number in range(1, 7)}
