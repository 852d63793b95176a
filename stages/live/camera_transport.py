"""A camera that is plugged into this computer, in the place of a robot: its images come as a robot's do."""

import threading
import time
from contextlib import suppress

from omninav.pipeline import BadInput
from omninav.stages.values.image import Pixels

from .camera_device import MESSAGE, TOPIC, CameraDevice, image_message
from .transport import RawMessage, Transport, opened

QUALITY = 92
"""Quality of the JPEGs that are recorded."""
REOPEN_S = 1.0
"""Interval at which an unplugged camera is looked for."""


class CameraTransport(Transport):
    """Gives the newest image of a camera on `TOPIC`, and sends nothing. A video is given at its own pace, and ends."""

    def __init__(self, device: str) -> None:
        super().__init__()
        self.device = CameraDevice(device)
        self.first = self.device.first()
        """The image by which the camera is known."""
        self._changed = threading.Condition()
        self._newest: tuple[int, Pixels] | None = None
        self._over = False
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._look, name="camera", daemon=True)

    def subscribe(self, topic: str, msgtype: str, newest: bool = False, latched: bool = False) -> None:
        """Look from now on, where the topic is that of the images."""
        if topic == TOPIC and not self._thread.is_alive():
            self._thread.start()

    def publish(self, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
        """Nobody is there."""

    def offered(self) -> dict[str, str]:
        """The images."""
        return {TOPIC: MESSAGE}

    def take(self, timeout_s: float = 0.0) -> RawMessage | None:
        """The newest image, if there is one since the last."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not None, timeout_s)
            newest, self._newest = self._newest, None
        if newest is None:
            return None
        stamp, pixels = newest
        return RawMessage(TOPIC, MESSAGE, stamp, image_message(pixels, stamp, QUALITY))

    @property
    def ended(self) -> bool:
        """Tells whether a video has ended, and its last image has been taken."""
        with self._changed:
            return self._over and self._newest is None

    def close(self) -> None:
        """Leave the camera to other programs."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join(timeout=2.0)
        self.device.close()

    def _look(self) -> None:
        while not self._closed.wait(self.device.period_s):
            pixels = self.device.read()
            if pixels is not None:
                with self._changed:
                    self.queue.overtaken[TOPIC] += self._newest is not None
                    self._newest = time.time_ns(), pixels
                    self._changed.notify()
            elif self.device.is_video:
                with self._changed:
                    self._over = True
                return
            elif not self._closed.wait(REOPEN_S):
                with suppress(BadInput):  # until it is there again
                    self.device.reopen()


def connect_camera(device: str) -> CameraTransport:
    """The camera of this computer, opened when it is first asked for. Raises `BadInput` where it is not there."""
    return opened(("camera", device), lambda: CameraTransport(device))
