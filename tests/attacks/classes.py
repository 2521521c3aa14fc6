"""The attacks, by class: each tries one thing in an empty folder, and says whether it held."""

from __future__ import annotations

import json
import random
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, get_args

import msgspec
import numpy as np
from PIL import Image
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import WorkspaceError
from prior_reinforce.files import sha256, sha256_of_folder
from prior_reinforce.generators import load_generator
from prior_reinforce.perception.calibration import TableCalibration
from prior_reinforce.perception.vlm_formats import FORMATS, read_box
from tests.arm.recordings import recorded
from tests.arm.workspace.planar import manifest
from tests.attacks import odd
from tests.attacks.harness import HELD, NASTY, call, command, damage, tree
from tests.perception.vision_server import Fault, VisionServer, vlm_file

Attack = Callable[[random.Random, Path, Path], str]
"""Of a source of chance, an empty folder, and a workspace with one open trial to copy from."""


_READERS = ["status", "ask", "log"] * 3 + ["report"]
"""Commands that only look; a report draws pictures, which takes as long as ten others."""


def flags(rng: random.Random, here: Path, asked: Path) -> str:
    """Any command of a workspace with any words behind it."""
    shutil.copytree(asked, here / "planar")
    words = {
        "goal": ["--memory", "--adapter", "--tolerance", "0.9", "0.05"],
        "ask": [
            "--out",
            "--rate",
            "--check",
            "--time-limit",
            "--generator",
            "--adapter",
        ],
        "tell": ["--error", "--outcome", "--hit", "--miss"],
        "amend": ["--error", "--outcome", "--hit", "--miss"],
        "void": ["--reason"],
        "status": [],
        "log": [],
        "export": ["plan.csv", "plan.npz", "plan.json", "--rate"],
        "import": [
            "--outcomes",
            "--format",
            "--key",
            "--rate",
            "--episodes",
            "--joints",
            "--units",
        ],
        "new": ["--name", "--action-names", "--dt", "--outcome-names", "--tolerance", "--robot"],
        "calibrate": ["--height", "--outcome-height", "--camera", "--out"],
    }
    name = rng.choice(list(words))
    args = [] if name in ("new", "calibrate") else ["planar"]
    args += [rng.choice(words[name] + NASTY) for _ in range(rng.randrange(6))]
    args = [arg for arg in args if arg not in ("/", "//", "/dev/null")]  # we may be root
    return command(here, name, *args)


def _words(rng: random.Random, most: int) -> list[str]:
    """What a person may type for a place or an error, and what nobody would."""
    spoken = ["5cm", "long", "left,", "-3", "0.02", "hit", "--hit", "--error", "--outcome"]
    numbers = [str(np.float32(rng.uniform(-1, 1) * 10.0 ** rng.randrange(-30, 30)))]
    return rng.choices(spoken + numbers * 9 + NASTY, k=rng.randrange(most + 1))


def tells(rng: random.Random, here: Path, asked: Path) -> str:
    """A reading in any words, of any trial."""
    shutil.copytree(asked, here / "planar")
    flag = rng.choice(["--error", "--outcome"])
    return command(here, "tell", "planar", str(rng.randrange(-1, 4)), flag, *_words(rng, 4))


def goals(rng: random.Random, here: Path, asked: Path) -> str:
    """Any numbers for a goal: two within five metres are one, unless a trial is open."""
    is_open = rng.random() < 0.5
    shutil.copytree(asked if is_open else asked.parent / "learned", here / "planar")
    numbers = [rng.choice([0.9, -4.9, 5.1, 1e-40, 3e38, np.nan, -np.inf]) for _ in range(3)]
    numbers = numbers[: rng.randrange(1, 4)]
    before = tree(here)
    verdict = command(here, "goal", "planar", *map(str, numbers))
    good = not is_open and len(numbers) == 2 and all(abs(number) <= 5 for number in numbers)
    if verdict == HELD and (tree(here) != before) != good:
        return f"goal {numbers} {'refused' if good else 'taken'}"
    return verdict


def outcomes(rng: random.Random, here: Path, asked: Path) -> str:
    """A table of outcomes of which no row is of a recording."""
    shutil.copytree(asked.parent / "learned", here / "planar")
    odd.npz(here)
    rows = [",".join(_words(rng, 4)) for _ in range(rng.randrange(7))]
    table = "\n".join(["episode,x,y", *rows])
    (here / "outcomes.csv").write_text(table, encoding="utf-8", errors="replace", newline="")
    before = tree(here)
    verdict = command(here, "import", "planar", ".", "--outcomes", "outcomes.csv")
    return "taken in" if verdict == HELD and tree(here) != before else verdict


