"""A small workspace: planar throws, two joints, no robot limits."""

import numpy as np

from prior_reinforce.plans.motions import Demonstrations, PlanFormat
from prior_reinforce.workspace.manifest import TEMPLATE

FORMAT = PlanFormat(("joint1", "joint2"), ("rad", "rad"), 0.02)


def demonstrations():
    outcomes = np.array([[0.8, -0.2], [0.8, 0.2], [1.0, -0.2], [1.0, 0.2]])
    phase = np.linspace(0.0, 1.0, 24)
    swing = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    plans = outcomes[:, None, :] * swing[None, :, None]
    return Demonstrations(plans, outcomes, FORMAT)


def manifest(**changes):
    given = {
        "name": "planar",
        "names": '["joint1", "joint2"]',
        "units": '["rad", "rad"]',
        "dt": 0.02,
        "outcome_names": '["x", "y"]',
        "outcome_units": '["m", "m"]',
        "tolerance": 0.015,
        "robot": "none",
    }
    return TEMPLATE.format(**(given | changes))
