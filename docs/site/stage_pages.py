"""A page for each role with all its stages, from their classes."""

import dataclasses
import importlib
import inspect
import re
from collections.abc import Iterator
from itertools import groupby

from port_drawing import drawing

from omninav.pipeline.cli.config_groups import options_with
from omninav.pipeline.graph.parameters import Parameter
from omninav.pipeline.graph.ports import type_name
from omninav.pipeline.graph.registry import Entry, entries, resolve
from omninav.pipeline.graph.signature import signature


def role_pages() -> dict[str, str]:
    """The page of every role, and one that lists them."""
    pages, lines = {}, ["# Stages", "", "Every step of a graph is a stage; `omninav stages ROLE.NAME` prints the same."]
    known = sorted((entry for entry in entries() if entry.origin == "built in"), key=lambda entry: entry.name)
    for role, group in groupby(known, key=lambda entry: entry.role):
        stages = list(group)
        package = importlib.import_module(f"omninav.stages.{role}")
        pages[f"stages/{role}.md"] = "\n".join([f"# {role}", "", package.__doc__ or "", *_all(stages)])
        lines += ["", f"## [{role}]({role}.md)", "", package.__doc__ or "", ""]
        lines += [f"- [`{entry.name}`]({role}.md#{_anchor(entry)}): {entry.summary}" for entry in stages]
    return pages | {"stages/index.md": "\n".join(lines)}


def _anchor(entry: Entry) -> str:
    return entry.name.replace(".", "-")


def _all(stages: list[Entry]) -> Iterator[str]:
    for entry in stages:
        cls = resolve(entry.target)
        read = signature(cls)
        yield f"\n## `{entry.name}` {{ #{_anchor(entry)} }}\n"
        yield _text(inspect.getdoc(cls) or "")
        yield f"\n<div>{drawing(cls.__name__, read)}</div>\n"
        if read.parameters:
            yield "| parameter | type | default | meaning |\n|---|---|---|---|"
            yield from (_row(parameter) for parameter in read.parameters.values())
        uses = [f"`{use}`" for use in [*options_with(entry), f"_target_: {entry.target}"]]
        yield f"\nUse: {' or '.join(uses)}\n"


def _row(parameter: Parameter) -> str:
    needed = parameter.default is dataclasses.MISSING
    default = "(needs a value)" if needed else f"`{_short(parameter.default)}`"
    cells = (f"`{parameter.name}`", f"`{type_name(parameter.type)}`", default, _text(parameter.meaning))
    return f"| {' | '.join(cells)} |"


def _short(default: object) -> str:
    text = repr(default)
    return text if len(text) < 60 else f"{text[:56]} …"


def _text(docstring: str) -> str:
    """A docstring as Markdown: what would be taken for HTML, emphasis or a cell's end is escaped outside of code."""
    parts = re.split(r"(`[^`]*`)", docstring)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<|])(?=\S)", r"\\\1", part) for part in parts)
