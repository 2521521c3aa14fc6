"""Pages: everything is escaped, nothing missing is passed over, files go in whole."""

import base64

import jinja2
import pytest

from prior_reinforce.report.html import data_uri, render


def test_what_is_filled_in_is_escaped(tmp_path):
    said = render("base.html", title="<b>5 & 6</b>")
    assert "<title>&lt;b&gt;5 &amp; 6&lt;/b&gt;</title>" in said
    assert ":root {" in said  # the style is ours and goes in as it is


def test_what_is_not_given_is_an_error():
    with pytest.raises(jinja2.UndefinedError, match="title"):
        render("base.html")


def test_files_are_carried_whole(tmp_path):
    path = tmp_path / "a.PNG"
    path.write_bytes(bytes(range(256)))
    kind, _, content = data_uri(path).partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(content) == bytes(range(256))
