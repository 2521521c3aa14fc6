"""Trimming, resampling and one horizon: nothing is cut, stretched or invented."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prior_reinforce.arm.recordings import import_demonstrations
from prior_reinforce.arm.recordings.preprocessing import Preprocessing, at_rests, preprocess
from prior_reinforce.arm.recordings.recording import Recording
from prior_reinforce.arm.robots.presets import robot_limits
from prior_reinforce.errors import (
    ConfigurationError,
    InvalidDemonstrationsError,
    UnclearUnitsError,
)
from prior_reinforce.generators import make_generator
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.plans.signals import analyse
from tests.arm.recordings.recorded import (
    AS_IS,
    BEFORE,
    OUTCOMES,
    SWING,
    N,
    duration,
    sampled,
    throw,
    write_csv,
    write_npz,
    write_outcomes,
)

UNITS = ("rad",) * 7


def form(*units, names=()):
    return PlanFormat(names or tuple(f"q{i}" for i in range(len(units))), units, 1.0)


FORM, STEPS = form(*UNITS), ("dx", "q")


def recording(t, q, name="0"):
    return Recording(name, t, np.asarray(q, dtype=float))


def throws(rate=100):
    return [recording(*sampled(i, rate), str(i)) for i in range(N)]


def test_still_ends_go_and_a_margin_stays():
    done = preprocess(throws(), FORM, Preprocessing())
    for i in range(N):
        # The largest motion is 0.9 * 1.25 rad; half a per cent of it is passed when the minimum
        # jerk polynomial reaches 0.005 * 1.25 / (1 + 0.05 i) of this throw's own motion.
        fraction = np.roots([6, -15, 10, 0, 0, -0.005 * 1.25 / (1 + 0.05 * i)])
        fraction = min(z.real for z in fraction if abs(z.imag) < 1e-9 and 0 < z.real < 1)
        onset = BEFORE + fraction * duration(i)
        assert done.starts[i] == pytest.approx(onset - 0.1, abs=0.011)
        assert done.starts[i] <= onset - 0.1
        assert done.ends[i] >= BEFORE + (1 - fraction) * duration(i) + 0.1
    shift = np.array(done.starts)
    t = np.arange(done.plans.shape[1]) * done.dt
    for i in range(N):
        inside = t + shift[i] <= done.ends[i]
        np.testing.assert_allclose(
            done.plans[i][inside], throw(i, t[inside] + shift[i]), atol=1e-12
        )


@pytest.mark.parametrize("seconds", [1.5, 3.0])
def test_nothing_of_a_soft_start_or_end_is_cut(seconds):
    """Half a per cent of the motion is passed later than the margin behind its beginning."""
    t = np.arange(round((1.6 + seconds) * 100)) / 100
    s = np.clip((t - 0.8) / seconds, 0, 1)[:, None]
    q = SWING * (10 * s**3 - 15 * s**4 + 6 * s**5)
    done = preprocess([recording(t, q)], FORM, Preprocessing())
    (start,), (end,) = done.starts, done.ends
    speed = np.abs(np.gradient(q, t, axis=0)).max(axis=1)
    assert max(speed[(t < start) | (t > end)]) <= 0.003 * speed.max()
    assert 0.7 <= start <= 0.8 + 0.01 * seconds
    assert 0.8 + 0.99 * seconds <= end <= 0.9 + seconds


def test_encoder_noise_is_no_motion():
    rng = np.random.default_rng(0)
    noisy = []
    for i in range(N):
        t, q = sampled(i, 100)
        noisy.append(recording(t, q + rng.uniform(-3e-4, 3e-4, q.shape), str(i)))
    clean = preprocess(throws(), FORM, Preprocessing())
    done = preprocess(noisy, FORM, Preprocessing())
    np.testing.assert_allclose(done.starts, clean.starts, atol=0.011)
    np.testing.assert_allclose(done.ends, clean.ends, atol=0.011)


def test_without_trimming_all_stays():
    done = preprocess(throws(), FORM, Preprocessing(trim=False))
    assert done.starts == (0.0,) * N
    assert done.plans.shape[1] == 191
    np.testing.assert_array_equal(done.plans[0][:171], sampled(0, 100)[1])
    np.testing.assert_array_equal(done.plans[0][171:], np.tile(sampled(0, 100)[1][-1], (20, 1)))
    assert done.held == 4


def test_a_motion_that_returns_to_its_start_is_kept_whole():
    t = np.arange(300) / 100
    q = np.where((t >= 1) & (t <= 2), np.sin(np.pi * (t - 1)), 0)[:, None]
    done = preprocess([recording(t, q)] * 2, form("rad"), Preprocessing())
    assert done.starts[0] < 1
    assert done.ends[0] > 2
    assert done.plans.max() == 1.0


@pytest.mark.parametrize("rate", [20, 50, 1000])
def test_other_rates_are_resampled_to_the_same_motion(rate):
    done = preprocess(throws(rate), FORM, Preprocessing(dt=0.01, trim=False))
    t = np.arange(done.plans.shape[1]) * 0.01
    # Splines through 20 Hz miss a 1 s minimum-jerk swing by 0.2 mrad at most, mostly at its ends.
    for i in range(N):
        np.testing.assert_allclose(done.plans[i], throw(i, t), atol=5e-4 if rate == 20 else 1e-5)


def test_jittered_stamps_are_put_on_the_grid():
    rng = np.random.default_rng(1)
    jittered = []
    for i in range(N):
        t = sampled(i, 100)[0]
        t = np.sort(t + rng.uniform(-0.004, 0.004, t.size))
        jittered.append(recording(t, throw(i, t), str(i)))
    done = preprocess(jittered, FORM, Preprocessing(dt=0.01, trim=False))
    t = np.arange(100) * 0.01
    for i in range(N):
        at = t + jittered[i].times[0]
        offset = sampled(i, 100)[0][0]
        moved = throw(i, at - offset)
        assert np.abs(done.plans[i][:100] - moved).max() < 0.01


@pytest.mark.parametrize("rate", [25, 40, 200])
def test_increments_at_another_rate_go_the_same_way(rate):
    """The sum is what counts: 25 frames a second have increments twice those of 50."""
    t = np.arange(60) / 50
    speed = 0.4 * np.sin(np.pi * np.clip((t - 0.2) / 0.8, 0, 1)) ** 2
    steps = np.column_stack([speed / 50, 0.05 - 0.05 * np.cos(2.0 * t)])
    done = preprocess(
        [recording(t, steps)], form("m", "rad", names=STEPS), Preprocessing(dt=1 / rate)
    )
    assert done.plans[0, :, 0].sum() == pytest.approx(steps[:, 0].sum(), abs=2e-5)
    middle = int(np.argmax(done.plans[0, :, 0]))
    assert done.plans[0, middle, 0] == pytest.approx(0.4 / rate, rel=0.02)
    # What is no increment is sampled as ever, beside the pose at which it was recorded.
    times = np.minimum(done.starts[0] + np.arange(done.plans.shape[1]) / rate, t[-1])
    np.testing.assert_allclose(done.plans[0, :, 1], 0.05 - 0.05 * np.cos(2.0 * times), atol=5e-4)


def test_increments_at_their_own_rate_stay_and_are_0_once_the_motion_is_over():
    t = np.arange(30) / 50
    steps = np.column_stack([0.01 + 0.002 * np.sin(t * 9), 0.02 * t])
    short, long = recording(t[:20], steps[:20], "0"), recording(t, steps, "1")
    done = preprocess([short, long], form("m", "rad", names=STEPS), Preprocessing(trim=False))
    np.testing.assert_allclose(done.plans[1], steps, atol=1e-12)
    np.testing.assert_allclose(done.plans[0, :20], steps[:20], atol=1e-12)
    np.testing.assert_allclose(done.plans[0, 20:], [[0.0, steps[19, 1]]] * 10, atol=1e-12)


def test_a_drive_at_constant_speed_is_motion_and_a_speed_is_0_once_the_recording_is_over():
    t = np.arange(90) / 30
    drive = np.interp(t, [0.5, 0.8], [0.0, 0.2])
    turn = np.interp(t, [1.0, 1.1, 1.3, 1.4], [0.0, 0.3, 0.3, 0.0])
    speeds = np.column_stack([drive, turn])
    short, long = recording(t[:80], speeds[:80], "0"), recording(t, speeds, "1")
    done = preprocess([short, long], form("m/s", "rad/s"), Preprocessing())
    assert 0.3 < done.starts[0] < 0.5
    np.testing.assert_allclose(
        done.plans[:, :, 0].sum(axis=1) / 30, [drive[:80].sum() / 30, drive.sum() / 30], atol=1e-9
    )
    assert not done.plans[0, -10:].any()
    assert [remark.partition(":")[0] for remark in done.remarks] == ["0", "1"]
    assert all("0.2 m/s" in remark and "pose" not in remark for remark in done.remarks)


@pytest.mark.parametrize(("missing", "said"), [([18, 19, 25], "3 of 60 frames"), ([2, 3], "")])
def test_increments_that_are_missing_in_mid_motion_are_counted(missing, said):
    t = np.arange(60) / 20
    steps = 0.01 * np.interp(t, [0.5, 1.0, 1.5, 2.0], [0.0, 1.0, 1.0, 0.0])[:, None]
    log = recording(np.delete(t, missing), np.delete(steps, missing, axis=0))
    remarks = preprocess([log], form("m", names=STEPS[:1]), Preprocessing(trim=False)).remarks
    assert [said in remark for remark in remarks if "missing" in remark] == [True] * bool(said)


def test_late_frames_are_not_lost():
    late = np.random.default_rng(0).uniform(-0.3, 0.3, 100)
    t = (np.arange(100) + late - late[0]) / 20
    log = recording(t, 0.01 + 0.005 * np.sin(t)[:, None])
    how = Preprocessing(trim=False)
    assert not [
        one
        for one in preprocess([log], form("m", names=STEPS[:1]), how).remarks
        if "missing" in one
    ]


@pytest.mark.parametrize(
    ("names", "units"), [(("dx", "vx"), ("m", "m/s")), (("dx", "joint1_vel"), ("m", "1"))]
)
def test_speeds_are_0_from_the_frame_after_the_last_by_unit_or_name(names, units):
    t = np.arange(30) / 50
    each = np.column_stack([0.01 + 0.002 * np.sin(t * 9), 0.2 + 0.02 * t])
    logs = [Recording(str(n), t[:n], each[:n], names) for n in (20, 30)]
    done = preprocess(logs, form(*units, names=names), Preprocessing(trim=False))
    np.testing.assert_allclose(done.plans[0], [*each[:20], *[[0.0, 0.0]] * 10], atol=1e-12)


@pytest.mark.parametrize(("names", "push"), [(("dx", "dy"), 0.01), (("vx", "wz"), 0.2)])
def test_a_push_at_constant_speed_is_no_rest(names, push):
    rest, ramp = np.zeros(12), np.linspace(0, 1, 5)
    w = push * np.concatenate([rest, ramp[1:], np.ones(16), ramp[::-1][1:], rest])
    speeds = np.tile(np.column_stack([w, 0.3 * w]), (3, 1))
    log = Recording("log", np.arange(len(speeds)) / 20, speeds, names)
    assert [len(at_rests(log, rest)) for rest in (0.3, 0.5)] == [3, 3]


def test_a_gripper_step_does_not_ring():
    t = np.arange(41) / 20
    q = np.column_stack([np.sin(t), (t >= 1.0) * 0.08])
    done = preprocess([recording(t, q)] * 2, form("rad", "m"), Preprocessing(dt=0.01, trim=False))
    assert done.plans[..., 1].min() == 0.0
    assert done.plans[..., 1].max() == pytest.approx(0.08, abs=1e-12)
    np.testing.assert_allclose(
        done.plans[0, :, 0], np.sin(np.arange(done.plans.shape[1]) * 0.01), atol=1e-5
    )
    assert "all: column2 jumps; no spline goes through it" in done.remarks


def test_a_horizon_holds_the_last_pose_and_never_cuts():
    done = preprocess(throws(), FORM, Preprocessing(horizon=200))
    assert done.plans.shape[1] == 200
    np.testing.assert_array_equal(done.plans[:, -1], [sampled(i, 100)[1][-1] for i in range(N)])
    assert done.held == N
    with pytest.raises(InvalidDemonstrationsError, match=r"more than the horizon 50.*never cut"):
        preprocess(throws(), FORM, Preprocessing(horizon=50))


def test_an_end_in_mid_swing_is_remarked():
    cut = [recording(*(part[: 100 + 10 * i] for part in sampled(i, 100)), str(i)) for i in range(2)]
    done = preprocess(cut, FORM, Preprocessing())
    moving = "(column1 to column2, column4 to column6)"
    assert done.remarks == (
        f"0: ends in motion, then holds its last pose {moving}",
        f"1: ends in motion {moving}",
    )


def test_a_start_in_mid_swing_is_remarked():
    cut = []
    for i in range(2):
        t, q = sampled(i, 100)
        cut.append(recording(t[60:], q[60:], str(i)))
    assert preprocess(cut, FORM, Preprocessing()).remarks == (
        "all: starts in motion (column1 to column2, column4 to column6)",
    )


@pytest.mark.parametrize("rate", [50, 500, 1000])
def test_a_held_joint_with_encoder_noise_is_held_and_at_rest(rate):
    """Two hundredths of a milliradian, as a Panda shows it: no remark, at any rate."""
    rng = np.random.default_rng(rate)
    noisy = []
    for i in range(N):
        t, q = sampled(i, rate)
        noisy.append(recording(t, q + rng.normal(0, 2e-5, q.shape), str(i)))
    done = preprocess(noisy, FORM, Preprocessing(dt=0.0125))
    assert done.remarks == ()
    assert done.held_channels == (2, 6)
    assert done.noise[[2, 6]] == pytest.approx(2e-5, rel=0.4)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [50, 200, 1000])
@pytest.mark.parametrize("sigma", [2e-5, 1e-4, 3e-4, 1e-3])
@pytest.mark.parametrize("count", [0.0, 2e-4])
def test_a_joint_that_is_held_is_held_in_the_plans_too(rate, sigma, count):
    """As import calls it, so it is learned: no plan trembles with a joint that nobody moved."""
    rng = np.random.default_rng(rate)
    noisy = []
    for i in range(N):
        t, q = sampled(i, rate)
        q = q + rng.normal(0, sigma, q.shape)
        noisy.append(recording(t, count * np.round(q / count) if count else q, str(i)))
    done = preprocess(noisy, FORM, Preprocessing(dt=0.02))
    assert done.held_channels == (2, 6)
    form = PlanFormat(tuple(f"joint{i}" for i in range(7)), UNITS, done.dt)
    demos = Demonstrations(done.plans, np.array(list(OUTCOMES.values())), form)
    goals = demos.outcomes_seen[:2].mean(axis=0, keepdims=True)
    (plan,) = make_generator("auto").fit(demos, seed=0).generate(goals)
    assert np.ptp(plan[:, [2, 6]], axis=0).max() < 1e-9


def test_smoothing_takes_noise_out_and_says_what_it_changed():
    rng = np.random.default_rng(0)
    noisy, clean = [], []
    for i in range(2):
        t, q = sampled(i, 500)
        clean.append(q)
        noisy.append(recording(t, q + rng.normal(0, 1e-4, q.shape), str(i)))
    settings = Preprocessing(dt=0.002, trim=False, smooth=20.0)
    done = preprocess(noisy, FORM, settings)
    plain = preprocess(noisy, FORM, Preprocessing(dt=0.002, trim=False))
    assert plain.smoothed is None
    n = len(clean[0])
    off = done.plans[0, :n] - plain.plans[0, :n]
    np.testing.assert_allclose(done.smoothed[0, 0], np.sqrt(np.mean(off**2, axis=0)))
    np.testing.assert_allclose(done.smoothed[0, 1], np.abs(off).max(axis=0))
    left = np.sqrt(np.mean((done.plans[0, :n] - clean[0]) ** 2, axis=0))
    # Of white noise, a fraction of 20 Hz in 250 Hz stays: sqrt(0.08), and the motion is kept.
    assert np.all(left < 0.4e-4)
    with pytest.raises(ConfigurationError, match="no less than half the plans' 500 Hz"):
        preprocess(noisy, FORM, Preprocessing(dt=0.002, smooth=250.0))


@pytest.mark.slow
def test_smoothing_slower_than_the_motion_is_refused():
    still = Preprocessing(dt=1e-5, trim=False, smooth=20.0)
    t = np.arange(2000) * 1e-5  # 20 ms
    with pytest.raises(
        ConfigurationError, match=r"faster than 0\.05 s, and episode 0 is 0\.02 s long"
    ):
        preprocess([Recording("0", t, np.column_stack([t, t]))], form(*UNITS[:2]), still)


def test_smoothing_leaves_a_gripper_alone():
    t = np.arange(100) / 100
    q = np.column_stack([np.sin(t), (t >= 0.5) * 0.08])
    settings = Preprocessing(dt=0.01, trim=False, smooth=10.0)
    done = preprocess([recording(t, q)] * 2, form("rad", "m"), settings)
    np.testing.assert_array_equal(done.plans[0, :, 1], q[:, 1])


@pytest.mark.slow
@pytest.mark.parametrize("rate", [50, 80, 200, 1000])
@pytest.mark.parametrize("frames", range(1, 11))
@pytest.mark.parametrize("sigma", [0.0, 2e-5])
def test_smoothing_leaves_a_gripper_alone_however_many_frames_it_opens_in(rate, frames, sigma):
    """As long as it opens within a quarter of the arm's motion, it is a step, and stays one."""
    rng, recordings = np.random.default_rng(0), []
    for i in range(N):
        t, q = sampled(i, rate)
        opens = 0.08 * np.clip((t - 0.9) * rate / frames, 0, 1) + sigma * rng.normal(size=t.size)
        recordings.append(recording(t, np.column_stack([q, opens]), str(i)))
    own = form(*UNITS, "m")
    plain = preprocess(recordings, own, Preprocessing(trim=False))
    done = preprocess(recordings, own, Preprocessing(trim=False, smooth=20.0))
    np.testing.assert_array_equal(done.plans[..., 7], plain.plans[..., 7])
    assert np.any(done.plans[..., :7] != plain.plans[..., :7])
    assert analyse(done.plans, own.units, done.dt).jumps.tolist() == [False] * 7 + [True]


