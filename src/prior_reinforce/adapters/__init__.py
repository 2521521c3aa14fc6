"""M: condition adapters. One file each; all share the interface of `base`."""

from prior_reinforce.adapters.base import Adapter
from prior_reinforce.adapters.frozen import FrozenAdapter
from prior_reinforce.adapters.gaussian_process import GaussianProcessAdapter, GaussianProcessConfig
from prior_reinforce.adapters.proportional import ProportionalAdapter

__all__ = [
    "Adapter",
    "FrozenAdapter",
    "GaussianProcessAdapter",
    "GaussianProcessConfig",
    "ProportionalAdapter",
]
