"""NPZ files come back as the motions that were written, and say what is wrong with them."""

import json

import numpy as np
import pytest

from prior_reinforce.arm.recordings import import_demonstrations, npz, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.arm.recordings.options import ReadOptions
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.arm.robots.plan_files import write_plan
from prior_reinforce.errors import (
    FileFormatError,
    InvalidDemonstrationsError,
    PriorReinforceError,
    UnclearUnitsError,
)
from prior_reinforce.plans.motions import Plan
from tests.arm.recordings.recorded import (
    AS_IS,
    JOINTS,
    OUTCOMES,
    N,
    check_motions,
    sampled,
    throw,
    write_npz,
    write_outcomes,
)


def test_npz(tmp_path):
    write_outcomes(write_npz(tmp_path))
    result = import_demonstrations(tmp_path, preprocessing=AS_IS)
    check_motions(result, 100, tolerance=0)
    assert result.demonstrations.format.names == JOINTS
    assert result.episodes == tuple(f"throw_{i}" for i in range(N))


def test_npz_of_one_array_with_its_own_outcomes(tmp_path):
    t = np.arange(171) / 100
    plans = np.stack([throw(i, t) for i in range(N)])
    np.savez(tmp_path / "all.npz", q=plans, dt=0.01, outcomes=np.array(list(OUTCOMES.values())))
    result = import_demonstrations(tmp_path / "all.npz", preprocessing=AS_IS)
    np.testing.assert_array_equal(result.demonstrations.plans, plans)
    assert result.episodes == tuple(OUTCOMES)


def test_our_own_demonstrations_and_plans_come_back(tmp_path):
    write_outcomes(write_npz(tmp_path))
    demos = import_demonstrations(tmp_path, preprocessing=AS_IS).demonstrations
    demos.save(tmp_path / "saved.npz")
    again = import_demonstrations(
        tmp_path / "saved.npz",
        outcomes={str(i): OUTCOMES[str(i)] for i in range(N)},
        preprocessing=AS_IS,
    ).demonstrations
    np.testing.assert_array_equal(again.plans, demos.plans)
    assert again.format == demos.format
    write_plan(Plan(demos.plans[2], demos.format), tmp_path / "plan.npz")
    (recording,) = read_recordings(tmp_path / "plan.npz")
    np.testing.assert_array_equal(recording.positions, demos.plans[2])
    assert recording.names == JOINTS


def test_pickled_objects_are_never_loaded(tmp_path):
    np.savez(tmp_path / "bad.npz", q=np.array([{"a": 1}, None], dtype=object), dt=0.01)
    with pytest.raises(FileFormatError, match="plain number arrays"):
        read_recordings(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"q": np.zeros((5, 2))}, "give the rate"),
        ({"a": np.zeros((5, 2)), "b": np.zeros((5, 2))}, r"no array q .* it holds \['a', 'b'\]"),
        ({"q": np.zeros(5), "dt": 0.01}, r"expected numbers of shape \(T, D\)"),
        ({"q": np.zeros((5, 2)), "t": np.zeros(4)}, "has 5 frames, but t of shape"),
        ({"q": np.zeros((5, 2)), "t": np.zeros(5)}, "time does not increase at frame 1"),
        ({"q": np.zeros((5, 2)), "t": np.full(5, np.nan)}, "time is nan at frame 0"),
        ({"q": np.zeros((5, 2)), "dt": np.zeros(3)}, "times t, or dt, or rate"),
        ({"q": np.zeros((5, 2)), "dt": 0.01, "names": np.array(["a", "a"])}, "repeats a channel"),
        ({"q": np.zeros((5, 2)), "dt": 0.01, "names": np.array(["a"])}, "for 1 channels"),
        ({"q": np.array([["a", "b"]] * 5), "dt": 0.01}, "expected numbers"),
        ({"q": np.zeros((2, 5, 2)), "dt": 0.01, "outcomes": np.zeros(3)}, "outcomes have shape"),
    ],
)
def test_npz_of_other_content(tmp_path, arrays, says):
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(PriorReinforceError, match=says):
        read_recordings(tmp_path / "bad.npz")


def test_a_bare_array_is_the_motion_alone(tmp_path):
    np.save(tmp_path / "throw_0.npy", np.arange(10.0).reshape(5, 2))
    with pytest.raises(PriorReinforceError, match="give the rate"):
        read_recordings(tmp_path)
    (recording,) = read_recordings(tmp_path, rate=50, joints=["a", "b"])
    np.testing.assert_array_equal(recording.positions[4], [8, 9])
    assert (recording.episode, recording.named, recording.duration) == ("throw_0", False, 0.08)


