"""CSV files come back as the motions that were written, and say what is wrong with them."""

import json

import numpy as np
import pandas as pd
import pytest

from prior_reinforce.arm.recordings import import_demonstrations, read_recordings
from prior_reinforce.arm.recordings.beside import moving_beside
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    PriorReinforceError,
    UnclearUnitsError,
)
from tests.arm.recordings.recorded import (
    AS_IS,
    JOINTS,
    N,
    check_motions,
    sampled,
    write_csv,
    write_npz,
    write_outcomes,
)


@pytest.mark.slow
def test_csv(tmp_path):
    write_outcomes(write_csv(tmp_path))
    check_motions(import_demonstrations(tmp_path, preprocessing=AS_IS), 100, tolerance=0)


def test_csv_with_a_column_of_episodes_and_text_beside(tmp_path):
    lines = ["episode,time,joint2,phase,joint1"]
    for episode in ("b10", "b9"):
        lines += [f"{episode},{k / 10},{k + len(episode)},swing,{-k}" for k in range(5)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    recordings = read_recordings(tmp_path / "log.csv", joints=["joint1", "joint2"])
    assert [r.episode for r in recordings] == ["b9", "b10"]
    np.testing.assert_array_equal(recordings[0].positions[:, 0], -np.arange(5))
    np.testing.assert_array_equal(recordings[1].positions[:, 1], np.arange(5) + 3)
    assert recordings[0].remarks == ()
    every = read_recordings(tmp_path / "log.csv")[0]
    assert every.names == ("joint2", "joint1")
    assert every.remarks == ("phase left out, which holds no number",)
    text = (tmp_path / "log.csv").read_text().replace("-3", "three")
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(FileFormatError, match="line 10: joint1 is 'three', expected a number"):
        read_recordings(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has 0 frames"),
        ("t,a\n0,1\n", "has 1 frames"),
        ("t,a\n0,1\n0.1\n", "line 3: a is ''"),
        ("t,a\n0,1\n0.1,x\n", "line 3: a is 'x'"),
        ("a,b\n0,1\n1,2\n", "give the rate"),
        ("t,a\n0.1,1\n0.0,2\n", "time does not increase"),
        ("t,a,b,a\n0,1,1,1\n0.1,2,2,2\n", "repeats a channel name: a; rename"),
        ('t,a\n0,"1\n0.1,2\n', "as a table .*unexpected end of data"),
        ("t\n0\n1\n", "for 0 channels"),
    ],
)
def test_csv_of_other_content(tmp_path, text, says):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(PriorReinforceError, match=says):
        read_recordings(tmp_path / "bad.csv")


def libfranka_log(path, q):
    """As libfranka 0.9.2 was seen to write it: `time` in ms since the robot started, six digits."""
    vectors = {"state.q": q, "state.q_d": q, "state.dq": 0 * q, "cmd.q_d": q + 1}
    names = ["time", "success_rate"]
    names += [f"{name}[{i}]" for name in vectors for i in range(7)]
    lines = [",".join(names)]
    for k, row in enumerate(np.column_stack(list(vectors.values()))):
        lines.append(f"{123456789 + k},1,{','.join(f'{v:.6g}' for v in row)}")
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.slow
def test_libfrankas_log_is_known_by_its_columns(tmp_path):
    libfranka_log(tmp_path / "0.csv", sampled(0, 1000)[1])
    (recording,) = read_recordings(tmp_path, joints=JOINTS)
    assert recording.period == pytest.approx(0.001)
    assert recording.duration == pytest.approx(1.7)
    np.testing.assert_allclose(recording.positions, sampled(0, 1000)[1], atol=1e-5)
    assert recording.remarks == ("libfranka's log: time in ms, motion is state.q (measured)",)
    commanded = read_recordings(tmp_path, key="cmd.q_d")[0]
    np.testing.assert_allclose(commanded.positions, recording.positions + 1, atol=2e-5)
    with pytest.raises(ConfigurationError, match="time is in ms, but --time-unit says s"):
        read_recordings(tmp_path, time_unit="s")
    with pytest.raises(ConfigurationError, match="time in ms says 1000 Hz"):
        read_recordings(tmp_path, rate=100)


@pytest.mark.slow
def test_a_numbered_group_keeps_what_its_columns_are_called(tmp_path):
    for i in range(N):
        t, q = sampled(i, 100)
        rows = np.column_stack([t, q, q + 1])
        header = ",".join(["t", *(f"q{k}" for k in range(7)), *(f"tau{k}" for k in range(7))])
        np.savetxt(tmp_path / f"{i}.csv", rows, delimiter=",", header=header, comments="")
    recording = read_recordings(tmp_path, key="q")[0]
    assert (recording.names, recording.named) == (tuple(f"column{k}" for k in range(1, 8)), False)
    assert recording.columns == tuple(f"q{k}" for k in range(7))


