"""The examples print what they promise, and their members compute what they say."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import prior_reinforce as pr
from prior_reinforce.cli import main
from prior_reinforce.environment import Rollout
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.registry import PLUGINS

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(autouse=True)
def examples_can_be_imported(monkeypatch):
    monkeypatch.setenv(PLUGINS, "")
    monkeypatch.syspath_prepend(EXAMPLES)


@pytest.fixture
def printed(monkeypatch, capsys):
    """Run an example's main with a command line and return what it printed."""

    def run(name, *args):
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *args])
        status = importlib.import_module(name).main()
        return status, capsys.readouterr().out

    return run


def shares(text):
    return {
        line.split()[0]: [int(share) for share in re.findall(r"(\d+)%", line)]
        for line in text.splitlines()
        if "%" in line
    }


@pytest.mark.slow
def test_own_generator_is_nearer_than_plain_interpolation(printed):
    _, text = printed("own_generator", "--goals", "12")
    missed = dict(re.findall(r"^(\S+) +first throws miss by ([\d.]+) cm", text, re.MULTILINE))
    assert float(missed["softmax-blend"]) < float(missed["interpolation"])


@pytest.mark.slow
def test_own_adapter_reaches_more_than_none(printed):
    _, text = printed("own_adapter", "--goals", "6", "--rounds", "4")
    reached = shares(text)
    assert list(reached) == ["ridge", "frozen", "proportional", "gp"]
    assert reached["ridge"][0] == reached["frozen"][0]  # the first condition is the goal
    assert reached["ridge"][-1] > reached["frozen"][-1]


@pytest.mark.slow
def test_own_perception_says_what_its_bias_costs(printed):
    _, text = printed("own_perception", "--goals", "6", "--rounds", "4")
    assert "a hit at (0.92, -0.26) m seems to be 2.2 cm off" in text  # |r - below| / 14
    assert list(shares(text)) == ["exact", "calibrated", "biased"]


def test_own_task_is_learned(printed):
    _, text = printed("own_task", "--goals", "20", "--rounds", "4")
    by_round = [int(share) for share in re.findall(r"(\d+)%", text)]
    assert len(by_round) == 4
    assert by_round == sorted(by_round)
    assert by_round[-1] >= 80


def test_ten_lines_reach_a_goal_with_a_network_that_has_learned_and_not_with_one_that_has_not(
    printed,
):
    status, text = printed("ten_lines", "--training-steps", "200")
    assert status == 0
    assert re.search(r"^reached, N = 6 demonstrations \+ [1-3] throws$", text, re.MULTILINE)
    status, text = printed("ten_lines", "--training-steps", "0", "--rounds", "4")
    assert status == 1
    assert text.endswith("not reached, N = 6 demonstrations + 4 throws\n")


@pytest.mark.filterwarnings("ignore:goal .* outside")
def test_ten_lines_tell_every_throw(printed):
    far = ("--goal", "1.5", "0.4")
    status, text = printed("ten_lines", "--training-steps", "2", "--rounds", "2", *far)
    assert status == 1
    assert re.findall(r"^throw (\d+): seen", text, re.MULTILINE) == ["1", "2"]
    assert text.endswith("not reached, N = 6 demonstrations + 2 throws\n")


def test_own_task_and_generator_run_by_name(tmp_path, capsys):
    own = ["--task", "toss", "--generator", "softmax-blend"]
    own += ["--plugins", "own_task", "--plugins", "own_generator"]
    aim = ["--goal", "1.10", "0.05", "--perception", "exact", "--no-film"]
    first, again = tmp_path / "first", tmp_path / "again"
    assert main(["adapt", *own, *aim, "--out", str(first)]) == 0
    told = capsys.readouterr().out
    assert "HIT" in told
    assert main(["adapt", *own, *aim, "--model", str(first / "model"), "--out", str(again)]) == 0
    trials = [line for line in told.splitlines() if line.startswith("  trial")]
    assert trials == [
        line for line in capsys.readouterr().out.splitlines() if line.startswith("  trial")
    ]
    assert (again / "report.html").is_file()


