"""The ROS 2 messages of many ticks at once."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial

import numpy as np
import numpy.typing as npt

from omninav.pipeline import State
from omninav.pipeline.mcap.message_rows import MessageRows, row_bytes
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.plots.pose_messages import (
    BASE,
    MAP,
    ODOM,
    covariance_6x6,
    header,
    path_bytes,
    pose_messages,
    set_heading,
    set_poses,
    set_stamps,
    transform,
)
from omninav.stages.values.drive import known

from .markers import AXIS_M, GREEN, LINES, PINK, POINTS, Colour, axis_ends, homing_arrow, opacity, weighted_points
from .show_tick import ROW, ShownTick

PATH_POSES = 500
"""Most poses in the path so far; of a longer one every second, every fourth, … is shown."""
PATH_TICKS = 16
"""Ticks between two messages of the path so far; a power of two, as between views."""
SHAPES = 256
"""Shapes of messages that are remembered."""
MARKERS = "visualization_msgs/msg/MarkerArray"
ORDER = (
    "/grid", "/map", "/tf", "/odom", "/ground_truth/pose", "/estimate/pose", "/estimate/path", "/estimate/confidence",
    "/estimate/state", "/belief/markers", "/belief", "/similarity/best", "/similarity", "/panorama/compressed",
    "/plan", "/homing", "/command",
)  # fmt: skip
"""Topics in the order in which a tick's messages are written."""

Rows = npt.NDArray[np.void]


class PathSoFar(State):
    """State that later messages need of earlier ticks: `odometry` (3,) since the log's start; `correction` (3,) from
    map to odometry, and whether it is `anchored`; the `path` so far (N, 3) with its `stamps` (N,), every `stride`-th
    tick's; the `ticks` so far.
    """

    odometry: Array = field(default_factory=lambda: np.zeros(3))
    correction: Array = field(default_factory=lambda: np.zeros(3))
    anchored: bool = False
    path: list[tuple[float, float, float]] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    stride: int = 1
    ticks: int = 0


@dataclass
class TopicMessages:
    """The messages of one topic in some ticks. `ticks`: the numbers of those that have one. `encode` gives their CDR
    bytes, in that order."""

    topic: str
    msgtype: str
    ticks: Sequence[int]
    encode: Callable[[], list[bytes]]


def tick_messages(ticks: Sequence[ShownTick], before: PathSoFar, views_every: int = 1) -> list[TopicMessages]:
    """Messages of ticks in a row, topic by topic, in the order in which a tick's are written (see `ResultMessages`).

    The transform from `map` to `odom` is the estimate less odometry; without any estimate the first true pose is taken.
    With `views_every` a path so far comes at one of that many ticks at most.
    """
    if not ticks:
        return []
    block = _Block(ticks, before, max(PATH_TICKS, views_every))
    rows, estimated = block.rows, known(block.rows["estimate"])
    everywhere = np.ones(len(ticks), np.bool_)
    path = np.isin(np.arange(len(ticks)), list(block.paths))
    rated, compared = ~np.isnan(rows["confidence"]), ~np.isnan(rows["best_similarity"])

    def has(field_name: str) -> Bools:
        return np.array([getattr(shown, field_name) is not None for shown in ticks])

    topics: list[tuple[str, str, Bools, Callable[[Ints], list[bytes]]]] = [
        ("/tf", "tf2_msgs/msg/TFMessage", everywhere, block.transforms),
        ("/odom", "nav_msgs/msg/Odometry", everywhere, block.odometries),
        ("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", known(rows["truth"]), block.true_poses),
        ("/estimate/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", estimated, block.estimates),
        ("/estimate/path", "nav_msgs/msg/Path", path, block.paths_so_far),
        ("/estimate/confidence", "std_msgs/msg/Float64", rated, block.numbers("confidence")),
        ("/belief/markers", MARKERS, has("weights"), block.belief_markers),
        ("/belief", "geometry_msgs/msg/PoseArray", has("belief"), block.beliefs),
        ("/similarity/best", "std_msgs/msg/Float64", compared, block.numbers("best_similarity")),
        ("/similarity", MARKERS, has("similar"), block.similar_references),
        ("/panorama/compressed", "sensor_msgs/msg/CompressedImage", has("jpeg"), block.panoramas),
        ("/homing", MARKERS, known(rows["homing"]), block.homing_arrows),
        ("/command", "geometry_msgs/msg/TwistStamped", known(rows["command"]), block.commands),
    ]
    made = [
        TopicMessages(topic, msgtype, (at := np.flatnonzero(where)).tolist(), partial(encode, at))
        for topic, msgtype, where, encode in topics
        if where.any()
    ]
    return sorted([*made, *_seldom(ticks)], key=lambda messages: ORDER.index(messages.topic))


