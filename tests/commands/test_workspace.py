"""Commands on a workspace as a whole, as a person types them."""

import json
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.arm.robots.urdf import read_urdf
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.plans.kinematics import tool_tip
from tests.arm.robots.arms import UR, ur5e, write_urdf
from tests.arm.robots.descriptions import J, Urdf, arm, fixed
from tests.arm.workspace.planar import events_in


@pytest.mark.slow
def test_an_afternoon(run, folder):
    assert run("goal", folder, "0.9", "-0.05")[1].startswith("goal 1: 90 cm ahead, 5 cm right")
    status, out, _ = run("ask", folder, "--out", "plan.csv")
    assert status == 0
    assert "no limits checked" in out
    assert 'next: prior-reinforce tell planar 1 --error "_cm long, _cm left"' in out
    assert run("tell", folder, 1, "--error", "5cm", "long,", "2cm", "left")[0] == 0
    _, out, _ = run("amend", folder, 1, "--error", "-0.05", "0.02")
    assert "trial 1, corrected: 5 cm short, 2 cm left" in out
    run("ask", folder)
    status, out, _ = run("void", folder, 2, "--reason", "ball slipped")
    assert "trial 2: void: ball slipped" in out
    run("ask", folder)
    _, out, _ = run("tell", folder, 3, "--outcome", "0.93", "-0.05")
    assert "trial 3: 3 cm long" in out
    run("ask", folder)
    _, out, _ = run("tell", folder, 4, "--hit")
    assert "trial 4: reached" in out
    _, out, _ = run("status", folder)
    assert "reached in 3 trials (N = 4 demonstrations + 3 trials = 7)" in out
    assert len([line for line in out.splitlines() if "  note" not in line]) <= 10
    assert "this trial repeats it" in run("ask", folder)[1]
    run("void", folder, 5)
    _, out, _ = run("log", folder)
    kinds = [json.loads(line)["kind"] for line in out.splitlines()]
    assert kinds[2:6] == ["goal_set", "asked", "told", "amended"]


@pytest.mark.slow
def test_a_report_replaces_only_what_it_wrote(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "overview.png").write_bytes(b"mine")
    status, _, err = run("report", folder, "--out", "thesis")
    assert status == 2
    assert "choose an empty or a new folder" in err
    assert (tmp_path / "thesis" / "overview.png").read_bytes() == b"mine"
    status, _, err = run("report", folder, "--out", "shown.html")
    assert status == 2
    assert "--out shown" in err
    assert not (tmp_path / "shown.html").exists()
    for _ in range(2):
        assert run("report", folder)[0] == 0


@pytest.mark.parametrize("robot", ["ur5e", "arm.urdf"])
def test_any_arm_gives_a_workspace_its_joints_and_limits(run, tmp_path, monkeypatch, robot):
    monkeypatch.chdir(tmp_path)
    write_urdf(tmp_path / "arm.urdf", ur5e())
    status, out, _ = run("new", "hoop", "--robot", robot)
    assert status == 0
    assert "shoulder_pan_joint, shoulder_lift_joint, elbow_joint" in out
    assert "no limits of acceleration and jerk are known" in out
    with Workspace("hoop") as workspace:
        assert workspace.manifest.format.names == UR
        np.testing.assert_allclose(workspace.manifest.robot.velocity, np.pi)
        assert workspace.manifest.robot.chain is not None


@pytest.mark.parametrize(
    ("said", "names", "units"),
    [
        (("--robot", "so101"), ("gripper.pos",), ("percent",)),
        (("--robot", "so101", "--gripper", "none"), (), ()),
        (("--robot", "ur5e"), (), ()),
        (("--robot", "ur5e", "--gripper", "m"), ("gripper",), ("m",)),
    ],
)
def test_a_gripper_is_one_more_dimension(run, tmp_path, monkeypatch, said, names, units):
    monkeypatch.chdir(tmp_path)
    assert run("new", "hoop", *said)[0] == 0
    with Workspace("hoop") as workspace:
        form, robot = workspace.manifest.format, workspace.manifest.robot
    assert form.names == (*robot.joint_names, *names)
    assert form.units == (*("rad" for _ in robot.joint_names), *units)


