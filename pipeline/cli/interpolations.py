"""Limits what the interpolations of a configuration (`${name}`) repeat, counted as YAML's aliases are."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from omegaconf import Container, Node
from omegaconf.errors import InterpolationResolutionError

MAX_REPEATED = 10_000
"""Largest number of values that the interpolations of a configuration repeat, 100 characters of a text counted as one.
Every variant and experiment that omninav brings stays below it."""
_CHARACTERS = 100
_SPENT = "_repeated"
_limited: ContextVar[bool] = ContextVar("_limited", default=False)


@contextmanager
def interpolations_limited() -> Iterator[None]:
    """While the block runs, a configuration that repeats more than `MAX_REPEATED` raises OmegaConf's error."""
    token = _limited.set(True)
    try:
        yield
    finally:
        _limited.reset(token)


def _counted(resolve: Callable[..., Any], cost: int) -> Callable[..., Any]:
    """A method of OmegaConf's that resolves interpolations, what it gives being counted, and what it costs: a function
    (`${oc.select:…}`) takes ten times as long as a name."""

    def counting(self: Any, *arguments: Any, **named: Any) -> Any:
        value = resolve(self, *arguments, **named)
        if _limited.get():
            root = vars(self._get_root())
            root[_SPENT] = root.get(_SPENT, 0) + cost + _number(value, MAX_REPEATED)
            if root[_SPENT] > MAX_REPEATED:
                raise InterpolationResolutionError(f"interpolations repeat more than {MAX_REPEATED:,} values")
        return value

    return counting


for _method, _cost in (
    ("resolve_parse_tree", 0),
    ("_resolve_node_interpolation", 0),
    ("_evaluate_custom_resolver", 10),
):
    setattr(Container, _method, _counted(getattr(Container, _method), _cost))


def _number(value: Any, most: int) -> int:
    """Counts the values in a value, up to a little more than `most`."""
    number, waiting = 0, [value]
    while waiting and number <= most:
        each = waiting.pop()
        number += 1
        content = vars(each).get("_content", vars(each).get("_val")) if isinstance(each, Node) else each
        if isinstance(content, dict):
            waiting += content.values()
        elif isinstance(content, list):
            waiting += content
        elif isinstance(content, str):
            number += len(content) // _CHARACTERS
    return number
