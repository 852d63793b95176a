import cv2
import numpy as np
import pytest
from measured_drives import made_drive
from small_run import small_run

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.plots.frame_by_frame import FrameByFrame
from omninav.stages.plots.panorama_snapshot import PanoramaSnapshot
from omninav.stages.plots.thumbnails import joined
from omninav.stages.values.image import Panorama, Windows
from omninav.stages.values.similarity import RetrievedReferences
from omninav.stages.values.thumbnails import decoded

CTX = Context("view")


def plain(*levels: int, rows: int = 30, columns: int = 40) -> np.ndarray:
    return np.stack([np.full((rows, columns, 3), level, np.uint8) for level in levels])


def windows(*levels: int) -> Windows:
    return Windows(plain(*levels), 2 * np.pi * np.arange(len(levels)) / len(levels), 1.0)


def test_windows_are_kept_side_by_side_from_the_left_to_the_right() -> None:
    # ahead, left, behind, right: as a panorama they are behind, left, ahead, right
    shot = PanoramaSnapshot().step(CTX, Tick(0, 0), windows(0, 80, 160, 240)).snapshot
    assert shot is not None
    seen = [round(float(part.mean())) for part in np.split(decoded(shot.jpeg), 4, axis=1)]
    assert seen == pytest.approx([160, 80, 0, 240], abs=3)
    assert np.degrees(shot.headings) == pytest.approx([180, 90, 0, 270])
    plot = FrameByFrame().step(CTX, made_drive([None]), [shot]).plot
    assert plot is not None
    assert "Windows" in plot.caption


def test_the_answers_of_a_database_stand_beside_the_image_with_the_error_of_the_pose_that_each_means() -> None:
    run = small_run()
    row = 4
    near = np.argsort(np.hypot(*(run.map.poses - run.drive.truth[row])[:, :2].T))
    answers = RetrievedReferences(near[:9], np.linspace(0.9, 0.5, 9).astype(np.float32), np.full(9, 0.5))
    shots = [PanoramaSnapshot().step(CTX, tick, Panorama(plain(120, columns=160)[0])).snapshot for tick in run.ticks]
    every = [None if n == 0 else answers for n in range(len(run.ticks))]
    images = [cv2.imencode(".jpg", picture)[1].tobytes() for picture in plain(*range(0, 5 * len(run.map), 5))]
    given = {"map": run.map, "thumbnails": joined(images), "answers": every}
    plot = FrameByFrame().step(CTX, run.drive, shots, **given).plot
    assert plot is not None
    first, then = plot.slides[0], plot.slides[row]
    assert [caption for caption, _ in first.photographs] == ["image"]
    captions = [caption for caption, _ in then.photographs]
    apart = np.hypot(*(run.map.poses[near[0]] - run.drive.truth[row])[:2])
    turned = abs(np.degrees(float(wrap(run.map.poses[near[0], 2] + 0.5 - run.drive.truth[row, 2]))))
    assert captions[:2] == ["image", f"match 1: 90 %, {apart:.1f} m, {turned:.0f}°"]
    assert len(captions) == 4
    assert [round(decoded(jpeg).mean() / 5) for _, jpeg in then.photographs[1:]] == near[:3].tolist()
    without = FrameByFrame().step(CTX, run.drive, shots, **(given | {"thumbnails": None})).plot
    assert without is not None
    assert [len(slide.photographs) for slide in without.slides] == [1] * len(without.slides)
