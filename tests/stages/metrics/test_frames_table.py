import csv

import numpy as np
import pyarrow.parquet as parquet
import pytest
from small_run import collected, small_run

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.frames_table import FramesTable, columns_of
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import BestMatch


def written(folder, drive):
    FramesTable().step(Context("frames", folder=folder), drive)
    with (folder / "frames.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_every_frame_has_a_row_in_both_files(tmp_path):
    run = small_run(frames=6, logs=2)
    rows = written(tmp_path, run.drive)
    table = parquet.read_table(tmp_path / "frames.parquet").to_pydict()
    assert [int(row["stamp_ns"]) for row in rows] == [tick.stamp for tick in run.ticks] == table["stamp_ns"]
    assert [row["time_s"] for row in rows[:7]] == ["0", "0.1", "0.2", "0.3", "0.4", "0.5", "0"]
    assert [float(row["truth_x"]) for row in rows] == table["truth_x"] == [pose.x for pose in run.truth]
    assert [float(row["covariance_xy"]) for row in rows] == [e.covariance[0, 1] for e in run.estimates]


def test_what_there_is_none_of_is_an_empty_cell(tmp_path):
    (row,) = written(tmp_path, collected([Tick(0, 5)], [None]))
    assert {name for name, cell in row.items() if cell} == {"log", "frame", "stamp_ns", "time_s"}


def test_errors_are_those_of_the_estimate_against_the_truth():
    belief = PlaceBelief(np.array([0.2, 0.8]), np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 3.0]]))
    columns = columns_of(collected([Tick(0, 0)], [Pose(0.0, 0.0, -3.0)], estimates=[belief.estimate()]))
    assert columns["position_error_m"].tolist() == [5.0]
    assert columns["heading_error_deg"][0] == pytest.approx(np.degrees(2 * np.pi - 6.0))
    assert columns["place"].tolist() == [1]
    assert columns["estimate_weight"].tolist() == [0.8]


def test_a_match_says_what_looked_most_like_the_image(tmp_path):
    drive = collected([Tick(0, 0), Tick(1, 1)], [None] * 2, matches=[BestMatch(7, 0.5, similarity=0.9), None])
    first, second = written(tmp_path, drive)
    assert (first["reference"], first["similarity"], first["reference_turn"]) == ("7", "0.9", "0.5")
    assert (second["reference"], second["similarity"], first["visual_distance"]) == ("", "", "")


def test_a_run_without_frames_has_a_table_without_rows(tmp_path):
    assert written(tmp_path, collected([], [])) == []
    assert parquet.read_table(tmp_path / "frames.parquet").num_rows == 0
