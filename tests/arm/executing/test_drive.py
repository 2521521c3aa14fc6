"""What is done once for every executor: columns, start pose, limits, approach, stopping."""

import json
import re
import signal
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from prior_reinforce.arm.executing.arguments import split_command
from prior_reinforce.arm.executing.base import ArmDescription, ArmSettings, begin_at
from prior_reinforce.arm.executing.command import run_command
from prior_reinforce.arm.executing.drive import (
    LOOK_FILE,
    Request,
    approach,
    arms_columns,
    drive,
    drive_command,
    make_executor,
    read_look,
    say_distance,
)
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import ENDLESS, RobotLimits
from prior_reinforce.arm.robots.plan_files import write_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidPlanError,
    MissingExtraError,
)
from prior_reinforce.plans.kinematics import Chain
from prior_reinforce.plans.motions import Plan
from prior_reinforce.plans.plan_format import PlanFormat
from tests.arm.executing import toy_arm
from tests.attacks.harness import wait_until

TOY = toy_arm.TOY
FORM = PlanFormat(("arm_joint2", "arm_joint1"), ("rad", "rad"), 0.02)
PHASE = np.linspace(0, 1, 24)[:, None]
SWING = (10 * PHASE**3 - 15 * PHASE**4 + 6 * PHASE**5) * [0.4, 1.0]
PLAN = Plan(SWING, FORM)
ARM = ArmDescription("toy", "", ("joint1", "joint2"), ("rad", "rad"), 100.0, (), ())


@pytest.fixture
def arm(tmp_path, toy_plugin):
    """Drives a toy arm; `.motions()` are its motions, `.pose()` is where it stands."""
    before = signal.getsignal(signal.SIGTERM)

    class Arm:
        folder = tmp_path / "arm"

        gate, limits, stood = GateSettings(), None, {}

        def request(self, motion="trial", speed=1.0, **options):
            settings = ArmSettings(TOY, {"folder": str(self.folder)} | options)
            return Request(settings, self.gate, motion, speed, self.limits, self.stood)

        def drive(self, motion="trial", plan=PLAN, speed=1.0, **options):
            self.result = tmp_path / f"result-{len(list(tmp_path.iterdir()))}"
            self.result.mkdir()
            return drive(self.request(motion, speed, **options), plan, self.result)

        def look(self, plan=PLAN):
            assert self.drive("look", plan).outcome == "done"
            return read_look(self.result)

        def motions(self):
            path = self.folder / "motions"
            return len(path.read_text().split()) if path.exists() else 0

        def pose(self):
            return [float(word) for word in (self.folder / "pose").read_text().split()]

        def stands(self, *pose):
            (self.folder / "pose").write_text(" ".join(map(str, pose)))

        def path(self):
            with np.load(self.result / "executed.npz") as archive:
                return archive["t"], archive["q"]

    Arm.folder.mkdir()
    yield Arm()
    signal.signal(signal.SIGTERM, before)


def test_a_plans_columns_become_the_arms_and_back(arm):
    result = arm.drive()
    assert (result.outcome, result.reason) == ("done", "")
    assert arm.pose() == pytest.approx([1.0, 0.4])
    t, q = arm.path()
    assert t[-1] == pytest.approx(0.46)
    assert q[-1] == pytest.approx([0.4, 1.0])
    assert json.loads((arm.result / "result.json").read_bytes())["outcome"] == "done"


def test_a_channel_that_the_plan_leaves_out_is_held(arm):
    arm.stands(0.7, 0.0)
    only = Plan(SWING[:, :1], PlanFormat(("joint2",), ("rad",), 0.02))
    assert arm.drive(plan=only).outcome == "done"
    assert arm.pose() == pytest.approx([0.7, 0.4])
    assert arm.path()[1].shape[1] == 1


@pytest.mark.parametrize(
    ("names", "units", "says"),
    [
        (("joint1", "joint3"), ("rad", "rad"), "no channel for joint3"),
        (("joint1", "joint2"), ("rad", "m"), r"no channel for joint2 \[m\]"),
        (("joint1", "a_joint1"), ("rad", "rad"), "are one channel"),
    ],
)
def test_columns_are_never_guessed(names, units, says):
    with pytest.raises(InvalidPlanError, match=says):
        arms_columns(PlanFormat(names, units, 0.01), ARM)


