"""The gate finds the joint, the time and the margin of plans whose peaks are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import prior_reinforce.simulation.tasks
from prior_reinforce.arm.robots.gate import beyond_band, check_plan
from prior_reinforce.arm.robots.gate_settings import GateSettings
from prior_reinforce.arm.robots.limits import RobotLimits
from prior_reinforce.arm.robots.plan_files import resample_plan
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError, InvalidPlanError, RobotLimitError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators import make_generator
from prior_reinforce.plans.interpolation import interpolate, join_frames
from prior_reinforce.plans.motions import Demonstrations, Plan
from prior_reinforce.plans.plan_format import PlanFormat
from tests.attacks.streams import KINDS, arms, attack

HOME = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.8])
DT = 0.01
FORMAT = PlanFormat(tuple(f"joint{i}" for i in range(1, 8)), ("rad",) * 7, DT)
PANDA = robot_limits("panda")


def swing(joint: int, amplitude: float, duration: float, frames: int = 0) -> np.ndarray:
    """Minimum jerk of one joint (from 1) away from HOME; peak speed 15/8 amplitude/duration."""
    n = frames or round(duration / DT) + 1
    s = np.linspace(0, 1, n)
    plan = np.tile(HOME, (n, 1))
    plan[:, joint - 1] += amplitude * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return plan


def lines(report):
    return {line.check: line for line in report.lines}


def test_a_gentle_swing_passes_everything():
    report = check_plan(Plan(swing(4, 0.5, 1.0), FORMAT), PANDA)
    assert not report.refused
    assert not report.warned
    assert [line.check for line in report.lines] == [
        "joints",
        "position",
        "velocity",
        "acceleration",
        "jerk",
        "rest at start",
        "rest at end",
        "demonstrations",
        "box",
    ]
    report.require()


def test_speed_is_found_with_its_joint_time_and_margin():
    # Peak 15/8 * 1.2 / 1.0 = 2.25 rad/s at half time, beyond the Panda's 2.175.
    report = check_plan(Plan(swing(4, 1.2, 1.0), FORMAT), PANDA)
    line = lines(report)["velocity"]
    assert line.status == "refuse"
    assert line.joint == "joint4"
    assert line.time == pytest.approx(0.5, abs=0.002)
    assert line.value == pytest.approx(2.25, rel=1e-4)
    assert line.limit == 2.175
    assert line.margin == pytest.approx(-0.075, abs=1e-3)
    with pytest.raises(RobotLimitError, match=r"velocity: joint4 at 2\.25 rad/s.*0\.500 s"):
        report.require()


def test_what_is_worst_while_a_pose_is_held_is_said_to_be_at_the_end_of_the_motion():
    towards = swing(4, -0.9, 1.0)  # nearest to its end in the last frame
    for plan, time in ((towards, 1.0), (towards[::-1], 0.0)):
        line = lines(check_plan(Plan(plan, FORMAT), PANDA))["position"]
        assert line.time == pytest.approx(time)
        assert line.text.endswith(f"at {time:.3f} s")


def test_acceleration_is_found():
    # Peak 10/sqrt(3) * 0.4 / 0.5^2 = 9.24 rad/s^2 on joint 2, whose limit is 7.5.
    line = lines(check_plan(Plan(swing(2, 0.4, 0.5), FORMAT), PANDA))["acceleration"]
    assert (line.status, line.joint, line.limit) == ("refuse", "joint2", 7.5)
    assert line.value == pytest.approx(10 / np.sqrt(3) * 0.4 / 0.25, rel=1e-3)


def test_nearly_used_up_warns():
    amplitude = 0.97 * 2.175 * 8 / 15
    report = check_plan(Plan(swing(1, amplitude, 1.0), FORMAT), PANDA)
    assert lines(report)["velocity"].status == "warn"
    assert report.warned
    assert not report.refused
    report.require()


def test_jitter_shows_in_acceleration_and_jerk_though_not_in_position():
    plan = swing(4, 0.3, 1.0)
    plan[40:60, 3] += 0.002 * (-1) ** np.arange(20)
    found = lines(check_plan(Plan(plan, FORMAT), PANDA))
    assert found["position"].status == "pass"
    assert found["acceleration"].status == "refuse"
    assert found["jerk"].status == "refuse"
    assert found["jerk"].joint == "joint4"


def test_position_beyond_the_range():
    line = lines(check_plan(Plan(swing(4, 2.0, 3.0), FORMAT), PANDA))["position"]
    assert (line.status, line.joint, line.limit) == ("refuse", "joint4", -0.0698)
    assert line.margin == pytest.approx(-0.0698, abs=1e-6)


@pytest.mark.parametrize("end", ["start", "end"])
def test_motion_at_an_end_is_refused(end):
    plan = swing(4, 0.5, 1.0)
    plan = plan[30:] if end == "start" else plan[:-30]
    found = lines(check_plan(Plan(plan, FORMAT), PANDA))
    assert found[f"rest at {end}"].status == "refuse"
    assert found[f"rest at {end}"].joint == "joint4"
    other = "end" if end == "start" else "start"
    assert found[f"rest at {other}"].status == "pass"
    # The step where the held pose meets the motion is seen by the rates as well.
    assert found["jerk"].status == "refuse"


def test_an_fr3_near_its_stop_is_slower():
    limits = robot_limits("fr3", ">=5.9")
    # Peak 15/8 * 0.7 / 0.6 = 2.19 rad/s at 2.35 rad, where -0.6599 + sqrt(12 * 0.5507) = 1.911.
    s = np.linspace(0, 1, 61)
    plan = np.tile(HOME, (61, 1))
    plan[:, 0] = 2.0 + 0.7 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    found = lines(check_plan(Plan(plan, FORMAT), limits))["velocity"]
    assert (found.status, found.joint) == ("refuse", "joint1")
    assert found.value > found.limit
    assert found.limit < 1.911
    # Between two instants the arm comes nearer to its stop: the later bound counts.
    here = limits.velocity_bounds(join_frames(plan, DT)(np.array([found.time])))[1][0, 0]
    assert 0.9 * here < found.limit < here - 1e-6
    centre = plan.copy()
    centre[:, 0] -= 2.0
    assert lines(check_plan(Plan(centre, FORMAT), limits))["velocity"].status == "pass"
    # The same motion away from the stop is held against the other side's bound.
    assert lines(check_plan(Plan(plan[::-1], FORMAT), limits))["velocity"].status == "pass"


def demonstrations():
    plans = [swing(4, amplitude, 1.0) for amplitude in (0.4, 0.5, 0.6)]
    return Demonstrations(np.array(plans), np.array([[0.8, 0.0], [0.9, 0.1], [1.0, -0.1]]), FORMAT)


@pytest.mark.parametrize(
    ("amplitude", "status"), [(0.5, "pass"), (0.65, "pass"), (0.75, "warn"), (1.0, "refuse")]
)
def test_distance_from_the_demonstrations(amplitude, status):
    # Demonstrated range of joint 4 is 0.6; 0.65 lies 8 % of it beyond, 0.75 25 %, 1.0 67 %.
    line = lines(check_plan(Plan(swing(4, amplitude, 1.0), FORMAT), PANDA, demonstrations()))[
        "demonstrations"
    ]
    assert line.status == status
    assert line.value == pytest.approx(max(0.0, amplitude - 0.6) / 0.6, abs=1e-9)


def test_the_envelope_follows_time():
    # The same path in reverse stays within the overall range, but not within the band in time.
    line = lines(check_plan(Plan(swing(4, 0.5, 1.0)[::-1], FORMAT), PANDA, demonstrations()))[
        "demonstrations"
    ]
    assert line.status == "refuse"
    other = Plan(swing(4, 0.5, 1.2)[::-1], FORMAT)
    assert lines(check_plan(other, PANDA, demonstrations()))["demonstrations"].status == "pass"


def test_demonstrations_of_other_columns_are_named():
    renamed = PlanFormat(tuple("abcdefg"), ("rad",) * 7, DT)
    with pytest.raises(InvalidPlanError, match="learned from"):
        check_plan(Plan(swing(4, 0.5, 1.0), renamed), PANDA, demonstrations())


@pytest.mark.parametrize("frame", [1, 50, 99])
def test_absurd_numbers_never_pass(frame):
    """1e305 overflows in the spline; what is not a number is beyond every limit."""
    plan = Plan(swing(4, 0.5, 1.0), FORMAT)
    frames = plan.actions.copy()
    frames[frame, 3] = 1e305  # a Plan would not take it
    object.__setattr__(plan, "actions", frames)
    assert check_plan(plan, PANDA).refused


def test_frames_between_two_cycles_are_refused():
    """A spike of 2 rad between two milliseconds, of which no sample at 1 kHz knows."""
    plan = swing(4, 0.5, 1.0, frames=1_001)
    plan[501, 3] += 2.0
    quick = PlanFormat(FORMAT.names, FORMAT.units, 1e-6)
    with pytest.raises(InvalidPlanError, match="closer than a cycle of the arm"):
        check_plan(Plan(plan, quick), PANDA)


def test_acceleration_is_exact_between_two_cycles():
    """It is largest at a frame, here 0.5 ms from both cycles; half as large at these."""
    form = PlanFormat(FORMAT.names, FORMAT.units, 0.0015)
    plan = np.tile(HOME, (41, 1))
    plan[20:23, 3] += np.array([1.0, 2.0, 1.0]) * 1e-6
    found = lines(check_plan(Plan(plan, form), PANDA))["acceleration"]
    exact = np.abs(join_frames(plan, 0.0015)(np.arange(41) * 0.0015, 2)).max()
    assert found.value == pytest.approx(exact, rel=1e-12)


def test_jerk_of_the_step_out_of_the_hold_counts_in_full():
    """The acceleration jumps with the first frame, and falls within the same millisecond."""
    plan = np.tile(HOME, (41, 1))
    plan[1:, 3] += 1e-5
    found = lines(check_plan(Plan(plan, FORMAT), PANDA))["jerk"]
    assert found.value == pytest.approx(join_frames(plan, DT)(0.0, 2)[3] * 1000, rel=1e-6)


def test_a_box_that_cannot_be_checked_refuses():
    """It was asked for: a dash would pass the plan."""
    box = GateSettings(box_low=(-1, -1, 0), box_high=(1, 1, 1.5))
    swung = swing(4, 0.5, 1.0)
    six = PlanFormat(FORMAT.names[1:], ("rad",) * 6, DT)
    without = replace(box, absent_joints=("joint1",))
    for plan, limits, settings_ in (
        (Plan(swung, FORMAT), replace(PANDA, robot="own", chain=None), box),
        (Plan(swung[:, 1:], six), PANDA, without),
    ):
        report = check_plan(plan, limits, settings=settings_)
        assert lines(report)["box"].status == "refuse"
        with pytest.raises(RobotLimitError, match="box: cannot be checked"):
            report.require()


def test_without_a_box_it_is_said_what_is_not_looked_at():
    line = lines(check_plan(Plan(np.tile(HOME, (5, 1)), FORMAT), PANDA))["box"]
    assert line.status == "unchecked"
    assert "the tool tip is not checked: set tool_tip, workspace_low" in line.text


def test_the_box_for_the_tool_tip():
    plan = Plan(swing(4, 0.5, 1.0), FORMAT)
    free = GateSettings(box_low=(-1, -1, 0), box_high=(1, 1, 1.5), tool_tip=(0.0, 0.0, 0.1))
    line = lines(check_plan(plan, PANDA, settings=free))["box"]
    assert line.status == "pass"
    low = GateSettings(box_low=(-1, -1, 0), box_high=(1, 1, 1.5), tool_tip=(0.0, 0.0, 0.9))
    line = lines(check_plan(plan, PANDA, settings=low))["box"]
    assert (line.status, line.joint, line.limit) == ("refuse", "z", 0.0)
    assert line.margin < 0


def test_columns_are_matched_by_name_whatever_their_order():
    plan = swing(4, 1.2, 1.0)
    order = [6, 3, 0, 5, 1, 4, 2]
    names = ("gripper", *(f"fr3_joint{i + 1}" for i in order))
    shuffled = np.column_stack([np.zeros(len(plan)), plan[:, order]])
    report = check_plan(Plan(shuffled, PlanFormat(names, ("m", *("rad",) * 7), DT)), PANDA)
    straight = check_plan(Plan(plan, FORMAT), PANDA)
    assert [(a.value, a.joint) for a in report.lines[1:5]] == [
        (b.value, b.joint) for b in straight.lines[1:5]
    ]


def test_some_joints_only():
    form = PlanFormat(("joint4.pos", "joint6.pos"), ("rad", "rad"), DT)
    report = check_plan(Plan(swing(4, 1.2, 1.0)[:, [3, 5]], form), PANDA)
    found = lines(report)
    assert found["velocity"].joint == "joint4"
    assert found["box"].status == "unchecked"
    assert (found["joints"].status, found["joints"].value) == ("warn", 5)
    assert found["joints"].text.endswith("joint1, joint2, joint3, joint5, joint7")


def test_a_joint_without_a_column_never_just_passes():
    """`Joint4` may be joint4, or another arm's: it is not guessed, and not passed over."""
    gentle = swing(4, 0.5, 1.0)
    names = ("joint1", "joint2", "joint3", "Joint4", "joint5", "j6", "joint7")
    plan = Plan(gentle, PlanFormat(names, ("rad",) * 7, DT))
    report = check_plan(plan, PANDA)
    assert report.warned
    assert report.text().startswith("plan NOT CHECKED for every joint: ")
    assert "WARN   joints         not in the plan, so not checked: joint4, joint6" in report.text()
    meant = check_plan(plan, PANDA, settings=GateSettings(absent_joints=("joint4", "joint6")))
    assert meant.text().startswith("plan passes:")
    assert "5 of 7, without joint4, joint6 on purpose" in meant.text()
    for wrong, why in (("joint1", "the plan moves it"), ("joint9", "no such joint")):
        with pytest.raises(ConfigurationError, match=why):
            check_plan(plan, PANDA, settings=GateSettings(absent_joints=(wrong,)))


