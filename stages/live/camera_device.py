"""A camera that is plugged into this computer, as OpenCV reads it."""

import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from omninav.pipeline import BadInput
from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.named_camera import assumed_camera, named_camera
from omninav.stages.values.image import Pixels

TOPIC, MESSAGE = "/camera/image/compressed", "sensor_msgs/msg/CompressedImage"
WAIT_S = 5.0
"""For the first image of a camera that wakes up."""


class CameraDevice:
    """An open camera: its number, or its file as /dev/video0; a video serves as a camera too.

    Raises `BadInput` where there is no such camera.
    """

    def __init__(self, device: str) -> None:
        self.name, self.is_video = device, Path(device).is_file()
        self._capture: Any = _opened(device)
        self.period_s = 1.0 / max(self._capture.get(cv2.CAP_PROP_FPS), 1.0) if self.is_video else 0.0
        """Between the images of a video; a camera gives them when it has them."""

    def read(self) -> Pixels | None:
        """The next image; None where there is none."""
        there, pixels = self._capture.read()
        return np.asarray(pixels, np.uint8) if there else None

    def first(self) -> Pixels:
        """The first image. Raises `BadInput` where none comes in time."""
        until = time.monotonic() + WAIT_S
        while (pixels := self.read()) is None:
            if time.monotonic() > until:
                raise BadInput(f"camera {self.name:.100} gives no image; does another program use it?")
            time.sleep(0.05)
        return pixels

    def reopen(self) -> None:
        """Look for it again, if it was unplugged. Raises `BadInput` while it is not there."""
        self._capture.release()
        self._capture = _opened(self.name)

    def close(self) -> None:
        """Leave it to other programs."""
        self._capture.release()


def device_camera(device: str, camera: str | None, pixels: Pixels) -> tuple[Camera, str]:
    """Camera model of a device, and what was assumed ("": nothing). Raises `BadInput` where it is unknown or misfits.

    `camera`: a camera.yaml, or the name of a projection; null: assumed where an image looks like one. `pixels`: one.
    """
    if camera is None:
        return assumed_camera(f"camera {device:.100}", pixels)
    model, (height, width) = named_camera(camera, lambda: pixels.shape[1::-1])[0], pixels.shape[:2]
    if (model.width, model.height_px) != (width, height):
        raise BadInput(
            f"camera={camera:.100} is of images of {model.width} x {model.height_px}, camera {device:.100} gives "
            f"{width} x {height}; name the camera.yaml of this size"
        )
    return model, ""


def image_message(pixels: Pixels, stamp: int, quality: int) -> bytes:
    """An image as a `CompressedImage` (JPEG) in CDR, with its stamp (ns)."""
    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return encode_message(MESSAGE, {"format": "jpeg", "data": data.ravel()}, stamp)


def _opened(device: str) -> Any:
    if not device.isdecimal() and not Path(device).exists():
        raise BadInput(f"there is no camera {device:.100}; type its number (0), or its file as /dev/video0")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what OpenCV reports is reported below
    capture = cv2.VideoCapture(int(device) if device.isdecimal() else str(Path(device).absolute()))
    if not capture.isOpened():
        raise BadInput(f"camera {device:.100} cannot be opened; is it plugged in, and free?")
    return capture
