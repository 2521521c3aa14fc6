"""Fifteen folders as labs have them, each from recordings to a plan that passes the gate.

Their files are written by the libraries that write them in labs, or as those were seen to write
them (lerobot, libfranka, robomimic). All have an encoder's noise and joints that are held.
At most one correction is needed, and the message before names it. The generator is what `learn`
chooses.
"""

import csv
import shlex

import h5py
import numpy as np
import pandas as pd
import pytest
import zarr
from mcap_ros2.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore

from prior_reinforce.arm.workspace.workspace import Workspace
from tests.arm.recordings.recorded import JOINTS, lerobot_set
from tests.arm.robots.arms import UR, ur5e, write_urdf

N = 6
NOISE = 2e-5
HOME = {
    7: np.array([0.0, -0.4, 0.1, -2.0, 0.0, 1.8, 0.8]),
    6: np.array([0.1, -1.9, 1.6, -1.2, -1.57, 0.3]),
}
SWING = {
    7: np.array([0.0, 0.35, 0.0, 0.7, 0.0, 0.8, 0.0]),
    6: np.array([0.0, 0.5, -0.6, 0.4, 0.0, 0.0]),
}


def throw(i, rate, joints=7):
    """Times and positions of a throw between rests, with the noise of an encoder."""
    t = np.arange(round(1.7 * rate) + 1) / rate
    s = np.clip((t - 0.3) / (1 + 0.05 * (i % 3)), 0, 1)[:, None]
    swing = SWING[joints] * (1 + 0.05 * i) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    # The last joints are turned a little by hand between throws, and held.
    swing[:, 0] += 0.02 * (-1) ** i
    return t, HOME[joints] + swing + np.random.default_rng(i).normal(0, NOISE, swing.shape)


def landed(i):
    return 0.8 + 0.04 * i, 0.1 * (-1) ** i + 0.01 * i


def outcomes(folder, scale=1.0, head="episode,x,y", name="{}"):
    rows = [f"{name.format(i)},{scale * x},{scale * y}" for i in range(N) for x, y in [landed(i)]]
    (folder / "outcomes.csv").write_text("\n".join([head, *rows]))


def libfranka(folder):
    """`franka::logToCSV` of 0.9.2: milliseconds since the robot started, six digits, 87 columns."""
    state = ("q", "q_d", "dq", "dq_d", "tau_J", "tau_ext_hat_filtered")
    command = {"q_d": 7, "dq_d": 7, "O_T_EE_d": 16, "O_dP_EE_d": 6, "tau_J_d": 7}
    names = [f"state.{vector}[{j}]" for vector in state for j in range(7)]
    names += [f"cmd.{vector}[{j}]" for vector, size in command.items() for j in range(size)]
    for i in range(N):
        _, q = throw(i, 1000)
        rows = np.column_stack([q, q, np.zeros((len(q), 28)), q, np.zeros((len(q), 36))])
        frame = pd.DataFrame(rows, columns=names)
        frame.insert(0, "success_rate", 1)
        frame.insert(0, "time", 123456789 + np.arange(len(q)))
        frame.to_csv(folder / f"log_{i}.csv", index=False, float_format="%.6g")
    outcomes(folder)


def rtde(folder):
    """UR's RTDE client: blanks between the cells, seconds since the controller started."""
    for i in range(N):
        t, q = throw(i, 500, 6)
        names = ["timestamp", *(f"{kind}_q_{j}" for kind in ("target", "actual") for j in range(6))]
        with (folder / f"{i}.csv").open("w") as file:
            writer = csv.writer(file, delimiter=" ")
            writer.writerow(names)
            writer.writerows(np.column_stack([t + 8123.4, q, q]).tolist())
    outcomes(folder)


def npz(folder):
    """numpy, in degrees, the time in milliseconds by its name."""
    for i in range(N):
        t, q = throw(i, 250)
        names = [f"panda_{name}" for name in JOINTS]
        np.savez(folder / f"{i}.npz", t_ms=1000 * t, q=np.rad2deg(q), joint_names=names)
    outcomes(folder)


def npy(folder):
    """numpy, the motions alone."""
    np.save(folder / "all.npy", [throw(i, 100)[1] for i in range(N)])
    outcomes(folder)


def european(folder):
    """pandas for a European Excel: semicolons, decimal commas, milliseconds in the name."""
    for i in range(N):
        t, q = throw(i, 200)
        frame = pd.DataFrame(q, columns=[f"panda_{name}" for name in JOINTS])
        frame.insert(0, "timestamp_ms", 1000 * t)
        frame.to_csv(folder / f"throw_{i}.csv", sep=";", decimal=",")
    outcomes(folder, 100, "episode,x [cm],y [cm]", "throw_{}")


