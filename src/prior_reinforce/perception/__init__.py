"""P: ways of seeing a trial's error. One file each; all share the interface of `base`."""

from prior_reinforce.perception.amplified import Amplified
from prior_reinforce.perception.base import Perception
from prior_reinforce.perception.exact import Exact
from prior_reinforce.perception.eye import Eye

__all__ = ["Amplified", "Exact", "Eye", "Perception"]
