"""Timing is chosen by what tells outcomes, and starts are learned apart where nothing tells."""

import numpy as np
import pytest

from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.timing import evidence
from prior_reinforce.generators.timing.evidence import choose_timing, outcome_error
from prior_reinforce.generators.timing.registration import even_subset
from prior_reinforce.generators.timing.timed import Timed
from prior_reinforce.generators.timing.timeline import decompose
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks import make_task

RNG = np.random.default_rng(0)
AIMS = RNG.uniform(-1, 1, size=(8, 2))
STARTS = RNG.uniform(20, 30, size=8)


def demonstrations(release: int | None, n: int = 8) -> Demonstrations:
    """Swings of two joints; the outcome is the state at a frame, or at the end of the motion."""
    s = np.clip((np.arange(100) - STARTS[:, None]) / 50, 0, 1)
    swing = 10 * s**3 - 15 * s**4 + 6 * s**5
    sizes = np.stack([1 + 0.3 * AIMS[:, :1], 0.6 + 0.3 * AIMS[:, 1:]])
    plans = np.stack([size * swing for size in sizes], axis=-1)
    outcomes = plans[:, -1] if release is None else plans[:, release]
    return Demonstrations(plans[:n], outcomes[:n], PlanFormat(("a", "b"), ("rad",) * 2, 0.02))


def test_a_release_that_the_motion_brings_about_asks_for_starts_apart():
    choice = choose_timing(demonstrations(None))
    assert choice.decomposition.timeline.kind == "start"
    assert "when to start is learned separately from the motion (start)" in choice.reason
    assert choice.errors["start"] == outcome_error(demonstrations(None), choice.decomposition)


def test_a_clocked_release_asks_for_plans_as_recorded():
    demos = demonstrations(42)
    errors = {kind: outcome_error(demos, decompose(demos, kind)) for kind in ("none", "start")}
    assert errors["none"] < 0.5 * errors["start"]
    choice = choose_timing(demos)
    assert choice.decomposition.timeline.kind == "none"
    assert choice.reason == (
        "timing: plans start when the demonstrations did (none), as these demonstrations ask for"
    )
    assert choice.errors == errors | {"tempo": choice.errors["tempo"]}


def test_of_many_some_tell_the_timing_by_which_all_are_learned():
    rng = np.random.default_rng(1)
    swing = np.sin(np.clip((np.arange(60) - rng.uniform(5, 20, (40, 1))) / 30, 0, 1) * np.pi / 2)
    plans = swing[..., None] * rng.uniform(0.5, 1.5, (40, 1, 2))
    form = PlanFormat(("a", "b"), ("rad",) * 2, 0.02)
    many = Demonstrations(plans, plans[:, -1], form)
    some = many.only(even_subset(40).tolist())
    choice, of_some = choose_timing(many), choose_timing(some)
    assert len(choice.decomposition.numbers) == 40
    # Channels are scaled by all, found from these same ones: from another scale to begin with.
    assert choice.errors == pytest.approx(of_some.errors, rel=1e-6)
    assert choice.reason == of_some.reason


def test_a_hand_that_opens_in_the_plan_needs_no_clock():
    """However well the arm at one frame seems to tell outcomes."""
    demos = demonstrations(42)
    opens = (np.arange(100) > np.round(STARTS)[:, None] + 30).astype(float)
    plans = np.concatenate([demos.plans, opens[:, :, None]], axis=2)
    plan_format = PlanFormat(("a", "b", "gripper"), ("rad", "rad", "m"), 0.02)
    choice = choose_timing(Demonstrations(plans, demos.outcomes_seen, plan_format))
    assert choice.errors["none"] < 0.5 * choice.errors["start"]
    assert choice.decomposition.timeline.kind == "start"


def test_people_who_start_when_they_like_keep_to_no_clock():
    """However well plans as recorded seem to tell outcomes."""
    demos = demonstrations(42)
    late = [np.pad(plan, ((0, 15 * (i % 4)), (0, 0)), "edge") for i, plan in enumerate(demos.plans)]
    plans = np.stack([np.pad(p, ((145 - len(p), 0), (0, 0)), "edge") for p in late])
    moved = Demonstrations(plans, demos.outcomes_seen, demos.format)
    assert choose_timing(moved).decomposition.timeline.kind != "none"


def test_few_demonstrations_tell_nothing():
    choice = choose_timing(demonstrations(42, n=4))
    assert choice.decomposition.timeline.kind == "start"
    assert "as a rule; 4 demonstrations cannot tell what is better" in choice.reason
    assert not choice.errors


