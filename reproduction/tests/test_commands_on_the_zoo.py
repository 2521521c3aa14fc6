"""The package's commands on the zoo's tasks: without pictures, in other units."""

import pytest

from prior_reinforce.cli import main


@pytest.mark.parametrize(
    ("task", "said"),
    [("zoo-slide", "cm ahead"), ("zoo-arrival", "arrival"), ("zoo-gripper", "cm up")],
)
def test_a_task_without_pictures_is_adapted_and_says_so_in_a_line(tmp_path, capsys, task, said):
    chosen = ["--task", task, "--demonstrations", "clean-5-1", "--generator", "interpolation"]
    assert main(["adapt", *chosen, "--perception", "exact", "--out", str(tmp_path)]) in (0, 1)
    told = capsys.readouterr().out
    assert f"no film: {task} has no pictures" in told
    assert said in told
    assert f"no film: {task} has no pictures" in (tmp_path / "report.html").read_text()


def test_a_set_that_the_task_does_not_have_is_named_with_those_it_has(capsys):
    assert main(["adapt", "--task", "zoo-lob"]) == 2
    assert "no demonstration set 'A'; write KIND-COUNT-SEED" in capsys.readouterr().err
