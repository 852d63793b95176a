"""A small value of every kind that is saved as an artifact."""

import cv2
import made_places
import numpy as np
from small_run import mixture_run, reference_graph, small_run

from omninav.pipeline import Value
from omninav.stages.values.projection import Projection
from omninav.stages.values.thumbnails import Thumbnails


def made_values() -> list[Value]:
    """Maps of references, of mixtures and of places, a projection, and thumbnails."""
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
    ]
