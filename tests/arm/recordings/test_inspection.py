"""What recordings hold is said before anything is taken in."""

from dataclasses import replace

import numpy as np
import pytest

from prior_reinforce.arm.recordings import Preprocessing, import_demonstrations, inspect_recordings
from prior_reinforce.arm.recordings.inspection import (
    Wanted,
    acceleration_of,
    inspect,
    say_small,
)
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.recordings.selection import select
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import InvalidDemonstrationsError, UnclearUnitsError
from prior_reinforce.plans.interpolation import join_frames
from tests.arm.recordings.recorded import (
    JOINTS,
    OUTCOMES,
    N,
    sampled,
    write_npz,
    write_outcomes,
)


@pytest.fixture
def folder(tmp_path):
    return write_npz(tmp_path)


def table(text, head):
    """A table's rows by their first cell."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(head))
    rows = {}
    for line in lines[start + 1 :]:
        if not line:
            break
        rows[line.split()[0]] = line.split()[1:]
    return rows


def test_episodes_and_channels_are_tabled_without_outcomes(folder):
    found = inspect_recordings(folder, preprocessing=Preprocessing(trim=False))
    episodes = table(found.text, "episode ")
    assert episodes["throw_1"] == ["181", "100", "1.80", "0.00", "0.00"]
    channels = table(found.text, "channel ")
    assert channels["joint3"][-1] == "held"
    assert channels["joint4"][:4] == ["joint4", "rad", "-2", "-1"]
    assert found.robot is None
    assert "limits" not in found.rows


@pytest.mark.slow
def test_what_would_be_cut_is_told(folder):
    cut = table(inspect_recordings(folder).text, "episode ")["throw_0"][-2:]
    assert all(float(seconds) > 0.1 for seconds in cut)


def test_guesses_are_named_with_the_options_that_settle_them(tmp_path):
    for i in range(N):
        t, q = sampled(i, 100)
        np.savez(tmp_path / f"{i}.npz", t=1000 * t, q=np.rad2deg(q), joint_names=JOINTS)
    found = inspect_recordings(tmp_path)
    assert [doubt.option for doubt in found.ambiguities] == ["--time-unit ms", "--units deg"]
    assert "(--time-unit ms)" in found.text
    assert table(found.text, "channel ")["joint4"][:3] == ["joint4", "rad,", "from"]
    assert found.recordings[0].duration == pytest.approx(1.7)


def test_a_channel_is_listed_by_its_recorded_name(tmp_path):
    for i in range(2):
        t, q = sampled(i, 100)
        names = [f"panda_joint{k}" for k in range(1, 8)]
        np.savez(tmp_path / f"{i}.npz", t=t, q=q, joint_names=names)
    found = inspect_recordings(tmp_path, joints=["joint4", "joint2"])
    assert table(found.text, "channel ")["joint4"][0] == "panda_joint4"


@pytest.mark.slow
def test_every_demonstration_is_held_against_the_robots_limits(folder):
    panda = robot_limits("panda")
    write_outcomes(folder)
    passing = import_demonstrations(folder, robot=panda).preview
    assert "panda: all 6 demonstrations pass" in passing.text
    # Joint 6 of throw i turns 0.9 (1 + i / 20) rad in 1 + (i % 3) / 10 s; its peak is 15/8 of that
    # on average, so 1.94 rad/s in throw 3 and 1.69 rad/s in throw 0.
    slow = replace(panda, velocity=np.array([2.175] * 5 + [1.9, 2.61]))
    found = inspect_recordings(folder, robot=slow)
    assert [report.refused for report in found.reports] == [i == 3 for i in range(N)]
    assert found.rows["limits"].startswith("panda: 1 of 6 demonstrations break a limit")
    assert found.remarks[0].startswith("the gate refuses velocity: throw_3 (joint6 at 1.94")


@pytest.mark.slow
def test_noise_that_breaks_a_limit_is_offered_smoothing(tmp_path):
    rng = np.random.default_rng(0)
    for i in range(2):
        t, q = sampled(i, 1000)
        noisy = q + rng.normal(0, 1e-4, q.shape)
        np.savez(tmp_path / f"{i}.npz", t=t, q=noisy, joint_names=JOINTS)
    panda = robot_limits("panda")
    found = inspect_recordings(tmp_path, robot=panda)
    assert any(r.startswith("the gate refuses acceleration") for r in found.remarks)
    assert any(r.endswith("--smooth 20 takes it out") for r in found.remarks)
    assert "with --smooth 20 fewer demonstrations break a limit" in found.remarks
    assert found.remedy == "--smooth 20"
    smooth = inspect_recordings(tmp_path, robot=panda, preprocessing=Preprocessing(smooth=20.0))
    assert not any(r.refused for r in smooth.reports)
    assert smooth.remedy == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "sigma", "skipped", "faster", "dt"),
    [
        (100, 0.0, 0.0, 3.0, None),  # nothing but too fast
        (30, 0.0, 0.0, 2.0, 0.04),  # too fast, at plans that --smooth 20 refuses
        (30, 1e-3, 0.0, 1.0, 0.04),
        (100, 1e-4, 0.8, 1.0, None),  # starts in motion
        (100, 1e-4, 0.0, 3.0, None),  # noise, and too fast without it
    ],
)
def test_smoothing_is_no_remedy_where_all_break_a_limit_after_it(
    tmp_path, rate, sigma, skipped, faster, dt
):
    rng = np.random.default_rng(0)
    for i in range(2):
        t, q = sampled(i, rate)
        t, q = t[t >= skipped] / faster, q[t >= skipped]
        noisy = q + rng.normal(0, sigma, q.shape)
        np.savez(tmp_path / f"{i}.npz", t=t, q=noisy, joint_names=JOINTS)
    panda = robot_limits("panda")
    found = inspect_recordings(tmp_path, robot=panda, preprocessing=Preprocessing(dt=dt))
    assert all(report.refused for report in found.reports)
    assert found.remedy == ""
    if not sigma or dt is not None:
        assert not any("--smooth" in remark for remark in found.remarks)


@pytest.mark.slow
def test_degrees_said_to_be_radians_break_every_limit_and_have_a_remedy(tmp_path):
    for i in range(2):
        t, q = sampled(i, 100)
        np.savez(tmp_path / f"{i}.npz", t=t, q=np.rad2deg(q) / 4, joint_names=JOINTS)
    said = inspect_recordings(tmp_path, robot=robot_limits("panda"), units=["rad"])
    assert said.remedy == "--units deg"
    right = inspect_recordings(tmp_path, robot=robot_limits("panda"), units=["deg"])
    assert right.remedy == ""


def test_small_numbers_are_said_in_thousandths():
    assert say_small(2.13e-5, "rad") == "0.021 mrad"
    assert say_small(0.0012, "m") == "1.2 mm"
    assert say_small(3.0, "counts") == "3 counts"


def noisy(folder, sigma, rate=80):
    """Two throws whose every joint has white noise."""
    rng = np.random.default_rng(0)
    for i in range(2):
        t, q = sampled(i, rate)
        q = q + rng.normal(0, sigma, q.shape)
        np.savez(folder / f"{i}.npz", t=t, q=q, joint_names=JOINTS)
    return folder


@pytest.mark.slow
def test_noise_that_takes_up_much_of_a_limit_is_said_with_what_takes_it_out(tmp_path):
    """2.5 standard deviations of 6 sigma / dt^2 in a cycle of 1 ms are 49 % of 3750 rad/s^3."""
    folder, panda = noisy(tmp_path, 1.9e-5), robot_limits("panda")
    found = inspect_recordings(folder, robot=panda)
    (remark,) = found.remarks
    share = 2.5 * 6 * found.processed.noise[1] * 80**2 * 1000 / 3750
    assert remark == (
        f"noise alone takes up about {share:.0%} of the jerk limit of joint2: --smooth 20 takes "
        "it out"
    )
    assert share == pytest.approx(0.49, abs=0.15)
    seen = [line.value for r in found.reports for line in r.lines if line.check == "jerk"]
    assert max(seen) > 0.25 * 3750
    smooth = inspect_recordings(folder, robot=panda, preprocessing=Preprocessing(smooth=20.0))
    assert smooth.remarks == ()
    assert inspect_recordings(folder).remarks == ()


@pytest.mark.parametrize(("sigma", "rate"), [(2e-6, 80), (0.0, 15), (2e-5, 20)])
def test_little_noise_and_what_may_be_motion_are_not_remarked_on(tmp_path, sigma, rate):
    folder = noisy(tmp_path, sigma, rate)
    found = inspect_recordings(
        folder, robot=robot_limits("panda"), preprocessing=Preprocessing(dt=0.0125)
    )
    assert not any("noise" in remark for remark in found.remarks)


def test_noise_of_joints_that_are_held_is_not_remarked_on(tmp_path):
    rng = np.random.default_rng(0)
    for i in range(2):
        t, q = sampled(i, 80)
        q[:, 2] += rng.normal(0, 4e-5, len(q))
        np.savez(tmp_path / f"{i}.npz", t=t, q=q, joint_names=JOINTS)
    assert inspect_recordings(tmp_path, robot=robot_limits("panda")).remarks == ()


def test_noise_alone_accelerates_by_as_much_as_the_spline_through_it():
    sigma, dt = 2e-5, 0.0125
    noise = np.random.default_rng(0).normal(0, sigma, (20_000, 1))
    knots = join_frames(noise, dt)(np.arange(100, 19_900) * dt, 2)
    assert knots.std() == pytest.approx(6 * sigma / dt**2, rel=0.03)
    assert acceleration_of(np.array([sigma]), dt) == pytest.approx(2.5 * knots.std(), rel=0.03)


def test_columns_without_names_are_asked_about_as_the_joints_of_a_robot_that_is_named(tmp_path):
    """Under names of no joint, the gate would judge none of them."""
    t, q = sampled(0, 100)
    np.savez(tmp_path / "a.npz", t=t, q=q)
    found = inspect_recordings(tmp_path, robot=robot_limits("panda"))
    assert found.selection.names == robot_limits("panda").joint_names
    assert [one.option.split()[0] for one in found.ambiguities] == ["--joints"]


ROBOT = replace(robot_limits("panda"), held={"lift": 0.2})
NAMES = tuple(f"panda_{joint}" for joint in JOINTS)


def written(folder, lift, called="lift", form="csv"):
    """Throws beside a lift: a number, or its way in the last two of them."""
    for i in range(N):
        t, q = sampled(i, 50.0)
        at = np.full(len(t), lift[0] if i < 4 else np.linspace(*lift, len(t)))
        if form == "csv":
            head = ",".join(("t", *NAMES, called))
            rows = np.column_stack([t, q, at])
            np.savetxt(folder / f"{i}.csv", rows, delimiter=",", header=head, comments="")
        else:
            columns = np.array([*NAMES, called])
            np.savez(folder / f"{i}.npz", t=t, positions=np.column_stack([q, at]), names=columns)
    rows = [f"{name},{x},{y}" for name, (x, y) in OUTCOMES.items()]
    (folder / "outcomes.csv").write_text("\n".join(["episode,x,y", *rows]) + "\n")
    return folder


def imported(folder, robot=ROBOT, **options):
    return import_demonstrations(folder, joints=NAMES, robot=robot, **options).demonstrations


@pytest.mark.parametrize("form", ["csv", "npz"])
@pytest.mark.parametrize(
    ("lift", "called"), [((0.2, 0.2), "lift"), ((0.203, 0.2), "lift"), ((200.0, 200.0), "lift")]
)
def test_a_lift_that_stands_where_it_is_held_says_nothing(tmp_path, lift, called, form):
    assert imported(written(tmp_path, lift, called, form)).n == N


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_lift_that_is_held_at_zero_does_not_stand_elsewhere(tmp_path, form):
    folder = written(tmp_path, (0.3, 0.3), form=form)
    with pytest.raises(InvalidDemonstrationsError, match=r"at 0.3 in 0 to 5, .* at 0: "):
        imported(folder, replace(ROBOT, held={"lift": 0.0}))


def test_a_lift_in_an_array_of_its_own_is_compared_too(tmp_path):
    folder = written(tmp_path, (0.35, 0.35), form="npz")
    for path in folder.glob("*.npz"):
        with np.load(path) as own:
            t, q = own["t"], own["positions"]
        np.savez(path, t=t, q=q[:, :-1], joint_names=np.array(NAMES), lift=q[:, -1])
    with pytest.raises(InvalidDemonstrationsError, match=r"at 0.35 in 0 to 5, "):
        imported(folder)


def test_its_unit_is_read(tmp_path):
    assert imported(written(tmp_path, (200.0, 200.0), "lift [mm]")).n == N


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_lift_that_stood_elsewhere_is_named_with_both_places(tmp_path, form):
    with pytest.raises(InvalidDemonstrationsError, match=r"at 0.35 in 0 to 5, .* at 0.2: .*--hold"):
        imported(written(tmp_path, (0.35, 0.35), form=form))


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_lift_that_moves_is_named_with_its_takes(tmp_path, form):
    folder = written(tmp_path, (0.2, 0.3), form=form)
    with pytest.raises(InvalidDemonstrationsError, match=r"lift is .* from 0.2 to 0.3 in 4 to 5, "):
        imported(folder)
    assert imported(folder, leave_out=("4", "5")).n == 4


def test_other_columns_and_other_robots_are_not_asked(tmp_path):
    folder = written(tmp_path, (0.35, 0.35))
    assert imported(folder, replace(ROBOT, held={})).n == N
    assert imported(folder, replace(ROBOT, held={"torso": 0.2})).n == N


def test_a_held_joint_is_known_by_its_whole_name(tmp_path):
    """Pitch beside Wrist_Pitch."""
    robot = replace(robot_limits("panda"), held={"Pitch": 0.2, "Wrist_Pitch": 1.0})
    folder = written(tmp_path, (1.0, 1.0), "Wrist_Pitch")
    assert imported(folder, robot).n == N
    with pytest.raises(InvalidDemonstrationsError, match=r"Wrist_Pitch is recorded at 0\.5"):
        imported(written(folder, (0.5, 0.5), "Wrist_Pitch"), robot)


def test_counts_that_leap_are_asked_about_before_they_are_refused():
    robot, t = robot_limits("ur5e"), np.arange(100) * 0.01
    names = robot.joint_names
    q = np.round(30000 + np.outer(1 - np.cos(3 * t), np.linspace(1000, 5000, len(names))))
    some = select([Recording("a", t, q, names)], names, names, plan_units=("rad",))
    with pytest.raises(UnclearUnitsError, match="counts a turn") as asked:
        inspect(some, Wanted(robot=robot))
    assert asked.value.options == "--units UNIT"