@pytest.mark.slow
def test_the_log_of_the_first_libfranka_is_known_by_its_columns(tmp_path):
    """Its `logToCSV` gives commands the names of the state's vectors, after an empty column."""
    q = sampled(0, 1000)[1]
    vectors = [", ".join(f"{name}[{i}]" for i in range(7)) for name in ("q", "q_d", "tau_J")]
    lines = [f"duration, success rate, {','.join(vectors)},sent commands,{vectors[1]}"]
    for k, row in enumerate(q):
        cells = ",".join(f"{v:.6g}" for v in row)
        lines.append(f"{5000 + k},1,{cells},{cells},{cells},,{cells}")
    (tmp_path / "0.csv").write_text("\n".join(lines) + "\n")
    (recording,) = read_recordings(tmp_path, joints=JOINTS)
    np.testing.assert_allclose(recording.positions, q, atol=1e-5)
    np.testing.assert_allclose(recording.times, np.arange(len(q)) / 1000)


def test_an_rtde_log_is_known_by_its_columns(tmp_path):
    """As UR's own recorder writes it: blanks between cells, seconds since the start."""
    t, q = sampled(0, 500)
    names = [
        "timestamp",
        *(f"target_q_{i}" for i in range(6)),
        *(f"actual_q_{i}" for i in range(6)),
    ]
    rows = np.column_stack([t + 4711.5, q[:, :6] + 1, q[:, :6]])
    np.savetxt(tmp_path / "0.csv", rows, header=" ".join(names), comments="", fmt="%.9f")
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.positions, q[:, :6], atol=1e-8)
    assert recording.period == pytest.approx(0.002)
    assert not recording.named  # six columns are any six joints, in order
    rows = np.column_stack([t, q[:, :6], q[:, :6]])
    names = [*names[:7], *(f"actual_TCP_pose_{i}" for i in range(6))]
    pd.DataFrame(rows, columns=names).to_csv(tmp_path / "0.csv", index=False)
    (pose,) = read_recordings(tmp_path, key="actual_TCP_pose")
    assert pose.names == tuple(names[7:])  # a pose is that of no six joints


def test_an_rtde_log_of_an_arm_at_rest_keeps_its_rows(tmp_path):
    t, names = np.arange(50) / 500, ["timestamp", "actual_q_0", "actual_q_1"]
    q = np.column_stack([np.round(np.linspace(0, 1e-4, 50), 5), np.ones(50)])  # whole 10 urad
    pd.DataFrame(np.column_stack([t, q]), columns=names).to_csv(tmp_path / "0.csv", index=False)
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.positions, q)
    assert len(recording.remarks) == 1


def rtde_log(path, t, q):
    names = ["timestamp", *(f"actual_q_{i}" for i in range(q.shape[1]))]
    pd.DataFrame(np.column_stack([t + 512.0, q]), columns=names).to_csv(path, index=False)


def repeated(t, q):
    """Every seventh row twice, as ur_rtde's recorder writes them."""
    twice = np.repeat(np.arange(len(t)), 1 + (np.arange(len(t)) % 7 == 0))
    return t[twice], q[twice]


@pytest.mark.parametrize("recorder", [lambda t, q: (t, q), repeated], ids=["ur", "ur_rtde"])
@pytest.mark.parametrize(
    ("rate", "digits"),
    [(500, 3), (20, 5), (10, 5)],  # coarse at the arm's cycle; slow, so that a rest comes at once
)
def test_right_rows_of_an_rtde_log_are_kept(tmp_path, recorder, rate, digits):
    t, q = sampled(0, rate)
    q = np.round(q[:, :6], digits)
    rtde_log(tmp_path / "0.csv", *recorder(t, q))
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.times, t, atol=1e-9)
    np.testing.assert_array_equal(recording.positions, q)


