"""Every metric that a run prints is explained in docs/glossary.md."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

from omninav.pipeline.report.metrics import STATISTICS, humanise, title

ROOT = Path(__file__).resolve().parents[2]
HEAD = "## Metrics of a run"
HOLE = "…"


def explained() -> set[str]:
    """The first column of the glossary's tables of metrics; a number that a parameter sets stands there as `…`."""
    _, _, section = (ROOT / "docs/glossary.md").read_text().partition(HEAD)
    rows = [line.split("|")[1].strip() for line in section.splitlines() if line.startswith("| ")]
    return {label for row in rows for label in row.split("; ")}


def text_of(node: ast.expr) -> str:
    """A text as it is written, with `…` for what it takes from elsewhere."""
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else HOLE for part in node.values)
    return node.value if isinstance(node, ast.Constant) else HOLE


def described() -> Iterator[tuple[str, dict[str, ast.expr]]]:
    """Path or name of every entry of the metrics that a stage describes, and how."""
    for file in sorted((ROOT / "stages").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            pairs = (
                zip(node.keys, node.values, strict=True)
                if isinstance(node, ast.Dict)
                else [(node.key, node.value)]
                if isinstance(node, ast.DictComp)
                else []
            )
            for key, value in pairs:
                if key is not None and isinstance(value, ast.Call) and getattr(value.func, "id", "") == "MetricSpec":
                    yield text_of(key), {word.arg or "": word.value for word in value.keywords}


def test_every_title_that_a_stage_states_is_in_the_glossary():
    titles = {text_of(given["title"]) for _, given in described() if "title" in given}
    assert len(titles) > 100
    missing = {each for each in titles if not re.fullmatch(f"[{HOLE}, ]+", each)} - explained()
    assert not missing, f"explain in a table below '{HEAD}' of docs/glossary.md:\n" + "\n".join(sorted(missing))


def test_every_name_that_is_shown_as_it_is_stands_in_the_glossary():
    known = [(re.compile(re.escape(key).replace(HOLE, ".*")), given) for key, given in described()]
    golden = json.loads((ROOT / "tests/variants/golden.json").read_text())
    paths = {
        path.removeprefix("metrics.")
        for run in golden.values()
        for path in run
        if path.startswith("metrics.") and run[path] is not None
    }
    assert len(paths) > 150
    missing: set[str] = set()
    rows = explained()
    for path in paths:
        of = path.rpartition(".")[0] if path.rpartition(".")[2] in STATISTICS else path
        groups, _, name = of.rpartition(".")
        stated = [given for key, given in known if any(map(key.fullmatch, (path, of, name)))]
        if not any("setting" in given or "title" in given for given in stated):
            missing |= {title(name), *map(humanise, filter(None, groups.split(".")))} - rows
    assert not missing, "\n".join(sorted(missing))