def test_what_cannot_be_checked_says_so():
    form = PlanFormat(("x", "y", "z"), ("m",) * 3, DT)
    report = check_plan(Plan(np.zeros((10, 3)), form), PANDA)
    assert {line.status for line in report.lines[1:]} == {"unchecked"}
    assert lines(report)["joints"].status == "warn"
    assert not report.refused
    assert report.text().startswith("plan NOT CHECKED for the arm: limits of panda")
    assert report.as_json()["unchecked"] == [line.check for line in report.lines[1:]]


def test_degrees_are_refused():
    form = PlanFormat(FORMAT.names, ("deg",) * 7, DT)
    with pytest.raises(InvalidPlanError, match="in rad"):
        check_plan(Plan(swing(4, 0.5, 1.0), form), PANDA)


def test_a_joint_resting_at_a_stop_breaks_no_velocity_bound():
    limits = robot_limits("fr3", ">=5.9")
    plan = np.tile(HOME, (50, 1))
    plan[:, 0] = limits.upper[0] - 1e-4
    line = lines(check_plan(Plan(plan, FORMAT), limits))["velocity"]
    assert line.status == "pass"


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_a_plan_passes_exactly_when_looser_limits_of_its_own_peaks_hold(seed):
    """Limits a hair above the plan's own peaks pass; a hair below any of them is refused."""
    rng = np.random.default_rng(seed)
    plan = Plan(swing(int(rng.integers(1, 8)), rng.uniform(0.1, 0.6), 1.0), FORMAT)
    loose = RobotLimits(
        "arm", "1", "test", FORMAT.names, *(np.full(7, v) for v in (-9, 9, 1e3, 1e4, 1e7))
    )
    peaks = {line.check: line.value for line in check_plan(plan, loose).lines[2:5]}
    for check, peak in peaks.items():
        for factor, status in ((1.001, "warn"), (0.999, "refuse")):
            values = {"velocity": 1e3, "acceleration": 1e4, "jerk": 1e7} | {check: peak * factor}
            limits = RobotLimits(
                "arm",
                "1",
                "test",
                FORMAT.names,
                np.full(7, -9.0),
                np.full(7, 9.0),
                *(np.full(7, value) for value in values.values()),
            )
            assert lines(check_plan(plan, limits))[check].status == status


