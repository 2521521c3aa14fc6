"""What a workspace's session loads, and which trials it neither gives out again nor lets tell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from prior_reinforce.adapters import DEFAULT_ADAPTER, make_adapter
from prior_reinforce.arm.workspace.state import Standing
from prior_reinforce.arm.workspace.store import Store
from prior_reinforce.arm.workspace.text import execute_step
from prior_reinforce.errors import TrialStateError, WorkspaceError
from prior_reinforce.session.trials import Trial

if TYPE_CHECKING:
    from prior_reinforce.adapters.base import Adapter
    from prior_reinforce.generators.base import Generator


def model_in_use(now: Standing, store: Store) -> Generator:
    """Load the model in use.

    Raises:
        WorkspaceError: There is none, or it was learned from other demonstrations than those in
            use.
    """
    imported, training = now.imported, now.state.training
    if training is None or training.demonstrations_sha256 != imported.sha256:
        why = "other demonstrations were imported since the model was learned"
        why = why if training is not None else "nothing is learned yet"
        raise WorkspaceError(f"{why}; run: prior-reinforce learn {now.folder}")
    return store.model(training.model)


def adapter_of_goal(now: Standing) -> Adapter:
    """Make the adapter that the goal was set with."""
    goal = now.state.goal
    return make_adapter(goal.adapter if goal is not None and goal.adapter else DEFAULT_ADAPTER)


def check_open(now: Standing, trial: Trial, verb: Literal["ask", "tell"]) -> None:
    """Refuse to give out a trial that is executing, or to take an outcome of none.

    Raises:
        TrialStateError: With what comes next.
    """
    number = trial.number
    stage, cut_off = now.state.stage(trial), now.state.cut_off.get(number)
    if verb == "ask" and stage == "executing":
        if now.moving:
            raise TrialStateError(f"trial {number} is executing now; wait for it")
        raise TrialStateError(
            f"trial {number} was executing when the program stopped; did the arm move? If it "
            f"did, tell or void trial {number}; if it did not, ask again with "
            "--arm-did-not-move"
        )
    if verb == "tell" and stage == "asked" and (cut_off or now.manifest.driven_by):
        why = "the manifest's [arm] has not moved for it"
        if cut_off:
            why = f"its {cut_off} was not made to its end"
        raise TrialStateError(
            f"trial {number} was not executed, {why}: run {execute_step(now, trial)}, or void "
            "it; drop [arm] from the manifest if something else drives the arm"
        )
