"""`omninav stages`: all stages, those of a role, or everything about one, or about a value that travels on wires."""

import dataclasses
import inspect
import re
import sys
from collections.abc import Iterator

from omninav.pipeline.cli.config_groups import options_with
from omninav.pipeline.graph.parameters import Parameter, first_line, read_parameters
from omninav.pipeline.graph.ports import type_name
from omninav.pipeline.graph.problems import counted, nearest, suggest
from omninav.pipeline.graph.registry import BUILT_IN, Entry, UnknownStage, entries, resolve
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.graph.value import VALUE_TYPES


def command(arguments: list[str]) -> int:
    """List stages in one line each, by role; of a stage that is named, print ports, parameters, source and use."""
    arguments = [word.replace("=", ".") for word in arguments]  # as it is typed for a run: match=l2
    stages = list(entries())
    of_stages = {entry.role for entry in stages if entry.origin == "built in"}
    known = [*stages, *(_values() if arguments else [])]
    classes = {re.split("[.:]", entry.target)[-1]: entry.name for entry in known}
    arguments = [classes.get(word, word) for word in arguments]  # as pages name a stage: IndexedCandidates
    roles, names = {entry.role for entry in known}, {entry.name for entry in known}
    for word in arguments:
        if word not in roles | names:
            options, kind, what = (
                (names, "stages", "stage") if "." in word else (roles, "roles", "role, stage or value")
            )
            last = {name.rpartition(".")[2]: name for name in names} | classes | {role: role for role in roles}
            near = None if "." in word else nearest(word, last)
            hint = suggest(word, options, kind, prefix="omninav stages ")
            hint = f"did you mean 'omninav stages {last[near]}'?" if near else hint
            print(f"there is no {what} '{word}'; {hint}", file=sys.stderr)
            return 2
    broken, every = 0, [entry.name for entry in known]
    for entry in known:
        listed = entry.role in arguments and (entry in stages or entry.role not in of_stages)
        if arguments and not listed and entry.name not in arguments:
            continue
        broken += bool(entry.problem)
        print("\n".join(_described(entry) if entry.name in arguments else _listed(entry, every.count(entry.name) > 1)))
    if broken:
        print(f"{counted(broken, 'plugin')} cannot be loaded; all other stages can be used", file=sys.stderr)
    return 0


def _values() -> list[Entry]:
    """The values that omninav itself defines: their modules are imported with those of its stages."""
    return [
        Entry(target.removeprefix(f"{BUILT_IN}.").removeprefix("omninav."), target, "built in", first_line(cls))
        for target, cls in sorted(VALUE_TYPES.items())
        if target.startswith("omninav.") and not inspect.isabstract(cls)
    ]


def _listed(entry: Entry, one_of_several: bool) -> list[str]:
    """The line of a stage, with its class where a file holds several."""
    origin = "" if entry.origin == "built in" else f"[{entry.origin}] "
    origin += f"{re.split('[.:]', entry.target)[-1]}: " if one_of_several else ""
    what = f"cannot be used: {entry.problem}" if entry.problem else entry.summary
    return [f"{entry.name:38} {origin}{what}"]


def _described(entry: Entry) -> Iterator[str]:
    if entry.problem:
        yield f"{entry.name}  [{entry.origin}, cannot be used]\n    {entry.problem}\n"
        return
    yield f"{entry.name}  [{entry.origin}]  {entry.summary}"
    if value := VALUE_TYPES.get(entry.target.replace(":", ".")):
        yield from _fields(value)
        return
    try:
        cls = resolve(entry.target)
    except UnknownStage:  # a value, which no graph names
        return
    read = signature(cls)
    for port in read.inputs.values():
        every, optional = "all " if port.collects else "", " (optional)" if port.optional else ""
        yield f"    in   {port.name}: {every}{type_name(port.type)}{optional}"
    for port in read.outputs.values():
        yield f"    out  {port.name}: {type_name(port.type)}{' (may be absent)' if port.optional else ''}"
    for parameter in read.parameters.values():
        yield from _parameter(parameter)
    if papers := _papers(cls):
        yield f"    from {papers}"
    target = entry.target if entry.origin == "built in" else entry.name  # a path depends on the folder it is typed in
    for use in [*options_with(entry), f"_target_: {target}"]:
        yield f"    use  {use}"
    yield ""


def _fields(value: type) -> Iterator[str]:
    """The rest of a value's docstring, and its fields."""
    yield from (f"    {line}" for line in inspect.cleandoc(value.__doc__ or "").split("\n")[2:])
    for field in read_parameters(value).values():
        yield f"    field  {field.name}: {type_name(field.type)}"
        if field.meaning:
            yield f"           {field.meaning}"
    yield ""


def _parameter(parameter: Parameter) -> Iterator[str]:
    needed = parameter.default is dataclasses.MISSING
    default = "(needs a value)" if needed else f"= {parameter.default!r}"
    yield f"    set  {parameter.name}: {type_name(parameter.type)} {default}"
    if parameter.meaning:
        yield f"           {parameter.meaning}"


def _papers(cls: type) -> str:
    """The works that a stage's docstring names, with the sections it is from."""
    author, part = r"[A-Z][\w-]+", r"(?:section|equation|chapter|figure|table)s? [\w.]*\w"
    pattern = rf"{author}(?:(?:, | & | and ){author}| et al\.)* (?:19|20)\d\d(?:, {part})*"
    return "; ".join(dict.fromkeys(re.findall(pattern, " ".join((cls.__doc__ or "").split()))))
