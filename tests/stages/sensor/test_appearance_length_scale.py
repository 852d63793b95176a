"""The distance over which views lose half of their excess, where it is known from how they were made."""

import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context
from omninav.stages.geometry.appearance.length_scale import excess_by_distance
from omninav.stages.sensor.appearance_length_scale import AppearanceLengthScale
from omninav.stages.values.maps import ReferenceGraph

STEP, PLACES = 0.1, 100


def along_a_wall(directions: int, segments: int) -> ReferenceGraph:
    """Views of the next metre of as many walls as there are directions, every 10 cm.

    What a view shows of its wall lies evenly over ten bins of the wall's own, so that two views of one wall that are d
    metres apart share 1 - d of it, up to one metre, and views of different walls nothing.
    """
    shows = np.zeros((directions, PLACES, directions, PLACES + 10), np.float32)
    for wall in range(directions):
        for place in range(PLACES):
            shows[wall, place, wall, place : place + 10] = 0.1
    poses = np.zeros((directions, PLACES, 3))
    poses[..., 0] = STEP * np.arange(PLACES)
    poses[..., 2] = (np.arange(directions) * 2 * np.pi / directions)[:, None] + 1.0
    features = np.repeat(shows.reshape(directions * PLACES, 1, -1), segments, axis=1)
    return references(poses.reshape(-1, 3), features)


@pytest.mark.parametrize(("directions", "segments"), [(1, 1), (4, 1), (1, 3)])
def test_views_reach_as_far_however_many_ways_pictures_look_from_each_place(directions, segments):
    stage, ctx = AppearanceLengthScale(), Context("reach")
    stage.setup(ctx)
    # half is left at 0.5 m; bins are a factor of 99^(1/30) = 1.17 wide, and places 0.1 m apart
    assert stage.step(ctx, along_a_wall(directions, segments)).length_scale.metres == pytest.approx(0.55, abs=0.1)


def test_in_a_large_map_what_is_near_and_some_of_the_rest_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    module = "omninav.stages.geometry.appearance.length_scale"
    monkeypatch.setattr(f"{module}.MAX_COMPARED", 70)
    monkeypatch.setattr(f"{module}.NEAREST_COMPARED", 25)
    map = along_a_wall(1, 1)
    assert AppearanceLengthScale().step(Context("scale"), map).length_scale.metres == pytest.approx(0.55, abs=0.1)


def test_pictures_that_look_other_ways_are_strangers_where_they_are_compared(monkeypatch):
    monkeypatch.setattr("omninav.stages.geometry.appearance.length_scale.MAX_HEADING_DIFFERENCE", np.pi)
    assert AppearanceLengthScale().step(Context("reach"), along_a_wall(4, 1)).length_scale.metres < 0.2


def test_pairs_that_are_not_to_be_compared_count_nowhere():
    apart = np.abs(np.subtract.outer(np.arange(12.0), np.arange(12.0)))
    alike = 1 / (1 + apart)
    wider = np.hstack([apart, apart]), np.hstack([alike, np.full_like(alike, np.nan)])
    for ours, theirs in zip(excess_by_distance(*wider), excess_by_distance(apart, alike), strict=True):
        assert np.allclose(ours, theirs)