SETS = sorted(
    (Path(prior_reinforce.simulation.tasks.__file__).parent / "demonstrations").glob("*.npz")
)


@pytest.mark.slow
def test_the_shipped_demonstrations_of_joints_pass():
    """Those of the other tasks are no joint positions; inverse kinematics answers for them."""
    shipped = [Demonstrations.load(path) for path in SETS]
    checked = [demos for demos in shipped if "joint1" in demos.format.names]
    assert len(checked) >= 4
    for demos in checked:
        for frames in demos.plans:
            check_plan(Plan(frames, demos.format), PANDA, demos).require()


UR = robot_limits("ur5e")
UR_FORMAT = PlanFormat(UR.joint_names, ("rad",) * 6, 0.01)


def ur_swing(size: float) -> np.ndarray:
    """The shoulder by so many radians within a second, at 10 / sqrt(3) rad/s^2 a radian."""
    s = np.linspace(0, 1, 101)[:, None]
    return (10 * s**3 - 15 * s**4 + 6 * s**5) * size * np.eye(6)[1]


def test_where_no_acceleration_is_published_what_was_demonstrated_refuses():
    shown = Demonstrations([ur_swing(a) for a in (0.8, 1.0)], [[0.8], [1.0]], UR_FORMAT)
    loose = GateSettings(beyond_refuse=9.0)
    for size, status in ((1.45, "pass"), (1.55, "warn"), (2.9, "warn"), (3.1, "refuse")):
        line = lines(check_plan(Plan(ur_swing(size), UR_FORMAT), UR, shown, loose))["acceleration"]
        assert (line.status, line.joint) == (status, "shoulder_lift_joint")
        assert line.limit == pytest.approx(3 * 10 / np.sqrt(3), rel=0.01)
        assert f"{100 * line.value / line.limit:.0f} % of {line.limit:.4g}, allowed" in line.text
        assert "no limit is known" in line.text


