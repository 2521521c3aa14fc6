"""Basketball Shot V3: V2 with a smaller, lighter ball and a smaller cup in place of the hoop.

Thrown with V1's demonstrations and the outcomes they had on V1, unchanged (paper, Section V-A).
The scene is in `basketball_v3.xml`.
"""

from __future__ import annotations

from typing import ClassVar

from prior_reinforce.tasks.basketball import BasketballShot


class BasketballShotV3(BasketballShot):
    """Basketball Shot V3 (paper, hardware figure), in MuJoCo."""

    name: ClassVar[str] = "basketball-v3"
    scene: ClassVar[str] = "basketball_v3"
    tolerance: ClassVar[float] = 0.0125  # clean pass: (7.5 cm - 5.0 cm) / 2
