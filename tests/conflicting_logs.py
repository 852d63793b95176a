"""Logs whose inputs do not fit each other, each made from a sound one: what is wrong, and what must be said of it.

python tests/conflicting_logs.py TOUR DRIVE FOLDER [OTHER_TOUR]    # whole runs: the table of docs/conflicts.md
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

import omninav
from omninav.pipeline import Context
from omninav.pipeline.engine.artifact import read_header, write_artifact
from omninav.pipeline.mcap.message import Message
from omninav.pipeline.mcap.message_types import make_message
from omninav.pipeline.mcap.reader import LogReader
from omninav.pipeline.mcap.writer import written_log
from omninav.stages.features.grey_strip import GreyStrip
from omninav.stages.features.hsv_histogram import HsvHistogram
from omninav.stages.mapping.reference_graph import LearnReferenceGraph, LearnReferenceGraphState
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.monitor.input_conflicts import InputConflicts, InputConflictsState
from omninav.stages.monitor.map_check import CheckMap
from omninav.stages.sensor.appearance_length_scale import AppearanceLengthScale
from omninav.stages.source.log import LogSource
from omninav.stages.source.playback import PlaybackState
from omninav.stages.unwarp.panorama import UnwarpPanorama
from omninav.stages.values.maps import ReferenceGraph

Array = npt.NDArray[np.float64]
IMAGE, ODOMETRY, TRUTH = "/camera/image/compressed", "/odom", "/ground_truth/pose"
SECOND = 1_000_000_000

Change = Callable[[Message, float], Message | None]
"""Takes a message and when it came, in seconds from the first one, and gives what is written in its place."""


class Case(NamedTuple):
    """One thing that is wrong with a drive (`change`), or with the `poses` (R, 3) of the map, and words of what is said
    of it."""

    change: Change
    said: str
    poses: Callable[[Array], Any] | None = None


def changed_log(log: Path, path: Path, change: Change) -> Path:
    """Write a log with all its attachments and messages anew, without truth where it is a drive's."""
    reader = LogReader(log)
    messages = list(reader.messages())
    first = min(message.stamp for message in messages)
    with written_log(path) as writer:
        for name, data in reader.attachments.items():
            writer.attach(name, data)
        for message in messages:
            made = change(message, (message.stamp - first) / SECOND)
            if made is not None:
                header = made.content.header
                header.stamp.sec, header.stamp.nanosec = divmod(made.stamp, SECOND)
                writer.write(made.topic, made.msgtype, made.stamp, made.content, made.log_time)
    return path


def odometry(of: Callable[[Array], Any]) -> Change:
    """Poses (3,) of odometry become others: x, y (m), heading (rad)."""

    def change(message: Message, seconds: float) -> Message:
        if message.topic != ODOMETRY:
            return message
        pose = message.content.pose.pose
        turned = pose.orientation
        row = np.array((pose.position.x, pose.position.y, 2.0 * math.atan2(turned.z, turned.w)))
        pose.position.x, pose.position.y, heading = (float(value) for value in of(row))
        turned.z, turned.w = math.sin(heading / 2.0), math.cos(heading / 2.0)
        return message

    return change


def images(of: Callable[[npt.NDArray[np.uint8]], npt.NDArray[np.uint8]]) -> Change:
    """Images (rows, columns, 3) become others."""

    def change(message: Message, seconds: float) -> Message:
        if message.topic != IMAGE:
            return message
        pixels = cv2.imdecode(np.frombuffer(bytes(message.content.data), np.uint8), cv2.IMREAD_COLOR)
        data = cv2.imencode(".jpg", np.ascontiguousarray(of(pixels)), [cv2.IMWRITE_JPEG_QUALITY, 90])[1]
        content = make_message(message.msgtype, {"format": "jpeg", "data": data.tobytes()}, message.stamp)
        return replace(message, content=content)

    return change


def stamps(of: Callable[[Message, float], int]) -> Change:
    """Stamps (ns) become others, and log times with them."""

    def change(message: Message, seconds: float) -> Message:
        moved = of(message, seconds) - message.stamp
        return replace(message, stamp=message.stamp + moved, log_time=message.log_time + moved)

    return change


def late(by_s: float) -> Change:
    """Images are stamped so much later than they were taken."""
    return stamps(lambda message, seconds: message.stamp + round(by_s * SECOND) * (message.topic == IMAGE))


