"""Simulated drives as MCAP logs."""

import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from omninav.pipeline.mcap.writer import LogStream, written_log
from omninav.stages.geometry.arrays import Array
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.messages import scan_fields
from omninav.stages.recordings.rooms_yaml import ROOMS, write_rooms

from .simulated_recording import SimulatedRecording
from .world_rooms import rooms_of

ODOMETRY_LATENCY_NS, SCAN_LATENCY_NS = 2_000_000, 5_000_000
"""Nanoseconds from the stamp of odometry and of a range reading to its arrival."""
JPEG_QUALITY = 90
"""Quality of the images, of 100."""


def record(
    recordings: SimulatedRecording | Sequence[SimulatedRecording],
    path: Path,
    progress: Callable[[int, int | None], None] = lambda done, total: None,
) -> None:
    """Write a simulated drive, or several one after the other, as an MCAP log; the same drives give the same bytes.

    Topics as every recording has them: JPEG images, camera information, odometry, truth, ranges (`/scan`); what was
    done to the robot is on `/ground_truth/event` as JSON; camera.yaml is attached, and rooms.yaml where rooms have
    names. Odometry, truth and ranges come at their own rates. Log times run behind header stamps as a camera's, a
    wheel's and a ring's do. `progress` is called for every image: how many are written, of how many.
    """
    drives = [recordings] if isinstance(recordings, SimulatedRecording) else recordings
    total = sum(len(drive.sent) for drive in drives)
    written = itertools.count(1)
    with written_log(path) as log:
        log.attach("camera.yaml", write_camera(drives[0].camera).encode(), "application/yaml")
        rooms = rooms_of(drives[0].world)
        if rooms is not None:
            log.attach(ROOMS, write_rooms(rooms).encode(), "application/yaml")
        for drive in drives:
            _write(log, drive, lambda: progress(next(written), total))


def _write(log: LogStream, recording: SimulatedRecording, wrote_image: Callable[[], None]) -> None:
    for arrival, topic, number in sorted(_arrivals(recording)):
        if topic == "odometry":
            _write_odometry(log, recording, number, arrival)
        elif topic == "truth":
            stamp = int(recording.true_times[number])
            truth = {"header": {"frame_id": "map"}, "pose": _pose(recording.true_poses[number])}
            log.write("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", stamp, truth, arrival)
        elif topic == "scan":
            _write_scan(log, recording, number, arrival)
        elif topic == "event":
            said = json.dumps(asdict(recording.kidnapped[number][1]))
            log.write("/ground_truth/event", "std_msgs/msg/String", arrival, {"data": said})
        else:
            _write_image(log, recording, number, arrival)
            wrote_image()


def _arrivals(recording: SimulatedRecording) -> list[tuple[int, str, int]]:
    """All messages by the time of their arrival (ns): what it is, and its number."""
    found = [(int(stamp) + ODOMETRY_LATENCY_NS, "odometry", number) for number, stamp in enumerate(recording.times)]
    found += [(int(stamp) + ODOMETRY_LATENCY_NS, "truth", number) for number, stamp in enumerate(recording.true_times)]
    found += [(int(stamp) + SCAN_LATENCY_NS, "scan", number) for number, stamp in enumerate(recording.scan_times)]
    found += [(stamp, "event", number) for number, (stamp, _) in enumerate(recording.kidnapped)]
    return found + [(arrival, "picture", number) for number, (arrival, _, _) in enumerate(recording.sent)]


def _write_odometry(log: LogStream, recording: SimulatedRecording, number: int, arrival: int) -> None:
    message = {
        "header": {"frame_id": "odom"},
        "child_frame_id": "base_link",
        "pose": {"pose": _pose(recording.rolled[number])},
    }
    log.write("/odom", "nav_msgs/msg/Odometry", int(recording.times[number]), message, arrival)


def _write_scan(log: LogStream, recording: SimulatedRecording, number: int, arrival: int) -> None:
    head = {"header": {"frame_id": "base_link"}, "scan_time": 1.0 / recording.world.ranges.rate}
    message = head | scan_fields(recording.scan_at(number))
    log.write("/scan", "sensor_msgs/msg/LaserScan", int(recording.scan_times[number]), message, arrival)


def _write_image(log: LogStream, recording: SimulatedRecording, number: int, arrival: int) -> None:
    _, stamp, shot = recording.sent[number]
    camera = recording.camera
    size = {"width": camera.width, "height": camera.height_px}
    stamp += camera.delay_ns
    info = {"header": {"frame_id": "omni_camera"}, **size, **camera.camera_info()}  # camera.yaml states the rest
    _, packed = cv2.imencode(".jpg", recording.image_of_shot(shot), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    image = {"header": {"frame_id": "omni_camera"}, "format": "jpeg", "data": packed.ravel()}
    log.write("/camera/camera_info", "sensor_msgs/msg/CameraInfo", stamp, info, arrival)
    log.write("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", stamp, image, arrival)


def _pose(pose: Array) -> dict[str, Any]:
    """A pose (x, y, heading) as the fields of a geometry_msgs/Pose."""
    x, y, heading = (float(value) for value in pose)
    turned = {"z": float(np.sin(heading / 2)), "w": float(np.cos(heading / 2))}
    return {"position": {"x": x, "y": y}, "orientation": turned}
