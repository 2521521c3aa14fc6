"""Outcomes that do not fit their motions are doubted, and no others."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.recordings.fit import slips
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.simulation.tasks import make_task

DRAWN = Path(__file__).parents[3] / "reproduction/src/reproduction/demonstrations/drawn"


def named(n):
    return tuple(f"throw_{i}" for i in range(n))


@pytest.mark.slow
def test_two_rows_that_were_exchanged_are_doubted_and_no_others():
    shown = make_task("fishing").demonstrations("A")
    outcomes, found = shown.outcomes_seen.copy(), 0
    for i, j in combinations(range(shown.n), 2):
        other = outcomes.copy()
        other[[i, j]] = other[[j, i]]
        doubted = slips(replace(shown, outcomes_seen=other), named(shown.n))
        assert [slip.rows for slip in doubted] in ([], [(i, j)])
        found += len(doubted)
    assert found >= 8


@pytest.mark.parametrize(
    "task", ["basketball-v1", "basketball-fr3", "curling", "curling-round", "fishing", "so101"]
)
@pytest.mark.parametrize("which", ["A", "B"])
def test_sets_that_are_right_are_not_doubted(task, which):
    shown = make_task(task).demonstrations(which)
    assert slips(shown, named(shown.n)) == []


@pytest.mark.parametrize("game", ["basketball", "curling", "fishing"])
def test_sets_that_were_drawn_are_not_doubted(game):
    paths = sorted(DRAWN.glob(f"{game}_v*.npz"))
    assert len(paths) >= 20
    sets = [Demonstrations.load(path) for path in paths]
    assert [slip for shown in sets for slip in slips(shown, named(shown.n))] == []


def plain(parts):
    """Motions of two parts, each of which moves one component of the outcome."""
    shown = make_task("curling").demonstrations("A")
    ways = np.arange(1.0, 15.0).reshape(2, 7) / 10
    plans = np.linspace(0, 1, shown.plans.shape[1])[:, None] * (parts @ ways)[:, None, :]
    nothing = np.zeros(parts.shape)
    return replace(
        shown, plans=plans, outcomes_seen=(0.9, 0.0) + parts * (0.1, 0.2),
        outcome_noise=nothing, outcome_correction=nothing,
    )  # fmt: skip


def text_order(n):
    return sorted(range(n), key=lambda i: named(n)[i])


@pytest.mark.filterwarnings("ignore:an outcome of")
@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda seen: seen[np.argsort(text_order(len(seen)))], "names in the order 1, 10, 11, 2"),
        (lambda seen: seen[text_order(len(seen))], "may stand in the order 1, 10, 11, 2"),
        (lambda seen: seen[::-1], "all outcomes may stand in reverse"),
        (lambda seen: np.abs(seen), "all of y may have lost their signs"),
        (lambda seen: seen * (1, -1) * np.sign(seen), "all of y may have lost their signs"),
    ],
)
def test_slips_of_all_rows_are_named(wrong, says):
    shown = plain(np.random.default_rng(0).uniform(-1, 1, (12, 2)))
    assert slips(shown, named(12)) == []
    outcomes = wrong(shown.outcomes_seen)
    (slip,) = slips(replace(shown, outcomes_seen=outcomes), named(shown.n))
    assert says in slip.what
    assert slip.rows == tuple(range(shown.n))


def test_an_exchange_among_six_is_doubted_where_it_is_plain():
    shown = plain(np.array([(-1, -1), (-1, 1), (0, -0.5), (0.2, 0.6), (1, -1), (0.9, 0.9)]))
    assert slips(shown, named(6)) == []
    wrong = shown.outcomes_seen[[0, 1, 2, 4, 3, 5]]
    (slip,) = slips(replace(shown, outcomes_seen=wrong), named(6))
    assert slip.what == "throw_3 and throw_4 may have each other's outcome"


@pytest.mark.filterwarnings("ignore:an outcome of")
@pytest.mark.parametrize("factor", [10.0, 100.0])
def test_a_decimal_point_is_named_with_its_row(factor):
    shown = make_task("fishing").demonstrations("A")
    outcomes = np.array(shown.outcomes_seen)
    outcomes[2, 0] *= factor
    (slip,) = slips(replace(shown, outcomes_seen=outcomes), named(shown.n))
    assert slip.rows == (2,)
    assert f"of throw_2, {outcomes[2, 0]:.4g}, may be {factor:g} times too large" in slip.what
    assert slip.better > 1


def test_an_outcome_on_the_axis_has_no_sign_to_lose():
    shown = make_task("fishing").demonstrations("A")
    outcomes = np.array(shown.outcomes_seen)
    outcomes[2, 1] = 0.0
    slips(replace(shown, outcomes_seen=outcomes), named(shown.n))


@pytest.mark.filterwarnings("ignore:an outcome of")
def test_a_forgotten_first_outcome_is_told_although_a_strangers_fills_the_last_row():
    shown = plain(np.random.default_rng(3).uniform(-1, 1, (8, 2)))
    outcomes = np.vstack([shown.outcomes_seen[1:], [[1.02, -0.11]]])
    (slip,) = slips(replace(shown, outcomes_seen=outcomes), named(8))
    assert slip.what == "outcomes from throw_0 on may stand one row too high"


def test_two_signs_that_were_lost_are_named():
    shown = plain(np.random.default_rng(11).uniform(-1, 1, (10, 2)))
    outcomes = np.array(shown.outcomes_seen)
    lost = tuple(np.flatnonzero(outcomes[:, 1] < -0.06)[:2].tolist())
    outcomes[list(lost), 1] *= -1
    (slip,) = slips(replace(shown, outcomes_seen=outcomes), named(10))
    assert slip.rows == lost
    assert "may have lost their signs" in slip.what


@pytest.mark.filterwarnings("ignore:an outcome of")
def test_a_number_that_is_too_small_is_said_to_be_and_its_row_to_be_looked_at():
    shown = plain(np.random.default_rng(5).uniform(-1, 1, (8, 2)))
    outcomes = np.array(shown.outcomes_seen)
    outcomes[3] /= 10
    (slip,) = slips(replace(shown, outcomes_seen=outcomes), named(8))
    assert slip.rows == (3,)
    assert "may be 10 times too small; look at the other numbers of its row" in slip.what
