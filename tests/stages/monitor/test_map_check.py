import numpy as np

from omninav.pipeline import Context
from omninav.stages.monitor.map_check import CheckMap, of_headings, of_poses
from omninav.stages.values.maps import ReferenceGraph

LINE = np.column_stack([np.arange(30) * 0.5, np.zeros(30), np.zeros(30)])


def test_a_small_map_is_not_judged():
    map = ReferenceGraph(LINE[:5] * 0.0, np.ones((5, 12, 4)), "histograms", np.zeros((0, 2), np.int64), "truth")
    ctx = Context("map_check")
    assert CheckMap().step(ctx, map).conflicts.sentences == ()
    assert ctx.warnings == []


def test_poses_that_cannot_be_are_named():
    assert of_poses(LINE) == ""
    assert of_poses(LINE * 0.0) == ("all 30 references of the map lie at one place, within 0 m: check its positions")
    assert "the map's images lie 500 m apart" in of_poses(LINE * 1000.0)
    far = LINE.copy()
    far[7, 1] = 1e6
    assert "reference 7 of the map lies 1000000 m from its middle" in of_poses(far)


def test_headings_are_judged_by_neighbours_that_turn():
    turned = np.radians(np.linspace(-60.0, 60.0, 30))
    assert of_headings(turned, turned) == ""
    assert "headings turn against its images" in of_headings(turned, -turned)
    assert of_headings(np.zeros(30), np.zeros(30)) == ""
