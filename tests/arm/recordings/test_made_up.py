"""A hundred recordings made up by seeds, ten of each kind: read rightly, or asked about.

What is right is known before anything is wrapped, renamed or written; nothing of the readers is
used to tell it. A question is right if following its options gives the right numbers.
"""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from prior_reinforce.arm.recordings import (
    import_demonstrations,
    inspect_recordings,
    read_recordings,
)
from prior_reinforce.arm.recordings.naming import find_channels
from prior_reinforce.arm.recordings.outcome_units import in_units
from prior_reinforce.arm.recordings.outcomes import read_outcomes
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import FileFormatError, UnclearUnitsError
from tests.arm.recordings.recorded import lerobot_set

TURN, RATE, N = 2 * np.pi, 50, 5
UR = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip
HOME = np.array([0.1, -1.5, 1.4, 0.2, 0.1, -0.4])
OUTCOMES = {f"t{i}": (0.8 + 0.05 * i, 0.1 * (-1) ** i + 0.013 * i) for i in range(N)}


def course(frames=60):
    """A minimum-jerk course from 0 to 1, at rest before and after."""
    s = np.clip((np.arange(frames) - 10) / 35, 0, 1)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


def swing(i, joints=6):
    return HOME[:joints] + course()[:, None] * np.linspace(0.3, 0.9, 6)[:joints] * (1 + 0.05 * i)


def dump(path, names, columns):
    cells = [[f"{v:.9f}" if isinstance(v, float) else str(v) for v in row] for row in columns]
    path.write_text("\n".join(",".join(row) for row in [names, *cells]) + "\n", encoding="utf-8")


def times():
    return np.arange(len(course())) / RATE


def imported(folder, **how):
    """What becomes of it; where something is asked, of following the answer that is offered.

    What it cannot tell, a number of 250 of a gripper, counts.
    """
    try:
        return import_demonstrations(folder, outcomes=OUTCOMES, **how)
    except UnclearUnitsError as asked:
        units = asked.options.removeprefix("--units ").replace("UNIT", "counts").split()
        return import_demonstrations(folder, outcomes=OUTCOMES, units=units, **how)


def angles_a_turn_away(rng, folder):
    robot, unit = rng.random() < 0.4, str(rng.choice(["rad", "deg"]))
    other = str(rng.choice(["yaw", "base", "heading", "j7", "wrist"]))
    names = [*UR] if robot else [*UR[:3], other]
    start, way, apart = rng.uniform(-3, 3), rng.choice([-2.5, -0.8, 0.5, 2.0]), rng.uniform(0, 0.2)
    true = []
    for i in range(N):
        q = swing(i, len(names))
        q[:, -1] = start + apart * rng.uniform(-1, 1) + way * course() * (1 + 0.04 * i)
        true.append(q[:, -1].copy())
        wrapped = (np.mod(q[:, -1] + np.pi, TURN) - np.pi, np.mod(q[:, -1], TURN), q[:, -1])
        q[:, -1] = wrapped[rng.integers(3)]
        q = q if unit == "rad" else np.rad2deg(q)
        heads = [f"{name} [{unit}]" for name in names]
        dump(folder / f"t{i}.csv", ["t", *heads], np.column_stack([times(), q]))
    how = {"joints": names, "robot": robot_limits("ur5e")} if robot else {}
    plans = import_demonstrations(folder, outcomes=OUTCOMES, **how).demonstrations.plans
    ends = [[t[0], t[-1]] for t in true]
    turns = (plans[:, [0, -1], -1] - ends) / TURN
    np.testing.assert_allclose(turns, np.round(turns[0, 0]), atol=1e-6)


