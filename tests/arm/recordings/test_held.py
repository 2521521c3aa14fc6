"""A lift that the robot's description holds has to stand where the recordings have it."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.recordings import import_demonstrations
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import InvalidDemonstrationsError
from tests.arm.recordings.recorded import JOINTS, OUTCOMES, N, sampled

ROBOT = replace(robot_limits("panda"), held={"lift": 0.2})
NAMES = tuple(f"panda_{joint}" for joint in JOINTS)


def written(folder, lift, called="lift", form="csv"):
    """Throws beside a lift: a number, or its way in the last two of them."""
    for i in range(N):
        t, q = sampled(i, 50.0)
        at = np.full(len(t), lift[0] if i < 4 else np.linspace(*lift, len(t)))
        if form == "csv":
            head = ",".join(("t", *NAMES, called))
            rows = np.column_stack([t, q, at])
            np.savetxt(folder / f"{i}.csv", rows, delimiter=",", header=head, comments="")
        else:
            columns = np.array([*NAMES, called])
            np.savez(folder / f"{i}.npz", t=t, positions=np.column_stack([q, at]), names=columns)
    rows = [f"{name},{x},{y}" for name, (x, y) in OUTCOMES.items()]
    (folder / "outcomes.csv").write_text("\n".join(["episode,x,y", *rows]) + "\n")
    return folder


def imported(folder, robot=ROBOT, **options):
    return import_demonstrations(folder, joints=NAMES, robot=robot, **options).demonstrations


@pytest.mark.parametrize("form", ["csv", "npz"])
@pytest.mark.parametrize(
    ("lift", "called"), [((0.2, 0.2), "lift"), ((0.203, 0.2), "lift"), ((200.0, 200.0), "lift")]
)
def test_a_lift_that_stands_where_it_is_held_says_nothing(tmp_path, lift, called, form):
    assert imported(written(tmp_path, lift, called, form)).n == N


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_lift_that_is_held_at_zero_does_not_stand_elsewhere(tmp_path, form):
    folder = written(tmp_path, (0.3, 0.3), form=form)
    with pytest.raises(InvalidDemonstrationsError, match=r"at 0.3 in 0 to 5, .* at 0: "):
        imported(folder, replace(ROBOT, held={"lift": 0.0}))


def test_a_lift_in_an_array_of_its_own_is_compared_too(tmp_path):
    folder = written(tmp_path, (0.35, 0.35), form="npz")
    for path in folder.glob("*.npz"):
        with np.load(path) as own:
            t, q = own["t"], own["positions"]
        np.savez(path, t=t, q=q[:, :-1], joint_names=np.array(NAMES), lift=q[:, -1])
    with pytest.raises(InvalidDemonstrationsError, match=r"at 0.35 in 0 to 5, "):
        imported(folder)


def test_its_unit_is_read(tmp_path):
    assert imported(written(tmp_path, (200.0, 200.0), "lift [mm]")).n == N


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_lift_that_stood_elsewhere_is_named_with_both_places(tmp_path, form):
    with pytest.raises(InvalidDemonstrationsError, match=r"at 0.35 in 0 to 5, .* at 0.2: .*--hold"):
        imported(written(tmp_path, (0.35, 0.35), form=form))


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_lift_that_moves_is_named_with_its_takes(tmp_path, form):
    folder = written(tmp_path, (0.2, 0.3), form=form)
    with pytest.raises(InvalidDemonstrationsError, match=r"lift is .* from 0.2 to 0.3 in 4 to 5, "):
        imported(folder)
    assert imported(folder, leave_out=("4", "5")).n == 4


def test_other_columns_and_other_robots_are_not_asked(tmp_path):
    folder = written(tmp_path, (0.35, 0.35))
    assert imported(folder, replace(ROBOT, held={})).n == N
    assert imported(folder, replace(ROBOT, held={"torso": 0.2})).n == N


def test_a_held_joint_is_known_by_its_whole_name(tmp_path):
    """Pitch beside Wrist_Pitch."""
    robot = replace(robot_limits("panda"), held={"Pitch": 0.2, "Wrist_Pitch": 1.0})
    folder = written(tmp_path, (1.0, 1.0), "Wrist_Pitch")
    assert imported(folder, robot).n == N
    with pytest.raises(InvalidDemonstrationsError, match=r"Wrist_Pitch is recorded at 0\.5"):
        imported(written(folder, (0.5, 0.5), "Wrist_Pitch"), robot)