def test_without_demonstrations_what_no_published_arm_comes_near_refuses():
    fast = PlanFormat(UR.joint_names, UR_FORMAT.units, 0.002)
    for size, status in ((0.3, "pass"), (0.5, "refuse")):  # 43 and 72 rad/s^2 in 0.2 s
        report = check_plan(Plan(ur_swing(size), fast), UR)
        line = lines(report)["acceleration"]
        assert line.limit == pytest.approx(np.pi / 0.05)
        assert line.status == status
    assert lines(report)["jerk"].limit == pytest.approx(np.pi / 0.05 / 0.002)


def test_noise_of_a_held_joint_hides_no_joint_that_moves():
    """An encoder's rounding is no motion, a thousand times as much of it neither."""
    noise = np.zeros((101, 6))
    noise[40:60:2, 0] = 1e-12
    shown = Demonstrations([ur_swing(a) + noise for a in (0.8, 1.0)], [[0.8], [1.0]], UR_FORMAT)
    plan = Plan(ur_swing(1.7) + 1000 * noise, UR_FORMAT)
    found = lines(check_plan(plan, UR, shown, GateSettings(beyond_refuse=9.0)))
    for check, status in (("acceleration", "warn"), ("jerk", "pass")):
        assert (found[check].joint, found[check].status) == ("shoulder_lift_joint", status)


