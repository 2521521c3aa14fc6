"""Wrapper that takes out of plans what a symmetry does, and puts it back after learning.

    learn     demonstrations --move to one place--> canonical plans over what is left of z
    generate  aim --chart--> z --base--> canonical plan --move by w = z - z_base--> plan

What a generator has to learn is one dimension less for each exact component (*canonicalisation*;
`plans.symmetry`), and nothing at all where no component is left or one demonstration is all there
is: that demonstration is moved. Beyond the demonstrated hull of what is left, plans are moved from
its edge; components that are `Learned` the generator extrapolates instead. Without a symmetry the
wrapped generator learns as it is, unless demonstrations show a turn and it is to be found.

Ours; the idea is that of canonical and frame-averaging policies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float
from typing_extensions import Self

from prior_reinforce.arrays import Frames, Plans, Point, Points
from prior_reinforce.errors import InvalidDemonstrationsError
from prior_reinforce.formats import OutcomeFormat
from prior_reinforce.generators.base import Generator, OnProgress, Wrapper, at_once
from prior_reinforce.generators.saving import SavedLayer, Tensors
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Anchors, Symmetry, TurnJoint
from prior_reinforce.plans.symmetry.found import find_turn


class Equivariant(Wrapper):
    """A generator of canonical plans, which the demonstrations' symmetry moves to the aim.

    Plans may differ in length, since slower ones are longer: one that is asked for alone is not
    padded; in a batch, shorter ones rest at their last frame.
    """

    name: ClassVar[str] = "equivariant"
    _anchors: Anchors | None = None
    """None before `fit`, and without a symmetry."""
    _plans: Plans
    _outcomes: Points
    _noise: Points
    _home: Point
    """Exact components to which plans are brought, the others 0, shape (k,)."""

    def __init__(self, generator: Generator, *, finds: bool = False) -> None:
        """Wrap a generator of canonical plans; see `Wrapper`.

        With `finds`, a turn is looked for where no symmetry is declared (`plans.symmetry.found`).
        """
        super().__init__(generator)
        self._finds = finds

    def with_symmetry_used(self, demonstrations: Demonstrations) -> Demonstrations:
        """Return them with theirs, or that which was found; see `Generator.with_symmetry_used`."""
        if self._anchors is None or demonstrations.symmetry is not None:
            return demonstrations
        return demonstrations.with_symmetry(self._anchors.symmetry)

    def check_demonstrations(self, demonstrations: Demonstrations) -> None:
        """Refuse too few to tell what a turn leaves; see `Generator.check_demonstrations`."""
        symmetry = demonstrations.symmetry
        if symmetry is None:
            self.generator.check_demonstrations(demonstrations)
        elif np.any(symmetry.learned):
            anchors = Anchors(symmetry, demonstrations.outcomes_seen, demonstrations.outcome_noise)
            if not anchors.mixed:
                raise InvalidDemonstrationsError(
                    f"{demonstrations.n} demonstrations do not tell what a turn leaves: give more "
                    f"than {len(anchors.left)} that differ in it, or leave the symmetry out"
                )

    def _fit(self, demonstrations: Demonstrations, seed: int, progress: OnProgress) -> None:
        declared = demonstrations.symmetry
        symmetry = declared or (find_turn(demonstrations) if self._finds else None)
        if symmetry is None:
            self._anchors = None
            self.generator.fit(demonstrations, seed=seed, progress=progress)
            return
        outcomes, noise = demonstrations.outcomes_seen, demonstrations.outcome_noise
        anchors = self._keep(symmetry, demonstrations.plans, outcomes, noise)
        if anchors.mixed:
            learned = self._canonical(demonstrations, anchors)
            self.generator.fit(learned, seed=seed, progress=progress)
            how = "demonstrations are brought to one place, mixed there, and moved to the goal"
        else:
            at_once(progress, loss=0.0)
            how = "the nearest demonstration is moved to the goal"
            how = how if demonstrations.n > 1 else "the demonstration is moved to the goal"
        said = f"symmetry: {symmetry.name}; {how}"
        self.remarks = (said if declared else _say_found(symmetry, demonstrations.format.names),)

    def _keep(self, symmetry: Symmetry, plans: Plans, outcomes: Points, noise: Points) -> Anchors:
        anchors = Anchors(symmetry, outcomes, noise)
        self._anchors, self._plans, self._outcomes, self._noise = anchors, plans, outcomes, noise
        self._home = np.where(symmetry.exact, anchors.z.mean(axis=0), 0.0)
        return anchors

    def _canonical(self, demonstrations: Demonstrations, anchors: Anchors) -> Demonstrations:
        """Plans at home, with what is left of their outcomes."""
        symmetry, left, z = anchors.symmetry, anchors.left, anchors.z
        to_home = np.where(symmetry.exact, self._home - z, 0.0)
        move, shown = symmetry.endless.move, demonstrations.plans
        plans = [move(*each) for each in zip(shown, to_home, strict=True)]
        plans = [symmetry.toward(plan, plans[0]) for plan in plans]
        into = np.linalg.inv(symmetry.chart.jacobian(z))
        correction = np.einsum("nij,nj->ni", into, demonstrations.outcome_correction)
        names = demonstrations.outcome_format.names
        units = symmetry.chart.units(demonstrations.outcome_format.units)
        return Demonstrations(
            np.stack(plans),
            z[:, left],
            demonstrations.format,
            OutcomeFormat(tuple(names[j] for j in left), tuple(units[j] for j in left)),
            anchors.sd[:, left],
            correction[:, left],
        )

    def _generate(self, conditions: Points) -> Plans:
        if self._anchors is None:
            return self.generator.generate(conditions)
        symmetry, anchors = self._anchors.symmetry, self._anchors
        aims = symmetry.chart.to(conditions)
        base, weights = anchors.base(aims)
        if not len(aims):
            return self._plans[:0]
        if anchors.mixed:
            plans = self.generator.generate(base[:, anchors.left])
            at = np.where(symmetry.exact, self._home, base)
            return self._rested([self._to(*each) for each in zip(plans, aims, at, strict=True)])
        return self._rested([self._picked(*each) for each in zip(aims, weights, strict=True)])

    def _picked(self, aim: Point, weights: Float[np.ndarray, " N"]) -> Float[np.ndarray, "_ D"]:
        """The demonstrations that count, each moved to the aim, and mixed."""
        assert self._anchors is not None
        count = np.flatnonzero(weights)
        moved = [self._to(self._plans[i], aim, self._anchors.z[i]) for i in count]
        moved = [self._anchors.symmetry.toward(plan, moved[0]) for plan in moved]
        return (
            moved[0]
            if len(count) == 1
            else np.tensordot(weights[count], self._rested(moved), axes=1)
        )

    def _to(self, plan: Frames, aim: Point, at: Point) -> Float[np.ndarray, "_ D"]:
        """A plan that belongs to `at`, moved to the aim.

        What is farther than believed stays there: a tempo of 0.01 would be no plan.
        """
        assert self._anchors is not None
        symmetry = self._anchors.symmetry
        farthest = np.where(symmetry.exact, np.inf, symmetry.farthest)
        return symmetry.move(plan, np.clip(aim - at, -farthest, farthest))

    def _rested(self, plans: Sequence[Float[np.ndarray, "_ D"]]) -> Plans:
        assert self._anchors is not None
        return rested(plans, self._anchors.symmetry.increments)

    def pack(self) -> list[SavedLayer]:
        """Return what was learned; see `Generator.pack`. A demonstration that is moved is all."""
        alone = self._anchors is not None and not self._anchors.mixed
        return Generator.pack(self) if alone else super().pack()

    def state(self) -> tuple[dict[str, Any], Tensors]:
        """The symmetry and the demonstrations; see `Generator.state`."""
        if self._anchors is None:
            return {"symmetry": None}, {}
        return {"symmetry": self._anchors.symmetry.data()}, {
            "plans": self._plans,
            "outcomes": self._outcomes,
            "noise": self._noise,
        }

    @classmethod
    def from_state(
        cls, settings: Mapping[str, Any], tensors: Tensors, generator: Generator | None = None
    ) -> Self:
        """Rebuild it; where demonstrations are moved as they are, nothing else was learned."""
        from prior_reinforce.generators.auto import Auto

        made = cls(generator or Auto())
        if settings["symmetry"] is None:
            return made
        symmetry = Symmetry.from_data(settings["symmetry"])
        anchors = made._keep(symmetry, *(tensors[each] for each in ("plans", "outcomes", "noise")))
        if anchors.mixed == (generator is None):
            raise ValueError("the canonical plans' generator does not fit the demonstrations")
        return made


def _say_found(symmetry: Symmetry, names: Sequence[str]) -> str:
    """Say what demonstrations show to be turned by the bearing, and how to leave it so."""
    turn = symmetry.moves[1]
    what, axis = "dx and dy turn", "origin"
    if isinstance(turn, TurnJoint):
        what, axis = f"{names[turn.joint]} turns", "base"
    return (
        f"symmetry: {what} with the outcome's bearing, so a turn about the {axis} is taken out, "
        "and the rest learned (not so: generator auto,symmetry=none)"
    )


def rested(plans: Sequence[Float[np.ndarray, "_ D"]], increments: Sequence[int] = ()) -> Plans:
    """Stack plans (H_i, D) of different lengths: shorter ones rest at their last frame.

    `increments` are columns of differences from frame to frame, which are 0 at rest.
    """
    longest = max(map(len, plans))
    padded = []
    for plan in plans:
        rest = np.repeat(plan[-1:], longest - len(plan), axis=0)
        rest[:, list(increments)] = 0.0
        padded.append(np.vstack([plan, rest]))
    return np.stack(padded)
