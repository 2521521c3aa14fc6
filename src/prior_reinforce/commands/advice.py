"""What the adapter of a workspace knows of the whole region, and where to learn more."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from prior_reinforce.arm.workspace.reaching import reach_picture, region_of
from prior_reinforce.arm.workspace.view import AdviceView
from prior_reinforce.arm.workspace.workspace import Workspace
from prior_reinforce.arrays import Point, Points
from prior_reinforce.commands.base import Json, OnWorkspace, print_json, print_next
from prior_reinforce.errors import ConfigurationError
from prior_reinforce.generators.reach import Reach, region_around
from prior_reinforce.wording import say_chance, say_place

_ACROSS = 15
"""Goals along each side of the region (ours): 25 took four to five times as long, to tell places
two centimetres apart."""
_MOST_GOALS = 1000
"""Goals in all: more than two components have fewer along a side."""
_DEMONSTRATED_EVERY = 4
"""Every fourth of these goals is tried as a demonstration, at 10 ms each."""
_MARGIN = 0.1
"""How far beyond the demonstrated outcomes is looked, as a share of their range (ours)."""


@dataclass(frozen=True)
class Advise(OnWorkspace):
    """Say where first throws would hit, and where one more throw or demonstration teaches most.

    For a goal that was set with the adapter bayes; before any goal, what motions can reach.

    For example:
        prior-reinforce advise hoop --out advice.png
    """

    out: Path | None = None
    """Picture, a .png; if not given, advice.png in the workspace, or before any goal one that the
    report shows."""
    json: Json = False

    def _run_on(self, workspace: Workspace, words: tuple[str, ...]) -> None:
        out = self.out or workspace.folder / "advice.png"
        if out.suffix != ".png":
            raise ConfigurationError(f"--out must name a .png file, got {out}")
        if workspace.state.goal is None and not self.json:
            self._before_a_goal(workspace)
            return
        session = workspace.session()
        adapter = session.informed_adapter()
        p_hit, gain = getattr(adapter, "p_hit", None), getattr(adapter, "gain", None)
        if p_hit is None or gain is None:
            raise ConfigurationError(
                f"the adapter {session.goals[-1].adapter} knows no probabilities; set the "
                "goal with --adapter bayes"
            )
        demonstrations = session.generator.with_symmetry_used(session.demonstrations)
        outcomes, moved = demonstrations.outcomes_seen, demonstrations.symmetry is not None
        declared = session.demonstrations.symmetry is not None  # goals may lie farther off
        low, high = region_around(demonstrations) if declared else _around(outcomes)
        goals = _grid(low, high)
        conditions = np.array([adapter.propose(goal) for goal in goals])
        p = p_hit(conditions, goals, session.tolerance)
        reached = None
        if moved:  # what is learned of a move serves everywhere: no throw teaches most
            reached = region_of(workspace)
            throws, shown = np.zeros(len(goals)), np.zeros(1)
        else:
            throws = gain(conditions, conditions)
            tried = np.arange(0, len(goals), _DEMONSTRATED_EVERY)
            shown = gain(goals[tried], conditions, demonstrations=True)
        form = workspace.manifest.outcome_format
        best, worst = np.argmax(p), np.argmin(p)
        throw = None if moved else goals[np.argmax(throws)]
        demonstration = goals[tried[np.argmax(shown)]] if shown.max() > 0 else None
        picture = None
        if goals.shape[1] == 2:
            from prior_reinforce.report.advice import draw_advice

            picture = draw_advice(
                out,
                form,
                outcomes,
                reached,
                goals=goals,
                p_hit=p,
                goal=session.goal,
                throw=throw,
                demonstration=demonstration,
            )
        if self.json:
            record = AdviceView(
                mean_p_hit=float(p.mean()),
                best=goals[best].tolist(),
                best_p_hit=float(p[best]),
                worst=goals[worst].tolist(),
                worst_p_hit=float(p[worst]),
                throw=None if throw is None else throw.tolist(),
                throw_teaches=float(throws.max()),
                reached=None if reached is None else float(reached.reached.mean()),
                demonstration=None if demonstration is None else demonstration.tolist(),
                demonstration_teaches=float(shown.max()),
                picture=None if picture is None else str(picture),
            )
            print_json(record)
            return
        if far := session.demonstrations.say_far_outside(session.goal):
            print(far)
        print(
            "in the region around what was shown "
            f"a first throw's hit is likeliest at {say_place(goals[best], form)} "
            f"({say_chance(p[best])}), least likely at {say_place(goals[worst], form)} "
            f"({say_chance(p[worst])})"
        )
        if reached is not None:
            print(_say_reached(reached))
        if throw is not None:
            print(
                f"the throw that teaches most: {say_place(throw, form)} ({throws.max():.0%} of "
                f"what is unknown; half of all places teach less than {np.median(throws):.0%})"
            )
        if demonstration is not None:
            place = f"{say_place(demonstration, form)} ({shown.max():.0%} of what is unknown)"
            print(f"the demonstration that teaches most: one that ends at {place}")
        elif not moved:
            print("one more demonstration here would teach nothing that trials do not")
        if picture is not None:
            print(f"picture: {picture}")

    def _before_a_goal(self, workspace: Workspace) -> None:
        """Say and draw what can be reached, as the report then shows it."""
        region, form = region_of(workspace), workspace.manifest.outcome_format
        if region is None:
            raise ConfigurationError(
                "no goal is set, and without a symmetry and a robot there is no reach to draw: set "
                "a goal first"
            )
        print(_say_reached(region))
        if region.goals.shape[-1] == 2:
            from prior_reinforce.report.advice import draw_advice

            assert workspace.state.training is not None
            out = self.out or reach_picture(workspace.folder, workspace.state.training.model)
            shown = workspace.demonstrations.outcomes_seen
            print(f"picture: {draw_advice(out, form, shown, region)}")
        print_next(workspace)


def _say_reached(region: Reach) -> str:
    share = f"{region.reached.mean():.0%} of the goals to which motions may be moved"
    return f"{share} are within the arm's limits"


def _around(outcomes: Points) -> tuple[Point, Point]:
    """Corners of the demonstrated outcomes and a little beyond."""
    low, high = outcomes.min(axis=0), outcomes.max(axis=0)
    margin = _MARGIN * (high - low)
    return low - margin, high + margin


def _grid(low: Point, high: Point) -> Float[np.ndarray, "m k"]:
    """Goals between two corners, the last component fastest."""
    k = len(low)
    across = min(_ACROSS, int(_MOST_GOALS ** (1 / k)))
    axes = [np.linspace(a, b, across) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, k)