@pytest.mark.slow
def test_an_arm_that_stands_elsewhere_is_not_moved_unasked(arm):
    arm.stands(0.0, 0.3)
    result = arm.drive()
    assert result.outcome == "not_moved"
    assert "0.3 rad (arm_joint2) from the start pose; 0.02 is allowed" in result.reason
    assert "--approach" in result.reason
    assert arm.motions() == 0
    assert arm.drive("approach").outcome == "done"
    assert arm.pose() == pytest.approx([0.0, 0.0])
    assert arm.drive().outcome == "done"


def test_what_is_left_within_the_tolerance_is_closed_slowly_first(arm):
    arm.stands(0.0, 0.015)
    assert arm.drive().outcome == "done"
    assert arm.motions() == 2
    assert arm.path()[1][0] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_an_approach_is_slow_and_at_rest_at_both_ends():
    plan = approach(np.array([0.0, 0.0]), np.array([0.6, -0.1]), ARM)
    speeds = np.abs(np.diff(plan.actions, axis=0)) / plan.format.dt
    assert speeds.max() == pytest.approx(0.3, rel=0.01)
    assert speeds[[0, -1]].max() < 0.001
    assert plan.actions[-1] == pytest.approx([0.6, -0.1])
    odd = ArmDescription("odd", "", ("joint1", "valve"), ("rad", "steps"), 100.0, (), ())
    with pytest.raises(InvalidPlanError, match="no slow speed is known in steps"):
        approach(np.zeros(2), np.ones(2), odd)


def test_a_motion_begins_where_the_arm_stands_and_is_its_plan_soon_after():
    pose = np.array([0.002, -0.001])
    for form in (PLAN.format, PlanFormat(PLAN.format.names, PLAN.format.units, 0.004)):
        begun = begin_at(Plan(SWING, form), pose)
        assert begun.actions[0].tolist() == pose.tolist()
        blended = form.dt * np.arange(len(SWING)) < min(0.2, form.dt * (len(SWING) - 1)) - 1e-9
        np.testing.assert_array_equal(begun.actions[~blended], SWING[~blended])
        assert np.abs(begun.actions - SWING).max() == pytest.approx(0.002)


@pytest.mark.slow
def test_the_plan_is_held_against_the_gate_as_it_begins_where_the_arm_stands(arm):
    """It keeps from a joint's end by 1 mrad, and the arm stands 1.9 mrad off."""
    arm.limits = replace(IN_PLANE, lower=[-0.001, -0.001])
    assert arm.drive().outcome == "done"
    arm.stands(-0.0019, 0.0)
    moved = arm.motions()
    result = arm.drive()
    assert result.outcome == "not_moved"
    assert result.reason.startswith("the plan from where the arm stands: position: joint1 at -0.00")
    assert arm.motions() == moved
    arm.drive("look")
    assert read_look(arm.result).refused == result.reason


def test_a_rehearsal_is_the_same_path_at_a_fraction_of_the_speed(arm):
    assert arm.drive("rehearsal", speed=0.25).outcome == "done"
    t, q = arm.path()
    assert t[-1] == pytest.approx(4 * 0.46)
    assert q[-1] == pytest.approx([0.4, 1.0])


@pytest.mark.slow
def test_a_limit_of_the_arm_refuses_before_anything_moves(arm):
    arm.stands(0.0, 0.015)  # what is left to close would pass
    fastest = 15 / 8 * 1.0 / 0.46
    assert arm.drive(fastest=0.99 * fastest).outcome == "not_moved"
    assert arm.motions() == 0
    assert arm.drive("rehearsal", speed=0.9, fastest=0.99 * fastest).outcome == "done"
    arm.stands(0.0, 0.0)
    assert arm.drive(fastest=1.01 * fastest).outcome == "done"


@pytest.mark.parametrize(
    ("kind", "outcome", "reason"),
    [
        ("faults", "aborted", toy_arm.FAULT),
        ("jams", "not_moved", "brakes are closed"),
        ("raises", "aborted", "ZeroDivisionError"),
        ("dead", "not_moved", "the arm does not answer"),
    ],
)
def test_a_fault_is_told_in_the_arms_words(arm, kind, outcome, reason):
    result = arm.drive(kind=kind)
    assert result.outcome == outcome
    assert reason in result.reason
    if kind == "faults":
        assert 0 < arm.path()[0][-1] < 0.46


def test_a_fault_on_the_way_to_the_start_is_no_measured_plan(arm):
    arm.stands(0.0, 0.015)
    assert arm.drive(kind="faults").outcome == "aborted"
    assert not (arm.result / "executed.npz").exists()
    assert arm.motions() == 1


