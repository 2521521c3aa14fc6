"""Wrapper that makes a generator equivariant: it learns canonical plans, and moves them to the aim.

    learn     demonstrations --move to one place--> canonical plans over the inexact part of z
    generate  aim --chart--> z --base--> canonical plan --move by w = z - z_base--> plan

Each exact component is one dimension less to learn (*canonicalisation*; `plans.symmetry`). Nothing
is learned if all components are exact, or from a single demonstration, which is moved. Beyond the
demonstrated hull of the inexact components, plans are moved from its edge; the generator
extrapolates those that are `Learned`. Without a symmetry the wrapped generator learns the plans
themselves, unless a turn is to be found and demonstrations show one.

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
from prior_reinforce.generators.base import Generator, OnProgress, Wrapper, report_single_step
from prior_reinforce.generators.saving import SavedLayer, Tensors
from prior_reinforce.plans.motions import Demonstrations
from prior_reinforce.plans.symmetry import Anchors, Symmetry, TurnJoint
from prior_reinforce.plans.symmetry.found import find_turn


class Equivariant(Wrapper):
    """A generator of canonical plans, which the demonstrations' symmetry moves to the aim.

    Plans may differ in length, since slower ones are longer: a single one is not padded; in a
    batch, shorter ones rest at their last frame.
    """

    name: ClassVar[str] = "equivariant"
    _anchors: Anchors | None = None
    """None before `fit`, and without a symmetry."""
    _plans: Plans
    _outcomes: Points
    _noise: Points
    _canonical: Point
    """Exact components z of canonical plans, the others 0, shape (k,)."""

    def __init__(self, generator: Generator, *, finds: bool = False) -> None:
        """Wrap a generator of canonical plans; see `Wrapper`.

        With `finds`, a turn is searched for if no symmetry is declared (`plans.symmetry.found`).
        """
        super().__init__(generator)
        self._finds = finds

    def with_symmetry_used(self, demonstrations: Demonstrations) -> Demonstrations:
        """Return them with the declared or found one; see `Generator.with_symmetry_used`."""
        if self._anchors is None or demonstrations.symmetry is not None:
            return demonstrations
        return demonstrations.with_symmetry(self._anchors.symmetry)

    def check_demonstrations(self, demonstrations: Demonstrations) -> None:
        """Refuse too few to learn the inexact components; see `Generator.check_demonstrations`."""
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
            canonical = self._canonicalised(demonstrations, anchors)
            self.generator.fit(canonical, seed=seed, progress=progress)
            how = "demonstrations are brought to one place, mixed there, and moved to the goal"
        else:
            report_single_step(progress, loss=0.0)
            how = f"the {'nearest ' * (demonstrations.n > 1)}demonstration is moved to the goal"
        remark = f"symmetry: {symmetry.name}; {how}"
        self.remarks = (remark if declared else _say_found(symmetry, demonstrations.format.names),)

    def _keep(self, symmetry: Symmetry, plans: Plans, outcomes: Points, noise: Points) -> Anchors:
        anchors = Anchors(symmetry, outcomes, noise)
        self._anchors, self._plans, self._outcomes, self._noise = anchors, plans, outcomes, noise
        self._canonical = np.where(symmetry.exact, anchors.z.mean(axis=0), 0.0)
        return anchors

    def _canonicalised(self, demonstrations: Demonstrations, anchors: Anchors) -> Demonstrations:
        """Return canonical plans, with the inexact components of their outcomes."""
        symmetry, left, z = anchors.symmetry, anchors.left, anchors.z
        w = np.where(symmetry.exact, self._canonical - z, 0.0)
        move = symmetry.endless.move
        plans = [move(*each) for each in zip(demonstrations.plans, w, strict=True)]
        plans = [symmetry.toward(plan, plans[0]) for plan in plans]
        dz_dr = np.linalg.inv(symmetry.chart.jacobian(z))
        correction = np.einsum("nij,nj->ni", dz_dr, demonstrations.outcome_correction)
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
            z = np.where(symmetry.exact, self._canonical, base)
            moved = [self._moved(*each) for each in zip(plans, z, aims, strict=True)]
        else:
            moved = [self._picked(*each) for each in zip(aims, weights, strict=True)]
        return padded(moved, symmetry.increments)

    def _picked(self, aim: Point, weights: Float[np.ndarray, " N"]) -> Float[np.ndarray, "_ D"]:
        """Move the demonstrations that have a weight to the aim, and mix them."""
        assert self._anchors is not None
        symmetry, used = self._anchors.symmetry, np.flatnonzero(weights)
        moved = [self._moved(self._plans[i], self._anchors.z[i], aim) for i in used]
        moved = [symmetry.toward(plan, moved[0]) for plan in moved]
        if len(used) == 1:
            return moved[0]
        return np.tensordot(weights[used], padded(moved, symmetry.increments), axes=1)

    def _moved(self, plan: Frames, z: Point, aim: Point) -> Float[np.ndarray, "_ D"]:
        """Move a plan with the outcome z to the aim, or as far as the symmetry is trusted.

        A tempo of 0.01 would be no plan.
        """
        assert self._anchors is not None
        symmetry = self._anchors.symmetry
        farthest = np.where(symmetry.exact, np.inf, symmetry.farthest)
        return symmetry.move(plan, np.clip(aim - z, -farthest, farthest))

    def pack(self) -> list[SavedLayer]:
        """Return the layers; see `Generator.pack`. The wrapped generator has one if it learned."""
        picked = self._anchors is not None and not self._anchors.mixed
        return Generator.pack(self) if picked else super().pack()

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
        """Rebuild it; if demonstrations themselves are moved, no generator is wrapped."""
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
    """Say what turns with the bearing, and how to switch that off."""
    turn = symmetry.moves[1]
    what, axis = "dx and dy turn", "origin"
    if isinstance(turn, TurnJoint):
        what, axis = f"{names[turn.joint]} turns", "base"
    return (
        f"symmetry: {what} with the outcome's bearing, so a turn about the {axis} is taken out, "
        "and the rest learned (not so: generator auto,symmetry=none)"
    )


def padded(plans: Sequence[Float[np.ndarray, "_ D"]], increments: Sequence[int] = ()) -> Plans:
    """Stack plans (H_i, D) of different lengths: shorter ones rest at their last frame.

    `increments` are columns of differences from frame to frame, which are 0 at rest.
    """
    longest = max(map(len, plans))
    stacked = []
    for plan in plans:
        rest = np.repeat(plan[-1:], longest - len(plan), axis=0)
        rest[:, list(increments)] = 0.0
        stacked.append(np.vstack([plan, rest]))
    return np.stack(stacked)