def test_gaps_are_remarked():
    t, q = sampled(0, 100)
    keep = np.ones(t.size, dtype=bool)
    keep[60:80] = False
    done = preprocess([recording(t[keep], q[keep])] * 2, FORM, Preprocessing())
    assert done.remarks == ("all: nothing recorded for 0.210 s at 0.59 s",)


def test_an_episode_that_never_moves_is_named():
    t, q = sampled(0, 100)
    still = recording(t, np.tile(q[0], (t.size, 1)), "dud")
    with pytest.raises(InvalidDemonstrationsError, match="episode dud never moves"):
        preprocess([recording(t, q), still], FORM, Preprocessing())


def test_the_period_snaps_to_a_whole_rate():
    t, q = sampled(0, 100)
    done = preprocess([recording(t * 1.0004, q)] * 2, FORM, Preprocessing())
    assert done.dt == 0.01
    slow = preprocess([recording(t * 13.7, q)] * 2, FORM, Preprocessing())
    assert slow.dt == pytest.approx(0.137)


@pytest.mark.parametrize(
    ("name", "value"),
    [("dt", 0.0), ("dt", float("nan")), ("horizon", 1), ("margin", -0.1), ("smooth", 0.0)],
)
def test_settings_are_checked(name, value):
    with pytest.raises(ConfigurationError, match=f"{name}: Expected .*, got {value}"):
        Preprocessing(**{name: value})


