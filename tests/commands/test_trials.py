"""`ask` and `export`: where plans go, and what runs them."""

import json
import math
import re
import shutil
import sqlite3
import sys
from collections import Counter
from pathlib import Path

import pytest

from prior_reinforce.arm.executing import EXECUTORS
from prior_reinforce.arm.executing.lock import executing_lock, stop_executing
from prior_reinforce.arm.workspace import workspace as workspace_module
from prior_reinforce.arm.workspace.events import Moving
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.commands import trials as trials_module
from prior_reinforce.errors import TrialStateError
from prior_reinforce.registry import PLUGINS
from prior_reinforce.session.session import Session
from tests.arm.executing import toy_arm
from tests.arm.workspace.planar import events_in, recordings, stage_in, trials_in

NARROW = (
    'model = "given"\njoint_names = ["joint1", "joint2"]\nlower = [-3, -3]\nupper = [3, 3]\n'
    "velocity = [0.1, 0.1]\nacceleration = [1000, 1000]\njerk = [1000000, 1000000]"
)


@pytest.mark.parametrize(
    ("flags", "remedy"),
    [
        (("--out", "plan.txt"), "end the name in"),
        (("--out", "nowhere/plan.csv"), "make the folder first"),
        (("--out", "plan.csv", "--rate", "1e12"), "up to 1000"),
        (("--out", "plan.csv", "--rate", "nan"), "up to 1000"),
        (("--run", "true {plan}"), "or add --yes"),
        (("--yes", "--run", "true {plan}", "--rate", "1000"), "--run is given the plan's own"),
        (("--run", "true"), "hold {plan}"),
        (("--run", "no-such-controller {plan}"), "give the path of a program"),
        (("--run", "true {plan}", "--time-limit", "0"), "must be a positive number"),
    ],
)
def test_what_ask_cannot_do_is_said_before_a_trial_is_made(run, folder, flags, remedy):
    run("goal", folder, "0.9", "0.05")
    before = events_in(folder)
    status, out, err = run("ask", folder, *flags)
    assert (status, out) == (2, "")
    assert remedy in err
    assert len(err.splitlines()) == 1
    assert events_in(folder) == before


@pytest.fixture
def work(monkeypatch):
    """Counts what commands do: whole journals and manifests read, sessions, calls of the gate."""
    done = Counter()

    def count(owner, name, what):
        real = getattr(owner, name)

        def counted(*args, **kwargs):
            done[what] += 1
            return real(*args, **kwargs)

        monkeypatch.setattr(owner, name, counted)

    def connect(*args, connect=sqlite3.connect, **kwargs):
        connection = connect(*args, **kwargs)
        connection.set_trace_callback(
            lambda sql: done.update(readings="FROM events WHERE id >= 0 " in sql)
        )
        return connection

    monkeypatch.setattr(sqlite3, "connect", connect)
    count(Session, "__init__", "sessions")
    count(workspace_module, "parse_manifest", "manifests")
    count(Workspace, "gate", "gated")
    return done


@pytest.mark.parametrize(
    ("command", "sessions", "gated"),
    [
        (("goal", "0.9", "0.05"), 1, 0),
        (("ask",), 1, 1),
        (("ask", "--yes", "--run", "true {plan}"), 1, 3),
        (("tell", "1", "hit"), 1, 0),
        (("void", "1"), 1, 0),
        (("status",), 0, 0),
    ],
)
def test_a_command_reads_the_journal_once(run, folder, work, command, sessions, gated):
    """And builds one session; the gate is asked again for the question, and before a motion."""
    run("goal", folder, "0.9", "0.05")
    if command[0] not in ("goal", "ask"):
        run("ask", folder)
    work.clear()
    name, *rest = command
    assert run(name, folder, *rest)[0] == 0
    expected = {"readings": 1, "sessions": sessions, "manifests": 1, "gated": gated}
    assert {what: work[what] for what in expected} == expected


