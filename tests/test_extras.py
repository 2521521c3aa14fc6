"""The light install: what works without any extra, and how each missing one is named."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import prior_reinforce
from prior_reinforce.extras import ALONE, EXTRA_OF, missing_extra
from tests.arm.recordings import recorded
from tests.test_dependencies import PROJECT

SOURCE = Path(prior_reinforce.__file__).parent
WITHOUT = """
import json, sys
from importlib.machinery import PathFinder

absent = set(json.loads(sys.argv[1]))

class Without(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.partition(".")[0] not in absent:
            return PathFinder.find_spec(name, path, target)

sys.meta_path = [Without if finder is PathFinder else finder for finder in sys.meta_path]
"""
"""Beginning of a program in which some libraries are not to be found."""
READERS = {"lerobot", "ros"}
"""Extras that are there in the tests below: they read two kinds of recordings."""


def light(code, *args, cwd):
    """Run a program without the libraries of any extra but `READERS`."""
    absent = [library for library, extra in EXTRA_OF.items() if extra not in READERS] + [*ALONE]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT + code, json.dumps(absent), *map(str, args)],
        cwd=cwd,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout, done.stderr


def command(*args, cwd):
    code = "from prior_reinforce.cli import main; sys.exit(main(sys.argv[2:]))"
    return light(code, *args, cwd=cwd)


def libraries(path):
    """Of all imports of a module, wherever they stand."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            yield node.module.partition(".")[0]


def test_every_library_is_required_or_an_extra_is_named_for_it():
    required = {Requirement(line).name.lower() for line in PROJECT["dependencies"]}
    imported_as = {"pillow": "pil", "typing-extensions": "typing_extensions"}
    required = {imported_as.get(name, name.replace("-", "_")) for name in required}
    brought = {
        "prior_reinforce",
        "gpytorch",
        "markupsafe",
        "docstring_parser",
        "mpl_toolkits",
        "pytest",
        "draccus",
    }
    unnamed = {
        f"{path.relative_to(SOURCE)}: {name}"
        for path in SOURCE.rglob("*.py")
        for name in libraries(path)
        if name not in sys.stdlib_module_names | EXTRA_OF.keys() | ALONE.keys() | brought
        and name.lower() not in required
    }
    assert not unnamed


@pytest.mark.parametrize("library", EXTRA_OF)
def test_an_extra_has_the_library_that_it_is_named_for(library):
    lines = PROJECT["optional-dependencies"][EXTRA_OF[library]]
    installed_as = {"cv2": "opencv_python_headless"} | dict.fromkeys(
        ("rtde_control", "rtde_receive"), "ur_rtde"
    )
    installed_as = installed_as.get(library, library)
    assert installed_as in {Requirement(line).name.replace("-", "_") for line in lines}


def test_recordings_become_a_told_trial_and_a_report_without_any_other_extra(tmp_path):
    """They are learned from whatever kind they are; what comes next knows nothing of the kind."""
    for kind in ("csv", "lerobot", "mcap"):
        (tmp_path / kind).mkdir()
    outcomes = {f"throw{i}": place for i, place in enumerate(recorded.OUTCOMES.values())}
    recorded.write_csv(tmp_path / "csv")
    recorded.write_lerobot(tmp_path / "lerobot")
    recorded.write_bags(tmp_path / "mcap", kind="mcap", count=recorded.N)
    recorded.write_outcomes(tmp_path / "csv")
    recorded.write_outcomes(tmp_path / "lerobot")
    recorded.write_outcomes(tmp_path / "mcap", outcomes)
    commands = [
        words
        for kind in ("csv", "lerobot", "mcap")
        for words in (
            ["new", f"hoop-{kind}", "--robot", "panda"],
            ["import", f"hoop-{kind}", kind],
            ["learn", f"hoop-{kind}"],
        )
    ]
    commands += [
        ["goal", "hoop-csv", "0.92", "0.03"],
        ["ask", "hoop-csv", "--out", "plan.npz"],
        ["tell", "hoop-csv", "1", "--error", "5cm long, 2cm left"],
        ["status", "hoop-csv"],
        ["report", "hoop-csv"],
    ]
    code = """
from prior_reinforce.cli import main
for words in json.loads(sys.argv[2]):
    assert main(words) == 0, words
"""
    status, out, err = light(code, json.dumps(commands), cwd=tmp_path)
    assert status == 0, out + err
    assert (tmp_path / "plan.npz").is_file()
    assert list((tmp_path / "hoop-csv").rglob("report.html"))


def test_all_commands_are_listed_without_any_extra(tmp_path):
    status, out, _ = command("--help", cwd=tmp_path)
    assert status == 0
    assert {"demo", "adapt", "look", "tell"} <= set(re.findall(r"\w+", out))


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        ("demo", "simulation"),
        ("adapt", "simulation"),
    ],
)
def test_a_command_names_the_extra_that_it_lacks_and_writes_nothing(words, extra, tmp_path):
    status, _, err = command(*words.split(), cwd=tmp_path)
    assert (status, err.count("\n")) == (2, 1), err
    assert err.endswith(f"; in your clone of the repository: pip install -e '.[{extra}]'\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("call", "extra"),
    [
        ("pr.make_generator('diffusion')", "diffusion"),
        ("pr.DiffusionGenerator()", "diffusion"),
        ("pr.make_task('basketball-v1')", "simulation"),
        ("pr.Camera", "simulation"),
        ("pr.make_perception('camera', scene=scene).perceive(rollout, [1, 0], None)", "simulation"),
    ],
)
def test_a_call_names_the_extra_that_it_lacks(call, extra, tmp_path):
    code = f"""
import prior_reinforce as pr
from prior_reinforce.errors import MissingExtraError

ball = pr.SeenObject("the orange ball", 0.06)
scene = pr.TableScene(ball, ball, 0.1)
rollout = pr.Rollout([1.0, 0.0], True, pr.KeyFrame(None, None, 0.0))
try:
    {call}
except MissingExtraError as error:
    print(error)
"""
    status, out, _ = light(code, cwd=tmp_path)
    assert status == 0
    assert out.endswith(f"'.[{extra}]'\n")


def test_what_no_extra_can_install_is_installed_by_make_and_named_in_the_docs():
    for what in ALONE.values():
        for page in ("Makefile", "docs/fr3.md"):
            assert f"--no-deps {what}" in (SOURCE.parents[1] / page).read_text()


def test_a_library_that_goes_without_its_dependencies_is_named_so():
    error = missing_extra(ModuleNotFoundError("no", name="franka_sim.server"))
    assert "pip install --no-deps franka-sim==1.1.7" in str(error)