def attitudes_of_either_form(rng, folder):
    form = str(rng.choice(["xyzw", "wxyz", "rotvec"]))
    names = {
        "xyzw": ["qx", "qy", "qz", "qw"],
        "wxyz": [f"pose.orientation.{c}" for c in "wxyz"],
        "rotvec": ["rx", "ry", "rz"],
    }[form]
    axis, start, way = rng.normal(size=3), rng.uniform(0, TURN), rng.uniform(0.2, 1.5)
    axis /= np.linalg.norm(axis)
    true = []
    for i in range(N):
        angle = start + way * course() * (1 + 0.05 * i) + 0.03 * rng.uniform(-1, 1)
        true.append(Rotation.from_rotvec(angle[:, None] * axis))
        if form == "rotvec":
            numbers = true[i].as_rotvec()
        else:
            numbers = true[i].as_quat()
            signs = (rng.choice([-1, 1], (60, 1)), rng.choice([-1, 1]), np.sign(numbers[:, 3:]))
            numbers = numbers * signs[rng.integers(3)]
            numbers = numbers if form == "xyzw" else numbers[:, [3, 0, 1, 2]]
        place = np.outer(course(), [1 + 0.1 * i, 0.2, 0.1 * i])
        heads = ["t", "x [m]", "y [m]", "z [m]", *names]
        dump(folder / f"t{i}.csv", heads, np.column_stack([times(), place, numbers]))
    plans = import_demonstrations(folder, outcomes=OUTCOMES).demonstrations.plans[:, :, 3:]
    for plan, turned in zip(np.array(plans), true, strict=True):
        plan = plan if form != "wxyz" else plan[:, [1, 2, 3, 0]]
        read = Rotation.from_rotvec(plan) if form == "rotvec" else Rotation.from_quat(plan)
        for end in (0, -1):
            assert (read[end] * turned[end].inv()).magnitude() < 0.02
    assert np.abs(np.diff(plans, axis=1)).max() < 0.25
    assert np.abs(plans[:, 0] - plans[0, 0]).max() < 0.3


def a_gripper_beside_joints(rng, folder):
    degrees, at = rng.random() < 0.5, int(rng.integers(0, 7))
    name = str(rng.choice(["gripper", "jaw", "left_finger", "Greifer", "robotiq_85", "claw.pos"]))
    low, high = ((10, 90), (2, 78), (0.001, 0.04), (0.1, 0.95), (3, 250))[rng.integers(5)]
    names = [f"{n} [deg]" if degrees and at % 2 else n for n in UR]
    names.insert(at, name)
    for i in range(N):
        q = np.rad2deg(swing(i)) if degrees else swing(i)
        rows = np.insert(q, at, low + (high - low) * course(), axis=1)
        dump(folder / f"t{i}.csv", ["t", *names], np.column_stack([times(), rows]))
    plans = imported(folder).demonstrations.plans
    np.testing.assert_allclose(np.delete(plans[0, 0], at), HOME, atol=1e-6)
    np.testing.assert_allclose(plans[0, [0, -1], at], [low, high], rtol=1e-6)


def times_by_any_name(rng, folder):
    name, scale = (
        ("timestamp_ns", 1e9), ("Zeit [ms]", 1e3), ("t_us", 1e6), ("recv_time", 1), ("ts", 1),
        ("Time (sec)", 1), ("ms", 1e3), ("时间戳", 1e3), ("header.stamp", 1e9), ("tick", 1e3),
        ("время", 1), ("Zeitstempel", 1), ("millis", 1e3), ("date", 0),
    )[rng.integers(14)]  # fmt: skip
    base, t = float(rng.choice([0, 12.5, 1.76e9])), times()
    if scale:
        cells = [f"{x * scale + base * scale:.6f}" for x in t]
    else:
        cells = [str(np.datetime64(1_760_000_000_000_000_000 + round(x * 1e9), "ns")) for x in t]
    dump(
        folder / "t0.csv",
        [name, *UR],
        [[c, *map(float, r)] for c, r in zip(cells, swing(0), strict=True)],
    )
    how = {"joints": UR} if rng.random() < 0.5 else {}
    try:
        (recording,) = read_recordings(folder, **how)
    except UnclearUnitsError as asked:
        words = asked.options.replace("'", "").split()
        how |= {w[2:].replace("-", "_"): v for w, v in zip(words[::2], words[1::2], strict=True)}
        (recording,) = read_recordings(folder, **how)
    np.testing.assert_allclose(recording.times, t, atol=1e-3)
    assert recording.names == UR