def test_ask_says_what_the_trial_may_expect(run, folder):
    run("goal", folder, "0.9", "0.05")
    out = run("ask", folder)[1]
    (trial,) = trials_in(folder)
    assert "trial 1: aims at 90 cm ahead, 5 cm left\n" in out
    assert f"a hit is possible; about {trial.expected.trials:.1f} trials" in out
    run("tell", folder, 1, "5 cm long")
    assert re.search(r"trial 2: aims at .* \(.* short.* of the goal, so", run("ask", folder)[1])
    run("void", folder, 2)
    run("void", folder, 1)
    run("goal", folder, "0.9", "0.05", "--adapter", "gp")
    assert "a hit is" not in run("ask", folder)[1]


def test_where_a_throw_goes_to_a_side_the_words_for_too_far_are_said(run, folder):
    run("goal", folder, "0.9", "0.05")
    assert "too far is" not in run("ask", folder)[1]
    run("tell", folder, 1, "hit")
    run("goal", folder, "0.8", "0.35")
    assert "behind the robot: here, too far is long and left)" in run("ask", folder)[1]


def test_what_was_told_is_repeated_as_it_was_understood(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    out = run("tell", folder, 1, "--error", "5 long, 2 left")[1]
    assert out.startswith("trial 1: 5 cm long, 2 cm left; numbers without a unit are centimetres\n")
    assert "5 cm long, 2 cm left" in run("status", folder)[1]
    out = run("amend", folder, 1, "--error", "3 cm long, 2 cm left")[1]
    assert out.startswith("trial 1, corrected: 3 cm long, 2 cm left\n")


@pytest.mark.parametrize(
    ("unit", "action", "said", "spelt"),
    [
        ("in", "m", "2 long", "inches"),
        ("rad", "m", "0.2 high", "rad"),
    ],
)
def test_a_number_without_a_unit_is_said_to_be_in_the_tasks(
    run, tmp_path, monkeypatch, unit, action, said, spelt
):
    monkeypatch.chdir(tmp_path)
    slide(run, tmp_path, unit)
    run("goal", "slide", "2")
    run("ask", "slide")
    status, out, _ = run("tell", "slide", "1", said)
    assert status == 0
    assert f"; numbers without a unit are {spelt}\n" in out


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("rad", "1 rad too far"),
        ("rad", "20deg high"),
        ("ml", "2ml long"),
        ("ml", "2 ml too much, miss"),
        ("in", "one foot long"),
    ],
)
def test_a_unit_that_was_given_is_not_called_missing(run, tmp_path, monkeypatch, unit, said):
    monkeypatch.chdir(tmp_path)
    slide(run, tmp_path, unit)
    run("goal", "slide", "2")
    run("ask", "slide")
    for tell in ((said,), ("--error", said)):
        verb = "tell" if tell == (said,) else "amend"
        status, out, _ = run(verb, "slide", "1", *tell)
        assert status == 0
        assert said in out
        assert "without a unit" not in out


