"""Six throws as functions of time, and writers of every format with the formats' own libraries."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zarr
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from prior_reinforce.arm.recordings import ImportResult, Preprocessing, Recording

AS_IS = Preprocessing(trim=False)
N = 6
JOINTS = tuple(f"joint{i}" for i in range(1, 8))
BEFORE = 0.3
"""Still time before each throw, [s]."""
AFTER = 0.4
"""Still time after each throw, [s]."""
HOME = np.array([0.0, -0.4, 0.1, -2.0, 0.0, 1.8, 0.8])
SWING = np.array([0.1, 0.4, 0.0, 0.8, -0.1, 0.9, 0.0])
T = np.arange(101) / 50
"""Times of a swing of three joints, [s]."""
S = 10 * (s := np.clip((T - 0.3) / 1.2, 0, 1)) ** 3 - 15 * s**4 + 6 * s**5
"""How far it is along, from 0 to 1."""
Q = np.array([0.1, -0.6, 0.2]) + S[:, None] * [0.3, 0.4, -0.2]
"""Its joints, [rad]."""
UR = ("pan", "lift", "elbow")
"""Their names."""
OUTCOMES = {str(i): (0.8 + 0.05 * i, 0.1 * (-1) ** i + 0.01 * i) for i in range(N)}


def duration(i: int) -> float:
    """Of the i-th swing, [s]: a whole number of frames at 20, 50, 100 and 1000 Hz."""
    return 1.0 + 0.1 * (i % 3)


def throw(i: int, t: np.ndarray) -> np.ndarray:
    """Joint positions (T, 7) of the i-th throw, t from the start of its recording."""
    s = np.clip((np.asarray(t) - BEFORE) / duration(i), 0, 1)[:, None]
    return HOME + SWING * (1 + 0.05 * i) * (10 * s**3 - 15 * s**4 + 6 * s**5)


def sampled(i: int, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions of a whole recording."""
    t = np.arange(round((BEFORE + duration(i) + AFTER) * rate) + 1) / rate
    return t, throw(i, t)


def check_motions(result: ImportResult, rate: float, *, tolerance: float) -> None:
    """Plans are the throws that were written, untrimmed, each holding its last pose."""
    demos = result.demonstrations
    t = np.arange(demos.horizon) / rate
    assert demos.format.dt == pytest.approx(1 / rate, rel=1e-9)
    assert demos.horizon == round((BEFORE + 1.2 + AFTER) * rate) + 1
    for i in range(N):
        np.testing.assert_allclose(demos.plans[i], throw(i, t), atol=tolerance)
    np.testing.assert_allclose(demos.outcomes_seen, list(OUTCOMES.values()))
    assert demos.outcome_format.names == ("x", "y")


def write_outcomes(folder: Path, outcomes: dict[str, Sequence[float]] | None = None) -> Path:
    path = folder / "outcomes.csv"
    rows = outcomes or OUTCOMES
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["episode", *"xyz"[: len(next(iter(rows.values())))]])
        writer.writerows([name, *values] for name, values in rows.items())
    return path


def write_npz(folder: Path, rate: float = 100) -> Path:
    for i in range(N):
        t, q = sampled(i, rate)
        np.savez(folder / f"throw_{i}.npz", t=t, q=q, joint_names=np.array(JOINTS))
    return folder


def write_csv(folder: Path, rate: float = 100) -> Path:
    for i in range(N):
        t, q = sampled(i, rate)
        with (folder / f"{i}.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t", *JOINTS])
            writer.writerows([repr(float(v)) for v in row] for row in np.column_stack([t, q]))
    return folder


def write_lerobot(
    folder: Path,
    rate: int = 100,
    *,
    version: str = "v3.0",
    stale: bool = False,
    skip: Sequence[int] = (),
    names: object = None,
) -> Path:
    """Six throws and a gripper's opening; of v3.0, the last episode is split over two files."""
    motions = [
        np.column_stack([q, np.full(len(q), 0.04)]) for _, q in map(sampled, range(N), [rate] * N)
    ]
    names = names or [*JOINTS, "gripper"]
    return lerobot_set(folder, rate, motions, names, version, stale=stale, skip=skip, apart=50)