def test_a_tiny_time_step_is_refused_before_it_fills_the_memory():
    with pytest.raises(InvalidDemonstrationsError, match="give a larger dt"):
        preprocess(throws(), FORM, Preprocessing(dt=1e-9))


@pytest.mark.slow
@settings(max_examples=60)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.02, 0.08),
    st.sampled_from([0.005, 0.01, 0.0125, 0.02, 1 / 30]),
    st.booleans(),
)
def test_plans_start_and_end_where_the_kept_recording_does(seed, period, dt, trim):
    rng = np.random.default_rng(seed)
    made = []
    for i in range(2):
        t = np.cumsum(rng.uniform(0.5, 1.5, 60) * period)
        made.append(recording(t, throw(i, t), str(i)))
    done = preprocess(made, FORM, Preprocessing(dt=dt, trim=trim))
    assert np.all(np.isfinite(done.plans))
    for source, plan, start, end in zip(made, done.plans, done.starts, done.ends, strict=True):
        first, last = np.searchsorted(source.times, [start, end])
        np.testing.assert_allclose(plan[0], source.positions[first], atol=1e-9)
        np.testing.assert_allclose(plan[-1], source.positions[last], atol=0.02 * 4 * np.ptp(SWING))
        assert (len(plan) - 1) * dt >= end - start - 0.03 * dt


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = write_npz(tmp_path_factory.mktemp("selected"))
    write_outcomes(folder)
    return folder


