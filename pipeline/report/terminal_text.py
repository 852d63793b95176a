"""Text for a terminal: control characters that a file holds are shown, and never sent."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

CONTROL = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\t\n"}
"""Every control character but the tab and the end of a line, by its code: as Python writes it."""


def plain(text: str) -> str:
    """A text with its control characters as Python writes them (`\\x1b`)."""
    return text.translate(CONTROL)


class Uncleaned:
    """A stream for code that writes control characters of omninav's own, around texts that are `plain`."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> Any:
        """Write the text as it is."""
        stream: Any = self._stream
        return type(stream).write(stream, text)

    def write_plain(self, text: str) -> Any:
        """Write the text as it is shown."""
        return self.write(plain(text))


@contextmanager
def cleaned(*streams: Any) -> Iterator[None]:
    """While the block runs, whatever is printed to these streams is `plain`, but through `Uncleaned`."""
    for stream in streams:
        stream.write = Uncleaned(stream).write_plain
    try:
        yield
    finally:
        for stream in streams:
            del stream.write


class PlainTexts:
    """Something of rich's whose texts are `plain`; colours stay."""

    def __init__(self, renderable: Any) -> None:
        self._renderable = renderable

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        from rich.segment import Segment

        for part in console.render(self._renderable, options):
            yield part if part.control else Segment(plain(part.text), part.style)
