"""Output that cannot be written: the work continues, and the end of the run reports it."""

import io
import os
import sys
from typing import Any


class _Output(io.FileIO):
    """An output that keeps the first error of a full disk instead of stopping the program that prints."""

    def __init__(self, stream: io.TextIOWrapper, read: bool) -> None:
        super().__init__(stream.fileno(), "wb", closefd=False)
        self._stream = stream  # one that nobody holds closes its file
        self._read = read
        self.error: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write, or keep why not. Raises BrokenPipeError: nobody reads any more what is printed to be `read`."""
        try:
            return super().write(data)
        except OSError as error:
            if self._read and isinstance(error, BrokenPipeError):
                raise
            self.error = self.error or error
            return len(data)


def mend_streams() -> None:
    """Mends the outputs: silent where closed, "?" for what an encoding lacks, and no progress that stops a run."""
    while (null := os.open(os.devnull, os.O_RDWR)) <= 2:  # else the next file or pipe to be opened gets its place
        os.set_inheritable(null, True)
    os.close(null)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
            if isinstance(_below(stream), io.FileIO):
                setattr(sys, name, _mended(stream, read=name == "stdout"))


def _mended(stream: io.TextIOWrapper, read: bool) -> io.TextIOWrapper:
    output: Any = _Output(stream, read)
    return io.TextIOWrapper(
        output if stream.write_through else io.BufferedWriter(output),
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
