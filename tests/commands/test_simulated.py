"""`demo`, `adapt` and `rollout`: what they print, keep and refuse."""

from __future__ import annotations

import copy
import json
import os
import pty
import re
import sys

import imageio_ffmpeg
import numpy as np
import pytest

from prior_reinforce.cli import main
from prior_reinforce.environment import make_renderer
from prior_reinforce.generators import make_generator
from prior_reinforce.lab.experiments.learned import save_learned
from prior_reinforce.lab.tasks import make_task, panda_task
from prior_reinforce.plans.motions import Demonstrations
from tests.perception.vision_server import VisionServer

GOAL = ("1.0", "0.05")
NOBODY = ("--perception=vlm", "--vlm.base-url=http://127.0.0.1:9/v1", "--vlm.max-retries=0")


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
@pytest.mark.parametrize("steps", [250, 0])
def test_the_demo_says_what_the_network_learned_and_needs_it(tmp_path, capsys, steps):
    """Nothing else reaches the goals: with an untrained network in its place the demo fails."""
    choice = f"diffusion,training_steps={steps}"
    arguments = ["demo", "--goals", "1", "--generator", choice, "--no-film", "--out"]
    assert main([*arguments, str(tmp_path / "demo")]) == (0 if steps else 1)
    (line,) = re.findall(r"learned: .*", capsys.readouterr().out.replace("\n", " "))
    missed, untrained = (float(x) for x in re.findall(r"by ([\d.]+)%", line))
    assert untrained > 80  # percent of how the demonstrations differ
    assert missed < untrained / 2 if steps else missed == untrained


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
def test_what_the_camera_saw_of_demonstrations_and_trials_is_kept(tmp_path, capsys):
    quick = ["--generator", "interpolation", "--goals", "1", "--no-film", "--out", str(tmp_path)]
    assert main(["demo", "--perception", "camera", *quick]) in (0, 1)
    pictures = {path.stem for path in (tmp_path / "seen").glob("*.png")}
    assert pictures > {f"demonstration{number}" for number in range(1, 7)}
    assert "goal1-trial1" in pictures
    reading = json.loads((tmp_path / "seen" / "goal1-trial1.json").read_text())
    assert len(reading["reached"]["answers"]) == 3
    assert "camera" in (tmp_path / "report.html").read_text()
    assert "with boxes and all answers" in capsys.readouterr().out


@pytest.mark.slow
def test_a_model_at_an_endpoint_sees_the_trials_and_its_readings_are_kept(adapt, tmp_path, capsys):
    with VisionServer("qwen3-vl") as server:
        flags = ("--vlm.base-url", server.base_url, "--vlm.family", "qwen3-vl")
        assert adapt("--perception", "vlm", *flags, "--vlm.model", "qwen") == 0
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
    assert "chance" in told
    page = (tmp_path / "report.html").read_text()
    for fact in ("Trials by goal", "basketball-v1, tolerance 1.5 cm", "basketball-v1: 2 new goals"):
        assert fact in page


def test_a_goal_that_is_cut_off_is_refused(model, tmp_path, capsys):
    assert main(["adapt", "--goal", *GOAL, "0.95", "--model", str(model)]) == 2
    assert "goal" in capsys.readouterr().err


def test_without_a_terminal_a_failed_reading_ends_in_one_line(adapt, tmp_path, capsys):
    assert adapt(*NOBODY) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert "is the server running?" in said
    assert "no terminal" in said
    assert not (tmp_path / "report.html").exists()


def test_at_a_terminal_the_operator_is_asked_until_it_is_understood(adapt, typed, capsys):
    typed("a little long\n5cm long, 2cm left\n" + "hit\n" * 9)
    status = adapt(*NOBODY)
    said = capsys.readouterr().out
    assert status in (0, 1)
    assert "not seen: looking for the orange ball: cannot reach" in said
    assert "cannot read 'a little long'" in said
    assert "seen: 5 cm long, 2 cm left" in said or "seen: HIT" in said


def test_an_operator_who_hangs_up_is_no_number(adapt, typed, capsys):
    typed("\x04")
    assert adapt(*NOBODY) == 2
    assert "no answer came" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (
            ("--perception", "eyes"),
            "no perception 'eyes'; known are exact, eye",
        ),
        (("--perception", "vlm", "--vlm.api-key-variable", "NO_SUCH_KEY"), "NO_SUCH_KEY is not"),
    ],
)
def test_wrong_settings_are_told_before_anything_is_learned(flags, message, tmp_path, capsys):
    assert main(["adapt", "--out", str(tmp_path), *flags]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_one_command_makes_a_tasks_film(tmp_path, capsys, monkeypatch):
    def without_shadows(model, width, height):  # they are nine tenths of its time
        model = copy.copy(model)
        model.vis.quality.shadowsize = 0
        return make_renderer(model, width, height)

    monkeypatch.setattr(panda_task, "make_renderer", without_shadows)
    film = tmp_path / "slide.mp4"
    # Seed 2 disturbs this one by 2 mm, within curling's tolerance of 1 cm.
    throw = ["--task", "curling", "--demonstration", "5", "--seed", "2"]
    assert main(["rollout", *throw, "--film", str(film)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "within the tolerance" in said
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
    lasts = 0.1 + 139 * 0.0125 + 1.5  # before, during and after the plan
    assert seconds == pytest.approx(lasts, abs=0.1)
    assert count == pytest.approx(30 * lasts, abs=2)
    assert (tmp_path / "slide-film.png").is_file()


def test_a_film_that_is_no_mp4_is_refused_before_anything_is_written(tmp_path, capsys):
    film = tmp_path / "throw.avi"
    assert main(["rollout", "--demonstration", "0", "--film", str(film)]) == 2
    assert "--film must name an .mp4 file" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_demonstration_that_is_not_there_is_named(capsys):
    assert main(["rollout", "--demonstration", "6"]) == 2
    assert "--demonstration must be 0 to 5, got 6" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("task", "said"),
    [("zoo-slide", "cm ahead"), ("zoo-arrival", "arrival"), ("zoo-gripper", "cm up")],
)
def test_a_task_without_pictures_is_adapted_and_says_so_in_a_line(tmp_path, capsys, task, said):
    chosen = ["--task", task, "--demonstrations", "clean-5-1", "--generator", "interpolation"]
    assert main(["adapt", *chosen, "--perception", "exact", "--out", str(tmp_path)]) in (0, 1)
    told = capsys.readouterr().out
    assert f"no film: {task} has no pictures" in told
    assert said in told
    assert f"no film: {task} has no pictures" in (tmp_path / "report.html").read_text()


def test_rollouts_are_printed_in_the_outcomes_units(capsys):
    chosen = ["--task", "zoo-arrival", "--demonstrations", "clean-5-1", "--demonstration", "0"]
    assert main(["rollout", *chosen, "--repeats", "2"]) == 0
    told = capsys.readouterr().out
    assert re.search(r"x \d\.\d{3} m, arrival \d\.\d{3} s", told)
    assert re.search(r"spread \(sd\): \d\.\d\d cm, \d\.\d{4} s", told)


def test_a_set_that_the_task_does_not_have_is_named_with_those_it_has(capsys):
    assert main(["adapt", "--task", "zoo-lob"]) == 2
    assert "no demonstration set 'A'; write KIND-COUNT-SEED" in capsys.readouterr().err