def by_tick(messages: Sequence[TopicMessages], number: int) -> list[list[tuple[str, str, bytes]]]:
    """Topic, type and bytes of each message of a number of ticks, tick by tick."""
    ticks: list[list[tuple[str, str, bytes]]] = [[] for _ in range(number)]
    for each in messages:
        for n, data in zip(each.ticks, each.encode(), strict=True):
            ticks[n].append((each.topic, each.msgtype, data))
    return ticks


def _seldom(ticks: Sequence[ShownTick]) -> Iterator[TopicMessages]:
    found: dict[tuple[str, str], dict[int, bytes]] = {}
    for n, shown in enumerate(ticks):
        if shown.made is not None:
            for topic, msgtype, data in zip(shown.made.topics, shown.made.types, shown.made.data, strict=True):
                found.setdefault((topic, msgtype), {})[n] = data
    for (topic, msgtype), data_of in found.items():
        yield TopicMessages(topic, msgtype, list(data_of), partial(list, data_of.values()))


class _Block:
    """Ticks in a row, their numbers in columns, and the messages of each topic at some of them."""

    def __init__(self, ticks: Sequence[ShownTick], before: PathSoFar, path_ticks: int) -> None:
        self.ticks = ticks
        self.stamps = np.array([shown.tick.stamp for shown in ticks], np.int64)
        self.rows: Rows = np.stack([shown.numbers for shown in ticks]).view(ROW)[:, 0]
        self.odometry, self.correction = np.empty((len(ticks), 3)), np.empty((len(ticks), 3))
        self.paths: dict[int, tuple[Array, Array]] = {}
        estimated, true = known(self.rows["estimate"]), known(self.rows["truth"])
        moved = known(self.rows["motion"])
        for n, shown in enumerate(ticks):
            row = self.rows[n]
            if shown.tick.first_of_log:
                before.odometry, before.correction, before.anchored = np.zeros(3), np.zeros(3), False
                before.path, before.stamps, before.stride = [], [], 1
            elif moved[n]:
                before.odometry = compose(before.odometry, row["motion"])
            if estimated[n] or (true[n] and not before.anchored):
                at = row["estimate" if estimated[n] else "truth"]
                before.correction, before.anchored = compose(at, between(before.odometry, np.zeros(3))), True
            self.odometry[n], self.correction[n] = before.odometry, before.correction
            if estimated[n] and shown.tick.frame % before.stride == 0:
                before.path.append(tuple(row["estimate"].tolist()))
                before.stamps.append(shown.tick.stamp)
                if len(before.path) > PATH_POSES:
                    before.path, before.stamps, before.stride = before.path[::2], before.stamps[::2], 2 * before.stride
            if before.path and before.ticks and before.ticks % path_ticks == 0:
                self.paths[n] = np.array(before.stamps), np.array(before.path)
            before.ticks += 1

    def _made(self, of_kind: MessageRows, at: Ints) -> Rows:
        rows = of_kind.rows(len(at))
        if "header" in (rows.dtype.names or ()):
            set_stamps(rows["header"], self.stamps[at])
        return rows

    def transforms(self, at: Ints) -> list[bytes]:
        rows = _transforms().rows(len(at))
        items = rows["transforms"]
        for item, poses in ((items["first"], self.correction[at]), (items["rest"][:, 0], self.odometry[at])):
            set_stamps(item["header"], self.stamps[at])
            place = item["transform"]
            place["translation"]["x"], place["translation"]["y"] = poses[:, 0], poses[:, 1]
            set_heading(place["rotation"], poses[:, 2])
        return row_bytes(rows)

    def odometries(self, at: Ints) -> list[bytes]:
        rows = self._made(_plain("nav_msgs/msg/Odometry", ODOM, child_frame_id=BASE), at)
        set_poses(rows["pose"]["pose"], self.odometry[at])
        return row_bytes(rows)

    def true_poses(self, at: Ints) -> list[bytes]:
        rows = self._made(_plain("geometry_msgs/msg/PoseStamped", MAP), at)
        set_poses(rows["pose"], self.rows["truth"][at])
        return row_bytes(rows)

    def estimates(self, at: Ints) -> list[bytes]:
        rows = self._made(_plain("geometry_msgs/msg/PoseWithCovarianceStamped", MAP), at)
        set_poses(rows["pose"]["pose"], self.rows["estimate"][at])
        rows["pose"]["covariance"] = covariance_6x6(self.rows["covariance"][at])
        return row_bytes(rows)

    def paths_so_far(self, at: Ints) -> list[bytes]:
        return [path_bytes(*self.paths[n], int(self.stamps[n])) for n in at.tolist()]

    def numbers(self, name: str) -> Callable[[Ints], list[bytes]]:
        def encode(at: Ints) -> list[bytes]:
            rows = _plain("std_msgs/msg/Float64").rows(len(at))
            rows["data"] = self.rows[name][at]
            return row_bytes(rows)

        return encode

    def beliefs(self, at: Ints) -> list[bytes]:
        def encode(poses: Array, at: Ints) -> list[bytes]:
            rows = self._made(_pose_array(poses.shape[1]), at)
            if poses.size:
                set_poses(rows["poses"], poses)
            return row_bytes(rows)

        return _equally_long(at, [self.ticks[n].belief for n in at.tolist()], encode)

    def belief_markers(self, at: Ints) -> list[bytes]:
        points, marks = [], ("belief", PINK, 0.35, POINTS)
        for n in at.tolist():
            shown = self.ticks[n]
            assert shown.belief is not None
            assert shown.weights is not None
            if shown.covariances is None:
                points.append(np.column_stack([shown.belief[:, :2], shown.weights]))
            else:
                ends = axis_ends(shown.belief, shown.covariances)
                points.append(np.column_stack([ends, np.repeat(shown.weights, 4)]))
                marks = "belief", PINK, AXIS_M, LINES
        return _equally_long(at, points, partial(self._points, marks))

    def similar_references(self, at: Ints) -> list[bytes]:
        marks = "similarity", GREEN, 0.2, POINTS
        return _equally_long(at, [self.ticks[n].similar for n in at.tolist()], partial(self._points, marks))

    def _points(self, marks: tuple[str, Colour, float, int], points: Array, at: Ints) -> list[bytes]:
        """Markers of points (ticks, M, 3), x, y and weight; `marks`: their namespace, colour, size (m) and type."""
        rows = _weighted(points.shape[1], *marks).rows(len(at))
        markers = rows["markers"][:, 0]
        set_stamps(markers["header"], self.stamps[at])
        if points.shape[1]:
            markers["points"]["x"], markers["points"]["y"] = points[..., 0], points[..., 1]
            markers["colors"]["a"] = opacity(points[..., 2])
        return row_bytes(rows)

    def panoramas(self, at: Ints) -> list[bytes]:
        heads = row_bytes(self._made(_plain("sensor_msgs/msg/CompressedImage", BASE, format="jpeg"), at))
        images = (self.ticks[n].jpeg or b"" for n in at.tolist())
        return [
            b"".join((head[:-4], len(image).to_bytes(4, "little"), image))
            for head, image in zip(heads, images, strict=True)
        ]

    def homing_arrows(self, at: Ints) -> list[bytes]:
        rows = _arrow().rows(len(at))
        arrows, homing = rows["markers"][:, 0], self.rows["homing"][at]
        set_stamps(arrows["header"], self.stamps[at])
        set_heading(arrows["pose"]["orientation"], homing[:, 0])
        arrows["scale"]["x"] = homing[:, 1]
        return row_bytes(rows)

    def commands(self, at: Ints) -> list[bytes]:
        rows = self._made(_plain("geometry_msgs/msg/TwistStamped", BASE), at)
        rows["twist"]["linear"]["x"], rows["twist"]["angular"]["z"] = self.rows["command"][at].T
        return row_bytes(rows)


