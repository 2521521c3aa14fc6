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
        "gp": Member(_GP, "Gaussian process, m = 2 trials remembered"),
        "gp-all": Member(_GP, "every trial remembered", {"memory_size": None}),
        "gp-one-term": Member(_GP, "one fixed diagonal term, as in the paper", _ONE_TERM),
        "gp-one-term-all": Member(
            _GP, "the same, every trial remembered", {**_ONE_TERM, "memory_size": None}
        ),
        "proportional": Member(
            "prior_reinforce.adapters.proportional:ProportionalAdapter",
            "a fixed share of the last error",
        ),
        "offset": Member(
            "prior_reinforce.adapters.offset:MeanOffsetAdapter",
            "the mean of what all trials were off by",
        ),
        "broyden": Member(
            "prior_reinforce.adapters.broyden:BroydenAdapter", "secants along the steps made"
        ),
        "frozen": Member(
            "prior_reinforce.adapters.frozen:FrozenAdapter", "no adaptation: the goal itself"
        ),
    },
)

DEFAULT_ADAPTER = "bayes"
"""Of a workspace's goals, and of `adapt`: as good on one goal, and better on the next ones
(docs/decisions-adapter.md)."""

make_adapter = ADAPTERS.make
