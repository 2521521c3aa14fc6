"""A URDF gives the limits and kinematics that MuJoCo finds in it, and says what it lacks."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arm.robots.urdf import bases_on_axis, read_urdf
from prior_reinforce.errors import ConfigurationError, FileFormatError, UnclearFlangeError
from prior_reinforce.plans.kinematics import rotation, tool_tip
from tests.arm.robots.arms import UR, limit, ur5e, write_urdf
from tests.arm.robots.descriptions import J, Urdf, arm, fixed

TIP = (0.03, -0.02, 0.15)


def test_an_arms_limits_and_names(tmp_path):
    arm = read_urdf(write_urdf(tmp_path / "ur5e.urdf", ur5e()))
    assert arm.joint_names == UR
    np.testing.assert_allclose(arm.upper, np.pi * np.array([2, 2, 1, 2, 2, 2]))
    np.testing.assert_allclose(arm.lower, -arm.upper)
    np.testing.assert_allclose(arm.velocity, np.pi)
    assert arm.acceleration is None
    assert arm.jerk is None
    assert arm.source == "ur5e.urdf, from link0 to tool0"


def with_mujoco(path, tip, q):
    """Where the tip is by MuJoCo, which keeps no frames of links behind fixed joints."""
    text = re.sub("<visual>.*?</visual>", "", path.read_text())
    text = text.replace(
        '<robot name="arm">',
        '<robot name="arm"><mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco>',
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    body = model.body(tip).id
    return data.xpos[body] + data.xmat[body].reshape(3, 3) @ TIP


@pytest.mark.parametrize("axis", ["0 0 1", "0 -1 0", "0.6 0 0.8"])
def test_kinematics_are_those_that_mujoco_finds(tmp_path, axis):
    path = write_urdf(tmp_path / "a.urdf", ur5e(), axis=axis)
    arm = read_urdf(path)
    rng = np.random.default_rng(0)
    for q in rng.uniform(-3, 3, size=(10, 6)):
        np.testing.assert_allclose(
            tool_tip(arm.chain, q, TIP), with_mujoco(path, "tool0", q), atol=1e-9
        )


def test_the_presets_kinematics_are_those_of_the_makers_urdf(tmp_path):
    arm = read_urdf(write_urdf(tmp_path / "ur5e.urdf", ur5e()))
    q = np.random.default_rng(1).uniform(-3, 3, size=(20, 6))
    preset = robot_limits("ur5e")
    np.testing.assert_allclose(
        tool_tip(preset.chain, q, TIP), tool_tip(arm.chain, q, TIP), atol=1e-9
    )
    np.testing.assert_allclose(preset.upper, arm.upper)
    np.testing.assert_allclose(preset.velocity, arm.velocity)


def test_the_flange_may_be_named_and_else_is_behind_the_last_turning_joint(tmp_path):
    joints = [
        ("a", "revolute", (0, 0, 1), (0, 0, 0), limit(-1, 1, 2)),
        ("b", "continuous", (0, 0, 1), (0, 0, 0), limit(0, 0, 2)),
        ("c", "fixed", (0, 0, 1), (0, 0, 0), ""),
        ("finger", "prismatic", (0, 0, 1), (0, 0, 0), limit(0, 0.04, 1)),
    ]
    path = write_urdf(tmp_path / "a.urdf", joints, last="tip")
    arm = read_urdf(path)
    np.testing.assert_allclose(tool_tip(arm.chain, np.zeros(2)), [0, 0, 2])
    np.testing.assert_allclose(arm.upper, [1, 4 * np.pi])
    np.testing.assert_allclose(tool_tip(read_urdf(path, "link3").chain, np.zeros(2)), [0, 0, 3])
    with pytest.raises(FileFormatError, match="finger is prismatic"):
        read_urdf(path, "tip")
    with pytest.raises(FileFormatError, match="no joint turns between the base and link0"):
        read_urdf(path, "link0")
    with pytest.raises(ConfigurationError, match="no link 'hand'; it has link0, link1"):
        read_urdf(path, "hand")


def test_two_arms_need_the_flange_to_be_named(tmp_path):
    one = [("a", "revolute", (0, 0, 1), (0, 0, 0), limit(-1, 1, 2))]
    other = (
        '<link name="other"/><joint name="b" type="revolute"><parent link="link0"/>'
        '<origin xyz="0 0 0"/><axis xyz="0 0 1"/>'
        f'<child link="other"/><limit {limit(-2, 2, 2)}/></joint>'
    )
    path = write_urdf(tmp_path / "a.urdf", one, last="left", more=other)
    with pytest.raises(ConfigurationError, match="ends in left, other; say which link"):
        read_urdf(path)
    assert read_urdf(path, "other").upper.tolist() == [2]


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ('lower="-1" upper="1" effort="1" velocity="0"', "no velocity limit of a"),
        ("", "no velocity limit of a"),
        ('lower="0" upper="0" effort="1" velocity="1"', "joint a has no range"),
    ],
)
def test_what_a_joint_lacks_is_named(tmp_path, attributes, says):
    joints = [("a", "revolute", (0, 0, 1), (0, 0, 0), attributes)]
    with pytest.raises(ConfigurationError, match=says):
        read_urdf(write_urdf(tmp_path / "a.urdf", joints))


@pytest.mark.parametrize(
    ("content", "is_a"),
    [
        ("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n", "git lfs pull"),
        ("\n<!doctype HTML>\n<html><body>404</body></html>", "a web page"),
        ("<html><head/></html>", "a web page"),
    ],
)
def test_a_file_that_stands_for_a_urdf_is_told_as_what_it_is(tmp_path, content, is_a):
    path = tmp_path / "a.urdf"
    path.write_text(content)
    with pytest.raises(FileFormatError, match=is_a) as refused:
        read_urdf(path)
    assert "export it again" not in str(refused.value)


@pytest.mark.parametrize("content", ["", "<robot", "<robot name='a'/>", "<a/>", "x\0y"])
def test_what_is_no_urdf_is_named(tmp_path, content):
    path = tmp_path / "a.urdf"
    path.write_text(content)
    with pytest.raises(FileFormatError, match=r"a\.urdf"):
        read_urdf(path)
    with pytest.raises(FileFormatError, match="no URDF at"):
        read_urdf(tmp_path / "b.urdf")
    (tmp_path / "c.urdf.xacro").write_text("<robot/>")
    with pytest.raises(FileFormatError, match="make a URDF of it: xacro"):
        read_urdf(tmp_path / "c.urdf.xacro")


SMALL = [
    ("base", "fixed", (0, 0.5, 0), (0, 0, 1.57), ""),
    ("a", "revolute", (0, 0, 0.333), (0, 0, 0), limit(-1.5, 2.25, 2)),
    ("b", "continuous", (0.1, -0.4, 0), (-1.57, 0, 0), limit(0, 0, 3.1)),
]
FINGER = (
    '<link name="f"/><joint name="finger" type="revolute"><parent link="tool0"/><child link="f"/>'
    '<origin xyz="0 0 0.1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1"/>'
    '<mimic joint="a"/></joint>'
)
NUMBERS = {"xyz", "rpy", "lower", "upper", "velocity"}


def said(text):
    """Every attribute of the arm's joints and of their elements, by a lenient look at XML.

    The arm's are all but the last, FINGER, which hangs behind the flange and cannot move it.
    """
    joints = [*ElementTree.fromstring(text).iter("joint")][:3]
    parts = [(joint.tag, joint.attrib) for joint in joints]
    parts += [(part.tag, part.attrib) for joint in joints for part in joint]
    return [(tag, key, value) for tag, pairs in parts for key, value in pairs.items()]


def same(arm, other):
    """Joints' kinds, limits and kinematics; not their names."""
    q = np.random.default_rng(0).uniform(-3, 3, (5, 2))
    return (
        len(other.joint_names) == 2
        and np.array_equal([arm.lower, arm.upper], [other.lower, other.upper])
        and np.array_equal(arm.velocity, other.velocity)
        and np.array_equal(tool_tip(arm.chain, q, TIP), tool_tip(other.chain, q, TIP))
    )


