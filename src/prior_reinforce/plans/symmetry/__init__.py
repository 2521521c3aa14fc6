"""Symmetries of motions: what may be done to a whole plan, and what that does to its outcome.

The field's terms: plans and outcomes are acted on by the same group, SO(2) (turns about a vertical
axis) or SE(2) (shifts and turns on a table), and a generator that respects it is *equivariant*;
bringing demonstrations to one place of the group before anything is learned is *canonicalisation*.
Playing a motion faster is *temporal scaling* (dynamic movement primitives), and learning from
trials what such a scaling does to the outcome is *task-level learning* (Aboaf, Atkeson and
Reinkensmeyer, 1988). Temporal scaling is no symmetry: its law is unknown, and is learned.
"""

from prior_reinforce.plans.symmetry.anchors import Anchors as Anchors
from prior_reinforce.plans.symmetry.axis import Axis as Axis
from prior_reinforce.plans.symmetry.axis import find_axis as find_axis
from prior_reinforce.plans.symmetry.axis import hand_paths as hand_paths
from prior_reinforce.plans.symmetry.charts import Cartesian as Cartesian
from prior_reinforce.plans.symmetry.charts import Chart as Chart
from prior_reinforce.plans.symmetry.charts import LogDistance as LogDistance
from prior_reinforce.plans.symmetry.charts import Polar as Polar
from prior_reinforce.plans.symmetry.declared import declare_symmetry as declare_symmetry
from prior_reinforce.plans.symmetry.moves import Amplitude as Amplitude
from prior_reinforce.plans.symmetry.moves import Delay as Delay
from prior_reinforce.plans.symmetry.moves import Learned as Learned
from prior_reinforce.plans.symmetry.moves import Move as Move
from prior_reinforce.plans.symmetry.moves import Shift as Shift
from prior_reinforce.plans.symmetry.moves import Tempo as Tempo
from prior_reinforce.plans.symmetry.moves import TurnIncrements as TurnIncrements
from prior_reinforce.plans.symmetry.moves import TurnJoint as TurnJoint
from prior_reinforce.plans.symmetry.moves import TurnPath as TurnPath
from prior_reinforce.plans.symmetry.moves import TurnPoses as TurnPoses
from prior_reinforce.plans.symmetry.symmetry import EXTRAPOLATED as EXTRAPOLATED
from prior_reinforce.plans.symmetry.symmetry import Symmetry as Symmetry
from prior_reinforce.plans.symmetry.symmetry import scale_alone as scale_alone
from prior_reinforce.plans.symmetry.symmetry import shift as shift
from prior_reinforce.plans.symmetry.symmetry import turn_and_scale as turn_and_scale
