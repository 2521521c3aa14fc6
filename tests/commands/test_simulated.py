"""`demo`, `adapt` and `rollout`: what they print, keep and refuse."""

from __future__ import annotations

import json
import os
import pty
import re
import sys

import numpy as np
import pytest

from prior_reinforce.cli import main
from prior_reinforce.generators import make_generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.learned import save_learned
from prior_reinforce.simulation.tasks import make_task
from tests.perception.vision_server import VisionServer, vlm_file

GOAL = ("1.0", "0.05")


@pytest.fixture
def nobody(tmp_path_factory):
    """Options that ask a model where none is."""
    file = vlm_file(tmp_path_factory.mktemp("vlm"), "http://127.0.0.1:9/v1")
    return "--perception=vlm", f"--vlm={file}"


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A quick generator, saved as `learn` saves one."""
    folder = tmp_path_factory.mktemp("model")
    demonstrations = make_task("basketball-v1").demonstrations("A")
    generator = make_generator("interpolation,timing=align").fit(demonstrations, seed=0)
    save_learned(folder, generator, demonstrations, seed=0)
    return folder


@pytest.fixture
def adapt(model, tmp_path):
    def run(*flags: str) -> int:
        where = ("--goal", *GOAL, "--model", str(model), "--out", str(tmp_path), "--no-film")
        return main(["adapt", *where, *flags])

    return run


@pytest.fixture
def typed(monkeypatch):
    """A terminal at which somebody has typed lines already."""
    opened = []

    def type_lines(text: str) -> None:
        master, slave = pty.openpty()
        os.write(master, text.encode())
        stdin = os.fdopen(slave, "r")
        opened.append((master, stdin))
        monkeypatch.setattr(sys, "stdin", stdin)

    yield type_lines
    for master, stdin in opened:
        stdin.close()
        os.close(master)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [120, 0])
def test_adapting_says_what_the_network_learned_and_needs_it(tmp_path, capsys, steps):
    """Nothing else reaches the goal: with an untrained network in its place it is missed."""
    choice = f"diffusion,training_steps={steps},symmetry=none"
    arguments = ["adapt", "--task", "basketball-v1", "--generator", choice, "--no-film", "--out"]
    assert main([*arguments, str(tmp_path / "adapted")]) == (0 if steps else 1)
    (line,) = re.findall(r"learned: .*", capsys.readouterr().out.replace("\n", " "))
    missed, untrained = (float(x) for x in re.findall(r"by ([\d.]+)%", line))
    assert untrained > 80  # percent of how the demonstrations differ
    assert missed < untrained / 2 if steps else missed == untrained


@pytest.mark.slow
def test_what_the_demo_learned_serves_adapt_together_with_what_it_saw(tmp_path, capsys):
    folder = tmp_path / "demo"
    quick = ["--generator", "interpolation", "--no-film", "--out"]
    assert main(["demo", "--goals", "1", *quick, str(folder)]) in (0, 1)
    assert "executing 1 demonstration once, seen by eye" in capsys.readouterr().out
    seen = Demonstrations.load(folder / "demonstrations.npz").outcomes_seen
    recorded = make_task("basketball-v1").demonstrations("A").outcomes_seen[:1]
    assert 0.01 < np.abs(seen - recorded).max() < 0.08

    other = ["--rounds", "1", "--no-film", "--out", str(tmp_path / "adapt")]
    adapt = ["adapt", "--task", "basketball-v3", "--model", str(folder / "model"), *other]
    assert main(adapt) == 2
    assert "name what it was learned from with --demonstrations" in capsys.readouterr().err
    assert main([*adapt, "--demonstrations", str(folder / "demonstrations.npz")]) in (0, 1)


@pytest.mark.slow
def test_what_the_camera_saw_of_demonstrations_and_trials_is_kept(tmp_path, capsys):
    quick = ["--generator", "interpolation", "--goals", "1", "--no-film", "--out", str(tmp_path)]
    assert main(["demo", "--perception", "camera", *quick]) in (0, 1)
    for folder, shown in ((tmp_path, 1), (tmp_path / "six", 6)):
        pictures = {path.stem for path in (folder / "seen").glob("*.png")}
        assert {name for name in pictures if name.startswith("demonstration")} == {
            f"demonstration{number}" for number in range(1, shown + 1)
        }
        assert "goal1-trial1" in pictures
    reading = json.loads((tmp_path / "seen" / "goal1-trial1.json").read_text())
    assert len(reading["reached"]["answers"]) == 3
    assert "camera" in (tmp_path / "report.html").read_text()
    assert "with boxes and all answers" in capsys.readouterr().out


@pytest.mark.slow
def test_a_model_at_an_endpoint_sees_the_trials_and_its_readings_are_kept(
    adapt, tmp_path, tmp_path_factory, capsys
):
    with VisionServer("qwen3-vl") as server:
        file = vlm_file(
            tmp_path_factory.mktemp("vlm"), server.base_url, family="qwen3-vl", model="qwen"
        )
        assert adapt("--perception", "vlm", "--vlm", str(file)) == 0
    reading = json.loads((tmp_path / "seen" / "goal1-trial1.json").read_text())
    assert reading["model"] == "qwen"
    assert len(reading["reached"]["answers"]) == 3
    assert (tmp_path / "seen" / "goal1-trial1.png").stat().st_size > 10_000
    assert f"vlm, qwen at {server.base_url}" in (tmp_path / "report.html").read_text()
    assert "seen: HIT" in capsys.readouterr().out


def test_several_goals_are_one_afternoon(model, tmp_path, capsys):
    goals = ("--goal", *GOAL, "0.95", "0.1")
    where = ("--model", str(model), "--out", str(tmp_path), "--no-film", "--rounds", "4")
    assert main(["adapt", *goals, *where]) in (0, 1)
    told = capsys.readouterr().out
    assert "goal 1 of 2" in told
    assert "goal 2 of 2" in told
    assert re.search(r"trials by goal: \d\+?, \d\+?\n", told)
    assert re.search(r"hit (unlikely|possible|likely)", told)
    page = (tmp_path / "report.html").read_text()
    for fact in ("Trials by goal", "basketball-v1, tolerance 1.5 cm", "basketball-v1: 2 new goals"):
        assert fact in page


def test_a_goal_that_is_cut_off_is_refused(model, tmp_path, capsys):
    assert main(["adapt", "--goal", *GOAL, "0.95", "--model", str(model)]) == 2
    assert "goal" in capsys.readouterr().err


def test_without_a_terminal_a_failed_reading_ends_in_one_line(adapt, tmp_path, capsys, nobody):
    assert adapt(*nobody) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert "is the server running?" in said
    assert "no terminal" in said
    assert not (tmp_path / "report.html").exists()


def test_at_a_terminal_the_operator_is_asked_until_it_is_understood(adapt, typed, capsys, nobody):
    typed("a hair long\n5cm long, 2cm left\n" + "hit\n" * 9)
    status = adapt(*nobody)
    said = capsys.readouterr().out
    assert status in (0, 1)
    assert "not seen: looking for the orange ball: cannot reach" in said
    assert "cannot read 'a hair long'" in said
    assert "seen: 5 cm long, 2 cm left" in said or "seen: HIT" in said


def test_an_operator_who_hangs_up_is_no_number(adapt, typed, capsys, nobody):
    typed("\x04")
    assert adapt(*nobody) == 2
    assert "no answer came" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (
            ("--perception", "eyes"),
            "no perception 'eyes'; known are exact, eye",
        ),
        (("--perception", "vlm", "--vlm", "key.toml"), "NO_SUCH_KEY is not"),
        (("--perception", "vlm", "--vlm", "no.toml"), "no.toml"),
    ],
)
def test_wrong_settings_are_told_before_anything_is_learned(
    flags, message, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "key.toml").write_text('[vlm]\napi_key_variable = "NO_SUCH_KEY"\n')
    assert main(["adapt", "--out", "run", *flags]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