@pytest.mark.slow
def test_a_urdf_that_lacks_a_character_is_refused_or_is_the_same_arm(tmp_path):
    """A copy that passes is well-formed XML with all elements and attributes.

    It is another arm only where the character was of a number, which leaves another number.
    """
    path = write_urdf(tmp_path / "a.urdf", SMALL, more=FINGER)
    text = re.sub("<(visual|inertial)>.*?</(visual|inertial)>", "", path.read_text())
    path.write_text(text)
    arm, intact = read_urdf(path), said(text)
    refused = passed = 0
    for i in range(text.index("<link"), text.index("</robot>")):
        copy = text[:i] + text[i + 1 :]
        path.write_text(copy)
        try:
            other = read_urdf(path)
        except (FileFormatError, ConfigurationError):
            refused += 1
            continue
        now = said(copy)
        changed = [key for (_, key, a), (_, _, b) in zip(intact, now, strict=True) if a != b]
        assert [x[:2] for x in now] == [x[:2] for x in intact], copy[i - 20 : i + 20]
        assert len(changed) <= 1
        assert same(arm, other) or changed[0] in NUMBERS, copy[i - 20 : i + 20]
        passed += 1
    assert refused > 500  # most of what is no number
    assert passed > 50  # digits, blanks and letters of joints' names


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "joint a has an <axis> of length 0"),
        ('<axis xyz="0 0 1"/>', "<axis/>", "joint a has an <axis> of length 0"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 1"/>', "joint a has <axis xyz=.*give 3 finite"),
        (
            '<axis xyz="0 0 1"/>',
            '<axis xyz="0 0 nan"/>',
            "joint a has <axis.*3 finite",
        ),
        ('<origin xyz="0 0 0.333" rpy="0 0 0"/>', "", "joint a has no <origin>"),
        ("0 0 0.333", "0 0 1e999", "give 3 finite numbers"),
        ("0 0 0.333", "0 0 ${height}", "give 3 finite numbers"),
        ("0 0 0.333", "0 0 333", "joint a has an <origin> beyond 10 m or a turn"),
        ('velocity="2"', 'velocity="200"', "velocity limit of 200 .a."),
        ('upper="2.25"', 'upper="225"', "12.57 rad: -1.5 to 225, in degrees\\?;"),
        ('upper="2.25"', 'upper="-3"', "12.57 rad: -1.5 to -3, exchanged\\?;"),
        ('velocity="2"', 'velocty="2"', "joint a has an unknown velocty in <limit>"),
        ("<axis", "axis", "text in joint base"),
        ('<axis xyz="0 0 1"/>', '<axs xyz="0 0 1"/>', "joint base has an unknown <axs>"),
        ('<link name="link2"/>', "", "names 'link2', which is no link"),
        ('<child link="tool0"/>', '<child link="link2"/>', "two joints move one link, link2"),
        ('<link name="link2"/>', '<link name="link2"/>' * 2, "two links are called link2"),
        ('<link name="link2"/>', '<link name="link2"/><link name="x"/>', "2 links hang from no"),
        ('<parent link="link1"/>', '<parent link="tool0"/>', "its joints form a loop"),
        ('name="b" type', 'name="a" type', "two joints are called a"),
        ('type="continuous"', 'type="continous"', "joint b has no type, or none of"),
        ("</joint></robot>", '<mimic joint="a"/></joint></robot>', "joint b follows another"),
        ("</joint></robot>", '<axis xyz="0 0 1"/></joint></robot>', "joint b has two <axis>"),
        ("<robot", "<!DOCTYPE robot><robot", "it has a DOCTYPE"),
    ],
)
def test_what_is_wrong_in_a_urdf_is_named(tmp_path, old, new, says):
    path = write_urdf(tmp_path / "a.urdf", SMALL)
    text = re.sub("<(visual|inertial)>.*?</(visual|inertial)>", "", path.read_text())
    text = text.replace("></link>", "/>")
    assert old in text
    at = text.index(old, text.index('name="a"') if says.startswith("joint a ") else 0)
    path.write_text(text[:at] + new + text[at + len(old) :])
    with pytest.raises((FileFormatError, ConfigurationError), match=says):
        read_urdf(path, "tool0")


