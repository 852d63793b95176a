"""A run's folder: made with all that a resume needs, and its manifest."""

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput

from .inputs import refuse_missing
from .plan import Plan, input_digests
from .provenance import LIBRARIES, git_commit, version


@dataclass
class Run:
    """A run folder with its manifest, which is written at the start and completed at the end."""

    folder: Path
    manifest: dict[str, Any] = field(default_factory=dict)

    def save(self) -> None:
        """Write the manifest as it stands."""
        write_whole(self.folder / "manifest.json", json.dumps(self.manifest, indent=1, default=str) + "\n")

    @property
    def memory(self) -> Path:
        """Where checkpoints and sequences lie."""
        return self.folder / "checkpoints"


def start(
    planned: Plan, argv: Sequence[str], folder: Path | None = None, files: Mapping[str, str] | None = None
) -> Run:
    """Make the run's folder with config, graph and manifest, and with more `files` by their names.

    `folder` is given by a sweep or by the user, else made from the date. The latter appears under its name when all
    that a resume needs is in it: a run that can be seen can be resumed.
    """
    config = planned.config
    refuse_missing(config)
    inputs = input_digests(planned)
    root, named = Path(str(config.get("runs", "runs"))), f"{datetime.now():%Y-%m-%d_%H-%M-%S}_{planned.variant}"
    beginning = root / f".{named}.{os.getpid()}.part" if folder is None else folder
    beginning.mkdir(parents=True, exist_ok=True)
    run = Run(beginning)
    run.manifest = {
        "omninav": version("omninav"),
        "status": "running",
        "variant": planned.variant,
        "argv": list(argv),
        "cwd": os.getcwd(),
        "started": datetime.now().isoformat(timespec="seconds"),
        "git_commit": git_commit(),
        "graph": planned.digest,
        "inputs": inputs,
        "seed": planned.seed,
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
    }
    write_whole(beginning / "config.yaml", yaml.safe_dump(dict(config), sort_keys=False, allow_unicode=True, width=120))
    for name, content in (files or {}).items():
        write_whole(beginning / name, content)
    from omninav.pipeline.report.graph_svg import svg  # drawing is not needed to start the command line
    from omninav.pipeline.report.mermaid import mermaid

    write_whole(beginning / "graph.svg", svg(planned.graph))
    write_whole(beginning / "graph.mmd", mermaid(planned.graph))
    run.save()
    if folder is None:
        run.folder = _named(beginning, root, named)
        _point_latest(run.folder)
    return run


def status(folder: Path) -> str | None:
    """What a run folder's manifest says of the run (`running`, `complete`, `failed`, …); None where there is none."""
    file = folder / "manifest.json"
    return str(json.loads(file.read_text()).get("status")) if file.is_file() else None


def _named(folder: Path, root: Path, name: str) -> Path:
    """The folder under a name that no other has (two runs may start in the same second)."""
    for number in range(1, 1000):
        target = root / (name if number == 1 else f"{name}_{number}")
        try:
            return folder.rename(target)
        except OSError as taken:  # by a folder with something in it
            if not target.exists():
                raise BadInput(f"{target}: {taken.strerror}; give another folder: runs=FOLDER") from None
    raise BadInput(f"{root}: more than 1000 runs named {name}")


def _point_latest(folder: Path) -> None:
    link = folder.parent / "latest"
    part = folder.parent / f".latest.{os.getpid()}"
    try:
        part.unlink(missing_ok=True)
        part.symlink_to(folder.name)
        os.replace(part, link)
    except OSError:  # a file system without links, or a folder of that name: the run does not need it
        part.unlink(missing_ok=True)