def test_a_look_moves_nothing_and_says_how_the_arm_stands(arm):
    arm.stands(0.2, 0.3)
    arm.drive("look", fastest=0.1)
    look = read_look(arm.result)
    assert look.pose == {"joint1": 0.2, "joint2": 0.3}
    assert not look.there
    assert "; 0.02 is allowed" in look.said
    assert "more than 0.1" in look.refused
    assert look.approach == pytest.approx(15 / 8 * 0.3 / 0.3, abs=0.02)
    assert arm.motions() == 0
    with pytest.raises(FileFormatError, match="ask again"):
        read_look(arm.folder)


def test_what_an_executor_wrote_that_is_no_text_is_as_if_it_said_nothing(tmp_path):
    (tmp_path / LOOK_FILE).write_bytes(b'{"refused": "\xff"}')
    with pytest.raises(FileFormatError, match="ask again"):
        read_look(tmp_path)


@pytest.mark.slow
def test_asked_to_stop_it_stops_in_mid_swing_and_says_so(arm, tmp_path):
    file = write_plan(PLAN, tmp_path / "plan.npz")
    words = split_command(drive_command(arm.request(seconds=20.0)), file.path, tmp_path)
    with subprocess.Popen(words) as program:
        assert wait_until(lambda: (arm.folder / "pose").exists() and sum(arm.pose()) > 0.01, 60)
        program.send_signal(signal.SIGTERM)
    assert json.loads((tmp_path / "result.json").read_bytes()) == {
        "outcome": "aborted",
        "reason": "stopped on request",
        "start_error": {},
        "tracking_rms": {},
    }
    assert 0 < sum(arm.pose()) < 1.4


def test_asked_to_stop_before_it_moves_it_does_not(arm, monkeypatch):
    monkeypatch.setattr(toy_arm.ToyArm, "check", lambda *_: signal.raise_signal(signal.SIGTERM))
    result = arm.drive()
    assert result.outcome == "not_moved"
    assert result.reason == "it was asked to stop before it moved; ask again"
    assert arm.motions() == 0


@pytest.mark.slow
def test_the_program_says_how_it_ended_by_its_status(arm, tmp_path):
    file = write_plan(PLAN, tmp_path / "plan.npz")
    for kind, status, outcome in (("works", 0, "done"), ("dead", 75, "not_moved")):
        arm.stands(0.0, 0.0)
        result = run_command(drive_command(arm.request(kind=kind)), file, time_limit=60)
        assert (result.exit_status, result.outcome) == (status, outcome)
    for kind, status, reason in (("faults", 1, toy_arm.FAULT), ("crashes", 3, "status 3")):
        arm.stands(0.0, 0.0)
        result = run_command(drive_command(arm.request(kind=kind)), file, time_limit=60)
        assert (result.exit_status, result.outcome) == (status, "aborted")
        assert reason in result.reason


@pytest.mark.slow
def test_the_folder_that_a_user_stands_in_is_no_place_for_modules(arm, tmp_path, monkeypatch):
    (tmp_path / "msgspec.py").write_text("raise SystemExit('taken for the library')")
    monkeypatch.chdir(tmp_path)
    file = write_plan(PLAN, tmp_path / "plan.npz")
    assert run_command(drive_command(arm.request()), file, time_limit=60).outcome == "done"


def test_settings_are_held_against_their_types(arm):
    with pytest.raises(ConfigurationError, match=r"\[arm\] .*has no setting 'hots'"):
        make_executor(ArmSettings(TOY, {"folder": "x", "hots": 1}))
    with pytest.raises(ConfigurationError, match="Expected `float`"):
        make_executor(ArmSettings(TOY, {"folder": "x", "fastest": "quick"}))
    with pytest.raises(ConfigurationError, match="no executor 'r2d2'"):
        make_executor(ArmSettings("r2d2"))


@pytest.mark.parametrize(("name", "library"), [("fr3", "pylibfranka"), ("ur", "rtde_receive")])
def test_a_library_that_is_missing_is_named_with_its_extra(name, library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtraError, match=rf"pip install -e '\.\[{name}\]'"):
        make_executor(ArmSettings(name, {"host": "127.0.99.9"}))


