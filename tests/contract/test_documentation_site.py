"""The documentation site builds, and every link and picture on it leads somewhere."""

import os
import re
from pathlib import Path
from unittest.mock import patch
from urllib.parse import unquote, urldefrag

import pytest
from mkdocs.commands.build import build
from mkdocs.config import load_config

from omninav.pipeline.graph.registry import entries

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"""(?:href|src)="([^"]+)\"""")
ELSEWHERE = re.compile(r"^(https?:|data:|mailto:|javascript:|//)")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Builds it in this process, which has composed many of the configurations that its pages describe.

    Its plots are drawn, but their pixels are not: `tests/pipeline/experiment/test_plots.py` looks at some.
    """
    built, environment = tmp_path_factory.mktemp("site"), {"NO_MKDOCS_2_WARNING": "1", "OMNINAV_EXECUTE": "false"}
    with patch.dict(os.environ, environment), patch("matplotlib.figure.Figure.savefig"):
        build(load_config(str(ROOT / "mkdocs.yml"), strict=True, site_dir=str(built)))
    return built


def test_every_link_and_picture_leads_somewhere(site: Path) -> None:
    pages = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html") if page.name != "404.html"}
    anchors = {page: set(re.findall(r"""\b(?:id|name)="([^"]+)\"""", text)) for page, text in pages.items()}
    links, missing = 0, set()
    for page, text in pages.items():
        for link in LINK.findall(text):
            if ELSEWHERE.match(link):
                continue
            links += 1
            path, anchor = urldefrag(link)
            target = (page.parent / unquote(path)).resolve() if path else page
            if not target.exists() or (anchor and target in anchors and unquote(anchor) not in anchors[target]):
                missing.add(f"{page.relative_to(site)}: {link}")
    assert links > 1000
    assert not missing


def test_a_page_fetches_nothing_from_a_network(site: Path) -> None:
    fetched = re.compile(
        r"""<(?:script|img|iframe)[^>]*src="(?:https?:)?//|<link[^>]*rel="stylesheet"[^>]*href="https?:"""
    )
    assert not [page.name for page in site.rglob("*.html") if fetched.search(page.read_text(encoding="utf-8"))]


def test_every_stage_has_its_place(site: Path) -> None:
    listed = (site / "stages/index.html").read_text(encoding="utf-8")
    names = [entry.name for entry in entries() if entry.origin == "built in"]
    assert len(names) > 100
    assert not [name for name in names if f"{name.partition('.')[0]}.html#{name.replace('.', '-')}" not in listed]
