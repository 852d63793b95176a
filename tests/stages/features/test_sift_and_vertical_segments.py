"""Both kinds of features in one view: found, kept by a map, matched."""

import math

import numpy as np
from turned_robot import CAMERA, look, wrapped

from omninav.pipeline import Context
from omninav.stages.features.sift_and_vertical_segments import SiftAndVerticalSegments
from omninav.stages.features.vertical_segment_features import VerticalSegmentFeatures
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, compare
from omninav.stages.match.correspondences import MatchFeatures
from omninav.stages.perturbation.lost_features import LostFeatures
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, view_features
from omninav.stages.values.topological_map import stored


def described(heading: float) -> LocalFeatures:
    stage, context = SiftAndVerticalSegments(), Context("features")
    stage.setup(context)
    return stage.step(context, image=look("mirror", heading), camera=CAMERA).features


def test_a_turned_robot_matches_patches_and_both_ends_of_columns() -> None:
    one, other = described(0.0), described(0.7)
    assert len(one.columns) > 100
    pairs = MatchFeatures().step(Context("match"), features=one, target=other).correspondences
    ends = pairs.first >= len(one)
    assert np.array_equal(ends, pairs.second >= len(other))
    assert np.count_nonzero(~ends) > 0
    first, second = pairs.first[ends] - len(one), pairs.second[ends] - len(other)
    assert len(first) > 100
    assert np.array_equal(first % 2, second % 2)  # upper with upper, lower with lower
    here, there = one.point_bearings()[pairs.first], other.point_bearings()[pairs.second]
    turned = wrapped(np.arctan2(there[:, 1], there[:, 0]) - np.arctan2(here[:, 1], here[:, 0]) + 0.7)
    assert (np.abs(turned[ends]) < math.radians(4.0)).mean() > 0.85
    assert np.isfinite(one.point_pixels()[pairs.first]).all()


def test_columns_alone_are_those_of_both_kinds() -> None:
    both = described(0.0).columns
    stage, context = VerticalSegmentFeatures(), Context("features")
    stage.setup(context)
    alone = stage.step(context, image=look("mirror", 0.0), camera=CAMERA).features
    assert len(alone) == 0
    assert np.array_equal(alone.columns.descriptors, both.descriptors)
    pairs = MatchFeatures().step(Context("match"), features=alone, target=alone).correspondences
    assert np.array_equal(pairs.first, pairs.second)
    assert len(pairs.first) > 200  # both ends


def test_a_map_keeps_columns_and_views_are_compared_by_them_too() -> None:
    view = described(0.0)
    kept = stored([view], [GlobalDescriptor(np.zeros(3, np.float32))]).features(0)
    assert len(kept.columns) == len(view.columns)
    by = ComparisonOptions()
    both = compare(view_features(kept), view_features(view), by)
    patches = view_features(kept)._replace(segments=None)
    alone = compare(patches, view_features(view), by)
    assert both.matches > alone.matches + 100
    assert both.features == len(view) + len(view.columns)


def test_lost_features_are_of_both_kinds() -> None:
    view = described(0.0)
    left = LostFeatures(share=0.5).step(Context("lost", np.random.default_rng(0)), view).features
    assert 0.3 < len(left.columns) / len(view.columns) < 0.7
