"""Drives that fail for a known reason, and what `omninav explain` says of each.

python tests/explained_failures.py FOLDER OTHER_TOUR TOUR DRIVE [TOUR DRIVE ...]    # a table of causes by known causes
"""

import math
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from conflicting_logs import ODOMETRY, RANDOM, Change, changed_log, images, learned_map, turned

import omninav
from omninav.pipeline.engine.artifact import read_header, write_artifact
from omninav.pipeline.mcap.message import Message
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.map_files.references import cut_references
from omninav.stages.metrics.causes import stretches
from omninav.stages.metrics.stretches import logs_of
from omninav.stages.recordings.opening import open_recording
from omninav.stages.tools.explain import columns_of_run

Pixels = npt.NDArray[np.uint8]
WINDOW = (0.5, 0.65)
"""Part of a drive in which something is wrong."""


def within(change: Change, seconds: float) -> Change:
    """A change of the messages in the window of a drive that takes so long."""
    first, last = (share * seconds for share in WINDOW)
    return lambda message, at: change(message, at) if first <= at < last else message


def driven(factor: float, seconds: float) -> Change:
    """Odometry that measures so many times the motion in the window of a drive, and goes on from where that leads."""
    before, said = [np.zeros(3)], [np.zeros(3)]

    def change(message: Message, at: float) -> Message:
        if message.topic != ODOMETRY:
            return message
        pose = message.content.pose.pose
        turned = pose.orientation
        row = np.array((pose.position.x, pose.position.y, 2.0 * math.atan2(turned.z, turned.w)))
        step = between(before[0], row) * (factor if WINDOW[0] * seconds <= at < WINDOW[1] * seconds else 1.0)
        before[0], said[0] = row, compose(said[0], step)
        pose.position.x, pose.position.y, heading = (float(value) for value in said[0])
        turned.z, turned.w = math.sin(heading / 2.0), math.cos(heading / 2.0)
        return message

    return change


def dimmed(gain: float) -> Callable[[Pixels], Pixels]:
    """Images in so much of their light, with the noise of a camera."""

    def of(pixels: Pixels) -> Pixels:
        noisy = pixels * gain + RANDOM.normal(0.0, 2.0, pixels.shape)
        return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)

    return of


def grey(pixels: Pixels) -> Pixels:
    """A lens that is covered."""
    return np.asarray(np.full(pixels.shape, 128) + RANDOM.integers(0, 3, pixels.shape), np.uint8)


def shrunk(pixels: Pixels) -> Pixels:
    """The image of another lens: shorter by two fifths."""
    rows, columns = pixels.shape[:2]
    about = cv2.getRotationMatrix2D(((columns - 1) / 2.0, (rows - 1) / 2.0), 0.0, 0.6)
    return np.asarray(cv2.warpAffine(pixels, about, (columns, rows)), np.uint8)


CHANGES: dict[str, tuple[str, Callable[[float], Change] | None]] = {
    "nothing": ("tracked", None),
    "lens covered": ("images without content", lambda seconds: within(images(grey), seconds)),
    "lamps off": ("dark images", lambda seconds: within(images(dimmed(0.02)), seconds)),
    "dim light": ("other light", lambda seconds: images(dimmed(0.08))),
    "odometry still": ("odometry stood still", lambda seconds: driven(0.0, seconds)),
    "odometry doubled": ("odometry slipped", lambda seconds: driven(2.0, seconds)),
    "camera turned": ("inputs that do not fit", lambda seconds: images(lambda pixels: turned(pixels, 60.0))),
    "shorter lens": ("few landmarks", lambda seconds: images(shrunk)),
}
"""Changed logs: the cause to be found, and the change of a drive that takes so many seconds."""


WHOLE = ("nothing", "dim light", "camera turned", "shorter lens", "other building")
"""Failures that last as long as the drive."""


