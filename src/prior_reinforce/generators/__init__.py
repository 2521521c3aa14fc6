"""pi: conditional motion generators. All share the interface of `base`, and any can be `Timed`."""

from prior_reinforce.generators.auto import Auto as Auto
from prior_reinforce.generators.base import FitProgress as FitProgress
from prior_reinforce.generators.base import Generator as Generator
from prior_reinforce.generators.config import DiffusionConfig as DiffusionConfig
from prior_reinforce.generators.config import UNetRegressionConfig as UNetRegressionConfig
from prior_reinforce.generators.config import UNetSize as UNetSize
from prior_reinforce.generators.corrected import Corrected as Corrected
from prior_reinforce.generators.diffusion import DiffusionGenerator as DiffusionGenerator
from prior_reinforce.generators.dmp import DynamicMovementPrimitives as DynamicMovementPrimitives
from prior_reinforce.generators.interpolation import NearestNeighbours as NearestNeighbours
from prior_reinforce.generators.interpolation import SmoothInterpolation as SmoothInterpolation
from prior_reinforce.generators.members import GENERATORS as GENERATORS
from prior_reinforce.generators.members import load_generator as load_generator
from prior_reinforce.generators.members import make_generator as make_generator
from prior_reinforce.generators.regression import UNetRegression as UNetRegression
from prior_reinforce.generators.timed import Timed as Timed