def test_an_rtde_log_without_a_repeated_row_is_of_another_recorder(tmp_path):
    """Positions of an arm at 125 Hz with times at 500 Hz."""
    t, q = sampled(0, 500)
    q = np.round(q[:, :6], 6)[np.arange(len(t)) // 4 * 4]
    rtde_log(tmp_path / "0.csv", t, q)
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_array_equal(recording.positions, q)


def test_a_channel_without_a_name_is_called_by_its_number(tmp_path):
    (tmp_path / "a.csv").write_text(",b\n0,1\n5,2\n3,4\n")
    (recording,) = read_recordings(tmp_path, rate=100)
    assert recording.names == ("column 1", "b")


@pytest.mark.slow
def test_columns_without_names_are_in_order_and_their_time_is_a_doubt(tmp_path):
    for i in range(N):
        t, q = sampled(i, 100)
        np.savetxt(tmp_path / f"{i}.csv", np.column_stack([1000 * t, np.rad2deg(q)]), delimiter=",")
    write_outcomes(tmp_path)
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(tmp_path, joints=JOINTS)
    assert caught.value.options == "--time-column 1 --time-unit ms --units deg"
    said = {"time_column": "1", "time_unit": "ms", "units": ["deg"]}
    result = import_demonstrations(tmp_path, joints=JOINTS, preprocessing=AS_IS, **said)
    check_motions(result, 100, tolerance=1e-12)


def test_a_column_of_throws_by_another_name(tmp_path):
    (tmp_path / "log.csv").write_text("throw_id,t,a\n1,0,1\n1,.1,2\n2,0,1\n2,.1,2\n")
    assert [r.episode for r in read_recordings(tmp_path)] == ["1", "2"]
    (tmp_path / "log.csv").write_text("wurf,t,a\n1,0,1\n1,.1,2\n2,0,1\n2,.1,2\n")
    assert len(read_recordings(tmp_path, episode_column="wurf")) == 2
    with pytest.raises(
        ConfigurationError, match="no column 'nr' for --episode-column; it has wurf"
    ):
        read_recordings(tmp_path, episode_column="nr")


@pytest.mark.parametrize("column", ["chrono", "1"])
def test_the_column_of_times_tells_throws_apart_by_its_name_or_number(tmp_path, column):
    lines = ["chrono,joint1"] + [f"{k / 50},{k % 7}" for _ in range(2) for k in range(30)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    recordings = read_recordings(tmp_path / "log.csv", time_column=column, time_unit="s")
    assert [r.episode for r in recordings] == ["log-0", "log-1"]


def test_joints_by_the_gates_names_and_a_refusal_that_is_short(tmp_path):
    names = [f"panda_joint{i}" for i in range(1, 8)]
    t, q = sampled(0, 100)
    table = np.column_stack([t, q])
    header = ",".join(["t", *names])
    np.savetxt(tmp_path / "0.csv", table, delimiter=",", header=header, comments="")
    (recording,) = read_recordings(tmp_path, joints=JOINTS)
    assert recording.names == tuple(names)
    (other,) = read_recordings(tmp_path, key="panda_joint")
    np.testing.assert_array_equal(other.positions, recording.positions)
    with pytest.raises(FileFormatError, match=r"no columns q_0, q_1, .*; numbered columns are pan"):
        read_recordings(tmp_path, key="q")
    with pytest.raises(InvalidDemonstrationsError) as caught:
        import_demonstrations(tmp_path, joints=[f"A{i}" for i in range(1, 8)])
    assert str(caught.value) == (
        "episode 0 has no joint A1 to A7; it has panda_joint1 to panda_joint7: give the recorded "
        "names in the plan's order with --joints, or numbered columns at once: --key panda_joint"
    )


def test_other_endings_are_read_where_nothing_else_is_there(tmp_path):
    write_csv(tmp_path)
    for path in list(tmp_path.glob("*.csv")):
        path.rename(path.with_suffix(".txt"))
    assert len(read_recordings(tmp_path)) == len(read_recordings(tmp_path, format="csv")) == N
    write_npz(tmp_path)
    assert {r.episode for r in read_recordings(tmp_path)} == {f"throw_{i}" for i in range(N)}


def texts(path, names, cells, q, heads):
    """A table of times, texts and positions, as ROS tools write JointStates."""
    rows = [",".join(["t", *names, *heads])]
    for k, row in enumerate(q):
        rows.append(",".join([f"{k / 50}", *cells, *(f"{v:.6f}" for v in row)]))
    path.write_text("\n".join(rows) + "\n")


@pytest.mark.parametrize("form", ["columns", "a cell"])
def test_names_in_cells_are_those_of_the_numbers_beside(tmp_path, form):
    q, said = sampled(0, 50)[1], JOINTS[::-1]
    names, cells, heads = (
        ([f"name{i}" for i in range(7)], said, [f"position{i}" for i in range(7)])
        if form == "columns"
        else (["name"], [f'"{list(said)}"'], [f"position_{i}" for i in range(7)])
    )
    velocities = [f"velocity{i}" for i in range(7)]
    path = tmp_path / "a.csv"
    texts(path, names, cells, np.column_stack([q, 0.1 * q]), [*heads, *velocities])
    for how in ({"joints": JOINTS}, {"key": heads[0][:-1].rstrip("_")}):
        (recording,) = read_recordings(tmp_path, **how)
        assert [n for n in recording.names if n in JOINTS] == [
            *(JOINTS if "joints" in how else said)
        ]
        assert not moving_beside([recording])
    wanted = read_recordings(tmp_path, joints=JOINTS)[0]
    np.testing.assert_allclose(wanted.positions, q[:, ::-1], atol=1e-6)
    lines = path.read_text().splitlines()
    lines[9] = lines[9].replace("joint1", "elbow")
    path.write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=r"line 10: name.* before joint7.*of one publisher"):
        read_recordings(tmp_path, joints=JOINTS)


def test_gaps_and_switches_beside_the_joints_are_named(tmp_path):
    t, q = sampled(0, 50)
    rows = [f"{a:.2f},{b[1]:.6f},{b[3]:.6f}" for a, b in zip(t, q, strict=True)]
    rows = [
        f"{row},{80 - 70 * k / len(t) if k % 5 == 0 else ''},{'on' if k < 40 else 'off'},arm"
        for k, row in enumerate(rows)
    ]
    (tmp_path / "a.csv").write_text("\n".join(["t,a,b,gripper,vacuum,frame_id", *rows]))
    (recording,) = read_recordings(tmp_path, joints=["a", "b"])
    assert [*moving_beside([recording])] == ["gripper"]
    assert recording.remarks == ("vacuum left out, which holds no number",)


def table(folder, head, columns, above=""):
    rows = [",".join(map(repr, map(float, row))) for row in np.column_stack(columns)]
    path = folder / "t.csv"
    path.write_text("\n".join([*([above] if above else []), head, *rows]) + "\n")
    return path


@pytest.mark.parametrize("json_name", ["throw_0.json", "columns.json"])
@pytest.mark.parametrize("time", [True, False])
def test_a_json_beside_a_table_without_heads_names_its_columns(tmp_path, json_name, time):
    t, q = sampled(0, 100)
    np.savetxt(tmp_path / "throw_0.csv", np.column_stack([t, q[:, ::-1]]), delimiter=",")
    names = [*["t"] * time, *JOINTS[::-1]]
    units = ["s", *["rad"] * 7] if json_name == "columns.json" else "rad"
    said = json.dumps({"robot": {"columns": names}, "units": units, "rows": 3})
    (tmp_path / json_name).write_text(said)
    (recording,) = read_recordings(tmp_path / "throw_0.csv", joints=JOINTS)
    assert (recording.names, recording.clock) == (JOINTS, "t in s")
    assert set(recording.units) == {"rad"}
    np.testing.assert_array_equal(recording.positions, q)


@pytest.mark.parametrize(
    ("comment", "units"),
    [
        ("# angles in degrees", ("deg", "deg", None, "rad")),
        ("# Joint positions [deg], time [ms]", ("deg", "deg", None, "rad")),
        ("% angle unit = °", ("deg", "deg", None, "rad")),
        ("#units,s,deg,deg,mm,rad", (None,) * 3 + ("rad",)),  # two
        ("# recorded without deg to rad", (None,) * 3 + ("rad",)),
        ("# outcome units: deg", (None,) * 3 + ("rad",)),
        ("# release angle [deg]: 30", (None,) * 3 + ("rad",)),
        ("# angle [deg]: 30", (None,) * 3 + ("rad",)),
        ("# Euler angles in deg", (None,) * 3 + ("rad",)),
        ("# units of camera: deg, gripper angle in deg", (None,) * 3 + ("rad",)),
        ("# Angles are in degrees", ("deg", "deg", None, "rad")),
        ("# t in s, q in deg", ("deg", "deg", None, "rad")),
        ("# angle_unit: deg", ("deg", "deg", None, "rad")),
        ({"angle_unit": "deg"}, ("deg", "deg", None, "rad")),
        ({"units": {"angle": "deg", "time": "ms"}}, ("deg", "deg", None, "rad")),
        ({"units": ["deg", "rad", "mm", "deg"]}, ("deg", "rad", "mm", "rad")),
        ({"units": "mm"}, (None,) * 3 + ("rad",)),
        ({"goal": {"units": "deg"}, "outcome": {"units": "deg"}}, (None,) * 3 + ("rad",)),
        ({"units": {"joint_positions": "deg"}}, ("deg", "deg", None, "rad")),
    ],
)
def test_comments_and_a_json_beside_say_the_units_that_heads_do_not(tmp_path, comment, units):
    first = comment if isinstance(comment, str) else "#"
    rows = "".join(f"{k / 50},{k},{k},{k},{k}\n" for k in range(5))
    (tmp_path / "throw_0.csv").write_text(f"{first}\nt,j1,j2,gripper,j3_rad\n{rows}")
    if not isinstance(comment, str):
        (tmp_path / "meta.json").write_text(json.dumps(comment))
    (read,) = read_recordings(tmp_path)
    assert (read.units, read.clock) == (units, "t in s")


@pytest.mark.parametrize("stem", ["actual_current", "tau_J", "actual_qd"])
def test_numbered_torques_that_are_named_as_the_motion_are_no_joints(tmp_path, stem):
    heads = ",".join(f"{of}_{i}" for of in (stem, "actual_q") for i in range(2))
    rows = "".join(f"{k / 50},{k},{k},{k / 99},{k / 99}\n" for k in range(50))
    (tmp_path / "a.csv").write_text(f"t,{heads}\n{rows}")
    with pytest.raises(FileFormatError, match=rf"{stem} looks like .*--key"):
        read_recordings(tmp_path / "a.csv", key=[stem], joints=["pan", "lift"])
    (read,) = read_recordings(tmp_path / "a.csv", key=["actual_q"], joints=["pan", "lift"])
    assert read.positions.max() < 1


@pytest.mark.parametrize("cell", ["{} rad", "{},5"])
def test_cells_of_numbers_in_other_forms_are_no_names_of_columns(tmp_path, cell):
    rows = "\n".join(f"{k / 50};{';'.join([cell.format(k)] * 2)};0.{k}" for k in range(5))
    (tmp_path / "a.csv").write_text(f"t;pan;lift;elbow\n{rows}\n")
    with pytest.raises(FileFormatError, match=r"pan holds .* and no numbers; write plain numbers"):
        read_recordings(tmp_path / "a.csv", joints=["pan", "lift", "elbow"])


def test_a_json_of_another_table_names_no_columns(tmp_path):
    np.savetxt(tmp_path / "throw_0.csv", sampled(0, 100)[1], delimiter=",")
    np.savetxt(tmp_path / "throw_1.csv", sampled(1, 100)[1], delimiter=",")
    (tmp_path / "throw_1.json").write_text(json.dumps({"columns": JOINTS[::-1]}))
    zero, one = read_recordings(tmp_path, rate=100, joints=JOINTS)
    assert (zero.named, one.named) == (False, True)


def test_a_head_that_comes_again_parts_throws_and_is_no_row(tmp_path):
    lines = []
    for i in range(3):
        t, q = sampled(i, 50)
        rows = ",".join(("t", *JOINTS)), *(",".join(map(repr, r)) for r in np.c_[t, q].tolist())
        lines += rows
    (tmp_path / "log.csv").write_text("\n".join(lines))
    read = read_recordings(tmp_path / "log.csv")
    assert [r.episode for r in read] == ["log-0", "log-1", "log-2"]
    np.testing.assert_allclose(read[1].positions, sampled(1, 50)[1])


def test_rows_without_an_episode_are_of_none(tmp_path):
    t, q = sampled(0, 50)
    lines = [",".join(("t", "episode", *JOINTS))]
    for k, name in enumerate(("0", "", "1")):
        lines += [
            f"{a + 10 * k},{name}," + ",".join(map(repr, r))
            for a, r in zip(t, q.tolist(), strict=True)
        ]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    read = read_recordings(tmp_path / "log.csv")
    assert [r.episode for r in read] == ["0", "1"]
    assert f"{len(t)} rows left out, which are of no episode" in read[0].remarks


def test_exponents_of_fortran_are_read(tmp_path):
    (tmp_path / "a.csv").write_text("t,j1\n0.0D+00,1.5D-01\n1.0D-02,-2.5d+00\n2.0D-02,1D1\n")
    (read,) = read_recordings(tmp_path / "a.csv")
    np.testing.assert_allclose(read.positions[:, 0], [0.15, -2.5, 10])


def test_a_date_beside_a_time_in_seconds_is_no_clock(tmp_path):
    t, q = sampled(0, 50)
    rows = [f"2024-03-09,{a}," + ",".join(map(repr, r)) for a, r in zip(t, q.tolist(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(("date", "t", *JOINTS)), *rows]))
    (read,) = read_recordings(tmp_path / "a.csv")
    np.testing.assert_allclose(read.times, t)


def test_a_rate_with_a_decimal_comma_in_a_comment_is_not_cut(tmp_path):
    _, q = sampled(0, 50)
    rows = [",".join(map(repr, r)) for r in q.tolist()]
    for said in ("# fps: 29,97", "# sample rate: 1,000 Hz"):
        (tmp_path / "a.csv").write_text("\n".join([said, ",".join(JOINTS), *rows]))
        with pytest.raises(FileFormatError, match="neither times nor a rate"):
            read_recordings(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("\n".join(["# fps: 40, joints: 7", ",".join(JOINTS), *rows]))
    (read,) = read_recordings(tmp_path / "a.csv")
    assert read.period == pytest.approx(1 / 40)


def test_what_ros2_topic_echo_writes_has_the_joints_that_its_cells_name(tmp_path):
    for frame in ("", "base_link"):
        rows = [
            f"1714557600,{k * 10_000_000},{frame},elbow,pan,{k / 10},{-k / 10},0.0,0.0,0.0,0.0"
            for k in range(6)
        ]
        (tmp_path / "a.csv").write_text("\n".join(rows))
        (read,) = read_recordings(tmp_path / "a.csv", joints=["pan", "elbow"])
        np.testing.assert_allclose(read.times, np.arange(6) * 0.01)
        by_name = dict(zip(read.names, read.positions.T, strict=True))
        np.testing.assert_allclose(by_name["elbow"], np.arange(6) / 10)
        np.testing.assert_allclose(by_name["pan"], -np.arange(6) / 10)


def test_names_of_several_levels_as_pandas_writes_them(tmp_path):
    t = np.arange(8) * 0.01
    columns = pd.MultiIndex.from_product([["pan", "lift"], ["position", "velocity"]])
    numbers = np.outer(np.arange(8), [1.0, 10.0, 2.0, 20.0])
    frame = pd.DataFrame(numbers, columns=columns, index=pd.Index(t, name="time"))
    frame.to_csv(tmp_path / "a.csv")
    (read,) = read_recordings(tmp_path / "a.csv", joints=["lift", "pan"])
    np.testing.assert_allclose(read.times, t)
    by_name = dict(zip(read.names, read.positions.T, strict=True))
    np.testing.assert_allclose(by_name["lift/position"], numbers[:, 2])


def test_rows_of_another_log_that_was_merged_are_left_out(tmp_path):
    lines = ["time,pan,lift,force"]
    for k in range(20):
        lines += [f"{k / 100},{k},{-k},", f"{k / 100 + 0.003},,,5.0"]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    (read,) = read_recordings(tmp_path / "a.csv", joints=["pan", "lift"])
    np.testing.assert_allclose(read.times, np.arange(20) / 100)
    assert "20 rows left out, in which no joint has a value" in read.remarks[0]
    # A recorder that loses the joints goes on writing the force.
    lines = ["time,pan,lift,force", *(f"{k / 100},{k},{-k},5.0" for k in range(20))]
    lines[5:12] = [f"{k / 100},,,5.0" for k in range(4, 11)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match="line 6: pan is ''"):
        read_recordings(tmp_path / "a.csv", joints=["pan", "lift"])


@pytest.mark.parametrize(
    ("head", "row", "says"),
    [
        ("time,joint,position", "{t},{name},{k}", "each row is of one joint, which joint names"),
        ("time,pan,lift", "{t},{k},False", "lift holds 'False' and no numbers"),
    ],
)
def test_joints_in_cells_and_switches_in_words_are_told_as_such(tmp_path, head, row, says):
    lines = [row.format(t=k // 2 / 10, k=k, name=("pan", "lift")[k % 2]) for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([head, *lines]))
    with pytest.raises(FileFormatError, match=says):
        read_recordings(tmp_path / "a.csv", joints=["pan", "lift"])


def test_words_beside_a_gripper_of_numbers_are_left_out(tmp_path):
    lines = ["time,pan,gripper_pos,gripper_closed"]
    lines += [f"{k / 10},{k},{k / 10},{k > 4}" for k in range(10)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    (read,) = read_recordings(tmp_path / "a.csv", joints=["pan", "gripper"])
    assert "gripper_pos" in read.names


def test_columns_without_names_are_numbered_as_in_the_file(tmp_path):
    rows = [f"{k / 10},,{k},{-k}" for k in range(6)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    (read,) = read_recordings(tmp_path / "a.csv", time_column="1")
    assert (read.names, read.named) == (("column3", "column4"), False)


def test_hidden_files_beside_recordings_are_none(tmp_path):
    write_csv(tmp_path)
    (tmp_path / "._0.csv").write_bytes(b"\0\5\26\7")
    assert len(read_recordings(tmp_path)) == N


def test_a_first_frame_without_a_number_is_no_line_of_names(tmp_path):
    rows = [f"2026-05-03T14:02:03.{k:02d}0,{k if k else 'nan'},{k}" for k in range(9)]
    rows[0] = rows[0].replace(",0", ",NaN")
    (tmp_path / "a.csv").write_text("\n".join(["time,pan,lift", *rows]))
    (read,) = read_recordings(tmp_path / "a.csv")
    assert (read.names, len(read.times)) == (("pan", "lift"), 9)


@pytest.mark.parametrize(
    ("head", "column"),
    [("t,pan,lift", False), ("# t,pan,lift", False), ("0,1,2", False), ("t,pan,lift", True)],
)
def test_a_head_that_comes_again_within_a_motion_is_refused(tmp_path, head, column):
    rows = [f"{k / 10},{5 + k / 4},{-k / 2}" for k in range(9)]
    lines = [head, *rows[:3], head, *rows]
    if column:
        lines = [f"{line},{'trial' if line == head else 7}" for line in lines]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(FileFormatError, match=r"a\.csv, line 5: the head comes again: two logs"):
        read_recordings(tmp_path / "a.csv", time_column="1")
    if column:  # where the episode changes, it does no harm
        (tmp_path / "a.csv").write_text("\n".join(lines).replace(",7", ",6", 3))
        assert len(read_recordings(tmp_path / "a.csv", time_column="1")) == 2


def test_a_head_that_comes_again_while_times_go_on_is_left_out(tmp_path):
    rows = [f"{k / 10},{k / 4},{-k / 2}" for k in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["t,pan,lift", *rows[:4], "t,pan,lift", *rows[4:]]))
    (read,) = read_recordings(tmp_path / "a.csv")
    assert (len(read.times), read.period) == (9, pytest.approx(0.1))


@pytest.mark.parametrize("index", [False, True])
def test_columns_that_pandas_numbers_are_called_by_their_places(tmp_path, index):
    t, q = sampled(0, 50)
    pd.DataFrame(np.column_stack([t, q])).to_csv(tmp_path / "a.csv", index=index)
    with pytest.raises(UnclearUnitsError, match="looks like the time") as caught:
        read_recordings(tmp_path)
    assert caught.value.options == f"--time-column {1 + index}"
    (read,) = read_recordings(tmp_path, time_column=str(1 + index))
    assert (read.names, read.named) == (tuple(f"column{i + index}" for i in range(2, 9)), False)
    np.testing.assert_allclose(read.times, t)
    np.testing.assert_allclose(read.positions, q)
    pd.DataFrame(q, index=np.arange(len(q)) + 40).to_csv(tmp_path / "a.csv")  # rows cut out
    (read,) = read_recordings(tmp_path, rate=50)
    np.testing.assert_allclose(read.positions, q)
    pd.DataFrame(q, index=pd.Index(t, name="t")).to_csv(tmp_path / "a.csv")
    (read,) = read_recordings(tmp_path)
    assert (read.clock, read.named) == ("t in s", False)


def test_an_episode_column_counts_beside_columns_that_pandas_numbered(tmp_path):
    q = np.sin(np.arange(60)[:, None] / [9, 8, 7])
    frame = pd.DataFrame(q)
    frame.insert(0, "episode", np.repeat([3, 4], 30))
    frame.to_csv(tmp_path / "a.csv", index=False)
    read = read_recordings(tmp_path / "a.csv", rate=50)
    assert [(one.episode, one.positions.shape) for one in read] == [("3", (30, 3)), ("4", (30, 3))]


def test_axes_that_are_not_there_are_left_out(tmp_path):
    t, q = sampled(0, 50)
    frame = pd.DataFrame(q, columns=JOINTS).assign(t=t, eax_a=9e9, eax_b=9e9)
    frame.to_csv(tmp_path / "0.csv", index=False)
    (recording,) = read_recordings(tmp_path)
    assert recording.names == JOINTS
    assert recording.remarks[0].startswith("eax_a, eax_b left out, which is 9E+09 all along")


@pytest.mark.parametrize("joints", [None, JOINTS])
def test_numbers_in_another_form_in_every_row_are_told_as_such(tmp_path, joints):
    t, q = sampled(0, 50)
    frame = pd.DataFrame(q, columns=JOINTS).assign(t=t)
    frame[JOINTS[1]] = [f"({abs(x):.6f})" for x in q[:, 1]]
    frame.loc[3, JOINTS[1]] = "0.2" if joints is None else "(0.2)"
    frame.to_csv(tmp_path / "0.csv", index=False)
    with pytest.raises(FileFormatError, match=r"\(0\.\d+\)'.* plain numbers, -0\.6 for \(0\.6\)"):
        read_recordings(tmp_path, joints=joints)


def test_lists_in_braces_are_read(tmp_path):
    t, q = sampled(0, 50)
    cells = ["{" + ", ".join(f"{x:.6f}" for x in row) + "}" for row in q]
    pd.DataFrame({"t": t, "QActual": cells}).to_csv(tmp_path / "0.csv", index=False)
    (recording,) = read_recordings(tmp_path)
    np.testing.assert_allclose(recording.positions, q, atol=1e-6)


@pytest.mark.parametrize(
    "other",
    ["u,v,x\n1,2,3\n2,3,4", "k,fx\n1,2", "t,u,v\n0,1,2\n0.01,2,3", "joint,q\njoint1,\njoint2,"],
)
def test_a_file_that_is_no_recording_is_refused_with_what_leaves_it_out(tmp_path, other):
    write_outcomes(write_csv(tmp_path))
    (tmp_path / "calibration.csv").write_text(other)
    with pytest.raises((FileFormatError, InvalidDemonstrationsError)) as refused:
        import_demonstrations(tmp_path, joints=JOINTS)
    assert "--leave-out calibration" in str(refused.value)
    kept = import_demonstrations(tmp_path, joints=JOINTS, leave_out=["calibration"])
    assert kept.demonstrations.n == N


def test_what_is_wrong_in_every_file_leaves_none_out(tmp_path):
    for i in range(2):
        rows = [f"{k / 10},{k / 20},{k / 30}" for k in range(20)]
        (tmp_path / f"throw_{i}.csv").write_text("\n".join(["t,left_elbow,right_elbow", *rows]))
    with pytest.raises(InvalidDemonstrationsError, match=r"--joints$"):
        read_recordings(tmp_path, joints=["elbow"])
    (tmp_path / "throw_1.csv").write_text("\n".join(["t,elbow,wrist", *rows]))
    with pytest.raises(InvalidDemonstrationsError, match=r"--leave-out throw_0$"):
        read_recordings(tmp_path, joints=["elbow"])


def test_rows_of_no_episode_do_not_make_its_neighbours_a_session(tmp_path):
    rows = [
        f"{k / 10},{n if k >= 10 else ''},{1 + n / 10},{np.sin(k / 4 + n)}"
        for n in (1, 2, 3)
        for k in range(30)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,episode,target_x,joint1", *rows]))
    assert [len(each.positions) for each in read_recordings(path, joints=["joint1"])] == [20] * 3


def test_numbers_of_episodes_that_begin_anew_with_a_session_are_refused(tmp_path):
    rows = [
        f"{k / 10},{s},{n},{np.sin(k / 4 + n)}" for s in (1, 2) for n in (1, 2) for k in range(20)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,session,trial,joint1", *rows]))
    with pytest.raises(FileFormatError, match=r"trial counts anew with session.*--episode-column"):
        read_recordings(path)


@pytest.mark.parametrize("flags", [(0, 1), (False, True)])
def test_frames_that_a_column_calls_invalid_are_lost(tmp_path, flags):
    times, q = sampled(0, 50)
    flag = [flags[i not in (20, 21)] for i in range(len(q))]
    frames = pd.DataFrame(np.column_stack([times, q]), columns=["t", *JOINTS]).assign(valid=flag)
    frames.to_csv(tmp_path / "0.csv", index=False)
    (found,) = read_recordings(tmp_path)
    assert found.names == tuple(JOINTS)
    assert np.flatnonzero(np.isnan(found.positions).all(axis=1)).tolist() == [20, 21]
    assert any("valid" in remark for remark in found.remarks)


@pytest.mark.parametrize("by", ["column", "comment", "json"])
def test_a_recording_that_is_flagged_as_failed_is_said(tmp_path, by):
    t, q = sampled(0, 50)
    for i, failed in enumerate((False, True)):
        frames = pd.DataFrame(np.column_stack([t, q]), columns=["t", *JOINTS])
        frames = frames.assign(success=not failed) if by == "column" else frames
        head = f"# success: {not failed}\n" if by == "comment" else ""
        (tmp_path / f"{i}.csv").write_text(head + frames.to_csv(index=False))
        if by == "json":
            (tmp_path / f"{i}.json").write_text(json.dumps({"outcome": {"success": not failed}}))
    good, bad = read_recordings(tmp_path)
    assert good.names == bad.names == JOINTS
    told = [any("--leave-out" in r and "calls it" in r for r in one.remarks) for one in (good, bad)]
    assert told == [False, True]


@pytest.mark.parametrize("of_one_table", [True, False])
def test_a_json_of_all_recordings_flags_each_by_its_name(tmp_path, of_one_table):
    t, q = sampled(0, 50)
    frames = pd.DataFrame(np.column_stack([t, q]), columns=["t", *JOINTS])
    throws = {f"throw_{i}": frames for i in range(3)}
    if of_one_table:
        table = pd.concat([own.assign(episode=name) for name, own in throws.items()])
        throws = {"throws": table}
    for name, own in throws.items():
        own.to_csv(tmp_path / f"{name}.csv", index=False)
    said = {"throw_0": {"success": True}, "throw_2": {"outcome": {"success": False}}}
    (tmp_path / "throws.json").write_text(json.dumps(said))
    read = read_recordings(tmp_path)
    assert [one.episode[-1] for one in read] == ["0", "1", "2"]
    assert [any("--leave-out" in r for r in one.remarks) for one in read] == [False, False, True]


@pytest.mark.parametrize(
    ("name", "said", "unit"),
    [
        ("intrinsics", {"angle_unit": "deg"}, None),
        ("camera_info", {"rotation": {"units": "deg"}}, None),
        ("config", {"units": "deg", "labels": ["a", "b"]}, None),
        ("config", {"units": "deg", "names": ["j1", "j2"]}, "deg"),
        ("config", {"units": {"j1": "deg", "j2": "deg"}}, "deg"),
        ("recording_info", {"units": "deg"}, "deg"),
        ("robot", {"units": "deg"}, "deg"),
        ("setup", {"joint_units": "deg"}, "deg"),
        ("recording_info", {"limits": {"units": "deg"}}, None),
    ],
)
def test_a_json_alone_counts_where_it_is_of_the_recordings(tmp_path, name, said, unit):
    rows = "".join(f"{k / 50},{k / 9},{k / 8}\n" for k in range(5))
    (tmp_path / "throw_0.csv").write_text(f"t,j1,j2\n{rows}")
    (tmp_path / f"{name}.json").write_text(json.dumps(said))
    (read,) = read_recordings(tmp_path)
    assert read.units == (unit, unit)


def test_a_json_of_something_else_names_no_columns(tmp_path):
    np.savetxt(tmp_path / "throw_0.csv", sampled(0, 100)[1], delimiter=",")
    (tmp_path / "panel.json").write_text(json.dumps({"column_labels": list("abcdefg")}))
    (read,) = read_recordings(tmp_path, rate=100)
    assert not read.named


@pytest.mark.parametrize(
    ("name", "said"),
    [("config", {"robot": {"joint_names": JOINTS}}), ("schema", {"columns": JOINTS})],
)
def test_a_json_alone_that_names_joints_names_the_columns(tmp_path, name, said):
    np.savetxt(tmp_path / "throw_0.csv", sampled(0, 100)[1], delimiter=",")
    (tmp_path / f"{name}.json").write_text(json.dumps(said))
    (read,) = read_recordings(tmp_path, rate=100)
    assert read.names == JOINTS


def test_an_offset_and_the_rate_of_a_control_are_no_channels(tmp_path):
    t, q = sampled(0, 50)
    others = ["q_offset_1", "control_rate", "control_command_success_rate"]
    table = np.column_stack([t, q, 0.1 * q[:, 1], 1000 + q[:, 1], 1 - 0.1 * q[:, 1] ** 2])
    head = ",".join(["t", *JOINTS, *others])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="")
    (read,) = read_recordings(tmp_path)
    assert read.names == JOINTS
    assert any(all(name in remark for name in others) for remark in read.remarks)
    (named,) = read_recordings(tmp_path, joints=("joint1", "control_rate"))
    assert named.names == ("joint1", "control_rate")


def test_a_key_is_the_name_before_the_number_and_the_unit(tmp_path):
    t, q = sampled(0, 50)
    names = [f"{of}_revolute_{i}_deg" for i in range(q.shape[1]) for of in ("cmd", "pos")]
    table = np.column_stack([t, np.repeat(q, 2, axis=1)])
    table[:, 1::2] += 0.1
    head = ",".join(["t", *names])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=head, comments="")
    (read,) = read_recordings(tmp_path, key=("pos_revolute",))
    np.testing.assert_allclose(read.positions, q)
    assert {*read.units} == {"deg"}


def test_several_numbers_in_a_cell_are_told_as_such(tmp_path):
    rows = [f'{k / 50},"{k},{k**2},0.5",{k % 3},open' for k in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["t,joint_positions,grip,state", *rows]))
    (read,) = read_recordings(tmp_path)
    assert any("joint_positions" in remark and "brackets" in remark for remark in read.remarks)
    bracketed = (tmp_path / "a.csv").read_text().replace(',"', ',"[').replace('",', ']",')
    (tmp_path / "a.csv").write_text(bracketed)
    assert len(read_recordings(tmp_path)[0].names) == 4
