import dataclasses
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from small_run import reference_graph, small_run
from world_files import DEMO

from omninav.pipeline import Context
from omninav.pipeline.report.plot_style import plot
from omninav.stages.plots.error_over_time import ErrorOverTime
from omninav.stages.plots.frame_by_frame import FrameByFrame, shown_frames
from omninav.stages.plots.map_plan import MapPlot
from omninav.stages.plots.panorama_snapshot import PanoramaSnapshot
from omninav.stages.plots.snapshot_times import even_frames, is_snapshot_frame
from omninav.stages.plots.thumbnails import joined
from omninav.stages.plots.trajectory_over_map import TrajectoryOverMap
from omninav.stages.simulator.floor_plan import plan_of
from omninav.stages.values.image import Panorama
from omninav.stages.values.view_mixtures import ViewEvent

CTX = Context("view")


def panoramas(run):
    rng = np.random.default_rng(0)
    for tick in run.ticks:
        pixels = rng.integers(0, 255, (8, 36, 3)).astype(np.uint8).repeat(10, axis=0).repeat(10, axis=1)
        yield PanoramaSnapshot().step(CTX, tick, Panorama(pixels)).snapshot


def all_plots(run):
    yield TrajectoryOverMap().step(CTX, run.drive, run.map).plot
    yield ErrorOverTime().step(CTX, run.drive).plot
    yield MapPlot().step(CTX, run.drive, run.map).plot
    yield FrameByFrame().step(CTX, run.drive, list(panoramas(run)), run.beliefs, run.map).plot


def reference_thumbnails(run):
    jpeg = cv2.imencode(".jpg", np.full((8, 36, 3), 90, np.uint8))[1]
    return joined([jpeg.tobytes()] * len(run.map))


@pytest.fixture(scope="module")
def plots():
    return list(all_plots(small_run()))


def test_every_picture_can_be_drawn_is_small_and_says_what_it_shows(plots):
    for each in plots:
        marks = ElementTree.fromstring(each.content).iter()
        assert sum(mark.tag.endswith(("}path", "}polygon")) for mark in marks) > 10, f"{each.name} is blank"
        assert len(each.content) < 150_000
        assert each.title
        assert len(each.caption) > 30


def test_errors_name_their_limits_and_mark_no_convergence_at_once():
    drive = small_run().drive
    errors = ErrorOverTime().step(CTX, dataclasses.replace(drive, estimate=drive.truth)).plot
    assert "Dotted: the limits of convergence, 1 m and 20°." in errors.caption
    assert "Converged at once" in errors.caption
    assert b">converged</text>" not in errors.content


def test_the_same_run_gives_the_same_pictures_byte_for_byte(plots):
    assert [plot.content for plot in all_plots(small_run())] == [plot.content for plot in plots]


def test_a_users_own_matplotlib_settings_change_nothing():
    import matplotlib

    def drawn():
        with plot(3.0, 2.0) as made:
            made.canvas.add_subplot().plot([0, 1], [1, 0])
        return made.content

    own = drawn()
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9, "figure.facecolor": "red"}):
        again = drawn()
        assert matplotlib.rcParams["font.size"] == 20
    assert again == own


def test_a_trajectory_stands_over_what_stands_on_the_floor():
    run, plan = small_run(frames=20), plan_of(DEMO, 0)
    bare, furnished = (TrajectoryOverMap().step(CTX, run.drive, run.map, plan=p).plot for p in (None, plan))
    assert b"<image" not in bare.content
    assert b"obstacles" in furnished.content
    assert b"<image" in furnished.content
    of_odometry = dataclasses.replace(run.map, pose_source="odometry")  # in a frame of its own
    assert b"obstacles" not in TrajectoryOverMap().step(CTX, run.drive, of_odometry, plan=plan).plot.content


def test_a_slide_shows_image_error_belief_and_best_match_of_its_frame():
    run = small_run(frames=30)
    drive = dataclasses.replace(run.drive, reference=np.full(30, 7), similarity=np.full(30, 0.9))
    given = list(panoramas(run)), run.beliefs, run.map, reference_thumbnails(run)
    slides = FrameByFrame().step(CTX, drive, *given).plot.slides
    assert [slide.label.split(" · ")[0] for slide in slides] == [f"frame {n}" for n in range(30)]
    facts = dict(slides[4].facts)
    wrong = np.hypot(*(drive.estimate[4] - drive.truth[4])[:2])
    assert facts["error"].startswith(f"{wrong:.3f} m")
    ahead = dataclasses.replace(drive, estimate=np.tile([1.0, -1e-9, -1e-9], (30, 1)))
    assert dict(FrameByFrame().step(CTX, ahead, *given).plot.slides[4].facts)["estimate"] == "x 1.000 m, y 0.000 m, 0°"
    assert facts["best match"].startswith("number 7, similarity 90 %, taken")
    assert [words for words, _ in slides[4].photographs] == ["image", "best match in the map"]
    assert slides[4].overlay != slides[5].overlay


