"""`import`, from the first command on."""

import errno
from collections import Counter

import numpy as np
import pytest
from matplotlib.figure import Figure

from prior_reinforce.arm.recordings import importer, inspection, npz
from prior_reinforce.arm.workspace.workspace import Workspace
from tests.arm.recordings.recorded import lerobot_set, write_outcomes
from tests.arm.workspace.planar import demonstrations, events_in, recordings

T = np.arange(24) * 0.02
NEW = (
    "--action-names", "joint1", "joint2", "--dt", "0.02", "--robot", "none",
)  # fmt: skip


def test_new_import_learn_and_what_comes_next(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings(tmp_path / "recordings")
    status, out, _ = run("new", "hoop", *NEW)
    assert status == 0
    assert "next: prior-reinforce import hoop RECORDINGS" in out
    status, out, _ = run("import", "hoop", "recordings")
    assert status == 0
    assert "episodes    4 from recordings" in out
    assert "next: prior-reinforce learn hoop" in out
    assert (tmp_path / "hoop" / "demonstrations.png").stat().st_size > 10_000
    status, out, _ = run("learn", "hoop")
    assert status == 0
    assert "next: prior-reinforce goal hoop X Y" in out


def in_milliseconds_and_degrees(folder):
    """Recordings that do not say so."""
    recordings(folder)
    for i, plan in enumerate(demonstrations().plans):
        t = np.arange(len(plan)) * 20
        np.savez(
            folder / f"throw_{i}.npz", t=t, q=np.rad2deg(plan), joint_names=["joint1", "joint2"]
        )


def shares(folder):
    """A set of LeRobot's in percent of each joint's range, which may as well be degrees."""
    shown = demonstrations()
    lerobot_set(folder, 50, [80 * plan for plan in shown.plans], ["joint1.pos", "joint2.pos"])
    write_outcomes(folder.parent, {str(i): r for i, r in enumerate(shown.outcomes_seen.tolist())})


def test_what_is_unclear_is_taken_only_when_said(run, folder, tmp_path):
    in_milliseconds_and_degrees(tmp_path / "odd")
    before = sorted((tmp_path / "planar").rglob("*"))
    status, _, err = run("import", folder, "odd")
    assert status == 2
    options = "--time-unit ms --units deg"
    assert err.rstrip().endswith(f"if so: prior-reinforce import planar odd {options}")
    assert sorted((tmp_path / "planar").rglob("*")) == before
    assert run("import", folder, "odd", "--no-trim", *options.split())[0] == 0
    with Workspace(folder) as workspace:
        np.testing.assert_allclose(workspace.demonstrations.plans, demonstrations().plans)


def test_a_unit_that_cannot_be_is_put_right_in_the_command(run, folder, tmp_path):
    in_milliseconds_and_degrees(tmp_path / "odd")
    (tmp_path / "odd" / "outcomes.csv").unlink()
    said = ("import", folder, "odd", "--time-unit", "s", "--units", "rad", "--no-trim")
    status, out, err = run(*said)
    assert (status, out) == (2, "")
    assert err.startswith("prior-reinforce: no outcomes for episodes throw_0, throw_1")
    command = "prior-reinforce import planar odd --no-trim --time-unit ms --units deg"
    assert err.endswith(f"if so: {command}\n")
    assert run(*said, "--inspect")[1].endswith(f"next: {command}\n")


def test_numbered_columns_are_looked_at_and_named_in_the_next_command(run, folder, tmp_path):
    (tmp_path / "odd").mkdir()
    for i, plan in enumerate(demonstrations().plans):
        rows = np.column_stack([np.arange(len(plan)) * 20, np.rad2deg(plan)])
        path = tmp_path / "odd" / f"take{i}.csv"
        np.savetxt(path, rows, delimiter=";", header="t;q0;q1", comments="")
    status, out, _ = run("import", folder, "odd", "--inspect", "--no-trim")
    assert status == 0
    assert "- no column is called joint1 to joint2: it looks as if q0 to q1 were these" in out
    assert ["joint1", "q0"] in [line.split()[:2] for line in out.splitlines()]
    following = out.splitlines()[-1].split("next: ")[1]
    assert following.endswith("--no-trim --time-unit ms --joints q0 q1 --units deg")
    table = tmp_path / "odd" / "outcomes.csv"
    rows = [f"take{i},{x},{y}," for i, (x, y) in enumerate(demonstrations().outcomes_seen)]
    table.write_text("\n".join(["episode,x [m],y [m],note", *rows]))
    status, _, err = run("import", folder, "odd", "--no-trim")
    assert status == 2
    assert err.endswith(f"if so: {following}\n")
    assert run(*following.split()[1:])[0] == 0
    with Workspace(folder) as workspace:
        np.testing.assert_allclose(workspace.demonstrations.plans, demonstrations().plans)
        assert workspace.demonstrations.format.names == ("joint1", "joint2")


def test_what_breaks_every_limit_is_not_learned_from_next(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings(tmp_path / "recordings")
    assert run("new", "arm", "--robot", "panda", "--dt", "0.02")[0] == 0
    for i, plan in enumerate(demonstrations().plans):
        t = np.arange(len(plan)) * 0.02
        q = 10 * plan[:, [0, 1, 0, 1, 0, 1, 0]]
        np.savez(
            tmp_path / "recordings" / f"throw_{i}.npz",
            t=t,
            q=q,
            joint_names=[f"joint{j + 1}" for j in range(q.shape[1])],
        )
    status, out, err = run("import", "arm", "recordings", "--units", "rad", "--no-trim")
    assert (status, err) == (0, "")
    assert "panda: 4 of 4 demonstrations break a limit" in out
    assert out.endswith("next: prior-reinforce import arm recordings --no-trim --units deg\n")


def test_what_is_refused_is_not_appended_so_the_remedy_leaves_no_twin(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    on_a_panda(run, tmp_path, 0.05, range(4))
    for i in range(4):
        with np.load(f"recordings/throw_{i}.npz") as was:
            kept = dict(was)
        kept["q"] = kept["q"] + [0, 0, 0, -1.5, 0, 1.5, 0]  # within joint4's range
        kept["q"][:, 1] += 2e-4 * (-1.0) ** np.arange(24) * (i == 3)  # an encoder's noise
        np.savez(f"recordings/throw_{i}.npz", **kept)
    said = ("import", "arm", "recordings", "--time-unit", "ms", "--no-trim", "--append")
    assert run(*said[:-1], "--leave-out", "throw_3")[0] == 0
    status, out, err = run(*said, "--episodes", "throw_3")
    assert status == 2
    assert "no symmetry" not in out
    assert "the gate refuses" in err
    with Workspace("arm") as workspace:
        assert workspace.demonstrations.n == 3
    remedy = err.partition("run: prior-reinforce ")[2].split()
    assert "--append" in remedy
    assert run(*remedy)[0] == 0
    with Workspace("arm") as workspace:
        assert workspace.demonstrations.n == 4


def test_or_agreed_to_at_a_terminal(run, folder, tmp_path, person):
    in_milliseconds_and_degrees(tmp_path / "odd")
    asked = person("no", "y", "yes").asked
    assert run("import", folder, "odd", "--no-trim")[0] == 2
    status, out, _ = run("import", folder, "odd", "--no-trim")
    assert status == 0
    assert "joint1 to joint2 [rad, recorded in deg]" in out
    assert all(said.endswith("; is it so?") for said in asked[:2])
    assert asked[2:] == ['got "y", which is not "yes" in full']
    with Workspace(folder) as workspace:
        np.testing.assert_allclose(workspace.demonstrations.plans, demonstrations().plans)


def test_what_only_the_user_knows_is_not_agreed_to(run, tmp_path, monkeypatch, person):
    monkeypatch.chdir(tmp_path)
    shares(tmp_path / "throws")
    run("new", "arm", "--robot", "none")
    asked = person("yes").asked
    status, _, err = run("import", "arm", "throws")
    assert (status, asked) == (2, [])
    assert err.endswith("import arm throws --units UNIT\n")


@pytest.mark.parametrize(
    ("new", "given"), [((), ("--units", "percent")), (("--action-units", "percent"), ())]
)
def test_shares_of_a_range_are_taken_in_where_no_robot_is_named(
    run, tmp_path, monkeypatch, new, given
):
    monkeypatch.chdir(tmp_path)
    shares(tmp_path / "throws")
    run("new", "arm", "--robot", "none", *new)
    status, _, err = run("import", "arm", "throws", *given)
    assert (status, err) == (0, "")
    with Workspace(tmp_path / "arm") as workspace:
        assert workspace.manifest.format.units == ("percent", "percent")
        assert workspace.demonstrations.plans.max() == pytest.approx(80, abs=1)


def test_a_single_recording_is_one_episode(run, folder, tmp_path):
    recordings(tmp_path / "own")
    for path in {*(tmp_path / "own").iterdir()} - {tmp_path / "own" / "throw_0.npz"}:
        path.unlink()
    assert "own: 1 episode\n" in run("import", folder, "own", "--inspect")[1]


def test_inspecting_looks_at_recordings_by_names_of_their_own(run, folder, tmp_path):
    recordings(tmp_path / "own")
    for path in (tmp_path / "own").glob("*.npz"):
        content = dict(np.load(path)) | {"joint_names": ["shoulder", "elbow"]}
        np.savez(path, **content)
    status, out, _ = run("import", folder, "own", "--inspect")
    assert status == 0
    assert "shoulder" in out
    assert "--joints" in out.splitlines()[-1]
    status, _, err = run("import", folder, "own")
    assert status == 2
    assert "--joints" in err


def test_inspecting_says_what_to_type_next_and_writes_a_table_to_fill_in(run, folder, tmp_path):
    in_milliseconds_and_degrees(tmp_path / "odd")
    (tmp_path / "odd" / "outcomes.csv").unlink()
    with Workspace(folder) as workspace:
        before = workspace.events
    status, out, _ = run("import", folder, "odd", "--inspect", "--no-trim")
    assert status == 0
    assert "outcomes: none yet; fill in odd/outcomes.csv" in out
    following = "prior-reinforce import planar odd --no-trim --time-unit ms --units deg"
    assert out.endswith(f"nothing was taken in; next: {following}\n")
    with Workspace(folder) as workspace:
        assert workspace.events == before
    table = tmp_path / "odd" / "outcomes.csv"
    assert table.read_text().startswith("episode,x [m],y [m],note\nthrow_0,,,\n")
    assert (
        "throw_0, throw_1, throw_2, throw_3 missing" in run("import", folder, "odd", "--inspect")[1]
    )
    filled = "episode,x [cm],y [cm],note\nthrow_0,80,-20,\nthrow_1,80,20,\n"
    table.write_text(filled + "throw_2,100,-20,short\nthrow_3,100,20,\n")
    assert run(*following.split()[1:])[0] == 0
    with Workspace(folder) as workspace:
        np.testing.assert_allclose(
            workspace.demonstrations.outcomes_seen, demonstrations().outcomes_seen
        )


def test_more_recordings_are_appended(run, folder, tmp_path):
    with Workspace(folder) as workspace:
        before = workspace.demonstrations
    longer = np.concatenate([before.plans[0], before.plans[0][-1:] + np.linspace(0, 1, 9)[:, None]])
    (tmp_path / "more").mkdir()
    t = np.arange(len(longer)) * 0.02
    for i in range(2):
        q = longer * (1 + i)
        np.savez(tmp_path / "more" / f"{i}.npz", t=t, q=q, joint_names=["joint1", "joint2"])
    (tmp_path / "more" / "outcomes.csv").write_text("episode,x,y\n0,0.7,0.1\n1,0.75,0\n")
    status, out, _ = run("import", folder, "more", "--append", "--no-trim")
    assert status == 0
    assert "4 demonstrations were there, now 6" in out
    assert "of 6; nearest two are 0 and 1," in out
    with Workspace(folder) as workspace:
        after = workspace.demonstrations
    assert after.plans.shape == (6, 33, 2)
    np.testing.assert_array_equal(after.plans[:4, :24], before.plans)
    np.testing.assert_array_equal(after.plans[:4, 24:], before.plans[:, -1:].repeat(9, axis=1))
    np.testing.assert_allclose(after.plans[5], 2 * longer)
    np.testing.assert_allclose(after.outcomes_seen[4:], [[0.7, 0.1], [0.75, 0]])
    status, _, err = run("import", folder, "more", "--append", "--no-trim")
    assert status == 2  # the same once more
    assert "demonstration 4 so far and 0 are one motion" in err


@pytest.mark.parametrize(
    ("columns", "named", "units", "rests_at"),
    [
        (("swivel_joint", "boom_joint"), (), ("rad", "rad"), 1.2),
        (("a", "b", "A", "B"), (), ("rad",) * 4, 1.2),
        (("slew_speed [rad]", "boom_joint [rad]"), (), ("rad", "rad"), 1.2),
        (("boom_joint_vel", "boom_joint"), ("boom_joint_vel", "boom_joint"), ("rad/s", "rad"), 0),
    ],
)
def test_the_plan_of_a_joint_ends_where_it_was_and_that_of_a_speed_at_0(
    run, tmp_path, monkeypatch, columns, named, units, rests_at
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own").mkdir()
    for k, n in enumerate((40, 60, 60, 60)):  # the first is held at its end
        phase = np.linspace(0.0, 1.0, n)
        q = (phase**2 * (3 - 2 * phase))[:, None] * (1.2 + 0.1 * k * np.arange(len(columns)))
        table = np.column_stack([np.arange(n) / 50, q])
        header = ",".join(("t", *columns))
        np.savetxt(f"own/{k}.csv", table, delimiter=",", header=header, comments="")
    write_outcomes(tmp_path / "own", {str(k): [0.5 + 0.1 * k, 0.05 * k**2] for k in range(4)})
    names = ("--action-names", *named) if named else ()
    assert run("new", "crane", *names, "--robot", "none", "--dt", "0.02", "--no-box")[0] == 0
    status, _, err = run("import", "crane", "own", "--no-trim")
    assert status == 0, err
    with Workspace("crane") as workspace:
        assert workspace.demonstrations.format.units == units
        assert workspace.demonstrations.plans[0, -1, 0] == pytest.approx(rests_at)


def test_episodes_with_odd_names_are_printed_as_text(run, folder, tmp_path, monkeypatch):
    rows = [
        f"{t},{q},{q},a\x1b[2J{i}" for i in range(4) for t, q in zip(T, T * (i + 1), strict=True)
    ]
    (tmp_path / "all.csv").write_text("\n".join(["t,joint1,joint2,episode", *rows]))
    (tmp_path / "outcomes.csv").write_text("episode,x,y\n")
    said = run("import", folder, "all.csv", "--inspect")[1]
    assert "a\\x1b[2J0, a\\x1b[2J1, a\\x1b[2J2, a\\x1b[2J3 missing" in said
    asked = []

    def answer(question):
        asked.append(question)
        return f"0.{len(asked)} 0.{len(asked) ** 2}"

    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("builtins.input", answer)
    status, out, err = run("import", folder, "all.csv")
    assert status == 0, err
    assert "\x1b" not in said + out + "".join(asked)


@pytest.fixture
def work(monkeypatch):
    """How often the costly steps of an import were taken."""
    counted = Counter()

    def count(module, name):
        real = getattr(module, name)

        def counting(*arguments, **options):
            counted[name] += 1
            return real(*arguments, **options)

        monkeypatch.setattr(module, name, counting)

    count(npz, "_arrays")
    count(importer, "select")
    count(importer.Recordings, "outcomes")
    count(inspection, "preprocess")
    count(inspection, "check_plan")
    return counted


ONCE = {"_arrays": 4, "select": 1, "outcomes": 1, "preprocess": 1, "check_plan": 4}


def on_a_panda(run, folder, scale, outcomes):
    """Four recordings of seven joints, and a workspace for them."""
    recordings(folder / "recordings", outcomes=outcomes)
    for i, plan in enumerate(demonstrations().plans):
        q = scale * plan[:, [0, 1, 0, 1, 0, 1, 0]]
        np.savez(
            folder / "recordings" / f"throw_{i}.npz",
            t=T * 1000,
            q=q,
            joint_names=[f"joint{j + 1}" for j in range(q.shape[1])],
        )
    assert run("new", "arm", "--robot", "panda", "--dt", "0.02")[0] == 0


def test_an_import_reads_and_checks_everything_once(run, tmp_path, monkeypatch, work, person):
    monkeypatch.chdir(tmp_path)
    on_a_panda(run, tmp_path, 0.05, [0, 1])
    assert run("import", "arm", "recordings", "--inspect", "--time-unit", "ms")[0] == 0
    assert work == ONCE
    work.clear()
    # At a terminal: a guess is agreed to, an outcome typed, and an episode skipped.
    person("yes")
    answers = iter(["100cm 20cm", "skip"])
    monkeypatch.setattr("builtins.input", lambda question: next(answers))
    status, out, err = run("import", "arm", "recordings", "--no-trim")
    assert (status, err) == (0, "")
    assert "throw_0, throw_1, throw_2" in out
    assert work == ONCE | {"check_plan": 3}


def test_smoothing_is_not_tried_where_positions_break_a_limit(run, tmp_path, monkeypatch, work):
    monkeypatch.chdir(tmp_path)
    on_a_panda(run, tmp_path, 3.0, range(4))
    assert run("import", "arm", "recordings", "--time-unit", "ms", "--no-trim")[0] == 0
    assert work == ONCE


def test_what_is_left_out_is_not_read(run, folder, tmp_path):
    recordings(tmp_path / "some")
    (tmp_path / "some" / "throw_2.npz").write_bytes(b"damaged")
    status, _, err = run("import", folder, "some", "--no-trim")
    assert status == 2
    assert "throw_2.npz cannot be read" in err
    status, out, err = run("import", folder, "some", "--no-trim", "--leave-out", "throw_2")
    assert (status, err) == (0, "")
    assert "3 from some" in out


def test_copies_are_found_by_inspecting(run, folder, tmp_path):
    recordings(tmp_path / "some")
    (tmp_path / "some" / "throw_4.npz").write_bytes((tmp_path / "some/throw_1.npz").read_bytes())
    status, out, _ = run("import", folder, "some", "--inspect")
    assert status == 0
    assert "throw_1 and throw_4 are one motion to the last number" in out


def test_a_channel_that_moves_and_is_left_out_is_named_with_its_range(run, folder, tmp_path):
    recordings(tmp_path / "some")
    for i, plan in enumerate(demonstrations().plans):
        gripper = np.where(T > 0.2, 70.0 + i, 8.0)
        still, index = np.full(len(T), 0.3), np.arange(len(T))
        q = np.column_stack([plan, gripper, gripper, still, index])
        names = ["joint1", "joint2", "gripper.pos", "gripper_velocity", "lamp", "index"]
        np.savez(tmp_path / "some" / f"throw_{i}.npz", t=T, q=q, joint_names=names)
    said = "left out although it moves: gripper.pos, 8 to 73 (take a gripper in: "
    assert said in run("import", folder, "some", "--inspect")[1]
    assert said in run("import", folder, "some", "--no-trim")[1]
    assert "without what moves as well: gripper.pos, 8 to 73" in run("status", folder)[1]


def test_one_in_a_csv_is_named_too_although_it_is_not_read(run, folder, tmp_path):
    (tmp_path / "some").mkdir()
    head = "t,joint1,joint2,gripper,target_joint1,target_joint2,note"
    for i, plan in enumerate(demonstrations().plans):
        rows = [[t, *q, 8 if t < 0.2 else 70, *q, "x"] for t, q in zip(T, plan, strict=True)]
        lines = [head, *(",".join(map(str, row)) for row in rows)]
        (tmp_path / "some" / f"throw_{i}.csv").write_text("\n".join(lines))
    out = run("import", folder, "some", "--inspect")[1]
    assert "left out although it moves: gripper, 8 to 70 (take a gripper in: new" in out


def test_a_picture_that_the_disk_refuses_is_a_remark(run, folder, tmp_path, monkeypatch):
    """Nothing that was recorded depends on it."""

    def refuse(figure, path, **how):
        path.write_bytes(b"half")
        raise OSError(errno.EFBIG, "File too large")

    monkeypatch.setattr(Figure, "savefig", refuse)
    recordings(tmp_path / "recorded")
    status, out, err = run("import", folder, "recorded")
    assert status == 0
    assert "picture:" not in out
    assert "next: prior-reinforce" in out
    assert err.count("\n") == 1
    assert "warning: no picture" in err
    assert "File too large" in err
    assert "ulimit -f" in err
    assert not (tmp_path / "planar" / "demonstrations.png").exists()
    assert events_in(folder)[-1].kind == "demonstrations_imported"


def test_inspecting_says_what_is_guessed_of_outcomes_and_an_import_what_was_said(
    run, folder, tmp_path
):
    recordings(tmp_path / "some")
    table = tmp_path / "some" / "outcomes.csv"
    _, *rows = table.read_text().splitlines()
    inches = [
        [row.split(",")[0], *(str(39.37 * float(n)) for n in row.split(",")[1:3])] for row in rows
    ]
    table.write_text("\n".join(["episode,x,y", *map(",".join, inches)]))
    out = run("import", folder, "some", "--inspect")[1]
    assert "it looks like cm (or inches: --outcome-unit in) (--outcome-unit cm)" in out
    out = run("import", folder, "some", "--outcome-unit", "cm")[1]
    assert "outcomes.csv, in cm as --outcome-unit says (or inches: --outcome-unit in)" in out


def test_inspecting_says_from_which_table_outcomes_are(run, folder, tmp_path):
    recordings(tmp_path / "some")
    table = tmp_path / "some" / "outcomes.csv"
    table.rename(table.with_name("results.csv"))
    out = run("import", folder, "some", "--inspect", "--format", "npz")[1]
    assert "outcomes: some/results.csv, none missing" in out