def test_demonstrations_that_shake_allow_no_plan_that_does():
    """100 rad/s^2 in what was recorded is the recording's, not the arm's."""
    noise = 1e-3 * (-1.0) ** np.arange(101)[:, None] * np.eye(6)[1]
    noise[[0, 1, -2, -1]] = 0
    shown = Demonstrations([ur_swing(a) + noise for a in (0.8, 1.0)], [[0.8], [1.0]], UR_FORMAT)
    line = lines(check_plan(Plan(shown.plans[0], UR_FORMAT), UR, shown))["acceleration"]
    assert (line.status, line.limit) == ("refuse", pytest.approx(np.pi / 0.05))


@pytest.mark.slow
def test_what_passes_is_within_every_limit_by_another_computation(tmp_path):
    """At 20 kHz, as a spline, as the files' differences, and as a ROS controller joins them."""
    found = {
        (arm, kind, seed): attack(arm, limits, kind, seed)
        for arm, limits in arms(tmp_path).items()
        for kind in KINDS
        for seed in range(2)
    }
    assert not {where: share for where, (refused, share) in found.items() if share > 1 > refused}
    assert len(found) >= 100
    # A gate that refuses everything would pass this, too.
    assert np.mean([not refused for refused, _ in found.values()]) > 0.2


def test_an_alternation_at_the_arms_own_cycle_is_refused():
    """At 1 kHz, a spline stands still on each frame; between them this one does 150 rad/s."""
    n = 400
    calm = np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / 100, 0, 1)
    frames = np.tile([0, -1.57, 1.57, -1.57, -1.57, 0.0], (n, 1))
    frames[:, 0] += 0.05 * calm**2 * (-1.0) ** np.arange(n)
    plan = Plan(frames, PlanFormat(UR.joint_names, UR_FORMAT.units, 0.001))
    line = lines(check_plan(plan, UR))["velocity"]
    assert line.status == "refuse"
    assert line.value == pytest.approx(1.5 * 0.1 / 0.001, rel=0.01)


def test_a_velocity_between_two_frames_is_exact():
    """Frames 20 ms apart: it is largest 10 ms from either, and off every millisecond's grid."""
    form = PlanFormat(FORMAT.names, FORMAT.units, 0.0203)
    plan = np.tile(HOME, (41, 1))
    plan[20:, 3] += 0.01
    spline = join_frames(plan, 0.0203)
    fine = np.linspace(19 * 0.0203, 20 * 0.0203, 200_001)
    line = lines(check_plan(Plan(plan, form), PANDA))["velocity"]
    assert line.value == pytest.approx(np.abs(spline(fine, 1)).max(), rel=1e-9)
    assert line.value >= np.abs(spline(fine, 1)).max() * (1 - 1e-14)


