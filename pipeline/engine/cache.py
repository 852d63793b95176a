"""The cache: results as files, by the hash of everything that made them."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from omninav.pipeline.files import DISK, digest_file, digest_text, locked, whole_file, write_whole

from .codec import BadEncoding, decode, encode, seal, unseal
from .damage import report_damage


class Cache:
    """Results by content: a folder of files named by the hash of everything that made them.

    Beside each file is its entry: the whole key, the file's sha256 and notes, sealed. So a file that is damaged, or
    another key's under this name, is no result: it is thrown away and made again.

    One process at a time makes a result (`lock`), so parallel jobs make each once; a lock dies with its process.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, key: str, suffix: str) -> Path:
        """Path of the result with this key, made or not."""
        return self.folder / f"{key[:32]}{suffix}"

    def find(self, key: str, suffix: str) -> tuple[Path, Any] | None:
        """The result with this key, and its notes; None where there is none, or no whole one."""
        path, entry = self.path(key, suffix), self._entry(key, suffix)
        try:
            if not path.is_file() or not entry.is_file():  # without its entry it was never finished
                return None
            stated = decode(unseal(entry.read_bytes(), str(entry)))
            if stated["key"] != key:
                raise BadEncoding(f"{path} was made for another key")
            if stated["sha256"] != digest_file(path):
                raise BadEncoding(f"{path} is damaged: its sha256 does not fit its content")
            return path, stated["notes"]
        except (BadEncoding, LookupError, TypeError) as error:
            self.discard(key, suffix, str(error))
        except PermissionError:  # somebody else's
            pass
        return None

    @contextmanager
    def keep(self, key: str, suffix: str, notes: Any = None) -> Iterator[Path]:
        """A path to write a result to; it is there, with its notes, when the block ends well. Its key is held."""
        for half_written in self.folder.glob(f"{key[:32]}*.part"):  # by a process that was killed
            half_written.unlink(missing_ok=True)
        with whole_file(self.path(key, suffix)) as part:
            yield part
            digest = digest_file(part)
        write_whole(self._entry(key, suffix), seal(encode({"key": key, "sha256": digest, "notes": notes})))

    @contextmanager
    def unless_full(self) -> Iterator[None]:
        """Around code that stores a result: a full disk, or one not ours, is reported, and does not fail the run."""
        try:
            yield
        except PermissionError as error:
            report_damage(f"cache: {self.folder}: {error.strerror}; results are not kept there: type cache=FOLDER")
        except OSError as error:
            if error.errno not in DISK:
                raise
            file = Path(str(error.filename2 or error.filename or self.folder))  # of a copy, the file that it makes
            where = f"cache: {file if file.is_relative_to(self.folder) else self.folder}: {error.strerror}"
            report_damage(f"{where}; results are not kept there: free some space, or type cache=FOLDER")

    def discard(self, key: str, suffix: str, why: str) -> None:
        """Throw a result away, and report why."""
        report_damage(f"{why}; it is thrown away and made again")
        with self.unless_full():
            for file in (self._entry(key, suffix), self.path(key, suffix)):
                file.unlink(missing_ok=True)

    @contextmanager
    def lock(self, key: str) -> Iterator[None]:
        """Lock an entry while its result is being computed; others that need it wait."""
        with ExitStack() as held:
            with self.unless_full():
                held.enter_context(locked(self.path(key, ".lock")))
            yield

    def _entry(self, key: str, suffix: str) -> Path:
        return self.path(key, f"{suffix}.entry")


def seeded(key: str, seed: int) -> str:
    """The key of a result that depends on the seed."""
    return digest_text(key, f"seed {seed}")
