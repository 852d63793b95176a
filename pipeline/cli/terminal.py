"""What is printed to a terminal: tables, and folders as one would type them."""

import sys
from pathlib import Path
from typing import Any


def show(renderable: Any) -> None:
    """Print a table or a text in the terminal's width, in 120 columns where there is none."""
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else 120).print(renderable)


def shown(path: Path) -> str:
    """A path relative to where one is, where it lies below."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)
