"""An arm's flange is taken where a convention or names leave no doubt, and else asked for."""

import pytest

from prior_reinforce.arm.robots.flange import arms_own
from prior_reinforce.arm.robots.urdf import read_urdf
from prior_reinforce.errors import PriorReinforceError, UnclearFlangeError
from tests.arm.robots.descriptions import J, Urdf, arm, fingers, fixed

SIX = [f"joint{i}" for i in range(1, 7)]
LINKS = [f"link{i}" for i in range(1, 7)]
LEVEL = '<mimic joint="joint2" multiplier="-1"/>'


def six(prefix="", of=None, n=6):
    first, *rest = arm([prefix + j for j in SIX[:n]], [prefix + k for k in LINKS[:n]])
    return [J(**{**vars(first), "of": of}), *rest]


def written(tmp_path, joints, **more):
    path = tmp_path / "arm.urdf"
    path.write_text(Urdf("arm", joints, **more).text())
    return path


READ = {
    "a namespace": ([*six("left/"), fixed("t", "left/tool0")], "left/tool0", ()),
    "a dot": ([*six(), fixed("t", "ur.tool0")], "ur.tool0", ()),
    "a screwdriver behind a prefixed tool0": (
        [*six(), fixed("t", "ur_tool0"), J("bit_joint", "bit", "continuous")],
        "ur_tool0",
        ("bit_joint",),
    ),
    "a camera that pans and tilts behind a prefixed tool0": (
        [*six(), fixed("t", "ur_tool0"), J("pan", "pan_link"), J("tilt", "tilt_link")],
        "ur_tool0",
        ("pan", "tilt"),
    ),
    "a camera on the last link, beside tool0": (
        [*six(), J("pan", "pan_link"), J("tilt", "tilt_link"), fixed("t", "tool0", of="link6")],
        "tool0",
        ("pan", "tilt"),
    ),
    "a screwdriver behind flange": (
        [*six(), fixed("t", "flange"), J("bit_joint", "bit", "continuous")],
        "flange",
        ("bit_joint",),
    ),
    "a link called tool0 within the arm, and flange": (
        [*six(n=4), fixed("f", "tool0"), *arm(SIX[4:], LINKS[4:]), fixed("t", "flange")],
        "flange",
        (),
    ),
    "a pedestal called flange": ([fixed("p", "flange"), *six(of="flange")], "link6", ()),
    "a link called flange within the arm, and tool0": (
        [*six(n=4), fixed("f", "flange"), *arm(SIX[4:], LINKS[4:]), fixed("t", "tool0")],
        "tool0",
        (),
    ),
    "two numbered fingers that slide": (
        [
            *six(),
            fixed("g", "gripper_base"),
            J("joint7", "link7", "prismatic", of="gripper_base", low=0.0, high=0.04),
            J("joint8", "link8", "prismatic", of="gripper_base", low=-0.04, high=0.0),
        ],
        "link6",
        ("joint7", "joint8"),
    ),
    "a finger that slides, and one that follows": (
        [*six(), fixed("h", "hand"), *fingers("hand")],
        "link6",
        ("left_finger_joint",),
    ),
    "fingers that do not move, named in the mesh of their hand": (
        [*six(), fixed("finger_1", "finger"), fixed("finger_2", "finger_2", of="link6")],
        "link6",
        (),
    ),
    "legs of three joints": (
        [*six(of="base_link"), *[j for s in "lr" for j in six(s, "base_link", 3)]],
        "link6",
        (),
    ),
    "a camera at the elbow": ([*six(), J("camera_pan", "camera", of="link3")], "link6", ()),
}


@pytest.mark.parametrize("label", READ)
def test_the_flange_is_where_nothing_is_in_doubt_and_what_moves_behind_is_named(tmp_path, label):
    joints, tip, behind = READ[label]
    change = ("", "")
    if "mesh" in label:
        mesh = '<visual><geometry><mesh filename="hand_2finger.dae"/></geometry></visual>'
        change = ('<link name="link6"/>', f'<link name="link6">{mesh}</link>')
    found = read_urdf(written(tmp_path, joints, change=change))
    assert found.joint_names == tuple(j.name for j in joints if j.name in SIX or "/" in j.name)
    assert f" to {tip}" in found.source
    _, _, said = found.source.partition("moved behind it: ")
    assert said == ", ".join(behind)


