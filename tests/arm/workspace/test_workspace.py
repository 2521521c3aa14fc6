"""A workspace: what happened is kept, whatever happens in between."""

import copy
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.adapters.bayesian import BayesianAdapter
from prior_reinforce.adapters.proportional import ProportionalAdapter
from prior_reinforce.arm.workspace.execute import execute
from prior_reinforce.arm.workspace.manifest import parse_manifest
from prior_reinforce.arm.workspace.template import NewWorkspace, with_columns
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.errors import (
    ConfigurationError,
    FileFormatError,
    InvalidDemonstrationsError,
    InvalidFeedbackError,
    InvalidGoalError,
    RobotLimitError,
    TrialStateError,
    WorkspaceError,
)
from prior_reinforce.generators import GENERATORS, make_generator
from prior_reinforce.generators.base import Generator
from prior_reinforce.generators.interpolation import SmoothInterpolation
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.plan_format import PlanFormat
from prior_reinforce.readings import Reading
from prior_reinforce.registry import Member
from prior_reinforce.session.session import Session
from prior_reinforce.session.trials import Stage
from tests.arm.workspace.planar import (
    amend,
    ask,
    demonstrations,
    describe,
    manifest,
    recordings,
    reopened,
    tell,
    trials,
    void,
)

GOAL = [0.9, 0.05]
SLOW = (
    'model = "given"\njoint_names = ["joint1", "joint2"]\nlower = [-3, -3]\nupper = [3, 3]\n'
    "velocity = [0.1, 0.1]\nacceleration = [100, 100]\njerk = [10000, 10000]\n"
)


class OwnInterpolation(SmoothInterpolation):
    """Not one of ours, as far as the package knows."""

    name = "own-interpolation"


def test_a_told_trial_is_there_when_the_program_starts_again(workspace):
    trial = ask(workspace)
    tell(workspace, trial.number, [0.05, -0.02])
    again = reopened(workspace)
    (kept,) = trials(again)
    assert kept.stage is Stage.TOLD
    np.testing.assert_array_equal(kept.error_seen, [0.05, -0.02])
    np.testing.assert_array_equal(kept.condition, trial.condition)
    again.close()


def test_ask_gives_the_same_plan_also_from_another_program(workspace):
    first = ask(workspace)
    again = reopened(workspace)
    second = ask(again)
    assert second.number == first.number
    assert len(list((workspace.folder / "plans").glob("*.npz"))) == 1
    again.close()


@pytest.mark.slow
def test_the_next_condition_is_the_sessions(workspace):
    """The workspace adds nothing to Algorithm 1: a session in memory goes the same way."""
    generator = workspace.session().generator
    session = Session(generator, BayesianAdapter(), demonstrations(), GOAL, 0.015)
    for error in ([0.05, 0.0], [0.01, -0.02]):
        trial = session.ask()
        session.tell(trial.number, error)
        number = ask(workspace).number
        tell(workspace, number, error)
    np.testing.assert_array_equal(ask(workspace).condition, session.ask().condition)


