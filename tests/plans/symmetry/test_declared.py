"""Words of a person, and the symmetry that they mean."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.plans.kinematics import Chain, rotation, tool_tip
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.symmetry import (
    Amplitude,
    Learned,
    Shift,
    Tempo,
    TurnIncrements,
    TurnJoint,
    TurnPath,
    TurnPoses,
)
from prior_reinforce.plans.symmetry.declared import declare_symmetry

PANDA = robot_limits("panda").chain
JOINTS = PlanFormat(("gripper", *(f"joint{i}" for i in range(1, 8))), ("1",) + ("rad",) * 7, 0.01)
POSES = PlanFormat(("x", "y", "z", "rx", "ry", "rz"), ("m",) * 3 + ("rad",) * 3, 0.02)
STEPS = PlanFormat(("dx", "dy", "dyaw", "grip"), ("m", "m", "rad", "1"), 0.04)
UPSIDE_DOWN = Chain(
    ((0.1, 0.2, 0.0, np.pi, 0.0, 0.0), (0.0, 0.0, 0.3, np.pi / 2, 0.0, 0.0)),
    ((0.0, 0.0, 1.0),) * 2,
    (0.4, 0.0, 0.0, 0.0, 0.0, 0.0),
)
"""Its first joint stands at (0.1, 0.2) m, and counts clockwise."""
ARM = {"chain": PANDA, "joints": range(1, 8)}


def kinds(symmetry):
    return [type(move) for move in symmetry.moves]


def test_an_arm_that_carries_the_object_turns_about_its_base():
    symmetry = declare_symmetry(JOINTS, 2, about="base", steps=["gripper"], **ARM)
    assert kinds(symmetry) == [Tempo, TurnJoint]
    assert symmetry.moves[1] == TurnJoint(1, 1.0)
    assert symmetry.moves[0].steps == (0,)


@pytest.mark.parametrize("chain", [PANDA, robot_limits("ur5e").chain, UPSIDE_DOWN])
def test_a_turn_about_the_base_turns_where_the_tip_is_whichever_way_the_joint_counts(chain):
    n = len(chain.axes)
    form = PlanFormat(tuple(f"j{i}" for i in range(n)), ("rad",) * n, 0.01)
    symmetry = declare_symmetry(form, 2, about="base", chain=chain, joints=range(n))
    plan = np.random.default_rng(0).uniform(-0.5, 0.5, (5, n))
    moved = symmetry.move(plan, np.array([0.0, 0.3]))
    centre = np.array(symmetry.chart.centre)
    before, after = (tool_tip(chain, each)[:, :2] - centre for each in (plan, moved))
    cos, sin = np.cos(0.3), np.sin(0.3)
    np.testing.assert_allclose(after, before @ np.array([[cos, sin], [-sin, cos]]), atol=1e-6)


def test_a_distance_that_does_not_exist_is_named():
    form = PlanFormat(("x", "y"), ("m", "m"), 0.02)
    with pytest.raises(ConfigurationError, match=r"one of tempo, .*shift, got 'faster'"):
        declare_symmetry(form, 2, about="base", distance="faster")


@pytest.mark.parametrize(
    "setting", [{"exponent": np.inf}, {"exponent": 0.0}, {"release_frame": -1}]
)
def test_settings_of_a_tempo_that_cannot_be_are_named(setting):
    form = PlanFormat(("x", "y"), ("m", "m"), 0.02)
    with pytest.raises(ConfigurationError, match=f"{next(iter(setting))} .*, got"):
        declare_symmetry(form, 2, about="base", **setting)
    assert declare_symmetry(form, 2, about="base", exponent=-1.0).moves[0].exponent == -1.0


def test_an_object_at_a_place_is_turned_about_by_kinematics():
    symmetry = declare_symmetry(JOINTS, 2, about=(0.43, 0.0), **ARM)
    assert kinds(symmetry) == [Tempo, TurnPath]
    assert symmetry.chart.centre == (0.43, 0.0)


def test_poses_turn_with_their_attitude_or_are_shifted():
    assert declare_symmetry(POSES, 2, about="base").moves[1] == TurnPoses(vector=(3, 4, 5))
    assert declare_symmetry(POSES, 2, distance="shift").moves == (Shift(0), Shift(1))


@pytest.mark.parametrize(
    "form",
    [
        replace(POSES, periodic=("rx", "ry", "rz")),  # recorded in degrees
        PlanFormat(("x", "y", "z", "a", "b", "c"), ("m",) * 3 + ("rad",) * 3, 0.01),
    ],
)
def test_poses_whose_attitude_would_stay_behind_are_refused(form):
    with pytest.raises(ConfigurationError, match="are Euler angles"):
        declare_symmetry(form, 2, about="base")
    assert declare_symmetry(form, 2, distance="shift").moves == (Shift(0), Shift(1))


def test_increments_are_played_turned_and_shifted_as_such():
    symmetry = declare_symmetry(STEPS, 2, about=(0.2, 0.1), start=(0.1, 0.1), steps=["grip"])
    turn = TurnIncrements((0.1, 0.1), (0.2, 0.1), yaw=2)
    assert symmetry.moves == (Tempo(steps=(3,), increments=(0, 1, 2)), turn)
    assert declare_symmetry(STEPS, 2, distance="shift").increments == (0, 1)


@pytest.mark.parametrize(
    ("names", "left"),
    [
        (("x", "y", "theta"), "theta"),  # a heading, were it called yaw
        (("x", "y", "vx", "vy"), "vx, vy"),
        (("x", "y", "x2", "y2"), "x2, y2"),
        (("x", "y", "z", "r11", "r12", "r13"), "r11, r12, r13"),
        (("x", "y", "q0", "q1", "q2", "q3"), "q0, q1, q2, q3"),
        (("dx", "dy", "drx", "dry"), "drx, dry"),
        (("dx", "dy", "dtheta"), "dtheta"),
        (("x", "y", "gripper_yaw"), "gripper_yaw"),
        (("x", "y", "finger_x", "jaw_angle", "gripper_vx"), "finger_x, gripper_vx"),
        (("x", "y", "gripper_pose_0", "gripper_rot_1"), "gripper_pose_0, gripper_rot_1"),
        (("x", "y", "z", "pitch", "roll"), "pitch, roll"),
        (("x", "y", "gripper_qw", "gripper_width"), "gripper_qw"),
    ],
)
def test_what_a_turn_would_leave_behind_is_refused_until_it_is_named(names, left):
    form = PlanFormat(names, ("1",) * len(names), 0.04)
    with pytest.raises(ConfigurationError, match=f"a turn would leave {left} as recorded"):
        declare_symmetry(form, 2, about=(0.0, 0.0))
    unmoved = left.split(", ")
    assert declare_symmetry(form, 2, about=(0.0, 0.0), stays=unmoved).moves[0].steps == ()
    assert declare_symmetry(form, 2, about=(0.0, 0.0), steps=unmoved).moves[0].steps == tuple(
        names.index(name) for name in unmoved
    )


def test_what_a_turn_leaves_is_made_larger_all_the_same():
    form = PlanFormat(("x", "y", "z", "pitch"), ("m",) * 3 + ("rad",), 0.02)
    symmetry = declare_symmetry(
        form, 2, about="base", distance="amplitude", exponent=1.0, stays=["pitch"]
    )
    plan = np.array([[0.3, 0.0, 0.1, 0.0], [0.4, 0.0, 0.3, 0.2]])
    moved = symmetry.move(plan, np.array([np.log(2.0), 0.5]))
    np.testing.assert_allclose(moved[:, 2:], [[0.1, 0.0], [0.5, 0.4]])


def test_a_shift_knows_every_place():
    form = PlanFormat(
        ("x", "y", "z", "x2", "y2", "theta", "jaw_width"), ("m",) * 5 + ("rad", "m"), 0.04
    )
    with pytest.raises(ConfigurationError, match="a shift would leave x2, y2 as recorded"):
        declare_symmetry(form, 2, distance="shift")
    one = PlanFormat(("dx", "dy", "theta", "width"), ("m", "m", "rad", "m"), 0.04)
    assert declare_symmetry(one, 2, distance="shift").moves == (Shift(0, 8), Shift(1, 8))


@pytest.mark.parametrize(
    ("names", "left"),
    [
        (("x", "y", "z", "right_x", "right_y", "right_z"), "right_x, right_y, right_z"),
        (("x", "y", "target_x", "pose_x", "p2x", "x2"), "target_x, pose_x, p2x, x2"),
        (("dx", "dy", "right_dx", "right_dy"), "right_dx, right_dy"),
        (("x", "y", "gripper_x", "gripper"), "gripper_x"),
    ],
)
def test_a_shift_knows_places_by_name_where_units_were_guessed(names, left):
    form = PlanFormat(names, ("m", "m", *("rad",) * (len(names) - 2)), 0.04)
    with pytest.raises(ConfigurationError, match=f"a shift would leave {left} as recorded"):
        declare_symmetry(form, 2, distance="shift")
    declare_symmetry(form, 2, distance="shift", stays=left.split(", "))


@pytest.mark.parametrize(
    ("names", "unit"),
    [
        *((names, "rad") for names in ("quat_w quat_x quat_y quat_z", "rot_x rot_y", "rx ry rz")),
        *((f"{angle}_x {angle}_y {angle}_z", "rad") for angle in ("euler", "axis_angle", "angle")),
        ("vx", "m/s"),
        ("force_x force_y", "N"),
        ("torque_x", "Nm"),
    ],
)
def test_a_shift_leaves_attitudes_rates_and_forces(names, unit):
    names = names.split()
    form = PlanFormat(("x", "y", *names), ("m", "m", *(unit,) * len(names)), 0.04)
    assert declare_symmetry(form, 2, distance="shift").moves == (Shift(0), Shift(1))


@pytest.mark.parametrize(
    "name",
    [
        *("gripper_angle", "finger_angle", "jaw_angle", "gripper_rotation", "gripper_pose", "hand"),
        *("right_hand", "drive_joint", "magnet", "trigger", "pump", "valve", "tool_do", "finger_1"),
    ],
)
def test_openings_are_right_in_any_place(name):
    form = PlanFormat((name, *JOINTS.names[1:]), ("rad",) * 8, 0.01)
    assert kinds(declare_symmetry(form, 2, about="base", **ARM)) == [Tempo, TurnJoint]


def test_about_the_vertical_only_yaw_turns():
    form = PlanFormat(("x", "y", "z", "pitch", "yaw"), ("m",) * 3 + ("rad",) * 2, 0.01)
    assert declare_symmetry(form, 2, about="base").moves[1] == TurnPoses(yaw=4)


@pytest.mark.parametrize("about", ["base", (0.43, 0.0)])
def test_what_moves_beside_an_arm_is_refused_until_it_is_named(about):
    left = ["base_x", "base_theta", "left_elbow"]
    openings = ["gripper", "gripper_width", "finger_1", "gripper_position"]
    names = (*openings, *JOINTS.names[1:], *left)
    form = PlanFormat(names, ("1",) * 4 + ("rad",) * 10, 0.01)
    said = {"about": about, "chain": PANDA, "joints": range(4, 11)}
    with pytest.raises(ConfigurationError, match=f"would leave {', '.join(left)} as recorded"):
        declare_symmetry(form, 2, **said)
    assert declare_symmetry(form, 2, stays=left, **said).moves[0].steps == ()


@pytest.mark.parametrize("about", ["base", (0.43, 0.0)])
@pytest.mark.parametrize(("prefix", "unit"), [("", "rad/s"), ("delta_", "rad")])
def test_rates_and_increments_of_joints_are_not_turned(about, prefix, unit):
    names = tuple(prefix + name for name in JOINTS.names[1:])
    form = PlanFormat(names, (unit,) * 7, 0.01)
    with pytest.raises(ConfigurationError, match=r"joint1.* are no positions"):
        declare_symmetry(form, 2, about=about, chain=PANDA, joints=range(7))


@pytest.mark.parametrize("said", [{"distance": "shift"}, {"about": "base"}])
def test_rates_of_a_hand_are_neither_shifted_nor_turned(said):
    """The way to the moved start is a way a frame."""
    form = PlanFormat(("dx", "dy"), ("m/s", "m/s"), 0.01)
    with pytest.raises(ConfigurationError, match="dx, dy are no positions"):
        declare_symmetry(form, 2, **said)


def test_one_number_a_plan_is_turned_or_refused_where_it_is_a_place_or_heading():
    names = ("x", "y", "aim_x", "aim_y", "heading", "stiffness")
    form = PlanFormat(names, ("m",) * 4 + ("rad", "1"), 0.01, per_plan=names[2:])
    with pytest.raises(ConfigurationError, match="would leave aim_x, aim_y, heading as recorded"):
        declare_symmetry(form, 2, about="base")


@pytest.mark.parametrize(
    ("names", "units", "distance", "wrong"),
    [
        (("q", "a"), ("rad", "m/s^2"), "tempo", ["a"]),
        (("q", "tau", "grip_force"), ("rad", "Nm", "N"), "amplitude", ["tau"]),
        (("q", "release_time"), ("rad", "s"), "tempo", ["release_time"]),
        (("q", "qw", "qx", "qy", "qz"), ("rad",) * 5, "amplitude", ["qw", "qx", "qy", "qz"]),
    ],
)
def test_what_cannot_be_scaled_is_refused_until_it_is_named(names, units, distance, wrong):
    form = PlanFormat(names, units, 0.01)
    with pytest.raises(ConfigurationError, match=rf"{', '.join(wrong)} would not be right"):
        declare_symmetry(form, 1, distance=distance)
    stay = declare_symmetry(form, 1, distance=distance, steps=wrong).moves[0].steps
    assert [names[i] for i in stay] == wrong


@pytest.mark.parametrize("unit", ["rad/s", "rad/sec", "rpm"])
def test_rates_are_played_as_what_they_add_up_to(unit):
    """Velocities of a motion that is played twice as fast are twice as large."""
    form = PlanFormat(("joint1", "speed2"), ("rad", unit), 0.02)
    t = np.arange(60) / 59
    plan = np.column_stack([t**2 * (3 - 2 * t), 6 * t * (1 - t) / (59 * 0.02)])
    symmetry = declare_symmetry(form, 1, exponent=1.0)
    np.testing.assert_allclose(symmetry.move(plan, np.array([0.0])), plan, atol=1e-9)
    moved = symmetry.move(plan, np.array([np.log(2.0)]))
    assert np.ptp(moved[:, 0]) == pytest.approx(1.0, abs=1e-3)
    assert moved[:, 1].sum() * 0.02 == pytest.approx(1.0, abs=0.02)
    assert moved[:, 1].max() == pytest.approx(2 * plan[:, 1].max(), rel=0.02)


def test_neither_leaves_a_scaling_of_one_outcome():
    assert kinds(declare_symmetry(JOINTS, 1)) == [Tempo]
    assert kinds(declare_symmetry(JOINTS, 1, distance="amplitude")) == [Amplitude]
    clock = declare_symmetry(JOINTS, 1, release_frame=56.0).moves[0]
    assert (clock.about, clock.keep_horizon) == (56.0, True)


@pytest.mark.parametrize(
    ("form", "k", "said", "message"),
    [
        (JOINTS, 2, {}, "needs an axis"),
        (JOINTS, 2, {"about": "base"}, r"name the arm .*chain=robot_limits\('ur5e'\).chain"),
        (PlanFormat(("delta_x",), ("m",), 0.1), 2, {"about": "base"}, "increments dx and dy"),
        (JOINTS, 2, {"about": "carried", **ARM}, r"'base' .*\(x, y\).*None.*got 'carried'"),
        (JOINTS, 2, {"about": (0.4, 0.0, 0.1), **ARM}, r"'base' .*\(x, y\)"),
        (JOINTS, 2, {"about": ("a", "b"), **ARM}, r"'base' .*\(x, y\)"),
        (JOINTS, 2, {"about": (float("nan"), 0.0), **ARM}, r"'base' .*\(x, y\)"),
        (JOINTS, 2, {"distance": "shift"}, "needs plans with x and y"),
        (JOINTS, 3, {"about": "base", **ARM}, "outcomes have 3 components"),
        (JOINTS, 1, {"steps": ["hand"]}, r"steps names \['hand'\]"),
        (JOINTS, 1, {"stays": ["hand"]}, r"stays names \['hand'\]"),
    ],
)
def test_what_cannot_be_done_is_refused_by_name(form, k, said, message):
    with pytest.raises(ConfigurationError, match=message):
        declare_symmetry(form, k, **said)


def test_an_arm_on_a_wall_has_no_upright_base():
    wall = Chain(((0, 0, 0, np.pi / 2, 0, 0),) * 2, ((0.0, 0.0, 1.0),) * 2)
    form = PlanFormat(("a", "b"), ("rad", "rad"), 0.01)
    with pytest.raises(ConfigurationError, match=r"leans by 90 degrees .* --symmetry"):
        declare_symmetry(form, 2, about="base", chain=wall, joints=(0, 1))


def leaning(by):
    """The UR5e on a mount that leans about x."""
    chain = robot_limits("ur5e").chain
    return replace(chain, origins=((0.0, 0.0, 0.1625, by, 0.0, 0.0), *chain.origins[1:]))


UR_FORM = PlanFormat(tuple("abcdef"), ("rad",) * 6, 0.01)


@pytest.mark.parametrize("lean", [0.002, 0.01, 0.04, np.radians(2.99), np.pi - 0.01])
def test_a_mount_that_leans_a_little_is_turned_by_its_first_joint(lean):
    chain = leaning(lean)
    symmetry = declare_symmetry(UR_FORM, 2, about="base", chain=chain, joints=range(6))
    assert symmetry.moves[1] == TurnJoint(0, 1.0 if lean < 1 else -1.0)
    plan = np.tile([0.2, -1.0, 1.5, -1.0, -1.5, 0.3], (3, 1))
    moved = symmetry.move(plan, np.array([0.0, 0.35]))
    turn = rotation(0.0, 0.0, 0.35)
    off = tool_tip(chain, moved) - tool_tip(chain, plan) @ turn.T
    reach = 1.3
    assert np.linalg.norm(off, axis=1).max() < min(lean, np.pi - lean) * reach * 0.35


@pytest.mark.parametrize("lean", [0.06, np.pi - 0.06])
def test_a_mount_that_leans_by_more_is_refused(lean):
    arm = {"chain": leaning(lean), "joints": range(6)}
    with pytest.raises(ConfigurationError, match=r"leans by 3\.44 degrees.*--symmetry \"0 0\""):
        declare_symmetry(UR_FORM, 2, about="base", **arm)
    turned = declare_symmetry(UR_FORM, 2, about=(0.0, 0.0), **arm)
    assert turned.moves[1].centre == (0.0, 0.0)
    plan = np.tile([0.2, -1.0, 1.5, -1.0, -1.5, 0.3], (3, 1))
    places = [
        tool_tip(arm["chain"], each) for each in (plan, turned.move(plan, np.array([0.0, 0.3])))
    ]
    turn = rotation(0.0, 0.0, 0.3)
    np.testing.assert_allclose(places[1], places[0] @ turn.T, atol=1e-3)


def test_a_place_on_the_first_axis_is_turned_about_by_that_joint():
    """Inverse kinematics would have to be exact where a wrist is singular."""
    for chain, place in ((UPSIDE_DOWN, (0.1, 0.2)), (leaning(0.01), (0.0, 0.0016))):
        n = len(chain.axes)
        form = PlanFormat(tuple(f"j{i}" for i in range(n)), ("rad",) * n, 0.01)
        for about, kind in ((place, TurnJoint), ((place[0] + 0.1, place[1]), TurnPath)):
            found = declare_symmetry(form, 2, about=about, chain=chain, joints=range(n))
            assert isinstance(found.moves[1], kind)


def test_ranges_are_those_of_the_joints_that_are_turned():
    ranges = [(-2.9, 2.9), *[(-1.0, 1.0)] * 6]
    turn = declare_symmetry(JOINTS, 2, about="base", ranges=ranges, **ARM).moves[1]
    assert turn == TurnJoint(1, 1.0, range=(-2.9, 2.9))
    path = declare_symmetry(JOINTS, 2, about=(0.43, 0.0), ranges=ranges, **ARM).moves[1]
    assert path.ranges == tuple(ranges)


def test_all_but_the_bearing_may_be_left_to_the_demonstrations():
    symmetry = declare_symmetry(JOINTS, 3, about="base", distance="learned", **ARM)
    assert kinds(symmetry) == [Learned, TurnJoint, Learned]
    assert symmetry.name == "turn"
    np.testing.assert_array_equal(symmetry.learned, [True, False, True])
    with pytest.raises(ConfigurationError, match="say distance = 'learned'"):
        declare_symmetry(JOINTS, 3, about="base", **ARM)
    for k, about, why in ((2, None, "a turn is all that is known"), (1, "base", "one component")):
        with pytest.raises(ConfigurationError, match=why):
            declare_symmetry(JOINTS, k, about=about, distance="learned", **ARM)


@pytest.mark.parametrize("distance", ["amplitude", "learned", "shift"])
def test_a_release_frame_is_refused_where_no_tempo_uses_it(distance):
    with pytest.raises(ConfigurationError, match="release_frame says"):
        declare_symmetry(JOINTS, 2, about="base", distance=distance, release_frame=56.0, **ARM)


def test_a_release_frame_says_that_a_clock_releases():
    assert declare_symmetry(JOINTS, 2, about="base", release_frame=56.0, **ARM).clocked
    assert not declare_symmetry(JOINTS, 2, about="base", **ARM).clocked
