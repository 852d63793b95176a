"""Learns the landmarks of a map from the local features of its references."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Metrics, Outputs, Quantity, Stage
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.landmarks.left_out import found_rate, other_references, samples_of
from omninav.stages.geometry.landmarks.map_making import (
    LocalViews,
    bearing_sigma,
    local_views,
    matched_pairs,
    mean_descriptors,
    most_seen,
    neighbouring_pairs,
    sightings_by_reference,
    similarity_rows,
    triangulated,
)
from omninav.stages.values.landmarks import Landmarks, stored_descriptors
from omninav.stages.values.length_scale import DEFAULT_M
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph
from omninav.stages.values.visual_words import VisualWords

QUANTITIES = {
    "landmarks.number": Quantity(title="Landmarks", context=True),
    "landmarks.sightings": Quantity(title="References that see a landmark, mean", context=True),
    "landmarks.sigma_deg": Quantity(title="Standard deviation of a bearing", unit="deg", context=True),
    "landmarks.found_rate": Quantity(title="Map's own images found by landmarks", unit="%", context=True),
}


class LearnLandmarks(Stage):
    """Triangulates the points that several references of a map see.

    Neighbouring references that share visual words are matched by their local features; matches that fit the motion
    between both join to tracks, and tracks become points with a mean descriptor (RootSIFT). There are none where images
    are too small for local features, and the map is used without them.
    """

    class Out(Outputs):
        """The map with its landmarks."""

        map: ReferenceGraph
        metrics: Metrics

    def step(
        self,
        ctx: Context,
        features: Sequence[LocalFeatures | None],
        events: Sequence[ReferenceEvent | None],
        map: ReferenceGraph,
        words: VisualWords,
    ) -> Out:
        """The whole tour at once; `events`: which of its images became references."""
        ctx.doing("triangulating landmarks")
        views = _views_of_references(features, events)
        rows = similarity_rows(words.starts, words.words, words.weights, len(words.centres), np.arange(len(words)))
        unit = length_scale(map.poses, map.features, map.kind) or DEFAULT_M
        tracks = matched_pairs(views, neighbouring_pairs(map.poses, rows, unit), map.poses)
        found = most_seen(views, triangulated(views, tracks, map.poses))
        starts, seen = sightings_by_reference(views, found)
        sigma = bearing_sigma(views, found, map.poses)
        looks = mean_descriptors(views, found)
        rate = found_rate(views, found, looks, map.poses, sigma, _candidates(words))
        landmarks = Landmarks(
            found.points.astype(np.float32), stored_descriptors(looks), starts, seen, sigma, words, rate
        )
        ctx.fact("landmarks", len(landmarks))
        values = {
            "number": len(landmarks),
            "sightings": len(seen) / max(1, len(landmarks)),
            "sigma_deg": float(np.degrees(sigma)),
            "found_rate": rate,
        }
        metrics = Metrics({"landmarks": values}, QUANTITIES)
        return self.Out(map=replace(map, landmarks=landmarks), metrics=metrics)


def _candidates(words: VisualWords) -> list[npt.NDArray[np.int64]]:
    samples = samples_of(len(words))
    rows = similarity_rows(words.starts, words.words, words.weights, len(words.centres), samples)
    return [other_references(int(reference), row) for reference, row in zip(samples, rows, strict=True)]


def _views_of_references(
    features: Sequence[LocalFeatures | None], events: Sequence[ReferenceEvent | None]
) -> LocalViews:
    found = [each for each, event in zip(features, events, strict=True) if event is not None]
    bearings = [np.empty((0, 3)) if each is None else each.bearings for each in found]
    nothing = np.empty((0, 128), np.float32)
    return local_views(bearings, (nothing if each is None else root_descriptors(each.descriptors) for each in found))
