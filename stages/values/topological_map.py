"""A map of places and the ways between them, made of pictures alone."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, RowsOf, Shape, Starts, Value
from omninav.stages.geometry.arrays import Array, Bools, Bytes, Floats, Ints

from .local_features import NO_SEGMENTS, GlobalDescriptor, LocalFeatures, VerticalSegments
from .pose import PoseSource

Small = npt.NDArray[np.int16]

ANGLE = math.pi / 32768.0
"""Radians of one step of a stored angle: 0.0055 degrees."""
DRIVEN, LOOP = 0, 1
"""Kinds of links: as the tour went; between two places that were found to be one."""


class StoredViews(Value):
    """Compact views: for each its patches, its columns and its colours. No pixel of any picture.

    Of view v the patches are rows `starts[v]` to `starts[v + 1]`: `directions` (F, 2) int16, azimuth and elevation in
    steps of `ANGLE`; `descriptors` (F, D) uint8; `colours` (F, 3) int8, in 127ths; `sizes` (F,) uint8, pixels. Its
    columns are rows `column_starts[v]` to `column_starts[v + 1]`: `column_directions` (C, 3) int16, azimuth, upper and
    lower end; `column_descriptors` (C, 10) float16; `column_weights` (C,) uint8. `moments` (V, 3): colours of it all.
    """

    starts: Annotated[Ints, Shape("V+1"), Starts("F")]
    directions: Annotated[Small, Shape("F", 2)]
    descriptors: Annotated[Bytes, Shape("F", "D")]
    colours: Annotated[npt.NDArray[np.int8], Shape("F", 3)]
    sizes: Annotated[Bytes, Shape("F")]
    column_starts: Annotated[Ints, Shape("V+1"), Starts("C")]
    column_directions: Annotated[Small, Shape("C", 3)]
    column_descriptors: Annotated[npt.NDArray[np.float16], Shape("C", 10)]
    column_weights: Annotated[Bytes, Shape("C")]
    moments: Annotated[Floats, Shape("V", 3)]

    def __len__(self) -> int:
        return len(self.starts) - 1

    def features(self, view: int) -> LocalFeatures:
        """The patches and columns of a view; their points in a picture are not known any more (NaN)."""
        rows = slice(int(self.starts[view]), int(self.starts[view + 1]))
        azimuth, elevation = (self.directions[rows].astype(np.float64) * ANGLE).T
        level = np.cos(elevation)
        bearings = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
        return LocalFeatures(
            bearings,
            np.full((len(bearings), 2), np.nan),
            self.descriptors[rows],
            self.colours[rows].astype(np.float32) / np.float32(127.0),
            self.sizes[rows].astype(np.float32),
            self._columns(view),
        )

    def _columns(self, view: int) -> VerticalSegments | None:
        """The columns of a view; None where it has none, as in a map that was made without."""
        rows = slice(int(self.column_starts[view]), int(self.column_starts[view + 1]))
        angles = self.column_directions[rows].astype(np.float64) * ANGLE
        if not len(angles):
            return None
        return VerticalSegments(
            angles[:, 0],
            angles[:, 1:],
            self.column_descriptors[rows].astype(np.float32),
            self.column_weights[rows].astype(np.float32),
            np.full((len(angles), 2, 2), np.nan),
        )

    def global_moments(self, view: int) -> GlobalDescriptor:
        """The colours of a view as a whole."""
        return GlobalDescriptor(self.moments[view])


def stored(features: list[LocalFeatures], moments: list[GlobalDescriptor]) -> StoredViews:
    """Views made small; one entry of each list per view."""
    columns = [NO_SEGMENTS if each.columns is None else each.columns for each in features]
    bearings = np.concatenate([np.empty((0, 3)), *(f.bearings for f in features)])
    azimuths = np.arctan2(bearings[:, 1], bearings[:, 0])
    elevations = np.arcsin(np.clip(bearings[:, 2], -1.0, 1.0))
    sides = [np.column_stack([c.azimuths, c.elevations]) for c in columns]
    descriptors = [f.descriptors for f in features if len(f)] or [np.empty((0, 128), np.uint8)]
    return StoredViews(
        starts=np.cumsum([0, *(len(f) for f in features)], dtype=np.int64),
        directions=_steps(np.column_stack([azimuths, elevations])),
        descriptors=np.concatenate(descriptors),
        colours=np.round(127.0 * _joined([f.colours for f in features], 3)).astype(np.int8),
        sizes=np.clip(np.round(_joined([f.sizes[:, None] for f in features], 1)[:, 0]), 1, 255).astype(np.uint8),
        column_starts=np.cumsum([0, *(len(c) for c in columns)], dtype=np.int64),
        column_directions=_steps(_joined(sides, 3)),
        column_descriptors=_joined([c.descriptors for c in columns], 10).astype(np.float16),
        column_weights=np.clip(_joined([c.weights[:, None] for c in columns], 1)[:, 0], 0, 255).astype(np.uint8),
        moments=np.stack([m.values for m in moments]) if moments else np.empty((0, 3), np.float32),
    )


def _joined(parts: Sequence[npt.NDArray[np.floating]], width: int) -> npt.NDArray[np.floating]:
    return np.concatenate([np.empty((0, width), np.float32), *parts])


def _steps(angles: npt.NDArray[np.floating]) -> Small:
    steps = np.round(angles / ANGLE).astype(np.int64)
    return ((steps + 32768) % 65536 - 32768).astype(np.int16)


class TopologicalMap(Value):
    """Places and the ways between them (Goedeme et al. 2007, section 4).

    `views`: the medoid of each place, and path images on the ways between. `places` (P,): each place's medoid, a view.
    `owner` (V,): the place that each view belongs to. `names` (P,): names of places, "" for none.
    `links` (L, 2): neighbouring places, in the order in which they were driven through. `kinds` (L,): DRIVEN or LOOP.
    `ways`: the path images of link l, rows `way_starts[l]` to `way_starts[l + 1]`, are views in the order from the
    first to the second place, both medoids excluded: driven one after the other they lead there.
    `frames` (V,): numbers of the views' pictures, counted on from tour to tour; `orders` (V,): among those that took
    part, with a gap from tour to tour. `poses` (V, 3): x, y (m), heading (rad) where they were taken, from
    `pose_source`: for scoring and drawing only. `spread`: by which the sensor model scales visual distances, as
    measured on the tour (`TopologicalMapping.spread`).
    """

    views: Annotated[StoredViews, Shape("V")]
    places: Annotated[Ints, Shape("P"), RowsOf("V")]
    owner: Annotated[Ints, Shape("V"), RowsOf("P")]
    names: Annotated[tuple[str, ...], Shape("P")]
    links: Annotated[Ints, Shape("L", 2), RowsOf("P")]
    kinds: Annotated[npt.NDArray[np.int8], Shape("L"), Bounds(ge=DRIVEN, le=LOOP)]
    way_starts: Annotated[Ints, Shape("L+1"), Starts("W")]
    ways: Annotated[Ints, Shape("W"), RowsOf("V")]
    frames: Annotated[Ints, Shape("V")]
    orders: Annotated[Ints, Shape("V")]
    poses: Annotated[Array, Shape("V", 3)]
    pose_source: PoseSource
    spread: Annotated[float, Bounds(ge=0)]

    def __len__(self) -> int:
        return len(self.places)

    def nearest_places(self, spots: Array) -> Ints:
        """Places (N,) whose medoids were taken closest to spots (N, 2 or more) in the frame of `poses`, m."""
        gaps = spots[:, None, :2] - self.poses[self.places][None, :, :2]
        return np.asarray(np.hypot(gaps[..., 0], gaps[..., 1]).argmin(axis=1), np.int64)

    def path_of(self, link: int) -> Ints:
        """The path images of a link, from its first place to its second: views."""
        return self.ways[self.way_starts[link] : self.way_starts[link + 1]]

    def whole_way(self, link: int) -> Ints:
        """The views of a link: the medoid of its first place, its path images, and the medoid of its second place."""
        first, second = self.places[self.links[link]]
        return np.array([first, *self.path_of(link), second], np.int64)

    def link(self, one: int, other: int) -> int | None:
        """The link between two places, in whichever order it was driven; None where there is none."""
        found = np.flatnonzero((np.sort(self.links, axis=1) == sorted((one, other))).all(axis=1))
        return int(found[0]) if len(found) else None

    def views_along(self, places: Ints) -> tuple[Ints, Ints]:
        """The views to drive to along a way (V,), and how many of them have been driven to at each of its places (K,).

        From the medoid of the first of `places` (K,) to that of the last; each must be linked with the next.
        """
        views = [int(self.places[place]) for place in places[:1]]
        ends = [len(views)] * len(views)
        for one, other in pairwise(places.tolist()):
            link = self.link(one, other)
            assert link is not None, f"places {one} and {other} are not linked"
            way: list[int] = self.whole_way(link).tolist()
            views += (way if int(self.links[link, 0]) == one else way[::-1])[1:]
            ends.append(len(views))
        return np.array(views, np.int64), np.array(ends, np.int64)

    def named(self, name: str) -> Ints:
        """The places of a name."""
        return np.array([place for place, own in enumerate(self.names) if own == name], np.int64)


class LoopHypotheses(Value):
    """Origin of a map: the tour's pictures, what they were identified as, and which of them were thought the same.

    `poses` (N, 3): of all pictures, from the map's `pose_source`. `cluster`, `subcluster` and `place` (N,): what each
    belongs to, subclusters numbered along the drive. `tour` (N,): which tour it is from. `pairs` (H, 2): the pictures
    that represent the two subclusters of each hypothesis. `distances` (H,): their visual ones. `initial` and `masses`
    (H, 3): for, against and unknown, before and after the evidence of neighbours. `accepted` (H,).
    """

    poses: Array
    cluster: Ints
    subcluster: Ints
    place: Ints
    tour: Ints
    pairs: Ints
    distances: Array
    initial: Array
    masses: Array
    accepted: Bools
    pose_source: PoseSource
