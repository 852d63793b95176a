"""Sightings of one point in several images, joined from matches between two images each."""

from typing import NamedTuple

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Ints


class Tracks(NamedTuple):
    """Sightings of points. Of track t the rows `starts[t]` to `starts[t + 1]` of `features` (O,): rows of features."""

    starts: Ints
    features: Ints

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def owners(self) -> Ints:
        """The track (O,) of each sighting."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))


def joined_matches(first: Ints, second: Ints, image: Ints) -> Tracks:
    """Tracks of features that matches join, directly or through others; those of one feature alone are left out.

    `first`, `second` (M,): rows of matched features; `image` (F,): the image of each feature. A track holds at most one
    feature of an image: a match that would give it two is left out, so that matches come the surest first.
    """
    parent, following = np.arange(len(image)), np.full(len(image), -1)
    last = np.arange(len(image))
    _join(first, second, image, parent, following, last)
    roots = _roots(parent)
    order = np.argsort(roots, kind="stable")
    counts = np.unique(roots[order], return_counts=True)[1]
    several = counts > 1
    kept = np.repeat(several, counts)
    return Tracks(np.concatenate([[0], np.cumsum(counts[several])]), order[kept])


@compiled(nogil=True)
def _root(parent: Ints, one: int) -> int:
    while parent[one] != one:
        parent[one] = parent[parent[one]]
        one = parent[one]
    return one


@compiled(nogil=True)
def _roots(parent: Ints) -> Ints:
    out = np.empty(len(parent), np.int64)
    for n in range(len(parent)):
        out[n] = _root(parent, n)
    return out


@compiled(nogil=True)
def _join(first: Ints, second: Ints, image: Ints, parent: Ints, following: Ints, last: Ints) -> None:
    # Each set is a list from its root along `following` to `last`: tracks are short, so two are compared whole.
    for m in range(len(first)):
        one, other = _root(parent, first[m]), _root(parent, second[m])
        if one == other:
            continue
        shared = False
        a = one
        while a >= 0 and not shared:
            b = other
            while b >= 0 and not shared:
                shared = image[a] == image[b]
                b = following[b]
            a = following[a]
        if not shared:
            parent[other] = one
            following[last[one]] = other
            last[one] = last[other]
