"""Output that cannot be written: the work continues, and the end of the run reports it."""

import io
import os
import sys
from typing import Any


class _Output(io.FileIO):
    """Standard output that keeps the first error of a full disk instead of stopping the program that prints."""

    def __init__(self, stream: io.TextIOWrapper) -> None:
        super().__init__(stream.fileno(), "wb", closefd=False)
        self._stream = stream  # one that nobody holds closes its file
        self.error: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write, or keep why not. Raises BrokenPipeError: nobody reads any more."""
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            self.error = self.error or error
            return len(data)


def mend_streams() -> None:
    """Says nothing where output is closed, and shows "?" for what its encoding lacks."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    stream = sys.stdout
    if isinstance(stream, io.TextIOWrapper) and isinstance(_below(stream), io.FileIO):
        mended: Any = _Output(stream)
        buffer = mended if stream.write_through else io.BufferedWriter(mended)
        sys.stdout = io.TextIOWrapper(
            buffer,
            stream.encoding,
            errors="replace",
            line_buffering=stream.line_buffering,
            write_through=stream.write_through,
        )


def lost_output() -> OSError | None:
    """Why something printed could not be written; None where all was."""
    sys.stdout.flush()
    raw = _below(sys.stdout)
    return raw.error if isinstance(raw, _Output) else None


def _below(stream: Any) -> Any:
    """Stream to which a stream's bytes go in the end."""
    buffer = getattr(stream, "buffer", None)
    return getattr(buffer, "raw", buffer)