def unlabelled(folder):
    """numpy, without a line of names, in milliseconds and degrees."""
    for i in range(N):
        t, q = throw(i, 100)
        np.savetxt(folder / f"{i}.csv", np.column_stack([1000 * t, np.rad2deg(q)]), delimiter=",")
    outcomes(folder)


def one_file(folder):
    """All throws in one file, with dates, a phase in words, and every tenth frame twice."""
    parts = []
    for i in range(N):
        t, q = throw(i, 100)
        frame = pd.DataFrame(q, columns=JOINTS)
        start = pd.Timestamp("2026-11-21T10:00") + pd.Timedelta(minutes=i)
        frame.insert(0, "timestamp", (start + pd.to_timedelta(t, unit="s")).astype(str))
        frame.insert(0, "throw_id", i + 1)
        frame["phase"] = "swing"
        parts.append(pd.concat([frame, frame.iloc[::10]]).sort_index())
    pd.concat(parts).to_csv(folder / "session.csv", index=False)
    rows = [f"{i + 1},{x},{y}" for i in range(N) for x, y in [landed(i)]]
    (folder / "outcomes.csv").write_text("\n".join(["throw_id,x,y", *rows]))


def lerobot(folder):
    """LeRobot v3 in degrees, with a gripper, as its drivers record them."""
    names = [f"{name}.pos" for name in (*JOINTS, "gripper")]
    motions = [np.rad2deg(throw(i, 50)[1]) for i in range(N)]
    motions = [np.column_stack([q, np.full(len(q), 30.0)]) for q in motions]
    lerobot_set(folder / "hoop", 50, motions, names)
    outcomes(folder)


def robomimic(folder):
    """robomimic's `dataset_states_to_obs`, where robosuite's collection kept the control rate."""
    with h5py.File(folder / "demos.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = '{"env_kwargs": {"control_freq": 50}}'
        for i in range(N):
            q = throw(i, 50)[1]
            demo = file.create_group(f"data/demo_{i + 1}")
            demo.attrs["num_samples"] = len(q)
            demo["actions"] = np.zeros((len(q), 8))
            demo["obs/robot0_joint_pos"] = q
            demo["obs/robot0_eef_pos"] = np.zeros((len(q), 3))
        file["mask/train"] = np.array([f"demo_{i + 1}" for i in range(N)], dtype="S")
    rows = [f"demo_{i + 1},{1000 * x},{1000 * y}" for i in range(N) for x, y in [landed(i)]]
    (folder / "outcomes.csv").write_text("\n".join(["episode,x (mm),y (mm)", *rows]))


def ros1(folder):
    """rosbags: joint states in another order, with a gripper's messages on the same topic."""
    store = get_typestore(Stores.ROS1_NOETIC)
    kind, none = "sensor_msgs/msg/JointState", np.zeros(0)
    for i in range(N):
        with Writer1(folder / f"throw_{i}.bag") as writer:
            topic = writer.add_connection("/joint_states", kind, typestore=store)
            for t, q in zip(*throw(i, 125, 6), strict=True):
                now = round((1.7e9 + t) * 1e9)
                stamp = store.types["builtin_interfaces/msg/Time"](
                    sec=now // 10**9, nanosec=now % 10**9
                )
                header = store.types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="")
                for said, positions in ((UR[::-1], q[::-1].copy()), (["finger"], np.ones(1))):
                    message = store.types[kind](
                        header=header,
                        name=list(said),
                        position=positions,
                        velocity=none,
                        effort=none,
                    )
                    writer.write(topic, now, store.serialize_ros1(message, kind))
    outcomes(folder)


