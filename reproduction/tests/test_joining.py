"""A method of one's own joins the comparisons."""

import pytest

from prior_reinforce.adapters import ADAPTERS
from prior_reinforce.generators import GENERATORS
from prior_reinforce.registry import Member
from reproduction.recipes import RECIPES, Run, Scale, adapters
from tests.test_extending import FILES

FEW = Scale(goals=2, seeds=(0,), sets=("A",), rounds=1)


@pytest.fixture
def added(tmp_path_factory, monkeypatch):
    """The guide's adapter and generator, as members."""
    folder = tmp_path_factory.mktemp("guide")
    for name, code in FILES.items():
        (folder / name).write_text(code)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setitem(ADAPTERS.members, "drift", Member("drift:Drift", "follows an offset"))
    monkeypatch.setitem(GENERATORS.members, "affine", Member("affine:Affine", "least squares"))


@pytest.mark.slow
def test_an_adapter_joins_the_comparison_of_adapters(added, tmp_path):
    choices = ("drift", "drift,gain=0.5")
    assert RECIPES["adapters"].joining(("affine", *choices)) == choices
    planned = adapters.units(FEW, choices, generator="nearest")
    planned = [
        (unit, names) for unit, names in planned if unit.adapter in ("gp-two-term", *choices)
    ]
    rows = Run(tmp_path).rows(planned)
    assert {row["adapter"] for row in rows} == {"gp-two-term", *choices}


@pytest.mark.slow
def test_a_generator_joins_the_comparison_of_generators(added, tmp_path):
    choices = ("affine", "affine,timing=align")
    assert RECIPES["generators"].joining(("drift", *choices)) == choices
    planned = [p for p in RECIPES["generators"].units(FEW, choices) if p[1]["method"] in choices]
    rows = Run(tmp_path).rows(planned)
    assert list(dict.fromkeys(row["generator"] for row in rows)) == list(choices)