ONE = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
LINKS = Chain(((0.0,) * 6, ONE), ((0.0, 0.0, 1.0),) * 2, ONE)
"""Two links of a metre in the plane: with joint 2 at 0 they are stretched."""
IN_PLANE = RobotLimits(
    "toy", "1.0", "ours", ("joint1", "joint2"), [-3.1] * 2, [3.1] * 2, [5.0] * 2, chain=LINKS
)
BOX = GateSettings(box_low=(-2.1, -0.5, -0.1), box_high=(2.1, 2.1, 0.1), tool_tip=(0.0, 0.0, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ((0.0, -3.0), "box: tool tip at y"),  # both ends are in the box, and not what is between
        ((-1.2, 0.0), "box: tool tip at y"),
        ((0.0, 3.2), "position: joint2 at 3.200"),
    ],
)
def test_the_way_to_the_start_is_held_against_the_gate(arm, pose, says, tmp_path):
    arm.gate, arm.limits = BOX, IN_PLANE
    arm.stands(*pose)
    assert arm.drive("look").reason == ""
    look = read_look(arm.result)
    assert says in look.approach_refused
    assert not look.refused
    result = arm.drive("approach")
    assert result.outcome == "not_moved"
    assert result.reason.startswith("the way from where the arm stands to the plan's first frame: ")
    assert says in result.reason
    assert arm.motions() == 0
    arm.stands(0.5, 0.1)
    file = write_plan(PLAN, tmp_path / "plan.npz")
    command = drive_command(arm.request("approach"))  # limits and box travel with it
    assert run_command(command, file, time_limit=60).outcome == "done"
    arm.stands(*pose)
    again = run_command(command, file, time_limit=60)
    assert (again.outcome, again.reason) == ("not_moved", result.reason)


def test_a_request_survives_its_way_through_the_command_line(arm):
    request = arm.request("rehearsal", 0.2, kind='it\'s "{quoted}"')
    again = msgspec.json.decode(msgspec.json.encode(request), type=Request)
    assert again == request
    assert sys.executable in drive_command(request)


def test_an_arm_that_stands_at_whole_numbers_gets_the_whole_plan(arm, monkeypatch):
    """A plan that is laid into a pose of integers would be cut to whole radians."""
    monkeypatch.setattr(toy_arm.ToyArm, "where", lambda self: [0, 0])
    assert arm.drive().outcome == "done"
    assert arm.pose() == pytest.approx([1.0, 0.4])
    assert arm.path()[1][12] == pytest.approx(PLAN.actions[6], abs=0.01)


@pytest.mark.parametrize("pose", [[0.0], [[0.0, 0.0]], 0.0])
def test_an_arm_that_stands_in_another_number_of_joints_is_not_moved(arm, monkeypatch, pose):
    monkeypatch.setattr(toy_arm.ToyArm, "where", lambda self: pose)
    result = arm.drive()
    assert result.outcome == "not_moved"
    assert "where each of joint1, joint2 stands" in result.reason
    assert arm.motions() == 0


def test_an_arm_of_another_model_than_the_workspaces_is_not_moved(arm, monkeypatch):
    arm.limits = robot_limits("ur5e")
    model = replace(ARM, model="ur10e")
    monkeypatch.setattr(toy_arm.ToyArm, "describe", lambda self: model)
    result = arm.drive()
    assert result.outcome == "not_moved"
    assert "driven as a ur10e" in result.reason
    assert "is ur5e: name the same one" in result.reason
    assert arm.motions() == 0


def test_an_arm_that_does_not_say_where_a_joint_stands_is_not_moved(arm):
    arm.folder.mkdir(exist_ok=True)
    (arm.folder / "pose").write_text("0.0 nan")
    for motion in ("trial", "approach"):
        result = arm.drive(motion)
        assert result.outcome == "not_moved"
        assert "toy does not say where joint2 stands" in result.reason
    assert arm.motions() == 0


UNITS = ("rad", "m", "percent", "steps")
OF_UNITS = PlanFormat(("joint1", "rail", "gripper", "valve"), UNITS, 0.01)


