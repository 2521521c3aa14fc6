"""Timing apart from the motion, for any generator: nothing is lost, whatever was recorded."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.generators import load_generator, make_generator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.generators.network.codec import PlanCodec
from prior_reinforce.generators.network.config import DiffusionConfig, UNetSize
from prior_reinforce.generators.network.diffusion import DiffusionGenerator
from prior_reinforce.generators.timing.alignment import align
from prior_reinforce.generators.timing.timed import Timed
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.simulation.tasks import make_task

STARTS = [5, 31, 12, 44]


def demonstrations(*, plans=None, horizon=90, names=("a", "b", "c")):
    """Minimum-jerk swings of 40 frames that start at STARTS, two joints and a constant one."""
    phase = np.clip((np.arange(horizon)[None] - np.array(STARTS)[:, None]) / 40, 0, 1)
    swing = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    size = np.array([0.9, 1.0, 1.1, 0.95])[:, None]
    if plans is None:
        plans = np.stack([0.2 + size * swing, 1.5 - 0.7 * size * swing, 0 * swing + 0.3], axis=-1)
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.1], [1.0, 0.2]])
    return Demonstrations(plans, outcomes, PlanFormat(names, ("rad",) * 3, 0.0125))


class Recall(SmoothInterpolation):
    """Its demonstrations through the codec, exactly or at chosen codes; keeps what it was given."""

    name = "recall"

    def _fit(self, demonstrations, seed, progress):
        super()._fit(demonstrations, seed, progress)
        self.learned = demonstrations
        self.codec = PlanCodec.fit(
            demonstrations,
            representation="splines",
            frames_per_point=4,
            length_multiple=4,
            margin=0.05,
        )
        self.codes = self.codec.encode(demonstrations.plans)

    def _generate(self, conditions):
        return self.codec.decode(self.codes)


def recalled(demos):
    timed = Timed(Recall(), "start").fit(demos, seed=0)
    return timed, timed.generate(demos.outcomes_seen)


@pytest.mark.slow
@pytest.mark.parametrize("timing", ["auto", "start", "tempo"])
@pytest.mark.parametrize("horizon", [90, 55], ids=["rest to rest", "cut in mid-swing"])
def test_plans_come_back_as_recorded(timing, horizon):
    demos = demonstrations(plans=demonstrations().plans[:, :horizon])
    timed = Timed(SmoothInterpolation(), timing).fit(demos, seed=0)
    plans = timed.generate(demos.outcomes_seen)
    assert np.sqrt(np.mean((plans - demos.plans) ** 2, axis=1)).max() < 1e-4


def test_what_was_chosen_is_said_and_kept_on_disk(tmp_path):
    timed = Timed(SmoothInterpolation()).fit(demonstrations(), seed=0)
    assert timed.remarks[0].startswith(
        "timing: when to start is learned separately from the motion, as a rule"
    )
    timed.save(tmp_path)
    assert load_generator(tmp_path).remarks == timed.remarks


def test_plans_come_back_from_control_points():
    demos = demonstrations()
    _, plans = recalled(demos)
    np.testing.assert_allclose(plans, demos.plans, atol=3e-3)


@pytest.mark.parametrize("names", [("a", "b", "c"), ("a", "start", "c")])
def test_the_motions_start_together_and_one_more_dimension_says_when(names):
    timed, _ = recalled(demonstrations(names=names))
    learned = timed.generator.learned
    assert learned.action_dim == 4
    assert learned.format.per_plan == learned.format.names[3:]
    np.testing.assert_allclose(np.ptp(learned.plans[:, 0, 3]), max(STARTS) - min(STARTS), atol=0.1)
    # The same swing but for its size: without its start time it is the same but for a scale.
    shapes = learned.plans[:, :, 0] - learned.plans[:, :1, 0]
    shapes /= np.linalg.norm(shapes, axis=1, keepdims=True)
    assert np.all(shapes @ shapes.T > 0.999)


def test_between_two_demonstrations_is_a_swing_of_full_speed():
    """Averaging frames would halve the peak speed of two swings that do not overlap."""
    demos = demonstrations()
    timed, _ = recalled(demos)
    recall = timed.generator
    recall.codes = recall.codes[[0, 3]].mean(axis=0, keepdims=True)
    middle = timed.generate(demos.outcomes_seen[:1])[0]
    speed = np.abs(np.diff(middle[:, 0]))
    demonstrated = np.abs(np.diff(demos.plans[[0, 3], :, 0], axis=1)).max(axis=1)
    assert speed.max() > 0.98 * demonstrated.min()
    assert np.argmax(speed) == pytest.approx((STARTS[0] + STARTS[3]) / 2 + 20, abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["A", "B"])
def test_a_trembling_hand_is_not_jerked_where_its_tremor_is_held(name):
    """Cut in mid-swing, the shipped curling sets' tremor would jerk the wrist."""
    demos = make_task("curling").demonstrations(name)
    _, plans = recalled(demos)
    jolts = np.abs(np.diff(plans, n=2, axis=1)).max(axis=(0, 1))
    shown = np.abs(np.diff(demos.plans, n=2, axis=1)).max(axis=(0, 1))
    assert np.all(jolts <= 1.1 * shown)


def test_aligned_it_generates_what_the_generator_learned_from_aligned_ones_does():
    demos = demonstrations()
    timed = Timed(SmoothInterpolation(), "align").fit(demos, seed=0)
    plain = SmoothInterpolation().fit(align(demos).demonstrations, seed=0)
    conditions = np.array([[0.9, 0.1], [0.95, -0.1]])
    np.testing.assert_array_equal(timed.generate(conditions), plain.generate(conditions))


@pytest.mark.slow
@pytest.mark.parametrize("timing", ["start", "align"])
def test_it_is_saved_with_the_generator_within(timing, tmp_path):
    demos = demonstrations()
    size = UNetSize(widths=(8, 16), groups=2, step_width=8, condition_width=8)
    inner = DiffusionGenerator(DiffusionConfig(network=size, training_steps=2))
    timed = Timed(inner, timing).fit(demos, seed=0)
    timed.save(tmp_path)
    conditions = np.array([[0.9, 0.1]])
    for loaded in (load_generator(tmp_path), Timed.load(tmp_path)):
        assert isinstance(loaded, Timed)
        assert isinstance(loaded.generator, DiffusionGenerator)
        assert loaded.timing == timing
        np.testing.assert_array_equal(loaded.generate(conditions), timed.generate(conditions))
    with pytest.raises(FileFormatError, match="timed"):
        DiffusionGenerator.load(tmp_path)


def test_timing_is_one_of_its_names_and_once():
    with pytest.raises(ConfigurationError, match="late"):
        Timed(SmoothInterpolation(), "late")
    with pytest.raises(ConfigurationError, match="once"):
        Timed(make_generator("diffusion"))


def test_what_is_one_number_a_plan_stays_one_for_the_generator_within():
    demos = demonstrations()
    demos = replace(demos, format=replace(demos.format, per_plan=("c",)))
    timed, _ = recalled(demos)
    assert timed.generator.learned.format.per_plan[0] == "c"