def test_the_array_of_times_may_be_named(tmp_path):
    arrays = {"q": np.eye(3), "clock": np.arange(3) * 10.0}
    np.savez(tmp_path / "a.npz", **arrays)
    (recording,) = read_recordings(tmp_path, time_column="clock", time_unit="ms")
    np.testing.assert_allclose(recording.times, [0, 0.01, 0.02])
    with pytest.raises(FileFormatError, match=r"no array t; it holds \['clock', 'q'\]"):
        read_recordings(tmp_path, time_column="t")


def test_times_may_be_a_column(tmp_path):
    """As a log of panda_py is, whose `get_log` has an array for each time too."""
    t = np.arange(171) / 100
    np.savez(tmp_path / "0.npz", q=list(throw(0, t)), tau_J=throw(1, t), time=t[:, None])
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.times, t)


@pytest.mark.parametrize("suffix", ["npz", "npy"])
def test_python_objects_are_named_without_advice_to_load_them_all_the_same(tmp_path, suffix):
    path = tmp_path / f"throw.{suffix}"
    objects = np.array([[{}, 1.0]] * 3, dtype=object)
    if suffix == "npz":
        np.savez(path, q=objects, dt=0.01)
    else:
        np.save(path, objects)
    with pytest.raises(FileFormatError, match="it holds Python objects") as caught:
        read_recordings(path, rate=100)
    assert "allow_pickle" not in str(caught.value)


ORDER = [2, 1, 0, 3, 4, 5, 6]
SWAPPED = [JOINTS[i] for i in ORDER]


@pytest.mark.parametrize("name", ["dof_names", "channels", "order"])
def test_names_in_any_array_of_texts_are_those_of_the_joints(tmp_path, name):
    t, q = sampled(0, 20)
    np.savez(tmp_path / "a.npz", t=t, q=q[:, ORDER], **{name: SWAPPED})
    (recording,) = read_recordings(tmp_path, joints=JOINTS)
    assert recording.names == tuple(SWAPPED)
    np.savez(tmp_path / "a.npz", t=t, q=q[:, ORDER], joint_names=JOINTS, **{name: SWAPPED})
    with pytest.raises(FileFormatError, match="names the columns in two ways"):
        read_recordings(tmp_path, joints=JOINTS)


@pytest.mark.parametrize("units", [["deg"] * 7, "deg"])
def test_units_beside_the_names_are_those_of_the_joints(tmp_path, units):
    t, q = sampled(0, 20)
    np.savez(tmp_path / "a.npz", t=t, q=q, joint_names=JOINTS, units=units)
    assert read_recordings(tmp_path)[0].units == ("deg",) * 7


@pytest.mark.parametrize("said", ["lengths", "mask", "nothing"])
@pytest.mark.parametrize("filled", [0.0, np.nan])
def test_frames_that_fill_up_are_no_motion(tmp_path, said, filled):
    lengths = np.array([60, 80, 100])
    real = np.arange(100) < lengths[:, None]
    q = np.where(
        real[..., None], np.stack([throw(i, np.arange(100) / 50) for i in range(3)]), filled
    )
    more = {"lengths": {"lengths": lengths}, "mask": {"mask": real}, "nothing": {}}[said]
    np.savez(tmp_path / "all.npz", q=q, rate=50, **more)
    recordings = read_recordings(tmp_path / "all.npz")
    assert [len(recording.times) for recording in recordings] == [60, 80, 100]
    assert [len(recording.remarks) for recording in recordings] == [1, 1, 0]


def test_one_array_a_joint_is_read_by_name_and_by_keys(tmp_path):
    t, q = sampled(0, 20)
    np.savez(tmp_path / "a.npz", time=t, **dict(zip(SWAPPED, q.T[ORDER], strict=True)))
    for how in ({"joints": JOINTS}, {"key": JOINTS}):
        (recording,) = read_recordings(tmp_path, **how)
        assert recording.names == JOINTS
        np.testing.assert_array_equal(recording.positions, q)


def test_a_second_arm_and_a_hand_are_named_and_commands_are_not(tmp_path):
    t, q = sampled(0, 50)
    hand = (q[:, 1] - q[0, 1])[:, None] * np.linspace(0.1, 0.9, 16)
    np.savez(tmp_path / "a.npz", t=t, q_right=q, q_left=0.5 * q[:, ::-1], hand=hand, q_cmd=q + 0.01)
    assert [*moving_beside([read_recordings(tmp_path, key="q_right")[0]])] == ["q_left", "hand"]


