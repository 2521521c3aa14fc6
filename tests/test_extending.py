"""A member of each family, added as one file (an example's) and one line in its registry."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.adapters import ADAPTERS, make_adapter
from prior_reinforce.cli import main
from prior_reinforce.generators import GENERATORS, load_generator, make_generator
from prior_reinforce.perception import PERCEPTIONS, make_perception
from prior_reinforce.registry import Member
from prior_reinforce.tasks import TASKS, make_task
from prior_reinforce.testing import synthetic_demonstrations, tiny_networks

REPOSITORY = Path(__file__).parents[1]
EXAMPLES = REPOSITORY / "examples"
ADDED = {
    "ridge": (ADAPTERS, Member("own_adapter:RidgeAdapter", "affine, by ridge regression")),
    "softmax-blend": (GENERATORS, Member("own_generator:SoftmaxBlend", "neighbours blended")),
    "overhead": (PERCEPTIONS, Member("own_perception:OverheadCamera", "with parallax")),
    "toss": (TASKS, Member("own_task:Toss", "a catapult")),
}
ELSEWHERE = f"""
import sys
sys.path.insert(0, {str(EXAMPLES)!r})
from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.generators import GENERATORS
from prior_reinforce.perception import PERCEPTIONS
from prior_reinforce.registry import Member
from prior_reinforce.tasks import TASKS
""" + "\n".join(
    f"{registry.family.upper()}S.members[{name!r}] = {member!r}"
    for name, (registry, member) in ADDED.items()
)
"""The same four lines, for a process of its own: as if they stood in the families' files."""


@pytest.fixture(autouse=True)
def added(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    for name, (registry, member) in ADDED.items():
        monkeypatch.setitem(registry.members, name, member)


def elsewhere(code):
    """Run code in a process whose registries have the four more; what it printed."""
    done = subprocess.run(
        [sys.executable, "-c", f"{ELSEWHERE}\n{code}"],
        capture_output=True,
        text=True,
        cwd=REPOSITORY,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_all_appear_in_the_help_of_the_command_that_takes_them():
    help_of = "from prior_reinforce.cli import main\nmain(['adapt', '--help'])"
    shown = "".join(c for c in elsewhere(help_of) if c.isalnum())  # whatever the box and its lines
    for name, (_, member) in ADDED.items():
        told = "".join(c for c in f"{name}{member.summary}" if c.isalnum())
        assert told in shown, name


def test_all_are_made_by_name_with_settings():
    assert make_adapter("ridge,penalty=0.5").penalty == 0.5
    assert make_generator("softmax-blend,neighbours=3,width=0.5").config.neighbours == 3
    assert make_perception("overhead,noise_sd=0.0,height=2.0").height == 2.0
    assert type(make_task("toss")).__name__ == "Toss"


def test_all_are_held_to_their_contracts_and_no_test_file_is_touched():
    folder = str(Path(__file__).parent / "testing")
    choice = " or ".join(ADDED)
    run = f"import pytest\nsys.exit(pytest.main(['-q', '-n0', {folder!r}, '-k', {choice!r}]))"
    passed = elsewhere(run)
    for name in ADDED:
        assert name in passed or " passed" in passed


def test_a_saved_generator_is_found_by_its_name(tmp_path):
    demonstrations = synthetic_demonstrations()
    generator = make_generator("softmax-blend,width=0.5").fit(demonstrations, seed=0)
    generator.save(tmp_path)
    loaded = load_generator(tmp_path)
    assert loaded.config == generator.config
    conditions = demonstrations.outcomes_seen.mean(axis=0, keepdims=True)
    np.testing.assert_array_equal(loaded.generate(conditions), generator.generate(conditions))


def test_an_adapter_joins_the_comparison_of_adapters(tmp_path, capsys):
    with tiny_networks():
        command = ["reproduce", "adapters", "--goals", "1", "--seeds", "0", "--include", "ridge"]
        assert main([*command, "--out", str(tmp_path)]) == 0
    figures = json.loads((tmp_path / "adapters.json").read_text())
    assert "ridge" in figures["success"]
    assert "ridge" in capsys.readouterr().out


def test_a_generator_joins_the_comparison_of_first_throws(tmp_path, capsys):
    with tiny_networks():
        command = ["reproduce", "zero-shot", "--quick", "--include", "softmax-blend"]
        assert main([*command, "--out", str(tmp_path)]) == 0
    assert "softmax-blend" in capsys.readouterr().out


def test_task_generator_adapter_and_perception_go_through_trials_together(tmp_path, capsys):
    chosen = ["--task", "toss", "--generator", "softmax-blend", "--adapter", "ridge"]
    level = "overhead,ball_height=0.0,noise_sd=0.0"  # else its bias, of centimetres, stays
    aim = ["--goal", "1.10", "0.05", "--no-film", "--out", str(tmp_path)]
    assert main(["adapt", *chosen, "--perception", level, *aim]) == 0
    assert "HIT" in capsys.readouterr().out
