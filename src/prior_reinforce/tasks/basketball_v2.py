"""Basketball Shot V2: V1 with a shorter spoon, thrown with V1's demonstrations.

The demonstrations and the outcomes they had on V1 are used unchanged (paper, Section V-A): they
promise more than this spoon gives, and adaptation has to find out by how much. The scene is in
`basketball_v2.xml`.
"""

from __future__ import annotations

from typing import ClassVar

from prior_reinforce.tasks.basketball import BasketballShot


class BasketballShotV2(BasketballShot):
    """Basketball Shot V2 (paper, hardware figure), in MuJoCo."""

    name: ClassVar[str] = "basketball-v2"
    scene: ClassVar[str] = "basketball_v2"