@pytest.mark.parametrize(
    ("xyz", "axis"), [("0 0 2", (0.0, 0.0, 1.0)), ("0 3 -4", (0.0, 0.6, -0.8))]
)
def test_an_axis_of_another_length_has_its_direction(tmp_path, xyz, axis):
    path = write_urdf(tmp_path / "a.urdf", SMALL)
    path.write_text(path.read_text().replace('axis xyz="0 0 1"', f'axis xyz="{xyz}"'))
    found = read_urdf(path, "tool0")
    np.testing.assert_allclose(found.chain.axes[0], axis)
    np.testing.assert_allclose(
        tool_tip(found.chain, np.array([0.4, -0.3]), TIP),
        with_mujoco(path, "tool0", [0.4, -0.3]),
        atol=1e-9,
    )


@pytest.mark.parametrize(
    ("old", "new", "axis", "ends", "said"),
    [
        ('<axis xyz="0 0 1"/>', "", (1.0, 0.0, 0.0), (-1.5, 2.25), "<axis> 1 0 0 of joint a"),
        ('lower="-1.5" ', "", (0.0, 0.0, 1.0), (0.0, 2.25), "lower 0 of joint a"),
        ('upper="2.25" ', "", (0.0, 0.0, 1.0), (-1.5, 0.0), "upper 0 of joint a"),
    ],
)
def test_defaults_of_urdf_are_taken_and_named(tmp_path, old, new, axis, ends, said):
    path = write_urdf(tmp_path / "a.urdf", SMALL)
    text = path.read_text()
    at = text.index(old, text.index('name="a"'))
    path.write_text(text[:at] + new + text[at + len(old) :])
    found = read_urdf(path, "tool0")
    assert found.chain.axes[0] == axis
    assert (found.lower[0], found.upper[0]) == ends
    assert found.source.endswith(said)


