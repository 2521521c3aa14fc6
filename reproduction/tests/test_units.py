"""The same files whatever the number of workers; runs that are killed are in `killed_runs`."""

import json
from pathlib import Path

import pytest
from quick_units import Ends, Roots, real_units, results

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.generators import GENERATORS
from prior_reinforce.registry import PLUGINS, Member
from reproduction.evaluation import Training, Trials, ZeroShot
from reproduction.recipes.base import Run
from reproduction.recipes.displacement import Displacement
from reproduction.recipes.process import Process
from reproduction.units import UnitFailedError, Workers, commit, result_path, run_units


def silent(done, total, label):
    pass


@pytest.mark.slow
def test_any_number_of_workers_gives_the_same_files_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setenv(PLUGINS, "quick_units")  # for the workers
    units = [*real_units(), *map(Roots, range(4))]
    for count in (1, 2):
        run_units(units, tmp_path / str(count), Workers(count), silent)
    one = results(tmp_path / "1")
    assert len(one) == len(units) + 9  # three models of three files each
    assert results(tmp_path / "2") == one


def test_a_model_of_which_nobody_says_what_made_it_is_learned_anew(tmp_path):
    training = Training("basketball-v1", "A", "nearest", 0)
    training.learned(tmp_path)
    (left,) = tmp_path.glob("models/*/generator/config.json")
    left.write_text("{}")
    run_units([training], tmp_path, Workers(), silent)
    learned = training.learned(tmp_path)
    assert (
        learned.generator.generate(learned.prior.outcomes_seen).shape == learned.prior.plans.shape
    )


def test_what_is_done_is_not_run_again(tmp_path):
    units = [Roots(seed) for seed in range(3)]
    first = run_units(units[:2], tmp_path, Workers(), silent)
    result_path(tmp_path, units[0]).write_text(json.dumps({"kept": True}))
    calls = []
    again = run_units(units, tmp_path, Workers(), lambda *call: calls.append(call))
    assert again[:2] == [{"kept": True}, first[1]]
    assert calls == [(2, 3, "found on disk"), (3, 3, "roots 2")]


def test_what_other_code_made_is_kept_and_named(tmp_path):
    units = [Roots(seed) for seed in range(2)]
    kept, _ = run_units(units, tmp_path, Workers(), silent)
    assert kept["commit"] == commit()
    result_path(tmp_path, units[0]).write_text(json.dumps({**kept, "commit": "of May"}))
    rows = Run(tmp_path).rows([(unit, {"method": "roots"}) for unit in units])
    assert rows[0] == {"method": "roots", **kept["result"], "commit": "of May"}
    assert [row["commit"] for row in rows] == ["of May", commit()]


def test_a_failing_unit_is_named_and_the_others_stay(tmp_path):
    units = [Ends("raise"), Roots(0), Ends("give nothing"), Roots(1)]
    with pytest.raises(UnitFailedError) as caught:
        run_units(units, tmp_path, Workers(), silent)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("'one that raises' failed: ArithmeticError: 0 is no divisor, and 1")
    assert "2 of 4 results are kept" in message
    assert [result_path(tmp_path, unit).is_file() for unit in units] == [False, True, False, True]
    told = Path(message.partition("what happened: ")[2].rstrip(")")).read_text()
    assert "second line" in told
    assert "quick_units.py" in told


@pytest.fixture
def edited(tmp_path, monkeypatch):
    """Edits the file that two members of one's own stand in."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(ADAPTERS.members, "mine", Member("edited:Mine", "an adapter"))
    monkeypatch.setitem(GENERATORS.members, "my-plans", Member("edited:Plans", "a generator"))
    (tmp_path / "edited.py").write_text("")
    return lambda: (tmp_path / "edited.py").write_text("# another\n")


def test_an_edited_class_of_ones_own_is_run_anew(tmp_path, edited):
    training = Training("basketball-v1", "A", "nearest", seed=0)
    unit = Trials(training, training.task, "mine,gain=2", "exact", goals=1)
    before, learned = result_path(tmp_path, unit), result_path(tmp_path, training)
    edited()
    assert result_path(tmp_path, unit) != before
    assert result_path(tmp_path, training) == learned


def test_what_was_learned_by_an_edited_class_is_thrown_anew(tmp_path, edited):
    training = Training("basketball-v1", "A", "my-plans", seed=0)
    units = [training, ZeroShot(training), Displacement(training), Process(training)]
    before = [result_path(tmp_path, unit) for unit in units]
    edited()
    assert all(
        result_path(tmp_path, unit) != path for unit, path in zip(units, before, strict=True)
    )


def test_without_git_a_result_says_so(monkeypatch):
    monkeypatch.setenv("PATH", "")
    commit.cache_clear()
    try:
        assert commit() == "not a checkout"
    finally:
        commit.cache_clear()


@pytest.mark.slow
def test_a_worker_that_is_killed_is_told_in_a_line(tmp_path):
    with pytest.raises(UnitFailedError, match=r"a worker process was killed.* fewer --workers"):
        run_units([Ends("die"), Roots(0)], tmp_path, Workers(2), silent)


def test_a_mended_unit_leaves_no_failure_behind(tmp_path):
    unit = Roots(0)
    failure = tmp_path / "failures" / f"{result_path(tmp_path, unit).stem}.txt"
    failure.parent.mkdir()
    failure.write_text("of yesterday")
    run_units([unit], tmp_path, Workers(), silent)
    assert not failure.exists()