def test_it_is_said_where_the_timing_does_not_matter():
    demos = demonstrations(None)
    together = decompose(demos, "start").shapes[:, :100]
    same = Demonstrations(together, demos.outcomes_seen, demos.format)
    assert choose_timing(same).reason.endswith("; other timings would do equally well here")


def test_it_is_said_where_the_demonstrations_do_not_tell():
    demos = demonstrations(None)
    elsewhere = np.random.default_rng(1).uniform(-1, 1, size=(8, 2))
    chance = Demonstrations(demos.plans, elsewhere, demos.format)
    assert choose_timing(chance).reason.endswith(
        "(start), as a rule; these demonstrations do not tell what is better"
    )


def test_what_does_not_move_keeps_its_timing():
    still = Demonstrations(
        np.ones((6, 20, 2)), AIMS[:6], PlanFormat(("a", "b"), ("rad",) * 2, 0.02)
    )
    choice = choose_timing(still)
    assert choice.decomposition.timeline.kind == "none"
    assert "does not move" in choice.reason


@pytest.mark.parametrize("task", ["basketball-v1", "curling", "fishing"])
@pytest.mark.parametrize("name", ["A", "B"])
def test_our_own_demonstrations_differ_in_their_starts(task, name):
    assert (
        choose_timing(make_task(task).demonstrations(name)).decomposition.timeline.kind == "start"
    )


@pytest.mark.parametrize(("untold", "kind"), [(0.3, "start"), (0.5, "none")])
def test_a_clock_is_looked_for_only_where_starts_apart_leave_much_untold(monkeypatch, untold, kind):
    errors = {"none": 0.5 * untold, "start": untold, "tempo": 0.9}
    monkeypatch.setattr(evidence, "outcome_error", lambda _, each: errors[each.timeline.kind])
    assert choose_timing(demonstrations(42)).decomposition.timeline.kind == kind


def test_plans_of_few_frames_are_timed_as_any_others():
    """Swings of 16 frames, which cannot be moved by parts of one to the last digit."""
    s = np.clip((np.arange(16) - 0.2 * STARTS[:, None]) / 8, 0, 1)
    swing = (1 + 0.3 * AIMS[:, :1]) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    plans = np.stack([swing, (1 + 0.3 * AIMS[:, 1:]) * swing], axis=-1)
    few = Demonstrations(plans, AIMS, PlanFormat(("a", "b"), ("rad",) * 2, 0.1))
    choice = choose_timing(few)
    assert choice.decomposition.timeline.kind == "start"
    assert not choice.decomposition.exact


def test_frames_that_cannot_be_moved_without_a_loss_are_learned_as_recorded():
    plans = np.random.default_rng(0).uniform(-1, 1, (6, 5, 2))
    outcomes = np.linspace([0.8, -0.2], [1.0, 0.2], 6) + [[0.0, 0.01 * (i % 2)] for i in range(6)]
    jumpy = Demonstrations(plans, outcomes, PlanFormat(("a", "b"), ("rad",) * 2, 0.02))
    choice = choose_timing(jumpy)
    assert choice.decomposition.timeline.kind == "none"
    assert "5 frames are too few" in choice.reason
    generator = Timed(SmoothInterpolation(), "start").fit(jumpy, seed=0)
    assert generator.remarks == (choice.reason,)
    np.testing.assert_allclose(generator.generate(outcomes), plans, atol=1e-9)


def test_leaving_out_in_closed_form_is_what_leaving_out_one_by_one_is():
    demos = demonstrations(42, n=7)
    decomposition = decompose(demos, "none")
    states = evidence._states(demos, decomposition)
    outcomes = demos.outcomes_seen / demos.outcomes_seen.std(axis=0)
    squares = np.zeros(len(states))
    for i in range(7):
        others = np.arange(7) != i
        mean, about = states[:, others].mean(axis=1), outcomes[others].mean(axis=0)
        x = states[:, others] - mean[:, None]
        ridge = evidence._RIDGE * np.sum(x**2, axis=(1, 2)) / 6 + 1e-12
        gram = x @ x.transpose(0, 2, 1) + ridge[:, None, None] * np.eye(6)
        weights = np.linalg.solve(gram, x @ (states[:, i] - mean)[:, :, None])[..., 0]
        squares += np.sum((about + weights @ (outcomes[others] - about) - outcomes[i]) ** 2, axis=1)
    expected = np.sort(np.sqrt(squares / 14))[: evidence._BEST].mean()
    assert outcome_error(demos, decomposition) == pytest.approx(expected, rel=1e-9)
