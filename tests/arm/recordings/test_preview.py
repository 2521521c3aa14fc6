"""The preview says what was found, in about ten lines and one picture."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from prior_reinforce.arm.recordings import Preprocessing, import_demonstrations
from prior_reinforce.arm.recordings.preview import hull_corners
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.plans.kinematics import Chain
from prior_reinforce.plans.symmetry import TurnPath, TurnPoses, turn_and_scale
from tests.arm.recordings.recorded import (
    JOINTS,
    OUTCOMES,
    write_bags,
    write_csv,
    write_npz,
    write_outcomes,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = write_npz(tmp_path_factory.mktemp("preview"))
    write_outcomes(folder)
    return folder


def test_the_text(folder):
    lines = import_demonstrations(folder).preview.text.splitlines()
    assert 8 <= len(lines) <= 13
    rows = {line[:11].strip(): line[12:] for line in lines}
    assert rows["episodes"].startswith(f"6 from {folder.name} (npz): throw_0, throw_1")
    assert rows["rate"] == "recorded at 100 Hz (t in s), plans at 100 Hz (dt 0.01 s)"
    assert rows["still ends"].startswith("dropped 0.2")
    assert "--no-trim" in rows["still ends"]
    assert "5 hold their last pose" in rows["length"]
    # Joint 6 of the largest throw: 0.9 * 1.25 rad; the fastest is 0.9 * 1.15 * 15/8 in 1.0 s.
    assert "joint6 moves most, over 1.12 rad" in rows["motion"]
    assert "joint6 of throw_3, 1.94 rad/s" in rows["motion"]
    assert rows["outcomes"] == f"x 0.8 to 1.05 m, y -0.09 to 0.14 m, from {folder}/outcomes.csv"
    assert rows["remarks"] == "none"


def test_the_hull_has_its_area(folder):
    # The corners 0, 1, 5, 4 by the shoelace formula.
    x, y = np.array([OUTCOMES[i] for i in "0154"]).T
    area = 0.5 * abs(sum(x[i - 1] * y[i] - x[i] * y[i - 1] for i in range(4)))
    text = import_demonstrations(folder).preview.text
    assert f"hull in x and y of {area:.3g} m^2 by 4 of 6" in text
    assert "nearest two are throw_0 and throw_2, 0.102 m apart" in text


def test_the_picture_is_drawn(folder, tmp_path):
    result = import_demonstrations(folder)
    result.preview.draw(tmp_path / "preview.png")
    picture = imread(tmp_path / "preview.png")
    assert picture.shape[1] > 1000
    # Each of six colours is drawn in more than the outcomes' dots.
    for colour in ([31, 119, 180], [140, 86, 75]):
        assert np.sum(np.abs(picture[..., :3] * 255 - colour).sum(axis=-1) < 6) > 200


@pytest.mark.parametrize("k", [1, 3])
def test_outcomes_of_other_dimensions(folder, tmp_path, k):
    rng = np.random.default_rng(0)
    outcomes = {name: rng.uniform(0, 1, k) for name in OUTCOMES}
    result = import_demonstrations(folder, outcomes=outcomes)
    assert result.demonstrations.outcome_dim == k
    assert ("hull" in result.preview.text) == (k > 1)
    result.preview.draw(tmp_path / "preview.png")


def test_points_on_a_line_have_no_hull():
    assert hull_corners(np.array([[0.0, 0], [1, 1], [2, 2]])).size == 0


def test_no_remark_is_hidden_and_each_names_its_episodes_once(tmp_path):
    write_bags(tmp_path, kind="mcap", gripper_apart=True, rate=20)
    write_outcomes(tmp_path)
    preview = import_demonstrations(tmp_path, joints=JOINTS).preview
    # Throws i and i + 3 are as long, so that as many messages of the gripper are between theirs.
    assert preview.remarks == tuple(
        f"throw{i}, throw{i + 3}: {n} messages without all joints skipped"
        for i, n in enumerate((35, 37, 39))
    )
    assert preview.text.splitlines()[-3:] == [f"  - {remark}" for remark in preview.remarks]


def test_noise_is_said_and_what_smoothing_changed(folder):
    rows = dict(
        line.split(None, 1) for line in import_demonstrations(folder).preview.text.splitlines()
    )
    assert rows["noise"] == "none found; joint3, joint7 held still"
    smooth = import_demonstrations(folder, preprocessing=Preprocessing(smooth=20)).preview
    assert "smoothing changed plans by " in smooth.text
    most = 1000 * smooth.inspection.processed.smoothed[:, 1].max()
    assert f"at most {most:.2g} mrad" in smooth.text


def test_dollar_signs_in_names_are_no_mathematics(folder, tmp_path):
    names = ["$\\frac$", "$x", *JOINTS[2:]]
    result = import_demonstrations(folder, joints=JOINTS)
    demos = result.demonstrations
    form = replace(demos.format, names=tuple(names))
    preview = replace(result.preview, demonstrations=replace(demos, format=form))
    preview.draw(tmp_path / "preview.png")
    assert (tmp_path / "preview.png").stat().st_size > 10_000


def outcome_axes(folder, outcomes, units=None):
    """The axes that outcomes are drawn in, by title."""
    drawn = []

    def keep(figure, *_, **__):
        drawn.append(figure)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", keep)
        result = import_demonstrations(folder, outcomes=outcomes, outcome_units=units)
        result.preview.draw("nowhere.png")
    return {a.get_title(): a for a in drawn[0].axes if a.get_title().startswith("outcomes")}


def test_outcomes_lie_as_in_a_report_x_up_and_left_to_the_left(folder):
    (axes,) = outcome_axes(folder, OUTCOMES).values()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y [m]", "x [m]")
    left, right = axes.get_xlim()
    assert left > right


def test_three_components_are_seen_from_above_and_from_the_side(folder):
    rng = np.random.default_rng(0)
    outcomes = {name: rng.uniform(0, 1, 3) for name in OUTCOMES}
    axes = outcome_axes(folder, outcomes)
    assert list(axes) == ["outcomes from above", "outcomes from the side"]
    assert axes["outcomes from the side"].get_ylabel() == "z [m]"


def test_measured_outcomes_that_come_twice_are_told(folder):
    twice = {**OUTCOMES, "3": OUTCOMES["1"]}
    preview = import_demonstrations(folder, outcomes=twice).preview
    (remark,) = preview.remarks
    assert remark.startswith("throw_1 and throw_3 have the same outcome: the mean of both")
    assert remark in preview.text


def test_the_picture_is_returned_too(folder):
    preview = import_demonstrations(folder, outcome_names=["x", "y"]).preview
    assert len(preview.draw().axes) >= len(JOINTS)


def test_when_a_gripper_changes_is_marked(folder):
    preview = import_demonstrations(folder).preview
    demos = preview.demonstrations
    assert len(preview._changes(0)) == 0
    opening = np.linspace(0.0, 1.0, demos.horizon)[None].repeat(demos.n, axis=0)
    plans = np.concatenate([demos.plans, 100 * (opening > 0.4)[..., None]], axis=2)
    units = (*demos.format.units, "percent")
    form = replace(demos.format, names=(*demos.format.names, "gripper"), units=units)
    marked = replace(preview, demonstrations=replace(demos, plans=plans, format=form))
    times = marked._changes(demos.action_dim)
    assert len(times) == demos.n
    np.testing.assert_allclose(times, 0.4 * demos.horizon * form.dt, atol=2 * form.dt)


@pytest.mark.parametrize(("scale", "said"), [(1.0, False), (0.1, True)])
def test_outcomes_that_all_lie_at_the_base_are_doubted(tmp_path, scale, said):
    folder = write_csv(tmp_path)
    near = {name: (scale * x, scale * y) for name, (x, y) in OUTCOMES.items()}
    text = import_demonstrations(folder, outcomes=near).preview.text
    assert ("no errors from a target" in text) == said


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ((0.6, 0.2), None),  # the hand touches it
        ((0.6, 0.4), None),  # a tool in it may
        ((0.6, -0.5), "0.7 m"),  # the base is turned against the table
        ((0.0, 0.0), None),  # carried: nothing lies at the base
    ],
)
def test_a_hand_that_stays_far_from_where_the_object_lies_is_doubted(folder, place, said):
    preview = import_demonstrations(folder).preview
    demos = preview.demonstrations
    plans = demos.plans.copy()
    plans[:, :, 0], plans[:, :, 1] = np.linspace(0.3, 0.8, demos.horizon), 0.2
    plans[0, :, 1] = place[1]  # one that comes there
    symmetry = turn_and_scale(TurnPoses(place, (0, 1)), place)
    demos = replace(demos, plans=plans).with_symmetry(symmetry)
    text = replace(preview, demonstrations=demos).text
    assert ("where the object is said to lie" in text) == (said is not None)
    if said:
        assert f"no nearer than {said} to (0.6, -0.5)" in text
        assert "in throw_1 to throw_5:" in text


@pytest.mark.parametrize(("tool", "said"), [(None, True), ((0.5, 0.0, 0.0), False)])
def test_the_hand_that_comes_to_a_place_has_its_tool(folder, tool, said):
    """One joint with a flange 0.3 m out, and a tool as far as the place."""
    gate = GateSettings(tool_tip=tool)
    preview = import_demonstrations(folder, gate=gate).preview
    chain = Chain(((0.0,) * 6,), ((0.0, 0.0, 1.0),), (0.3, 0.0, 0.0, 0.0, 0.0, 0.0))
    symmetry = turn_and_scale(TurnPath(chain, (0.8, 0.0), (0,)), (0.8, 0.0))
    demos = replace(preview.demonstrations, plans=0.0 * preview.demonstrations.plans)
    preview = replace(preview, demonstrations=demos.with_symmetry(symmetry))
    assert ("the hand comes no nearer" in preview.text) == said