def leaping(by_s: int) -> Change:
    """The clock leaps in the middle of a drive of a minute."""
    return stamps(lambda message, seconds: message.stamp + by_s * SECOND * (seconds > 25.0))


def frozen(after_s: float) -> Change:
    """The first image after so long is given again and again."""
    kept: list[bytes] = []

    def change(message: Message, seconds: float) -> Message:
        if message.topic != IMAGE or seconds < after_s:
            return message
        kept.append(bytes(message.content.data))
        content = make_message(message.msgtype, {"format": "jpeg", "data": kept[0]}, message.stamp)
        return replace(message, content=content)

    return change


def of_another(log: Path) -> Change:
    """Poses of odometry become those of another drive, one by one."""
    others = (message.content.pose for message in LogReader(log).messages() if message.topic == ODOMETRY)

    def change(message: Message, seconds: float) -> Message | None:
        if message.topic != ODOMETRY:
            return message
        message.content.pose = next(others, None)
        return None if message.content.pose is None else message

    return change


def w_first(message: Message, seconds: float) -> Message:
    """A quaternion w, x, y, z where x, y, z, w is read."""
    if message.topic == ODOMETRY:
        turned = message.content.pose.pose.orientation
        turned.x, turned.y, turned.z, turned.w = turned.w, turned.x, turned.y, turned.z
    return message


def upside_down(message: Message, seconds: float) -> Message:
    """An orientation whose roll is half a turn: the same heading."""
    if message.topic == ODOMETRY:
        turned = message.content.pose.pose.orientation
        turned.x, turned.y, turned.z, turned.w = turned.w, turned.z, 0.0, 0.0
    return message


def turned(pixels: npt.NDArray[np.uint8], degrees: float) -> npt.NDArray[np.uint8]:
    """A mirror's image (rows, columns, 3), turned about its middle."""
    rows, columns = pixels.shape[:2]
    about = cv2.getRotationMatrix2D(((columns - 1) / 2.0, (rows - 1) / 2.0), degrees, 1.0)
    return np.asarray(cv2.warpAffine(pixels, about, (columns, rows)), np.uint8)


def carried(poses: Array) -> Array:
    """Two of the map's poses lie 1000 km away."""
    return np.concatenate([poses[:10], poses[10:12] + np.array((1e6, 0.0, 0.0)), poses[12:]])


def without_truth(change: Change) -> Change:
    """The same for a drive, whose truth nobody knows."""
    return lambda message, seconds: None if message.topic == TRUTH else change(message, seconds)


def as_is(message: Message, seconds: float) -> Message:
    """Nothing is wrong."""
    return message