def files(rng: random.Random, here: Path, asked: Path) -> str:
    """Any file of a workspace that was damaged."""
    folder = here / "planar"
    shutil.copytree(asked, folder)
    path = rng.choice(sorted(path for path in folder.rglob("*") if path.is_file()))
    path.chmod(0o644)
    path.write_bytes(damage(rng, path.read_bytes()))
    return command(here, rng.choice(_READERS), "planar")


_VALUES = [
    *map(json.dumps, [[], [0], ["a", "a"], {}, True, -1, 0, 1e308, "", "x" * 1000]),
    *("[[1]]", "9" * 400, "nan", "inf", "1979-05-27", "{a=1}", '"\\u001b[2J"', '"$\\\\frac$"'),
]


def manifests(rng: random.Random, here: Path, asked: Path) -> str:
    """A manifest that somebody edited."""
    shutil.copytree(asked, here / "planar")
    seven = {"names": str([f"joint{i}" for i in range(1, 8)]), "units": str(["rad"] * 7)}
    text = manifest(robot=rng.choice(["panda", "fr3"]), **seven)
    if rng.random() < 0.7:
        text = (here / "planar" / "workspace.toml").read_text()
    lines = [line.removeprefix("# ") if " = " in line else line for line in text.splitlines()]
    if rng.random() < 0.5:
        lines = text.splitlines()
    for _ in range(rng.randrange(1, 4)):
        at = rng.randrange(len(lines))
        key = lines[at].split("=")[0]
        value = rng.choice(_VALUES)
        lines[at] = rng.choice([f"{key} = {value}", "", f"[{value}]", lines[at] + value])
    content = "\n".join(lines)
    if rng.random() < 0.2:
        (here / "planar" / "workspace.toml").write_bytes(damage(rng, content.encode()))
    else:
        (here / "planar" / "workspace.toml").write_text(content, encoding="utf-8")
    return command(here, rng.choice(_READERS), "planar")


def recordings(kind: str, rng: random.Random, here: Path, asked: Path) -> str:
    """Recordings of a kind that were damaged or crafted."""
    shutil.copytree(asked.parent / "learned", here / "planar")
    whole, inside = written(kind, asked.parent)
    source = here / "source"
    shutil.copytree(whole, source)
    path = source / inside
    files = sorted(file for file in source.rglob("*") if file.is_file())
    for _ in range(rng.randrange(1, 3)):
        file = rng.choice(files)
        if file.is_symlink():  # whatever is done to it would be done elsewhere
            continue
        if file.suffix == ".npz" and rng.random() < 0.5:
            np.savez(file, **_crafted(rng))
        elif file.suffix in (".json", "") and rng.random() < 0.5:
            _edit_json(rng, file)
        elif file.suffix == ".yaml" and rng.random() < 0.5:
            lines = file.read_text(errors="replace").splitlines() or [""]
            lines[rng.randrange(len(lines))] = rng.choice(_YAML)
            file.write_text("\n".join(lines))
        elif rng.random() < 0.1:  # a link to what is none of its business
            file.unlink()
            file.symlink_to(asked / "workspace.toml")
        else:
            file.write_bytes(damage(rng, file.read_bytes()))
    if inside == Path() and rng.random() < 0.3:
        _write_odd_bag(rng, source / "odd")
    more = ["--joints", "joint1", "joint2", "--rate", "100"] if rng.random() < 0.8 else []
    before = tree(source)
    verdict = command(here, "import", "planar", str(path), *more)
    return "recordings changed" if tree(source) != before else verdict


WRITERS: dict[str, Callable[[Path], Path]] = {
    "npz": recorded.write_npz,
    "csv": recorded.write_csv,
    "hdf5": recorded.write_robomimic,
    "zarr": recorded.write_zarr,
    "lerobot": recorded.write_lerobot,
    "ros1": partial(recorded.write_bags, kind="ros1", rate=20),
    "sqlite": partial(recorded.write_bags, kind="sqlite", rate=20),
    "mcap": partial(recorded.write_bags, kind="mcap", rate=20),
    **{f"odd {name}": write for name, write in odd.WRITERS.items()},
}
_YAML = (
    *("", "- x", "a: &a [*a]", "  message_count: 99999999999999", "  storage_identifier: sh"),
    *("  - ../../../../etc/passwd", 'x: !!python/object/apply:os.system ["touch ran"]'),
    *("  compression_mode: file", "  compression_mode: message", "  compression_format: zstd"),
)


@cache
def written(kind: str, place: Path) -> tuple[Path, Path]:
    """A folder of recordings, of this process alone, and what in it is imported."""
    folder = Path(tempfile.mkdtemp(prefix=f"recorded-{kind}-", dir=place))
    path = WRITERS[kind](folder)
    count = 4 if kind.startswith("odd ") else recorded.N
    recorded.write_outcomes(folder, dict(list(recorded.OUTCOMES.items())[:count]))
    return folder, path.relative_to(folder)


