"""A tool: a command with arguments of its own, outside of any graph."""

import dataclasses
from abc import ABC, abstractmethod
from typing import Any, ClassVar, dataclass_transform

from .stage import Context


@dataclass_transform(kw_only_default=True)
class Tool(ABC):
    """Base of all tools. A subclass is a keyword-only dataclass of its arguments with a `run`.

    The first line of its docstring and the docstrings below its arguments are its help. Words that set nothing are
    its first argument.
    """

    example: ClassVar[str]
    """Words to type behind its name."""
    groups: ClassVar[tuple[str, ...]] = ()
    """Groups of configuration that arguments of these names are composed of."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        dataclasses.dataclass(kw_only=True, eq=False)(cls)

    @abstractmethod
    def run(self, ctx: Context) -> None:
        """Do the work. Raises `BadInput` where an argument does not fit."""