@pytest.mark.slow
def test_numbers_run_over_all_goals_and_an_earlier_goals_trial_can_be_amended(workspace):
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    workspace.set_goal([0.95, 0.0])
    assert ask(workspace).number == 2
    amend(workspace, 1, [0.03, 0.0])
    assert not trials(workspace)[0].hit
    np.testing.assert_array_equal(trials(workspace)[0].error_seen, [0.03, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("adapter", "carry_over", "carried"),
    [
        ("bayes", None, True),
        ("bayes", False, False),
        ("gp", None, False),
        ("gp", True, True),
    ],
)
def test_earlier_goals_serve_a_later_one_where_they_serve_its_adapter(
    workspace, adapter, carry_over, carried
):
    tell(workspace, ask(workspace).number, [0.06, 0.03])
    goal = workspace.set_goal([0.91, 0.05], carry_over=carry_over, adapter=adapter)
    assert goal.carry_over is carried
    moved = np.linalg.norm(ask(workspace).condition - [0.91, 0.05])
    assert moved > 0.01 if carried else moved < 0.0005


@pytest.mark.slow
def test_new_hardware_is_noted_and_what_is_known_is_believed_less(workspace):
    for goal in ([0.9, 0.05], [0.95, -0.05], [0.85, 0.0]):
        workspace.set_goal(goal)
        for _ in range(2):
            number = ask(workspace).number
            session = workspace.session()
            error = session.trials[-1].condition - np.subtract(goal, [0.08, 0.0])
            session.tell(number, Reading.measured(error, 0.001), hit=False)
    shifted = workspace.set_goal([0.9, 0.0])
    known = ask(workspace)
    void(workspace, known.number, "")
    goal = workspace.set_goal([0.9, 0.0], new_hardware="another ball")
    assert goal.new_hardware == "another ball"
    anew = ask(workspace)
    assert (known.condition - shifted.goal)[0] < -0.06
    np.testing.assert_allclose(anew.condition, known.condition, atol=0.005)
    assert anew.expected.p_hit < 0.5 * known.expected.p_hit
    assert "another ball" in describe(workspace)


def test_the_adapter_is_the_goals(workspace):
    workspace.set_goal(GOAL, adapter="proportional,gain=0.5")
    tell(workspace, ask(workspace).number, [0.06, 0.03])
    again = reopened(workspace)
    np.testing.assert_allclose(ask(again).condition, np.subtract(GOAL, [0.03, 0.015]))
    assert "adapter proportional,gain=0.5" in describe(again)
    before = again.events
    for wrong in ("spline", "gp,size=2"):
        with pytest.raises(ConfigurationError):
            again.set_goal(GOAL, adapter=wrong)
    assert again.events == before
    again.close()


@pytest.mark.slow
def test_a_trial_of_another_model_is_left_out(workspace):
    first = ask(workspace)
    tell(workspace, first.number, [0.06, 0.03])
    workspace.learn("interpolation,timing=none")
    np.testing.assert_array_equal(ask(workspace).condition, first.condition)


@pytest.mark.slow
@pytest.mark.parametrize("choice", ["interpolation", "interpolation,timing=align"])
def test_a_workspace_plans_as_its_generator_does_by_itself(tmp_path, choice):
    """Recordings that start at different times, aligned or not."""
    demos = demonstrations()
    late = [
        np.concatenate([p[:1].repeat(n, 0), p[: len(p) - n]]) for n, p in enumerate(demos.plans)
    ]
    rest = np.repeat(np.array(late)[:, -1:], 4, axis=1)
    demos = Demonstrations(np.concatenate([late, rest], axis=1), demos.outcomes_seen, demos.format)
    with Workspace.create(tmp_path / "planar", manifest()) as workspace:
        workspace.import_demonstrations(demos, "made up")
        model = workspace.learn(choice).model
        workspace.set_goal(GOAL)
        trial = ask(workspace)
        alone = make_generator(choice).fit(demos, seed=0)
        expected = alone.generate(trial.condition[None])[0]
        np.testing.assert_array_equal(workspace.plan(trial).actions, expected)
        assert f"{model}, {choice}" in describe(workspace)


@pytest.mark.slow
def test_what_a_fit_chose_is_kept_and_shown(workspace):
    training = workspace.learn()
    assert [remark.split(":")[0] for remark in training.remarks] == ["generator", "timing"]
    assert all(remark in describe(workspace) for remark in training.remarks)


def test_ones_own_generator_is_registered_by_a_person_not_by_the_journal(workspace, monkeypatch):
    monkeypatch.setitem(
        GENERATORS.members, OwnInterpolation.name, Member(OwnInterpolation, "one's own")
    )
    workspace.learn(OwnInterpolation.name)
    assert ask(workspace).number == 1
    void(workspace, 1, "")
    before = workspace.events
    monkeypatch.delitem(GENERATORS.members, OwnInterpolation.name)
    with pytest.raises(FileFormatError, match=f"no generator '{OwnInterpolation.name}'.*--plugins"):
        ask(workspace)
    assert workspace.events == before


class OwnAdapter(ProportionalAdapter):
    """Not one of ours, as far as the package knows."""


def test_ones_own_adapter_is_registered_by_a_person_not_by_the_journal(workspace, monkeypatch):
    monkeypatch.setitem(ADAPTERS.members, "mine", Member(OwnAdapter, "one's own"))
    workspace.set_goal(GOAL, adapter="mine,gain=0.5")
    number = ask(workspace).number
    tell(workspace, number, [0.06, 0.03])
    np.testing.assert_allclose(ask(workspace).condition, np.subtract(GOAL, [0.03, 0.015]))
    void(workspace, 2, "")
    before = workspace.events
    monkeypatch.delitem(ADAPTERS.members, "mine")
    with pytest.raises(ConfigurationError, match=r"no adapter 'mine'.*--plugins"):
        ask(workspace)
    assert workspace.events == before


def test_bad_feedback_changes_nothing(workspace):
    number = ask(workspace).number
    before = workspace.events
    for error in ([0.1], [np.nan, 0.0], "wide"):
        with pytest.raises(InvalidFeedbackError):
            tell(workspace, number, error)
    for call in (
        lambda: tell(workspace, 7, [0.0, 0.0]),
        lambda: amend(workspace, number, [0.0, 0.0]),
        lambda: workspace.set_goal([0.9, 0.0]),
        lambda: workspace.learn("interpolation"),
    ):
        with pytest.raises(TrialStateError):
            call()
    assert workspace.events == before


def test_a_bad_goal_changes_nothing(workspace):
    before = workspace.events
    for goal in ([0.9], [np.inf, 0.0], ["a", "b"]):
        with pytest.raises(InvalidGoalError):
            workspace.set_goal(goal)
    assert workspace.events == before


@pytest.mark.slow
def test_the_order_of_things_is_told(tmp_path):
    workspace = Workspace.create(tmp_path / "new", manifest())
    with pytest.raises(WorkspaceError, match="prior-reinforce import"):
        workspace.set_goal(GOAL)
    workspace.import_demonstrations(demonstrations(), "made up")
    with pytest.raises(WorkspaceError, match="prior-reinforce learn"):
        ask(workspace)
    workspace.learn("interpolation")
    with pytest.raises(WorkspaceError, match="prior-reinforce goal"):
        ask(workspace)
    workspace.close()


def test_demonstrations_must_fit_the_manifest(workspace):
    other = demonstrations()
    slow = Demonstrations(
        other.plans, other.outcomes_seen, PlanFormat(other.format.names, other.format.units, 0.04)
    )
    with pytest.raises(InvalidDemonstrationsError, match=r"dt 0\.04.*0\.02"):
        workspace.import_demonstrations(slow, "slow.npz")


def test_a_plan_that_breaks_a_limit_is_refused_and_nothing_is_written(workspace):
    path = workspace.folder / "workspace.toml"
    path.write_text(path.read_text().replace('model = "none"', SLOW, 1))
    slow = reopened(workspace)
    before = slow.events
    with pytest.raises(RobotLimitError, match="velocity"):
        ask(slow)
    assert slow.events == before
    assert not list((slow.folder / "plans").glob("*"))
    slow.close()


@pytest.mark.slow
def test_a_plan_that_the_limits_refuse_by_now_is_neither_given_out_nor_executed(workspace):
    """The verdict counts at the moment of leaving, whatever it was when the plan was made."""
    number = ask(workspace).number
    path = workspace.folder / "workspace.toml"
    path.write_text(path.read_text().replace('model = "none"', SLOW, 1))
    narrow = reopened(workspace)
    before = narrow.events
    ran = workspace.folder / "ran"
    with pytest.raises(RobotLimitError, match="void it and ask again"):
        ask(narrow)
    with pytest.raises(RobotLimitError, match="velocity"):
        execute(narrow, number, f"touch {ran} {{plan}}", time_limit=20)
    assert narrow.events == before
    assert not ran.exists()
    narrow.close()


@pytest.mark.slow
def test_a_workspace_that_was_copied_goes_on(workspace, tmp_path):
    tell(workspace, ask(workspace).number, [0.05, -0.02])
    shutil.copytree(workspace.folder, tmp_path / "elsewhere")
    copy = Workspace(tmp_path / "elsewhere")
    np.testing.assert_array_equal(ask(copy).condition, ask(workspace).condition)
    copy.close()


def test_folders_that_are_no_workspace_are_named(tmp_path):
    with pytest.raises(WorkspaceError, match="prior-reinforce new"):
        Workspace(tmp_path)
    (tmp_path / "file").write_text("x")
    with pytest.raises(WorkspaceError, match="not empty"):
        Workspace.create(tmp_path, manifest())


def test_a_trial_is_told_once_and_voided_once_and_an_amendment_takes_both_back(workspace):
    number = ask(workspace).number
    tell(workspace, number, [0.05, 0.0])
    with pytest.raises(TrialStateError, match="amend it"):
        tell(workspace, number, [0.01, 0.0])
    void(workspace, number, "slipped")
    before = workspace.events
    with pytest.raises(TrialStateError, match="ask for another"):
        void(workspace, number, "again")
    with pytest.raises(TrialStateError, match="amend it"):
        tell(workspace, number, [0.0, 0.0])
    assert workspace.events == before
    amend(workspace, number, [0.0, 0.0])
    assert workspace.state.trial(number).hit


@pytest.mark.slow
def test_limits_that_were_narrowed_while_the_program_waited_are_the_ones_that_count(workspace):
    number = ask(workspace).number
    path = workspace.folder / "workspace.toml"
    path.write_text(path.read_text().replace('model = "none"', SLOW, 1))
    ran = workspace.folder / "ran"
    for call in (
        lambda: ask(workspace),
        lambda: execute(workspace, number, f"touch {ran} {{plan}}", time_limit=20),
    ):
        with pytest.raises(RobotLimitError, match="velocity"):
            call()
    assert not ran.exists()
    assert not (workspace.folder / "executions").exists()


@pytest.mark.parametrize(
    "name",
    [
        "journal.sqlite",
        "models",
        "plans",
        "pictures",
        "demonstrations.png",
        "report",
        "workspace.toml",
    ],
)
def test_links_out_of_the_folder_are_refused_before_anything_is_read_or_written(
    workspace, tmp_path, name
):
    workspace.close()
    target = tmp_path / "elsewhere"
    if (workspace.folder / name).exists():
        (workspace.folder / name).rename(target)
    (workspace.folder / name).symlink_to(target)
    with pytest.raises(FileFormatError, match=f"{name} is a link out of"):
        Workspace(workspace.folder)


@pytest.mark.parametrize("part", ["plans", "models", "demonstrations"])
def test_links_further_down_are_refused_too(workspace, tmp_path, part):
    ask(workspace)
    (path,) = (workspace.folder / part).iterdir()
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    again = reopened(workspace)
    if part != "plans":  # an open trial has its plan already
        void(again, 1, "")
    with pytest.raises(FileFormatError, match="is a link out of"):
        ask(again)
    again.close()


class Unsavable(Generator):
    """Knows how to learn, and not how to be kept."""

    def _fit(self, demonstrations, seed, progress):
        raise AssertionError("must be refused before it is fitted")

    def _generate(self, conditions): ...


def test_a_generator_that_cannot_be_kept_is_refused_before_it_is_fitted(workspace, monkeypatch):
    monkeypatch.setitem(GENERATORS.members, "unsavable", Member(Unsavable, "a test's own"))
    with pytest.raises(ConfigurationError, match=r"give the class state\(\) and from_state"):
        workspace.learn("unsavable")


@pytest.mark.slow
def test_one_long_session_follows_what_is_learned_and_chosen_meanwhile(tmp_path):
    with Workspace.create(tmp_path / "planar", manifest()) as workspace:
        workspace.import_demonstrations(demonstrations(), "made up")
        session = workspace.session()
        first = workspace.learn("interpolation").model
        session.set_goal(GOAL)
        alone = session.ask()
        assert alone.model == first
        session.tell(1, [0.06, 0.03])
        assert not np.allclose(session.ask().condition, alone.condition)
        session.void(2, "")
        with Workspace(workspace.folder) as elsewhere:
            second = elsewhere.learn("interpolation,timing=none").model
        trial = session.ask()
        assert trial.model == second
        np.testing.assert_array_equal(trial.condition, alone.condition)
        session.tell(3, [0.06, 0.03])
        session.set_goal(GOAL, adapter="proportional,gain=0.5", carry_over=True)
        expected = trial.condition - [0.03, 0.015]
        np.testing.assert_allclose(session.ask().condition, expected)


def test_closed_it_says_so_and_is_never_copied(workspace):
    session = workspace.session()
    for copied in (copy.deepcopy, pickle.dumps):
        for each in (workspace, session):
            with pytest.raises(WorkspaceError, match=r"not copied; open it again: Workspace\('"):
                copied(each)
    assert repr(workspace).endswith("planar': goal 1, trial 0)")
    workspace.close()
    for ask_it in (lambda: workspace.state, lambda: session.solved, session.ask):
        with pytest.raises(WorkspaceError, match="planar is closed; open it again"):
            ask_it()
    assert "is closed" in repr(workspace)


def test_it_is_made_as_new_makes_it(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = {"robot": "ur5e", "gripper": "percent", "dt": 0.01, "tolerance": [0.02, 0.03]}
    Workspace.create("hoop", name="one", **given).close()
    said = (
        "--robot",
        "ur5e",
        "--gripper",
        "percent",
        "--dt",
        "0.01",
        "--tolerance",
        "0.02",
        "0.03",
    )
    assert run("new", "other", "--name", "one", *said)[0] == 0
    assert Path("hoop/workspace.toml").read_text() == Path("other/workspace.toml").read_text()
    with pytest.raises(ConfigurationError, match="--gripper adds a column"):
        Workspace.create("third", robot="none", gripper="percent")


@pytest.mark.slow
@pytest.mark.parametrize("names", [None, ["joint1", "joint2"], ["joint2", "joint1"]])
def test_an_arm_may_be_known_by_its_first_recordings(tmp_path, names):
    recordings(tmp_path / "throws")
    with Workspace.create(tmp_path / "hoop", robot="none", dt=0.02) as workspace:
        options = {} if names is None else {"joints": names}
        result = workspace.import_recordings(tmp_path / "throws", **options)
        expected = tuple(names or ("joint1", "joint2"))
        assert workspace.manifest.format.names == expected == result.demonstrations.format.names
        assert workspace.manifest.format.units == ("rad",) * len(expected)
        workspace.learn("interpolation")
        workspace.set_goal([0.9, 0.0])
        trial = workspace.session().ask()
        assert workspace.plan(trial).format.names == expected
    with Workspace(tmp_path / "hoop") as workspace:
        assert workspace.session().ask().plan.shape[1] == len(expected)


def test_columns_are_written_into_a_section_however_its_head_is_spaced(tmp_path):
    text = NewWorkspace(robot="none").manifest("hoop")
    for head in ("[plan]", "[ plan ]", "  [plan]"):
        told = with_columns(text.replace("[plan]", head), ("one",), ("deg",))
        form = parse_manifest(told, tmp_path / "workspace.toml").format
        assert (form.names, form.units) == (("one",), ("deg",))
    inline = 'plan = { names = ["?"], units = ["rad"], dt = 0.02 }'
    with pytest.raises(FileFormatError, match=r'no line \[plan\]; .*names = \["one"\]'):
        with_columns(inline, ("one",), ("deg",))


@pytest.mark.slow
def test_recordings_are_taken_in_as_the_command_does(tmp_path, run, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recordings(tmp_path / "throws")
    how = {"robot": "none", "action_names": ["joint1", "joint2"], "dt": 0.02}
    for name in ("one", "other"):
        Workspace.create(name, **how).close()
    with Workspace("one") as workspace:
        result = workspace.import_recordings("throws")
        assert result._repr_html_().startswith("<pre>episodes    4 from throws (npz)")
        assert repr(result) == "ImportResult(4 of throws (npz))"
        with pytest.raises(InvalidDemonstrationsError, match=r"twice|identical|same"):
            workspace.import_recordings("throws", append=True)
        python = [e.event for e in workspace.events]
    assert run("import", "other", "throws")[0] == 0
    with Workspace("other") as workspace:
        assert [e.event for e in workspace.events] == python


@pytest.mark.slow
def test_where_it_stands_reports_and_exports(workspace, tmp_path):
    trial = ask(workspace)
    status = workspace.status()
    assert repr(status) == status.text
    assert status._repr_html_().startswith("<pre>task")
    assert (status.solved, status.open_trial.number, status.goals[0].told) == (False, 1, 0)
    assert workspace.export(1, tmp_path / "plan.csv").path.is_file()
    with pytest.raises(TrialStateError):
        workspace.export(2, tmp_path / "none.csv")
    tell(workspace, trial.number, "hit")
    assert workspace.report() == workspace.folder / "report" / "report.html"


def told_three_times(workspace):
    workspace.set_goal(GOAL)
    for number in (1, 2, 3):
        ask(workspace)
        tell(workspace, number, [0.03 / number, -0.02])
    return ask(workspace)


@pytest.mark.slow
def test_an_adapter_goes_on_from_what_it_knew_when_the_program_starts_again(workspace, monkeypatch):
    told_three_times(workspace)
    tell(workspace, 4, [0.02, 0.01])
    observed, observe = [], BayesianAdapter._observe_reading
    monkeypatch.setattr(
        BayesianAdapter,
        "_observe_reading",
        lambda self, *told: observed.append(1) or observe(self, *told),
    )
    again = reopened(workspace)
    asked = ask(again)
    assert len(observed) == 1
    void(again, 5, "")
    again.store.path("adapter.npz").unlink()
    afresh = ask(reopened(again))
    assert len(observed) == 5
    np.testing.assert_array_equal(asked.condition, afresh.condition)


@pytest.mark.slow
@pytest.mark.parametrize("damaged", [False, True])
def test_what_an_adapter_knew_of_other_readings_is_not_taken(workspace, damaged):
    told_three_times(workspace)
    void(workspace, 4, "")
    if damaged:
        workspace.store.path("adapter.npz").write_bytes(b"PK")
    else:
        amend(workspace, 2, [-0.05, 0.04])
    kept = ask(reopened(workspace)).condition
    workspace.store.path("adapter.npz").unlink()
    again = reopened(workspace)
    void(again, 5, "")
    np.testing.assert_array_equal(kept, ask(again).condition)
