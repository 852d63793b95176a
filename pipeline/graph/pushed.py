"""Sources whose frames come from the caller, one at a time."""

import inspect
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from .problems import BadInput, suggest


@runtime_checkable
class Pushed(Protocol):
    """A source that gives, at its next step, what it was pushed; without anything it has ended.

    `push` has an argument for everything that a frame may bring.
    """

    push: Any


def push(source: Pushed, given: Mapping[str, Any]) -> None:
    """Hand a frame to a source. Raises `BadInput` where it is none, with what the source takes."""
    arguments = inspect.signature(source.push).parameters
    for name in given:
        if name not in arguments:
            raise BadInput(f"step: there is no {name}=…; {suggest(name, arguments, 'arguments')}")
    missing = [name for name, one in arguments.items() if one.default is one.empty and name not in given]
    if missing:
        raise BadInput(f"step: {missing[0]}=… is missing; it takes {', '.join(arguments)}")
    source.push(**given)