@pytest.mark.slow
def test_what_drives_the_arm_is_written_into_the_manifest(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("new", "hoop", "--robot", "ur5e", "--arm", "ur,host=192.168.1.10,lag=0.05")[0] == 0
    with Workspace("hoop") as workspace:
        arm = workspace.manifest.driven_by
    assert arm.executor == "ur"
    assert arm.options == {"host": "192.168.1.10", "lag": 0.05}
    for wrong, says in (("fr4", "fr3, lerobot, ur"), ("fr3", "host"), ("fr3,hots=x", "hots")):
        status, _, err = run("new", "other", "--robot", "fr3", "--arm", wrong)
        assert status == 2
        assert says in err
    assert not (tmp_path / "other").exists()


def test_an_arm_that_is_not_known_names_the_ways_to_give_it(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, err = run("new", "hoop", "--robot", "ur3")
    assert status == 2
    assert "known are panda, fr3, ur5e, ur10e, xarm6, xarm7, so101" in err
    assert "--robot path/to/arm.urdf" in err
    assert run("new", "hoop", "--robot", "gone.urdf")[0] == 2
    assert "--tip, --base and --hold are of a URDF" in run("new", "hoop", "--tip", "tool0")[2]
    assert not (tmp_path / "hoop").exists()


@pytest.mark.parametrize("place", [("90cm", "-5cm"), ("90 -5 cm",), ("90cm ahead, 5cm right",)])
def test_a_goal_may_be_said_with_a_unit_or_in_words(run, folder, place):
    assert run("goal", folder, *place)[1].startswith("goal 1: 90 cm ahead, 5 cm right")


@pytest.mark.filterwarnings("always::UserWarning")
@pytest.mark.parametrize(
    ("place", "how_far"),
    [(("1.05", "0.3"), "5 cm in x, 10 cm in y"), (("2", "0.1"), "100 cm in x")],
)
def test_how_far_outside_a_goal_lies_is_said_at_once_with_the_nearest_inside(
    run, folder, place, how_far
):
    _, out, err = run("goal", folder, *place)
    (said,) = [line for line in (out + err).splitlines() if "outside what was demonstrated" in line]
    assert f"lies {how_far} " in said
    assert f"100 cm ahead, {'20' if place[1] == '0.3' else '10'} cm left" in said


def test_a_goal_in_centimetres_without_a_unit_is_refused(run, folder):
    status, _, err = run("goal", folder, "65", "15")
    assert status == 2
    assert "65 m is farther than any arm throws; say the unit, for instance 65cm" in err
    with Workspace(folder) as workspace:
        assert not workspace.session().goals


def test_a_refused_new_workspace_is_no_line_of_a_file_that_was_not_made(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, err = run("new", "hoop", "--symmetry", "carried")
    assert status == 2
    assert "nothing was made: [symmetry] object = 'carried'" in err
    assert "--no-box" in err


def test_of_a_motion_along_a_line_it_is_said_how_it_is_moved(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rail = ("--robot", "none", "--action-names", "rail", "--action-units", "m")
    of_line = ("--outcome-names", "distance", "--symmetry", "none")
    out = run("new", "line", *rail, *of_line)[1]
    assert "the motion is played faster or slower; one demonstration is enough" in out


def test_a_person_at_the_terminal_is_asked_which_link_is_the_flange(run, tmp_path, monkeypatch):
    so101 = Urdf("so101", [*arm(["a", "b", "wrist"]), J("gripper", "jaw")])
    (tmp_path / "arm.urdf").write_text(so101.text())
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    questions = []
    monkeypatch.setattr(
        "prior_reinforce.commands.workspace.answer_to",
        lambda question: questions.append(question) or ("none" if "object" in question else ""),
    )
    status, out, err = run("new", tmp_path / "w", "--robot", tmp_path / "arm.urdf")
    assert status == 0, err
    assert "--tip: wrist_link" in out
    assert "Ctrl-C" in questions[0]  # what is no link cannot be typed
    with Workspace(tmp_path / "w") as workspace:
        assert workspace.manifest.robot.joint_names == ("a", "b", "wrist")


def test_where_no_flange_is_proposed_one_has_to_be_said(run, tmp_path, monkeypatch):
    of = {"of": "base_link"}
    left, right = ([J(f"{s}_a", f"{s}1", **of), J(f"{s}_b", f"{s}2")] for s in ("l", "r"))
    (tmp_path / "arm.urdf").write_text(Urdf("two", [*left, *right]).text())
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    answers = iter(["", " ", "2r", "r2", "none"])  # and what is no link is asked about at once
    monkeypatch.setattr(
        "prior_reinforce.commands.workspace.answer_to", lambda question: next(answers)
    )
    status, out, err = run("new", tmp_path / "w", "--robot", tmp_path / "arm.urdf")
    assert status == 0, err
    assert out.count("ends in l2, r2") == 3
    assert "no link '2r'" in out
    with Workspace(tmp_path / "w") as workspace:
        assert workspace.manifest.robot.joint_names == ("r_a", "r_b")


@pytest.mark.parametrize("robot", ["none", "panda"])
def test_where_no_motion_is_turned_no_box_is_wanted_anyway(run, tmp_path, robot):
    status, _, err = run("new", tmp_path / "w", "--robot", robot, "--no-box")
    assert (status, err) == (0, "")


def test_an_sdf_is_said_to_be_none_that_is_read(run, tmp_path):
    (tmp_path / "arm.sdf").write_text("<sdf/>")
    status, _, err = run("new", tmp_path / "w", "--robot", tmp_path / "arm.sdf")
    assert status == 2
    assert "arm.sdf: SDF is not read; give the URDF" in err


@pytest.mark.parametrize("held", ["lift", "lift=high", "=0.2", "lift=nan"])
def test_a_joint_is_held_somewhere(run, tmp_path, held):
    status, _, err = run("new", tmp_path / "w", "--robot", "arm.urdf", "--hold", held)
    assert status == 2
    assert "lift=0.2" in err


def test_a_joint_is_held_at_one_place(run, tmp_path):
    path = mounted(tmp_path, (0.0, 0.0, 0.1), lift=True)
    new = ("new", tmp_path / "w", "--robot", path, "--hold")
    status, _, err = run(*new, "lift=0.2", "lift=0.3")
    assert status == 2
    assert "lift" in err
    assert not (tmp_path / "w").exists()
    assert run(*new, "lift=0.2")[0] == 0


def mounted(tmp_path, xyz, rpy=(0.0, 0.0, 0.0), lift=False):
    """An arm on a mount, which may be on a lift; its first joint turns about the mount's z."""
    level, up = (0.0, 0.0, 0.0), (0.0, 0.0, 0.2)
    joints = [J("lift", "carriage", "prismatic", xyz=level, rpy=level)] * lift
    joints += [fixed("mount", "base", xyz=xyz, rpy=rpy)]
    joints += [J("turn", "one", xyz=up, rpy=level)]
    joints += [J("bend", "tool0", xyz=up, rpy=level, axis=(0.0, 1.0, 0.0))]
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("mounted", joints, root="world").text())
    return path


@pytest.mark.parametrize(
    ("xyz", "rpy", "warned"),
    [
        ((0.5, -0.3, 0.8), (0.0, 0.0, 0.0), True),
        ((0.3, -0.2, 1.8), (np.pi, 0.0, 0.0), True),
        ((0.0, 0.1, 0.8), (0.0, 0.0, 0.0), True),  # 20 cm over half a turn
        ((0.005, 0.0, 0.8), (0.0, 0.0, 0.0), False),  # 1 cm of 1.5 cm
    ],
)
def test_new_says_where_an_arm_turns_if_that_matters_and_how_to_measure_from_there(
    run, tmp_path, xyz, rpy, warned
):
    path = mounted(tmp_path, xyz, rpy)
    new = ("--robot", path, "--symmetry", "carried", "--no-box")
    _, out, _ = run("new", tmp_path / "w", *new)
    place = f"({xyz[0]:.3f}, {xyz[1]:.3f}) m"
    assert (f"WARNING: turn turns about {place} in the frame at world" in out) == warned
    assert (f"add {place} to them, or make the workspace with --base base (" in out) == warned
    if warned:
        status, out, _ = run("new", tmp_path / "v", *new, "--base", "base")
        assert status == 0
        assert "WARNING" not in out
        with Workspace(tmp_path / "v") as workspace:  # heading and height as the file has them
            chain = workspace.manifest.robot.chain
        q = np.array([0.3, 1.0])
        seen = tool_tip(read_urdf(path).chain, q) - xyz
        np.testing.assert_allclose(tool_tip(chain, q), seen, atol=1e-9)


def test_above_a_lift_no_link_is_advised_where_none_stands_on_the_axis(run, tmp_path):
    path = mounted(tmp_path, (0.2, 0.0, 0.1), (0.0, 0.0, 1.0), lift=True)
    new = ("--robot", path, "--symmetry", "carried", "--no-box", "--base", "carriage")
    _, out, _ = run("new", tmp_path / "w", *new)
    assert "about (0.200, 0.000) m in the frame at carriage" in out
    assert "--base" not in out


@pytest.mark.parametrize("how", [("--symmetry", "none"), ("--symmetry", "0.5 0", "--no-box")])
def test_of_an_axis_that_is_level_no_place_is_said(run, tmp_path, how):
    path = mounted(tmp_path, (0.2, 0.0, 0.1), (0.0, np.pi / 2, 0.0))
    status, out, _ = run("new", tmp_path / "w", "--robot", path, *how, "--base", "base")
    assert status == 0
    assert "turns about (" not in out
    status, _, err = run(
        "new", tmp_path / "v", "--robot", path, "--symmetry", "carried", "--no-box"
    )
    assert status == 2
    assert "leans by 90 degrees from the vertical" in err


@pytest.mark.parametrize(("lean", "warned"), [(0.01, False), (0.045, True)])
def test_a_lean_is_said_where_it_matters(run, tmp_path, lean, warned):
    path = mounted(tmp_path, (0.0, 0.0, 0.0), (lean, 0.0, 0.0))
    path.write_text(path.read_text().replace("0 0 0.2", "0 0 0.6"))
    new = ("--robot", path, "--symmetry", "carried", "--no-box", "--tolerance", "0.02")
    _, out, _ = run("new", tmp_path / "w", *new)
    assert ("the axis of turn leans by 2.6 degrees" in out) == warned


def test_where_the_person_at_the_terminal_gives_no_answer_nothing_is_made(
    run, tmp_path, monkeypatch
):
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    for answers in ([], ["carried"]):  # Ctrl-D at the first question, and at the second

        def answer(question, left=answers):
            if not left:
                raise EOFError
            return left.pop()

        monkeypatch.setattr("builtins.input", answer)
        status, _, err = run("new", tmp_path / "hoop")
        assert status == 2
        assert "no answer came, and nothing was made; answer, or say --symmetry" in err
        assert not (tmp_path / "hoop").exists()


def test_new_asks_again_after_a_slip_and_only_for_a_new_folder(run, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    answers = iter(["carry", "carried", "no box"])
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    status, out, _ = run("new", tmp_path / "w")
    assert status == 0
    assert "got 'carry'" in out
    assert 'object = "carried"' in (tmp_path / "w" / "workspace.toml").read_text()
    assert "exists and is not empty" in run("new", tmp_path / "w")[2]  # no answer is left to take


@pytest.mark.parametrize(("unit", "tolerance"), [("m", 0.015), ("cm", 1.5), ("mm", 15.0)])
def test_a_tolerance_that_is_not_said_is_a_centimetre_and_a_half_in_any_unit(
    run, tmp_path, unit, tolerance
):
    assert run("new", tmp_path / "w", "--robot", "none", "--outcome-units", unit)[0] == 0
    with Workspace(tmp_path / "w") as workspace:
        assert workspace.manifest.outcome_format.tolerance == (tolerance, tolerance)


def test_what_is_no_length_needs_a_tolerance_of_its_own(run, tmp_path):
    new = ["new", tmp_path / "w", "--robot", "none", "--outcome-names", "spin"]
    new += ["--outcome-units", "deg"]
    status, _, err = run(*new)
    assert status == 2
    assert "--tolerance" in err
    assert run(*new, "--tolerance", "5")[0] == 0


@pytest.mark.parametrize(
    ("names", "units"),
    [
        ("x y z qw qx qy qz", ("m",) * 3 + ("1",) * 4),
        ("joint1 joint2 gripper", ("rad",) * 3),
        ("joint1 torso_lift joint1_vel", ("rad", "m", "rad/s")),
    ],
)
def test_columns_without_units_have_those_of_what_they_are_called(run, tmp_path, names, units):
    folder = tmp_path / "w"
    assert run("new", folder, "--robot", "none", "--action-names", *names.split())[0] == 0
    with Workspace(folder) as workspace:
        assert workspace.manifest.format.units == units


@pytest.mark.parametrize("where", ["0.7 0", "carried", "anywhere"])
def test_motions_are_moved_in_metres_and_outcomes_in_another_unit_refused(run, tmp_path, where):
    columns = ["--robot", "none", "--action-names", "x", "y", "--action-units", "m"]
    new = ["new", tmp_path / "w", *columns, "--symmetry", where]
    status, _, err = run(*new, "--outcome-units", "cm")
    assert status == 2
    assert "write units m" in err
    assert run(*new)[0] == 0


@pytest.mark.parametrize(
    ("was", "now"),
    [('units = ["m", "m"]', 'units = ["cm", "cm"]'), ('names = ["x", "y"]', 'names = ["y", "x"]')],
)
def test_no_command_takes_numbers_for_what_the_manifest_says_since_the_goal_was_set(
    run, folder, was, now
):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    run("tell", folder, "5cm long")
    run("ask", folder)
    path, n = Path(folder, "workspace.toml"), len(events_in(folder))
    text = path.read_text()
    assert was in text
    path.write_text(text.replace(was, now))
    for command in (
        ("status",), ("status", "--json"), ("trials",), ("report",), ("advise",), ("ask",),
        ("goal", "0.9", "0.1"), ("tell", "2", "5cm long"), ("tell", "--outcome", "0.9", "0.1"),
        ("amend", "1", "--outcome", "0.9", "0.1"), ("void", "2"), ("export", "2", "plan.npz"),
    ):  # fmt: skip
        status, out, err = run(command[0], folder, *command[1:])
        assert (status, out) == (2, ""), command
        assert "x [m], y [m]" in err
        assert "put it back" in err
    path.write_text(text)
    assert len(events_in(folder)) == n
    assert run("status", folder)[0] == 0
