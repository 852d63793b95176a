"""Records a camera that is plugged into this computer, as a log."""

import time
from pathlib import Path
from typing import Annotated

from omninav.pipeline import BadInput, Bounds, Context, Tool, counted, user_path
from omninav.pipeline.mcap.writer import written_log
from omninav.stages.live.camera_device import MESSAGE, TOPIC, CameraDevice, device_camera, image_message
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.values.image import Pixels


class RecordCamera(Tool):
    """Writes the images of a webcam, or of another camera that OpenCV reads, as an MCAP log, until Ctrl-C.

    Each image has the time at which it was read, and is kept as JPEG; camera.yaml is attached. Images that come faster
    than `rate_hz` are left out. Raises BadInput where there is no such camera, or nothing states how it is to be read.
    """

    example = "device=0 camera=perspective out=drive.mcap"

    camera: str | None = None
    """Its camera.yaml, or a projection (equirectangular, dual_fisheye, fisheye, donut, perspective)."""
    device: int | str = 0
    """Number of the camera, or its file as /dev/video0; a video serves as a camera too."""
    out: str = "camera.mcap"
    """The log to write."""
    seconds: Annotated[float, Bounds(gt=0)] | None = None
    """Duration of the recording; null: until Ctrl-C, or until the camera ends."""
    rate_hz: Annotated[float, Bounds(gt=0, le=1e6)] = 10.0
    """Images per second at most."""
    quality: Annotated[int, Bounds(ge=1, le=100)] = 92
    """Quality of the JPEGs, 1 to 100."""

    def run(self, ctx: Context) -> None:
        """Record, and report what was recorded."""
        path = user_path(self.out)
        if path.suffix != ".mcap":
            raise BadInput(f"record: out={self.out:.100} is no .mcap; type out=camera.mcap")
        if path.exists():
            raise BadInput(f"record: {path} is there; type another name, or delete it")
        device = CameraDevice(str(self.device))
        ctx.status("recording; Ctrl-C ends it")
        try:
            written = self._record(ctx, device, path)
        finally:
            device.close()
        print(f"{path}: {counted(written, 'image')}; log={path} reads it")

    def _record(self, ctx: Context, device: CameraDevice, path: Path) -> int:
        first = device.first()
        written, begin, due = 0, time.monotonic(), 0.0
        camera, assumed = device_camera(device.name, self.camera, first)
        if assumed:
            print(f"assumed: {assumed}")
        with written_log(path) as log:
            log.attach("camera.yaml", write_camera(camera).encode())
            pixels: Pixels | None = first
            try:
                while pixels is not None and (self.seconds is None or time.monotonic() - begin < self.seconds):
                    now = time.monotonic() - begin
                    if now >= due:
                        stamp, due = time.time_ns(), max(due + 1.0 / self.rate_hz, now)
                        log.append(TOPIC, MESSAGE, stamp, image_message(pixels, stamp, self.quality))
                        written += 1
                        ctx.progress(written, None)
                    pixels = device.read()
            except KeyboardInterrupt:
                pass  # that is how it ends
        return written