def _write_odd_bag(rng: random.Random, path: Path) -> None:
    """A bag as its library writes it, of messages that are damaged or of another type."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types, state = store.types, "sensor_msgs/msg/JointState"
    stamp = types["builtin_interfaces/msg/Time"](sec=rng.choice([0, 1, -1]), nanosec=0)
    names = rng.choice([["joint1", "joint2"], ["joint1", "joint1"], [], ["a\x1b[2J", "joint2"]])
    numbers = np.array([rng.choice([0.1, np.nan, 1e308])] * rng.choice([2, 3, 0]))
    message = types[state](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
        name=names,
        position=numbers,
        velocity=numbers,
        effort=numbers,
    )
    raw = bytes(store.serialize_cdr(message, state))
    trajectory = "trajectory_msgs/msg/JointTrajectory"
    kind = rng.choice([state, state, trajectory, "std_msgs/msg/String", "sensor_msgs/msg/Image"])
    plugin = rng.choice([StoragePlugin.MCAP, StoragePlugin.SQLITE3])
    with Writer(path, version=8, storage_plugin=plugin) as writer:
        topic = writer.add_connection(rng.choice(["/q", "a\x1b[2J\nb"]), kind, typestore=store)
        for k in range(rng.choice([0, 1, 30])):
            sent = raw if rng.random() < 0.5 else damage(rng, raw)
            writer.write(topic, rng.choice([k * 10**7, 0, 2**62]), sent)


def _crafted(rng: random.Random) -> dict[str, Any]:
    arrays: list[Any] = [
        np.zeros((3, 2)),
        np.array([[np.nan, 1.0]] * 4),
        np.full((4, 2), 1e305),
        np.array([[{}, 1]] * 3, dtype=object),
        np.array(["a", "b"]),
        np.zeros((0, 2)),
        np.zeros((2, 2, 2, 2)),
        np.array(5),
        np.arange(8.0).reshape(4, 2) * 1j,
        np.linspace(0, 1, 40)[:, None] * [1.0, 2.0],
    ]
    names = ("q", "t", "dt", "rate", "joint_names", "outcome", "metadata", "plans")
    return {name: rng.choice(arrays) for name in rng.sample(names, rng.randrange(1, 5))}


def _edit_json(rng: random.Random, file: Path) -> None:
    try:
        content = json.loads(file.read_text())
    except ValueError:
        return
    _edit(rng, content)
    file.write_text(json.dumps(content))


def _edit(rng: random.Random, content: Any) -> None:
    """Change one value somewhere in JSON."""
    values = [None, [], {}, "", -1, 0, 1e308, 10**30, "x", [1, 2], True, [[[]]], {"a": {}}]
    while isinstance(content, (dict, list)) and content:
        key = rng.choice(list(content) if isinstance(content, dict) else range(len(content)))
        if rng.random() < 0.5 or not isinstance(content[key], (dict, list)):
            if rng.random() < 0.2:
                del content[key]
            else:
                content[key] = rng.choice(values)
            return
        content = content[key]


def models(rng: random.Random, here: Path, asked: Path) -> str:
    """A model's folder that was damaged, or crafted with hashes that fit."""
    from safetensors.numpy import load, save

    source = next((asked / "models").iterdir())
    folder = here / "model"
    shutil.copytree(source, folder)
    config, weights = folder / "config.json", folder / "model.safetensors"
    content = json.loads(config.read_text())
    how = rng.randrange(3)
    if how == 0:
        file = rng.choice([config, weights])
        file.write_bytes(damage(rng, file.read_bytes()))
        if rng.random() < 0.5:
            return call(lambda: load_generator(folder))
        content["tensors_sha256"] = sha256(weights.read_bytes())
    elif how == 1:
        _edit(rng, content)
    else:
        tensors = dict(load(weights.read_bytes()))
        name = rng.choice(list(tensors))
        tensors[name] = rng.choice(
            [
                np.zeros(0),
                np.zeros((3, 3, 3)),
                tensors[name] * np.nan,
                tensors[name][:1],
                tensors[name].astype(np.int8),
            ]
        )
        if rng.random() < 0.3:
            del tensors[name]
        weights.write_bytes(save({key: np.ascontiguousarray(v) for key, v in tensors.items()}))
        content["tensors_sha256"] = sha256(weights.read_bytes())
    if isinstance(content, dict):
        content.pop("config_sha256", None)
        digest = sha256(json.dumps(content, sort_keys=True).encode())
        config.write_text(json.dumps(content | {"config_sha256": digest}))

    def use() -> None:
        plans = load_generator(folder).generate(np.array([[0.9, 0.05]]))
        assert plans.ndim == 3

    verdict = call(use)
    if verdict != HELD:
        return verdict
    # The same as a workspace's model: it is not the one that was learned.
    shutil.copytree(asked, here / "planar")
    if sha256_of_folder(folder)[:16] != source.name:
        shutil.rmtree(here / "planar" / "models" / source.name)
        shutil.copytree(folder, here / "planar" / "models" / source.name)
        with Workspace(here / "planar") as workspace:
            workspace.session().void(1, "")
        verdict = command(here, "ask", "planar")
    return verdict