def lerobot_set(
    folder: Path,
    rate: int,
    motions: Sequence[np.ndarray],
    names: object,
    version: str = "v3.0",
    *,
    stale: bool = False,
    skip: Sequence[int] = (),
    apart: int = 0,
) -> Path:
    """A data set as `LeRobotDataset.create`, `add_frame` and `save_episode` make it of vectors.

    Held against what lerobot 0.4.4 (v3.0) and 0.3.3 (v2.1) wrote of the same numbers: columns,
    types and values of data and episodes were equal, and info but for what nothing reads;
    statistics and tasks are left out. The action is the state plus one.

    Args:
        folder: New.
        rate: Frames a second.
        motions: State of each episode, (T, D).
        names: Of the D channels; a list, or nested as some writers do.
        version: `v3.0` or `v2.1`.
        stale: Whether the list of episodes points to a file that is not there.
        skip: Episodes that are listed and have no frames.
        apart: How many of the last frames are in a second file, in v3.0.
    """
    vector = {"dtype": "float32", "shape": [motions[0].shape[1]], "names": names}
    kinds = {"timestamp": "float32"} | dict.fromkeys(
        ("frame_index", "episode_index", "index", "task_index"), "int64"
    )
    single = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in kinds.items()}
    lengths = [len(motion) for motion in motions]
    ends = np.cumsum(lengths).tolist()
    newer = version == "v3.0"
    pattern = (
        "chunk_index:03d}/file-{file_index:03d"
        if newer
        else "episode_chunk:03d}/episode_{episode_index:06d"
    )
    info = {
        "codebase_version": version,
        "robot_type": "arm",
        "total_episodes": len(motions),
        "total_frames": ends[-1],
        "total_tasks": 1,
        "chunks_size": 1000,
        "fps": rate,
        "splits": {"train": f"0:{len(motions)}"},
        "data_path": f"data/chunk-{{{pattern}}}.parquet",
        "video_path": None,
        "features": {"observation.state": vector, "action": vector, **single},
    }
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info, indent=4))
    tables = {}
    for i, motion in enumerate(motions):
        count = len(motion)
        flat = motion.astype(np.float32).ravel()
        columns = {
            "observation.state": pa.FixedSizeListArray.from_arrays(flat, motion.shape[1]),
            "action": pa.FixedSizeListArray.from_arrays(flat + 1, motion.shape[1]),
            "timestamp": (np.arange(count) / rate).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, i),
            "index": np.arange(ends[i] - count, ends[i]),
            "task_index": np.zeros(count, dtype=np.int64),
        }
        if i not in skip:
            tables[i] = pa.table(columns)
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    tasks = ["throw"]
    if not newer:
        for i, table in tables.items():
            pq.write_table(table, data / f"episode_{i:06d}.parquet")
        rows = [{"episode_index": i, "tasks": tasks, "length": n} for i, n in enumerate(lengths)]
        text = "".join(f"{json.dumps(row)}\n" for row in rows)
        (folder / "meta" / "episodes.jsonl").write_text(text)
        return folder
    whole = pa.concat_tables(list(tables.values()))
    cut = whole.num_rows - apart
    pq.write_table(whole.slice(0, cut), data / "file-000.parquet")
    if apart:
        pq.write_table(whole.slice(cut), data / "file-001.parquet")
    listed = folder / "meta" / "episodes" / "chunk-000"
    listed.mkdir(parents=True)
    nothing = [0] * len(motions)
    episodes = {
        "episode_index": list(range(len(motions))),
        "tasks": [tasks] * len(motions),
        "length": lengths,
        "data/chunk_index": nothing,
        "data/file_index": [7] * len(motions) if stale else nothing,
        "dataset_from_index": [0, *ends[:-1]],
        "dataset_to_index": ends,
        "meta/episodes/chunk_index": nothing,
        "meta/episodes/file_index": nothing,
    }
    pq.write_table(pa.table(episodes), listed / "file-000.parquet")
    return folder


def write_robomimic(folder: Path, rate: float | None = 20) -> Path:
    path = folder / "demos.hdf5"
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        env = {"env_name": "Throw", "type": 1, "env_kwargs": {"control_freq": rate}}
        data.attrs["env_args"] = json.dumps(env)
        for i in range(N):
            t, q = sampled(i, rate or 20)
            demo = data.create_group(f"demo_{i}")
            demo.attrs["num_samples"] = len(t)
            demo["actions"] = np.zeros((len(t), 7))
            demo["obs/robot0_joint_pos"] = q
            demo["obs/other_joints"] = q + 1
    return path


def write_zarr(folder: Path, rate: float = 50) -> Path:
    path = folder / "replay_buffer.zarr"
    root = zarr.open_group(str(path), mode="w", zarr_format=2)
    data, meta = root.create_group("data"), root.create_group("meta")
    parts = [sampled(i, rate)[1] for i in range(N)]
    whole = np.concatenate(parts)
    data.create_array("joint_pos", data=whole, chunks=(64, 7))
    data.create_array("action", data=whole + 1, chunks=(64, 7))
    data.create_array("img", data=np.zeros((len(whole), 2, 2, 3), dtype=np.uint8))
    meta.create_array("episode_ends", data=np.cumsum([len(part) for part in parts]))
    return path