def test_names_of_some_columns_are_asked_about_in_the_files_order(tmp_path):
    t, q = sampled(0, 20)
    plan = (*JOINTS, "gripper")
    np.savez(tmp_path / "a.npz", t=t, q=np.column_stack([q[:, ORDER], q[:, 1]]), dof_names=SWAPPED)
    with pytest.raises(UnclearUnitsError) as asked:
        read_recordings(tmp_path, joints=plan)
    said = (*SWAPPED, "gripper")
    assert asked.value.options == f"--joints {' '.join(said)}"
    (recording,) = read_recordings(tmp_path, joints=said)
    units = ["deg" if name == "joint3" else "rad" for name in said]
    chosen = select([recording], said, plan, units).recordings[0].positions[:, :7]
    np.testing.assert_allclose(chosen, np.where(np.arange(7) == 2, np.deg2rad(q), q))


def test_the_metadata_of_another_program_is_searched_for_names_and_the_rate(tmp_path):
    _, q = sampled(0, 50)
    said = {"robot": {"joint_names": JOINTS[::-1]}, "timing": {"fps": 50}, "operator": "kim"}
    np.savez(tmp_path / "a.npz", q=q[:, ::-1], metadata=json.dumps(said))
    (recording,) = read_recordings(tmp_path / "a.npz", joints=JOINTS)
    assert recording.names == JOINTS[::-1]
    assert recording.clock == "fps in the file"
    t = np.arange(len(q)) / 100
    np.savez(tmp_path / "c.npz", t=t, q=q, metadata=json.dumps(said))
    with pytest.raises(FileFormatError, match=r"but fps 50; take one: --time-column t, or --time"):
        read_recordings(tmp_path / "c.npz")
    assert read_recordings(tmp_path / "c.npz", time_column="t")[0].period == pytest.approx(0.01)
    (given,) = read_recordings(tmp_path / "c.npz", time_column="none", rate=50)
    assert given.period == pytest.approx(0.02)
    np.savez(tmp_path / "b.npz", q=q, metadata="by kim, in the evening", rate=50)
    assert not read_recordings(tmp_path / "b.npz")[0].named


def test_a_gripper_at_a_rate_of_its_own_is_named_and_what_to_do_about_it(tmp_path):
    t, q = sampled(0, 100)
    np.savez(tmp_path / "a.npz", t=t, q=q, t_gripper=t[::5], gripper=80 - 100 * q[::5, 1])
    (recording,) = read_recordings(tmp_path / "a.npz")
    assert [*moving_beside([recording])] == [f"gripper ({len(t[::5])} frames, beside {len(t)})"]
    with pytest.raises(
        FileFormatError, match=r"gripper has \d+; .* at the times of q: numpy\.interp"
    ):
        read_recordings(tmp_path / "a.npz", key=["q", "gripper"])


def test_fields_of_a_record_are_arrays_of_their_own_in_any_order(tmp_path):
    for i in range(2):
        t, q = sampled(i, 50)
        names = ("time", *(JOINTS if i else JOINTS[::-1]))
        log = np.zeros(len(t), dtype=[(name, "f8") for name in names])
        log["time"] = t
        for k, joint in enumerate(JOINTS):
            log[joint] = q[:, k]
        np.savez(tmp_path / f"{i}.npz", log=log)
    for i, read in enumerate(read_recordings(tmp_path, joints=JOINTS)):
        np.testing.assert_allclose(read.positions, sampled(i, 50)[1])
        np.testing.assert_allclose(read.times, sampled(i, 50)[0])


def test_three_numbers_of_a_place_are_called_by_their_key(tmp_path):
    t, q = sampled(0, 50)
    place, quaternion = 1000 * q[:, :3], np.c_[np.zeros((len(t), 3)), np.ones(len(t))]
    np.savez(tmp_path / "a.npz", t=t, eef_pos=place, quat=quaternion)
    (read,) = read_recordings(tmp_path / "a.npz", key=("eef_pos", "quat"))
    assert read.names[:4] == ("eef_pos_x", "eef_pos_y", "eef_pos_z", "quat_0")


def test_numbers_of_a_whole_pose_are_called_by_their_key(tmp_path):
    t, q = sampled(0, 50)
    np.savez(tmp_path / "a.npz", t=t, q=q, tcp_pose=q)
    (read,) = read_recordings(tmp_path / "a.npz", key="tcp_pose")
    assert read.names == tuple(f"tcp_pose_{i}" for i in range(7))


