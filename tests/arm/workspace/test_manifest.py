"""The manifest: what it says, and where a wrong value stands."""

import contextlib
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.arm.workspace.manifest import parse_manifest, read_text
from prior_reinforce.arm.workspace.template import NewWorkspace
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.plans.kinematics import tool_tip
from tests.arm.workspace.planar import manifest

SEVEN = {"names": str([f"joint{i}" for i in range(1, 8)]), "units": str(["rad"] * 7)}


def load_manifest(path):
    return parse_manifest(read_text(path), path)


def write(tmp_path, text):
    path = tmp_path / "workspace.toml"
    path.write_text(text)
    return path


def test_the_template_says_what_was_filled_in(tmp_path):
    read = load_manifest(write(tmp_path, manifest(robot="panda", **SEVEN)))
    assert read.name == "planar"
    assert read.format.names == tuple(f"joint{i}" for i in range(1, 8))
    assert read.format.dt == 0.02
    assert read.outcome_format.units == ("m", "m")
    assert read.outcome_format.tolerance == (0.015, 0.015)
    assert read.robot is not None
    assert read.robot.robot == "panda"
    assert read.robot.velocity[0] == 2.175


def test_no_robot_means_no_limits(tmp_path):
    assert load_manifest(write(tmp_path, manifest())).robot is None


def test_limits_can_be_given(tmp_path):
    """The template's own example, its comment signs taken away."""
    text = manifest(robot="given")
    start, end = text.index("# joint_names"), text.index("# The program's own")
    text = text[:start] + re.sub("^# ", "", text[start:end], flags=re.M) + text[end:]
    limits = load_manifest(write(tmp_path, text)).robot
    assert limits.upper.tolist() == [2, 2]
    assert limits.jerk.tolist() == [5000, 5000]


@pytest.mark.parametrize(
    ("model", "given", "message"),
    [
        ("panda", "velocity = [1, 1]", r'velocity = .*: goes with model = "given"'),
        ("fr3", 'joint_names = ["joint1"]', r'joint_names = .*: goes with model = "given"'),
        ("none", "upper = [1, 1]", r'upper = .*: goes with model = "given"'),
        ("given", "lower = [-170, -120]\nupper = [170, 120]", "lower = .*looks like degrees"),
        ("given", "lower = [-3, -2]\nupper = [170, 120]", "upper = .*looks like degrees"),
        ("given", "velocity = [150, 150]", "velocity = .*looks like degrees"),
    ],
)
def test_a_limit_that_was_given_is_applied_or_refused(tmp_path, model, given, message):
    names = {} if model == "given" else SEVEN
    text = manifest(robot=model, **names)
    start, end = text.index("# joint_names"), text.index("# The program's own")
    lists = re.sub("^# ", "", text[start:end], flags=re.M) if model == "given" else ""
    for line in given.splitlines():
        lists = re.sub(rf"^{line.split()[0]} = .*\n", "", lists, flags=re.M) + line + "\n"
    with pytest.raises(ConfigurationError, match=message):
        load_manifest(write(tmp_path, text[:start] + lists + text[end:]))


def test_a_box_without_a_robot_is_refused(tmp_path):
    text = manifest() + "\nworkspace_low = [0, 0, 0]\nworkspace_high = [1, 1, 1]\n"
    with pytest.raises(ConfigurationError, match=r"workspace_low.*no robot.*take it out"):
        load_manifest(write(tmp_path, text))


def test_acceleration_and_jerk_may_be_left_out_and_then_are_not_known(tmp_path):
    text = manifest(robot="given")
    start, end = text.index("# joint_names"), text.index("# acceleration")
    text = text[:start] + re.sub("^# ", "", text[start:end], flags=re.M) + text[end:]
    limits = load_manifest(write(tmp_path, text)).robot
    assert limits.velocity.tolist() == [2, 2]
    assert (limits.acceleration, limits.jerk, limits.chain) == (None, None, None)
    boxed = text + "workspace_low = [0, 0, 0]\nworkspace_high = [1, 1, 1]\n"
    with pytest.raises(ConfigurationError, match="kinematics of planar are not known; take it out"):
        load_manifest(write(tmp_path, boxed))


