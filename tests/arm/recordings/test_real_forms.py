"""Forms in which people's recorders write the same six throws, each with its right value.

Every kind is tried in several inputs: equal up to a turn or a sign, units of channels that differ,
times by any name, names in any form, and what is stored beside the motion.
"""

import csv
import json

import h5py
import numpy as np
import pytest
import zarr

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import (
    FileFormatError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from tests.arm.recordings.recorded import (
    JOINTS,
    OUTCOMES,
    N,
    lerobot_set,
    sampled,
    write_outcomes,
)

TURN = 2 * np.pi
UR = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip
POSE = ("x [m]", "y [m]", "z [m]")


def swing(i, rate=50):
    """Times and a smooth course from 0 to 1 of the i-th throw."""
    t, q = sampled(i, rate)
    return t, (q[:, 1] - q[0, 1]) / (q[-1, 1] - q[0, 1])


def write(folder, names, motion, time="t", rate=50, times=None):
    """Six CSV files of what `motion(i, s)` returns for a course s from 0 to 1."""
    for i in range(N):
        t, s = swing(i, rate)
        columns = [] if time is None else [t if times is None else times(t)]
        with (folder / f"{i}.csv").open("w", newline="") as file:
            out = csv.writer(file)
            out.writerow([*([] if time is None else [time]), *names])
            out.writerows(np.column_stack([*columns, motion(i, s)]).tolist())
    write_outcomes(folder)
    return folder


def starts(folder, **options):
    """First frames of the demonstrations, and the remarks."""
    result = import_demonstrations(folder, **options)
    return result.demonstrations.plans[:, 0], " / ".join(result.preview.remarks)


def ur(i, s, off=(), to=-1.0):
    """Six joints; the last starts at 3.0, off by a turn in some throws."""
    q = np.array([0.1, -0.5, 0.4, 0.2, 0.1, 3.0]) + s[:, None] * 0.3 * (1 + 0.05 * i)
    q[:, 5] += to * TURN * (i in off)
    return q


@pytest.mark.slow
@pytest.mark.parametrize(
    ("off", "to", "start"),
    [((1,), -1, 3.0), ((0, 1, 2, 3, 4), -1, 3.0 - TURN), ((2, 4), -1, 3.0), ((0,), -1, 3.0)],
)
def test_throws_of_a_robot_that_are_a_turn_apart(tmp_path, off, to, start):
    folder = write(tmp_path, UR, lambda i, s: ur(i, s, off, to))
    first, said = starts(folder, joints=UR, robot=robot_limits("ur5e"))
    np.testing.assert_allclose(first[:, 5], start, atol=1e-6)
    assert "wrist_3_joint is taken 1 turn" in said


@pytest.mark.slow
def test_a_turn_in_degrees(tmp_path):
    folder = write(tmp_path, UR, lambda i, s: np.rad2deg(ur(i, s, (3,))))
    first, _ = starts(folder, joints=UR, robot=robot_limits("ur5e"), units=["deg"])
    np.testing.assert_allclose(first[:, 5], 3.0, atol=1e-6)


@pytest.mark.slow
def test_a_recorder_of_whole_circles_is_put_within_the_limits(tmp_path):
    folder = write(tmp_path, JOINTS, lambda i, s: np.mod(sampled(i, 50)[1] + 1e-4, TURN), rate=50)
    first, said = starts(folder, joints=JOINTS, robot=robot_limits("panda"))
    np.testing.assert_allclose(first[0], sampled(0, 50)[1][0] + 1e-4, atol=1e-6)
    assert "joint2 is taken 1 turn lower" in said


@pytest.mark.slow
def test_a_turn_that_the_limits_forbid_is_none(tmp_path):
    """The elbow of a UR turns by pi either way: 3.1 and -3.1 are far apart."""

    def motion(i, s):
        q = ur(i, s)
        q[:, 5] = 0.2
        q[:, 2] = (3.1 if i % 2 else -3.1) * (1 - 0.02 * s)
        return q

    first, said = starts(write(tmp_path, UR, motion), joints=UR, robot=robot_limits("ur5e"))
    np.testing.assert_allclose(np.abs(first[:, 2]), 3.1)
    assert "turn" not in said


@pytest.mark.parametrize("name", ["yaw [rad]", "roll [rad]", "tool_heading [rad]", "base [rad]"])
def test_angles_at_the_cut_between_throws(tmp_path, name):
    folder = write(
        tmp_path,
        (*POSE, name),
        lambda i, s: np.column_stack(
            [s, 0.2 * s, 0.1 * s * i, np.full(len(s), 3.1 if i % 2 else -3.12)]
        ),
    )
    first, said = starts(folder)
    assert np.ptp(first[:, 3]) < 0.1
    assert "the same pose" in said


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("name", ["yaw", "azimuth", "base"])
def test_angles_that_pass_the_cut_within_a_throw(tmp_path, name, unit):
    turn = {"rad": TURN, "deg": 360.0}[unit]

    def motion(i, s):
        angle = 0.45 * turn + 0.1 * turn * s * (1 + 0.05 * i)
        return np.column_stack([s, s, s, np.mod(angle + turn / 2, turn) - turn / 2])

    result = import_demonstrations(write(tmp_path, (*POSE, f"{name} [{unit}]"), motion))
    plans = result.demonstrations.plans[:, :, 3]
    assert np.abs(np.diff(plans, axis=1)).max() < 0.5
    assert np.ptp(plans[0]) == pytest.approx(0.1 * TURN, rel=0.01)
    assert any("passes the end of its range" in remark for remark in result.preview.remarks)


def quaternion(i, s):
    half = 0.5 * (3.0 + 0.4 * s * (1 + 0.05 * i))
    return np.column_stack([np.sin(half) * 0.6, np.sin(half) * 0.8, 0 * s, np.cos(half)])


@pytest.mark.parametrize("where", ["between", "within"])
@pytest.mark.parametrize(
    "names", [("qx", "qy", "qz", "qw"), tuple(f"pose.orientation.{c}" for c in "xyzw")]
)
def test_quaternions_of_either_sign(tmp_path, names, where):
    def motion(i, s):
        q = quaternion(i, s)
        q = q * np.where(q[:, 3:] < 0, -1, 1) if where == "within" else q * (-1) ** i
        return np.column_stack([s, s, s, q])

    result = import_demonstrations(write(tmp_path, (*POSE, *names), motion))
    plans = result.demonstrations.plans[:, :, 3:]
    np.testing.assert_allclose(np.abs(np.sum(plans[:, 0] * plans[0, 0], axis=1)), 1, atol=1e-3)
    assert np.all(np.sum(plans[:, 0] * plans[0, 0], axis=1) > 0)
    assert np.abs(np.diff(plans, axis=1)).max() < 0.1
    assert result.demonstrations.format.attitudes == (names,)
    assert result.demonstrations.format.units[3:] == ("1",) * 4


def test_rotation_vectors_at_the_cut(tmp_path):
    def motion(i, s):
        angle = (3.1 if i % 2 else 3.1 - TURN) + 0 * s
        return np.column_stack([s, s, s * i, 0.6 * angle, 0.8 * angle, 0 * angle])

    names = ("rx [rad]", "ry [rad]", "rz [rad]")
    first, _ = starts(write(tmp_path, (*POSE, *names), motion))
    assert np.ptp(first[:, 3:5], axis=0).max() < 0.01


@pytest.mark.parametrize("names", [POSE + tuple(f"pose_{k}" for k in range(4)),
                                   tuple(f"ee_state_{k}" for k in range(7))])  # fmt: skip
def test_a_quaternion_is_known_by_its_length_where_names_do_not_say(tmp_path, names):
    def motion(i, s):
        return np.column_stack([0.4 + 0.2 * s, 0.3 * s, 0.1 * s, quaternion(i, s) * (-1) ** i])

    result = import_demonstrations(write(tmp_path, names, motion))
    assert np.ptp(result.demonstrations.plans[:, 0, 3:], axis=0).max() < 0.01
    assert result.demonstrations.format.attitudes == (tuple(names[3:]),)


def test_a_rotation_vector_is_known_by_its_other_form_where_names_do_not_say(tmp_path):
    def motion(i, s):
        v = np.column_stack([2.2 + 0.05 * s, 2.2 - 0.05 * s, 0.1 + 0.2 * s])
        if i in (1, 4):
            v = v * (1 - TURN / np.linalg.norm(v, axis=1, keepdims=True))
        return np.column_stack([0.4 + 0.2 * s, 0.1 + 0.03 * i * s, 0.3 + 0 * s, v])

    first, said = starts(write(tmp_path, tuple(f"actual_TCP_pose_{k}" for k in range(6)), motion))
    np.testing.assert_allclose(first[:, 3:], np.tile([2.2, 2.2, 0.1], (N, 1)), atol=1e-3)
    assert "the other numbers of the same turn" in said


@pytest.mark.parametrize("names", [("yaw [deg]", "pitch [deg]", "roll [deg]"),
                                   ("A [deg]", "B [deg]", "C [deg]")])  # fmt: skip
@pytest.mark.parametrize("where", ["between", "within"])
def test_euler_angles_of_either_form(tmp_path, names, where):
    def motion(i, s):
        first, middle, last = 10 + 5 * s, 70 + 35 * s * (1 + 0.02 * i), 20 + 10 * s
        other = i % 2 if where == "between" else middle > 90
        first, last = (np.mod(a + 180 * other + 180, 360) - 180 for a in (first, last))
        return np.column_stack([s, s, s, first, np.where(other, 180 - middle, middle), last])

    result = import_demonstrations(write(tmp_path, (*POSE, *names), motion))
    plans = np.rad2deg(result.demonstrations.plans[:, :, 3:])
    np.testing.assert_allclose(plans[:, 0], np.tile([10, 70, 20], (N, 1)), atol=0.1)
    assert np.abs(np.diff(plans, axis=1)).max() < 5


def test_a_frame_that_is_averaged_across_the_cut_is_refused(tmp_path):
    def motion(i, s):
        wrapped = np.mod(150 + 60 * s + 180, 360) - 180
        at = int(np.argmin(np.diff(wrapped)))
        wrapped[at] = wrapped[at : at + 2].mean() + 20
        return np.column_stack([s, s, wrapped])

    with pytest.raises(InvalidDemonstrationsError, match=r"yaw steps by .* in one frame"):
        starts(write(tmp_path, ("a", "b", "yaw [deg]"), motion))


@pytest.mark.parametrize(
    ("names", "units", "scale"),
    [
        (("shoulder [rev]", "elbow [rev]"), ("rad", "rad"), TURN),
        (("q_deg_0", "q_deg_1"), ("rad", "rad"), TURN / 360),
        (("shoulder [rad]", "pressure [bar]"), ("rad", "bar"), 1),
        (("x", "y"), ("m", "m"), 1),
    ],
)
def test_units_are_what_names_say(tmp_path, names, units, scale):
    def motion(i, s):
        return np.column_stack([0.1 + 0.3 * s, 0.2 + 2.3 * s * (1 + 0.01 * i)])

    made = import_demonstrations(write(tmp_path, names, motion)).demonstrations
    assert made.format.units == units
    np.testing.assert_allclose(made.plans[0, [0, -1]] / scale, [[0.1, 0.2], [0.4, 2.5]], atol=0.01)


def test_places_and_angles_are_asked_about_each_in_their_unit(tmp_path):
    def motion(i, s):
        places = 600 + 200 * s, 100 + 20 * i * s, 400 + 30 * s
        return np.column_stack([*places, -90 + 30 * s, 10 + 40 * s, 175 + 3 * s])

    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(write(tmp_path, tuple("XYZABC"), motion))
    assert caught.value.options == "--units mm mm mm deg deg deg"


@pytest.mark.parametrize(("unit", "span", "looks"), [("m", 80, "mm"), ("percent", 0.9, "share")])
def test_a_grippers_unit_is_asked_about_where_it_is_another(tmp_path, unit, span, looks):
    folder = write(tmp_path, (*UR, "gripper"), lambda i, s: np.column_stack([ur(i, s), span * s]))
    plan_units = (*["rad"] * 6, unit)
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(folder, plan_units=plan_units)
    assert caught.value.options == f"--units {'rad ' * 6}{looks}"
    units = caught.value.options.removeprefix("--units ").split()
    made = import_demonstrations(folder, plan_units=plan_units, units=units).demonstrations
    factor = {"mm": 0.001, "share": 100}[looks]
    assert made.plans[:, -1, -1] == pytest.approx(span * factor, rel=0.01)


def test_a_switch_of_five_is_no_turn(tmp_path):
    def motion(i, s):
        return np.column_stack([s, s, 5.0 * (s > 0.5)])

    result = import_demonstrations(write(tmp_path, ("a", "b", "valve"), motion))
    assert np.ptp(result.demonstrations.plans[:, :, 2]) == pytest.approx(5.0)


def test_a_joint_that_steps_is_refused(tmp_path):
    def motion(i, s):
        q = ur(i, s)
        q[40:, 1] += 4.5
        return q

    with pytest.raises(InvalidDemonstrationsError, match="which no joint does in one frame"):
        starts(write(tmp_path, UR, motion), joints=UR, robot=robot_limits("ur5e"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gripper", "jaw", "left_finger", "grip_width"])
def test_a_gripper_in_percent_is_asked_about_alone(tmp_path, name):
    folder = write(tmp_path, (*UR, name), lambda i, s: np.column_stack([ur(i, s), 20 + 60 * s]))
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(folder)
    assert caught.value.options == "--units rad rad rad rad rad rad percent"
    result = import_demonstrations(folder, units=caught.value.options.split()[1:])
    np.testing.assert_allclose(result.demonstrations.plans[:, 0, 5], 3.0, atol=1e-6)
    assert result.demonstrations.plans[:, :, 6].max() == pytest.approx(80)
    with pytest.raises(UnclearUnitsError, match="hardly a motion"):
        import_demonstrations(folder, units=["deg"])


def test_a_gripper_of_a_share_is_no_angle_and_no_question(tmp_path):
    folder = write(
        tmp_path, (*UR, "gripper"), lambda i, s: np.column_stack([ur(i, s), 0.2 + 0.6 * s])
    )
    assert import_demonstrations(folder).demonstrations.format.units[6] == "1"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("__time", lambda t: t + 1.76e9),
        ("Zeit", lambda t: t),
        ("temps_ms", lambda t: 1000 * t),
        ("时间", lambda t: t),
        ("elapsedTime", lambda t: t),
        ("stamp_ns", lambda t: 1e9 * t),
        ("wall_time", lambda t: t),
    ],
)
def test_times_by_any_name(tmp_path, name, times):
    folder = write(tmp_path, UR, ur, time=name, times=times)
    for joints in (UR, None):
        recording = read_recordings(folder, joints=joints)[0]
        np.testing.assert_allclose(recording.times, swing(0)[0], atol=1e-5)
        assert recording.names == UR


def test_a_column_that_rises_is_offered_as_the_time(tmp_path):
    with pytest.raises(UnclearUnitsError) as caught:
        read_recordings(write(tmp_path, UR, ur, time="chrono"), joints=UR)
    assert caught.value.options == "--time-column chrono"


@pytest.mark.parametrize("names", [("secs", "nsecs"), ("stamp.sec", "stamp.nanosec")])
def test_seconds_and_nanoseconds_are_one_time(tmp_path, names):
    def motion(i, s):
        t = swing(i)[0] + 0.9
        return np.column_stack([1.76e9 + np.floor(t), np.round(t % 1 * 1e9), ur(i, s)])

    folder = write(tmp_path, (*names, *UR), motion, time=None)
    np.testing.assert_allclose(read_recordings(folder)[0].times, swing(0)[0], atol=1e-6)


@pytest.mark.parametrize("other", [lambda t: t * 1.5, lambda t: t + 0.5 * (t > 0.8)])
def test_two_clocks_that_contradict_each_other(tmp_path, other):
    folder = write(
        tmp_path, ("wall_time", *UR), lambda i, s: np.column_stack([other(swing(i)[0]), ur(i, s)])
    )
    with pytest.raises(FileFormatError, match="say which is the time: --time-column t, or wall"):
        read_recordings(folder)
    recording = read_recordings(folder, time_column="wall_time")[0]
    np.testing.assert_allclose(recording.times, other(swing(0)[0]), atol=1e-6)


def test_times_and_a_rate_that_contradict_each_other(tmp_path):
    t, q = sampled(0, 100)
    np.savez(tmp_path / "a.npz", t=t, dt=0.02, q=q)
    with pytest.raises(FileFormatError, match="t says 100 frames a second, but dt 50"):
        read_recordings(tmp_path / "a.npz")


@pytest.mark.parametrize("form", ["npz", "hdf5", "zarr"])
def test_times_beside_an_array_are_read_and_held_against_each_other(tmp_path, form):
    t, q = sampled(0, 20)

    def read(**arrays):
        source = tmp_path / f"{len(arrays)}.{form}"
        if form == "npz":
            np.savez(source, q=q, **arrays)
        elif form == "hdf5":
            with h5py.File(source, "w") as file:
                for name, array in {"q": q, **arrays}.items():
                    file[f"data/demo_0/{name}"] = array
        else:
            store = zarr.open_group(str(source), mode="w", zarr_format=2)
            store.create_array("meta/episode_ends", data=np.array([len(t)]))
            for name, array in {"q": q, **arrays}.items():
                store.create_array(f"data/{name}", data=array)
        return read_recordings(source, key="q")[0]

    np.testing.assert_allclose(read(wall_time=t + 7).times, t, atol=1e-9)
    np.testing.assert_allclose(read(time=t, wall_time=1000 * t).times, t, atol=1e-9)
    with pytest.raises(FileFormatError, match="say which is the time: --time-column time, or wall"):
        read(time=t, wall_time=t * 1.25, other=t)


@pytest.mark.parametrize("how", ["another rate", "a gap"])
def test_stamps_of_lerobot_are_read(tmp_path, how):
    import pyarrow.parquet as pq

    folder = lerobot_set(tmp_path / "set", 30, [sampled(0, 30)[1]], [*JOINTS])
    (path,) = (folder / "data").glob("**/*.parquet")
    table = pq.read_table(path)
    index = np.arange(len(table))
    stamps = index / 20 if how == "another rate" else index / 30 + 0.4 * (index > 25)
    i = table.column_names.index("timestamp")
    field = table.schema.field(i)
    table = table.set_column(i, field, [stamps.astype(np.float32)])
    pq.write_table(table, path)
    if how == "another rate":
        with pytest.raises(FileFormatError, match="timestamp says 20 frames a second, but fps"):
            read_recordings(folder)
        assert read_recordings(folder, time_column="none")[0].period == pytest.approx(1 / 30)
        assert read_recordings(folder, time_column="timestamp")[0].period == pytest.approx(0.05)
    else:
        assert np.diff(read_recordings(folder)[0].times).max() == pytest.approx(0.4333, abs=1e-3)


@pytest.mark.parametrize(
    ("names", "read"),
    [
        ({name: i for i, name in enumerate(JOINTS)}, JOINTS),
        ({name: 6 - i for i, name in enumerate(JOINTS)}, JOINTS[::-1]),
        ({"arm": list(JOINTS[:6]), "gripper": [JOINTS[6]]}, JOINTS),
        ({"motors": {"arm": list(JOINTS)}}, JOINTS),
        ([list(JOINTS[:3]), list(JOINTS[3:])], JOINTS),
        (
            {"left": ["a", "b", "c"], "right": ["a", "b", "c", "d"]},
            ("left.a", "left.b", "left.c", "right.a", "right.b", "right.c", "right.d"),
        ),
    ],
)
def test_names_of_lerobot_in_every_form(tmp_path, names, read):
    folder = lerobot_set(tmp_path / "set", 30, [sampled(0, 30)[1]], names)
    recording = read_recordings(folder)[0]
    assert recording.names == read


def test_columns_of_tools_that_write_fields(tmp_path):
    names = [f"/joint_states/{name}/position" for name in UR]
    recording = read_recordings(write(tmp_path, names, ur), joints=UR)[0]
    assert recording.columns == tuple(names)


def test_a_list_in_a_cell_is_a_column_for_each_number(tmp_path):
    t, q = sampled(0, 50)
    rows = [f'{a:.3f},"{json.dumps(b.tolist())}"' for a, b in zip(t, q, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["t,angles", *rows]))
    recording = read_recordings(tmp_path / "a.csv")[0]
    assert recording.names == tuple(f"angles_{i}" for i in range(7))
    np.testing.assert_allclose(recording.positions, q)


@pytest.mark.slow
def test_a_gripper_in_another_array_is_named_and_can_be_taken(tmp_path):
    t, q = sampled(0, 50)
    grip = 1.0 * (t > 0.6)
    np.savez(tmp_path / "a.npz", t=t, q=q, joint_names=JOINTS, grip=grip, dq=np.gradient(q, axis=0))
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        demo = file.create_group("data/demo_0/obs")
        demo["robot0_joint_pos"], demo["robot0_gripper_qpos"] = q, np.column_stack([grip, -grip])
    store = zarr.open_group(str(tmp_path / "a.zarr"), mode="w", zarr_format=2)
    for name, array in (
        ("data/q", q),
        ("data/grip", grip[:, None]),
        ("meta/episode_ends", [len(t)]),
    ):
        store.create_array(name, data=np.asarray(array))
    for source, key, beside in (
        ("a.npz", "q", "grip"),
        ("a.hdf5", "obs/robot0_joint_pos", "obs/robot0_gripper_qpos"),
        ("a.zarr", "q", "grip"),
    ):
        how = {} if source == "a.npz" else {"rate": 50}
        path = tmp_path / source
        (alone,) = read_recordings(path, key=[key], **how)
        assert [*moving_beside([alone])] == [beside]
        (both,) = read_recordings(path, key=[key, beside], **how)
        assert np.ptp(both.positions[:, 7]) == 1.0
        assert not moving_beside([both])


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.hdf5", "a.bag"])
def test_a_pointer_of_git_lfs_is_told_as_one(tmp_path, name):
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n"
    (tmp_path / name).write_text(pointer)
    with pytest.raises(FileFormatError, match="git lfs pull"):
        read_recordings(tmp_path / name)


@pytest.mark.slow
def test_a_log_of_changes_holds_still_between_them(tmp_path):
    def motion(i, s):
        return ur(i, s)

    folder = write(tmp_path, UR, motion, rate=100)
    for i in range(N):
        lines = (folder / f"{i}.csv").read_text().splitlines()
        kept = [lines[0], lines[1]]
        for line in lines[2:]:
            now, last = (np.array(one.split(",")[1:], float) for one in (line, kept[-1]))
            if np.abs(now - last).max() > 0.0017:
                kept.append(line)
        (folder / f"{i}.csv").write_text("\n".join(kept))
    result = import_demonstrations(folder, joints=UR, robot=robot_limits("ur5e"))
    assert not any(report.refused for report in result.preview.inspection.reports)
    assert any("written at changes only" in remark for remark in result.preview.remarks)


@pytest.mark.parametrize("slip", ["ten times", "a lost sign", "shifted", None])
def test_outcomes_that_do_not_fit_are_named(tmp_path, slip):
    rng = np.random.default_rng(0)
    aims = rng.uniform(-1, 1, (8, 2))
    outcomes = np.array([0.8, 0.0]) + aims * [0.2, 0.15]
    for i, (a, b) in enumerate(aims):
        t, s = swing(0)
        q = np.column_stack([s * (1 + 0.3 * a), s * (0.5 + 0.3 * b), 0.2 * s])
        np.savez(tmp_path / f"throw_{i}.npz", t=t, q=q)
    if slip == "ten times":
        outcomes[3, 0] *= 10
    elif slip == "a lost sign":
        outcomes[int(np.argmax(np.abs(outcomes[:, 1]))), 1] *= -1
    elif slip == "shifted":
        outcomes = np.roll(outcomes, 1, axis=0)
    named = {f"throw_{i}": row.tolist() for i, row in enumerate(outcomes)}
    with_limits = import_demonstrations(tmp_path, outcomes=named, outcome_units=["m", "m"])
    said = " / ".join(with_limits.preview.remarks)
    expected = {"ten times": "throw_3, ", "a lost sign": "sign", "shifted": "one row too"}
    assert (expected[slip] in said) if slip else ("may" not in said)
    assert len(OUTCOMES) == N
