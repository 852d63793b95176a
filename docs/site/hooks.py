"""The pages that are generated: stages, variants and settings from the classes, experiments from their results.

mkdocs loads this file and calls its functions by their names. Pages that lie elsewhere in the repository (README,
CONTRIBUTING, …) are taken as they are.
"""

import posixpath
import re
from pathlib import Path
from typing import Any

from experiment_pages import experiment_pages, with_results
from mkdocs.structure.files import File, Files
from setting_pages import settings_page
from stage_pages import role_pages
from variant_pages import variants_page

ROOT = Path(__file__).parents[2]
TAKEN = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "runs/README.md": "runs.md",
    "examples/README.md": "examples.md",
}
"""Pages from elsewhere in the repository, and where they stand on the site."""
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s#]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add what is generated, and what lies elsewhere."""
    pages: dict[str, str | bytes] = (
        {"reference/settings.md": settings_page()} | variants_page() | role_pages() | experiment_pages()
    )
    pages |= {page: _at_home(ROOT / origin, page) for origin, page in TAKEN.items()}
    for page, content in pages.items():
        files.append(File.generated(config, page, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links of pages in docs/ that lead out of it lead to where it stands on the site."""
    origin = page.file.src_uri
    markdown = with_results(markdown, origin)
    return markdown if origin in TAKEN.values() else _linked(markdown, f"docs/{origin}", origin)


def _at_home(file: Path, page: str) -> str:
    return _linked(file.read_text(encoding="utf-8"), file.relative_to(ROOT).as_posix(), page)


def _linked(text: str, origin: str, page: str) -> str:
    """A page's text with links that lead from `page` to where each target stands; code of the repository is named."""

    def target(match: re.Match[str]) -> str:
        image, words, link, anchor = match.groups()
        if "://" in link:
            return match[0]
        path = posixpath.normpath(posixpath.join(posixpath.dirname(origin), link))
        place = TAKEN.get(path) or (path.removeprefix("docs/") if path.startswith("docs/") else None)
        if place is None:
            return words if words.startswith("`") else f"{words} (`{path}`)"
        return f"{image}[{words}]({posixpath.relpath(place, posixpath.dirname(page) or '.')}{anchor or ''})"

    return LINK.sub(target, text)
