"""Pages that stand outside docs/, and links that work in the repository and on the site.

Every link in a Markdown file is written relative to that file, so that it works where the file is
read in the repository. On the site README.md is the first page, and the others have pages of their
own; a link to any other file of the repository leads to where its source is published.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

REPOSITORY = Path(__file__).parents[1]
PAGES = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "results/evidence.md": "results.md",
    "results/beyond.md": "beyond.md",
}
"""Files outside docs/ by their page on the site."""
PICTURES = "results/pictures"
EVIDENCE = "reproduction/docs"
"""Folder whose pages and pictures stand on the site as if they stood in docs/."""
PAGES |= {f"{EVIDENCE}/{path.name}": path.name for path in (REPOSITORY / EVIDENCE).glob("*.md")}
LINK = re.compile(
    r'(?P<before>\]\(|src=")(?P<target>[^)\s"#]+)(?P<anchor>#[^)\s"]*)?(?P<after>[)"])'
)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and pictures that stand outside docs/."""
    for source, page in PAGES.items():
        files.append(File.generated(config, page, abs_src_path=str(REPOSITORY / source)))
    for picture in sorted((REPOSITORY / PICTURES).iterdir()):
        place = f"pictures/{picture.name}"
        files.append(File.generated(config, place, abs_src_path=str(picture)))
    for picture in sorted((REPOSITORY / EVIDENCE).rglob("*.png")):
        place = picture.relative_to(REPOSITORY / EVIDENCE).as_posix()
        files.append(File.generated(config, place, abs_src_path=str(picture)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links at the site's pages, or at the source of what has none."""
    source = next((s for s, p in PAGES.items() if p == page.file.src_uri), None)
    if page.file.src_uri == "index.md":
        page.meta["hide"] = ["navigation"]
    folder = posixpath.dirname(source or f"docs/{page.file.src_uri}")

    def on_site(link: re.Match[str]) -> str:
        target, anchor = link["target"], link["anchor"] or ""
        if ":" in target:
            return link[0]
        place = posixpath.normpath(posixpath.join(folder, target))
        if not (REPOSITORY / place).exists():
            raise PluginError(
                f"{source or page.file.src_uri} links to {target}, which is not there"
            )
        return f"{link['before']}{_address(place, page, config)}{anchor}{link['after']}"

    return LINK.sub(on_site, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point a notebook's links at pages, which is done for Markdown only."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html

    def on_site(link: re.Match[str]) -> str:
        file = files.get_file_from_path(link[1])
        if file is None:
            raise PluginError(f"{page.file.src_uri} links to {link[1]}, which is not there")
        return f'href="{file.url_relative_to(page.file)}"'

    return re.sub(r'href="([\w/.-]+\.md)"', on_site, html)


def _address(place: str, page: Page, config: MkDocsConfig) -> str:
    """What a link to a file of the repository is on the site."""
    if place in PAGES:
        on_site = PAGES[place]
    elif place.startswith(f"{PICTURES}/"):
        on_site = place.removeprefix("results/")
    elif place.startswith(f"{EVIDENCE}/"):
        on_site = place.removeprefix(f"{EVIDENCE}/")
    elif place.startswith("docs/"):
        on_site = place.removeprefix("docs/")
    else:
        kind = "tree" if (REPOSITORY / place).is_dir() else "blob"
        return f"{config.repo_url}/{kind}/main/{place}"
    return posixpath.relpath(on_site, posixpath.dirname(page.file.src_uri) or ".")