def clocks_that_agree_or_not(rng, folder):
    pair = (("t", "wall_time"), ("timestamp", "recv_time"), ("t", "host_ts"))[rng.integers(3)]
    t, says = times(), str(rng.choice(["same", "ms", "drift", "step", "rate"]))
    other = {
        "same": t + 5,
        "ms": 1000 * t,
        "drift": t * rng.uniform(1.1, 1.6),
        "step": t + (np.arange(len(t)) > rng.integers(20, 50)) * rng.uniform(0.3, 0.8),
        "rate": t * 0.8,
    }[says]
    dump(folder / "t0.csv", [*pair, *UR], np.column_stack([t, other, swing(0)]))
    if says in ("same", "ms"):
        (recording,) = read_recordings(folder)
        np.testing.assert_allclose(recording.times, t, atol=1e-6)
        return
    with pytest.raises(FileFormatError, match=f"--time-column {pair[0]}"):
        read_recordings(folder)
    (recording,) = read_recordings(folder, time_column=pair[1])
    np.testing.assert_allclose(recording.times, other - other[0], atol=1e-6)


def names_in_every_form(rng, folder):
    wanted = (
        ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"],
        ["waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate", "gripper"],
        [*UR],
    )[rng.integers(3)]
    order = rng.permutation(wanted).tolist()
    ending, before = rng.choice(["", ".pos", "_position"]), rng.choice(["", "main_", "left/"])
    said, cut = [f"{before}{name}{ending}" for name in order], int(rng.integers(1, len(order) - 1))
    index = {name: i for i, name in enumerate(said)}
    form = (
        said, index, dict(reversed(index.items())), {str(i): name for name, i in index.items()},
        {"arm": said[:cut], "hand": said[cut:]}, {"motors": {"a": said[:cut], "b": said[cut:]}},
        [said[:cut], said[cut:]], {"motors": said},
    )[rng.integers(8)]  # fmt: skip
    start = rng.uniform(-1, 1, len(order))
    folder = lerobot_set(folder / "set", 30, [start + course()[:, None]], form)
    (recording,) = read_recordings(folder, joints=wanted)
    columns = find_channels(wanted, recording.names)
    expected = start[[order.index(name) for name in wanted]]
    np.testing.assert_allclose(recording.positions[0, columns], expected, atol=1e-6)


def motion_beside_the_motion(rng, folder):
    name = str(rng.choice(["gripper", "hand", "finger_q", "width", "torso", "aux"]))
    columns = int(rng.integers(1, 3))
    beside = np.outer(course(), np.full(columns, rng.uniform(3, 80)))
    form = str(rng.choice(["npz", "csv", "lerobot"]))
    if form == "npz":
        source = folder / "t0.npz"
        beside = beside[:, 0] if columns == 1 else beside
        np.savez(source, q=swing(0), t=times(), joint_names=UR, **{name: beside}, dq=swing(0))
    elif form == "csv":
        source, heads = folder / "t0.csv", [name] if columns == 1 else [f"{name}_l", f"{name}_r"]
        dump(source, ["t", *UR, *heads], np.column_stack([times(), swing(0), beside]))
    else:
        source, kind = lerobot_set(folder / "set", 50, [swing(0)], UR), str(rng.choice(["f", "u"]))
        beside = beside.astype({"f": np.float32, "u": np.uint8}[kind])
        (path,) = (source / "data").glob("**/*.parquet")
        pq.write_table(pq.read_table(path).append_column(name, pa.array(beside.tolist())), path)
        info = json.loads((source / "meta" / "info.json").read_text())
        info["features"][name] = {"dtype": str(beside.dtype), "shape": [columns], "names": None}
        (source / "meta" / "info.json").write_text(json.dumps(info))
    said = " ".join(inspect_recordings(source, joints=UR).remarks)
    assert f"left out although it moves: {name}" in said