def test_of_a_range_that_no_file_states_no_number_is_said(tmp_path):
    path = write_urdf(tmp_path / "a.urdf", SMALL)
    path.write_text(path.read_text().replace('lower="-1.5" upper="2.25" ', ""))
    with pytest.raises(ConfigurationError, match="joint a has no range") as refused:
        read_urdf(path, "tool0")
    assert "inf" not in str(refused.value)


@pytest.mark.parametrize(("speeds", "asked"), [((22, 37), True), ((6, 27), False)])
def test_speeds_that_few_arms_have_are_read_and_asked_about(tmp_path, speeds, asked):
    joints = [J(name, name, speed=speed) for name, speed in zip("ab", speeds, strict=True)]
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("g1", joints).text())
    found = read_urdf(path)
    assert found.velocity.tolist() == [*speeds]
    assert ("deg/s?" in found.source) == asked


def test_links_that_no_arm_has_are_in_another_unit(tmp_path):
    path = write_urdf(tmp_path / "a.urdf", ur5e())
    path.write_text(path.read_text().replace("-0.425", "-4.25"))
    with pytest.raises(ConfigurationError, match=r"elbow_joint stands 4\.25 m from the joint"):
        read_urdf(path)


@pytest.mark.parametrize(
    ("soft", "says"),
    [((-1, 9), None), ((0, 0), "0 to 0"), ((2, -1), "2 to -1"), ((3, 9), "3 to 2.25")],
)
def test_soft_limits_narrow_a_joints_range(tmp_path, soft, says):
    path = write_urdf(tmp_path / "a.urdf", SMALL)
    low, high = soft
    ends = f'soft_lower_limit="{low}" soft_upper_limit="{high}"'
    soft = f'<safety_controller {ends} k_velocity="1"/></joint>'
    text = path.read_text()
    at = text.index("</joint>", text.index('name="a"'))
    path.write_text(text[:at] + soft + text[at + len("</joint>") :])
    if says:
        with pytest.raises(ConfigurationError, match=f"joint a .*<safety_controller>: {says}"):
            read_urdf(path)
        return
    arm = read_urdf(path)
    assert (arm.lower[0], arm.upper[0]) == (-1, 2.25)
    assert arm.source.endswith("soft limits too")
    path.write_text(path.read_text().replace(ends, ""))
    assert "soft limits" not in read_urdf(path).source


def named_arm(tmp_path, names, mesh, behind=""):
    """A chain of joints of these names; the last link's mesh has a name."""
    links = ["base", *(f"part_{k}" for k in range(1, len(names) + 1))]
    joint = (
        '<joint name="{}" type="revolute"><origin xyz="0 0 0.1"/><parent link="{}"/>'
        '<child link="{}"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="6"/>{}</joint>'
    )
    parts = [joint.format(name, *links[k : k + 2], "") for k, name in enumerate(names)]
    links += ["jaw_l", "jaw_r"] * bool(behind)
    if behind:
        parts.append(joint.format("left_jaw", behind, "jaw_l", ""))
        parts.append(joint.format("right_jaw", behind, "jaw_r", '<mimic joint="left_jaw"/>'))
    visual = f'<visual><geometry><mesh filename="package://arm/{mesh}"/></geometry></visual>'
    shown = [f'<link name="{n}">{visual * (n == f"part_{len(names)}")}</link>' for n in links]
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(shown)}{"".join(parts)}</robot>')
    return path


def test_a_jaw_is_known_by_its_mesh_where_no_name_tells(tmp_path):
    names = [f"Revolute {k}" for k in range(1, 7)]
    with pytest.raises(UnclearFlangeError, match=r"Revolute 6 looks like .* --tip: part_5"):
        read_urdf(named_arm(tmp_path, names, "moving_jaw_v1.stl"))
    assert len(read_urdf(named_arm(tmp_path, names, "part.stl")).joint_names) == 6


