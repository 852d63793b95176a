import pytest
from small_run import collected, small_run

from omninav.pipeline import BadInput, Context
from omninav.pipeline.files import write_json
from omninav.stages.metrics.frames_table import FramesTable
from omninav.stages.tools.explain import ExplainRun


def test_a_run_is_explained_log_by_log_from_its_frames(tmp_path, capsys):
    run_folder(tmp_path, small_run(frames=60, logs=2).drive)
    ExplainRun(run_folder=str(tmp_path)).run(Context("explain"))
    said = capsys.readouterr().out
    assert "Log 0: Sure of the estimate" in said
    assert "nodes.evidence" in said
    assert "images 1:0-" in said
    assert "searching" in said


def test_a_run_that_estimates_no_pose_or_did_not_end_is_refused(tmp_path):
    run = small_run(frames=3)
    run_folder(tmp_path, collected(run.ticks, run.truth))
    with pytest.raises(BadInput, match="homing estimates no pose"):
        ExplainRun(run_folder=str(tmp_path)).run(Context("explain"))
    for status, said in (("complete", "a complete run of homing leaves none"), ("interrupted", "omninav resume")):
        run_folder(tmp_path, collected(run.ticks, run.truth), status=status)
        (tmp_path / "frames.parquet").unlink()
        with pytest.raises(BadInput, match=said):
            ExplainRun(run_folder=str(tmp_path)).run(Context("explain"))


def test_a_run_that_failed_is_said_to_be_no_whole_one(tmp_path, capsys):
    run_folder(
        tmp_path, small_run(frames=60).drive, status="failed", error="the disk is full", warnings=["images come late"]
    )
    ExplainRun(run_folder=str(tmp_path)).run(Context("explain"))
    said = capsys.readouterr().out
    assert said.startswith("the run is failed (the disk is full); this is of its first 60 images\n")
    assert said.endswith("\nwarning: images come late\n")


def test_images_that_could_not_be_used_are_counted(tmp_path, capsys):
    dropped = {"source.blank_image": 20, "source.undecodable_image": 20, "source.blank_image (map)": 9, "source.x": 9}
    notes = {kind: {"count": count, "first": ""} for kind, count in dropped.items()}
    run_folder(tmp_path, small_run(frames=60).drive, dropped=notes)
    ExplainRun(run_folder=str(tmp_path)).run(Context("explain"))
    assert "\n40 of 100 images could not be used, and have no estimate.\n" in capsys.readouterr().out


def run_folder(folder, drive, **manifest):
    write_json(folder / "manifest.json", {"variant": "homing", "status": "complete", **manifest})
    (folder / "config.yaml").write_text("lost_m: 2.5\n")
    FramesTable().step(Context("frames", folder=folder), drive)
