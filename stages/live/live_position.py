"""The position of a live run: in time, in the odometry's frame, and in what it has seen."""

from collections.abc import Callable

import numpy as np

from omninav.pipeline import State, Tick
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Floats
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.recordings.live_record import Frame
from omninav.stages.source.outputs import motion_of
from omninav.stages.values.image import Image
from omninav.stages.values.pose import AssumedMotion, Motion

Guess = Callable[["LiveSourceState", Image, Camera, float | None], AssumedMotion | None]
"""Says the motion to an image, seconds after the one before, and goes on with the position."""


class LiveSourceState(State):
    """Ticks made, logs begun (a clock that is set back begins one), and of the last tick the stamp (ns), the odometry
    pose (m, rad), measured or guessed, the seconds of odometry not believed, and what the compass keeps of the image.
    `first` and `ended`: stamps of the first tick, and of that at which the planned route ended (0: it has not)."""

    ticks: int = 0
    log: int = 0
    stamp: int = 0
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    unmeasured_s: float = 0.0
    view: Floats | None = None
    first: int = 0
    ended: int = 0

    def turn(self, stamp: int) -> tuple[Tick, float | None]:
        """The tick of an image, and the seconds since the one before; None at the first of a log."""
        first = self.ticks == 0 or stamp <= self.stamp
        self.log += first and self.ticks > 0
        seconds = None if first else (stamp - self.stamp) / 1e9
        tick = Tick(index=self.ticks, stamp=stamp, log=self.log, frame=self.ticks, first_of_log=first)
        self.ticks, self.stamp, self.first = self.ticks + 1, stamp, self.first or stamp
        return tick, seconds

    def move(
        self, guess: Guess | None, image: Image, camera: Camera, seconds: float | None, frame: Frame
    ) -> Motion | None:
        """Go on to an image, `seconds` after the one before; gives the motion, None at the first of a log.

        By the frame's odometry where no `guess` takes its place.
        """
        if guess is not None:
            if seconds is None:
                self.x = self.y = self.heading = 0.0
            return guess(self, image, camera, seconds)
        assert frame.odometry is not None  # an image that odometry does not reach is no tick
        before = np.array([self.x, self.y, self.heading])
        unmeasured_s = abs(frame.unmeasured_s - self.unmeasured_s)
        self.x, self.y, self.heading = frame.odometry.tolist()
        self.unmeasured_s = frame.unmeasured_s
        return None if seconds is None else motion_of(between(before, frame.odometry), unmeasured_s)
