"""A configuration as YAML that says nothing twice: an alias where a part stands again, a line for what fits in one."""

from collections.abc import Mapping
from typing import Any

import yaml

LINE = 185
"""Most characters of a part that is written in one line. A longer one that stands again is an alias."""
WIDTH = 200
"""Characters after which a line is broken: such a part with its key and indent."""


def config_text(settings: Mapping[str, Any]) -> str:
    """A configuration as its file holds it: what is read from it is equal to what was written."""
    names: dict[int, str] = {}
    plain = _shared(dict(settings), "", {}, names)

    class Dumper(_Dumper):
        parts = names

    return str(yaml.dump(plain, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=WIDTH))


def _shared(value: Any, key: str, known: dict[str, Any], names: dict[int, str]) -> Any:
    """The value, in which equal long parts are one object; `names` gets the key of each."""
    if isinstance(value, dict):
        value = {name: _shared(part, str(name), known, names) for name, part in value.items()}
    elif isinstance(value, list | tuple):
        value = [_shared(part, key, known, names) for part in value]
    else:
        return value
    text = repr(value)  # tells 1, 1.0 and true apart
    if len(text) <= LINE:
        return value
    found = known.setdefault(text, value)
    names.setdefault(id(found), key)
    return found


class _Dumper(yaml.SafeDumper):
    """Writes short collections in one line, and names the anchor of a part after its key."""

    parts: Mapping[int, str]
    """Object's id -> key of a part that may stand again."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.of_nodes: dict[int, str] = {}
        self.taken: dict[str, int] = {}

    def represent_data(self, data: Any) -> yaml.Node:
        node: yaml.Node = super().represent_data(data)
        if id(data) in self.parts:
            self.of_nodes[id(node)] = self.parts[id(data)]
        if isinstance(node, yaml.CollectionNode):
            node.flow_style = _width(node) <= LINE
        return node

    def ignore_aliases(self, data: Any) -> bool:
        """Tells whether a value is written in full each time it occurs."""
        return id(data) not in self.parts

    def generate_anchor(self, node: yaml.Node) -> str:
        """Name of a part: its key, with a number where several have that."""
        name = self.of_nodes.get(id(node), "part")
        self.taken[name] = self.taken.get(name, 0) + 1
        return name if self.taken[name] == 1 else f"{name}_{self.taken[name]}"


def _width(node: yaml.Node) -> int:
    """Characters of a value in one line."""
    if isinstance(node, yaml.MappingNode):
        return sum(_width(key) + _width(value) + 4 for key, value in node.value)
    if isinstance(node, yaml.SequenceNode):
        return sum(_width(item) + 2 for item in node.value)
    return len(str(node.value))