def test_a_joint_that_turns_the_gripper_is_the_arms(tmp_path):
    names = ["base_rotation", "shoulder", "elbow", "wrist_pitch", "gripper_rotation"]
    with pytest.raises(UnclearFlangeError, match=r"--tip: part_5, which .* gripper_rotation moves"):
        read_urdf(named_arm(tmp_path, names, "part.stl", behind="part_5"))


@pytest.mark.parametrize(
    ("rpy", "heading"),
    [
        ((0.0, 0.0, 0.7), 0.7),  # turned
        ((np.pi, 0.0, 0.0), 0.0),  # on a ceiling
        ((np.pi, 0.0, -1.2), -1.2),
        ((np.pi / 2, 0.0, 0.3), 0.3),  # on a wall, its x level
        ((0.0, np.pi / 2, 0.4), 0.0),  # on a wall, its x down: the root's axes
        ((0.0, np.pi / 2 + 0.01, 0.4), 0.0),
        ((0.01, -0.02, np.pi), np.pi),  # calibrated
    ],
)
@pytest.mark.parametrize("torso", [False, True])
def test_a_base_link_stands_upright_in_its_heading_however_it_is_mounted(
    tmp_path, rpy, heading, torso
):
    place = (0.3, -0.2, 1.8)
    lift = J("lift", "lifted", "prismatic", xyz=(0.0, 0.1, 0.0), rpy=(0.0, 0.0, 0.0))
    joints = [*[lift] * torso, fixed("mount", "base", xyz=place, rpy=rpy), *arm(["a", "b", "c"])]
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("mounted", joints, root="world").text())
    hold = {"lift": 0.4} if torso else {}
    whole, above = read_urdf(path, hold=hold), read_urdf(path, base="base")
    q = np.random.default_rng(0).uniform(-2, 2, (5, 3))
    stands = np.add(place, (0.0, 0.1, 0.4) if torso else 0.0)
    expected = tool_tip(whole.chain, q, TIP) - stands
    turn = rotation(0.0, 0.0, heading)
    np.testing.assert_allclose(tool_tip(above.chain, q, TIP) @ turn.T, expected, atol=2e-4)
    tilted, steep = abs(rpy[0]) + abs(rpy[1]) > 0.1, abs(rpy[1]) > 1.0
    axes = " (x and z as in world)" if steep else " (z as in world)" * tilted
    assert f"from base{axes} to" in above.source


def test_bases_are_links_by_which_the_first_axis_passes(tmp_path):
    level = {"rpy": (0.0, 0.0, 0.0)}
    mount = fixed("mount", "base", xyz=(0.5, -0.3, 0.8), **level)
    riser = fixed("riser", "plate", xyz=(0.0, 0.0, 0.2), rpy=(0.0, 0.0, 1.0))  # other axes
    joints = [mount, riser, *arm(["a", "b"], xyz=(0.0, 0.0, 0.1), **level)]
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("mounted", joints, root="world").text())
    assert bases_on_axis(path, None, None, {}, 0.001) == ("world", ["base"])
    assert bases_on_axis(path, None, "base", {}, 0.001) == ("base", [])


def test_no_base_is_advised_that_a_joint_below_would_turn(tmp_path):
    level = {"rpy": (0.0, 0.0, 0.0)}
    steep = fixed("steep", "plate", rpy=(0.0, np.pi / 2, 0.0))
    joints = [J("waist", "torso", **level), steep, *arm(["a", "b"], **level)]
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("mounted", joints).text())
    assert bases_on_axis(path, None, "torso", {}, 0.001) == ("torso", [])


def test_a_slide_between_an_arms_own_joints_offers_no_base_behind_them(tmp_path):
    """A SCARA: what turns behind the quill is not the arm."""
    path = write_urdf(tmp_path / "a.urdf", ur5e())
    text = path.read_text()
    at = text.index('name="wrist_1_joint"')
    path.write_text(text[:at] + text[at:].replace('type="revolute"', 'type="prismatic"', 1))
    with pytest.raises(FileFormatError, match="say --tip") as refused:
        read_urdf(path)
    assert "--base" not in str(refused.value)


RAISED = [
    J("turntable", "torso", low=0.5, high=2.0),
    J("lift", "lifted", "prismatic", low=0.0, high=0.8),
    *arm(["a", "b"]),
    J("c", "c_link", "continuous"),
    J("hand", "palm", "prismatic", of="b_link", low=None, high=None),
]


