"""Plan files: what is in them, that they never change, and what damaged ones say."""

import csv
import hashlib
import json
import stat
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from prior_reinforce.arm.robots.plan_files import (
    PlanFile,
    check_plan_path,
    read_plan,
    resample_plan,
    write_plan,
)
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidPlanError,
    PriorReinforceError,
    WorkspaceError,
)
from prior_reinforce.plans.interpolation import interpolate, join_frames
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat

DT = 0.01


@pytest.fixture
def plan():
    s = np.linspace(0, 1, 101)[:, None]
    rise = 10 * s**3 - 15 * s**4 + 6 * s**5
    names = tuple(f"joint{i}" for i in range(1, 8))
    return Plan(0.1 + rise * np.linspace(-1, 1, 7), PlanFormat(names, ("rad",) * 7, DT))


def test_npz_holds_positions_and_their_derivatives(plan, tmp_path):
    file = write_plan(plan, tmp_path / "plan.npz")
    with np.load(file.path, allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["q"], plan.actions)
        np.testing.assert_allclose(archive["t"], np.arange(101) * DT)
        # Half way a minimum-jerk swing has speed 15/8 and no acceleration; the ends rest.
        assert archive["dq"][50, 6] == pytest.approx(15 / 8, rel=1e-4)
        assert archive["ddq"][50, 6] == pytest.approx(0, abs=1e-9)
        np.testing.assert_allclose(archive["dq"][[0, -1]], 0, atol=1e-12)


def test_npz_reads_back_the_same_plan(plan, tmp_path):
    file = write_plan(plan, tmp_path / "plan.npz")
    back = read_plan(file.path, sha256=file.sha256)
    np.testing.assert_array_equal(back.actions, plan.actions)
    assert back.format == plan.format


def test_a_finer_rate(plan, tmp_path):
    file = write_plan(resample_plan(plan, 1000), tmp_path / "fine.npz")
    back = read_plan(file.path)
    assert back.horizon == 1001
    assert back.format.dt == 0.001
    np.testing.assert_allclose(back.actions[::10], plan.actions, atol=1e-12)


@pytest.mark.parametrize("rate", [50, 200])
def test_increments_at_another_rate_go_the_same_way(rate):
    speed = 0.3 * np.sin(np.linspace(0, np.pi, 101)) ** 2
    grip = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 101))
    form = PlanFormat(("dx", "grip"), ("m", "1"), DT)
    plan = Plan(np.column_stack([speed * DT, grip]), form)
    other = resample_plan(plan, rate)
    assert other.actions[:, 0].sum() == pytest.approx(plan.actions[:, 0].sum(), abs=1e-6)
    assert other.actions[:, 0].max() == pytest.approx(0.3 / rate, rel=0.01)


@pytest.mark.parametrize("rate", [0.5, 3.0])
def test_a_rate_that_makes_another_motion_is_refused(plan, rate):
    """Two points, half a radian off what was checked."""
    with pytest.raises(InvalidPlanError, match="is another motion"):
        resample_plan(plan, rate)


@pytest.mark.parametrize("rate", [0.0, -80.0, 1001.0, float("nan")])
def test_a_rate_that_no_arm_has_is_refused(plan, tmp_path, rate):
    with pytest.raises(InvalidPlanError, match="samples a second up to 1000, got"):
        resample_plan(plan, rate)
    with pytest.raises(InvalidPlanError, match="samples a second up to 1000, got"):
        check_plan_path(tmp_path / "odd.npz", rate=rate)


@pytest.mark.parametrize("rate", [33.0, 80.0, 101.0, 1000.0])
def test_a_motion_at_another_rate_is_the_same_motion(plan, rate):
    back = resample_plan(plan, rate)
    again = interpolate(back.actions, back.format.dt)
    here = interpolate(plan.actions, plan.format.dt)
    n = min(len(again.q), len(here.q))
    np.testing.assert_allclose(again.q[:n], here.q[:n], atol=1e-4)


def test_no_head_of_an_exported_table_is_a_formula(plan, tmp_path):
    odd = replace(plan, format=replace(plan.format, names=("=1+1", *plan.format.names[1:])))
    write_plan(odd, tmp_path / "plan.csv")
    assert (tmp_path / "plan.csv").read_text().startswith("t,'=1+1,")


def test_csv_reads_back_exactly(plan, tmp_path):
    write_plan(plan, tmp_path / "plan.csv")
    with open(tmp_path / "plan.csv", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0][:3] == ["t", "joint1", "joint2"]
    assert rows[0][8] == "d_joint1"
    assert rows[0][-1] == "dd_joint7"
    np.testing.assert_array_equal(np.array(rows[1:], dtype=float)[:, 1:8], plan.actions)


def test_json_has_the_field_order_of_a_joint_trajectory(plan, tmp_path):
    write_plan(plan, tmp_path / "plan.json")
    message = json.loads((tmp_path / "plan.json").read_text())
    assert list(message) == ["header", "joint_names", "points"]
    assert list(message["header"]) == ["stamp", "frame_id"]
    point = message["points"][-1]
    assert list(point) == [
        "positions",
        "velocities",
        "accelerations",
        "effort",
        "time_from_start",
    ]
    assert point["time_from_start"] == {"sec": 1, "nanosec": 0}
    assert message["points"][29]["time_from_start"] == {"sec": 0, "nanosec": 290_000_000}
    np.testing.assert_array_equal([p["positions"] for p in message["points"]], plan.actions)


