"""A run's folder: made with all that a resume needs, and its manifest."""

import os
import platform
import shutil
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.code_version import LIBRARIES, git_commit, version
from omninav.pipeline.engine.codec import encode, seal
from omninav.pipeline.files import Damaged, Taken, digest_text, locked, read_json, write_json, write_whole
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.graph_svg import svg
from omninav.pipeline.report.mermaid import mermaid

from .config_text import config_text
from .inputs import refuse_missing
from .metrics_files import MANIFEST
from .prepared_run import PreparedRun, input_digests

CONFIG = "config.yaml"
STEPS = "steps"
"""Key of the manifest for how many frames a session had when it was interrupted."""


class Interrupted(KeyboardInterrupt):
    """A run that its user stopped. `folder`: where it can continue."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder


@dataclass
class RunFolder:
    """A run folder with its manifest, which is written at the start and completed at the end.

    One process owns it at a time, until it releases it or dies.
    """

    folder: Path
    manifest: dict[str, Any] = field(default_factory=dict)
    complete: bool = False
    """The run was complete when it was resumed: nothing was done."""
    shown_as: Path | None = None
    """The folder that its report names, where that is another one."""
    _owned: bool = False

    def save(self) -> None:
        """Write the manifest as it is."""
        write_json(self.folder / MANIFEST, self.manifest)

    @property
    def memory(self) -> Path:
        """Folder of checkpoints and sequences."""
        return self.folder / "checkpoints"

    @property
    def beginning(self) -> Path:
        """Manifest and configuration as the run began with them, sealed; only while it is unfinished."""
        return self.memory / "start"

    @contextmanager
    def owned(self) -> Iterator[None]:
        """Keep other processes from running it while the block runs. Raises `BadInput` naming the one that does."""
        if self._owned:
            yield
            return
        try:
            with locked(self.folder / ".lock", wait=False):
                self._owned = True
                yield
        except Taken as taken:
            raise BadInput(f"{self.folder}: {taken} is running it; wait until it has ended") from None
        finally:
            self._owned = False

    def seal_beginning(self, config: str) -> None:
        """Keep the manifest as it is, and the text of the configuration, where damage to their files is found."""
        write_whole(self.beginning, seal(encode({"manifest": self.manifest, "config": config})))

    def describe(self, prepared: PreparedRun, config: str) -> None:
        """Write the text of the configuration, and the graph that follows from it."""
        write_whole(self.folder / CONFIG, config)
        write_whole(self.folder / "graph.svg", svg(prepared.graph))
        write_whole(self.folder / "graph.mmd", mermaid(prepared.graph))


def recorded_name(origin: str) -> str:
    """The file that holds every value of a recorded output."""
    return f"{origin}.values"


def start(
    prepared: PreparedRun, argv: Sequence[str], folder: Path | None = None, files: Mapping[str, str] | None = None
) -> RunFolder:
    """Make the run's folder with config, graph and manifest, and with more `files` by their names.

    `folder` is given by a sweep or by the user, else made from the date. The latter appears under its name when all
    that a resume needs is in it: a run that can be seen can be resumed.
    """
    config = prepared.config
    refuse_missing(config)
    inputs = input_digests(prepared)
    root = Path(str(config.get("runs", "runs"))).absolute()
    named = f"{datetime.now():%Y-%m-%d_%H-%M-%S}_{prepared.variant}"
    beginning = root / f".{named}.{threading.get_native_id()}.part" if folder is None else folder.absolute()
    beginning.mkdir(parents=True, exist_ok=True)
    run = RunFolder(beginning)
    config_file = config_text(prepared.config)
    run.manifest = {
        "omninav": version("omninav"),
        "status": "running",
        "variant": prepared.variant,
        "argv": list(argv),
        "cwd": os.getcwd(),
        "started": datetime.now().isoformat(timespec="seconds"),
        "git_commit": git_commit(),
        "graph": prepared.digest,
        "config": digest_text(config_file),
        "inputs": inputs,
        "seed": prepared.seed,
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
    }
    try:
        with run.owned():
            run.describe(prepared, config_file)
            for name, content in (files or {}).items():
                write_whole(beginning / name, content)
            run.seal_beginning(config_file)
            run.save()
    except BaseException:
        if folder is None:
            shutil.rmtree(beginning, ignore_errors=True)
        raise
    if folder is None:
        run.folder = _named(beginning, root, named)
        _point_latest(run.folder)
    return run


def was_started(folder: Path, prepared: PreparedRun) -> bool:
    """Tells if a run of the same configuration, stages and inputs was started in a folder, and can continue there."""
    try:
        manifest = read_json(folder / MANIFEST)
    except (OSError, Damaged):
        return False
    now = {
        "graph": prepared.digest,
        "config": digest_text(config_text(prepared.config)),
        "inputs": input_digests(prepared),
        "git_commit": git_commit(),
    }
    return all(manifest.get(key) == value for key, value in now.items())


def _named(folder: Path, root: Path, name: str) -> Path:
    """The folder under a name that no other has (two runs may start in the same second)."""
    for target in _numbered(root / name):
        try:
            return folder.rename(target)
        except OSError as taken:  # by a folder with something in it
            if not target.exists():
                raise BadInput(f"{target}: {taken.strerror}; give another folder: runs=FOLDER") from None
    raise BadInput(f"{root}: more than 1000 runs named {name}")


def new_folder(folder: Path) -> Path:
    """Make a folder that nobody else has made: of this name, or with a number behind it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    for target in _numbered(folder):
        with suppress(FileExistsError):
            target.mkdir()
            return target
    raise BadInput(f"{folder.parent}: more than 1000 folders named {folder.name}")


def _numbered(folder: Path) -> Iterator[Path]:
    return (folder.with_name(f"{folder.name}_{number}") if number > 1 else folder for number in range(1, 1000))


def _point_latest(folder: Path) -> None:
    link = folder.parent / "latest"
    part = folder.parent / f".latest.{threading.get_native_id()}"
    try:
        part.unlink(missing_ok=True)
        part.symlink_to(folder.name)
        os.replace(part, link)
    except OSError as error:  # a file system without links, or a folder of that name: the run does not need it
        part.unlink(missing_ok=True)
        what = "is a folder and no link" if link.is_dir() and not link.is_symlink() else f"({error.strerror})"
        print(f"{link} {what}, and does not lead to this run: {folder}", file=sys.stderr)
