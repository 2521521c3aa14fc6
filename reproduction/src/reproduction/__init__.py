"""The paper's tables and figures, made again; with what they need beside the package.

Importing this lets the package choose by name what stands here: the paper's baselines and
`diffusion-ways` as generators, two rivals as adapters, the zoo's tasks.
"""

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.generators.members import GENERATORS, TIMED
from prior_reinforce.perception import PERCEPTIONS
from prior_reinforce.registry import Member
from prior_reinforce.simulation.tasks import TASKS
from reproduction import zoo

_GENERATORS, _ADAPTERS = f"{__name__}.generators", f"{__name__}.adapters"

for _name, _member in {
    "diffusion-ways": Member(
        f"{_GENERATORS}.ways:DiffusionWays",
        "a network for demonstrations of several ways",
        TIMED,
    ),
    "regression": Member(
        f"{_GENERATORS}.regression:UNetRegression", "a network like the paper's, supervised", TIMED
    ),
    "dmp": Member(f"{_GENERATORS}.dmp:DynamicMovementPrimitives", "dynamic movement primitives"),
    "nearest": Member(f"{_GENERATORS}.nearest:NearestNeighbours", "nearest demonstrations, mixed"),
}.items():
    GENERATORS.add(_name, _member)
for _name, _member in {
    "offset": Member(
        f"{_ADAPTERS}.offset:MeanOffsetAdapter", "the mean of what all trials were off by"
    ),
    "broyden": Member(f"{_ADAPTERS}.broyden:BroydenAdapter", "secants along the steps made"),
}.items():
    ADAPTERS.add(_name, _member)
# By the names that the raw rows have them under.
for _name in ("affine:RidgeAdapter", "rivals:BayesianOptimisationAdapter", "rivals:CmaEsAdapter",
              "rivals:NewtonAdapter", "rivals:NormOptimalAdapter"):  # fmt: skip
    ADAPTERS.add(f"{__name__}.{_name}", Member(f"{__name__}.{_name}", "a rival"))
for _name in ("BiasedModel", "ErringEye", "MisreadingEye", "ScatteredModel"):
    _target = f"{__name__}.observers:{_name}"
    PERCEPTIONS.add(_target, Member(_target, "a noisy observer"))
for _name, _member in zoo.MEMBERS.items():
    TASKS.add(_name, _member)
