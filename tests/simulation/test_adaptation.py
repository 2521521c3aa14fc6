"""Readings that are kept, and films that are drawn or not."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.adapters import make_adapter
from prior_reinforce.environment import Rollout
from prior_reinforce.errors import PerceptionFailedError, RenderingUnavailableError
from prior_reinforce.generators import make_generator
from prior_reinforce.perception.exact import Exact
from prior_reinforce.session.trials import Stage, Trial
from prior_reinforce.simulation.adaptation import goal_record, recording
from prior_reinforce.simulation.protocol import GoalTrials, run_goals
from prior_reinforce.simulation.tasks import make_task


class Page:
    def save(self, folder, stem):
        (folder / f"{stem}.png").write_text("picture")


class Photographer(Exact):
    """Reads a picture each time, except where it says so."""

    last_reading = None
    out_of_order = False

    def perceive(self, rollout, goal, rng):
        if self.out_of_order:
            raise PerceptionFailedError("no picture")
        self.last_reading = Page()
        if not rollout.valid:
            raise PerceptionFailedError("nothing to be seen")
        return super().perceive(rollout, goal, rng)


GOAL = np.zeros(2)


def test_every_reading_is_kept_also_a_failed_one(tmp_path):
    camera = Photographer()
    kept = recording(camera, tmp_path / "seen", "trial")
    assert kept.perceive(Rollout(np.ones(2), True), GOAL, None).error_seen.tolist() == [1.0, 1.0]
    assert kept.latest == tmp_path / "seen" / "trial1.png"
    with pytest.raises(PerceptionFailedError, match="nothing to be seen"):
        kept.perceive(Rollout(np.ones(2), False), GOAL, None)
    assert kept.latest == tmp_path / "seen" / "trial2.png"
    camera.out_of_order = True
    with pytest.raises(PerceptionFailedError, match="no picture"):
        kept.perceive(Rollout(np.ones(2), True), GOAL, None)
    assert kept.latest is None
    assert sorted(path.name for path in (tmp_path / "seen").iterdir()) == [
        "trial1.png",
        "trial2.png",
    ]


def test_a_perception_without_pictures_stays_as_it_is(tmp_path):
    exact = Exact()
    assert recording(exact, tmp_path, "trial") is exact


@pytest.mark.slow
def test_what_a_report_tells_says_why_there_is_no_film(tmp_path, monkeypatch):
    task = make_task("basketball-v1")
    demonstrations = task.demonstrations("A")
    generator = make_generator("interpolation,timing=none").fit(demonstrations, seed=0)
    (result,) = run_goals(
        task,
        generator,
        lambda: make_adapter("frozen"),
        Exact(),
        demonstrations,
        demonstrations.outcomes_seen[:1],
        rounds=1,
        seed=0,
    )

    def film(*_):
        raise RenderingUnavailableError("no OpenGL here")

    monkeypatch.setattr(task, "film", film)
    record = goal_record(task, demonstrations, result, 1, film_in=tmp_path, seed=0)
    assert (record.film, record.film_caption) == (None, "no film: no OpenGL here")
    none = goal_record(task, demonstrations, result, 1, film_in=None, seed=0)
    assert (none.film, none.film_caption) == (None, "no film was asked for")
    assert np.array_equal(none.outcomes, [rollout.outcome for rollout in result.rollouts])


def test_the_number_of_trials_a_goal_took_does_not_depend_on_their_numbers():
    missed = Trial(7, 1, GOAL, stage=Stage.TOLD)
    hit = replace(missed, number=8, hit=True)
    assert GoalTrials(GOAL, (missed, hit), ()).solved_at == 2
    assert GoalTrials(GOAL, (missed,), ()).solved_at is None
