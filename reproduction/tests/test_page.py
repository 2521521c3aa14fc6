"""The page of evidence extends the package's."""

from prior_reinforce.report.html import render
from reproduction.recipes.tables import Table


def test_another_packages_page_extends_ours():
    page = render(
        "evidence.html",
        package="reproduction",
        title="Evidence",
        counts={"ours": {"open": 1}},
        claims=Table(("the paper says", "verdict"), (("a claim", "open"),)),
        observations=Table(("quantity",), ()),
        sections=[],
        missing=[],
        unbroken=str,
        source=str,
    )
    assert page.startswith("<!DOCTYPE html>")
    assert "<h1>Evidence</h1>" in page
