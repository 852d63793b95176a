import csv

import numpy as np
import pyarrow.parquet as parquet
import pytest
from measured_drives import AT_ORIGIN, made_drive
from small_run import small_run

from omninav.pipeline import Context
from omninav.stages.metrics.frames_table import FramesTable, columns_of
from omninav.stages.values.belief import PlaceBelief, PoseEstimate, SinglePose
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.evidence import ImageEvidence
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
    (row,) = written(tmp_path, made_drive([None]))
    assert {name for name, cell in row.items() if cell} == {"log", "frame", "stamp_ns", "time_s"}


def test_of_a_belief_without_covariance_nothing_is_said_of_how_sure_it_is(tmp_path):
    (row,) = written(tmp_path, made_drive([None], estimates=[SinglePose(Pose(1.0, 2.0, 0.5)).estimate()]))
    assert row["estimate_x"] == "1"
    assert [row[name] for name in ("covariance_xx", "covariance_hh", "estimate_weight", "confident")] == [""] * 4


def test_a_match_says_what_looked_most_like_the_image(tmp_path):
    matches = [BestMatch(7, 0.5, similarity=0.9), None]
    first, second = written(tmp_path, made_drive([None] * 2, matches=matches))
    assert (first["reference"], first["similarity"], first["reference_turn"]) == ("7", "0.9", "0.5")
    assert (second["reference"], second["similarity"], first["visual_distance"]) == ("", "", "")


def test_of_several_logs_too_a_state_or_conflict_that_is_not_known_is_an_empty_cell(tmp_path):
    told = [None, PoseConfidence(0.2, "lost"), PoseConfidence(0.9), None]
    found = [ImageEvidence(), None, ImageEvidence(conflict="a clock"), None]
    rows = written(tmp_path, made_drive([None] * 4, logs=[0, 0, 1, 1], confidences=told, evidence=found))
    assert [row["state"] for row in rows] == ["", "lost", "tracking", ""]
    table = parquet.read_table(tmp_path / "frames.parquet").to_pydict()
    assert table["state"] == [None, "lost", "tracking", None]
    assert table["conflict"] == [None, None, "a clock", None]


def test_a_run_without_frames_has_a_table_without_rows(tmp_path):
    assert written(tmp_path, made_drive([])) == []
    assert parquet.read_table(tmp_path / "frames.parquet").num_rows == 0


def test_every_column_holds_its_own_figure():
    covariance = np.array([[0.1, 0.2, 0.3], [0.2, 0.5, 0.6], [0.3, 0.6, 0.9]])
    seen = PoseEstimate(Pose(1.0, 2.0, 0.3), covariance, 0.7, Pose(4.0, 5.0, 0.6))
    drive = made_drive([(-1.0, -2.0, -0.3)], motion=[(0.1, 0.2, 0.25)], estimates=[seen])
    drive.frames[:], drive.stamps[:] = 3, 7
    columns = {name: column.tolist()[0] for name, column in columns_of(drive).items()}
    for name, pose in (("estimate", (1.0, 2.0, 0.3)), ("mean", (4.0, 5.0, 0.6)), ("truth", (-1.0, -2.0, -0.3))):
        assert tuple(columns[f"{name}_{axis}"] for axis in ("x", "y", "heading")) == pose
    assert tuple(columns[f"motion_{axis}"] for axis in ("x", "y", "turn")) == (0.1, 0.2, 0.25)
    entries = [columns[f"covariance_{name}"] for name in ("xx", "xy", "xh", "yy", "yh", "hh")]
    assert entries == [0.1, 0.2, 0.3, 0.5, 0.6, 0.9]
    assert tuple(columns[f"odometry_{axis}"] for axis in ("x", "y", "heading")) == pytest.approx((-1.0, -2.0, -0.3))
    assert (columns["log"], columns["frame"], columns["stamp_ns"], columns["time_s"]) == (0, 3, 7, 0.0)
    assert (columns["confident"], columns["reference"], columns["place"]) == (1, -1, -1)
    assert columns["position_error_m"] == pytest.approx(20**0.5)
    assert columns["heading_error_deg"] == pytest.approx(np.degrees(0.6))
    assert columns["estimate_weight"] == 0.7


def test_an_error_needs_both_truth_and_estimate_and_the_first_place_and_reference_are_none(tmp_path):
    seen = PlaceBelief(np.array([0.8, 0.2]), np.zeros((2, 3))).estimate()
    drive = made_drive([None, AT_ORIGIN], estimates=[seen, None], matches=[BestMatch(0, 0.0), None])
    columns = columns_of(drive)
    assert np.isnan(columns["position_error_m"]).all()
    assert np.isnan(columns["heading_error_deg"]).all()
    assert columns["estimate_weight"].tolist() == pytest.approx([0.8, np.nan], nan_ok=True)
    first, second = written(tmp_path, drive)
    assert (first["reference"], first["place"], first["confident"]) == ("0", "0", "1")
    assert (second["reference"], second["place"], second["confident"]) == ("", "", "")
    FramesTable().step(Context("frames"), drive)  # a run without a folder has no files