@pytest.mark.slow
def test_joints_are_picked_renamed_and_converted(tmp_path):
    write_outcomes(write_csv(tmp_path))
    plain = import_demonstrations(tmp_path, preprocessing=Preprocessing(trim=False))
    result = import_demonstrations(
        tmp_path,
        joints=["joint6", "joint4"],
        names=["wrist", "elbow"],
        units=["deg", "rad"],
        preprocessing=Preprocessing(trim=False),
    ).demonstrations
    assert result.format.names == ("wrist", "elbow")
    assert result.format.units == ("rad", "rad")
    np.testing.assert_allclose(result.plans[..., 0], np.deg2rad(plain.demonstrations.plans[..., 5]))
    np.testing.assert_array_equal(result.plans[..., 1], plain.demonstrations.plans[..., 3])


def degrees(folder):
    """Six throws in degrees, nothing saying so."""
    for i in range(N):
        t, q = sampled(i, 100)
        np.savez(folder / f"throw_{i}.npz", t=t, q=np.rad2deg(q))
    write_outcomes(folder)
    return folder


@pytest.mark.slow
def test_degrees_that_nobody_names_are_refused_until_said(tmp_path):
    folder = degrees(tmp_path)
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(folder)
    assert "column1 to column7 in rad would reach 167.6 (column6 of throw_5)" in str(caught.value)
    assert caught.value.options == "--units deg"
    for said in ({"units": ["deg"]}, {"take_guesses": True}):
        plans = import_demonstrations(folder, preprocessing=AS_IS, **said).demonstrations.plans
        np.testing.assert_allclose(plans[0, :171], sampled(0, 100)[1], atol=1e-12)


