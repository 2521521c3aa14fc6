"""Hit a goal a robot arm has never hit, in about ten real trials (Prior Reinforce)."""

from importlib.metadata import version

from prior_reinforce.adapters import (
    Adapter,
    FrozenAdapter,
    GaussianProcessAdapter,
    ProportionalAdapter,
)
from prior_reinforce.errors import PriorReinforceError
from prior_reinforce.generators import (
    DiffusionConfig,
    DiffusionGenerator,
    Generator,
    load_generator,
)
from prior_reinforce.perception import Amplified, Exact, Eye, Perception
from prior_reinforce.plans.motions import Demonstrations, Plan, PlanFormat
from prior_reinforce.rollouts import KeyFrame, Rollout
from prior_reinforce.session import Session
from prior_reinforce.trials import Event, Goal, Stage, Trial
from prior_reinforce.tasks import Task, make_task

__version__ = version("prior-reinforce")

__all__ = [
    "Adapter",
    "Amplified",
    "Demonstrations",
    "DiffusionConfig",
    "DiffusionGenerator",
    "Exact",
    "Eye",
    "FrozenAdapter",
    "GaussianProcessAdapter",
    "Generator",
    "KeyFrame",
    "Perception",
    "Plan",
    "PlanFormat",
    "PriorReinforceError",
    "ProportionalAdapter",
    "Rollout",
    "Session",
    "Task",
    "Trial",
    "Stage",
    "load_generator",
    "make_task",
]