def mcap(folder):
    """mcap-ros2-support: joint states as franka_ros2 names them, the fingers among them."""
    names = [f"fr3_{name}" for name in (*JOINTS, "finger_joint1", "finger_joint2")]
    for i in range(N):
        with (folder / f"throw_{i}.mcap").open("wb") as file, McapWriter(file) as writer:
            schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
            for t, q in zip(*throw(i, 125), strict=True):
                now = round((1.7e9 + t) * 1e9)
                stamp = {"sec": now // 10**9, "nanosec": now % 10**9}
                message = {
                    "header": {"stamp": stamp, "frame_id": "base"},
                    "name": names,
                    "position": [*q, 0.04, 0.04],
                    "velocity": [],
                    "effort": [],
                }
                writer.write_message("/franka/joint_states", schema, message, now + 10**6, now)
    outcomes(folder)


JOINT_STATE = "\n".join(
    [
        "std_msgs/Header header",
        "string[] name",
        *(f"float64[] {name}" for name in ("position", "velocity", "effort")),
        80 * "=",
        "MSG: std_msgs/Header",
        "builtin_interfaces/Time stamp",
        "string frame_id",
        80 * "=",
        "MSG: builtin_interfaces/Time",
        "int32 sec",
        "uint32 nanosec",
    ]
)
"""`sensor_msgs/msg/JointState`, with the definitions that it names, as rosbag2 stores them."""


def replay_buffer(folder):
    """Diffusion Policy's buffer of a real arm (`RealEnv`), whose times are milliseconds here."""
    root = zarr.open_group(str(folder / "all.zarr"), mode="w", zarr_format=2)
    parts = [throw(i, 60) for i in range(N)]
    q = np.concatenate([q for _, q in parts])
    data = root.create_group("data")
    data.create_array("robot_joint", data=q)
    data.create_array("robot_eef_pose", data=q[:, :6])
    data.create_array("action", data=q[:, :6])
    data.create_array("stage", data=np.zeros(len(q), dtype=np.int64))
    data.create_array("timestamp", data=np.concatenate([1000 * t for t, _ in parts]))
    ends = np.cumsum([len(t) for t, _ in parts])
    root.create_group("meta").create_array("episode_ends", data=ends)
    outcomes(folder, 100)


FOLDERS = {
    libfranka: ("panda", "", ""),
    rtde: ("ur5e", "", ""),
    npz: ("panda", "", "--units deg"),
    npy: ("panda", "all.npy", "--rate 100"),
    european: ("panda", "", ""),
    unlabelled: ("panda", "", "--time-column 1 --time-unit ms --units deg"),
    one_file: ("panda", "", ""),
    lerobot: ("panda", "hoop", "--units deg"),
    robomimic: ("panda", "demos.hdf5", ""),
    ros1: ("arm.urdf", "", ""),
    mcap: ("fr3", "", ""),
    replay_buffer: ("panda", "all.zarr --key robot_joint", "--time-unit ms --outcome-unit cm"),
}
"""Robot, what of the folder is imported and how, and the correction that the message names."""
MANY = {libfranka: 40, ros1: 40}
"""Of which so many plans are asked for: a Panda, and a UR5e known by its URDF alone."""


def opened(t, i):
    """A gripper in percent: closed at 8, open at 70, from 0.62 s into the throw on."""
    return np.round(8 + 62 * np.clip((t - 0.92 - 0.004 * i) / 0.15, 0, 1), 1)


def so101(folder):
    """LeRobot v3 of an SO-101: degrees by an encoder of 4096 steps, the gripper in percent."""
    names = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
    motions = []
    for i in range(N):
        t = np.arange(round(1.7 * 30) + 1) / 30
        s = np.clip((t - 0.3) / 0.9, 0, 1)
        swing = (10 * s**3 - 15 * s**4 + 6 * s**5) * (1 + 0.05 * i)
        pan = 4 * (-1) ** i * swing
        q = np.column_stack([pan, -60 + 70 * swing, 60 - 50 * swing, -20 + 40 * swing, 1 + 0 * t])
        motions.append(np.column_stack([np.round(q / 360 * 4096) * 360 / 4096, opened(t, i)]))
    lerobot_set(folder / "hoop", 30, motions, [f"{name}.pos" for name in names])
    outcomes(folder)


def ur5e_gripper(folder, column="gripper"):
    """An RTDE log with a gripper in percent."""
    for i in range(N):
        t, q = throw(i, 500, 6)
        names = ["timestamp", *(f"{kind}_q_{j}" for kind in ("target", "actual") for j in range(6))]
        rows = np.column_stack([t + 8123.4, q, q, opened(t, i)])
        with (folder / f"{i}.csv").open("w") as file:
            writer = csv.writer(file, delimiter=" ")
            writer.writerow([*names, column])
            writer.writerows(rows.tolist())
    outcomes(folder)


def ur5e_register(folder):
    """The same, with the gripper in a register of the controller, as RTDE has no gripper."""
    ur5e_gripper(folder, "output_double_register_24")


REGISTER = "--joints " + " ".join(f"actual_q_{j}" for j in range(6)) + " output_double_register_24"
GALLERY = {
    so101: ("--robot so101", "lab/hoop --units deg"),
    ur5e_gripper: ("--robot ur5e --gripper percent", "lab"),
    ur5e_register: ("--robot ur5e --gripper percent", f"lab {REGISTER}"),
}
"""What `new` and `import` are told, as docs/demonstrations.md has it."""


@pytest.mark.parametrize("write", GALLERY, ids=lambda write: write.__name__)
def test_an_arm_with_a_gripper_has_a_plan_in_four_commands(run, tmp_path, monkeypatch, write):
    robot, how = GALLERY[write]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab").mkdir()
    write(tmp_path / "lab")
    assert run("new", "hoop", *robot.split())[0] == 0
    status, out, err = run("import", "hoop", *how.split())
    assert status == 0, err
    assert f"all {N} demonstrations pass" in out
    assert "left out" not in out
    assert run("learn", "hoop")[0] == 0
    status, out, err = run("ask", "hoop", "--goal", "90cm", "2cm", "--out", "plan.npz")
    assert status == 0, err
    assert "REFUSE" not in out
    assert "  ok     range          gripper" in out
    assert "  ok     speed          gripper" in out
    plan = np.load("plan.npz")["q"][:, -1]
    assert plan.min() == pytest.approx(8, abs=2)
    assert plan.max() == pytest.approx(70, abs=2)
    assert plan[0] < 10 < 60 < plan[-1]
    first = run("ask", "hoop", "--goal", "90cm", "2cm")[1]  # the goal stands, and so does the trial
    assert first.startswith("goal 1: 90 cm ahead, 2 cm left; within 1.5 cm\ntrial 1:")
    status, _, err = run("ask", "hoop", "--goal", "95cm", "2cm")
    assert status == 2
    assert "trial 1 waits to be told" in err


@pytest.mark.parametrize("write", [so101, ur5e_gripper], ids=lambda write: write.__name__)
def test_a_gripper_that_is_left_out_is_named_with_its_range(run, tmp_path, monkeypatch, write):
    robot, how = GALLERY[write]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab").mkdir()
    write(tmp_path / "lab")
    assert run("new", "hoop", "--robot", robot.split()[1], "--gripper", "none")[0] == 0
    name = "gripper.pos" if write is so101 else "gripper"
    for more in (["--inspect"], []):
        out = run("import", "hoop", *how.split(), *more)[1]
        assert f"left out although it moves: {name}, 8 to 70 (take a gripper in: new" in out
    assert f"without what moves as well: {name}, 8 to 70" in run("status", "hoop")[1]


@pytest.mark.slow
@pytest.mark.parametrize("write", FOLDERS, ids=lambda write: write.__name__)
def test_a_folder_becomes_a_plan_that_passes(run, tmp_path, monkeypatch, write):
    robot, inside, correction = FOLDERS[write]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab").mkdir()
    write(tmp_path / "lab")
    write_urdf(tmp_path / "arm.urdf", ur5e())
    assert run("new", "hoop", "--robot", robot)[0] == 0
    command = ["import", "hoop", *f"lab/{inside}".split()]
    status, out, err = run(*command)
    if correction:
        assert status == 2
    given: list[str] = []
    for _ in range(3):  # what was recorded without names or with doubtful units is asked for
        if status == 0:
            break
        _, command, rest = err.rpartition("import hoop")
        given = shlex.split(rest) if command else [*f"lab/{inside}".split(), "--rate"]
        given += ["100"] if given[-1] == "--rate" else []  # nobody knows the rate
        status, out, err = run("import", "hoop", *given)
    assert status == 0, err
    assert set(correction.split()) <= {word.removesuffix(".0") for word in given}
    joints = 6 if robot in ("ur5e", "ur10e", "arm.urdf") else 7
    held = np.array(UR if joints == 6 else JOINTS)[SWING[joints] == 0]
    (noise,) = [line for line in out.splitlines() if line.startswith("noise")]
    assert noise.endswith(" held still")
    assert noise.count("joint") >= 1
    assert all(name in noise or " to " in noise for name in held)
    assert f"all {N} demonstrations pass" in out
    assert "in motion" not in out
    assert "jumps" not in out
    assert run("learn", "hoop")[0] == 0
    shares = np.random.default_rng(0).dirichlet(np.ones(N), size=MANY.get(write, 1))
    first, *others = shares @ [landed(i) for i in range(N)]
    assert run("goal", "hoop", *first.round(4))[0] == 0
    status, out, err = run("ask", "hoop")
    assert status == 0, err  # the gate refuses with 2
    assert "plan passes" in out
    assert run("void", "hoop", 1)[0] == 0
    with Workspace(tmp_path / "hoop") as workspace:
        session = workspace.session()
        for goal in others:
            workspace.set_goal(goal.round(4))
            trial = session.ask()  # RobotLimitError where the gate refuses
            assert not trial.verdict.refusals
            session.void(trial.number)
