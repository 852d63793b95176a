"""What is opened in a folder while something runs there, by whatever process and library."""

import ctypes
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_OPENED, _MADE = 0x20, 0x100
_EVENT = struct.Struct("iIII")


@contextmanager
def watched(folder: Path) -> Iterator[set[str]]:
    """Files and folders that are opened or made in a folder and in those that it has at the beginning, by name."""
    system = ctypes.CDLL(None, use_errno=True)
    watch = system.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    assert watch >= 0, os.strerror(ctypes.get_errno())
    folders = {
        system.inotify_add_watch(watch, os.fsencode(place), _OPENED | _MADE): place
        for place in (folder, *(path for path in folder.rglob("*") if path.is_dir()))
    }
    seen: set[str] = set()
    try:
        yield seen
        while events := _read(watch):
            at = 0
            while at < len(events):
                number, _, _, length = _EVENT.unpack_from(events, at)
                name = events[at + _EVENT.size : at + _EVENT.size + length].rstrip(b"\0").decode()
                at += _EVENT.size + length
                if name:  # else the folder itself was listed
                    seen.add(str((folders[number] / name).relative_to(folder)))
    finally:
        os.close(watch)


def _read(watch: int) -> bytes:
    try:
        return os.read(watch, 1 << 20)
    except BlockingIOError:
        return b""
