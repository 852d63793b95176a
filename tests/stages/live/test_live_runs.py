"""Variants on a robot: a map that is learned there, inputs that do not fit, and a camera that stops on the way."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from conflicting_logs import CASES, changed_log
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline.api.run import Run
from omninav.stages.live.publish import WARN

from .conftest import CAMERA, IMAGE, Recorded

Localised = Callable[..., Run]
SILENT = range(20, 30)
"""Images of the drive, one a second, that never come."""
LOCALISER = ("omniview_mcl", f"tour={TOUR}", "nodes.prior.number=200", "nodes.source.seconds=45")


def test_a_map_learned_live_is_that_of_its_record(localised: Localised, tmp_path: Path, shared_cache: Path):
    driven = localised(Recorded(), "omniview_cml", "nodes.source.seconds=4")
    words = {"camera": CAMERA, "cache": shared_cache, "progress": False, "plots": "none"}
    again = omninav.run("omniview_cml", log=driven.folder / "live.mcap", folder=tmp_path / "again", **words)
    assert driven.manifest["dropped"]["source.overtaken_image"]["count"] > 0
    assert "rate_hz" in driven.manifest["facts"]
    for name in ("map.omap", "frames.csv", "trajectory.tum"):
        assert (driven.folder / name).read_bytes() == (again.folder / name).read_bytes(), name


def test_inputs_that_do_not_fit_are_said_in_diagnostics_while_they_do_not(localised: Localised, tmp_path: Path):
    robot = Recorded(changed_log(DRIVE, tmp_path / "drive.mcap", CASES["turns reversed"].change), at_once=1)
    run = localised(robot, *LOCALISER)
    states = [status for message in robot.on("/diagnostics") for status in message.status]
    said = [state for state in states if "the images turn against odometry's turns" in state.message]
    assert {state.level for state in said} == {WARN}
    assert states.index(said[0]) > len(states) // 3  # not before it was found
    assert "the images turn against" in robot.status.line()  # which the terminal shows
    assert any("the images turn against" in line for line in run.manifest["warnings"])


def test_a_localiser_bridges_ten_seconds_without_images_by_odometry(localised: Localised):
    robot = Recorded(at_once=1, silent=SILENT)
    run = localised(robot, *LOCALISER)
    said = {status.message for message in robot.on("/diagnostics") for status in message.status}
    assert any(f"{IMAGE} (sensor_msgs/msg/CompressedImage) has been silent for 9 s" in words for words in said), said
    assert "running" in said
    assert any("the robot sent no image that could be used for " in line for line in run.manifest["warnings"])
    seconds = run.frames["stamp_ns"].to_numpy() / 1e9
    (gap,) = np.flatnonzero(np.diff(seconds) > 1.5)
    assert np.diff(seconds)[gap] == len(SILENT) + 1
    assert run.frames["position_error_m"].to_numpy()[gap + 1 :].max() < 0.5
