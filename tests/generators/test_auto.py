"""What demonstrations ask for: said, kept, and exact at the demonstrations."""

from collections import Counter

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import load_generator, make_generator
from prior_reinforce.generators.auto import Auto
from prior_reinforce.generators.diffusion import DiffusionGenerator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.lab.tasks import make_task
from prior_reinforce.plans import motions, timeline
from prior_reinforce.plans.motions import Demonstrations
from tests.generators.test_patterns import throws


@pytest.mark.parametrize("task", ["zoo-push", "zoo-gripper", "zoo-strike"])
def test_one_pattern_is_learned_in_closed_form_and_comes_back(task):
    demos = make_task(task).demonstrations("mixed-8-0")
    made = Auto().fit(demos, seed=0)
    assert isinstance(made.generator.generator, SmoothInterpolation)
    off = made.generate(demos.outcomes_seen) - demos.plans
    assert np.sqrt(np.mean(off**2, axis=1)).max() < 1e-4
    assert made.remarks[0].startswith("generator: closed form")
    assert made.remarks[1].startswith("timing:")


def test_the_larger_pattern_is_learned_and_the_odd_ones_are_named():
    demos = throws((1, -1, 1, 1, 1, 1))
    made = Auto().fit(demos, seed=0)
    assert "demonstrations 2 move in another way" in made.remarks[0]
    kept = [0, 2, 3, 4, 5]
    np.testing.assert_allclose(
        made.generate(demos.outcomes_seen[kept]), demos.plans[kept], atol=1e-4
    )


def test_patterns_too_small_to_stand_alone_go_to_diffusion(monkeypatch):
    started = []
    monkeypatch.setattr(DiffusionGenerator, "_fit", lambda self, *a: started.append(self))
    made = Auto().fit(throws((1, -1, -1, 1, 1, -1)), seed=0)
    assert len(started) == 1
    assert made.remarks[0] == (
        "generator: diffusion, since the demonstrations show 2 patterns that do not mix: "
        "1, 4, 5; 2, 3, 6"
    )


def test_it_is_loaded_as_it_was_learned(tmp_path):
    demos: Demonstrations = make_task("zoo-slide").demonstrations("tempo-5-1")
    made = make_generator("auto").fit(demos, seed=0)
    made.save(tmp_path)
    loaded = load_generator(tmp_path)
    assert loaded.remarks == made.remarks
    np.testing.assert_array_equal(
        loaded.generate(demos.outcomes_seen), made.generate(demos.outcomes_seen)
    )


def test_a_large_pattern_with_outcomes_on_a_line_goes_to_diffusion_with_the_rest(monkeypatch):
    demos = throws((1, 1, 1, 1, 1, 1))
    plans, outcomes = demos.plans.repeat(2, axis=0)[:9].copy(), np.zeros((9, 2))
    plans[5:] *= -1
    outcomes[:5, 0] = [0.7, 0.8, 0.9, 1.0, 1.1]
    outcomes[5:] = [[0.9, 0.3], [0.8, -0.3], [1.0, 0.2], [0.85, -0.2]]
    monkeypatch.setattr(DiffusionGenerator, "_fit", lambda *a: None)
    made = Auto().fit(Demonstrations(plans[:8], outcomes[:8], demos.format), seed=0)
    assert made.remarks[0].startswith("generator: diffusion")


def test_ways_that_do_not_mix_are_each_learned_in_closed_form(tmp_path):
    """A plan is of the way with the nearest outcome: nothing of the other is in it."""
    demos = make_task("zoo-sidearm").demonstrations("ways-12-101")
    made = Auto().fit(demos, seed=0)
    assert "within each of 2 patterns that do not mix" in made.remarks[0]
    off = made.generate(demos.outcomes_seen) - demos.plans
    assert np.sqrt(np.mean(off**2, axis=1)).max() < 1e-3
    goals = make_task("zoo-sidearm").sample_goals(20, np.random.default_rng(7000))
    landed = make_task("zoo-sidearm").rollout(made.generate(goals), None)
    errors = [np.linalg.norm(r.outcome - goal) for r, goal in zip(landed, goals, strict=True)]
    assert np.max(errors) < 0.1  # of all twelve mixed, a third of a metre in the median
    made.save(tmp_path)
    np.testing.assert_array_equal(load_generator(tmp_path).generate(goals), made.generate(goals))


@pytest.mark.parametrize("setting", ["timing=align", "correction=spline"])
def test_what_it_chooses_itself_is_not_set(setting):
    with pytest.raises(ConfigurationError, match="auto chooses its timing itself"):
        make_generator(f"auto,{setting}")


def test_demonstrations_are_analysed_once_and_decomposed_once_for_each_timing(monkeypatch):
    register, analyse, done = timeline.register, motions.analyse, Counter()

    def counted(profiles, kind, decisive):
        done[kind] += 1
        return register(profiles, kind, decisive)

    def analysed(*arguments):
        done["signals"] += 1
        return analyse(*arguments)

    monkeypatch.setattr(timeline, "register", counted)
    monkeypatch.setattr(motions, "analyse", analysed)
    Auto().fit(make_task("basketball-v1").demonstrations("A"), seed=0)
    assert done == {"signals": 1, "none": 1, "start": 1, "tempo": 1}
