"""M: condition adapters. One file each; all share the interface of `base`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from prior_reinforce.registry import Member, Registry

if TYPE_CHECKING:
    from prior_reinforce.adapters.base import Adapter

_GP = "prior_reinforce.adapters.gaussian_process:GaussianProcessAdapter"
_ONE_TERM = {"trial_jitter": 1e-3, "demonstration_jitter_bounds": (1e-3, 1e-3)}

ADAPTERS: Registry[Adapter] = Registry(
    "adapter",
    "prior_reinforce.adapters.base:Adapter",
    {
        "bayes": Member(
            "prior_reinforce.adapters.bayesian:BayesianAdapter",
            "readings as intervals, up to 64 trials remembered, P(hit) known",
        ),
        "gp": Member(_GP, "the paper's Gaussian process, m = 2 trials remembered", _ONE_TERM),
        "gp-all": Member(
            _GP, "the same, every trial remembered", {**_ONE_TERM, "memory_size": None}
        ),
        "gp-two-term": Member(_GP, "ours: demonstrations less certain than trials, m = 2"),
        "gp-two-term-all": Member(_GP, "the same, every trial remembered", {"memory_size": None}),
        "proportional": Member(
            "prior_reinforce.adapters.proportional:ProportionalAdapter",
            "a fixed share of the last error",
        ),
        "frozen": Member(
            "prior_reinforce.adapters.frozen:FrozenAdapter", "no adaptation: the goal itself"
        ),
    },
)

DEFAULT_ADAPTER = "bayes"
"""Default of workspaces and of `adapt`: as good on the first goal, and better on later ones
(reproduction/docs/decisions-adapter.md)."""

make_adapter = ADAPTERS.make
