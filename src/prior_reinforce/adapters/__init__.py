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

from prior_reinforce.registry import Member, Registry

_GP = "prior_reinforce.adapters.gaussian_process:GaussianProcessAdapter"
ADAPTERS = Registry(
    "adapter",
    "prior_reinforce.adapters.base:Adapter",
    {
        "gp": Member(_GP, "m = 2"),
        "proportional": Member("prior_reinforce.adapters.proportional:ProportionalAdapter", "p"),
        "frozen": Member("prior_reinforce.adapters.frozen:FrozenAdapter", "f"),
    },
)
make_adapter = ADAPTERS.make