@pytest.mark.parametrize(
    ("flag", "name", "message"),
    [
        ("--task", "shot", "no task 'shot'; known are basketball-v1"),
        ("--plugins", "own_task.Toss", "there is no module own_task.Toss"),
        ("--generator", "neural", "no generator 'neural'; known are auto, diffusion"),
    ],
)
def test_a_name_that_is_nobodys_is_told(flag, name, message, tmp_path, capsys):
    assert main(["adapt", flag, name, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert re.search(message, told)
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_ridge_by_hand():
    """One trial, k = 1, spread 1: the ridge solution is (1, z) d / (1 + z^2 + penalty)."""
    from own_adapter import RidgeAdapter

    demonstrations = Demonstrations(
        np.zeros((2, 2, 1)), [[-1.0], [1.0]], PlanFormat(("joint1",), ("rad",), 0.02)
    )
    adapter = RidgeAdapter(penalty=0.1)
    adapter.start(demonstrations)
    adapter.observe(np.array([0.5]), np.array([0.4]), np.array([0.3]))
    expected = 0.4 - 0.2 * (1 + 0.4 * 0.7) / (1 + 0.7**2 + 0.1)
    np.testing.assert_allclose(adapter.propose(np.array([0.4])), expected)


def test_a_blend_of_two_onsets_starts_in_between():
    from own_generator import SoftmaxBlend

    times = np.arange(60)
    ramp = [np.clip((times - onset) / 20, 0, 1) for onset in (10, 20)]
    smooth = np.array([r**3 * (10 - 15 * r + 6 * r**2) for r in ramp])[..., None]
    demonstrations = Demonstrations(smooth, [[0.0], [1.0]], PlanFormat(("joint1",), ("rad",), 0.02))
    plan = SoftmaxBlend().fit(demonstrations, seed=0).generate(np.array([[0.3]]))[0, :, 0]
    share = 1 / (1 + np.exp((0.7**2 - 0.3**2) / 0.4**2))  # of the later demonstration
    middle = np.clip((times - 10 - 10 * share) / 20, 0, 1)
    np.testing.assert_allclose(plan, middle**3 * (10 - 15 * middle + 6 * middle**2), atol=2e-3)


def test_parallax_by_hand():
    from own_perception import OverheadCamera

    camera = OverheadCamera(below=(0.5, 0.0), height=1.0, ball_height=0.2, noise_sd=0.0)
    hit = Rollout(outcome=np.array([0.9, -0.2, 3.0]), valid=True)
    seen = camera.perceive(hit, hit.outcome, np.random.default_rng(0))
    np.testing.assert_allclose(seen.error_seen, [0.1, -0.05, 0.0], atol=1e-12)


def test_the_catapults_ball_falls_as_one_thrown_by_hand():
    """Swung at constant speed, no turn: from height h at (u, w), x = x0 + u t, t the fall's."""
    from own_task import ARM, GRAVITY, PIVOT, STOP, Flight, Toss

    speed = 4.0
    swing = -1.2 + speed * np.arange(20) * 0.02
    (rollout,) = Toss().rollout(np.stack([np.zeros(20), swing], axis=1)[None], None)
    height = PIVOT + ARM * np.cos(STOP)
    ahead, up = ARM * speed * np.cos(STOP), -ARM * speed * np.sin(STOP)
    time = np.roots([-GRAVITY / 2, up, height]).max()
    np.testing.assert_allclose(rollout.outcome, [ARM * np.sin(STOP) + ahead * time, 0.0], atol=1e-9)
    assert rollout.valid
    flight = Flight(np.array([0.0, 0.0, height]), np.array([ahead, 0.0, up]))
    assert flight.at(flight.duration)[2] == pytest.approx(0.0, abs=1e-12)


def test_the_catapults_film_ends_with_the_ball_on_its_goal():
    from own_task import Toss

    task = Toss()
    demonstrations = task.demonstrations("A")
    plan, landing = demonstrations.plans[4], demonstrations.outcomes_seen[4]
    pictures = list(task.film(plan, landing, camera="birdseye", frames_per_second=100))
    orange = np.array([230, 120, 20])
    first, last = (
        np.argwhere(np.all(picture == orange, axis=-1)).mean(axis=0)
        for picture in (pictures[0], pictures[-1])
    )
    assert first[1] < last[1]
    pixel = 2.0 / 640
    np.testing.assert_allclose((last[1] + 0.5) * pixel - 0.5, landing[0], atol=0.03)
    np.testing.assert_allclose((240 - last[0] - 0.5) * pixel, landing[1], atol=0.03)


def test_the_arm_calls_where_the_ball_came_down(printed, tmp_path):
    task = pr.make_task("basketball-v1")
    demonstrations = task.demonstrations("A")
    pr.write_plan(pr.Plan(demonstrations.plans[4], task.format), tmp_path / "plan.npz")
    x, y = demonstrations.outcomes_seen[4] + [-0.2, 0.1]
    called = tmp_path / "called.txt"
    status, text = printed(
        "simulated_arm", str(tmp_path / "plan.npz"), "--goal", f"{x}", f"{y}", "--call", str(called)
    )
    assert status == 0
    error = pr.from_words(called.read_text())
    np.testing.assert_allclose(error.error_seen, [0.2, -0.1], atol=0.03)
    assert called.read_text().strip() in text


def test_a_lost_ball_is_called_lost(printed, tmp_path, monkeypatch):
    called = tmp_path / "called.txt"
    called.write_text("hit\n")
    arm = importlib.import_module("simulated_arm")
    monkeypatch.setattr(arm, "throw", lambda *_: Rollout(outcome=np.zeros(2), valid=False))
    status, _ = printed("simulated_arm", "plan.npz", "--goal", "1", "0", "--call", str(called))
    assert status == 0
    assert pr.from_words(called.read_text()).lost