@pytest.mark.parametrize(
    ("off", "said", "there"),
    [
        ((0.01, 0.005, 0.1, 0), "0.005 m (rail), 0.1 percent (gripper)", True),
        (
            (0.01, 0.005, -12.0, 0),
            "12 percent (gripper); 5 is allowed, 0 steps",
            False,
        ),
        (
            (0.03, 0.005, 0.1, 0),
            "0.03 rad (joint1); 0.02 is allowed, 0.005 m",
            False,
        ),
        ((0.01, -0.02, 0.1, 0), "0.02 m (rail); 0.01 is allowed, ", False),
        (
            (0.01, 0.005, 0.1, 90),
            "90 steps (valve), which is held against nothing",
            False,
        ),
        ((2.6e-17, 3e-5, 0.0, 2.6e-17), "0 rad (joint1), 0 m (rail), 0 percent", True),
        (
            (float("nan"), 0.005, 0.1, 0),
            "inf rad (joint1); 0.02 is allowed",
            False,
        ),
    ],
)
def test_units_are_never_compared_with_each_other(off, said, there):
    text, near = say_distance(np.abs(off), OF_UNITS, GateSettings())
    assert said in text.replace(" from the start pose", "")
    assert near == there


def test_a_joint_that_is_no_number_is_not_there_whatever_the_others_are():
    form = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.01)
    for off in ([float("nan"), 0.0], [0.0, float("nan")]):
        assert not say_distance(np.array(off), form, GateSettings())[1]


def test_a_unit_may_be_given_its_own_error():
    own = GateSettings(errors=(("steps", 40.0, 40.0),), start_error=0.1)
    for steps, near in ((39, True), (41, False)):
        assert say_distance(np.array([0.09, 0.0, 0.0, steps]), OF_UNITS, own)[1] == near


@pytest.mark.parametrize(
    ("t", "q", "says"),
    [
        (np.arange(3.0), np.zeros((3, 3)), r"q \(T, 2\), got \(3,\) and \(3, 3\)"),
        (np.arange(3.0), np.zeros((2, 2)), r"got \(3,\) and \(2, 2\)"),
        (0.5, np.zeros((3, 2)), r"got \(\) and \(3, 2\)"),
        (["soon"], np.zeros((1, 2)), "holds no numbers"),
        (np.arange(3.0), np.full((3, 2), np.nan), "not all of it is finite"),
    ],
)
def test_a_motion_is_done_whatever_its_executor_calls_its_path(arm, monkeypatch, t, q, says):
    path = SimpleNamespace(t=t, q=q, fault="", moved=True)
    monkeypatch.setattr(toy_arm.ToyArm, "run", lambda self, plan: path)
    result = arm.drive()
    assert result.outcome == "done"
    assert re.search(says, result.reason)
    assert not (arm.result / "executed.npz").exists()


def test_an_approach_begins_where_the_arm_stood_when_a_person_was_asked(arm):
    arm.stands(0.5, 0.2)
    arm.stood = arm.look().pose
    arm.stands(1.5, 0.2)
    result = arm.drive("approach")
    assert result.outcome == "not_moved"
    assert re.search(r"1 rad \(joint1\) from where it stood .*: ask again", result.reason)
    assert arm.motions() == 0
    arm.stands(0.5001, 0.2)  # what an encoder shows at rest
    assert arm.drive("approach").outcome == "done"


@pytest.mark.parametrize("motion", ["trial", "approach"])
def test_a_channel_that_the_plan_leaves_out_stands_where_a_person_saw_it(arm, motion):
    only = Plan(PLAN.actions[:, :1], PlanFormat(FORM.names[:1], ("rad",), 0.02))
    arm.stands(0.5, 0.0)
    arm.stood = arm.look(only).pose
    arm.stands(1.9, 0.0)
    result = arm.drive(motion, only)
    assert (result.outcome, arm.motions()) == ("not_moved", 0)
    assert "1.4 rad (joint1) from where it stood" in result.reason


def test_a_joint_at_the_seam_of_a_turn_stands_where_it_stood(arm):
    ends = {"lower": np.full(2, -ENDLESS), "upper": np.full(2, ENDLESS)}
    arm.limits = RobotLimits("own", "", "", ("joint1", "joint2"), **ends, velocity=np.full(2, 9.0))
    arm.stands(3.1415, 0.0)
    arm.stood = arm.look().pose
    arm.stands(-3.1416, 0.0)
    assert "from where it stood" not in arm.drive("approach").reason


def test_a_throw_is_done_whatever_fails_after_it(arm, monkeypatch):
    def full(*_, **__):
        raise OSError("No space left on device")

    monkeypatch.setattr(toy_arm.ToyArm, "close", full)
    monkeypatch.setattr(np, "savez", full)
    result = arm.drive()
    assert result.outcome == "done"
    assert "is not kept: No space left" in result.reason
    assert "it was not let go" in result.reason
