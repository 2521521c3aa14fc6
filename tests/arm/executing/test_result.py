"""What a driver says of a motion, and what is made of it."""

import json
import sys

import numpy as np
import pytest
from msgspec import to_builtins

from prior_reinforce.arm.executing.command import run_command
from prior_reinforce.arm.executing.result import measure_tracking
from prior_reinforce.arm.robots.plan_files import resample_plan, write_plan
from prior_reinforce.errors import FileFormatError
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

PLAN = Plan(np.linspace(0, 1, 11)[:, None] * [1.0, 2.0], PlanFormat(("a", "b"), ("rad",) * 2, 0.1))
DRIVER = """
import pathlib, sys
text, status = sys.argv[1:3]
if text:
    pathlib.Path(sys.argv[3], "result.json").write_text(text)
sys.exit(int(status))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "status", "outcome", "reason"),
    [
        ("", 0, "done", ""),
        ("", 75, "not_moved", "did not move"),
        ("", 1, "aborted", "status 1"),
        ('{"outcome": "done"}', 0, "done", ""),
        ('{"outcome": "not_moved", "reason": "door open"}', 0, "not_moved", "door open"),
        ('{"outcome": "not_moved", "reason": "door open"}', 75, "not_moved", "door open"),
        ('{"outcome": "aborted", "reason": "reflex"}', 0, "aborted", "reflex"),
        ('{"outcome": "aborted", "reason": "reflex"}', 1, "aborted", "reflex"),
        # Who fails may have moved, whatever was written before.
        ('{"outcome": "not_moved"}', 1, "aborted", "status 1"),
        ('{"outcome": "done"}', 1, "aborted", "status 1"),
        ('{"outcome": "fine"}', 0, "aborted", "cannot be read"),
        ('{"outcome": "done", "start_error": -1}', 0, "aborted", ">= 0.0"),
        ('{"outcome": "done", "tracking_rms": 1e999}', 0, "aborted", "cannot be read"),
        ('{"outcome": "done", "tracking_rms": {"percent": -1}}', 0, "aborted", ">= 0.0"),
        ("[" * 50_000, 0, "aborted", "cannot be read"),
        ('{"outcome": "done", "reason": "' + "x" * 100_000, 0, "aborted", "cannot be read"),
    ],
)
def test_outcome(tmp_path, text, status, outcome, reason):
    plan, script = write_plan(PLAN, tmp_path / "plan.npz"), tmp_path / "driver.py"
    script.write_text(DRIVER)
    (tmp_path / "text").write_text(text)
    result = run_command(
        f"sh -c '{sys.executable} {script} \"$(cat {tmp_path}/text)\" {status} $0' "
        "{result} {plan}",
        plan,
        time_limit=60,
    )
    assert result.outcome == outcome
    assert reason in result.reason
    assert result.succeeded == (outcome == "done")
    json.dumps(to_builtins(result), allow_nan=False)


@pytest.mark.slow
def test_a_command_that_was_stopped_may_have_moved(tmp_path):
    plan = write_plan(PLAN, tmp_path / "plan.npz")
    wrote = '{\\"outcome\\": \\"not_moved\\"}'
    command = f"sh -c 'echo \"{wrote}\" > $0/result.json; exec sleep 60' {{result}} {{plan}}"
    result = run_command(command, plan, time_limit=1)
    assert (result.outcome, result.timed_out) == ("aborted", True)


def test_tracking_is_the_measured_distance_from_the_plan(tmp_path):
    assert measure_tracking(tmp_path, PLAN) == {}
    plan = write_plan(resample_plan(PLAN, 1000), tmp_path / "plan.npz")
    fine = np.load(plan.path)
    np.savez(tmp_path / "executed.npz", t=fine["t"], q=fine["q"] + [0.03, 0.04], dq=fine["dq"])
    # sqrt((0.03^2 + 0.04^2) / 2)
    found = measure_tracking(tmp_path, PLAN)
    assert found["tracking_rms"] == {"rad": pytest.approx(0.05 / np.sqrt(2))}
    assert found["tracking_max"] == {"rad": pytest.approx(0.04)}
    percent = Plan(PLAN.actions, PlanFormat(("a", "b"), ("rad", "percent"), 0.1))
    apart = {"rad": pytest.approx(0.03), "percent": pytest.approx(0.04)}
    assert set(measure_tracking(tmp_path, percent)) == {*found}
    assert all(each == apart for each in measure_tracking(tmp_path, percent).values())


def test_a_motion_that_was_cut_off_ends_far_from_the_plans_end(tmp_path):
    plan = write_plan(resample_plan(PLAN, 1000), tmp_path / "plan.npz")
    fine, half = np.load(plan.path), 1000 * (PLAN.horizon - 1) // 20
    np.savez(tmp_path / "executed.npz", t=fine["t"][:half], q=fine["q"][:half])
    found = measure_tracking(tmp_path, PLAN)
    assert found["tracking_max"]["rad"] < 1e-9
    far = np.abs(fine["q"][half - 1] - PLAN.actions[-1]).max()
    assert found["end_error"]["rad"] == pytest.approx(far)


@pytest.mark.parametrize(
    "arrays",
    [
        {"t": np.zeros(3)},
        {"t": np.zeros(3), "q": np.zeros((3, 3))},
        {"t": np.zeros(0), "q": np.zeros((0, 2))},
        {"t": np.zeros(3), "q": np.full((3, 2), np.nan)},
        {"t": np.zeros(3), "q": np.array([[{}, 1]] * 3, dtype=object)},
    ],
)
def test_a_path_that_is_none_is_named(tmp_path, arrays):
    np.savez(tmp_path / "executed.npz", **arrays)
    with pytest.raises(FileFormatError, match=r"executed\.npz cannot be read") as caught:
        measure_tracking(tmp_path, PLAN)
    assert "allow_pickle" not in str(caught.value)
