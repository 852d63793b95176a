"""Files that once made a reader fail, and files of their kinds: each is used as far as it is good, or refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made_logs
import numpy as np
import pytest
from conftest import DATA, needs_data
from made_values import with_few_landmarks
from small_run import reference_graph

from hostile.map_files import MAP, entries_of, fields_of, with_fields
from omninav.pipeline import BadInput, Context
from omninav.pipeline.engine.artifact import artifact_bytes, read_artifact
from omninav.stages.recordings.opening import open_recording
from omninav.stages.source.log import LogSource
from omninav.stages.values.landmarks import Landmarks
from omninav.stages.values.maps import ReferenceGraph

HOSTILE = DATA / "hostile"


def poses_like(poses: np.ndarray) -> bytes:
    """A map with these poses, its sums right."""
    map = reference_graph(6)
    map.put(poses=poses)
    return artifact_bytes(map)


def landmarks_like(**fields: Callable[[Landmarks], Any]) -> bytes:
    """A map whose landmarks have these fields, each made of the right landmarks, its sums right."""
    map = with_few_landmarks()
    assert map.landmarks is not None
    wrong = {name: field(map.landmarks) for name, field in fields.items()}
    return artifact_bytes(replace(map, landmarks=replace(map.landmarks, **wrong)))


WRONG: dict[str, Callable[[], bytes]] = {
    "'poses' has the shape (6,), expected (R, 3)": lambda: poses_like(np.zeros(6)),
    "'poses' holds nan, expected finite numbers": lambda: poses_like(np.full((6, 3), np.nan)),
    "'features' has the shape (6, 10, 20), expected (R, segments, bins), R = 5": lambda: poses_like(np.zeros((5, 3))),
    "'landmarks': 'points' holds nan, expected finite": lambda: landmarks_like(
        points=lambda few: np.full_like(few.points, np.nan)
    ),
    "'words' are of descriptors of 8 numbers": lambda: landmarks_like(
        descriptors=lambda few: few.descriptors[:, :4].copy()
    ),
    "'words': 'words' names a row": lambda: landmarks_like(
        words=lambda few: replace(few.words, words=few.words.words - np.int32(1))
    ),
}
"""Makers of maps with wrong content, by what the refusal says."""


@pytest.mark.parametrize("said", WRONG)
def test_a_map_whose_sum_is_right_over_wrong_content_is_refused_by_name(tmp_path: Path, said: str):
    (tmp_path / MAP).write_bytes(WRONG[said]())
    with pytest.raises(BadInput) as refused:
        read_artifact(tmp_path / MAP)
    assert said in str(refused.value)
    assert str(refused.value).startswith(str(tmp_path / MAP))


def test_a_map_that_was_saved_before_there_were_landmarks_is_read(tmp_path: Path):
    entries = entries_of(artifact_bytes(with_few_landmarks()))
    fields = fields_of(entries)
    del fields["landmarks"]
    (tmp_path / MAP).write_bytes(with_fields(entries, fields))
    map = read_artifact(tmp_path / MAP)
    assert isinstance(map, ReferenceGraph)
    assert map.landmarks is None
    assert len(map) == 4


@needs_data
@pytest.mark.parametrize(
    ("name", "counted", "min_frames"),
    [
        ("one_chunk_removed", "missing_message", 11),
        ("image_short_and_logtime_2e64", "bad_message", 11),
        ("bomb_zstd_chunk", "bad_chunk", 12),
        ("chunk_index_offset_2e63", "bad_chunk", 10),
    ],
)
def test_of_a_log_among_the_examples_the_good_part_is_used_and_the_rest_counted(
    tmp_path: Path, name: str, counted: str, min_frames: int
):
    camera = tmp_path / "camera.yaml"  # one of them has lost its own
    camera.write_text("projection: cylindrical\nimage: {width: 160, height: 120}\ncolumn_of_forward: 80\n")
    recording = open_recording(str(HOSTILE / f"{name}.mcap"), camera=str(camera))
    assert sum(recording.image(frame) is not None for frame in range(len(recording.stamps))) >= min_frames
    assert recording.dropped[counted]


def test_a_run_counts_the_messages_that_its_log_misses(tmp_path: Path):
    log = made_logs.write_mcap(tmp_path / "log.mcap")
    data = log.read_bytes()
    middle = len(data) // 2
    log.write_bytes(data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :])
    ctx = Context("source")
    LogSource(log=str(log)).setup(ctx)
    assert ctx.counts["missing_message"] > 0
    assert " on /" in ctx.details["missing_message"]