def doubtful(names):
    return arm(names, [f"{name}_link" for name in names])


ASKED = {
    "a foreign gripper": ([*six(), J("greifer_joint", "greifer")], "link6", "greifer"),
    "a servo, numbered on": ([*six(), J("servo7_joint", "servo")], "link6", "servo"),
    "a camera that pans and tilts": (
        [*six(), J("cam_pan", "pan_link"), J("cam_tilt", "tilt_link")],
        "link6",
        "tilt_link",
    ),
    "a hand that turns, of two joints": (
        [*six(), J("hand_1", "a"), J("hand_2", "b")],
        "link6",
        "b",
    ),
    "spot's hand": (
        doubtful(["arm_sh0", "arm_sh1", "arm_el0", "arm_el1", "arm_wr0", "arm_wr1", "arm_f1x"]),
        "arm_wr1_link",
        "arm_f1x_link",
    ),
    "three fingers of three joints, by the links' names": (
        [
            *six(),
            fixed("palm", "palm"),
            *[
                J(f"bh_j{f}{k}", f"finger_{f}{k}", of="palm" if k == 1 else f"finger_{f}{k - 1}")
                for f in (1, 2, 3)
                for k in (1, 2, 3)
            ],
        ],
        "link6",
        "finger_11",
    ),
    "three fingers of which nothing tells": (
        [
            *six(),
            fixed("palm", "palm"),
            *[
                J(f"bh_j{f}{k}", f"bh_{f}{k}", of="palm" if k == 1 else f"bh_{f}{k - 1}")
                for f in (1, 2, 3)
                for k in range(1, 3 + (f == 1))
            ],
        ],
        "link6",
        None,
    ),
    **{
        f"joints behind a link called {tip}": (
            [*six(n=4), fixed("f", tip), *arm(SIX[4:], LINKS[4:])],
            tip,
            "link6",
        )
        for tip in ("flange", "tool0", "link_eef")
    },
    "joints beside a link called tool0": (
        [*six(), fixed("f", "tool0", of="link3")],
        "tool0",
        "link6",
    ),
    "joints behind a link called flange, of which no name tells": (
        [*doubtful(["basis", "schulter", "oberarm"]), fixed("f", "flange"), J("hand", "palm")],
        "flange",
        "palm",
    ),
}


@pytest.mark.parametrize("label", ASKED)
def test_a_joint_that_may_be_a_tools_is_asked_about_and_either_answer_works(tmp_path, label):
    joints, proposed, other = ASKED[label]
    path = written(tmp_path, joints)
    with pytest.raises(UnclearFlangeError) as refused:
        read_urdf(path)
    assert refused.value.proposed == proposed
    assert f"--tip: {proposed}, " in str(refused.value)
    shorter = read_urdf(path, proposed).joint_names
    assert shorter == tuple(j.name for j in joints if j.kind == "revolute")[: len(shorter)]
    if other is not None:
        assert f"or {other}, if " in str(refused.value)
        assert len(read_urdf(path, other).joint_names) > len(shorter)


def test_a_slide_at_the_end_is_the_arms_or_a_tools(tmp_path):
    quill = J("j4", "quill", "prismatic", low=0.1, high=0.3)
    path = written(tmp_path, [*six(n=3), quill, fixed("t", "quill_tool")])
    with pytest.raises(UnclearFlangeError, match=r"j4 .*--tip quill --hold j4=0\.1") as refused:
        read_urdf(path)
    assert refused.value.proposed == "link3"
    assert "--robot none" in str(refused.value)
    assert read_urdf(path, "link3").held == {}
    held = read_urdf(path, "quill", hold={"j4": 0.1})
    assert (held.joint_names, held.held) == (("joint1", "joint2", "joint3"), {"j4": 0.1})
    short = read_urdf(path, hold={"j4": 0.1}).source
    assert " to link3" in short
    assert "fixed behind it: quill, quill_tool" in short


@pytest.mark.parametrize("leader", ["joint2", "joint3"])
def test_a_wrist_that_follows_the_arm_is_the_arms_or_a_tools(tmp_path, leader):
    level = J("level", "wrist", more=LEVEL.replace("joint2", leader))
    path = written(tmp_path, [*six(n=3), level, fixed("t", "cup")])
    with pytest.raises(UnclearFlangeError, match=f"level follows {leader}.*--robot none") as said:
        read_urdf(path)
    assert said.value.proposed == "link3"  # and no shorter arm
    assert len(read_urdf(path, "link3").joint_names) == 3