@pytest.mark.parametrize("robot", ["ur5e", "panda"])
def test_an_arm_that_is_written_out_is_read_back(tmp_path, robot):
    arm = robot_limits(robot)
    own = replace(arm, robot="my own")
    text = NewWorkspace(dt=0.01, outcome_names=["x"], tolerance=0.01, robot=own).manifest("own")
    again = load_manifest(write(tmp_path, text)).robot
    assert again.source == arm.source
    for key in ("lower", "upper", "velocity", "acceleration", "jerk"):
        written = getattr(again, key)
        if getattr(arm, key) is None:
            assert written is None
        else:
            np.testing.assert_allclose(written, getattr(arm, key), rtol=1e-8)
    q = np.random.default_rng(0).uniform(-2, 2, (5, len(arm.joint_names)))
    np.testing.assert_allclose(tool_tip(again.chain, q), tool_tip(arm.chain, q), atol=1e-9)
    for old, new, says in [
        ("flange = [", "flange = [1.0, ", "flange = .*expected `array.*` of length 6"),
        (
            "kinematics = [\n  [",
            "kinematics = [\n  [1.0, ",
            "kinematics = .*expected `array` of length 9",
        ),
        (", 1.0],\n", ", 2.0],\n", "axes .* must have length 1"),
    ]:
        assert old in text
        with pytest.raises(ConfigurationError, match=says):
            load_manifest(write(tmp_path, text.replace(old, new, 1)))


def test_each_component_has_its_tolerance(tmp_path):
    text = manifest().replace('["m", "m"]', '["m", "s"]').replace("0.015", "[0.015, 0.02]")
    assert load_manifest(write(tmp_path, text)).outcome_format.tolerance == (0.015, 0.02)


def test_the_box_for_the_tool_tip(tmp_path):
    """The template's own example, its comment signs taken away."""
    text = manifest(robot="panda", **SEVEN)
    start, end = text.index("# tool_tip"), text.index("# absent_joints")
    text = text[:start] + re.sub("^# ", "", text[start:end], flags=re.M) + text[end:]
    gate = load_manifest(write(tmp_path, text)).gate
    assert (gate.box_low, gate.box_high) == ((0.2, -0.6, 0.0), (0.9, 0.6, 1.2))
    assert gate.tool_tip == (0.0, 0.0, 0.1)


@pytest.mark.parametrize("stem", ["Joint", "j", "q", "motor_"])
def test_a_robots_joints_must_be_among_the_plans_names(tmp_path, stem):
    """A column by another name would be handed out unchecked."""
    given = SEVEN | {"names": str([f"{stem}{i}" for i in range(1, 8)])}
    missing = ", ".join(f"joint{i}" for i in range(1, 8))
    with pytest.raises(
        ConfigurationError, match=rf":\d+: \[plan\] names = .*lacks {missing} of panda.*give"
    ):
        load_manifest(write(tmp_path, manifest(robot="panda", **given)))
    assert load_manifest(write(tmp_path, manifest(robot="none", **given))).robot is None