def replies(rng: random.Random, here: Path, asked: Path) -> str:
    """What a model may say of where an object is."""
    pieces = ["[", "]", "(", ")", ",", " ", "1000", "0", "-1", "1e3", "0.5", "<|begin_of_box|>"]
    pieces += ["<|end_of_box|>", "<think>", "</think>", "{", "}", '"bbox_2d"', "x", "\n", "9" * 50]
    count = rng.choice([5, 20, 2_000, 100_000])
    text = (
        "".join(rng.choices(pieces, k=count)) if rng.random() < 0.8 else rng.choice(pieces) * count
    )
    family = FORMATS[rng.choice(list(FORMATS))]
    return call(lambda: read_box(text, family, (640, 480)))


def journals(rng: random.Random, here: Path, asked: Path) -> str:
    """A journal that was damaged, or holds well-formed events that cannot be."""
    folder = here / "planar"
    shutil.copytree(asked, folder)
    journal = folder / "journal.sqlite"
    if rng.random() < 0.4:
        journal.write_bytes(damage(rng, journal.read_bytes()))
    else:
        kinds = ["goal_set", "asked", "moving", "moved", "told", "amended"]
        kinds += ["voided", "demonstrations_imported", "model_trained", "unknown"]
        with Workspace(folder) as workspace:
            whole = [(entry.kind, msgspec.to_builtins(entry.event)) for entry in workspace.events]
            kind, data = rng.choice(whole)
            data = json.loads(json.dumps(data))
            if rng.random() < 0.5:
                data |= {"trial": rng.choice([0, 1, 2, -1, "1", None, 1.5]), "hit": True}
                data |= {"error_seen": rng.choice([[0.1, 0.2], [], "x", [1e308, 0], None])}
            _edit(rng, data)
            with suppress(WorkspaceError), workspace.log.exclusive():  # which reads it back
                data["kind"] = rng.choice([kind, rng.choice(kinds)])
                workspace.log.append(msgspec.Raw(json.dumps(data).encode()))
    name = rng.choice([*_READERS, *["tell", "void", "export"] * 3])
    more = {"tell": ["1", "--hit"], "void": ["1"], "export": ["1", "plan.csv"]}.get(name, [])
    return command(here, name, "planar", *more)


def looks(rng: random.Random, here: Path, asked: Path) -> str:
    """A photograph, a calibration or a server's answer that is damaged, crafted or hostile."""
    shutil.copytree(asked, here / "planar")
    photo, table = here / "photo.png", here / "table.json"
    pixels = np.full((60, 80, 3), 128, np.uint8)
    Image.fromarray(pixels).save(photo, rng.choice(["PNG", "PNG", "JPEG", "GIF", "TIFF"]))
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    TableCalibration.fit(points, 55 - 50 * points[:, ::-1]).save(table)
    file = rng.choice([photo, table, here / "photo-seen.json", here / "photo-seen.png"])
    how = rng.choice(["nothing", "damage", "json", "link"])
    if how == "damage":
        file.write_bytes(damage(rng, file.read_bytes() if file.exists() else b"x"))
    elif how == "json" and file == table:
        _edit_json(rng, table)
    elif how == "link":
        file.unlink(missing_ok=True)
        file.symlink_to(rng.choice([asked / "workspace.toml", here / "planar", here / "none"]))
    words = rng.choice(["the ball", *NASTY])
    flags = ["--reached", "the ball", "--reached-size", "0.06", "--goal", words]
    flags += ["--goal-size", rng.choice(["0.1", "0.1", "nan", "-1", "1e308"])]
    if rng.random() < 0.3:
        flags += ["--workspace", "planar", "--trial", rng.choice(["1", "2", "x"])]
    with VisionServer(faults=[rng.choice(FAULTS) for _ in range(6)]) as server:
        flags += ["--vlm", str(vlm_file(here, server.base_url, timeout=1.0))]
        return command(here, "look", str(photo), *flags)


FAULTS = (None, *(fault for fault in get_args(Fault) if fault != "timeout"))
_ALL = (
    flags,
    tells,
    goals,
    outcomes,
    manifests,
    files,
    models,
    replies,
    looks,
    journals,
)
CLASSES: dict[str, Attack] = {attack.__name__: attack for attack in _ALL}
