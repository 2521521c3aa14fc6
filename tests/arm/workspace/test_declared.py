"""A workspace in which one demonstration is enough."""

from dataclasses import replace

import numpy as np
import pytest

import prior_reinforce as pr
from prior_reinforce.arm.workspace.declared import DeclaredSymmetry, read_object
from prior_reinforce.arm.workspace.reaching import region_of
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    OutOfReachError,
)
from prior_reinforce.plans.kinematics import rotation
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import Amplitude, Shift, TurnJoint, TurnPath

BOX = (-0.8, -0.9, 0.4, 0.6, 0.9, 1.4)


def shown(which):
    """Demonstrations of V1 as recordings have them: nothing says how they may be moved."""
    return pr.make_task("basketball-v1").demonstrations("A").only(which).without_symmetry()


@pytest.fixture
def hoop(tmp_path):
    with Workspace.create(tmp_path / "hoop", symmetry="carried", box=BOX) as workspace:
        yield workspace


def declare(workspace, old, new):
    path = workspace.folder / "workspace.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    workspace.read_manifest()


def test_one_demonstration_is_moved_to_goals_around_it(hoop):
    hoop.import_demonstrations(shown([0]), "a throw")
    learned = hoop.learn()
    assert "the demonstration is moved to the goal" in learned.remarks[0]
    hoop.set_goal([1.20, -0.10])
    trial = hoop.session().ask()
    assert not trial.verdict.refused
    assert hoop.status().demonstrations == 1
    said = trial.verdict.text()
    assert "times as fast as demonstrated" in said
    assert "within the band" in said
    again = hoop.session().ask()
    np.testing.assert_array_equal(again.plan, trial.plan)


def test_demonstrations_that_state_a_rival_are_refused(tmp_path):
    """A trial that a rival moved would be one of a model that no workspace has learned."""
    own = pr.make_task("basketball-v1").demonstrations("A").only([0])
    rival = pr.make_task("curling").symmetry
    unsure = own.with_symmetry(replace(own.symmetry, rival=rival))
    with Workspace.create(tmp_path / "hoop", robot="panda") as workspace:
        with pytest.raises(InvalidDemonstrationsError, match=r"rival.*rival=None"):
            workspace.import_demonstrations(unsure, "a throw")
        assert not workspace.events
        workspace.import_demonstrations(own, "a throw")


def test_a_goal_out_of_reach_is_refused_with_the_nearest_that_is_not(hoop):
    hoop.import_demonstrations(shown([0]), "a throw")
    hoop.learn()
    # Farther and nearer, and the nearest lies where the goal does as seen from the base.
    for goal, nearest in (([2.2, 0.3], r"\d+"), ([2.5, 0.0], "163 cm ahead, 0 cm left"),
                          ([0.3, 0.1], "37.2 cm ahead, 12.4 cm left")):  # fmt: skip
        with pytest.raises(OutOfReachError, match=f"nearest that can be reached is {nearest}"):
            hoop.set_goal(goal)
    assert not hoop.state.goals


def test_several_say_what_they_look_turned_about(hoop):
    hoop.import_demonstrations(shown(range(6)), "throws")
    (said,) = [remark for remark in hoop.learn().remarks if remark.startswith("axis: ")]
    assert said.startswith("axis: 6 demonstrations look turned about (")
    assert " 0.01 m from the declared axis" in said
    declare(hoop, 'object = "carried"', "object = [0.43, 0.0]")
    # What is in use is another symmetry than is declared now, and learning takes it.
    with pytest.raises(InvalidDemonstrationsError, match="prior-reinforce learn"):
        _ = hoop.demonstrations
    with pytest.raises(OutOfReachError, match=r"WARNING: .* is the axis right\?"):
        hoop.learn()
    assert isinstance(hoop.demonstrations.symmetry.moves[1], TurnPath)


def test_several_on_a_line_are_enough_where_they_may_be_turned(hoop, tmp_path):
    plans, outcomes = shown([0]).plans, np.array([[0.92, -0.27]])
    form = shown([0]).format
    for i in range(2):
        np.savez(tmp_path / f"{i}.npz", t=np.arange(140) * form.dt, q=plans[0] + 1e-2 * i)
    places = {str(i): outcomes[0] * (1 + 0.1 * i) for i in range(2)}
    result = hoop.import_recordings(
        tmp_path, outcomes=places, take_guesses=True, format="npz", episodes=["0", "1"]
    )
    assert isinstance(result.demonstrations.symmetry.moves[1], TurnJoint)


