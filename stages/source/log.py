"""The source of recorded drives: one tick per usable image."""

import math
from dataclasses import replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.recordings.image_folder import ImageFolder
from omninav.stages.recordings.live_record import LiveRecording
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording, Topics, UnreadableRecording
from omninav.stages.recordings.topic_recording import TopicRecording
from omninav.stages.values.image import Image
from omninav.stages.values.pose import AssumedPose, Motion, Pose

from .dead_reckoning import VisualCompass, assumed_speed, dead_reckon
from .log_parts import LogPart
from .outputs import motion_of, pose_of
from .playback import Playback, PlaybackState

DISTANCE_NOISE = 0.1
"""Standard deviation of synthetic odometry's distance after one metre, metres; it grows with the root of the path."""
TURN_NOISE_PER_M = TURN_NOISE_PER_RAD = math.radians(3.0)
"""Standard deviation of synthetic odometry's heading after one metre, and what a turn of one radian adds to it, rad."""


class LogSource(Playback):
    """Plays recorded drives one after another: a tick for every image that can be used.

    Poses are metres and radians; stamps are header stamps. `motion` is the SE(2) increment of the odometry between the
    images' own times, absent at the first image of each log; where images are left out it spans the gap.

    A recording without odometry but with positions gets a synthetic one (`odometry: synthetic` in the manifest): the
    true increment with the noise of `synthetic_increment`, drawn frame by frame from the run's seed. Raises
    `UnreadableRecording` for a log that cannot be read.

    A log without odometry and positions (a video, images alone) is driven by a guess: `speed_m_s` straight ahead, and
    the turns that a visual compass finds (`odometry: guessed`). A graph that reads its motion tick by tick is refused
    (`UnreadableRecording`) until that speed is stated.
    """

    log: str | tuple[str, ...] | None = None
    """One recording or several (see `open_recording`)."""
    topics: Topics = Topics()
    """Which topics of the log are read."""
    camera: str | None = None
    """A camera.yaml in place of the log's own, or a projection (`equirectangular`, …)."""
    layout_folders: tuple[str, ...] = ()
    """Folders with further descriptions of folders of images."""
    speed_m_s: Annotated[float, Bounds(ge=0, le=100)] | None = None
    """The guessed speed of a log without odometry; it may be off by as much, or by 0.5 m/s where that is more. 0: only
    the compass's turns are known. Null: noisy positions where the log has some, else a nominal one, for drawing."""

    def setup(self, ctx: Context) -> None:
        """Open all logs; what is lost by then is counted."""
        super().setup(ctx)
        self._compass = VisualCompass()
        turned = sum(recording.turned for recording in self._opened if isinstance(recording, ImageFolder))
        if turned:
            ctx.fact("turned_images", f"{turned}, as their EXIF orientation says")
        mounted = {recording.mounted: None for recording in self._opened if isinstance(recording, TopicRecording)}
        if any(mounted):
            ctx.fact("camera_mounted", "; ".join(filter(None, mounted)))

    def check(self, ctx: Context) -> None:
        """Refuse a variant that needs odometry over a log that has none, where no speed is stated."""
        self._open()
        for part in self._parts:
            if part.kind == "guessed":
                self._assumed_speed(ctx, part)

    def recordings(self) -> list[Recording]:
        """Open the logs by their names."""
        names = (self.log,) if isinstance(self.log, str) else self.log
        if not names or None in names:
            raise UnreadableRecording("no recording is named; type log=PATH")
        topics = self.topics
        if self.truth is not None and self._truth_file is None:
            topics = replace(topics, truth=self.truth)
        return [
            open_recording(
                name, topics, self.camera, self.layout_folders, self.limits, self.rate_hz, self.truth_max_gap_s
            )
            for name in names
        ]

    def _begin(self, ctx: Context, part: LogPart) -> None:
        if part.kind == "synthetic":
            ctx.warn(f"No odometry in {part.recording.name}: made from its true positions, with noise")
        elif part.kind == "guessed":
            self._speed = self._assumed_speed(ctx, part)
        else:
            super()._begin(ctx, part)

    def _motion(
        self, ctx: Context, position: PlaybackState, part: LogPart, image: Image
    ) -> tuple[Pose | None, Motion | None]:
        if part.kind == "measured":
            return super()._motion(ctx, position, part, image)
        recording, frame = part.recording, int(part.frames[position.next])
        last = None if position.last < 0 else int(part.frames[position.last])
        motion: Motion | None = None
        if part.kind == "guessed":
            seconds = None if last is None else float(recording.stamps[frame] - recording.stamps[last]) / 1e9
            motion = dead_reckon(self._compass, self._speed, position, image, recording.camera, seconds)
        elif last is not None:
            motion = motion_of(
                synthetic_increment(between(part.driven[last], part.driven[frame]), ctx.rng.standard_normal(2))
            )
            position.advance(motion)
        odometry = np.array([position.x, position.y, position.heading])
        return pose_of(odometry, AssumedPose if part.kind == "guessed" else Pose), motion

    def _guesses(self) -> bool:
        return self.speed_m_s is not None

    def _assumed_speed(self, ctx: Context, part: LogPart) -> float:
        placed = part.truth is not None and not isinstance(part.recording, LiveRecording)
        return assumed_speed(ctx, part.recording.name, part.recording.camera, self.speed_m_s, placed)


def synthetic_increment(increment: Array, noise: Array) -> Array:
    """A true increment of motion (3,) as a poor odometry would have measured it.

    `noise`: two independent standard normal numbers n1, n2. With d the length of the increment (m) and t its turn
    (rad), the length becomes d + DISTANCE_NOISE sqrt(d) n1 and the turn t + e, e = sqrt(TURN_NOISE_PER_M^2 d +
    TURN_NOISE_PER_RAD^2 |t|) n2; the translation is turned by e / 2, as if the error had grown evenly on the way.
    Variances grow with the way, so that cutting it into more frames changes nothing. The model is the odometry motion
    model of Thrun, Burgard & Fox, Probabilistic Robotics (2005), section 5.4, with variances in place of standard
    deviations.
    """
    length, turn = math.hypot(increment[0], increment[1]), abs(float(increment[2]))
    error = math.sqrt(TURN_NOISE_PER_M**2 * length + TURN_NOISE_PER_RAD**2 * turn) * float(noise[1])
    scale = 1.0 + DISTANCE_NOISE / math.sqrt(length) * float(noise[0]) if length > 0 else 1.0
    cos, sin = math.cos(error / 2) * scale, math.sin(error / 2) * scale
    x, y = float(increment[0]), float(increment[1])
    return np.array([cos * x - sin * y, sin * x + cos * y, float(increment[2]) + error])