def one_file_of_all_throws(rng, folder):
    head, form = "trial", str(rng.choice(["known", "other", "anew", "both", "rests"]))
    parts = [swing(i) for i in range(N)]
    if form == "rests":
        parts = [(q, q[-1] + (q[0] - q[-1]) * course()[:, None]) for q in parts]
        parts = [part for pair in parts for part in pair]
    t = np.concatenate(
        [times() + i * 1.2 * (form not in ("anew", "both")) for i in range(len(parts))]
    )
    rows, heads = np.column_stack([t, np.concatenate(parts)]).tolist(), ["t", *UR]
    if form in ("known", "other", "both"):
        head = "trial" if form == "known" else str(rng.choice(["nr", "Lauf", "rollout"]))
        rows, heads = [[*r, i // 60] for i, r in enumerate(rows)], [*heads, head]
    dump(folder / "log.csv", heads, rows)
    outcomes = {str(i): place for i, place in enumerate(OUTCOMES.values())}
    how, option = {}, {"other": f"--episode-column {head}", "rests": "--rests 0.5"}.get(form, "")
    if form == "rests":
        outcomes = {f"log-{2 * i}": place for i, place in enumerate(OUTCOMES.values())}
    if option:
        with pytest.raises(UnclearUnitsError) as asked:
            import_demonstrations(folder / "log.csv", outcomes=outcomes)
        assert asked.value.options == option
        how = {"other": {"episode_column": head}, "rests": {"rests": 0.5}}[form]
    if form == "rests":
        how["leave_out"] = [f"log-{2 * i + 1}" for i in range(N)]
    demos = import_demonstrations(folder / "log.csv", outcomes=outcomes, **how).demonstrations
    np.testing.assert_allclose(demos.plans[:, -1], [swing(i)[-1] for i in range(N)], atol=1e-3)
    np.testing.assert_allclose(demos.outcomes_seen, list(OUTCOMES.values()))


def tables_of_any_dialect(rng, folder):
    pairs = ((",", "."), (";", ","), (";", "."), ("\t", "."), ("\t", ","), ("|", "."), (" ", "."))
    between, decimal = pairs[rng.integers(7)]
    code = str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    unit, scale = (("m", 1), ("cm", 100), ("mm", 1000))[rng.integers(3)]
    places = np.round(rng.uniform([0.6, -0.4], [1.6, 0.4], (N, 2)) * scale, 3 - (unit != "m"))
    quote, ending = str(rng.choice(["", '"'])), str(rng.choice(["\n", "\r\n"]))
    lines = [
        f"{rng.choice(['episode', 'Trial', 'Wurf', 'Aufnahme'])}{between}x_{unit}{between}y_{unit}"
    ]
    for i in rng.permutation(N):
        cells = [f"{quote}{v:.3f}{quote}".replace(".", decimal) for v in places[i]]
        lines.append(between.join([f"t{i}", *cells]))
    lines += [between * 2] * int(rng.integers(2))
    (folder / "outcomes.csv").write_bytes((ending.join(lines) + ending).encode(code))
    outcomes, asked = in_units(read_outcomes(folder / "outcomes.csv"), None, None)
    assert not asked
    read = dict(zip(outcomes.episodes, outcomes.values, strict=True))
    np.testing.assert_allclose([read[f"t{i}"] for i in range(N)], places / scale, rtol=1e-9)


def outcomes_with_a_slip(rng, folder):
    n, slip = int(rng.integers(7, 11)), str(rng.choice(["none", "none", "ten", "sign", "shift"]))
    aims = rng.uniform(-1, 1, (n, 2))
    outcomes = np.array([0.9, 0.05]) + aims * [0.2, 0.15] + 0.01 * aims**2
    for i, (a, b) in enumerate(aims):
        q = np.outer(course(), [1 + 0.3 * a, 0.5 + 0.3 * b, 0.2 + 0.05 * a * b])
        np.savez(folder / f"t{i}.npz", t=times(), q=q)
    row = int(np.argmax(np.abs(outcomes[:, 1]))) if slip == "sign" else int(rng.integers(n))
    if slip == "shift":
        outcomes = np.roll(outcomes, 1, axis=0)
    outcomes[row] *= {"ten": [10, 1], "sign": [1, -1]}.get(slip, [1, 1])
    rows = {f"t{i}": place.tolist() for i, place in enumerate(outcomes)}
    result = import_demonstrations(folder, outcomes=rows, outcome_units=["m", "m"])
    said = " ".join(remark for remark in result.preview.remarks if "put right" in remark)
    expected = {
        "none": "",
        "shift": "one row too",
        "ten": f"x of t{row}, ",
        "sign": f"y of t{row}, ",
    }
    assert expected[slip] in said
    assert bool(said) == (slip != "none")


KINDS = (
    angles_a_turn_away, attitudes_of_either_form, a_gripper_beside_joints, times_by_any_name,
    clocks_that_agree_or_not, names_in_every_form, motion_beside_the_motion,
    one_file_of_all_throws, tables_of_any_dialect, outcomes_with_a_slip,
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:an outcome of")
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", KINDS)
def test_ten_of_a_kind(tmp_path, kind, seed):
    kind(np.random.default_rng(seed), tmp_path)
