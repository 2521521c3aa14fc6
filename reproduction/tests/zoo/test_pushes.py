"""Known pushes stop where the formula says."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from reproduction.zoo.physics import GRAVITY
from reproduction.zoo.pushes import Curl, Push, Slide, Strike


def outcome(task, plan):
    (rollout,) = task.rollout(plan[None], None)
    assert rollout.valid
    return rollout.outcome


def straight(task, speed, length, heading=0.0, frames=60):
    """Increments of a push at one speed [m/s] over a length [m], the bar turned first."""
    plan = np.zeros((frames, 3))
    plan[0, 2] = heading
    n = round(length / speed / task.format.dt)
    plan[1 : 1 + n, :2] = speed * task.format.dt * np.array([np.cos(heading), np.sin(heading)])
    return plan


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_a_puck_leaves_a_bar_that_stops_and_slides_v_squared_over_two_mu_g(speed):
    task = Push()
    x, y = outcome(task, straight(task, speed, length=0.2))
    pushed = task.bar[0] + 0.2 + task.radius  # as far as the bar's face carries it
    assert x - pushed == pytest.approx(speed**2 / (2 * task.friction * GRAVITY), abs=0.005)
    assert y == 0.0


def test_a_turned_bar_pushes_along_its_face_and_a_mirrored_plan_mirrors():
    task = Push()
    x, y = outcome(task, straight(task, 0.8, 0.2, heading=0.1))
    assert np.arctan2(y, x - task.puck[0]) == pytest.approx(0.1, abs=0.02)
    mirrored = straight(task, 0.8, 0.2, heading=-0.1)
    np.testing.assert_allclose(outcome(task, mirrored), [x, -y], atol=1e-9)


def test_a_push_by_increments_is_the_same_whenever_it_begins():
    task = Push()
    plan = task.demonstrations("clean-6-0").plans[0]
    later = np.concatenate([np.zeros((9, 3)), plan[:-9]])
    np.testing.assert_allclose(outcome(task, later), outcome(task, plan), atol=1e-9)


def test_a_bar_that_does_not_reach_the_puck_moves_nothing():
    task = Push()
    (rollout,) = task.rollout(straight(task, 0.5, 0.02)[None], None)
    assert not rollout.valid


def test_friction_takes_its_integral_from_a_disc():
    """Against the equation of motion of a disc that slides over the waves."""
    task = Slide()
    start, speed = 0.1, 1.4

    def motion(_, state):
        return [state[1], -task.braking(np.array(state[:1]))[0]]

    def rest(_, state):
        return state[1]

    rest.terminal = True
    path = solve_ivp(motion, (0, 10), [start, speed], events=rest, rtol=1e-10, atol=1e-9)
    stopped = path.y_events[0][0][0]
    before, after = task.work(np.array([start, stopped]))
    assert after - before == pytest.approx(speed**2 / 2, abs=1e-6)


def test_a_disc_leaves_a_cue_that_brakes_as_hard_as_the_table():
    """x = v t - c t^3 brakes with 6 c t, and friction with mu g."""
    task = Slide()
    task.worn = 0.0
    v, c, braking = 1.2, 1.0, task.friction * GRAVITY
    times = np.arange(30) * task.format.dt
    t = braking / (6 * c)
    speed = v - 3 * c * t**2
    expected = v * t - c * t**3 + speed**2 / (2 * braking)
    stopped = task._execute((v * times - c * times**3)[:, None], np.zeros(2))
    assert stopped == pytest.approx(expected, abs=1e-6)


def test_a_worn_table_moves_a_disc_by_centimetres():
    worn, even = Slide(), Slide()
    even.worn = 0.0
    plans = worn.demonstrations("clean-6-0").plans
    off = [outcome(worn, plan)[0] - outcome(even, plan)[0] for plan in plans]
    assert np.ptp(off) > 0.02
    later = np.concatenate([np.repeat(plans[0][:1], 6, axis=0), plans[0][:-6]])
    np.testing.assert_allclose(outcome(worn, later), outcome(worn, plans[0]), atol=1e-3)


def stroke(task, spin):
    """Increments of x = v t - c t^3 under a constant spin, and where and how fast it lets go."""
    v, c = 1.2, 0.4
    times = np.arange(60) * task.format.dt
    path = np.stack([v * times - c * times**3, 0 * times, spin * times], axis=1)
    time = task.friction * GRAVITY / (6 * c)
    place = v * time - c * time**3
    return np.diff(path, axis=0, prepend=path[:1]), place, v - 3 * c * time**2


@pytest.mark.parametrize("spin", [0.0, 0.8, -2.0])
def test_a_curling_stone_stops_where_its_equation_of_motion_does(spin):
    task = Curl()
    plan, place, speed = stroke(task, spin)
    braking = task.friction * GRAVITY

    def motion(_, state):
        _, _, v, heading = state
        return [v * np.cos(heading), v * np.sin(heading), -braking, task.curl * spin / v]

    until = speed / braking * (1 - 1e-6)
    path = solve_ivp(motion, (0, until), [place, 0.0, speed, 0.0], rtol=1e-9, atol=1e-12)
    stopped = task._execute(plan, np.zeros(2))
    np.testing.assert_allclose(stopped, path.y[:2, -1], atol=1e-5)


def test_a_stone_that_is_spun_to_the_left_curls_to_the_left():
    task = Curl()
    left, straight, right = (task._execute(stroke(task, s)[0], np.zeros(2)) for s in (1, 0, -1))
    assert left[1] > 0.05
    np.testing.assert_allclose(right, left * [1, -1], atol=1e-9)
    assert straight[0] > left[0]


def test_a_putt_leaves_the_putter_with_its_speed_times_one_and_a_half():
    task = Strike()
    task.bandwidth = None
    pace = -2.0  # the arm hangs: it swings forward as it leans back
    contact = np.arcsin(task.radius / 0.60)
    plan = np.zeros((120, 4))
    plan[:, 1] = contact + pace * (np.arange(120) * 0.01 - 0.5)
    # The face is level where the arm hangs; its way to the ball is shorter by the lean's cosine.
    face_speed = 0.60 * abs(pace) * np.cos(contact)
    rolled = (1.5 * face_speed) ** 2 / (2 * task.friction * GRAVITY)
    assert task.execute(plan) == pytest.approx([rolled, 0.0], abs=1e-4)
    aside = plan + np.eye(4)[0] * 0.4
    np.testing.assert_allclose(
        task.execute(aside), rolled * np.array([np.cos(0.4), np.sin(0.4)]), atol=1e-4
    )


def test_a_putter_that_passes_above_the_ball_misses_it():
    task = Strike()
    plan = np.zeros((120, 4))
    plan[:, 1] = 0.6 - 2.0 * np.arange(120) * 0.01
    plan[:, 2] = 1.2  # the elbow bent: the putter is 12 cm up
    assert not task.rollout(plan[None], None)[0].valid


@pytest.mark.parametrize("task", [Curl(), Strike()], ids=lambda task: task.name)
def test_a_stroke_is_the_same_whenever_it_begins(task):
    plan = task.demonstrations("clean-6-0").plans[0]
    first = plan[:1] if isinstance(task, Strike) else np.zeros((1, 3))
    later = np.concatenate([np.repeat(first, 5, axis=0), plan[:-5]])
    np.testing.assert_allclose(outcome(task, later), outcome(task, plan), atol=2e-4)