def test_the_estimates_ellipse_is_drawn_and_how_many_true_positions_such_hold_is_said_beside_it():
    run = small_run(frames=20)
    truth = run.drive.truth.copy()
    truth[:5, 0] += 3.0
    drive = dataclasses.replace(run.drive, estimate=run.drive.truth.copy(), truth=truth)
    sure = dataclasses.replace(drive, covariance=np.zeros((20, 3, 3)))
    drive = dataclasses.replace(drive, covariance=np.repeat(np.diag((1.0, 0.25, 0.1))[None], 20, axis=0))
    plot, point = (FrameByFrame().step(CTX, each, list(panoramas(run)), None, run.map).plot for each in (drive, sure))
    assert "The 95 % ellipse holds 75 % of the true positions." in plot.caption
    assert "ellipse" not in point.caption
    assert ["<ellipse" in slide.overlay for slide in (plot.slides[7], point.slides[7])] == [True, False]


def test_the_best_match_in_a_map_that_is_learned_on_the_way_is_an_image_of_the_drive():
    run = small_run(frames=30)
    drive = dataclasses.replace(run.drive, reference=np.full(30, 7), reference_turn=np.full(30, np.pi / 2))
    none = np.empty(0, np.int64)
    learned = ViewEvent(1, 1, np.array([7]), np.array([2]), none, "", none, np.empty(0), np.empty((0, 2)), none)
    seen = list(panoramas(run))
    plot = FrameByFrame().step(CTX, drive, seen, run.beliefs, events=[None] * 29 + [learned], panoramas=seen).plot
    words, shown = plot.slides[20].photographs[1]
    assert words == "best match in the map"
    image, then = (cv2.imdecode(np.frombuffer(data, np.uint8), 1) for data in (shown, seen[2].jpeg))
    quarter = np.roll(cv2.resize(then, image.shape[1::-1], interpolation=cv2.INTER_AREA), image.shape[1] // 4, axis=1)
    assert np.abs(image.astype(int) - quarter).mean() < 20 < np.abs(image.astype(int) - np.roll(quarter, 60, 1)).mean()
    gap = np.hypot(*(drive.truth[2] - drive.truth[20])[:2])
    assert dict(plot.slides[20].facts)["best match"] == f"number 7, taken {gap:.2f} m away"


def test_slides_of_a_long_drive_are_at_most_sixty_at_even_steps_and_all_have_their_image():
    for frames in (1, 60, 61, 500, 12_345):
        shown = even_frames(frames)
        assert shown[0] == 0
        assert len(shown) <= 60
        assert all(is_snapshot_frame(frame) for frame in shown)
    assert len(even_frames(500)) == 32
    assert sum(map(is_snapshot_frame, range(100_000))) < 800


@pytest.mark.parametrize(
    ("shown", "frames", "words"),
    [
        (range(4), 4, "Every frame is shown."),
        (range(0, 103, 2), 103, "Every second frame is shown."),
        (range(0, 103, 4), 103, "Every 4th frame is shown."),
        ([0, 2, 8], 9, "3 of 9 frames can be stepped to."),
    ],
)
def test_a_caption_says_which_frames_can_be_stepped_to(shown, frames, words):
    assert shown_frames(list(shown), frames) == words


def test_several_logs_get_a_picture_of_the_earlier_ones():
    out = TrajectoryOverMap().step(CTX, small_run(frames=20, logs=3).drive, None)
    assert out.plot is not None
    assert out.earlier is not None


def test_without_truth_or_estimates_there_is_a_trajectory_but_no_error():
    run = small_run(frames=20)
    assert ErrorOverTime().step(CTX, run.blind).plot is None
    assert "no ground truth" in TrajectoryOverMap().step(CTX, run.blind, run.map).plot.caption
    run.estimates = [None] * 20
    assert ErrorOverTime().step(CTX, run.drive).plot is not None
    assert TrajectoryOverMap().step(CTX, run.drive, run.map).plot is not None


def test_an_empty_run_gives_no_pictures():
    run = small_run(frames=0)
    run.map = reference_graph(0)
    assert list(all_plots(run)) == [None] * 4
