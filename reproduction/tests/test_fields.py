from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.adapters import make_adapter
from prior_reinforce.environment import Rollout
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import make_generator
from prior_reinforce.perception import make_perception
from prior_reinforce.simulation.protocol import run_goals
from prior_reinforce.simulation.tasks import make_task
from reproduction import fields
from reproduction.fields import Change, Conditions, Field, FieldTask, measure

REGION = np.array([[0.9, -0.2], [1.1, 0.2]])


def d(conditions):
    """A smooth field of a few centimetres, by hand."""
    x, y = np.moveaxis(conditions, -1, 0)
    return 0.03 * np.stack([np.sin(8 * x) * y, np.cos(6 * y)], axis=-1)


@pytest.fixture
def field():
    x, y = np.linspace(0.85, 1.15, 9), np.linspace(-0.25, 0.25, 14)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    corners = np.array([[0.9, -0.2], [0.9, 0.2], [1.1, -0.2], [1.1, 0.2]])
    return Field(
        "by hand", grid[0, 0], np.array([x[1] - x[0], y[1] - y[0]]), d(grid),
        np.array([0.004, 0.002]), REGION, 0.015, corners, np.full((4, 2), 0.01),
        np.full((4, 2), 0.0125),
    )  # fmt: skip


def test_between_its_points_a_field_is_what_was_measured_to_half_a_millimetre(field):
    conditions = np.random.default_rng(0).uniform(*REGION, size=(50, 2))
    np.testing.assert_allclose(field.at(conditions), d(conditions), atol=5e-4)


def test_beyond_its_grid_it_is_what_it_is_at_the_edge(field):
    edge, beyond = np.array([[1.15, 0.1], [0.9, -0.25]]), np.array([[1.4, 0.1], [0.9, -0.6]])
    np.testing.assert_allclose(field.at(beyond), field.at(edge))


def test_a_field_comes_back_from_its_file(field, tmp_path):
    field.save(tmp_path / "field.npz")
    again = Field.load(tmp_path / "field.npz")
    assert (again.name, again.tolerance) == ("by hand", 0.015)
    conditions = np.random.default_rng(0).uniform(*REGION, size=(5, 2))
    np.testing.assert_array_equal(again.at(conditions), field.at(conditions))
    np.testing.assert_array_equal(again.demonstrations.outcome_noise, field.outcome_noise)
    correction = again.demonstrations.outcome_correction
    np.testing.assert_array_equal(correction, field.outcome_correction)
    with np.load(tmp_path / "field.npz") as kept:
        older = {name: array for name, array in kept.items() if name != "outcome_correction"}
    np.savez(tmp_path / "field.npz", **older)
    with pytest.raises(FileFormatError, match=r"is of an earlier version.*fresh --out"):
        Field.load(tmp_path / "field.npz")


def test_a_plan_comes_down_at_its_condition_and_the_displacement(field):
    task = FieldTask(field)
    conditions = np.array([[1.0, 0.1], [0.95, -0.1]])
    plans = Conditions().fit(task.demonstrations("own"), seed=0).generate(conditions)
    landed = [rollout.outcome for rollout in task.rollout(plans, None)]
    np.testing.assert_allclose(landed, conditions + field.at(conditions))


def test_execution_noise_is_as_wide_as_was_measured_times_its_change(field):
    task = FieldTask(field, Change(noise=2.0))
    plans = np.full((4000, 2, 2), [1.0, 0.1])
    landed = np.array([r.outcome for r in task.rollout(plans, np.random.default_rng(0))])
    np.testing.assert_allclose(landed.std(axis=0), [0.008, 0.004], rtol=0.05)


def test_changed_hardware_stretches_from_the_middle_and_shifts(field):
    plain, changed = FieldTask(field), FieldTask(field, Change(shift=(-0.06, 0.01), stretch=1.1))
    plans = np.full((1, 2, 2), [1.05, 0.1])
    (before,), (after,) = plain.rollout(plans, None), changed.rollout(plans, None)
    middle = np.array([1.0, 0.0])
    expected = middle + 1.1 * (before.outcome - middle) + [-0.06, 0.01]
    np.testing.assert_allclose(after.outcome, expected)


def test_the_share_that_is_lost_is_lost(field):
    task = FieldTask(field, Change(lost=0.3))
    plans = np.full((2000, 2, 2), [1.0, 0.1])
    rollouts = task.rollout(plans, np.random.default_rng(0))
    assert np.mean([not r.valid for r in rollouts]) == pytest.approx(0.3, abs=0.03)


def test_goals_are_reached_on_a_field_as_on_any_task(field):
    task = FieldTask(field)
    demonstrations = task.demonstrations("own")
    results = run_goals(
        task, Conditions().fit(demonstrations, seed=0), lambda: make_adapter("bayes"),
        make_perception("eye"), demonstrations, task.sample_goals(6, np.random.default_rng(0)),
        rounds=10, seed=0,
    )  # fmt: skip
    assert all(result.solved_at for result in results)


class LosingTask(FieldTask):
    def rollout(self, plans, rng):
        return [Rollout(np.zeros(2), False) for _ in plans]


def test_a_field_with_holes_is_refused(field):
    task = LosingTask(field)
    own = task.demonstrations("own")
    with pytest.raises(ConfigurationError, match="were lost; measure a smaller region"):
        measure(task, Conditions().fit(own, seed=0), own, "holes", seed=0)


def test_measuring_a_field_finds_the_field(field):
    task = FieldTask(field)
    own = task.demonstrations("own")
    found = measure(task, Conditions().fit(own, seed=0), own, "again", seed=0)
    conditions = np.random.default_rng(0).uniform(*REGION, size=(50, 2))
    np.testing.assert_allclose(found.at(conditions), d(conditions), atol=1e-3)
    np.testing.assert_allclose(found.noise_sd, field.noise_sd, rtol=0.5)


@pytest.mark.slow
def test_a_field_measured_in_physics_tells_where_other_plans_land(monkeypatch):
    monkeypatch.setattr(fields, "SPACING", 0.08)
    task = make_task("basketball-v1")
    own = task.demonstrations("A")
    known = np.linspace(-0.01, 0.02, own.outcomes_seen.size).reshape(own.outcomes_seen.shape)
    own = replace(own, outcome_correction=known)
    generator = make_generator("interpolation,timing=align").fit(own, seed=0)
    field = measure(task, generator, own, "V1", seed=0)
    conditions = task.sample_goals(20, np.random.default_rng(0))
    landed = [r.outcome for r in task.rollout(generator.generate(conditions), None)]
    np.testing.assert_array_equal(field.outcome_correction, known)
    off = conditions + field.at(conditions) - landed
    assert np.sqrt(np.mean(off**2)) < 0.003
