"""Names of methods, and the family that one's own belongs to."""

import pytest

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.experiments.methods import family_of, make_generator


@pytest.mark.parametrize(("name", "segmented"), [("dmp", True), ("dmp-whole", False)])
def test_both_kinds_of_dmp_have_a_name(name, segmented):
    assert make_generator(name).config.segmented is segmented


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("prior_reinforce.generators:SmoothInterpolation", "generator"),
        ("prior_reinforce.adapters.frozen:FrozenAdapter", "adapter"),
    ],
)
def test_a_class_tells_its_family(name, family):
    assert family_of(name) == family


@pytest.mark.parametrize(
    "name",
    [
        "prior_reinforce.perception.exact:Exact",
        "interpolation",
        "nowhere:Thing",
        "json:JSONDecoder",
    ],
)
def test_what_is_neither_generator_nor_adapter_is_refused(name):
    with pytest.raises(ConfigurationError):
        family_of(name)
