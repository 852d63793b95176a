"""The cache: results as files, by the hash of everything that made them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from omninav.pipeline.files import digest_text, locked


class Cache:
    """Results by content: a folder of files named by the hash of everything that made them.

    One process at a time makes a result (`lock`), so parallel jobs make each once; a lock dies with its process.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, key: str, suffix: str) -> Path:
        """Where the result with this key lies, or would lie."""
        return self.folder / f"{key[:32]}{suffix}"

    @contextmanager
    def lock(self, key: str) -> Iterator[None]:
        """Hold the key: others who want the same result wait here until it is there."""
        with locked(self.path(key, ".lock")):
            yield


def seeded(key: str, seed: int) -> str:
    """The key of a result that depends on the seed."""
    return digest_text(key, f"seed {seed}")