def test_a_unit_that_cannot_be_is_refused_whoever_says_it(tmp_path):
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(degrees(tmp_path), units=["rad"])
    assert "in rad, as --units says, would reach 167.6 (column6 of throw_5)" in str(caught.value)
    assert caught.value.options == "--units deg"


def test_what_no_arm_does_but_some_joint_could_is_the_first_remark(tmp_path):
    """Twelve radians: two turns of a joint without stops, or a few degrees."""
    for i in range(2):
        t, q = sampled(i, 100)
        np.savez(tmp_path / f"{i}.npz", t=t, q=q * 4)
    outcomes = {name: OUTCOMES[name] for name in ("0", "1")}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        preview = import_demonstrations(tmp_path, outcomes=outcomes, units=["rad"]).preview
    assert preview.remarks[0] == (
        "column6 of 1 reaches 10.98 rad, and arms do not: if it was recorded in deg, say "
        "--units deg"
    )


def far(folder, names, scale):
    """The last joint of six throws reaches twice as far as any joint turns."""
    for i in range(N):
        t, q = sampled(i, 100)
        q[:, 6] *= 11
        np.savez(folder / f"{i}.npz", t=t, q=q * scale, joint_names=names)
    write_outcomes(folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("said", ["in the names", "with --units"])
def test_degrees_that_were_said_are_not_advised_again(tmp_path, said):
    ending, units = ("_deg", None) if said == "in the names" else ("", ["deg"])
    folder = far(tmp_path, [f"j{i}{ending}" for i in range(7)], 180 / np.pi)
    result = import_demonstrations(folder, units=units, robot=robot_limits("panda"))
    assert np.abs(result.demonstrations.plans).max() == pytest.approx(8.8)
    assert not any("--units" in remark for remark in result.preview.remarks)
    assert result.preview.inspection.remedy == ""


@pytest.mark.slow
def test_a_unit_that_the_file_says_is_to_be_checked_and_not_said_otherwise(tmp_path):
    names = [*(f"joint{i}_rad" for i in range(1, 7)), "rail_m"]
    folder = far(tmp_path, names, 1.0)
    preview = import_demonstrations(folder, robot=robot_limits("panda")).preview
    assert preview.remarks[0] == "rail of 0 reaches 8.8 m, and arms do not: check its unit"
    names = [f"joint{i}_rad" for i in range(1, 8)]
    preview = import_demonstrations(far(folder, names, 1.0), robot=robot_limits("panda")).preview
    assert preview.remarks[0] == "joint7 of 0 reaches 8.8 rad, and arms do not: check its unit"
    assert preview.remarks[1].endswith(
        "joint7 is taken 1 turn lower, as the others have it: the same pose"
    )
    assert preview.inspection.remedy == ""


def test_one_unit_is_not_advised_for_channels_of_several(tmp_path):
    names, units = [f"c{i}" for i in range(7)], [*["rad"] * 6, "m"]
    preview = import_demonstrations(far(tmp_path, names, 1.0), units=units).preview
    assert preview.remarks[0] == "c6 of 0 reaches 8.8 m, and arms do not: check its unit"


def numbered(folder, names):
    folder.mkdir(exist_ok=True)
    for i in range(N):
        t, q = sampled(i, 100)
        np.savez(folder / f"{i}.npz", t=t, q=q, joint_names=names)
    write_outcomes(folder)
    return folder


@pytest.mark.slow
def test_numbered_columns_are_taken_for_the_plans_joints_only_when_said(tmp_path):
    recorded = [f"q{i}" for i in range(7)]
    folder, plan = numbered(tmp_path, recorded), tuple(f"joint{i}" for i in range(1, 8))
    with pytest.raises(UnclearUnitsError) as caught:
        import_demonstrations(folder, joints=plan, names=plan)
    assert str(caught.value) == (
        "no column is called joint1 to joint7: it looks as if q0 to q6 were these; if so, add: "
        "--joints q0 q1 q2 q3 q4 q5 q6"
    )
    said = import_demonstrations(folder, joints=recorded, names=plan).demonstrations
    guessed = import_demonstrations(folder, joints=plan, names=plan, take_guesses=True)
    np.testing.assert_array_equal(guessed.demonstrations.plans, said.plans)
    assert guessed.demonstrations.format.names == plan
    torques = numbered(tmp_path / "torques", [f"tau{i}" for i in range(7)])
    with pytest.raises(InvalidDemonstrationsError, match=r"it has tau0 to tau6: .* --joints$"):
        import_demonstrations(torques, joints=plan, names=plan)
    # What was said is not guessed about.
    with pytest.raises(InvalidDemonstrationsError, match="has no joint a1 to a7; it has q0 to q6"):
        import_demonstrations(folder, joints=[f"a{i}" for i in range(1, 8)], names=plan)


def test_plans_may_be_in_degrees(tmp_path):
    units = ("deg",) * 7
    result = import_demonstrations(
        degrees(tmp_path), units=["deg"], plan_units=units, preprocessing=AS_IS
    )
    assert result.demonstrations.format.units == units
    np.testing.assert_allclose(
        result.demonstrations.plans[0, :171], np.rad2deg(sampled(0, 100)[1]), atol=1e-12
    )
    with pytest.raises(ConfigurationError, match="recorded in cm, but plans are in deg"):
        import_demonstrations(tmp_path, units=["cm"], plan_units=units)


@pytest.mark.slow
def test_a_unit_in_a_channels_name_is_converted_and_may_not_be_contradicted(tmp_path):
    names = [f"j{i}_deg" for i in range(7)]
    for i in range(N):
        t, q = sampled(i, 100)
        np.savez(tmp_path / f"{i}.npz", t=t, q=np.rad2deg(q), joint_names=names)
    write_outcomes(tmp_path)
    result = import_demonstrations(tmp_path, preprocessing=AS_IS)
    assert result.demonstrations.format.names == tuple(f"j{i}" for i in range(7))
    assert "j0 to j6 [rad, recorded in deg]" in result.preview.text
    np.testing.assert_allclose(result.demonstrations.plans[0, :171], sampled(0, 100)[1], atol=1e-12)
    with pytest.raises(ConfigurationError, match="j0 of episode 0 is in deg, but --units says rad"):
        import_demonstrations(tmp_path, units=["rad"])


def test_joints_that_do_not_fit(folder):
    with pytest.raises(
        InvalidDemonstrationsError, match=r"no joint elbow; it has joint1 to joint7"
    ):
        import_demonstrations(folder, joints=["elbow"])
    with pytest.raises(ConfigurationError, match="need as many names"):
        import_demonstrations(folder, names=["a"])
    with pytest.raises(ConfigurationError, match="must be names that differ"):
        import_demonstrations(folder, joints=["joint1", "joint1"])


@pytest.mark.slow
def test_columns_without_names(tmp_path):
    plans = np.random.default_rng(0).normal(size=(6, 20, 3))
    np.savez(tmp_path / "all.npz", q=plans, rate=20)
    options = {"outcomes": OUTCOMES, "preprocessing": Preprocessing(trim=False)}
    made_up = import_demonstrations(tmp_path / "all.npz", **options).demonstrations
    assert made_up.format.names == ("column1", "column2", "column3")
    named = import_demonstrations(tmp_path / "all.npz", joints="xyz", **options).demonstrations
    assert named.format.names == ("x", "y", "z")
    with pytest.raises(
        InvalidDemonstrationsError, match="3 columns without names, and the plan 2 joints"
    ):
        import_demonstrations(tmp_path / "all.npz", joints="xy", **options)


def test_times_that_leap_are_told_before_the_frames_that_they_make():
    times = np.concatenate([[0.0], 2233.5 + np.arange(200) / 100])
    motion = np.column_stack([np.sin(times), np.cos(times)])
    recording = Recording("a", times, motion, ("pan", "lift"))
    with pytest.raises(InvalidDemonstrationsError, match=r"leap by 2234 s at frame 1"):
        preprocess(
            [recording], PlanFormat(("pan", "lift"), ("rad", "rad"), 0.0125), Preprocessing()
        )
