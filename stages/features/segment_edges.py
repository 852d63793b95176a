"""Cuts a panorama into segments."""

import functools

import numpy as np

from omninav.stages.geometry.arrays import Ints


@functools.cache
def segment_edges(columns: int, segments: int) -> Ints:
    """First column of each segment, and the end of the last: (segments + 1,). Needs segments <= columns."""
    if segments > columns:
        raise ValueError(f"{segments} segments do not fit into a panorama of {columns} columns")
    edges: Ints = np.round(np.arange(segments + 1) * columns / segments).astype(np.int64)
    edges.setflags(write=False)
    return edges
