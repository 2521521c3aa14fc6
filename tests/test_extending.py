"""The guide's member of each family: as it stands, and as one of ours by a line in its registry."""

import ast
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.arm.executing import EXECUTORS
from prior_reinforce.arm.executing.base import ArmSettings
from prior_reinforce.arm.executing.drive import Request, drive
from prior_reinforce.arm.executing.result import measure_tracking
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.cli import main
from prior_reinforce.generators import GENERATORS, Timed, load_generator, make_generator
from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.registry import Member
from prior_reinforce.simulation.tasks import TASKS, make_task
from prior_reinforce.testing import synthetic_demonstrations

REPOSITORY = Path(__file__).parents[1]
GUIDE = (REPOSITORY / "docs" / "extending.md").read_text()
FILES = dict(re.findall(r'^```python title="(.*?)"\n(.*?)^```$', GUIDE, re.M | re.S))
REGISTRIES = {
    "ADAPTERS": (ADAPTERS, "drift", Member("drift:Drift", "follows an offset")),
    "GENERATORS": (GENERATORS, "affine", Member("affine:Affine", "least squares")),
    "PERCEPTIONS": (PERCEPTIONS, "tape", Member("tape:Tape", "read to a centimetre")),
    "TASKS": (TASKS, "puck", Member("puck:Puck", "pushed, then sliding")),
}
LINES = "\n".join(
    f"from prior_reinforce.{family} import {registry}\n{registry}.members[{name!r}] = {member!r}"
    for family, (registry, (_, name, member)) in zip(
        ("adapters", "generators", "perception", "simulation.tasks"),
        REGISTRIES.items(),
        strict=True,
    )
)
"""One a family, for a process of its own: as if they stood in the registries."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The guide's files."""
    made = tmp_path_factory.mktemp("guide")
    for name, code in FILES.items():
        (made / name).write_text(code)
    return made


@pytest.fixture
def added(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    for registry, name, member in REGISTRIES.values():
        monkeypatch.setitem(registry.members, name, member)


def run(folder, *command, cwd=None):
    """Run Python beside the guide's files, and return what it printed."""
    path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        [sys.executable, *command],
        capture_output=True,
        text=True,
        cwd=cwd or folder,
        env=os.environ | {"PYTHONPATH": path, "COLUMNS": "200"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def registered(folder, code):
    """Run code where all four are members of their registries."""
    header = "import sys\nfrom prior_reinforce.registry import Member\n"
    return run(folder, "-c", f"{header}{LINES}\n{code}", cwd=REPOSITORY)


def test_the_guides_members_pass_the_guides_test_file(folder):
    told = run(
        folder, "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider", "test_mine.py"
    )
    passed, skipped = (re.search(rf"(\d+) {kind}", told) for kind in ("passed", "skipped"))
    assert int(passed[1]) > 40
    assert int(skipped[1]) == 2  # the puck has no scene for a camera


def test_the_guides_comparison_reaches_the_goals(folder):
    shares = ast.literal_eval(re.sub(r"\s+", ",", run(folder, "compare.py").strip("[] \n")))
    assert sorted(shares) == list(shares)
    assert shares[-1] >= 0.9


def test_one_line_puts_it_into_the_help_of_the_command_that_takes_it(folder):
    shown = registered(folder, "from prior_reinforce.cli import main\nmain(['adapt', '--help'])")
    told = " ".join(re.sub("[│|]", " ", shown).split())
    for _, name, member in REGISTRIES.values():
        assert f"{name} ({member.summary})" in told


def test_one_line_holds_it_to_its_contract_and_no_test_file_is_touched(folder):
    names = [name for _, name, _ in REGISTRIES.values()]
    # The line is in that process only, so no other can load a model by its name.
    chosen = f"({' or '.join(names)}) and not another_process"
    imported_before = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
    arguments = ["-v", *imported_before, "tests/testing", "-k", chosen]
    told = registered(folder, f"import pytest\nsys.exit(pytest.main({arguments!r}))")
    for name in names:
        assert len(re.findall(rf"\[.*{name}.*\] PASSED", told)) >= 4


def test_one_line_makes_it_a_name_that_takes_settings(added):
    assert make_adapter("drift,gain=0.5").gain == 0.5
    assert isinstance(make_generator("affine,timing=align"), Timed)
    assert type(make_perception("tape")).__name__ == "Tape"
    assert type(make_task("puck")).__name__ == "Puck"


@pytest.mark.parametrize("choice", ["affine", "affine,timing=start"])
def test_a_saved_generator_is_found_by_its_name(added, choice, tmp_path):
    demonstrations = synthetic_demonstrations()
    generator = make_generator(choice).fit(demonstrations, seed=0)
    generator.save(tmp_path)
    loaded = load_generator(tmp_path)
    assert type(loaded) is type(generator)
    conditions = demonstrations.outcomes_seen.mean(axis=0, keepdims=True)
    np.testing.assert_array_equal(loaded.generate(conditions), generator.generate(conditions))


def test_all_four_go_through_trials_together(added, tmp_path, capsys):
    chosen = [
        "--task",
        "puck",
        "--generator",
        "affine",
        "--adapter",
        "drift",
        "--perception",
        "tape",
    ]
    assert main(["adapt", *chosen, "--goal", "0.8", "--no-film", "--out", str(tmp_path)]) == 0
    assert "HIT" in capsys.readouterr().out


def test_the_guides_executor_moves_its_arm_and_no_faster_than_it_may(tmp_path, monkeypatch):
    (tmp_path / "slider.py").write_text(FILES["slider.py"])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(EXECUTORS.members, "slider", Member("slider:Slider", "an axis"))
    before = signal.getsignal(signal.SIGTERM)
    s = np.linspace(0, 1, 51)[:, None]
    plan = Plan(0.1 * (10 * s**3 - 15 * s**4 + 6 * s**5), PlanFormat(("rail",), ("m",), 0.02))
    try:
        for fastest, outcome in ((0.5, "done"), (0.1, "not_moved")):
            arm = ArmSettings("slider", {"port": "/dev/null", "fastest": fastest})
            result = drive(Request(arm, GateSettings(), "trial"), plan, tmp_path)
            assert result.outcome == outcome
    finally:
        signal.signal(signal.SIGTERM, before)
    measured = measure_tracking(tmp_path, plan)
    assert measured["end_error"] == {"m": pytest.approx(0.0, abs=1e-9)}
