"""Where a workspace stands, in words."""

from prior_reinforce.workspace.status import describe
from tests.workspace.planar import ask, tell


def test_status_is_short_and_says_what_is_next(workspace):
    assert "prior-reinforce ask" in describe(workspace)
    tell(workspace, ask(workspace).number, [0.05, 0.0])
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    text = describe(workspace)
    assert "5 cm long" in text
    assert "reached in 2 trials (N = 4 demonstrations + 2 = 6)" in text
    assert len(text.splitlines()) <= 12


def test_a_first_trial_that_hits_is_one_trial(workspace):
    tell(workspace, ask(workspace).number, [0.0, 0.0])
    assert "reached in 1 trial (N = 4 demonstrations + 1 = 5)" in describe(workspace)
