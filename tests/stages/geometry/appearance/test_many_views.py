"""One view compared with many at once, against one after the other."""

import numpy as np
import pytest

from omninav.stages.geometry.appearance.visual_distance import (
    ROWS,
    ComparisonOptions,
    ManyViews,
    PatchDistance,
    Patches,
    Segments,
    ViewFeatures,
    compare,
)


def a_view(rng: np.random.Generator, looks: np.ndarray, number: int, segments: int | None = None) -> ViewFeatures:
    """Of some landmarks, each seen with noise in a direction of its own."""
    rows = rng.choice(len(looks), number, replace=False)
    angles = rows / len(looks) * 6.0 + rng.normal(0.0, 0.02, number)
    colours = np.repeat((rows / len(looks))[:, None], 3, axis=1).astype(np.float32)
    descriptors = looks[rows] + rng.integers(0, 9, (number, looks.shape[1]))
    described = Patches(descriptors.astype(np.float32), colours, angles)
    if segments is None:
        return ViewFeatures(described, None)
    columns = rng.normal(0, 1, (segments, 10)).astype(np.float32)
    return ViewFeatures(described, Segments(columns, rng.uniform(-3, 3, segments)))


@pytest.mark.parametrize("patch_distance", ["euclidean", "mahalanobis"])
def test_many_views_are_compared_as_one_after_the_other(patch_distance: PatchDistance):
    rng = np.random.default_rng(0)
    looks = rng.integers(0, 100, (300, 128))
    sizes = [80, 0, 3, 150, 60, 1, *[90] * 40]
    assert sum(sizes) > ROWS  # more than one block
    views = [a_view(rng, looks, number, segments=5 if row % 7 == 0 else None) for row, number in enumerate(sizes)]
    here, by = a_view(rng, looks, 120, segments=9), ComparisonOptions(patch_distance=patch_distance)
    chosen = np.array([n for n in range(len(views)) if n % 5 != 4])
    found = ManyViews(views).compare(chosen, here, by)
    assert found == [compare(views[n], here, by) for n in chosen]
    assert 0 < sum(np.isfinite(each.distance) for each in found) < len(found)
    assert ManyViews(views).compare(chosen[:0], here, by) == []


def test_a_view_without_any_patch_matches_none():
    rng = np.random.default_rng(1)
    looks = rng.integers(0, 100, (100, 128))
    views = [a_view(rng, looks, 50), a_view(rng, looks, 40)]
    for empty in (a_view(rng, looks, 0), ViewFeatures(None, None)):
        found = ManyViews(views).compare(np.arange(2), empty, ComparisonOptions())
        assert [each.matches for each in found] == [0, 0]
