"""Basketball Shot on a Franka Research 3: V1's spoon, ball and hoop, and the FR3's stiffer servo.

Its demonstrations stay within half of what the FR3's interface allows (10 rad/s^2), so that plans
between them can be streamed as joint positions. Its kinematics are the Panda's, which the FR3
shares; so, here, are its masses, of which a servo this stiff lets nothing be seen.
"""

from __future__ import annotations

import numpy as np

from prior_reinforce.simulation.tasks.basketball import BasketballShot
from prior_reinforce.simulation.tasks.panda_task import Disturbances

_STIFFNESS = np.array([4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0])
"""Of each joint's servo, in [Nm/rad]: the position actuators of MuJoCo Menagerie's FR3 (fr3v2), as
franka-sim 1.1.7 quotes them; libfranka's examples set 3000 to 2000."""
_DAMPING = _STIFFNESS / 10
"""In [Nm s/rad], from the same place."""


class BasketballFR3(BasketballShot):
    """Basketball Shot V1 on an FR3."""

    name = "basketball-fr3"
    recordings = "basketball_fr3"

    def __init__(self, disturbances: Disturbances | None = None) -> None:
        """Compile the scene; argument as in `PandaTask`."""
        super().__init__(disturbances)
        self.model.actuator_gainprm[:, 0] = _STIFFNESS
        self.model.actuator_biasprm[:, 1] = -_STIFFNESS
        self.model.actuator_biasprm[:, 2] = -_DAMPING