@pytest.mark.parametrize(
    ("hold", "says"),
    [
        ({"lift": 0.8}, None),
        ({"lift": 60}, "held at 60 m.* 0 to 0.8 m; in centimetres. .*lift=0.6"),
        ({"lift": 600}, "in millimetres. .*lift=0.6"),
        ({"lift": 0.9}, "held at 0.9 m.* 0 to 0.8 m; .*--hold lift=0.8$"),
        ({"lift": -0.2}, "held at -0.2 m.* 0 to 0.8 m; .*--hold lift=0$"),
        ({"lift": 0.4, "a": 90}, "held at 90 rad.* -2.5 to 2.25 rad; in degrees. .*a=1.571"),
        ({"lift": 0.4, "c": 180}, "-6.283 to 6.283 rad; in degrees. .*c=3.142"),
        ({"lift": 0.4, "c": -6.283}, None),
        ({"lift": 0.4, "hand": 0.2}, None),  # its file says no range
    ],
)
def test_a_joint_is_held_in_its_own_range(tmp_path, hold, says):
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("raised", RAISED).text())
    hold = {"turntable": 1.0, **hold}
    if says is None:
        assert read_urdf(path, "c_link", hold=hold).held.items() <= hold.items()
    else:
        with pytest.raises(ConfigurationError, match=says):
            read_urdf(path, "c_link", hold=hold)


@pytest.mark.parametrize(
    ("axis", "rpy", "mount", "matters"),
    [
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.3), (0.0, 0.0, 0.0), False),  # a waist that yaws
        ((0.0, 0.0, -1.0), (0.0, 0.0, 0.3), (np.pi, 0.0, 0.2), False),  # above it, a ceiling
        ((0.0, 1.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.0, 0.0), True),  # one that pitches
        ((0.0, 0.0, 1.0), (0.2, 0.0, 0.0), (0.0, 0.0, 0.0), True),  # that yaws, and leans
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0), True),  # under a link's steep x
    ],
)
def test_a_joint_that_would_turn_the_base_is_held_somewhere(tmp_path, axis, rpy, mount, matters):
    waist = J("waist", "torso", axis=axis, rpy=rpy)
    follower = J("level", "levelled", axis=axis, rpy=(0.0, 0.0, 0.0), more='<mimic joint="waist"/>')
    for joints in ([waist], [waist, follower]):
        path, base = tmp_path / "arm.urdf", fixed("m", "base", rpy=mount)
        path.write_text(Urdf("waist", [*joints, base, *arm(["a", "b"])]).text())
        if not matters:
            assert read_urdf(path, base="base").joint_names == ("a", "b")
            continue
        with pytest.raises(ConfigurationError, match=r"waist stands before .*--hold waist=0$"):
            read_urdf(path, base="base")
        tips = [
            tool_tip(read_urdf(path, base="base", hold={"waist": at}).chain, np.array([0.2, 0.4]))
            for at in (0.0, 0.5)
        ]
        assert np.linalg.norm(np.subtract(*tips)) > 0.01


def test_a_joint_before_the_base_stands_at_0_only_where_that_is_in_its_range(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("raised", RAISED).text())
    with pytest.raises(
        ConfigurationError, match=r"turntable.* 0.5 to 2 rad.*--hold turntable=0.5$"
    ):
        read_urdf(path, "c_link", base="lifted")
    assert read_urdf(path, "c_link", base="lifted", hold={"turntable": 1.0}).joint_names[0] == "a"


@pytest.mark.parametrize("at", [0.0, 0.3])
def test_a_joint_before_the_base_that_cannot_move_is_not_asked_for(tmp_path, at):
    path, locked = tmp_path / "arm.urdf", J("waist", "base", axis=(0.0, 1.0, 0.0), low=at, high=at)
    path.write_text(Urdf("locked", [locked, *arm(["a", "b"])]).text())
    given = read_urdf(path, base="base", hold={"waist": at}).chain
    tips = [tool_tip(chain, np.zeros(2)) for chain in (read_urdf(path, base="base").chain, given)]
    np.testing.assert_allclose(*tips)


@pytest.mark.parametrize(
    ("low", "high", "place"), [(0.1, 0.8, 0.1), (-0.8, -0.3, -0.3), (-1.0, 1.0, 0.0)]
)
def test_what_holds_a_lift_is_a_place_in_its_range(tmp_path, low, high, place):
    path = tmp_path / "arm.urdf"
    lift = J("lift", "lifted", "prismatic", low=low, high=high)
    path.write_text(Urdf("raised", [lift, *arm(["a", "b"])]).text())
    with pytest.raises(FileFormatError, match=f"--hold lift={place:g} if"):
        read_urdf(path)
    assert read_urdf(path, hold={"lift": place}).held == {"lift": place}


