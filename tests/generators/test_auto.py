"""What demonstrations ask for: said, kept, and exact at the demonstrations."""

import warnings
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators import make_generator
from prior_reinforce.generators.auto import Auto
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.generators.timing.registration import Motions
from prior_reinforce.plans import motions
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import declare_symmetry
from prior_reinforce.simulation.tasks import make_task
from tests.generators.test_patterns import throws


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


def test_a_large_pattern_with_outcomes_on_a_line_goes_to_diffusion_with_the_rest(monkeypatch):
    demos = throws((1, 1, 1, 1, 1, 1))
    plans, outcomes = demos.plans.repeat(2, axis=0)[:9].copy(), np.zeros((9, 2))
    plans[5:] *= -1
    outcomes[:5, 0] = [0.7, 0.8, 0.9, 1.0, 1.1]
    outcomes[5:] = [[0.9, 0.3], [0.8, -0.3], [1.0, 0.2], [0.85, -0.2]]
    monkeypatch.setattr(DiffusionGenerator, "_fit", lambda *a: None)
    made = Auto().fit(Demonstrations(plans[:8], outcomes[:8], demos.format), seed=0)
    assert made.remarks[0].startswith("generator: diffusion")


@pytest.mark.parametrize("n", [2, 3])
def test_outcomes_almost_on_a_line_are_warned_of_where_no_symmetry_tells_the_rest(n):
    shown = throws((1,) * 6).only(range(3))
    along = np.array([0.0, 0.1, 0.2])
    outcomes = np.column_stack([0.8 + along, 0.1 + along + [0.0, 0.001, 0.0]])[:n]
    demos = Demonstrations(shown.plans[:n], outcomes, shown.format)
    with pytest.warns(UserWarning, match="demonstrate one well beside it") as warned:
        make_generator("auto").fit(demos, seed=0)
    assert [each.filename for each in warned] == [__file__]
    form = PlanFormat(("x", "y"), ("m", "m"), 0.02)
    turned = replace(demos, format=form, symmetry=declare_symmetry(form, 2, about="base"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make_generator("auto").fit(turned, seed=0)


def test_what_it_chooses_itself_is_not_set():
    with pytest.raises(ConfigurationError, match="auto chooses its timing itself"):
        make_generator("auto,timing=align")


def test_a_device_may_be_chosen_before_it_is_fitted():
    assert isinstance(Auto().to("cpu"), Auto)


def test_demonstrations_are_analysed_once_and_decomposed_once_for_each_timing(monkeypatch):
    register, analyse, done = Motions.register, motions.analyse, Counter()

    def counted(self, kind, *some):
        done[kind] += 1
        return register(self, kind, *some)

    def analysed(*arguments):
        done["signals"] += 1
        return analyse(*arguments)

    monkeypatch.setattr(Motions, "register", counted)
    monkeypatch.setattr(motions, "analyse", analysed)
    Auto().fit(make_task("basketball-v1").demonstrations("A"), seed=0)
    assert done == {"signals": 1, "none": 1, "start": 1, "tempo": 1}