def pair(left, right, left_tip=None, right_tip=None, torso=()):
    """Two arms of so many joints, with a link of a convention or without."""
    of = torso[-1].to if torso else "base_link"
    return [
        *torso,
        *six("l_", of, left),
        *([fixed("lt", left_tip)] if left_tip else []),
        *six("r_", of, right),
        *([fixed("rt", right_tip)] if right_tip else []),
    ]


@pytest.mark.parametrize(
    ("joints", "ends"),
    [
        (pair(6, 5), ["l_link6", "r_link5"]),
        (pair(4, 6), ["r_link6", "l_link4"]),
        (pair(6, 6, "tool0"), ["tool0", "r_link6"]),
        (pair(5, 6, "l_tool0"), ["l_tool0", "r_link6"]),
        (pair(6, 6, "tool0", "flange"), ["tool0", "flange"]),
        (pair(6, 6, "l_tool0", torso=[J("waist", "torso")]), ["l_tool0", "r_link6"]),
        ([*pair(6, 6), J("hand", "palm")], ["l_link6", "r_link6 (or palm, if hand is the arm's)"]),
    ],
)
def test_of_several_arms_of_similar_size_none_is_taken_for_its_name_or_count(
    tmp_path, joints, ends
):
    path = written(tmp_path, joints)
    with pytest.raises(UnclearFlangeError) as refused:
        read_urdf(path)
    assert f"ends in {', '.join(ends)}; say" in str(refused.value)
    for end in ends:
        assert read_urdf(path, end.split(" ")[0]).joint_names


def test_the_fingers_of_two_arms_hide_neither(tmp_path):
    def hand(side):
        bones = [(f, k) for f in "abc" for k in range(2)]
        return [
            J(f"{side}_h{f}{k}", f"{side}_{f}{k}", of=f"{side}_{f}0" if k else f"{side}_link6")
            for f, k in bones
        ]

    joints = [*six("l_", "base_link"), *hand("l"), *six("r_", "base_link"), *hand("r")]
    with pytest.raises(UnclearFlangeError, match=r"ends in l_link6 \(or .*, r_link6 \(or "):
        read_urdf(written(tmp_path, joints))


@pytest.mark.parametrize(
    ("names", "own"),
    [
        (SIX, 6),
        ([f"right_{n}" for n in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")], 7),  # Baxter
        ([f"joint_{i}_{n}" for i, n in enumerate("slurbt", 1)], 6),  # Motoman
        ([f"joint_{n}" for n in "slurbt"], 6),
        ([f"j2n6s300_joint_{i}" for i in range(1, 7)], 6),
        ([f"Revolute {i}" for i in range(1, 8)], 7),
        ([f"joint{i + 1}_to_joint{i}" for i in range(1, 6)] + ["joint6output_to_joint6"], 6),
        (["waist", "shoulder", "elbow", "wrist_angle", "wrist_rotate"], 5),
        (["base_yaw_servo", *SIX], 7),
        (["basis", "schulter", "arm", "hand"], 3),  # none tells: the last is in doubt
        ([*SIX, "tool_1", "tool_2"], 6),
        (["a"], 1),
        (["joint", "b"], 2),
    ],
)
def test_joints_are_the_arms_by_words_of_arms_or_by_numbers(names, own):
    assert arms_own(names) == own


def test_joints_that_were_said_to_stand_still_are_in_no_doubt(tmp_path):
    path = written(tmp_path, [*six(), J("greifer", "hand")])
    assert read_urdf(path, hold={"greifer": 0.2}).joint_names == tuple(SIX)
    assert len(read_urdf(path, "hand").joint_names) == 7


def test_a_base_leaves_the_arms_beside_it_out(tmp_path):
    joints = [fixed("m", "mount"), *six("l_", "mount"), *six("r_", "base_link")]
    path = written(tmp_path, joints)
    with pytest.raises(PriorReinforceError, match="r_link6, l_link6"):
        read_urdf(path)
    assert read_urdf(path, base="mount").joint_names[0] == "l_joint1"