def without_window(sound: Path, path: Path, truth: npt.NDArray[np.float64]) -> Path:
    """A map's file without the references within 4 m of where a drive (N, 3) is in its window."""
    map = omninav.load_map(sound)
    some = truth[int(WINDOW[0] * len(truth)) : int(WINDOW[1] * len(truth))]
    away = np.hypot(*(map.poses[:, None, :2] - some[None, :, :2]).transpose(2, 0, 1)).min(axis=1)
    write_artifact(path, cut_references(map, away > 4.0), read_header(sound)["facts"])
    return path


def failures(other: Path, tour: Path, drive: Path, folder: Path) -> dict[str, tuple[str, dict[str, Any]]]:
    """The cause of each failure of a drive, and the settings of a run that fails so."""
    recording = open_recording(str(drive))
    seconds, frames = float(np.ptp(recording.stamps)) / 1e9, len(recording.stamps)
    sound = learned_map(tour, folder)
    as_is = {"log": str(drive), "map": str(sound)}
    made: dict[str, tuple[str, dict[str, Any]]] = {}
    for name, (cause, change) in CHANGES.items():
        log = folder / f"{drive.stem}_{name.replace(' ', '_')}.mcap"
        if change is not None:
            changed_log(drive, log, change(seconds))
        made[name] = cause, as_is | ({} if change is None else {"log": str(log)})
    made["carried"] = "carried elsewhere", as_is | {"cuts": [[int(share * frames) for share in WINDOW]]}
    made["other building"] = "another place", as_is | {"map": str(learned_map(other, folder))}
    assert recording.truth is not None
    holed = without_window(sound, folder / f"{drive.stem}_holed.omap", recording.truth)
    made["off the map"] = "off the map", as_is | {"map": str(holed)}
    return made


def found_in(run: Any, name: str) -> str:
    """The cause of the longest stretch that touches the window of a run, or of all of it; `tracked`: there is none.

    The first images of a drive are no failure.
    """
    columns = columns_of_run(run)
    frames = int(columns["frame"][-1]) + 1
    first, last = (share * frames for share in ((0.0, 1.0) if name in WHOLE else WINDOW))
    if name == "carried":
        first, last = last - 1, last + frames / 10
    lengths: dict[str, int] = {}
    for each in stretches(logs_of(columns), 2.5):
        shared = min(each.last, last) - max(each.first, first) + 1
        if shared > 0 and each.cause != "first images":
            lengths[each.cause] = lengths.get(each.cause, 0) + int(shared)
    return max(lengths, key=lengths.__getitem__) if lengths else "tracked"


def print_table(found: list[tuple[str, str, str]]) -> None:
    """Print failures by name, each with its cause and what was found, as a table."""
    print("| what is wrong | cause to be found | runs | found | tracked | other |\n|---|---|---:|---:|---:|---|")
    for name, cause in dict.fromkeys((name, cause) for name, cause, _ in found):
        told = Counter(cause_found for other, _, cause_found in found if other == name)
        runs, right, tracked = told.total(), told.pop(cause, 0), told.pop("tracked", 0)
        others = ", ".join(f"{other} {number}" for other, number in told.items())
        print(f"| {name} | {cause} | {runs} | {right} | {tracked} | {others} |")


def main(folder: str, other: str, *pairs: str) -> None:
    """Run all failures of some tours and drives, with landmarks and without, and print what is found."""
    place, found = Path(folder), list[tuple[str, str, str]]()
    for tour, drive in zip(pairs[::2], pairs[1::2], strict=True):
        for name, (cause, settings) in failures(Path(other), Path(tour), Path(drive), place).items():
            for landmarks in ("sift", "none"):
                settings = settings | {"landmarks": landmarks, "runs": str(place / "runs"), "plots": "none"}
                run = omninav.run("omninav", progress=False, **settings)
                found.append((name, cause, found_in(run, name)))
    print_table(found)


if __name__ == "__main__":
    main(*sys.argv[1:])