RANDOM = np.random.default_rng(0)
CASES: Mapping[str, Case] = {
    "camera frozen": Case(frozen(10.0), "the camera is frozen"),
    "images mirrored": Case(images(lambda p: p[:, ::-1]), "the images turn against odometry's turns"),
    "images upside down": Case(images(lambda p: p[::-1]), "the images turn against odometry's turns"),
    "images turned by 180°": Case(images(lambda p: p[::-1, ::-1]), "the camera looks"),
    "camera's yaw off by 90°": Case(images(lambda p: turned(p, 90.0)), "the camera looks"),
    "camera's yaw off by 25°": Case(images(lambda p: turned(p, 25.0)), "the camera looks"),
    "grey images": Case(
        images(lambda p: np.full(p.shape, 128, np.uint8) + RANDOM.integers(0, 6, p.shape, np.uint8)),
        "nothing in common",
    ),
    "noise": Case(images(lambda p: RANDOM.integers(0, 256, p.shape, np.uint8)), "nothing in common"),
    "odometry still": Case(odometry(lambda pose: (0.0, 0.0, 0.0)), "odometry stands still"),
    "odometry in feet": Case(odometry(lambda pose: pose * (3.28, 3.28, 1.0)), "times as long"),
    "heading in degrees": Case(odometry(lambda pose: (*pose[:2], math.degrees(pose[2]))), "unit of its heading"),
    "turns reversed": Case(odometry(lambda pose: pose * (1, 1, -1)), "the images turn against odometry's turns"),
    "left and right": Case(odometry(lambda pose: pose * (1, -1, -1)), "the images turn against odometry's turns"),
    "y negative": Case(odometry(lambda pose: pose * (1, -1, 1)), "once that is mirrored"),
    "x and y swapped": Case(odometry(lambda pose: pose[[1, 0, 2]]), "once that is mirrored"),
    "odometry x 1.4": Case(odometry(lambda pose: pose * (1.4, 1.4, 1)), "times as long"),
    "odometry x 2": Case(odometry(lambda pose: pose * (2, 2, 1)), "times as long"),
    "odometry x 0.1": Case(odometry(lambda pose: pose * (0.1, 0.1, 1)), "times as long"),
    "heading always 0": Case(odometry(lambda pose: pose * (1, 1, 0)), "heading does not change"),
    "quaternion w first": Case(w_first, "heading does not change"),
    "heading off by 90°": Case(odometry(lambda pose: pose + np.array((0, 0, math.pi / 2))), "the camera looks"),
    "heading off by 180°": Case(odometry(lambda pose: pose + np.array((0, 0, math.pi))), "the camera looks"),
    "images 0.35 s late": Case(late(0.35), "s after odometry measures them"),
    "images 0.5 s late": Case(late(0.5), "s after odometry measures them"),
    "images 0.5 s early": Case(late(-0.5), "s before odometry measures them"),
    "images 3 s late": Case(late(3.0), "s after odometry measures them"),
    "clock set back by 1000 s": Case(leaping(-1000), "was set back by"),
    "clock leaps by 600 s": Case(leaping(600), "the clock leaps by 600 s"),
    "clock of 1970 until it is set": Case(
        stamps(lambda message, seconds: message.stamp - 1_767_225_600 * SECOND * (seconds < 25.0)),
        "no image for 490896.0 h after image 24",
    ),
    "map in mm": Case(as_is, "m apart, one after the other", lambda poses: poses * (1e3, 1e3, 1)),
    "map x 2": Case(as_is, "times as long", lambda poses: poses * (2, 2, 1)),
    "map mirrored": Case(as_is, "headings turn against its images", lambda poses: poses * (1, -1, -1)),
    "map's y negative": Case(as_is, "once that is mirrored", lambda poses: poses * (1, -1, 1)),
    "map shuffled": Case(as_is, "do not fit its images", np.random.default_rng(0).permutation),
    "map: all poses the same": Case(as_is, "at one place", lambda poses: np.tile(poses[0], (len(poses), 1))),
    "map: two 1000 km apart": Case(as_is, "m from its middle", carried),
}
AT_TWO_HERTZ = ("images 0.35 s late", "images 0.5 s late", "images 0.5 s early", "images 3 s late")
"""Cases that are noticed where images come so often."""
UNNOTICED: Mapping[str, Change] = {
    "red and blue exchanged": images(lambda p: p[..., ::-1]),
    "half of the image black": images(
        lambda p: p * (np.arange(p.shape[1]) > p.shape[1] // 2)[:, None].astype(np.uint8)
    ),
    "image centre off by 60 pixels": images(lambda p: np.roll(p, 60, axis=1)),
    "odometry's roll 180°": upside_down,
}
"""Changes of which nothing is said, as best matches still follow odometry."""


class Found(NamedTuple):
    """After how many images of a drive what was said; 0: before the first."""

    images: int
    sentence: str


def learned(tour: str) -> ReferenceGraph:
    """A map from a tour, as `omninav` learns it."""
    ctx, learn = Context("map"), LearnReferenceGraph()
    describe, map, state = HsvHistogram(grey_world="local"), None, LearnReferenceGraphState()
    unwarp = UnwarpPanorama()
    unwarp.setup(ctx)
    describe.setup(ctx)
    for out in ticks(LogSource(log=tour), ctx):
        features = describe.step(ctx, unwarp.step(ctx, out.image, out.camera).panorama).features
        map = learn.step(ctx, features, out.odometry, out.truth, map, state).map
    assert map is not None
    return map


def said(map: ReferenceGraph, drive: str) -> list[Found]:
    """What is said of a map and during a drive in it, by the stages that `omninav` takes."""
    ctx, matching = Context("conflicts"), Context("match")
    matching.read = frozenset({"similarities"})  # their calibration takes most of the time
    scale = AppearanceLengthScale().step(ctx, map).length_scale
    of_map = CheckMap().step(ctx, map).conflicts
    found = [Found(0, sentence) for sentence in ctx.warnings]
    describe, match, strip = HsvHistogram(grey_world="local"), SelectiveMatch(penalty="three_quarters"), GreyStrip()
    watch, state, unwarp = InputConflicts(), InputConflictsState(), UnwarpPanorama()
    unwarp.setup(ctx)
    describe.setup(ctx)
    for number, out in enumerate(ticks(LogSource(log=drive), ctx), 1):
        panorama = unwarp.step(ctx, out.image, out.camera).panorama
        features = describe.step(ctx, panorama=panorama).features
        watch.step(
            ctx, state, strip.step(ctx, panorama).strip, out.odometry, out.motion,
            match.step(matching, features, map).similarities, map, scale, of_map,
        )  # fmt: skip
        found += [Found(number, sentence) for sentence in ctx.warnings[len(found) :]]
    return found


def ticks(source: LogSource, ctx: Context) -> Iterator[Any]:
    """All that a source gives; `ctx` is at each tick."""
    source.setup(ctx)
    position = PlaybackState()
    while (out := source.step(ctx, position)) is not None:
        ctx.tick = out.tick
        yield out


def found(case: Case, map: ReferenceGraph, drive: Path, folder: Path) -> list[Found]:
    """What is said of a case: of a sound map and a sound drive, whose truth nobody knows."""
    log = changed_log(drive, folder / "drive.mcap", without_truth(case.change))
    poses = map.poses if case.poses is None else np.array(case.poses(map.poses), np.float64)
    return said(ReferenceGraph(poses, map.features[:], map.kind, map.edges, map.pose_source), str(log))


def of_whole_run(change: Change, map: Path, drive: Path, folder: Path) -> list[Found]:
    """What a whole run of `omninav` says of a changed drive: of its inputs, and of its log when that is opened."""
    log = changed_log(drive, folder / "drive.mcap", without_truth(change))
    run = omninav.run(
        "omninav", map=str(map), log=str(log), runs=str(folder), cache=str(folder / "cache"), plots="none",
        progress=False, record=["conflicts.conflicts"],
    )  # fmt: skip
    so_far = [each.sentences for each in run.values("conflicts.conflicts")]
    said = [
        Found(0 if sentence in so_far[0] else next(n for n, all in enumerate(so_far, 1) if sentence in all), sentence)
        for sentence in so_far[-1]
    ]
    return said + [Found(0, sentence) for sentence in run.manifest["warnings"] if sentence not in so_far[-1]]


def learned_map(tour: Path, folder: Path) -> Path:
    """The file of the map that `omninav` learns from a tour."""
    run = omninav.run("omninav", learn="map", log=str(tour), runs=str(folder), plots="none", progress=False)
    return run.folder / "map.omap"


def changed_map(sound: Path, path: Path, poses: Callable[[Array], Any]) -> Path:
    """A map's file with other poses."""
    map = omninav.load_map(sound)
    others = np.array(poses(map.poses), np.float64)
    changed = ReferenceGraph(others, map.features[:], map.kind, map.edges, map.pose_source)
    write_artifact(path, changed, read_header(sound)["facts"])
    return path


def print_table(tour: Path, drive: Path, folder: Path, other_tour: Path | None) -> None:
    """Print what whole runs say of each case, a row each."""
    sound = learned_map(tour, folder)
    rows: dict[str, tuple[Change, Path]] = {"nothing": (as_is, sound)}
    for name, case in CASES.items():
        poses, file = case.poses, folder / f"{len(rows)}.omap"
        rows[name] = case.change, sound if poses is None else changed_map(sound, file, poses)
    rows |= {name: (change, sound) for name, change in UNNOTICED.items()}
    rows["odometry in mm"] = odometry(lambda pose: pose * (1e3, 1e3, 1.0)), sound
    if other_tour is not None:
        rows["another building"] = as_is, learned_map(other_tour, folder)
    for name, (change, map) in rows.items():
        try:
            found = of_whole_run(change, map, drive, folder)
        except omninav.BadInput as refused:
            found = [Found(0, str(refused))]
        after = ", ".join(str(each.images) for each in found) or "never"
        print(f"| {name} | {after} | {'; '.join(each.sentence for each in found)} |", flush=True)


if __name__ == "__main__":
    import sys

    print_table(*map(Path, sys.argv[1:4]), Path(sys.argv[4]) if len(sys.argv) > 4 else None)