def test_a_rate_that_the_file_says_is_that_of_frames_that_are_counted(tmp_path):
    q = sampled(0, 50)[1]
    np.savez(tmp_path / "a.npz", q=q, frame=np.arange(len(q)), fps=50)
    (read,) = read_recordings(tmp_path / "a.npz", time_column="frame", time_unit="frame")
    np.testing.assert_allclose(read.times, np.arange(len(q)) / 50)


@pytest.mark.parametrize(
    ("keys", "names"),
    [
        (("tcp",), "tcp_x tcp_y tcp_z"),
        (("positions", "gripper"), "positions_0 positions_1 positions_2 gripper"),
        (("hand_joints", "gripper"), "hand_joints_0 hand_joints_1 hand_joints_2 gripper"),
    ],
)
def test_three_numbers_that_may_be_joints_are_no_place(tmp_path, keys, names):
    t, q = sampled(0, 50)
    arrays = {keys[0]: q[:, :3]} | ({"gripper": q[:, 3]} if len(keys) > 1 else {})
    np.savez(tmp_path / "a.npz", t=t, **arrays)
    (read,) = read_recordings(tmp_path / "a.npz", key=keys)
    assert read.names == tuple(names.split())


def test_a_gripper_in_another_array_is_named_with_the_option_that_takes_it(tmp_path):
    t, q = sampled(0, 50)
    np.savez(tmp_path / "a.npz", t=t, q=q[:, :2], joint_names=["pan", "lift"], gripper=q[:, 3])
    with pytest.raises(InvalidDemonstrationsError, match=r"gripper stands beside .* another --key"):
        import_demonstrations(
            tmp_path, outcomes={"a": [1.0, 0.0]}, joints=["pan", "lift", "gripper"]
        )


def test_an_array_a_throw_is_an_episode_each(tmp_path):
    own = {f"throw_{i}": sampled(i, 100)[1] for i in range(N)}
    np.savez(tmp_path / "throws.npz", **own, dt=0.01)
    read = read_recordings(tmp_path / "throws.npz", leave_out=("throw_1",))
    assert [r.episode for r in read] == [name for name in own if name != "throw_1"]
    for recording in read:
        np.testing.assert_array_equal(recording.positions, own[recording.episode])
    (one,) = read_recordings(tmp_path / "throws.npz", key="throw_1")
    np.testing.assert_array_equal(one.positions, own["throw_1"])


def test_arrays_beside_a_motion_are_no_throws_and_outcomes_go_with_their_throw(tmp_path):
    own = {f"throw_{i}": sampled(i, 100)[1] for i in range(2)}
    outcomes = np.array([[1.0, 0.1], [1.2, 0.2]])
    np.savez(tmp_path / "throws.npz", **own, dt=0.01, outcomes=outcomes)
    for recording, outcome in zip(read_recordings(tmp_path / "throws.npz"), outcomes, strict=True):
        np.testing.assert_array_equal(recording.outcome, outcome)
    np.savez(tmp_path / "throws.npz", **own, dt=0.01, outcomes=outcomes[:1])
    with pytest.raises(FileFormatError, match="outcomes needs a row for each of throw_0, throw_1"):
        read_recordings(tmp_path / "throws.npz")
    np.savez(tmp_path / "throws.npz", **own, dt=0.01, q=own["throw_1"])
    (read,) = read_recordings(tmp_path / "throws.npz")
    assert read.episode == "throws"


UNEVEN = np.append(np.arange(100) / 100, 1.6)
Q = np.sin(np.arange(101) / 20)[:, None] * [1.0, 0.5]


def read_one(folder, rate=None, time_column=None, key=None, **arrays):
    np.savez(folder / "a.npz", **arrays)
    options = ReadOptions(rate=rate, time_column=time_column, key=key)
    ((_, read_it),) = npz.read(folder / "a.npz", options)
    return read_it()


@pytest.mark.parametrize("rate", [None, 100.0])
def test_a_time_that_rises_unevenly_is_asked_about_beside_a_rate(tmp_path, rate):
    found = read_one(tmp_path, rate, q=Q, fps=100.0, time_in_contact=UNEVEN)
    assert "--time-column time_in_contact" in [one.option for one in found.ambiguities]
    left = read_one(tmp_path, rate, "none", q=Q, fps=100.0, time_in_contact=UNEVEN)
    assert left.times[-1] == pytest.approx(1.0)
    assert left.ambiguities == ()


def test_periods_that_are_asked_for_are_summed(tmp_path):
    dt = np.resize([0.01, 0.02], 101)
    found = read_one(tmp_path, None, "dt", q=Q, dt=dt)
    assert found.times[-1] - found.times[0] == pytest.approx(dt[1:].sum())