def test_jerk_does_not_depend_on_where_the_milliseconds_begin():
    form = PlanFormat(FORMAT.names, FORMAT.units, 0.0033)
    rng = np.random.default_rng(0)
    plan = HOME + np.cumsum(rng.normal(0, 1e-6, (60, 7)), axis=0)
    spline = join_frames(plan, 0.0033)
    t = np.arange(-0.002, spline.x[-1] + 0.002, 1e-6)
    inside = ((t >= 0) & (t <= spline.x[-1]))[:, None]
    acceleration = spline(np.clip(t, 0, spline.x[-1]), 2) * inside
    worst = np.abs(acceleration[1000:] - acceleration[:-1000]).max(axis=0) * 1000
    share = (worst / PANDA.jerk).max()
    line = lines(check_plan(Plan(plan, form), PANDA))["jerk"]
    assert line.value / line.limit == pytest.approx(share, rel=2e-3)
    assert line.value / line.limit >= share * (1 - 1e-9)


def test_a_box_without_a_tool_tip_speaks_of_the_flange():
    plan = Plan(swing(4, 0.5, 1.0), FORMAT)
    corners = {"box_low": (-1, -1, 0), "box_high": (1, 1, 1.5)}
    line = lines(check_plan(plan, PANDA, settings=GateSettings(**corners)))["box"]
    assert line.status == "warn"
    assert line.text.startswith("flange at ")
    assert line.text.endswith("the tool is not checked: set tool_tip")
    meant = GateSettings(**corners, tool_tip=(0.0, 0.0, 0.0))
    again = lines(check_plan(plan, PANDA, settings=meant))["box"]
    assert (again.status, again.value) == ("pass", line.value)
    assert again.text.startswith("tool tip at ")


GRIPPER = PlanFormat((*FORMAT.names, "gripper"), (*FORMAT.units, "percent"), DT)


def opening(low, high, frames=5):
    """A gentle swing with a gripper that goes from low to high in so many frames, [percent]."""
    s = np.clip((np.arange(101) - 60) / frames, 0, 1)
    return np.column_stack([swing(4, 0.5, 1.0), low + (high - low) * s])


def test_columns_that_are_no_joints_are_named():
    report = lines(check_plan(Plan(opening(0, 62), GRIPPER), PANDA))
    assert report["joints"].text == "all 7 are in the plan; gripper: by range and speed"
    assert (report["range"].status, report["speed"].status) == ("unchecked", "unchecked")


@pytest.mark.parametrize(
    ("low", "high", "frames", "refused"),
    [
        (0.0, 62.0, 5, set()),
        (-1.0, 63.0, 5, set()),  # 4 % of 62 is 2.48; the spline goes 0.6 beyond the frames
        (-3.0, 62.0, 5, {"range"}),
        (0.0, 65.0, 5, {"range"}),
        (0.0, 62.0, 1, {"speed"}),  # five times as fast, though within the range at every frame
    ],
)
def test_a_gripper_is_held_against_what_was_shown(low, high, frames, refused):
    shown = np.stack([opening(0, 62, 5), opening(0, 62, 6)])
    outcomes = np.array([[0.5, 0.0], [0.6, 0.1]])
    demos = Demonstrations(shown, outcomes, GRIPPER, OutcomeFormat.metres(2))
    # However the band and the ringing of a step are judged, the others say what they say.
    wide = GateSettings(beyond_refuse=10.0, ranges=() if frames > 1 else (("gripper", -50, 150),))
    report = lines(check_plan(Plan(opening(low, high, frames), GRIPPER), PANDA, demos, wide))
    assert {name for name, line in report.items() if line.status == "refuse"} == refused
    for name in refused:
        assert report[name].joint == "gripper"
        assert report[name].unit == {"range": "percent", "speed": "percent/s"}[name]


def test_ranges_that_are_given_hold_instead_of_what_was_shown():
    shown = np.stack([opening(8, 70), opening(8, 70)])
    demos = Demonstrations(shown, [[0.5, 0.0], [0.6, 0.1]], GRIPPER, OutcomeFormat.metres(2))
    closed = np.column_stack([opening(8, 70)[:, :7], np.zeros(101)])
    assert lines(check_plan(Plan(closed, GRIPPER), PANDA, demos))["range"].status == "refuse"
    given = GateSettings(ranges=(("gripper", 0.0, 100.0),))
    at_its_end = lines(check_plan(Plan(closed, GRIPPER), PANDA, demos, given))["range"]
    assert (at_its_end.status, at_its_end.limit) == ("pass", pytest.approx(0.0, abs=1e-6))
    beyond = lines(check_plan(Plan(closed - np.eye(8)[7] * 0.01, GRIPPER), PANDA, None, given))
    assert beyond["range"].status == "refuse"
    assert "gripper at -0.01 percent, 0.01 beyond its end" in beyond["range"].text
    with pytest.raises(ConfigurationError, match="ranges names jaw, and columns are joint1"):
        check_plan(Plan(closed, GRIPPER), PANDA, settings=GateSettings(ranges=(("jaw", 0.0, 1.0),)))


