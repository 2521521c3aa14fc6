"""Rendering of self-contained pages: no request leaves the reader's machine."""

from __future__ import annotations

import base64
from importlib import resources
from pathlib import Path

_PACKAGE = "prior_reinforce.report"
MIME_TYPES = {
    ".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".svg": "image/svg+xml",
    ".mp4": "video/mp4",
}  # fmt: skip
"""What a page shows, by suffix."""


def render(template: str, *, package: str = _PACKAGE, **context: object) -> str:
    """Render a template with everything escaped; it may extend this package's `base.html`."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name, ".") for name in (package, _PACKAGE)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    css = resources.files(_PACKAGE).joinpath("style.css").read_text(encoding="utf-8")
    return environment.get_template(template).render(style=Markup(css), **context)


def data_uri(path: Path) -> str:
    """Return a picture or an mp4 as a `data:` address that carries the whole file."""
    encoded = base64.b64encode(path.read_bytes()).decode("ascii")
    return f"data:{MIME_TYPES[path.suffix.lower()]};base64,{encoded}"