@pytest.mark.parametrize("kind", ["npz", "csv", "json"])
def test_the_same_plan_is_the_same_bytes(plan, tmp_path, kind):
    first = write_plan(plan, tmp_path / f"a.{kind}")
    second = write_plan(Plan(plan.actions, plan.format), tmp_path / f"b.{kind}")
    assert first.sha256 == second.sha256
    assert first.sha256 == hashlib.sha256(first.path.read_bytes()).hexdigest()


def test_a_plan_is_written_once(plan, tmp_path):
    file = write_plan(plan, tmp_path / "plan.npz")
    assert not stat.S_IMODE(file.path.stat().st_mode) & 0o222
    assert write_plan(plan, file.path) == file
    other = Plan(plan.actions + 0.001, plan.format)
    with pytest.raises(FileFormatError, match="never overwritten"):
        write_plan(other, file.path)
    file.verify()
    assert [entry.name for entry in tmp_path.iterdir()] == ["plan.npz"]


def test_a_changed_plan_is_noticed(plan, tmp_path):
    file = write_plan(plan, tmp_path / "plan.npz")
    file.path.chmod(0o644)
    other = write_plan(Plan(plan.actions * 1.0001, plan.format), tmp_path / "other.npz")
    file.path.write_bytes(other.path.read_bytes())
    with pytest.raises(FileFormatError, match="put the original back"):
        file.verify()
    with pytest.raises(FileFormatError, match="never change"):
        read_plan(file.path, sha256=file.sha256)
    file.path.unlink()
    with pytest.raises(FileFormatError, match="cannot read"):
        file.verify()


def test_no_such_folder(plan, tmp_path):
    with pytest.raises(WorkspaceError, match="make the folder first"):
        write_plan(plan, tmp_path / "missing" / "plan.npz")


def test_unknown_suffix(plan, tmp_path):
    with pytest.raises(ConfigurationError, match=r"\.npz, \.csv or \.json"):
        write_plan(plan, tmp_path / "plan.xlsx")
    assert write_plan(plan, tmp_path / "plan", format="csv").path.name == "plan"


def test_a_file_of_another_version_is_no_plan(plan, tmp_path):
    with np.load(write_plan(plan, tmp_path / "plan.npz").path) as archive:
        parts = {**archive}
    metadata = json.loads(str(parts["metadata"])) | {"version": 2}
    np.savez(tmp_path / "later.npz", **parts | {"metadata": json.dumps(metadata)})
    with pytest.raises(FileFormatError, match="written as prior-reinforce plan 2"):
        read_plan(tmp_path / "later.npz")


def test_missing_plan(tmp_path):
    with pytest.raises(FileFormatError, match="no plan at"):
        read_plan(tmp_path / "plan.npz")


@pytest.mark.slow
@settings(max_examples=60)
@given(cut=st.booleans(), where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_damaged_files_are_named_errors_or_noticed_by_the_hash(cut, where, bit, tmp_path_factory):
    frames = np.cumsum(np.ones((20, 2)), axis=0)
    plan = Plan(frames, PlanFormat(("a", "b"), ("rad", "rad"), DT))
    folder = tmp_path_factory.mktemp("plans")
    content = write_plan(plan, folder / "whole.npz").path.read_bytes()
    damaged = bytearray(content)
    position = int(where * len(content))
    damaged[position] ^= 1 << bit
    path = folder / "plan.npz"
    path.write_bytes(content[:position] if cut else damaged)
    with pytest.raises(FileFormatError):
        PlanFile(path, hashlib.sha256(content).hexdigest()).verify()
    try:
        back = read_plan(path)
    except PriorReinforceError:
        return
    # The flipped bit lies outside what is read, such as a stored date.
    np.testing.assert_array_equal(back.actions, plan.actions)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [None, 50, 240, 1000])
def test_a_controller_that_joins_a_file_makes_the_motion_that_the_gate_saw(tmp_path, rate):
    """By quintics through q, dq and ddq: the spline through the file's own frames."""
    rng, x = np.random.default_rng(11), np.linspace(0, 1, 41)[:, None]
    form = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.0125)
    plan = Plan(sum(rng.normal(size=2) * 1e-3 * np.sin(np.pi * k * x) ** 3 for k in (1, 2)), form)
    sent = plan if rate is None else resample_plan(plan, rate)
    with np.load(write_plan(sent, tmp_path / "plan.npz").path) as z:
        joined = BPoly.from_derivatives(z["t"], np.stack([z["q"], z["dq"], z["ddq"]], 1))
        t = np.linspace(0, z["t"][-1], 5001)
    spline = join_frames(sent.actions, sent.format.dt)
    for order, size in ((0, 1e-3), (1, 1e-1), (2, 10)):
        assert joined(t, order) == pytest.approx(spline(t, order), abs=1e-8 * size)