def test_a_joint_may_be_given_a_narrower_range():
    narrow = GateSettings(ranges=(("joint4", -2.1, -1.6),))
    report = check_plan(Plan(swing(4, 0.5, 1.0), FORMAT), PANDA, settings=narrow)
    line = lines(report)["range"]
    assert (line.status, line.joint, line.unit) == ("refuse", "joint4", "rad")
    assert line.value == pytest.approx(-1.5)


def test_noise_of_a_gripper_that_is_held_is_no_speed():
    held = opening(8, 8)
    noise = np.zeros_like(held)
    noise[::2, 7] = 1e-12
    demos = Demonstrations(
        np.stack([held, held]), [[0.5, 0.0], [0.6, 0.1]], GRIPPER, OutcomeFormat.metres(2)
    )
    assert not check_plan(Plan(held + noise, GRIPPER), PANDA, demos).refused


def test_a_box_is_kept_by_any_arm_whose_kinematics_are_known():
    ur = robot_limits("ur5e")
    form = PlanFormat(ur.joint_names, ("rad",) * 6, 0.01)
    still = Plan(np.zeros((50, 6)), form)
    # Stretched out it is 0.817 m ahead.
    for reach, refused in ((0.85, False), (0.8, True)):
        box = GateSettings(box_low=(0, -1, -1), box_high=(reach, 1, 1))
        (line,) = [x for x in check_plan(still, ur, None, box).lines if x.check == "box"]
        assert (line.status == "refuse") == refused
        assert line.value == pytest.approx(0.8172)


def test_two_frames_one_cycle_apart_are_held_against_the_jerk_too():
    """The acceleration goes from 65 % of a cycle's largest step to as much below nothing."""
    step = 0.65 * PANDA.jerk * 1e-3 * 1e-6 / 6
    form = PlanFormat(FORMAT.names, FORMAT.units, 0.001)
    plan = Plan([HOME, HOME + step], form)
    line = lines(check_plan(plan, PANDA, settings=GateSettings(rest_speed=1e9)))["jerk"]
    assert line.status == "refuse"
    stream = np.abs(interpolate(plan.actions, 0.001).dddq).max(axis=0) / PANDA.jerk
    assert line.value / line.limit == pytest.approx(stream.max()) == pytest.approx(1.3)


def test_a_plan_that_takes_longer_than_any_does_is_refused_by_name():
    """As milliseconds given for seconds do; the gate looks at every millisecond."""
    form = PlanFormat(FORMAT.names, FORMAT.units, 12.5)
    with pytest.raises(InvalidPlanError, match=r"takes 1250 s, .* give dt \(now 12.5\) in seconds"):
        check_plan(Plan(swing(4, 0.5, 1.0), form), PANDA)


@pytest.mark.slow
@pytest.mark.parametrize(("dt", "frames"), [(0.01, 1001), (0.005, 2001), (0.002, 3001)])
def test_a_gripper_may_do_three_times_its_demonstrated_speed_however_fine_the_recording(dt, frames):
    s, form = np.linspace(0, 1, frames), replace(GRIPPER, dt=dt)

    def closing(opening, factor=1.0):
        u = np.clip(0.5 + factor * (s - 0.5), 0, 1)
        gripper = opening * (10 * u**3 - 15 * u**4 + 6 * u**5)
        return np.column_stack([np.tile(HOME, (frames, 1)), gripper])

    shown = Demonstrations([closing(60), closing(70)], [[0.5], [0.6]], form)
    for factor, refused in ((2.9, False), (3.1, True), (16, True), (34, True)):
        report = check_plan(Plan(closing(70, factor), form), PANDA, shown)
        line = lines(report)["speed"]
        assert (line.status == "refuse") == refused
        peak = 70 * 15 / 8 / (s[-1] * (frames - 1) * dt)
        assert line.value == pytest.approx(factor * peak, rel=0.02)
        assert line.limit == pytest.approx(3 * peak, rel=1e-3)
        assert f"of {line.limit:.4g} over 10 ms, 3 times what was demonstrated" in line.text


def test_a_gripper_that_was_held_is_said_to_have_been():
    held = opening(8, 8)
    shown = Demonstrations([held, held], [[0.5], [0.6]], GRIPPER)
    line = lines(check_plan(Plan(opening(8, 9), GRIPPER), PANDA, shown))["speed"]
    assert line.status == "refuse"
    assert "demonstrations held it still" in line.text