def test_an_amount_is_asked_for_in_its_own_words_and_unit(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    slide(run, tmp_path, "ml")
    run("goal", "slide", "2")
    assert '--error "_ml too much"' in run("ask", "slide")[1]


@pytest.mark.filterwarnings("ignore:goal x 8.028 rad lies")
def test_a_goal_of_more_than_a_turn_is_set_where_its_unit_is_said(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    slide(run, tmp_path, "rad")
    status, _, err = run("goal", "slide", "8")
    assert status == 2
    assert "8rad" in err
    assert run("goal", "slide", "460deg")[0] == 0
    run("ask", "slide")
    assert run("tell", "slide", "1", "--outcome", "7.5")[0] == 0
    (trial,) = trials_in(tmp_path / "slide")
    assert trial.error_seen == pytest.approx([7.5 - math.radians(460)])


def slide(run, folder, unit):
    """A task of one component, learned."""
    new = ("--outcome-names", "x", "--outcome-units", unit, "--tolerance", "0.1")
    run("new", "slide", "--robot", "none", "--action-names", "joint1", "joint2", *new)
    recordings(folder / "recorded")
    table = "\n".join(["episode,x", *(f"{i},{1 + i / 2}" for i in range(4))])
    (folder / "recorded" / "outcomes.csv").write_text(table)
    assert run("import", "slide", "recorded")[0] == 0
    assert run("learn", "slide", "--generator", "interpolation")[0] == 0


def test_after_three_poor_trials_it_is_said_what_would_help(run, folder):
    run("goal", folder, "0.9", "0.05")
    for number in range(1, 4):
        assert "would help" not in run("ask", folder)[1]
        run("tell", folder, number, "20 cm long" if number % 2 else "20 cm short")
    assert "would help: a demonstration near this goal" in run("ask", folder)[1]


def test_a_plan_can_be_put_elsewhere_trial_by_trial(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    for number in (1, 2):
        assert run("ask", folder, "--out", "plan-{trial}.csv")[0] == 0
        assert run("ask", folder, "--out", ".")[0] == 0
        run("tell", folder, number, "--error", "3cm long")
    assert sorted(path.name for path in tmp_path.glob("*-*")) == [
        *("plan-1.csv", "plan-2.csv", "trial-1.npz", "trial-2.npz")
    ]
    before = events_in(folder)
    status, out, err = run("ask", folder, "--out", "plan-1.csv")
    assert (status, out) == (2, "")
    assert "plan-1.csv is there already" in err
    assert "{trial}" in err
    (tmp_path / "plan-3.csv").touch()
    _, _, err = run("ask", folder, "--out", "plan-{trial}.csv")
    assert err.endswith("choose another name\n")
    assert events_in(folder) == before


def test_a_command_that_fails_is_told_by_the_status(run, folder, tmp_path):
    run("goal", folder, "0.9", "0.05")
    script = tmp_path / "arm.py"
    script.write_text("import sys; print('moved', sys.argv[1][-4:]); sys.exit(int(sys.argv[2]))")
    status, out, err = run("ask", folder, "--yes", "--run", f"python3 {script} {{plan}} 3")
    assert status == 1
    assert "moved .npz" in out
    assert "ended with status 3" in err
    assert "next: if it moved: prior-reinforce void planar 1" in out
    status, out, err = run("ask", folder, "--yes", "--run", f"python3 {script} {{plan}} 0")
    assert status == 2
    assert "a plan runs once" in err
    assert "it was executed already" in run("ask", folder)[1]
    run("void", folder, 1)
    status, out, _ = run("ask", folder, "--yes", "--run", f"python3 {script} {{plan}} 0")
    assert status == 0
    assert "next: prior-reinforce tell planar 2" in out


@pytest.fixture
def driver(tmp_path):
    """A driver that says what it is told to say; its command."""
    script = tmp_path / "arm.py"
    script.write_text(
        "import pathlib, sys\nfolder = pathlib.Path(sys.argv[2])\n"
        "(folder / 'result.json').write_text(pathlib.Path('say.json').read_text())\n"
        "open('motions', 'a').write('moved\\n')\n"
    )
    return f"{sys.executable} {script} {{plan}} {{result}}"


def test_a_trial_whose_arm_did_not_move_stays_open(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "not_moved", "reason": "door open"}')
    status, _, err = run("ask", folder, "--yes", "--run", driver)
    assert status == 1
    assert "the arm did not move: door open" in err
    assert stage_in(folder) == "asked"
    (tmp_path / "say.json").write_text('{"outcome": "done"}')
    assert run("ask", folder, "--yes", "--run", driver)[0] == 0
    assert stage_in(folder) == "executed"
    assert len(list((tmp_path / folder / "executions").iterdir())) == 2


def test_bad_tracking_is_warned_of_before_a_reading_is_taken(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "done", "tracking_rms": 0.09}')
    status, _, err = run("ask", folder, "--yes", "--run", driver)
    assert status == 0
    assert "went 0.09 rad rms off the plan, more than 0.01" in err
    _, _, err = run("tell", folder, 1, "--hit")
    assert "warning: trial 1 was executed, but went 0.09 rad rms off the plan" in err


def test_units_of_tracking_are_never_mixed(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    said = {"rad": 0.009, "percent": 4.4, "steps": 60.0}
    (tmp_path / "say.json").write_text(json.dumps({"outcome": "done", "tracking_rms": said}))
    status, out, err = run("ask", folder, "--yes", "--run", driver)
    assert (status, err) == (0, "")
    assert "next: prior-reinforce tell planar 1" in out
    manifest = tmp_path / folder / "workspace.toml"
    own = 'errors = [["percent", 5.0, 4.0], ["steps", 40.0, 40.0]]'
    manifest.write_text(manifest.read_text().replace("[gate]", f"[gate]\n{own}", 1))
    err = run("tell", folder, 1, "--hit")[2]
    assert "went 4.4 percent rms off the plan, more than 4" in err
    assert "went 60 steps rms off the plan, more than 40" in err
    assert "rad" not in err


def test_a_command_that_failed_before_the_arm_moved_costs_no_trial(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    broken = tmp_path / "broken.py"
    broken.write_text("import no_such_driver_of_mine")
    status, out, _ = run("ask", folder, "--yes", "--run", f"{sys.executable} {broken} {{plan}}")
    assert status == 1
    assert out.rstrip().endswith(
        "next: if it moved: prior-reinforce void planar 1 --reason WHY; if not: "
        "prior-reinforce ask planar --arm-did-not-move"
    )
    again = ("ask", folder, "--arm-did-not-move")
    status, out, _ = run(*again)
    assert status == 0
    assert 'next: prior-reinforce ask planar --run "COMMAND {plan}"' in out
    assert stage_in(folder) == "asked"
    (tmp_path / "say.json").write_text('{"outcome": "done"}')
    assert run("ask", folder, "--yes", "--run", driver)[0] == 0
    status, _, err = run(*again)  # whose command says that it was executed
    assert status == 2
    assert "trial 1 was executed to its end" in err
    assert stage_in(folder) == "executed"


def test_an_aborted_trial_is_proposed_to_be_voided(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "aborted", "reason": "reflex"}')
    status, _, err = run("ask", folder, "--yes", "--run", driver)
    assert status == 1
    assert "aborted: reflex" in err
    assert "prior-reinforce void planar 1" in run("status", folder)[1]
    assert run("void", folder, 1)[0] == 0


@pytest.mark.parametrize("answer", ["no", "yes", "Throw  1"])
def test_a_person_says_that_the_arm_may_move(run, folder, driver, tmp_path, person, answer):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "done"}')
    person(answer)
    status, _, _ = run("ask", folder, "--run", driver)
    assert status == (0 if answer.startswith("Throw") else 1)
    assert (tmp_path / "motions").exists() == (answer.startswith("Throw"))


def test_a_check_moves_nothing(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    status, out, _ = run("ask", folder, "--check", "--yes", "--run", driver)
    assert status == 0
    assert "it begins at joint1 0 rad, joint2 0 rad: move the arm there slowly first" in out
    assert "checked; nothing moved" in out
    assert not (tmp_path / "motions").exists()
    assert stage_in(folder) == "asked"


def cut_off(folder):
    with Workspace(folder) as workspace, workspace.log.exclusive():
        # What is written before the program dies.
        workspace.log.append(Moving(1, "trial", "arm", ""))


@pytest.mark.parametrize(("answer", "stage"), [("no", "asked"), ("yes", "executing")])
def test_a_cut_off_execution_asks_whether_the_arm_moved(run, folder, person, answer, stage):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    cut_off(folder)
    status, _, err = run("ask", folder)
    assert status == 2
    assert "did the arm move?" in err
    asked = person("perhaps", answer[0], answer).asked
    status, out, _ = run("ask", folder)
    assert asked == ["did the arm move?"] * 3
    assert status == (0 if answer == "no" else 1)
    assert stage_in(folder) == stage
    assert ("plan: " in out) == (answer == "no")


def test_export_writes_what_was_handed_out(run, folder):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder)
    status, out, _ = run("export", folder, 1, "plan.npz")
    assert status == 0
    assert json.loads(run("trials", folder, "--json")[1])[0]["sha256"] in out


def test_a_plan_of_before_a_correction_is_named_until_it_is_voided(run, folder):
    run("goal", folder, "0.9", "-0.05")
    run("ask", folder)
    assert "before your correction" not in run("tell", folder, 1, "30 cm long")[1]
    run("ask", folder)
    said = "trial 2 was planned before your correction; if it was not thrown yet, void it"
    assert said in run("amend", folder, 1, "3 cm long")[1]
    assert said in run("ask", folder)[1]
    assert said in run("void", folder, 1)[1]
    assert "before your correction" not in run("void", folder, 2)[1]
    assert "before your correction" not in run("ask", folder)[1]


def test_a_plan_that_is_refused_while_it_is_shown_leaves_nothing(
    run, folder, tmp_path, monkeypatch
):
    """The limits are narrowed between opening the workspace and the trial."""
    run("goal", folder, "0.9", "0.05")
    path = tmp_path / folder / "workspace.toml"
    ask = Session.ask

    def narrowed(session, **how):
        path.write_text(path.read_text().replace('model = "none"', NARROW, 1))
        return ask(session, **how)

    monkeypatch.setattr(Session, "ask", narrowed)
    status, out, err = run("ask", folder, "--out", "plan.npz")
    assert status != 0
    assert "velocity" in err
    assert "written" not in out
    assert not (tmp_path / "plan.npz").exists()


def test_limits_that_change_after_the_verdict_give_out_no_refused_plan(
    run, folder, tmp_path, monkeypatch
):
    """What is written is held against the limits of the moment at which it is written."""
    run("goal", folder, "0.9", "0.05")
    path = tmp_path / folder / "workspace.toml"
    ask = Session.ask

    def narrowed(session, **how):
        trial = ask(session, **how)
        path.write_text(path.read_text().replace('model = "none"', NARROW, 1))
        return trial

    monkeypatch.setattr(Session, "ask", narrowed)
    status, _, err = run("ask", folder, "--out", "plan.npz")
    assert status != 0
    assert "refused" in err
    assert not (tmp_path / "plan.npz").exists()


def test_a_restored_journal_asks_whether_that_was_this_trial(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "done"}')
    journal = tmp_path / folder / "journal.sqlite"
    backup = journal.read_bytes()  # before the trial was asked for
    assert run("ask", folder, "--yes", "--run", driver)[0] == 0
    journal.write_bytes(backup)
    for suffix in ("-wal", "-shm"):
        journal.with_name(journal.name + suffix).unlink(missing_ok=True)
    for _ in range(2):
        status, _, err = run("ask", folder, "--yes", "--run", driver)
        assert status != 0
        assert (tmp_path / "motions").read_text() == "moved\n"
    assert "did the arm move?" in err
    assert "restored from a copy" in run("status", folder)[1]
    # A person says that it was another one.
    status, _, err = run("ask", folder, "--yes", "--arm-did-not-move", "--run", driver)
    assert status == 0, err
    assert (tmp_path / "motions").read_text() == "moved\n" * 2


def test_a_copied_workspace_waits_for_the_arm(run, folder, driver, tmp_path):
    run("goal", folder, "0.9", "0.05")
    shutil.copytree(tmp_path / folder, tmp_path / "copy")
    (tmp_path / "say.json").write_text('{"outcome": "done"}')
    with executing_lock(tmp_path / folder):
        status, _, err = run("ask", "copy", "--yes", "--run", driver)
        assert status != 0
        assert "[robot] arm" in err
        assert not (tmp_path / "motions").exists()
        manifest = tmp_path / "copy" / "workspace.toml"
        manifest.write_text(manifest.read_text().replace("# arm = ", "arm = "))
        assert run("ask", "copy", "--yes", "--run", driver)[0] == 0


def test_the_journal_keeps_no_argument(run, folder, driver):
    run("goal", folder, "0.9", "0.05")
    run("ask", folder, "--yes", "--run", f"{driver} -p hunter2")
    assert "hunter2" not in run("log", folder)[1]


@pytest.fixture
def arm(run, folder, tmp_path, toy_plugin):
    """A toy arm that the manifest names; call it with what is wrong with it."""
    run("goal", folder, "0.9", "0.05")

    def named(**options):
        toy_arm.name_arm(tmp_path / folder, tmp_path / "arm", **options)
        return tmp_path / "arm"

    return named


STOP = "Ctrl-C stops the arm; keep the arm's own stop button in your hand."


@pytest.mark.parametrize(
    ("flags", "remedy"),
    [
        (("--execute",), "or add --yes"),
        (("--execute", "--yes", "--run", "true {plan}"), "drop --run"),
        (("--rehearse", "0.2"), "go with --execute"),
        (("--approach",), "go with --execute"),
        (("--execute", "--yes", "--rehearse", "1.5"), "must be a fraction of the speed"),
        (("--execute", "--yes", "--rehearse", "nan"), "must be a fraction of the speed"),
    ],
)
def test_what_cannot_be_executed_is_said_before_a_trial_is_made(run, arm, folder, flags, remedy):
    arm()
    before = events_in(folder)
    status, out, err = run("ask", folder, *flags)
    assert (status, out) == (2, "")
    assert remedy in err
    assert events_in(folder) == before


def test_a_manifest_starts_no_code_of_its_own(run, arm, folder, monkeypatch):
    toy, before = arm(), events_in(folder)
    monkeypatch.delenv(PLUGINS)
    with monkeypatch.context() as unknown:
        unknown.delitem(EXECUTORS.members, toy_arm.TOY)
        status, _, err = run("ask", folder, "--yes", "--execute")
        assert status == 2
        assert "no executor 'toy'" in err
        assert "your own is registered by the module that --plugins names" in err
    assert (toy_arm.motions(toy), events_in(folder)) == (0, before)
    status, _, err = run("ask", folder, "--yes", "--execute", "--plugins", toy_arm.__name__)
    assert (status, toy_arm.motions(toy)) == (0, 1), err


def test_without_an_arm_the_manifest_is_to_name_one(run, folder):
    run("goal", folder, "0.9", "0.05")
    assert "add [arm] with its executor" in run("ask", folder, "--yes", "--execute")[2]


@pytest.mark.parametrize("answer", ["no", "throw 1"])
def test_a_person_is_told_what_was_not_checked(run, arm, folder, person, answer):
    toy, asked = arm(), person(answer).asked
    status, out, _ = run("ask", folder, "--execute")
    assert asked == [
        "Trial 1 will run at FULL SPEED (0.5 s). NOT checked: self-collision, the table. "
        f"Is the area clear? {STOP}"
    ]
    assert status == (answer == "no")
    assert toy_arm.motions(toy) == (answer == "throw 1")
    assert "toy, firmware 1.0: the arm is 0 rad (joint1) from the start pose" in out


def test_a_command_is_asked_nothing_so_less_is_checked(run, folder, driver, tmp_path, person):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "done"}')
    asked = person("no").asked
    run("ask", folder, "--run", driver)
    assert asked == [
        "Trial 1 will run at FULL SPEED (0.5 s). NOT checked: where the arm stands, the arm's "
        f"limits, self-collision, the table. Is the area clear? {STOP.replace('arm;', 'command;')}"
    ]


def asked_at(run, folder, person, *flags):
    """What a person is asked, who says no."""
    asked = person("no").asked
    assert run("ask", folder, *flags)[0] == 1
    return asked


def test_an_arm_that_checks_its_range_alone_has_not_checked_its_limits(run, arm, folder, person):
    arm()
    assert "NOT checked: self-coll" in asked_at(run, folder, person, "--execute")[0]
    arm(checks="the range of every joint")
    asked = asked_at(run, folder, person, "--execute")[0]
    assert "NOT checked: self-collision, the arm's limits, the table. " in asked


def test_an_arm_that_stands_elsewhere_is_not_moved_there_unasked(run, arm, folder):
    toy = arm()
    (toy / "pose").write_text("0.0 0.3")
    status, _, err = run("ask", folder, "--yes", "--execute")
    assert status == 1
    assert (
        "0.3 rad (joint2) from the start pose; 0.02 is allowed; move it there, or ask again with "
        "--approach" in err
    )
    assert toy_arm.motions(toy) == 0


@pytest.mark.parametrize("answers", [["yes", "no"], ["yes", "yes", "yes"], ["yes", "yes", "no"]])
def test_each_motion_is_confirmed_and_none_is_made_unasked(run, arm, folder, person, answers):
    """And the yes to the slow way to the start is none to the throw."""
    toy, asked = arm(), person(*answers).asked
    (toy / "pose").write_text("0.0 0.3")
    status, out, err = run("ask", folder, "--approach", "--execute")
    assert status == 1, (out, err)
    assert "nothing moved; run ask again when the area is clear" in out
    assert [question.partition(".")[0] for question in asked[:2]] == [
        "The arm will move slowly to where trial 1 begins (1",
        "Trial 1 will run at FULL SPEED (0",
    ]
    assert asked[2:] == ['got "yes", which is not "throw 1" in full'] * (len(answers) - 2)
    assert toy_arm.motions(toy) == 1
    assert stage_in(folder) == "asked"


@pytest.mark.parametrize(("after", "motions"), [("look_at_arm", 0), ("execute", 1)])
def test_a_stop_between_two_motions_lets_no_other_begin(
    run, arm, folder, monkeypatch, after, motions
):
    toy, plain = arm(), getattr(trials_module, after)
    (toy / "pose").write_text("0.0 0.3")

    def then_stopped(workspace, *args, **kwargs):
        result = plain(workspace, *args, **kwargs)
        stop_executing(Path(folder))
        return result

    monkeypatch.setattr(trials_module, after, then_stopped)
    status, _, err = run("ask", folder, "--yes", "--approach", "--execute")
    assert status == 1
    assert "somebody pressed Stop since this was asked for" in err
    assert toy_arm.motions(toy) == motions
    assert stage_in(folder) == "asked"


@pytest.mark.parametrize(
    ("speed", "answers", "moves"),
    [("0.2", ["yes"], 1), ("0.9", ["yes", "throw 1"], 0), ("0.9", ["rehearse 1"], 1)],
)
def test_a_rehearsal_that_is_not_slow_is_no_plain_yes(
    run, arm, folder, person, speed, answers, moves
):
    toy, asked = arm(), person(*answers).asked
    assert run("ask", folder, "--rehearse", speed, "--execute")[0] == (not moves)
    assert f"Trial 1 will be rehearsed at {float(speed):.0%}".replace("%", " %") in asked[0]
    assert len(asked) == len(answers)
    assert toy_arm.motions(toy) == moves


def test_a_rehearsal_leaves_the_trial_as_it_was(run, arm, folder):
    toy = arm()
    status, out, _ = run("ask", folder, "--yes", "--rehearse", "0.5", "--execute")
    assert status == 0
    assert "measured: at most" in out
    assert stage_in(folder) == "asked"
    assert run("ask", folder, "--yes", "--approach", "--execute")[0] == 0
    assert stage_in(folder) == "executed"
    assert toy_arm.motions(toy) == 3
    assert "a plan runs once" in run("ask", folder, "--yes", "--execute")[2]


def test_what_was_not_executed_is_not_told_but_approached_again(run, arm, folder):
    toy = arm(kind="faults")
    (toy / "pose").write_text("0.0 0.3")
    again = f"prior-reinforce ask {folder} --execute --approach"
    status, out, err = run("ask", folder, "--yes", "--approach", "--execute")
    assert status == 1
    assert "the approach was aborted" in err
    assert f"next: {again}" in out
    said = run("status", folder)[1]
    assert "its approach was not made to its end; it waits to be executed" in said
    assert again in said
    before = events_in(folder)
    status, _, err = run("tell", folder, "1", "5cm long")
    assert status == 2
    assert f"trial 1 was not executed, its approach was not made to its end: run {again}" in err
    assert events_in(folder) == before
    arm()
    (toy / "pose").write_text("0.0 0.3")
    assert run("ask", folder, "--yes", "--approach", "--execute")[0] == 0
    assert run("tell", folder, "1", "5cm long")[0] == 0


def test_a_trial_that_the_manifests_arm_did_not_execute_is_not_told(run, arm, folder):
    arm()
    assert "--execute" in run("ask", folder)[1]
    status, _, err = run("tell", folder, "1", "--hit")
    assert status == 2
    assert "[arm] has not moved for it: run prior-reinforce ask" in err
    with Workspace(folder) as workspace, pytest.raises(TrialStateError, match="not executed"):
        workspace.session().tell(1, hit=True)
    assert run("void", folder, "1", "--reason", "no time")[0] == 0


@pytest.mark.parametrize("answer", ["no", "yes"])
def test_a_fault_voids_the_trial_after_a_question(run, arm, folder, person, answer):
    arm(kind="faults")
    asked = person(answer).asked
    status, out, err = run("ask", folder, "--yes", "--execute")
    assert status == 1
    assert f"aborted: {toy_arm.FAULT}" in err
    assert asked == ["void trial 1?"]
    assert stage_in(folder) == ("voided" if answer == "yes" else "executed")
    assert trials_in(folder)[0].note == (toy_arm.FAULT if answer == "yes" else "")
    assert "next: " in out


@pytest.mark.parametrize(
    ("options", "says"),
    [({"kind": "dead"}, "does not answer; switch it on"), ({"fastest": 0.1}, "more than 0.1000")],
)
def test_an_arm_that_refuses_is_not_asked_to_move(run, arm, folder, options, says):
    toy = arm(**options)
    status, _, err = run("ask", folder, "--yes", "--execute")
    assert status == 1
    assert says in err
    assert toy_arm.motions(toy) == 0
    assert stage_in(folder) == "asked"


def test_a_check_asks_the_arm_and_moves_nothing(run, arm, folder):
    toy = arm()
    status, out, _ = run("ask", folder, "--check", "--execute")
    assert status == 0
    assert "checked; nothing moved" in out
    assert toy_arm.motions(toy) == 0


def test_an_arm_that_somebody_moves_while_it_is_asked_about_makes_no_approach(
    run, arm, folder, person
):
    toy = arm()
    (toy / "pose").write_text("0.5 0.2")

    def move_it():
        (toy / "pose").write_text("1.5 0.2")
        return "yes"

    person(move_it)
    status, _, err = run("ask", folder, "--approach", "--execute")
    assert status == 1
    assert "from where it stood when a person was asked" in err
    assert toy_arm.motions(toy) == 0


def test_what_could_not_be_kept_of_a_throw_is_said_beside_what_is_told(
    run, folder, driver, tmp_path
):
    run("goal", folder, "0.9", "0.05")
    (tmp_path / "say.json").write_text('{"outcome": "done", "reason": "no path was measured"}')
    status, _, err = run("ask", folder, "--yes", "--run", driver)
    assert status == 0
    said = "executed, but its driver says: no path was measured"
    assert said in err
    assert said not in run("tell", folder, 1, "--hit")[1]
    assert f"reached (hit); {said}" in run("status", folder)[1]
