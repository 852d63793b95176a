import cv2
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
from omninav.stages.plots.reference_life import ReferenceLife, farthest_moved, lives_of
from omninav.stages.plots.thin_belief import ThinBelief, heaviest
from omninav.stages.plots.trajectory_over_map import TrajectoryOverMap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures

CTX = Context("view")
PLAN = FloorPlan(np.array([[[2.0, 2.0], [4.0, 2.0], [4.0, 3.0], [2.0, 3.0]]]), 10.0, 10.0)


@pytest.fixture(scope="module")
def run():
    return small_run(30, logs=2)


@pytest.fixture(scope="module")
def learned(run):
    return mixture_run(run)


def all_plots(run, learned):
    map, _, events, after = learned
    kept = [ChangedMixtures().step(CTX, now, event).mixtures for now, event in zip(after, events, strict=True)]
    drive = run.drive
    yield TrajectoryOverMap().step(CTX, drive, map).plot
    yield MapEllipses().step(CTX, drive, map, PLAN).plot
    yield MapGrowth().step(CTX, drive, events).plot
    yield ReferenceLife().step(CTX, drive, events, kept, PLAN).plot


def test_every_picture_can_be_decoded_is_small_and_the_same_each_time(run, learned):
    plots = list(all_plots(run, learned))
    for plot in plots:
        if plot.media_type != "image/svg+xml":
            pixels = cv2.imdecode(np.frombuffer(plot.content, np.uint8), cv2.IMREAD_COLOR)
            assert pixels.std() > 5, f"{plot.name} is blank"
        assert len(plot.content) < 150_000
        assert plot.title
        assert len(plot.caption) > 30
    assert [plot.content for plot in all_plots(run, learned)] == [plot.content for plot in plots]


def test_an_empty_map_and_a_run_without_events_give_no_pictures(run):
    drive, nothing = run.drive, [None] * len(run.ticks)
    assert MapEllipses().step(CTX, drive, ViewMixtures.empty()).plot is None
    assert MapGrowth().step(CTX, drive, nothing).plot is None
    assert ReferenceLife().step(CTX, drive, nothing, nothing).plot is None
    assert TrajectoryOverMap().step(CTX, drive, ViewMixtures.empty()).plot is not None


def test_without_truth_the_maps_picture_has_the_estimates_path_and_no_plan(run, learned):
    caption = MapEllipses().step(CTX, run.blind, learned[0], PLAN).plot.caption
    assert "line is the estimate" in caption


def test_the_life_that_is_told_is_that_of_the_reference_whose_place_moved_most():
    def event(name, x):
        one = np.array([name])
        none = np.empty(0, np.int64)
        return ViewEvent(1, 1, none, none, none, "", one, np.ones(1), np.array([[x, 0.0]]), np.ones(1, np.int64))

    moves = [event(3, 0.0), None, event(5, 0.0), event(5, 1.0), event(3, 1.5), event(5, 0.5)]
    assert farthest_moved(moves) == 5  # 1.0 m and half of it back, as far as 3 in one go, but in more frames
    assert farthest_moved([*moves, event(3, 1.6)]) == 3
    assert farthest_moved([None]) is None


def test_a_references_place_goes_on_where_a_component_is_near_and_ends_where_none_is():
    far = np.array([[9.0, 0.0]])
    here, there = np.array([[0.0, 0.0]]), np.array([[0.4, 0.0]])
    snapshots = [
        (0, here, np.array([1.0])),
        (4, np.concatenate([far, there]), np.array([0.3, 0.7])),
        (9, far, np.array([1.0])),
    ]
    lives = lives_of(snapshots, same_m=1.0)
    assert [life[:, 0].tolist() for life in lives] == [[0.0, 4.0], [4.0, 9.0]]  # 1.7 of weight in all, and 1.3
    np.testing.assert_allclose(lives[0][:, 1:], [[0, 0, 1.0], [0.4, 0, 0.7]])
    np.testing.assert_allclose(lives[1][:, 3], [0.3, 1.0])


def test_of_two_components_near_the_same_place_the_closer_one_is_its_future():
    snapshots = [
        (0, np.array([[0.0, 0.0]]), np.ones(1)),
        (1, np.array([[0.5, 0.0], [0.2, 0.0]]), np.array([0.6, 0.4])),
    ]
    lives = sorted(lives_of(snapshots, same_m=1.0), key=len)
    assert [len(life) for life in lives] == [1, 2]
    assert lives[1][1, 1] == 0.2


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
