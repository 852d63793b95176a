"""Cuts a panorama into segments, and counts in each."""

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


def counts_by_segment(bins: Ints, number: int, segments: int) -> Ints:
    """How many pixels of each segment are in each of a `number` of bins: (rows, columns) -> (segments, number)."""
    segment = np.repeat(np.arange(segments), np.diff(segment_edges(bins.shape[1], segments)))
    counts = np.bincount((segment * number + bins).ravel(), minlength=segments * number)
    return counts.reshape(segments, number)
