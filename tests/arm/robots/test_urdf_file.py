"""URDFs of makers' forms are read rightly, or refused for a fault of theirs."""

import re

import numpy as np
import pytest

from prior_reinforce.arm.robots.urdf import read_urdf
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import FileFormatError, UnclearFlangeError
from prior_reinforce.plans.kinematics import tool_tip
from tests.arm.robots.descriptions import HEAD, J, Urdf, arm, fingers, fixed, wheels

UR = [f"{n}_joint" for n in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2")]
UR.append("wrist_3_joint")
PANDA = [f"panda_joint{i}" for i in range(1, 8)]
SEVEN = [f"joint_{i}" for i in range(1, 8)]
SIX = [f"joint{i}" for i in range(1, 7)]
NAMED = ("dont_collapse", "joint_properties", "deceleration", "stiffness")
"""Words that are passed over, and named."""
SO = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
WX = ["waist", "shoulder", "elbow", "wrist_angle", "wrist_rotate"]
YAWED = {"rpy": (0.0, 0.0, -0.2)}
"""What a base link above may be against the root without another base frame (`test_urdf`)."""
LIFT = J("torso_lift_joint", "torso_lift_link", "prismatic", low=0.0, high=0.4, speed=0.1, **YAWED)
SOFT = (
    '<safety_controller soft_lower_limit="-2" soft_upper_limit="2" k_position="9" k_velocity="9"/>'
)
MOTOR = '<dynamics damping="0.5" friction="0.1"/>'
GAZEBO = '<gazebo reference="base_link"><material>Gazebo/Grey</material></gazebo>\n'
CONTROL = (
    '<ros2_control name="arm" type="system"><hardware><plugin>a/B</plugin></hardware>'
    '<joint name="joint1"><command_interface name="position"/></joint></ros2_control>\n'
)
TRANSMISSION = (
    '<transmission name="t"><type>a/Simple</type><joint name="joint1"><hardwareInterface>p'
    '</hardwareInterface></joint><actuator name="m"><mechanicalReduction>50</mechanicalReduction>'
    "</actuator></transmission>\n"
)


def numbered(n, **more):
    return arm(SIX[:n], [f"link{i + 1}" for i in range(n)], **more)


def side(word, names=("shoulder", "elbow", "wrist"), of="torso"):
    first, *rest = arm([f"{word}_{n}_joint" for n in names])
    return [J(**{**vars(first), "of": of}), *rest]


READ = [
    Urdf("ur", [*arm(UR), fixed("flange_joint", "flange"), fixed("tool0_joint", "tool0")]),
    Urdf(
        "ur with a prefix",
        [*arm([f"left_{n}" for n in UR]), fixed("t", "left_tool0")],
        tip="left_tool0",
    ),
    Urdf(
        "ur on a table", [fixed("on_table", "mount"), *arm(UR), fixed("t", "tool0")], root="world"
    ),
    Urdf(
        "ur with a gripper behind tool0",
        [*arm(UR), fixed("t", "tool0"), fixed("g", "hand"), *fingers("hand", "revolute")],
        tip="tool0",
    ),
    Urdf("a preset's name", [*arm(UR), fixed("t", "tool0")], name='name="ur5e"'),
    Urdf("franka", [*arm(PANDA), fixed("panda_joint8", "panda_link8")], tip="panda_joint7_link"),
    Urdf(
        "franka with a hand",
        [
            *arm(PANDA),
            fixed("panda_joint8", "panda_link8"),
            fixed("hand_joint", "hand"),
            *fingers("hand"),
        ],
        tip="panda_joint7_link",
    ),
    Urdf(
        "franka to its hand",
        [*arm(PANDA), fixed("hand_joint", "panda_hand"), *fingers("panda_hand")],
        {"tip": "panda_hand"},
        name='name="panda"',
    ),
    Urdf("xarm", [*numbered(6), fixed("joint_eef", "link_eef")]),
    Urdf(
        "xarm with a gripper",
        [
            *numbered(6),
            fixed("joint_eef", "link_eef"),
            J("drive_joint", "left_outer_knuckle"),
            J(
                "right_joint",
                "right_outer_knuckle",
                of="link_eef",
                more='<mimic joint="drive_joint"/>',
            ),
        ],
        tip="link_eef",
    ),
    Urdf(
        "kinova with continuous joints",
        [
            *[
                J(n, f"{n}_link", "continuous" if i % 2 == 0 else "revolute")
                for i, n in enumerate(SEVEN)
            ],
            fixed("end_effector", "end_effector_link"),
        ],
        {"tip": "end_effector_link"},
    ),
    Urdf(
        "kinova without a hand", [J(n, f"{n}_link", "continuous", axis=(0, 0, -1)) for n in SEVEN]
    ),
    Urdf(
        "so101 to its wrist",
        [*arm(SO), J("gripper", "moving_jaw", low=-0.17, high=1.74)],
        {"tip": "wrist_roll_link"},
    ),
    Urdf(
        "so101 without a jaw", [*arm(SO), fixed("g", "gripper_frame_link")], tip="wrist_roll_link"
    ),
    Urdf(
        "widowx to its gripper",
        [*arm(WX), J("gripper", "gripper_prop", "continuous"), *fingers("gripper_prop")],
        {"tip": "wrist_rotate_link"},
    ),
    Urdf(
        "viperx",
        [
            *arm([*WX[:3], "forearm_roll", *WX[3:]]),
            fixed("ee_arm", "ee_arm_link"),
            fixed("gb", "gripper_bar"),
            *fingers("gripper_bar"),
        ],
        tip="wrist_rotate_link",
    ),
    Urdf(
        "fetch above its lift",
        [
            *wheels(n=2),
            J(**{**vars(LIFT), "of": "base_link"}),
            *arm(SEVEN),
            fixed("g", "gripper_link"),
            *fingers("gripper_link"),
        ],
        {"base": "torso_lift_link"},
        tip="joint_7_link",
    ),
    Urdf(
        "tiago with its lift held",
        [LIFT, *arm(SEVEN), fixed("t", "arm_tool_link")],
        {"hold": "torso_lift_joint=0.15", "tip": "arm_tool_link"},
        tip="arm_tool_link",
    ),
    Urdf(
        "pr2's right arm",
        [J(**{**vars(LIFT), "to": "torso"}), *side("l", SEVEN), *side("r", SEVEN)],
        {"base": "torso", "tip": "r_joint_7_link"},
    ),
    Urdf(
        "an arm on a rail",
        [
            J("rail", "carriage", "prismatic", low=0.0, high=3.0, **YAWED),
            *arm(UR),
            fixed("t", "tool0"),
        ],
        {"base": "carriage"},
    ),
    Urdf(
        "a waist that is held",
        [J("waist_yaw", "torso"), *arm(UR), fixed("t", "tool0")],
        {"hold": "waist_yaw=0.7"},
    ),
    Urdf(
        "a mobile manipulator",
        [*wheels(), J("j1", "a", of="base_link"), *arm(["j2", "j3", "j4"])],
        tip="j4_link",
    ),
    Urdf(
        "a planar base",
        [J("drive", "chassis", "planar", **YAWED), *arm(SIX)],
        {"base": "chassis"},
        root="odom",
    ),
    Urdf(
        "a floating base",
        [J("free", "chassis", "floating", low=None, high=None, speed=None), *arm(SIX)],
        {"hold": "free=0"},
        root="world",
    ),
    Urdf(
        "two arms, one asked for",
        [fixed("b", "torso"), *side("left"), *side("right")],
        {"tip": "left_wrist_link"},
    ),
    Urdf(
        "a head beside the arm",
        [fixed("b", "torso"), *side("head", ("pan", "tilt")), *side("arm", ("a", "b", "c"))],
        tip="arm_c_link",
    ),
    Urdf(
        "two arms with tool0 each",
        [
            fixed("b", "torso"),
            *side("left"),
            fixed("lt", "left_tool0"),
            *side("right"),
            fixed("rt", "right_tool0"),
        ],
        {"tip": "right_tool0"},
    ),
    Urdf(
        "flange and tool0, with a prefix",
        [*arm(SIX), fixed("f", "r1_flange"), fixed("t", "r1_tool0")],
        tip="r1_tool0",
    ),
    Urdf(
        "dont_collapse",
        [*numbered(6), fixed("cam", "cam_link", attributes='dont_collapse="true"')],
        tip="link6",
    ),
    Urdf(
        "dont_collapse in the arm",
        [fixed("m", "mount", attributes='dont_collapse="true"'), *numbered(6)],
    ),
    Urdf(
        "<joint_properties> of a wheel",
        [
            J(
                "wheel",
                "wheel_link",
                "continuous",
                more='<joint_properties friction="0"/>',
                speed=None,
            ),
            J("a", "a_link", of="base_link"),
            J("b", "b_link"),
        ],
        tip="b_link",
    ),
    Urdf("<joint_properties> of the arm", arm(SIX, more='<joint_properties damping="0.1"/>')),
    Urdf(
        "<hardwareInterface> in a joint", arm(SIX, more="<hardwareInterface>p</hardwareInterface>")
    ),
    Urdf(
        "drake's acceleration",
        arm(SIX, limit='effort="9" drake:acceleration="9"'),
        name='name="a" xmlns:drake="http://drake.mit.edu"',
    ),
    Urdf(
        "drake's acceleration, whose prefix nobody declared",
        arm(SIX, limit='effort="9" drake:acceleration="9"'),
        before=f"{HEAD}<!-- see: drake.mit.edu -->\n",
    ),
    Urdf("acceleration and jerk", arm(SIX, limit='acceleration="8" deceleration="8" jerk="400"')),
    Urdf("deceleration alone", arm(SIX, limit='deceleration="8"')),
    Urdf("another word in <limit>", arm(SIX, limit='stiffness="3"')),
    Urdf("drake's namespace for all", arm(SIX), name='name="a" xmlns="http://drake.mit.edu"'),
    Urdf("soft limits", arm(SIX, more=SOFT)),
    Urdf("dynamics and calibration", arm(SIX, more=f'{MOTOR}<calibration rising="0.0"/>')),
    Urdf("transmissions", numbered(6), more=TRANSMISSION, tip="link6"),
    Urdf("gazebo", numbered(6), more=GAZEBO, tip="link6"),
    Urdf("ros2_control", numbered(6), more=CONTROL, tip="link6"),
    Urdf(
        "comments and a licence", arm(SIX), before=f"{HEAD}<!-- made by xacro -->\n<!-- (c) -->\n"
    ),
    Urdf("effort 0", arm(SIX, limit='effort="0"')),
    Urdf("no effort", arm(SIX, limit="")),
    Urdf("names with blanks", arm([f"Revolute {i}" for i in range(1, 7)])),
    Urdf("names in Chinese", arm([f"关节{i}" for i in range(1, 7)])),
    Urdf("no name of the robot", arm(SIX), name=""),
    Urdf("an axis to two digits", [*arm(SIX[:1]), J("b", "b_link", axis=(0.71, 0.0, 0.71))]),
    Urdf(
        "a joint of an unknown type off the arm",
        [J("b", "ball_link", "ball"), J("a", "a_link", of="base_link"), J("c", "c_link")],
        tip="c_link",
    ),
    Urdf("Windows' line ends", arm(SIX), change=("\n", "\r\n")),
    Urdf("without a declaration", arm(SIX), before=""),
]
ASKED = [
    Urdf("a jaw behind the wrist", [*arm(SO), J("gripper", "jaw")], says="--tip: wrist_roll_link"),
    Urdf(
        "numbers for names",
        [*arm(list("12345"), ["a", "b", "c", "d", "gripper"]), J("6", "moving_jaw")],
        says="--tip: gripper",
    ),
    Urdf(
        "a drive that others follow",
        [
            *numbered(6),
            fixed("g", "robotiq_base"),
            J("drive", "pad"),
            J("other", "other_pad", of="robotiq_base", more='<mimic joint="drive"/>'),
        ],
        says="--tip: link6",
    ),
    Urdf(
        "three fingers",
        [*numbered(6), *[J(f"f{i}", f"tip{i}", of="link6") for i in range(3)]],
        says="--tip: link6",
    ),
    Urdf(
        "a continuous gripper",
        [*arm(WX), J("gripper", "prop", "continuous"), *fingers("prop")],
        says="--tip: wrist_rotate_link",
    ),
]
REFUSED = [
    Urdf("two arms", [fixed("b", "torso"), *side("left"), *side("right")], says="with --tip"),
    Urdf(
        "two arms with flange and tool0 each",
        [
            fixed("b", "torso"),
            *side("left"),
            fixed("lf", "left_flange"),
            fixed("lt", "left_tool0"),
            *side("right"),
            fixed("rf", "right_flange"),
            fixed("rt", "right_tool0"),
        ],
        says="ends in left_tool0, right_tool0; say which",
    ),
    Urdf("an arm on a lift", [LIFT, *arm(SEVEN)], says="--base torso_lift_link"),
    Urdf(
        "a lift that slides behind the arm",
        [*arm(SIX), J("slide", "tool", "prismatic")],
        {"tip": "tool"},
        says="--tip joint6_link",
    ),
    Urdf("velocity 0", arm(SIX, speed=0.0), says=f"no velocity limit of {', '.join(SIX)}; "),
    Urdf("no limits", arm(SIX, low=None, high=None), says="no range"),
    Urdf("a range of 100 rad", arm(SIX, low=-100.0, high=100.0), says="no range within 12.57"),
    Urdf("speed of a placeholder", arm(SIX, speed=1000.0), says="velocity limit of 1000"),
    Urdf(
        "acceleration of some joints",
        [*arm(SIX[:3]), *arm(SIX[3:], limit='acceleration="9"')],
        says="no acceleration limit of joint1, joint2, joint3; ",
    ),
    Urdf("a slip in <limit>", arm(SIX), change=("velocity=", "velocty="), says="is it velocity?"),
    Urdf("a slip in <mimic>", arm(SIX, more='<mimc joint="joint1"/>'), says="is it <mimic>?"),
    Urdf(
        "a number of xacro",
        arm(SIX),
        change=('xyz="0 0.1 0.2"', 'xyz="0 0 ${h}"'),
        says="xacro arm",
    ),
    Urdf(
        "a macro of xacro",
        arm(SIX),
        name='xmlns:xacro="http://www.ros.org/wiki/xacro"',
        more='<xacro:arm prefix=""/>',
        says="xacro arm.urdf.xacro",
    ),
    Urdf(
        "a name of xacro",
        arm(SIX),
        change=("joint3", "${prefix}joint3"),
        says="xacro arm.urdf.xacro",
    ),
    Urdf(
        "a link that is not there",
        arm(SIX),
        change=('<link name="joint3_link"/>', ""),
        says="joint3_link', which is no link",
    ),
    Urdf(
        "a second arm of which nobody said which is meant",
        [
            fixed("b", "torso"),
            *side("left"),
            fixed("lt", "tool0"),
            *side("right"),
            fixed("rt", "right_tool0"),
        ],
        says="ends in tool0, right_tool0; say which",
    ),
    Urdf(
        "a palletizer, whose tool is kept level",
        [*arm(SIX[:3]), J("level", "level_link", more='<mimic joint="joint3"/>'), *arm(["joint5"])],
        {"hold": "level=0"},
        says="joint level follows joint3 (<mimic>), and does not stand still",
    ),
    Urdf(
        "parallel linkage",
        [*arm(SIX[:2]), J("p", "p_link", more='<mimic joint="joint2"/>')],
        {"tip": "p_link"},
        says="joint p follows another (<mimic> of joint2)",
    ),
    Urdf(
        "MuJoCo's format",
        arm(SIX),
        change=("robot", "mujoco"),
        says="begins with <mujoco>, not <robot>: MuJoCo's format is not read; give the URDF",
    ),
    Urdf("SDF", arm(SIX), change=("robot", "sdf"), says="SDF is not read; give the URDF"),
    Urdf(
        "an argument of xacro",
        arm(SIX),
        change=("joint3", "$(arg prefix)joint3"),
        says="xacro arm.urdf.xacro",
    ),
    *[
        Urdf(
            f"an unknown attribute of <{part}>",
            arm(SIX),
            change=(f"<{part} ", f'<{part} frame="world" '),
            says=f"joint1 has an unknown frame in <{part}>; take it out",
        )
        for part in ("origin", "axis")
    ],
    Urdf("a gripper alone", fingers("base_link", "revolute"), says="--tip"),
    Urdf(
        "a base that is not on the way",
        [*wheels(n=1), J("a", "a_link", of="base_link"), J("c", "c_link")],
        {"base": "wheel_0", "tip": "c_link"},
        says="wheel_0 is not on the way",
    ),
    Urdf(
        "a joint to hold that is not there", arm(SIX), {"hold": "lift=0.2"}, says="no joint 'lift'"
    ),
]


def labelled(descriptions):
    return [pytest.param(each, id=each.label) for each in descriptions]


def of_new(options):
    return [word for name, value in options.items() for word in (f"--{name}", value)]


@pytest.mark.parametrize("given", labelled(READ))
def test_a_description_is_read_with_the_right_values(run, tmp_path, given):
    path = tmp_path / "arm.urdf"
    path.write_text(given.text(), newline="")
    status, out, err = run("new", tmp_path / "w", "--robot", path, *of_new(given.options))
    assert status == 0, err
    with Workspace(tmp_path / "w") as workspace:
        robot = workspace.manifest.robot
    tip = given.tip or given.options.get("tip") or given.joints[-1].to
    base = given.options.get("base") or given.root
    held = dict(pair.split("=") for pair in given.options.get("hold", "").split() if pair)
    held = {name: float(position) for name, position in held.items()}
    assert robot.held == held  # and so recordings are compared with it
    way, link = [], tip
    moves = {j.to: (j, j.of or (given.joints[i - 1].to if i else given.root))
             for i, j in enumerate(given.joints)}  # fmt: skip
    while link != base:
        way.insert(0, moves[link][0])
        link = moves[link][1]
    turning = [j for j in way if j.kind in ("revolute", "continuous") and j.name not in held]
    assert robot.joint_names == tuple(j.name for j in turning)
    soft = any(j.more == SOFT for j in way)
    for joint, low, high, speed in zip(
        turning, robot.lower, robot.upper, robot.velocity, strict=True
    ):
        ends = (-4 * np.pi, 4 * np.pi) if joint.kind == "continuous" else (joint.low, joint.high)
        np.testing.assert_allclose([low, high], (-2, 2) if soft else ends)
        assert speed == joint.speed
    for key in ("acceleration", "jerk"):
        stated = re.search(rf'(?<![a-z]){key}="(\d+)"', turning[0].limit)
        found = getattr(robot, key)
        assert stated is None if found is None else set(found) == {float(stated[1])}
    q = np.random.default_rng(1).uniform(-1, 1, len(turning))
    positions = {j.name: angle for j, angle in zip(turning, q, strict=True)} | held
    described = Urdf(**{**vars(given), "tip": tip})
    np.testing.assert_allclose(
        tool_tip(robot.chain, q), described.place(positions, base), atol=1e-9
    )
    unknown = [word for word in NAMED if word in given.text()]
    assert all(word in out for word in unknown)  # what is passed over is named


@pytest.mark.parametrize("given", labelled([*ASKED, *REFUSED]))
def test_a_description_is_refused_for_a_reason_of_its_own(run, tmp_path, given):
    path = tmp_path / "arm.urdf"
    path.write_text(given.text())
    status, _, err = run("new", tmp_path / "w", "--robot", path, *of_new(given.options))
    assert status == 2
    assert given.says in err
    assert not (tmp_path / "w").exists()


@pytest.mark.parametrize("given", labelled(ASKED))
def test_where_a_gripper_hangs_below_the_arms_last_joint_is_proposed(tmp_path, given):
    path = tmp_path / "arm.urdf"
    path.write_text(given.text())
    with pytest.raises(UnclearFlangeError) as refused:
        read_urdf(path)
    proposed = given.says.removeprefix("--tip: ")
    assert refused.value.proposed == proposed
    assert len(read_urdf(path, proposed).joint_names) in (5, 6)


def test_thousands_of_links_are_read(tmp_path):
    cables = [J(f"c{i}", f"cable{i}", more="<unknown/>") for i in range(3000)]
    chain = [fixed("off", "off_link", of="base_link"), *cables]
    given = Urdf("cables", [*numbered(6), fixed("t", "tool0"), *chain])
    path = tmp_path / "arm.urdf"
    path.write_text(given.text())
    arm = read_urdf(path)
    assert len(arm.joint_names) == 6
    assert len(arm.source) < 300
    path.write_text(given.text().replace("tool0", "tool1"))
    with pytest.raises(FileFormatError, match="3000 joints turn"):
        read_urdf(path)
    crowd = [J(f"finger{i}", f"tip{i}", of="link6") for i in range(3000)]
    path.write_text(Urdf("crowd", [*numbered(6), *crowd]).text())
    with pytest.raises(UnclearFlangeError, match="--tip: link6"):
        read_urdf(path)
    path.write_text(f"<robot>{' ' * 20_000_000}</robot>")
    with pytest.raises(FileFormatError, match="20 MB"):
        read_urdf(path)
