"""Records a camera that is plugged into this computer, as a log."""

import time
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.pipeline.files import user_path
from omninav.pipeline.mcap.message_types import make_message
from omninav.pipeline.mcap.writer import LogWriter
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.named_camera import assumed_camera, named_camera
from omninav.stages.values.image import Pixels

TOPIC, MESSAGE = "/camera/image/compressed", "sensor_msgs/msg/CompressedImage"
WAIT_S = 5.0
"""For the first image of a camera that wakes up."""


class RecordCamera(Stage):
    """Writes the images of a webcam, or of another camera that OpenCV reads, as an MCAP log, until Ctrl-C.

    Each image has the time at which it was read, and is kept as JPEG; camera.yaml is attached. Images that come faster
    than `rate_hz` are left out. Raises BadInput where there is no such camera, or nothing says how it is to be read.
    """

    device: int | str = 0
    """Number of the camera, or its file as /dev/video0; a video stands for a camera too."""
    out: str = "camera.mcap"
    """The log to write."""
    camera: str | None = None
    """Its camera.yaml, or a projection (equirectangular, dual_fisheye, fisheye, donut, perspective)."""
    seconds: Annotated[float, Bounds(gt=0)] | None = None
    """How long to record; null: until Ctrl-C, or until the camera ends."""
    rate_hz: Annotated[float, Bounds(gt=0, le=1e6)] = 10.0
    """Images per second at most."""
    quality: Annotated[int, Bounds(ge=1, le=100)] = 92
    """Of the JPEGs."""

    class Out(Outputs):
        """Nothing: it writes a file."""

    def step(self, ctx: Context) -> Out:
        """Record, and say what was recorded."""
        path = user_path(self.out)
        if path.suffix != ".mcap":
            raise BadInput(f"record: out={self.out:.100} is no .mcap; type out=camera.mcap")
        capture = opened(str(self.device))
        ctx.doing("recording; Ctrl-C ends it")
        try:
            written = self._record(ctx, capture, path)
        finally:
            capture.release()
        print(f"{path}: {written} images; log={path} reads it")
        return self.Out()

    def _record(self, ctx: Context, capture: Any, path: Path) -> int:
        first = self._first(capture)
        written, begin, due = 0, time.monotonic(), 0.0
        with LogWriter(path) as log:
            log.attach("camera.yaml", write_camera(self._camera(first)).encode())
            pixels: Pixels | None = first
            try:
                while pixels is not None and (self.seconds is None or time.monotonic() - begin < self.seconds):
                    now = time.monotonic() - begin
                    if now >= due:
                        stamp, due = time.time_ns(), max(due + 1.0 / self.rate_hz, now)
                        _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, self.quality])
                        image = make_message(MESSAGE, {"format": "jpeg", "data": data.tobytes()}, stamp)
                        log.write(TOPIC, MESSAGE, stamp, image, stamp)
                        written += 1
                        ctx.progress(written, None)
                    pixels = read(capture)
            except KeyboardInterrupt:
                pass  # that is how it ends
        return written

    def _first(self, capture: Any) -> Pixels:
        until = time.monotonic() + WAIT_S
        while (pixels := read(capture)) is None:
            if time.monotonic() > until:
                raise BadInput(f"camera {self.device!s:.100} gives no image; does another program use it?")
            time.sleep(0.05)
        return pixels

    def _camera(self, pixels: Pixels) -> Camera:
        name = f"camera {self.device!s:.100}"
        if self.camera is None:
            camera, sentence = assumed_camera(name, pixels)
            print(f"assumed: {sentence}")
            return camera
        return named_camera(self.camera, lambda: pixels.shape[1::-1])[0]


def opened(device: str) -> Any:
    """A camera by its number or file. Raises BadInput."""
    if not device.isdecimal() and not Path(device).exists():
        raise BadInput(f"there is no camera {device:.100}; type device=0 (its number), or its file as /dev/video0")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what OpenCV says of it is said below
    capture = cv2.VideoCapture(int(device) if device.isdecimal() else str(Path(device).absolute()))
    if not capture.isOpened():
        raise BadInput(f"camera {device:.100} cannot be opened; is it plugged in, and free? type device=NUMBER")
    return capture


def read(capture: Any) -> Pixels | None:
    """The next image; None where there is none."""
    there, pixels = capture.read()
    return np.asarray(pixels, np.uint8) if there else None
