"""A small value of every kind that is saved as an artifact."""

from dataclasses import replace

import cv2
import made_places
import numpy as np
from landmark_tour import mapped_room
from small_run import mixture_run, reference_graph, small_run

from omninav.pipeline import Value
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.projection import Projection
from omninav.stages.values.thumbnails import Thumbnails


def made_values() -> list[Value]:
    """Maps of references, of mixtures and of places, a projection, thumbnails, and a map with landmarks."""
    mixtures, *_ = mixture_run(small_run(frames=8))
    places = made_places.made_map(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)], {(0, 1): 2, (1, 2): 1}, [(0, 2)], ["a", "", "b"]
    )
    jpeg = np.asarray(cv2.imencode(".jpg", np.full((4, 6, 3), 90, np.uint8))[1])
    return [
        reference_graph(6),
        mixtures,
        places,
        Projection(np.eye(3, 12, dtype=np.float32), np.array([0.5, 0.3, 0.1])),
        Thumbnails(np.concatenate([jpeg, jpeg]), np.array([0, len(jpeg), 2 * len(jpeg)])),
        with_few_landmarks(),
    ]


def with_few_landmarks() -> ReferenceGraph:
    """A map of four references with the landmarks that they see."""
    map = mapped_room()
    landmarks = map.landmarks
    assert landmarks is not None
    cut = landmarks.of_references(np.array([0, 1, 24, 25]))
    words = replace(cut.words, centres=cut.words.centres[:, :8].copy())
    graph = reference_graph(4)
    return replace(graph, landmarks=replace(cut, descriptors=cut.descriptors[:, :8].copy(), words=words))
