"""A localiser that is a program of its own, measured like every other."""

import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np

from omninav.pipeline import (
    BadInput,
    Context,
    Metrics,
    MetricSpec,
    Outputs,
    Stage,
    Tick,
    cut,
    digest_file,
    digest_text,
    refuse_untyped,
)
from omninav.stages.recordings.localiser_folder import read_poses, write_folder
from omninav.stages.recordings.recorded_images import RecordedImages
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Motion, Pose

from .collect_drive import CollectDrive

LOG = "localiser.log"
"""File of the run's folder that holds its output."""
SUPERVISOR = """
import os, signal, subprocess, sys, threading
try:
    process = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
except OSError as error:
    sys.exit(f"it cannot be run: {error.strerror}")
def watch():
    os.read(0, 1)
    os.killpg(0, signal.SIGKILL) if hasattr(os, "killpg") else process.kill()
threading.Thread(target=watch, daemon=True).start()
code = process.wait()
os._exit(code if code >= 0 else 128 - code)
"""
"""Program that runs another, and ends it with all that it has started when its own standard input is closed."""
SPECS = {
    "peer.image_cpu_ms": MetricSpec(title="Processor time of an image", unit="ms", better="lower"),
    "peer.map_cpu_s": MetricSpec(title="Processor time of all the rest, the map", unit="s", better="lower"),
    "peer.cpu_s": MetricSpec(title="Processor time of the localiser", unit="s", better="lower"),
    "peer.kept_mb": MetricSpec(title="Files that the localiser keeps", unit="MB", better="lower"),
    "peer.lines": MetricSpec(title="Lines of its program", better="lower"),
    "peer.without_pose": MetricSpec(title="Images without a pose", unit="%", better="lower"),
}


class OutsideLocaliser(Stage):
    """Gives a program the images of a map and of a drive as files, and uses its poses as the drive's estimates.

    It is called as `COMMAND FOLDER` after the last image, and reads and writes what `recordings/localiser_folder.py`
    says. Under `peer`: its processor time with that of its children, in all (`cpu_s`), and where its `poses.csv` says
    what each image took, of an image and of all the rest; the files that it leaves in the folder beside its poses;
    lines of the text files that the command names, without empty ones and what they import. Raises `BadInput` with its
    last words where it fails, and where its poses cannot be read. It ends with the run, however that ends.
    """

    command: str | None = None
    """The program with its words, as typed in a terminal; `python` is the one that runs this. The folder follows."""

    class Out(Outputs):
        """`drive`: with its poses."""

        drive: Drive
        metrics: Metrics

    def inputs_digest(self) -> str | None:
        """Hash of the files that the command names, and of all Python files beside one of Python."""
        files = self._files()
        beside = {
            module for file in files if file.suffix == ".py" for module in file.parent.glob("*.py") if module.is_file()
        }
        return digest_text(*map(digest_file, [*files, *sorted(beside)])) if files else None

    def step(
        self,
        ctx: Context,
        map: RecordedImages,
        images: RecordedImages,
        ticks: Sequence[Tick],
        truth: Sequence[Pose | None],
        motion: Sequence[Motion | None],
    ) -> Out:
        if len({tick.log for tick in ticks}) > 1:
            raise BadInput("a localiser of your own is given one log at a time: log=PATH")
        with tempfile.TemporaryDirectory(prefix="omninav_peer_") as place:
            folder = Path(place)
            given = {*write_folder(folder, map, images)}
            ctx.status(f"{cut(self.command or '')}: a map of {len(map)} images, a drive of {len(images)}")
            used = self._run(folder, (ctx.folder or folder) / LOG)
            try:
                poses, images_ms = read_poses(folder, images)
            except BadInput as wrong:
                raise BadInput(f"{cut(self.command or '')}: {wrong}".replace(f"{folder}{os.sep}", "")) from None
            kept = [path for path in folder.rglob("*") if path.is_file() and path not in given]
            size = sum(path.stat().st_size for path in kept if path.name not in (LOG, "poses.csv", "poses.tum"))
        estimates = [
            PoseEstimate(pose, np.zeros((3, 3)), 1.0, pose) if np.isfinite(row).all() else None
            for row in poses
            for pose in [Pose(*row.tolist())]
        ]
        drive = CollectDrive().step(ctx, ticks, truth, motion, estimates).drive
        contents = [file.read_bytes() for file in self._files()]
        lines = [line for content in contents if b"\0" not in content for line in content.splitlines()]
        values = {
            "image_cpu_ms": float(np.median(images_ms)) if len(images_ms) else None,
            "map_cpu_s": None if used is None or not len(images_ms) else max(0.0, used - images_ms.sum() / 1e3),
            "cpu_s": used,
            "kept_mb": size / 1e6,
            "lines": sum(bool(line.strip()) for line in lines) or None,
            "without_pose": float(np.isnan(poses[:, 0]).mean()),
        }
        missing = ("peer.without_pose",) if values["without_pose"] else ()
        return self.Out(drive=drive, metrics=Metrics({"peer": values}, SPECS, missing))

    def _words(self) -> list[str]:
        try:
            words = shlex.split(self.command or "")
        except ValueError as error:
            raise BadInput(f"command: {cut(self.command or '')}: {error}") from None
        if not words:
            raise BadInput('command: no program; type command="python my_localiser.py"')
        refuse_untyped(self.command or "")
        script = words[1] if words[0].startswith("python") and words[1:] and words[1].endswith(".py") else ""
        if shutil.which(words[0], path=_path()) is None:
            raise BadInput(f"command: {cut(words[0])} is no program that can be run; name one, or its path")
        if script and not os.path.isfile(script):
            raise BadInput(f"command: there is no file {cut(script)}")
        return words

    def _files(self) -> list[Path]:
        return [Path(word) for word in self._words() if os.path.isfile(word)]

    def _run(self, folder: Path, log: Path) -> float | None:
        """Run it to its end, and give the seconds of processor time that it took; None where nothing counts them."""
        before = _children_s()
        with log.open("w+b") as output:
            ended = wait(self._words(), folder, output)
            if ended:
                output.seek(max(0, output.tell() - 2000))
                words = output.read().decode(errors="replace").strip().splitlines() or ["it said nothing"]
                raise BadInput(f"{cut(self.command or '')} ended with {ended}: {words[-1]:.300}")
        after = _children_s()
        return None if before is None or after is None else after - before


def wait(words: Sequence[str], folder: Path, output: IO[bytes]) -> int:
    """Run a program until it ends, or this process does, even killed: no process of it survives."""
    own = os.environ | {"PATH": _path()}
    own.pop("PYTHONSAFEPATH", None)  # which a command of ours sets for processes of ours
    process = subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", SUPERVISOR, *words, str(folder)],
        stdin=subprocess.PIPE,
        stdout=output,
        stderr=output,
        env=own,
        start_new_session=True,
    )
    try:
        return process.wait()
    finally:
        if hasattr(os, "killpg"):
            with suppress(OSError):  # nothing of it is left
                os.killpg(process.pid, signal.SIGKILL)
        assert process.stdin is not None
        process.stdin.close()
        process.wait()


def _path() -> str:
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])


def _children_s() -> float | None:
    """Processor time (s) of all programs that were run from here and have ended; None where nothing counts it."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
