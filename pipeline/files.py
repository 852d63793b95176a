"""Files appear whole or not at all, and are known by the hash of what is in them."""

import errno
import fcntl
import hashlib
import json
import os
import re
import stat
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

DISK = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS)
"""Errors of a full or read-only disk: no fault of the code that writes."""
SUM = "sha256"
"""The key of a JSON file's own checksum."""
PART = f"@{re.sub(r'[^A-Za-z0-9-]', '_', os.uname().nodename)}.part"
"""Ending of a file's name that a process of this machine is writing: others may share its disk."""


class Damaged(ValueError):
    """A file that does not hold what was written to it. The message is one line and names the file."""


class Taken(Exception):
    """Another process holds a lock. The message names the process."""


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file under a temporary name and rename it, so that no reader ever sees half of it.

    Characters that UTF-8 cannot hold (lone surrogates) are escaped.
    """
    with whole_file(path) as part:
        part.write_bytes(content.encode(errors="backslashreplace") if isinstance(content, str) else content)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to; renamed to `path` when the block ends well, removed when it does not."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}{PART}")
    part.unlink(missing_ok=True)  # a link of that name would be written through
    _remove_left_over(path)
    try:
        with named(path, part):
            yield part
            os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def named(path: Path, part: Path | None = None) -> Iterator[None]:
    """Give an error of the block its file's name where it has none (of a full disk), or that of the file's `part`."""
    try:
        yield
    except OSError as error:
        if error.filename is None or (part is not None and str(error.filename).startswith(str(part))):
            error.filename = str(path)
        raise


def _remove_left_over(path: Path) -> None:
    """Remove what processes of this machine left that were killed while they wrote this file."""
    begins, ends = f"{path.name}.", PART
    for name in os.listdir(path.parent):
        by = name.removeprefix(begins).removesuffix(ends)
        process, _, thread = by.partition("-")
        if name == f"{begins}{by}{ends}" and f"{process}{thread}".isdecimal() and not _lives(int(process)):
            with suppress(OSError):
                path.with_name(name).unlink()


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # somebody else's
        pass
    return True


def user_path(text: str | Path) -> Path:
    """A path as a user writes it, `~` and all; unchanged where `~name` is nobody."""
    try:
        return Path(text).expanduser()
    except RuntimeError:
        return Path(text)


def digest_file(path: Path) -> str:
    """sha256 of a file's bytes, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest_text(*parts: str) -> str:
    """sha256 of some texts, each kept apart from the next."""
    whole = hashlib.sha256()
    for part in parts:
        whole.update(f"{len(part)}:{part}".encode())
    return whole.hexdigest()


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write plain data as a JSON file that holds its own checksum, under `SUM`."""
    plain = {key: value for key, value in json.loads(json.dumps(content, default=str)).items() if key != SUM}
    write_whole(path, json.dumps({**plain, SUM: _sum(plain)}, indent=1) + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """Reads what `write_json` wrote, without the checksum. Raises `Damaged` where it is anything else."""
    if not path.is_file():
        raise Damaged(f"{path}: there is no such file")
    try:
        content = json.loads(path.read_bytes())
        expected = content.pop(SUM)
    except (ValueError, LookupError, AttributeError, TypeError, RecursionError):
        raise Damaged(f"{path} is damaged, or was written by another version of omninav") from None
    if expected != _sum(content):
        raise Damaged(f"{path} is damaged or was changed: its sha256 does not fit its content")
    return dict(content)


def _sum(plain: Mapping[str, Any]) -> str:
    return digest_text(json.dumps(plain, sort_keys=True))


def open_itself(path: Path, flags: int) -> int:
    """A file descriptor of a regular file that has this name only. A link is refused, as is a device or a pipe.

    Who could place a link would have us write to a file elsewhere. Raises `OSError` naming the file.
    """
    try:
        file = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "is a link, which is not followed; delete it", str(path)) from None
        raise
    found = os.fstat(file)
    if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:
        os.close(file)
        raise OSError(errno.EINVAL, "is no file of its own (a link, a device or a pipe); delete it", str(path))
    return file


@contextmanager
def locked(path: Path, wait: bool = True) -> Iterator[None]:
    """Hold a lock file for as long as the block runs, or until this process dies, in whatever way.

    Without `wait` raises `Taken` where another process holds it, or this one does already.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    file = open_itself(path, os.O_RDWR | os.O_CREAT)
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            time.sleep(0.1)  # its owner may have it for so short a time that it has not signed it yet
            owner = os.pread(file, 20, 0).decode("ascii", "replace").strip()
            raise Taken(f"process {owner}" if owner.isdigit() else "another process") from None
        with suppress(OSError):  # a full disk: the lock holds without a name
            os.ftruncate(file, 0)
            os.pwrite(file, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(file)
