"""Tracks the features of a local map from image to image."""

from dataclasses import field

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Bools, Bytes, Floats, Ints
from omninav.stages.values.homing import FOUND_AGAIN, LOST, MATCHED, TRACKED, LocalMap, TrackedFeatures
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.pose import Motion

from .camera_motion import camera_motion
from .image_tracking import HISTOGRAM_BINS, best_nearby, find_again, histograms, track, trackability
from .working_image import WorkingImage, working_image

EDGE_PX = 2.0
"""Points closer to the image's edge are not tracked."""
MAX_PIXELS = 76800
"""Pixels of the image that is tracked in, larger ones are made smaller: 320 x 240, the paper's size."""


class FeatureTrackerState(State):
    """The grey `image` before, and in it the tracked points of the local map `number`, one for each of its N features.

    `points` (N, 2) are tracked where `alive` (N,), are at `places` (N, 3) in the map, and have these `histograms`
    (N, 16) of intensities.
    """

    image: Bytes = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    number: int = -1
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))
    points: Array = field(default_factory=lambda: np.zeros((0, 2)))
    alive: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    histograms: Floats = field(default_factory=lambda: np.zeros((0, HISTOGRAM_BINS), np.float32))


class FeatureTracker(Stage):
    """Follows the most trackable point beside each feature of the local map, and finds lost ones again.

    Goedemé et al. 2007, sections 7.2.1 and 7.2.2. The local map is the one of the tick before. In the image of that
    tick, tracks that contradict the map end, features that were matched with the target view start, and lost ones are
    searched where the map has them. All are then tracked into the present image, from where odometry, if it is wired,
    and the map expect them. Raises BadInput for an image without bearings.
    """

    class Out(Outputs):
        """Absent where there is no local map."""

        tracks: TrackedFeatures | None = None

    def step(
        self,
        ctx: Context,
        state: FeatureTrackerState,
        image: Image | Panorama,
        camera: Camera | None = None,
        local_map: LocalMap | None = None,
        motion: Motion | None = None,
    ) -> Out:
        """Track into this image; `local_map` is that of the tick before, `motion` what was driven since."""
        seen = working_image(image, camera, MAX_PIXELS)
        if local_map is None or not len(local_map):
            state.number, state.image = -1, seen.grey
            return self.Out()
        if local_map.number != state.number:
            state.number, state.places = local_map.number, local_map.places.copy()
            state.points, state.alive = np.full((len(local_map), 2), np.nan), np.zeros(len(local_map), np.bool_)
            state.histograms = np.zeros((len(local_map), HISTOGRAM_BINS), np.float32)
        if state.image.shape != seen.grey.shape:
            state.alive[:] = False
            found_again = np.zeros(0, np.int64)
        else:
            found_again = self._update(state, seen._replace(grey=state.image), local_map)
        tracks = self._track(state, seen, local_map.moved(camera_motion(motion, camera)), found_again)
        state.image = seen.grey
        return self.Out(tracks=tracks)

    def _update(self, state: FeatureTrackerState, before: WorkingImage, local_map: LocalMap) -> Ints:
        """End, start and find tracks in the image before; gives the rows that were found again."""
        kinds = local_map.kinds
        state.alive &= (kinds == TRACKED) | (kinds == FOUND_AGAIN)
        if local_map.state == "lost":
            return np.zeros(0, np.int64)
        strength = trackability(before)
        self._start(state, before, strength, local_map, np.flatnonzero(kinds == MATCHED))
        steady = np.flatnonzero(state.alive)
        state.histograms[steady] = histograms(before, state.points[steady])
        expected = _expected(state, before, local_map)
        lost = np.flatnonzero(~state.alive & before.inside(expected, EDGE_PX))
        points, found = find_again(before, strength, expected[lost], state.histograms[lost])
        state.points[lost[found]], state.alive[lost[found]] = points[found], True
        return lost[found]

    def _start(
        self, state: FeatureTrackerState, before: WorkingImage, strength: Floats, local_map: LocalMap, rows: Ints
    ) -> None:
        """Track the best points near to where the features of these rows are."""
        expected = _expected(state, before, local_map, rows)
        if local_map.state == "new":
            expected = before.from_original(local_map.points[rows])
        inside = before.inside(expected, EDGE_PX)
        rows, expected = rows[inside], expected[inside]
        points = best_nearby(strength, before, expected)
        bearings = before.bearings(points)
        usable = np.isfinite(bearings).all(axis=1) & before.inside(points, EDGE_PX)
        rows, points, bearings = rows[usable], points[usable], bearings[usable]
        depths = np.linalg.norm(state.places[rows] - local_map.translation, axis=1)
        state.places[rows] = local_map.translation + (depths[:, None] * bearings) @ local_map.rotation.T
        state.points[rows], state.alive[rows] = points, True

    def _track(
        self, state: FeatureTrackerState, seen: WorkingImage, predicted: LocalMap, found_again: Ints
    ) -> TrackedFeatures:
        points = _expected(state, seen, predicted)
        old = np.flatnonzero(state.alive)
        guesses = np.where(np.isfinite(points[old]), points[old], state.points[old])
        found, kept = track(state.image, seen, state.points[old], guesses)
        rows = old[kept]
        points[rows] = state.points[rows] = found[kept]
        state.alive[:] = False
        state.alive[rows] = True
        kinds = np.where(state.alive, TRACKED, LOST)
        kinds[found_again] = np.where(state.alive[found_again], FOUND_AGAIN, LOST)
        bearings = np.full((len(points), 3), np.nan)
        bearings[rows] = seen.bearings(points[rows])
        return TrackedFeatures(
            state.number, predicted.rows, kinds, seen.to_original(points), bearings, state.places.copy()
        )


def _expected(
    state: FeatureTrackerState, image: WorkingImage, local_map: LocalMap, rows: Ints | slice = slice(None)
) -> Array:
    """Predicts the tracked points of some rows in an image taken from the robot's pose in the map: (N, 2)."""
    return image.points((state.places[rows] - local_map.translation) @ local_map.rotation)
