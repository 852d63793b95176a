import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from result_of import write_result
from small_run import mixture_run, small_run

from omninav.pipeline import Context
from omninav.stages.plots.changed_mixtures import ChangedMixtures
from omninav.stages.plots.map_ellipses import MapEllipses
from omninav.stages.plots.map_growth import MapGrowth
from omninav.stages.plots.thin_belief import ThinBelief, heaviest
from omninav.stages.plots.trajectory_over_map import TrajectoryOverMap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.view_mixtures import ViewMixtures

CTX = Context("view")
PLAN = FloorPlan(np.array([[[2.0, 2.0], [4.0, 2.0], [4.0, 3.0], [2.0, 3.0]]]), 10.0, 10.0)


@pytest.fixture(scope="module")
def run():
    return small_run(30, logs=2)


@pytest.fixture(scope="module")
def learned(run):
    return mixture_run(run)


def all_plots(run, learned):
    map, _, events, _ = learned
    drive = run.drive
    yield TrajectoryOverMap().step(CTX, drive, map).plot
    yield MapEllipses().step(CTX, drive, map, PLAN).plot
    yield MapGrowth().step(CTX, drive, events).plot


def test_every_picture_is_small_and_the_same_each_time(run, learned):
    plots = list(all_plots(run, learned))
    for plot in plots:
        assert len(plot.content) < 150_000
        assert plot.title
        assert len(plot.caption) > 30
    assert [plot.content for plot in all_plots(run, learned)] == [plot.content for plot in plots]


def test_an_empty_map_and_a_run_without_events_give_no_pictures(run):
    drive, nothing = run.drive, [None] * len(run.ticks)
    assert MapEllipses().step(CTX, drive, ViewMixtures.empty()).plot is None
    assert MapGrowth().step(CTX, drive, nothing).plot is None
    assert TrajectoryOverMap().step(CTX, drive, ViewMixtures.empty()).plot is not None


def test_without_truth_the_maps_picture_has_the_estimates_path_and_no_plan(run, learned):
    caption = MapEllipses().step(CTX, run.blind, learned[0], PLAN).plot.caption
    assert "line is the estimate" in caption


def test_the_mixtures_that_are_kept_are_those_of_the_changed_views(run, learned):
    _, _, events, after = learned
    kept = ChangedMixtures().step(CTX, after[3], events[3]).mixtures
    assert kept.ids.tolist() == [0, 0]
    assert sorted(kept.weights.tolist()) == pytest.approx([0.125, 0.875])
    assert ChangedMixtures().step(CTX, after[3], None).mixtures is None


def test_a_mixture_is_kept_as_it_is_or_in_its_heaviest_gaussians():
    many = GaussianMixture(np.arange(9.0).reshape(3, 3), np.tile(np.eye(3), (3, 1, 1)), np.array([0.2, 0.1, 0.7]))
    assert ThinBelief().step(CTX, many).belief is many
    few = heaviest(many, 2)
    assert few.weights.tolist() == [0.2, 0.7]
    assert few.means[:, 0].tolist() == [0.0, 6.0]


def test_a_log_of_mixtures_opens_with_mcaps_own_ros2_decoder(run, learned, tmp_path):
    with write_result(tmp_path, run, learned[1], learned[0]).open("rb") as file:
        found = {}
        for _, channel, _, content in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            found.setdefault(channel.topic, []).append(content)
    # The map comes at the first frame of each log, and at the end.
    assert [len(found[topic]) for topic in ("/belief", "/belief/markers", "/map")] == [60, 60, 3]
    assert len(found["/belief"][7].poses) == 2
    assert [belief.poses[0].position.x for belief in found["/belief"]] == [each.means[0, 0] for each in learned[1]]
    lines = found["/belief/markers"][7].markers[0]
    assert len(lines.points) == len(lines.colors) == 8  # two Gaussians, two axes each, two ends each
    ends = np.array([[point.x, point.y] for point in lines.points[:4]])
    lengths = np.linalg.norm(ends[1::2] - ends[::2], axis=1)
    np.testing.assert_allclose(sorted(lengths / 2), np.sqrt([0.05, 0.2]))  # one standard deviation to either side
    places, ellipses = found["/map"][-1].markers
    assert len(places.points) == len(learned[0].weights)
    assert len(ellipses.points) == 4 * len(learned[0].weights)