Bag = Callable[..., Path]


def write_bag(
    path: Path,
    i: int,
    *,
    kind: str,
    rate: float = 100,
    names: Sequence[str] = JOINTS,
    shuffled: bool = False,
    fingers: bool = False,
    gripper_apart: bool = False,
    halves: bool = False,
    lost: int | None = None,
    trajectory: bool = False,
    stamped: bool = True,
) -> Path:
    """One throw in a bag of the kind `ros1`, `sqlite` or `mcap`."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    times = store.types["builtin_interfaces/msg/Time"]
    header_type = store.types["std_msgs/msg/Header"]
    rng = np.random.default_rng(i)
    t, q = sampled(i, rate)
    q = q[:, : len(names)]
    base = 1_700_000_000

    def header(seconds: float) -> object:
        nanoseconds = round(seconds * 1e9) if stamped else 0
        whole = base if stamped else 0
        stamp = times(sec=whole + nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        extra = {"seq": 0} if kind == "ros1" else {}
        return header_type(stamp=stamp, frame_id="", **extra)

    def state(seconds: float, joints: list[str], positions: np.ndarray) -> object:
        empty = np.zeros(0)
        return store.types["sensor_msgs/msg/JointState"](
            header=header(seconds), name=joints, position=positions, velocity=empty, effort=empty
        )

    if trajectory:
        point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
        span = store.types["builtin_interfaces/msg/Duration"]
        empty = np.zeros(0)
        points = [
            point(
                positions=row,
                velocities=empty,
                accelerations=empty,
                effort=empty,
                time_from_start=span(sec=int(s), nanosec=round((s - int(s)) * 1e9)),
            )
            for s, row in zip(t, q, strict=True)
        ]
        message = store.types["trajectory_msgs/msg/JointTrajectory"](
            header=header(0.0), joint_names=list(names), points=points
        )
        messages = [(0.0, message)]
        topic, type_name = "/plan", "trajectory_msgs/msg/JointTrajectory"
    else:
        topic, type_name = "/joint_states", "sensor_msgs/msg/JointState"
        messages = []
        for s, row in zip(t, q, strict=True):
            joints, positions = list(names), row
            if fingers:
                joints, positions = ["finger_left", *joints, "finger_right"], np.r_[0.04, row, 0.04]
            if shuffled:
                order = rng.permutation(len(joints))
                joints, positions = [joints[k] for k in order], positions[order]
            parts = [slice(3), slice(3, None)] if halves else [slice(None)]
            messages += [(s, state(s, joints[own], positions[own])) for own in parts]
            if gripper_apart:
                messages.append((s, state(s, ["finger_left"], np.array([0.04]))))
    if lost is not None:
        del messages[lost]
    if kind == "ros1":
        with Writer1(path) as writer:
            connection = writer.add_connection(topic, type_name, typestore=store)
            for s, message in messages:
                raw = store.serialize_ros1(message, type_name)
                writer.write(connection, base * 10**9 + round(s * 1e9), raw)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        with Writer2(path, version=8, storage_plugin=plugin) as writer:
            connection = writer.add_connection(topic, type_name, typestore=store)
            for s, message in messages:
                raw = store.serialize_cdr(message, type_name)
                writer.write(connection, base * 10**9 + round(s * 1e9), raw)
    return path


def write_bags(folder: Path, *, kind: str, count: int = N, **options: object) -> Path:
    for i in range(count):
        write_bag(folder / f"throw{i}{'.bag' if kind == 'ros1' else ''}", i, kind=kind, **options)
    return folder


def takes(
    names: Sequence[str], *ends: Sequence[float] | np.ndarray, units: Sequence[tuple] = ()
) -> list[Recording]:
    """One take of 1 s for each row of numbers that its channels end at, from half of these."""
    t = np.arange(100) * 0.01
    s = 0.5 + 0.5 * np.linspace(0, 1, 100)[:, None]
    every = enumerate(zip(ends, units or [()] * len(ends), strict=True))
    return [Recording(f"t{i}", t, s * np.array(end), names, units=u) for i, (end, u) in every]


def table(tmp_path: Path, text: str) -> Path:
    """A table of outcomes."""
    path = tmp_path / "outcomes.csv"
    path.write_text(text)
    return path


def rows_of_outcomes(scale=(1, 1), first=0, name="{}"):
    """Lines of the throws' outcomes, in other units or numbered from another number."""
    return [
        f"{name.format(int(episode) + first)},{scale[0] * x:.6g},{scale[1] * y:.6g}"
        for episode, (x, y) in OUTCOMES.items()
    ]