def test_what_is_fixed_behind_the_flange_is_named_where_nothing_says_which_it_is(tmp_path):
    path = tmp_path / "arm.urdf"
    behind = [fixed("8", "fr3_link8"), fixed("h", "fr3_hand"), fixed("t", "hand_tcp")]
    path.write_text(Urdf("franka", [*arm(["a", "b"]), *behind]).text())
    assert (
        "to b_link; fixed behind it: fr3_link8, fr3_hand, hand_tcp (--tip" in read_urdf(path).source
    )
    assert "fixed behind" not in read_urdf(path, "b_link").source
    path.write_text(Urdf("ur", [*arm(["a", "b"]), fixed("tool", "tool0"), *behind]).text())
    assert "fixed behind" not in read_urdf(path).source


@pytest.mark.parametrize(
    ("ends", "said"), [((-3, 3), True), ((0, 0), False), ((-1e16, 1e16), False)]
)
def test_a_continuous_joints_ends_are_said_to_be_passed_over(tmp_path, ends, said):
    joints = [*SMALL[:2], ("b", "continuous", (0, 0, 1), (0, 0, 0), limit(*ends, 2))]
    arm = read_urdf(write_urdf(tmp_path / "a.urdf", joints))
    assert ("passed over: lower and upper of joint b" in arm.source) == said
    assert arm.upper[1] == 4 * np.pi


STAGES = [
    J("lower", "stage", "prismatic", low=0.0, high=0.35),
    J(
        "upper",
        "top",
        "prismatic",
        low=-0.1,
        high=0.6,
        more='<mimic joint="lower" multiplier="1.5" offset="-0.05"/>',
    ),
    *arm(["a", "b", "c"]),
]


def test_what_follows_a_held_joint_follows_it(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("lift", STAGES).text())
    with pytest.raises(FileFormatError, match=r"--base top .*, or --hold lower=0 if") as refused:
        read_urdf(path)
    assert "upper=" not in str(refused.value)
    q = np.random.default_rng(0).uniform(-2, 2, (5, 3))
    given = Urdf("lift", STAGES, tip="c_link")
    for hold in ({"lower": 0.2}, {"lower": 0.2, "upper": 0.25}):
        lifted = read_urdf(path, hold=hold)
        stands = {"lower": 0.2, "upper": 0.25}
        assert lifted.held == pytest.approx(stands)
        for row in q:
            expected = given.place(dict(zip("abc", row, strict=True)) | stands, "base_link")
            np.testing.assert_allclose(tool_tip(lifted.chain, row), expected, atol=1e-9)
    for hold, remedy in [
        ({"lower": 0.2, "upper": 0.4}, "to 0.25; take it out"),
        ({"upper": 0.4}, "hold lower where both do"),
    ]:
        with pytest.raises(ConfigurationError, match=f"upper follows lower .*{remedy}"):
            read_urdf(path, hold=hold)
    third = J("third", "roof", "prismatic", low=0.0, high=0.6, more='<mimic joint="upper"/>')
    path.write_text(Urdf("lift", [*STAGES[:2], third, *STAGES[2:]]).text())
    with pytest.raises(FileFormatError, match=r"--base roof .*, or --hold lower=0 if"):
        read_urdf(path)
    assert read_urdf(path, hold={"lower": 0.2}).held["third"] == pytest.approx(0.25)
    with pytest.raises(ConfigurationError, match=r"third follows upper .*hold lower where"):
        read_urdf(path, hold={"third": 0.25})
    path.write_text(path.read_text().replace('"1.5"', '"4"'))
    with pytest.raises(ConfigurationError, match=r"to 1.15, and its range is -0.1 to 0.6"):
        read_urdf(path, hold={"lower": 0.3})


@pytest.mark.parametrize("multiplier", ["-1", "x"])
def test_what_follows_behind_the_flange_may_be_wrong(tmp_path, multiplier):
    more = f'<mimic joint="finger_joint" multiplier="{multiplier}"/>'
    fingers = [
        J("finger_joint", "finger", of="tool0", low=0.0, high=0.8),
        J("mim", "other", of="tool0", low=0.0, high=0.8, more=more),
    ]
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("a", [*arm(["a", "b", "c"]), fixed("t", "tool0"), *fingers]).text())
    assert read_urdf(path, hold={"finger_joint": 0.4}).joint_names == ("a", "b", "c")
    with pytest.raises(ConfigurationError, match="joint mim "):
        read_urdf(path, "other", hold={"finger_joint": 0.4})