def _equally_long(
    at: Ints, arrays: Sequence[Array | None], encode: Callable[[Array, Ints], list[bytes]]
) -> list[bytes]:
    """The messages of arrays, one each, encoded together where they are equally long."""
    lengths = np.array([0 if array is None else len(array) for array in arrays])
    found: dict[int, bytes] = {}
    for length in np.unique(lengths).tolist():
        some = np.flatnonzero(lengths == length)
        together = np.stack([arrays[n] for n in some.tolist()])  # type: ignore[misc]
        found.update(zip(some.tolist(), encode(together, at[some]), strict=True))
    return [found[n] for n in range(len(arrays))]


@cache
def _plain(msgtype: str, frame: str = "", **texts: str) -> MessageRows:
    return MessageRows(msgtype, ({"header": header(0, frame)} if frame else {}) | texts)


@cache
def _transforms() -> MessageRows:
    frames = [transform(0, MAP, ODOM, np.zeros(3)), transform(0, ODOM, BASE, np.zeros(3))]
    return MessageRows("tf2_msgs/msg/TFMessage", {"transforms": frames})


@cache
def _arrow() -> MessageRows:
    return MessageRows(MARKERS, {"markers": [homing_arrow(0, 0.0, 1.0)]})


@lru_cache(SHAPES)
def _pose_array(number: int) -> MessageRows:
    poses = pose_messages(np.zeros((number, 3)))
    return MessageRows("geometry_msgs/msg/PoseArray", {"header": header(0), "poses": poses})


@lru_cache(SHAPES)
def _weighted(number: int, namespace: str, colour: Colour, size: float, kind: int) -> MessageRows:
    shown = weighted_points(0, namespace, colour, size, np.zeros((number, 2)), np.zeros(number), kind)
    return MessageRows(MARKERS, {"markers": [shown]})