@pytest.mark.parametrize(
    ("absent", "message"),
    [
        ('["joint1", "joint3", "joint5", "joint6"]', None),
        ('["joint1", "joint3", "joint5"]', r"\[plan\] names = .*lacks joint6 of panda"),
        ('["joint1", "joint2"]', r"\[gate\]: absent_joints names 'joint2', but the plan moves it"),
        ('["elbow"]', r"\[gate\]: absent_joints names 'elbow', but panda has no such joint"),
        ("[1]", r"\[gate\] absent_joints = \[1\]: expected `str`, got `int`"),
    ],
)
def test_joints_may_stay_still_on_purpose(tmp_path, absent, message):
    names = {"names": '["panda_joint2", "joint4.pos", "joint7"]', "units": '["rad", "rad", "rad"]'}
    text = manifest(robot="panda", **names)
    text = text.replace("[gate]", f"[gate]\nabsent_joints = {absent}", 1)
    if message is None:
        assert load_manifest(write(tmp_path, text)).gate.absent_joints[0] == "joint1"
    else:
        with pytest.raises(ConfigurationError, match=message):
            load_manifest(write(tmp_path, text))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "tolerance = 0.015",
            "tolerance = -1",
            r":\d+: .outcome. tolerance = -1: expected .float. > 0",
        ),
        (
            "tolerance = 0.015",
            'tolerance = "2cm"',
            r"tolerance = '2cm'.*expected `float | array`, got `str`",
        ),
        ("tolerance = 0.015", "tolerance = nan", "must be finite"),
        ("tolerance = 0.015", "tolerance = [0.015]", r":\d+: .outcome.: tolerance .* each of x"),
        ("tolerance = 0.015", "tolerance = [0.015, 0]", r"expected `float` > 0"),
        (
            'units = ["m", "m"]',
            'units = ["m", "s"]',
            r"several units; give .* of x \[m\]",
        ),
        ("tolerance = 0.015", "tolerance = 1.5", "tolerance: x of 1.5 m looks like centimetres"),
        (
            'units = ["m", "m"]\ntolerance = 0.015',
            'units = ["rad", "rad"]\ntolerance = 5',
            "of 5 rad looks like degrees; give radians",
        ),
        ("dt = 0.02", "dt = 12.5", r":\d+:.*dt = 12.5: looks like milliseconds"),
        ("tolerance = 0.015", "", r"\[outcome\] tolerance: missing"),
        ("dt = 0.02", "dt = true", "dt = True: expected `float`, got `bool`"),
        ("dt = 0.02", "dt = 0", r"\[plan\].*positive number of seconds"),
        ('units = ["rad", "rad"]', 'units = ["rad"]', r"\[plan\].*as many units"),
        (
            'names = ["joint1", "joint2"]',
            'names = "joint1"',
            "= .joint1.: expected `array`",
        ),
        ('units = ["m", "m"]', 'units = ["m"]', "one unit for each"),
        ('name = "planar"', 'nmae = "planar"', r"nmae = 'planar'.*unknown; keys are name"),
        ('name = "planar"', 'name = " "', "name = ' ': expected `str` matching"),
        ('model = "none"', 'model = "ur5"', r"\[robot\].*known are panda, fr3, ur5e"),
        (
            'model = "none"',
            'model = "given"',
            r"joint_names: missing \(and lower, upper, velocity\)",
        ),
        ("dt = 0.02", f"dt = 1{'0' * 400}", "number out of range"),
        ('model = "none"', 'model = "none"\nheld = { lift = nan }', r"held = .*must be finite"),
        ("[gate]", "[gate]\nworkspace_low = [0, 0]", "expected `array.*` of length 3"),
        ("[gate]", "[gate]\nbox_low = [0, 0, 0]", r"box_low.*unknown; keys are .*workspace_low"),
        ("[gate]", "[gate]\nworkspace_low = [0, 0, 0]", r"\[gate\].*needs both corners"),
        ("[gate]", "[gait]", "unknown; sections are"),
        ("[gate]", "[gate]\nbeyond_refuse = -1", r"\[gate\].*beyond_warn"),
    ],
)
def test_a_wrong_value_is_named_with_its_place(tmp_path, old, new, message):
    text = manifest()
    assert old in text
    with pytest.raises(ConfigurationError, match=message) as caught:
        load_manifest(write(tmp_path, text.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_the_line_is_the_line(tmp_path):
    text = manifest().replace("tolerance = 0.015", "tolerance = -1")
    line = next(i for i, row in enumerate(text.splitlines(), 1) if row.startswith("tolerance"))
    with pytest.raises(ConfigurationError, match=rf"workspace\.toml:{line}:"):
        load_manifest(write(tmp_path, text))


def test_a_missing_file_and_one_that_is_no_toml_are_named(tmp_path):
    with pytest.raises(FileFormatError, match="no manifest at"):
        load_manifest(tmp_path / "workspace.toml")
    with pytest.raises(FileFormatError, match=r"not a TOML file.*line 1"):
        load_manifest(write(tmp_path, "name = \nx = 1"))
    (tmp_path / "workspace.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="not a text in UTF-8"):
        load_manifest(tmp_path / "workspace.toml")


@pytest.mark.slow
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2000), st.binary(max_size=3))
def test_no_damage_causes_anything_but_a_named_error(tmp_path, position, junk):
    whole = manifest().encode()
    position %= len(whole)
    path = tmp_path / "workspace.toml"
    path.write_bytes(whole[:position] + junk + whole[position + len(junk) :])
    with contextlib.suppress(ConfigurationError, FileFormatError):
        assert min(load_manifest(path).outcome_format.tolerance) > 0


@pytest.mark.slow
def test_reading_one_loads_nothing_heavy():
    """Every command on a workspace does so, also those that only look something up."""
    heavy = ("scipy.interpolate", "scipy.spatial", "mujoco", "torch", "matplotlib")
    code = "import sys, prior_reinforce.arm.workspace.manifest; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(heavy) & set(done.stdout.split())


def test_frames_closer_than_an_arms_cycle_are_refused_before_anything_is_recorded(tmp_path):
    with pytest.raises(
        ConfigurationError, match=r"dt = 0\.0005: is less than an arm's cycle of 0\.001 s"
    ):
        load_manifest(write(tmp_path, manifest(robot="panda", dt=0.0005, **SEVEN)))
    assert (
        load_manifest(write(tmp_path, manifest(robot="panda", dt=0.001, **SEVEN))).format.dt
        == 0.001
    )
    assert load_manifest(write(tmp_path, manifest(dt=0.0005))).robot is None


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('host = "172.16.0.2"', r":\d+: \[arm\] executor: must be one of fr3"),
        ('executor = "r2d2"', "no executor 'r2d2'; known are fr3"),
        ('executor = "fr3"', "missing required field `host`"),
        ('executor = "fr3"\nhost = 5', "Expected `str`, got `int`"),
        ('executor = "fr3"\nhost = "a"\nhots = "b"', "no setting 'hots'; it has host"),
        ('executor = "fr3"\nhost = "a"\nfirmware = "4.2"', "no limits for fr3 with firmware"),
        ('executor = "fr3"\nhost = "a"\ncollision_thresholds = [20, -1]', "Expected `float` > 0"),
    ],
)
def test_what_drives_the_arm_is_held_against_its_executor(tmp_path, lines, message):
    with pytest.raises(ConfigurationError, match=message):
        load_manifest(write(tmp_path, f"{manifest()}\n[arm]\n{lines}\n"))


def test_the_arm_of_the_template_can_be_used_and_ones_own_has_to_be_registered(tmp_path):
    text = manifest()
    start = text.index("# [arm]")
    named = re.sub("^# ", "", text[start:], flags=re.M)
    driven_by = load_manifest(write(tmp_path, text[:start] + named)).driven_by
    assert (driven_by.executor, driven_by.options) == ("fr3", {"host": "172.16.0.2"})
    own = f'{text}\n[arm]\nexecutor = "antigravity:Arm"\nport = 5\n'
    with pytest.raises(ConfigurationError, match=r"no executor 'antigravity:Arm'.*--plugins"):
        load_manifest(write(tmp_path, own))
    assert "antigravity" not in sys.modules
    assert load_manifest(write(tmp_path, text)).driven_by is None