def test_an_arms_joint_that_follows_no_joint_is_corrected_in_the_file(tmp_path):
    path = tmp_path / "arm.urdf"
    lost = J("c", "c_link", more='<mimic joint="zz"/>')
    path.write_text(Urdf("a", [*arm(["a", "b"]), lost, J("d", "d_link")]).text())
    with pytest.raises(ConfigurationError, match=r"joint c .*correct .*<mimic> of c"):
        read_urdf(path, "d_link")


@pytest.mark.parametrize("hold", [None, {"s": 0.0}])
@pytest.mark.parametrize(("follows", "mend"), [("s", "s"), ("zz", "s"), ("t", "t")])
def test_a_follower_that_nothing_leads_is_corrected_in_the_file(tmp_path, follows, mend, hold):
    path = tmp_path / "arm.urdf"
    slides = [
        J("s", "s_link", "prismatic", more=f'<mimic joint="{follows}"/>'),
        J("t", "t_link", "prismatic", more='<mimic joint="s"/>'),
    ]
    path.write_text(Urdf("lift", [*slides, *arm(["a", "b", "c"])]).text())
    with pytest.raises(ConfigurationError, match=f"correct .*<mimic> of {mend}") as refused:
        read_urdf(path, hold=hold)
    assert "hold" not in str(refused.value)


def test_a_base_that_drives_and_turns_is_none_of_the_arm(tmp_path):
    drive = [
        J("base_x", "bx", "prismatic", rpy=(0.0, 0.0, 0.0)),
        J("base_y", "by", "prismatic", rpy=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
        J("base_theta", "base", "continuous", rpy=(0.0, 0.0, 0.0)),
    ]
    path = tmp_path / "arm.urdf"
    joints = [f"joint{i}" for i in range(1, 7)]
    path.write_text(Urdf("mobile", [*drive, *arm(joints)], root="world").text())
    remedy = "--base base for .*, or --hold base_x=0 base_y=0 base_theta=0 if"
    with pytest.raises(FileFormatError, match=remedy):
        read_urdf(path)
    assert read_urdf(path, base="base").joint_names == tuple(joints)
    held = read_urdf(path, hold=dict.fromkeys(("base_x", "base_y", "base_theta"), 0.0))
    assert held.joint_names == tuple(joints)


def test_a_flange_metres_behind_the_last_joint_is_in_another_unit(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("a", [*arm(["a", "b"]), fixed("t", "tool0", xyz=(0, 0, 8.0))]).text())
    with pytest.raises(ConfigurationError, match=r"flange is 8 m from the last joint.*--tip"):
        read_urdf(path)


# Half angles: z turned by -0.2 after x by 0.3.
SIN_X, COS_X, SIN_Z, COS_Z = np.sin(0.15), np.cos(0.15), np.sin(-0.1), np.cos(-0.1)
X_Y_Z_W = (SIN_X * COS_Z, SIN_X * SIN_Z, COS_X * SIN_Z, COS_X * COS_Z)
QUATERNION = 'rpy="0.3 0 -0.2"', f'quat_xyzw="{" ".join(map(str, X_Y_Z_W))}"'


def test_a_urdf_is_read_without_loading_scipy():
    program = "import sys, prior_reinforce.arm.robots.urdf; print('scipy' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", program], text=True).strip() == "False"


def test_a_quaternion_turns_as_roll_pitch_and_yaw_do(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("a", [*arm(["a", "b"]), fixed("t", "tool0")]).text())
    by_angles, text = read_urdf(path), path.read_text()
    assert QUATERNION[0] in text
    path.write_text(text.replace(*QUATERNION))
    q = np.random.default_rng(0).uniform(-2, 2, (5, 2))
    arm_ = read_urdf(path)
    seen = tool_tip(arm_.chain, q, TIP)
    np.testing.assert_allclose(seen, tool_tip(by_angles.chain, q, TIP), atol=1e-9)
    assert "quat_xyzw" not in arm_.source
    for wrong, says in [
        (f"{QUATERNION[0]} {QUATERNION[1]}", "rpy and quat_xyzw.*take one out"),
        ('quat_xyzw="0 0 0 2"', "length 1, and it has 2"),
        ('quat_xyzw="0 0 1"', "give 4 finite numbers"),
    ]:
        path.write_text(text.replace(QUATERNION[0], wrong))
        with pytest.raises(ConfigurationError, match=says):
            read_urdf(path)