def test_periods_that_are_not_one_a_frame_are_no_number_and_can_be_left_unread(tmp_path):
    with pytest.raises(FileFormatError, match=r"dt is no number.*--time-column none --rate HZ"):
        read_one(tmp_path, q=Q, dt=np.full(100, 0.01))
    found = read_one(tmp_path, 100.0, "none", q=Q, dt=np.full(100, 0.01))
    assert found.times[-1] == pytest.approx(1.0)


def test_one_joint_is_read_by_its_name(tmp_path):
    found = read_one(tmp_path, 100.0, key=("foo",), foo=Q[:, 0])
    np.testing.assert_array_equal(found.positions, Q[:, :1])


def test_outcomes_are_not_taken_for_the_motion_that_is_missing(tmp_path):
    np.savez(tmp_path / "a.npz", dt=0.01, outcome=np.arange(6.0)[:, None] ** [1, 2])
    with pytest.raises(FileFormatError, match=r"no array q.*--key"):
        read_recordings(tmp_path)


def test_a_total_of_samples_is_no_length_of_an_episode(tmp_path):
    q = np.cumsum(np.full((5, 100, 7), 0.01), axis=1)
    np.savez(tmp_path / "all.npz", q=q, t=0.02 * np.arange(100), num_samples=500)
    assert len(read_recordings(tmp_path / "all.npz")) == 5


def test_chunks_of_actions_are_no_episodes(tmp_path):
    t, q = sampled(0, 50)
    ahead = np.minimum(np.arange(len(q))[:, None] + np.arange(8), len(q) - 1)
    np.savez(tmp_path / "throw_0.npz", actions=q[ahead], t=t)
    with pytest.raises(FileFormatError, match=r"chunks of 8 actions.*actions\[:, 0\]"):
        read_recordings(tmp_path)


def test_episodes_that_rest_at_one_pose_first_are_no_chunks(tmp_path):
    ends = np.linspace(0.5, 1.0, 60)[:, None, None]
    q = ends * np.interp(np.arange(50), [5, 40], [0, 1])[:, None] * np.ones(7)
    np.savez(tmp_path / "all.npz", q=q, t=0.02 * np.arange(50))
    assert len(read_recordings(tmp_path / "all.npz")) == 60


@pytest.mark.parametrize("start", [np.datetime64("2024-01-01"), np.timedelta64(0, "us")])
def test_dates_and_spans_are_times_whose_unit_nobody_is_asked_for(tmp_path, start):
    stamps = start + (np.arange(101) * 20_000).astype("timedelta64[us]")
    log = np.zeros(101, dtype=[("stamp", stamps.dtype), ("q", float, 2)])
    log["stamp"], log["q"] = stamps, Q
    for arrays in ({"q": Q, "timestamps": stamps}, {"log": log}):
        np.testing.assert_allclose(
            read_one(tmp_path, **arrays).times, np.arange(101) / 50, atol=1e-6
        )
    np.save(tmp_path / "throw.npy", log)
    assert read_recordings(tmp_path / "throw.npy")[0].period == pytest.approx(0.02)
    for name in ("dt", "dt_ms"):
        period = {name: np.timedelta64(20, "ms")}
        assert read_one(tmp_path, q=Q, **period).period == pytest.approx(0.02)
    for name in ("t_ns", "timestamp_ms", "t [0.1 ms]"):
        named = read_one(tmp_path, **{"q": Q, name: stamps})
        np.testing.assert_allclose(named.times, np.arange(101) / 50, atol=1e-6)
    stamps[5] = "NaT"
    with pytest.raises(InvalidDemonstrationsError, match=r"nan.* frame 5"):
        read_one(tmp_path, q=Q, timestamps=stamps)


def test_an_episode_that_is_flagged_as_failed_is_said(tmp_path):
    t = np.arange(0, 2, 0.02)
    motions, flags = np.stack([throw(i, t) for i in range(N)]), np.arange(N) != 2
    np.savez(tmp_path / "all.npz", t=t, q=motions, success=flags)
    read = read_recordings(tmp_path / "all.npz")
    said = [any("success" in remark for remark in one.remarks) for one in read]
    assert said == (~flags).tolist()
    np.savez(tmp_path / "one.npz", t=t, q=motions[0], meta=json.dumps({"success": False}))
    (one,) = read_recordings(tmp_path / "one.npz")
    assert any("meta.success" in remark for remark in one.remarks)


def test_a_flag_of_the_joints_is_no_name_of_one(tmp_path):
    said = json.dumps({"joint_names_known": True})
    assert not read_one(tmp_path, q=Q[:, 0], meta=said, key=("q",), rate=50).named