def test_a_turn_asks_for_a_box(tmp_path):
    with pytest.raises(ConfigurationError, match="sweeps other parts of the room"):
        Workspace.create(tmp_path / "hoop", symmetry="carried")
    assert not (tmp_path / "hoop").exists()
    with Workspace.create(tmp_path / "hoop", symmetry="carried", no_box=True) as workspace:
        assert workspace.manifest.symmetry.no_box


def test_of_three_numbers_the_turn_alone_is_declared(tmp_path):
    how = {"outcome_names": ("x", "y", "t"), "outcome_units": ("m", "m", "s")}
    with Workspace.create(
        tmp_path / "hoop", symmetry="carried", box=BOX, tolerance=(0.02, 0.02, 0.05), **how
    ) as workspace:
        assert workspace.manifest.symmetry.distance == "learned"


def test_poses_without_a_robot_are_shifted(tmp_path):
    form = PlanFormat(("x", "y", "z"), ("m",) * 3, 0.02)
    path = np.linspace([0.3, 0.0, 0.2], [0.5, 0.1, 0.2], 30)
    demonstrations = Demonstrations(path[None], np.array([[0.5, 0.1]]), form)
    with Workspace.create(
        tmp_path / "pour", robot="none", symmetry="anywhere", dt=0.02
    ) as workspace:
        workspace.import_demonstrations(demonstrations, "a pour")
        assert all(isinstance(move, Shift) for move in workspace.demonstrations.symmetry.moves)
        workspace.learn()
        workspace.set_goal([0.6, 0.0])
        plan = workspace.session().ask().plan
        np.testing.assert_allclose(plan, np.add(path, [0.1, -0.1, 0.0]), atol=1e-9)


def test_what_a_turn_leaves_is_named_in_the_manifest():
    form = PlanFormat(("x", "y", "z", "pitch"), ("m",) * 3 + ("rad",), 0.02)
    outcomes = pr.OutcomeFormat(("x", "y"), ("m", "m"), (0.05, 0.05))
    with pytest.raises(ConfigurationError, match=r"stays = \['pitch'\]"):
        DeclaredSymmetry("carried").symmetry(form, outcomes, None)
    made = DeclaredSymmetry("carried", "amplitude", stays=("pitch",))
    assert made.symmetry(form, outcomes, None).moves[0] == Amplitude()


def test_what_is_no_answer_is_refused():
    assert read_object("0.43, 0") == (0.43, 0.0)
    assert read_object("carried") == "carried"
    with pytest.raises(ConfigurationError, match="where is the object"):
        read_object("0.43")
    with pytest.raises(ConfigurationError, match="where is the object"):
        read_object("X Y")


def test_nothing_is_declared_where_nothing_was_said(tmp_path):
    with Workspace.create(tmp_path / "hoop") as workspace:
        assert workspace.manifest.symmetry is None
    with Workspace.create(tmp_path / "other", symmetry="none") as workspace:
        assert workspace.manifest.symmetry is None


def test_a_goal_behind_is_reached_the_other_way_round_where_the_first_joint_allows(tmp_path):
    """The Panda's first joint, at 1.2 rad, has 1.7 rad to its end and 4.1 rad to the other."""
    own = shown([0])
    first = own.format.names.index("joint1")
    plans = own.plans + (1.2 - own.plans[0, 0, first]) * np.eye(own.plans.shape[2])[first]
    with Workspace.create(tmp_path / "hoop", symmetry="carried", no_box=True) as hoop:
        hoop.import_demonstrations(replace(own, plans=plans), "a throw")
        hoop.learn()
        assert region_of(hoop).reached.any(axis=0).sum() == 12  # of 13 bearings: 28 deg are missing
        place = own.outcomes_seen[0] @ rotation(0.0, 0.0, 2.6)[:2, :2].T
        hoop.set_goal(place)
        trial = hoop.session().ask()
        assert not trial.verdict.refused
        turned = (trial.plan - plans[0])[:, first]
        np.testing.assert_allclose(turned, 2.6 - 2 * np.pi, atol=1e-6)


def test_a_range_that_is_narrowed_between_trials_asks_for_no_learning_and_learning_takes_it(hoop):
    hoop.import_demonstrations(shown([0]), "a throw")
    before = hoop.demonstrations.symmetry.moves[1].range
    hoop.manifest = replace(
        hoop.manifest, robot=replace(hoop.manifest.robot, upper=hoop.manifest.robot.upper - 0.1)
    )
    assert hoop.demonstrations.symmetry.moves[1].range == before
    hoop.learn()
    after = hoop.demonstrations.symmetry.moves[1].range
    assert after == (before[0], pytest.approx(before[1] - 0.1))
