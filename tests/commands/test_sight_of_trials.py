"""`adapt` and `demo` through a camera and an endpoint; the operator where nothing is seen."""

from __future__ import annotations

import json
import os
import pty
import sys
from dataclasses import asdict

import pytest
from tests.perception.vision_server import VisionServer

from prior_reinforce.cli import main
from prior_reinforce.commands.learning import TrainingRecord
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.plans.alignment import align
from prior_reinforce.tasks import make_task

GOAL = ("1.0", "0.05")


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A quick generator, saved as `learn` saves one."""
    folder = tmp_path_factory.mktemp("model")
    demonstrations = make_task("basketball-v1").demonstrations("A")
    SmoothInterpolation().fit(align(demonstrations).demonstrations, seed=0).save(folder)
    record = TrainingRecord(demonstrations.sha256, 0)
    (folder / "training.json").write_text(json.dumps(asdict(record)))
    return folder


@pytest.fixture
def adapt(model, tmp_path):
    def run(*flags: str) -> int:
        where = ("--goal", *GOAL, "--model", str(model), "--out", str(tmp_path), "--no-film")
        return main(["adapt", *where, *flags])

    return run


@pytest.fixture
def typed(monkeypatch):
    """A terminal at which somebody has typed lines already."""
    opened = []

    def type_lines(text: str) -> None:
        master, slave = pty.openpty()
        os.write(master, text.encode())
        stdin = os.fdopen(slave, "r")
        opened.append((master, stdin))
        monkeypatch.setattr(sys, "stdin", stdin)

    yield type_lines
    for master, stdin in opened:
        stdin.close()
        os.close(master)


@pytest.mark.slow
def test_a_model_at_an_endpoint_sees_the_trials_and_its_readings_are_kept(adapt, tmp_path, capsys):
    with VisionServer("qwen3-vl") as server:
        flags = ("--vlm.base-url", server.base_url, "--vlm.family", "qwen3-vl")
        assert adapt("--perception", "vlm", *flags, "--vlm.model", "qwen") == 0
    reading = json.loads((tmp_path / "seen" / "goal1-trial1.json").read_text())
    assert reading["model"] == "qwen"
    assert len(reading["reached"]["answers"]) == 3
    assert (tmp_path / "seen" / "goal1-trial1.png").stat().st_size > 10_000
    assert f"vlm, qwen at {server.base_url}" in (tmp_path / "report.html").read_text()
    assert "seen: HIT" in capsys.readouterr().out


@pytest.mark.slow
def test_the_camera_needs_no_endpoint(adapt, tmp_path):
    assert adapt("--perception", "camera") == 0
    assert (tmp_path / "seen" / "goal1-trial1.png").is_file()


@pytest.mark.slow
def test_without_a_terminal_a_failed_reading_ends_in_one_line(adapt, tmp_path, capsys):
    with VisionServer() as server:
        gone = server.base_url
    assert adapt("--perception", "vlm", "--vlm.base-url", gone, "--vlm.max-retries", "0") == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert "is the server running?" in said
    assert "no terminal" in said
    assert not (tmp_path / "report.html").exists()


@pytest.mark.slow
def test_at_a_terminal_the_operator_is_asked_until_it_is_understood(adapt, typed, capsys):
    typed("a little long\n5cm long, 2cm left\n" + "hit\n" * 9)
    with VisionServer() as server:
        gone = server.base_url
    status = adapt("--perception", "vlm", "--vlm.base-url", gone, "--vlm.max-retries", "0")
    said = capsys.readouterr().out
    assert status in (0, 1)
    assert "not seen: looking for the orange ball: cannot reach" in said
    assert "cannot read 'a little long'" in said
    assert "seen: 5 cm long, 2 cm left" in said or "seen: HIT" in said


@pytest.mark.slow
def test_an_operator_who_hangs_up_is_no_number(adapt, typed, capsys):
    typed("\x04")
    with VisionServer() as server:
        gone = server.base_url
    assert adapt("--perception", "vlm", "--vlm.base-url", gone, "--vlm.max-retries", "0") == 2
    assert "no answer came" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (
            ("--perception", "eyes"),
            "no perception 'eyes'; known are exact, eye, amplified, camera, vlm",
        ),
        (("--perception", "vlm", "--vlm.api-key-variable", "NO_SUCH_KEY"), "NO_SUCH_KEY is not"),
    ],
)
def test_wrong_settings_are_told_before_anything_is_learned(flags, message, tmp_path, capsys):
    assert main(["adapt", "--out", str(tmp_path), *flags]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