@pytest.mark.slow
def test_noise_of_a_fine_recording_allows_no_faster_gripper():
    """At 500 frames/s, half a percent of noise moves at hundreds of percent a second."""
    n, form = 3001, replace(GRIPPER, dt=0.002)
    s, rng = np.linspace(0, 1, n), np.random.default_rng(0)

    def closing(factor, noise):
        u = np.clip(0.5 + factor * (s - 0.5), 0, 1)
        gripper = 70 * (10 * u**3 - 15 * u**4 + 6 * u**5) + noise * rng.uniform(-1, 1, n)
        return np.column_stack([np.tile(HOME, (n, 1)), gripper])

    shown = Demonstrations([closing(1, 0.05), closing(1, 0.05)], [[0.5], [0.6]], form)
    assert lines(check_plan(Plan(shown.plans[0], form), PANDA, shown))["speed"].status == "pass"
    assert lines(check_plan(Plan(closing(8, 0), form), PANDA, shown))["speed"].status == "refuse"


def test_columns_named_after_other_quantities_of_a_joint_are_no_positions_and_named():
    names = ("delta_joint1", *FORMAT.names[1:])
    report = check_plan(Plan(swing(4, 0.5, 1.0), PlanFormat(names, FORMAT.units, DT)), PANDA)
    line = lines(report)["joints"]
    assert line.status == "warn"
    assert "not in the plan, so not checked: joint1" in line.text
    assert "no positions by their names: delta_joint1 (if they are, rename them)" in line.text
    form = PlanFormat((*FORMAT.names, "d_joint1"), (*FORMAT.units, "rad/s"), DT)
    both = np.column_stack([swing(4, 0.5, 1.0), np.zeros(101)])
    line = lines(check_plan(Plan(both, form), PANDA))["joints"]
    assert line.status == "warn"
    assert "all 7 are in the plan; d_joint1: by range and speed; no positions" in line.text


def test_the_band_follows_motions_of_any_frames_and_rate():
    """A plan at another rate is held against the same band, not against all frames at once."""
    shown = [Plan(swing(4, amplitude, 1.0), FORMAT) for amplitude in (0.4, 0.6)]
    back = resample_plan(Plan(swing(4, 0.5, 1.0)[::-1], FORMAT), 250)
    assert beyond_band(back, shown).max() > 0.5
    assert beyond_band(resample_plan(Plan(swing(4, 0.5, 1.0), FORMAT), 250), shown).max() == 0
    coarse = [resample_plan(each, 50) for each in shown]
    assert beyond_band(Plan(swing(4, 0.5, 1.0), FORMAT), [shown[0], coarse[1]]).max() == 0
    slower = Plan(swing(4, 0.5, 1.2)[::-1], FORMAT)
    assert beyond_band(slower, shown).max() == 0


def moved_by_bearing(only: list[int]):
    """Some demonstrations of V1, and what moves them."""
    shown = prior_reinforce.simulation.tasks.make_task("basketball-v1").demonstrations("A")
    shown = shown.only(only)
    return shown, make_generator("auto").fit(shown, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("only", [[0], [0, 1, 2, 3, 4, 5]])
@pytest.mark.parametrize("distance", [0.9, 1.0, 1.15])
def test_moved_demonstrations_are_within_their_own_band(only, distance):
    shown, generator = moved_by_bearing(only)
    r = shown.outcomes_seen[0] * distance
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    goal = turn @ r
    plan = Plan(generator.generate(goal[None])[0], shown.format)
    found = lines(check_plan(plan, PANDA, shown, condition=goal))
    assert found["demonstrations"].status == "pass", found["demonstrations"].text
    assert found["tempo"].status == "pass"
    if only == [0]:  # where it is not said what the plan is for, it is far from what was shown
        assert lines(check_plan(plan, PANDA, shown))["demonstrations"].status == "refuse"


def test_a_demonstration_is_not_played_at_any_tempo():
    shown, generator = moved_by_bearing([0])
    goal = shown.outcomes_seen[0] * 2.0
    plan = Plan(generator.generate(goal[None])[0], shown.format)
    line = lines(check_plan(plan, PANDA, shown, condition=goal))["tempo"]
    assert (line.status, line.limit) == ("refuse", 1.5)
    assert line.value == pytest.approx(np.exp(np.log(2.0) / shown.symmetry.moves[0].exponent))


def test_another_motion_than_the_moved_one_is_far_from_it():
    shown, generator = moved_by_bearing([0])
    goal = shown.outcomes_seen[0]
    backwards = Plan(generator.generate(goal[None])[0][::-1], shown.format)
    found = lines(check_plan(backwards, PANDA, shown, condition=goal))
    assert found["demonstrations"].status == "refuse"
