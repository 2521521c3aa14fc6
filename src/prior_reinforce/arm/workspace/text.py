"""A workspace in words for a person: what became of a trial, and the command that comes next."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Literal

from prior_reinforce.arm.executing.lock import programs_executing
from prior_reinforce.arm.workspace.events import Moved, Moving
from prior_reinforce.arm.workspace.folder import RECORDINGS
from prior_reinforce.arm.workspace.manifest import Manifest, workspace_around
from prior_reinforce.arm.workspace.state import Standing, WorkspaceState
from prior_reinforce.errors import TrialStateError
from prior_reinforce.session.trials import SessionState, Trial, told_trials
from prior_reinforce.terminal import plain
from prior_reinforce.wording import error_example, say_chance, say_reading, say_trials

_POOR_TRIALS = 3
_POOR_CHANCE = 0.35
"""Probability of a hit below which another trial like the last ones is no good plan (ours): words
by eye leave a chance of a half where all else is known."""
_OUTDATED = (
    "planned before your correction; if it was not thrown yet, void it and ask for a new plan"
)
"""What to do about a trial whose plan knows nothing of what was amended or voided since."""


def say_trial(now: Standing, trial: Trial) -> str:
    """Say what became of a trial, in a line."""
    return plain(_say_trial(now, trial))


def _say_trial(now: Standing, trial: Trial) -> str:
    if trial.reading is not None:
        warning = execution_warning(now, trial)
        return say_told(now, trial) + (f"; executed, {warning}" if warning else "")
    match now.state.stage(trial):
        case "voided":
            return f"void: {trial.note}" if trial.note else "void"
        case "executing" if now.moving:
            return "is executing now"
        case "executing":
            began = now.state.executions[trial.number]
            if isinstance(began, Moving) and began.folder and not began.by:
                return (
                    f"its plan was executed, as executions/{began.folder} shows, of which the "
                    "journal, restored from a copy, knows nothing: was that this trial, did the "
                    "arm move?"
                )
            return "was executing when the program stopped: did the arm move?"
        case "executed":
            return f"executed, {execution_warning(now, trial) or 'waits to be told'}"
    waits = "asked for, waits to be executed and told"
    if cut_off := now.state.cut_off.get(trial.number):
        if now.moving:
            return f"the arm makes its {cut_off.motion} now"
        waits = f"its {cut_off.motion} was not made to its end; it waits to be executed and told"
    return f"{waits}; {_OUTDATED}" if trial.outdated else waits


def say_told(now: Standing, trial: Trial) -> str:
    """Say what was told of a trial."""
    assert trial.reading is not None
    seen = say_reading(trial.reading, now.manifest.outcome_format)
    seen = f"reached ({seen})" if trial.hit else seen
    return plain(f"{seen}, {trial.surprise}" if trial.surprise else seen)


def say_expectation(now: Standing, trial: Trial) -> list[str]:
    """Say what the adapter expected of a trial, and after poor ones what would help."""
    state, expected = now.state, trial.expected
    if expected.p_hit is None:
        return []
    lines = [f"a hit is {say_chance(expected.p_hit)}"]
    if expected.trials is not None:
        lines[0] += f"; {say_trials(expected.trials)} trials to go"
    if expected.remark:
        lines.append(expected.remark)
    told = told_trials(state.trials)
    shown, moved = state.demonstrations, now.manifest.symmetry
    if not told and shown is not None and shown.n == 1 and moved and expected.sd is not None:
        form = now.manifest.outcome_format
        sd = ", ".join(
            f"{name} +- {100 * value:.0f} cm" if unit == "m" else f"{name} +- {value:.2g} {unit}"
            for name, value, unit in zip(form.names, expected.sd, form.units, strict=True)
        )
        lines.append(f"this trial teaches how {moved.distance} changes the distance; expect {sd}")
    if told and told[-1].surprise:
        lines.append(f"trial {told[-1].number} was {told[-1].surprise}")
    missed = sum(known.goal_number == trial.goal_number for known in told)
    poor = expected.p_hit < _POOR_CHANCE and not expected.beyond
    if missed >= _POOR_TRIALS and not state.solved and poor:
        lines.append(
            "what would help: a demonstration near this goal, or a finer look at the next trial "
            '("5.2 +- 0.3 cm long")'
        )
    return lines


def say_outdated(state: SessionState) -> list[str]:
    """Say so where the trial that waits was planned before a correction."""
    trial = state.open_trial
    return [f"trial {trial.number} was {_OUTDATED}"] if trial and trial.outdated else []


def say_left_out(state: WorkspaceState) -> list[str]:
    """Say how many trials would teach for the goal of now, had this model planned them."""
    goal, model = state.goal, state.in_use[0]
    trials = state.trials if goal is not None and goal.carry_over else state.current
    n = sum(trial.model != model for trial in told_trials(trials))
    planned = "a trial of another model teaches" if n == 1 else f"{n} trials of other models teach"
    return [f"{planned} this one nothing"] if n else []


def say_warning(now: Standing, trial: Trial) -> str:
    """What the last motion of an open trial came to; why a reading of a trial might mislead."""
    latest = now.state.moves.get(trial.number) if trial.open else None
    if isinstance(latest, Moving) and latest.motion != "trial" and not now.moving:
        return "its result was not recorded"
    if isinstance(latest, Moved) and latest.outcome == "not_moved":
        return plain(f"nothing moved: {latest.reason}") if latest.reason else "nothing moved"
    if isinstance(latest, Moved) and latest.motion != "trial":
        begun = "" if latest.outcome == "done" else "the arm only began to move: "
        return begun and plain(begun + latest.reason)
    return execution_warning(now, trial)


def execution_warning(now: Standing, trial: Trial) -> str:
    """Why a reading of a trial might mislead: it was aborted, or went another way than planned."""
    ended, gate = now.state.executions.get(trial.number), now.manifest.gate
    if not isinstance(ended, Moved) or ended.outcome == "not_moved":
        return ""
    warnings = []
    if ended.outcome == "aborted":
        warnings.append(f"aborted: {ended.reason or 'no reason was given'}")
    elif ended.reason:
        warnings.append(f"its driver says: {ended.reason}")
    for which, distances, says in (
        (0, ended.start_error, "began {} from the plan's first frame, more than {:g}"),
        (1, ended.tracking_rms, "went {} rms off the plan, more than {:g}"),
    ):
        for unit, distance in distances.items():
            allowed = gate.errors_of(unit)
            if allowed is not None and distance > allowed[which]:
                warnings.append(says.format(f"{distance:.3g} {unit}", allowed[which]))
    return plain(f"but {'; '.join(warnings)}") if warnings else ""


def call(folder: Path, command: str, *words: object) -> str:
    """A command as it is typed here: within the workspace, it need not be named."""
    here = workspace_around(Path())
    is_here = here is not None and here.resolve() == folder.resolve()
    named = () if is_here else (shlex.quote(str(folder)),)
    return " ".join(map(str, ("prior-reinforce", command, *named, *words)))


def next_step(now: Standing) -> str:
    """The command that comes next; see `Standing.step`. While the arm moves, wait for it before."""
    step = _next_step(now)
    if now.state.moves and now.moving:
        running = [f"pid {pid}: {name:.80}" for pid, name in programs_executing(now.folder)]
        by = plain("".join(f" ({each})" for each in running[:1]))
        return f"the arm's program still runs{by}; wait for its end, then: {step}"
    return step


def _next_step(now: Standing) -> str:
    state, trial, folder = now.state, now.state.open_trial, now.folder
    if trial is None:
        match now.step:
            case "import":
                return call(folder, "import", _recorded(folder))
            case "learn":
                learn, shown = call(folder, "learn"), state.demonstrations
                if now.manifest.symmetry is None and shown is not None and shown.n == 1:
                    return (
                        f"import more, or say in {folder / 'workspace.toml'} under [symmetry] how "
                        f"this one may be moved (docs/symmetry.md); then: {learn}"
                    )
                return learn
            case "goal":
                return goal_step(now)
            case "reached":
                return f"{goal_step(now)}, or {call(folder, 'report')}"
        return call(folder, "ask")
    tell = call(folder, "tell", trial.number, tell_example(now.manifest))
    match now.step:
        case "settle":
            did_not_move = call(folder, "ask", "--arm-did-not-move")
            if state.stage(trial) == "executing":
                moved = tell
            else:
                moved = call(folder, "void", trial.number, "--reason WHY")
            return f"if it moved: {moved}; if not: {did_not_move}"
        case "execute" if now.manifest.driven_by or trial.number in state.executions:
            return execute_step(now, trial)
    return f"{tell} (or --hit)"


def _recorded(folder: Path) -> str:
    """Folder of the newest takes of `record`, or a placeholder if there are none."""
    numbered = [path for path in (folder / RECORDINGS).glob("*") if path.name.isdecimal()]
    kept = [path for path in numbered if any(path.glob("*.npz"))]
    newest = max(kept, key=lambda path: int(path.name), default=None)
    return "RECORDINGS" if newest is None else shlex.quote(str(newest))


def goal_step(now: Standing) -> str:
    """The command that sets a goal."""
    return call(now.folder, "goal", *map(_placeholder, now.manifest.outcome_format.names))


def execute_step(now: Standing, trial: Trial) -> str:
    """The command that executes a trial that waits: after a motion that was cut off, slowly."""
    arm = now.manifest.driven_by
    if arm is None:
        return call(now.folder, "ask", '--run "COMMAND {plan}"')
    flags = ["--execute"]
    cut_off, last = now.state.cut_off.get(trial.number), now.state.moves.get(trial.number)
    if cut_off or (isinstance(last, Moved) and last.motion == "rehearsal"):
        flags.append("--approach")  # the arm may stand anywhere, or at the plan's end
    if cut_off and cut_off.motion == "rehearsal":
        flags.append(f"--rehearse {cut_off.speed:g}")
    return call(now.folder, "ask", *flags)


def check_open(now: Standing, trial: Trial, verb: Literal["ask", "tell"]) -> None:
    """Refuse to give out a trial that is executing, or to take an outcome of none.

    TrialStateError says what comes next.
    """
    number, stage, cut_off = trial.number, now.state.stage(trial), now.state.cut_off
    if verb == "ask" and stage == "executing":
        if now.moving:
            raise TrialStateError(f"trial {number} is executing now; wait for it")
        raise TrialStateError(
            f"trial {number} was executing when the program stopped; did the arm move? If it "
            f"did, tell or void trial {number}; if it did not, ask again with "
            "--arm-did-not-move"
        )
    if verb == "tell" and stage == "asked" and (number in cut_off or now.manifest.driven_by):
        why = "the manifest's [arm] has not moved for it"
        if number in cut_off:
            why = f"its {cut_off[number].motion} was not made to its end"
        raise TrialStateError(
            f"trial {number} was not executed, {why}: run {execute_step(now, trial)}, or void "
            "it; drop [arm] from the manifest if something else drives the arm"
        )


def tell_example(manifest: Manifest) -> str:
    """How an error of this task can be told."""
    form = manifest.outcome_format
    if example := error_example(form):  # without numbers, which somebody in a hurry would take
        return '--error "' + re.sub(r"\b[0-9]+", "_", example) + '"'
    return "--error " + " ".join(f"D{_placeholder(name)}" for name in form.names)


def _placeholder(name: str) -> str:
    """What stands in a command for a number, in one word: `LANDING_SPOT`."""
    return re.sub(r"\W+", "_", name.strip()).upper()
