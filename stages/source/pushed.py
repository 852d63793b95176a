"""The source of a program's own loop: one tick for every image that is pushed."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from omninav.pipeline import BadInput, Context, Source, State, Tick, cut, digest_text, user_path, wrong_output
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.recordings.camera_yaml import parse_camera, write_camera
from omninav.stages.recordings.messages import is_blank
from omninav.stages.recordings.named_camera import named_camera
from omninav.stages.recordings.opening import ring_found_in
from omninav.stages.recordings.plausibility import MotionLimits
from omninav.stages.values.command import Command
from omninav.stages.values.encoded_image import MAX_FILE_BYTES, MAX_PIXELS, Undecodable, decode_image
from omninav.stages.values.image import Image, Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.scan import Scan

from .dead_reckoning import SCENE
from .outputs import DriveOutputs, motion_of, pose_of

INTERVAL_NS = 100_000_000
"""Time between images that come without a time stamp, ns."""
MAX_STAMP_NS = 10**9 << 31
"""Nanoseconds since 1970 below which a stamp is: ROS counts seconds in 31 bits."""
MAX_NUMBER = 1e8
"""Largest accepted coordinate of a pose (m, rad)."""
MAX_READINGS = 100_000
"""Largest accepted number of readings of a ring of ranges."""
MAX_MOTION_M = 1000.0
"""Largest motion between two images, m: more than any robot drives unseen. A drive that begins elsewhere is a
`new_log`."""
ANY_SIZE = (64, 32)
"""Width and height (pixels) by which a camera's name is tried: every model that a size is enough for takes it."""
LIMITS = MotionLimits()
"""Largest speeds of a robot that are not warned of."""


class PushedFrame(NamedTuple):
    """Inputs that came with an image; `rows`: motion, odometry and truth, (3,) each."""

    image: Image
    stamp: int | None
    rows: dict[str, Array | None]
    scan: Scan | None
    new_log: bool


class PushedSourceState(State):
    """Ticks made, the present log and its next frame, the last stamp (ns), the last pose by odometry and whether
    the present log's began with one (`placed`), and what its images have shown of a camera that leaves something open
    (a camera.yaml)."""

    ticks: int = 0
    log: int = 0
    frame: int = 0
    stamp: int = -INTERVAL_NS
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    placed: bool = False
    camera: str = ""


class PushedSource(Source):
    """Takes images that a program pushes, each with what it knows of motion and pose: a tick for every one.

    It gives what `LogSource` gives of a recording, so that both lead to the same results. Poses are metres and radians.
    """

    repeatable = False

    camera: str | None = None
    """A camera.yaml, or the name of a camera (equirectangular, fisheye, …), of the images."""

    class Out(DriveOutputs):
        """Inputs known at an image."""

    def setup(self, ctx: Context) -> None:
        self._frame: PushedFrame | None = None
        self._opened: Camera | None = None
        self._whole: Camera | None = None
        if self.camera is not None and user_path(self.camera).is_file():
            self._opened = self._camera_of(self.camera, (0, 0))

    def inputs_digest(self) -> str | None:
        """Hash of the camera, where a file describes it fully. Raises `BadInput` where there is none."""
        if self.camera is None:
            raise BadInput("camera: what took the images is not known; type camera=FILE.yaml or camera=NAME")
        camera = self._camera_of(self.camera, ANY_SIZE)  # a name that is none is refused before the first image
        return digest_text(write_camera(camera)) if user_path(self.camera).is_file() else None

    def push(
        self,
        image: Pixels | bytes,
        motion: Sequence[float] | None = None,
        stamp: int | None = None,
        odometry: Sequence[float] | None = None,
        truth: Sequence[float] | None = None,
        scan: Scan | None = None,
        new_log: bool = False,
    ) -> None:
        """Take a frame for the next tick. Raises `BadInput` where something of it cannot be used.

        `image`: pixels, (rows, columns, 3) uint8 blue-green-red as OpenCV reads them or (rows, columns) grey, or the
        bytes of a JPEG or PNG file. What is given is copied. `motion`: (forward m, left m, counter-clockwise rad) since
        the image before, or `odometry`: the robot's pose (x m, y m, heading rad) in the odometry's own frame, from
        which motion follows. `stamp`: nanoseconds; None: a tenth of a second after the image before. `truth`: the true
        pose in the map frame, for metrics only. `scan`: range readings, for variants that keep clear of obstacles.
        `new_log`: the robot has been put elsewhere, or another drive begins: there is no motion from the image before,
        and `stamp` may be earlier.
        """
        pixels = _pixels(image)
        if stamp is not None and (isinstance(stamp, bool) or not isinstance(stamp, int | np.integer)):
            raise BadInput(f"step: stamp={cut(stamp)}, expected whole nanoseconds; seconds are int(seconds * 1e9)")
        if stamp is not None and not 0 <= int(stamp) < MAX_STAMP_NS:
            raise BadInput(
                f"step: stamp={cut(stamp)}, expected nanoseconds since 1970, 0 or more and below {MAX_STAMP_NS}"
            )
        if not isinstance(new_log, bool | np.bool_):
            raise BadInput(f"step: new_log={cut(new_log)}, expected True or False")
        scan = _sound_scan(scan)
        rows = {"motion": motion, "odometry": odometry, "truth": truth}
        found = {name: None if row is None else _row(name, row) for name, row in rows.items()}
        if motion is not None and odometry is not None:
            raise BadInput(
                "step: motion=… and odometry=… are both given, and one follows from the other; leave one out"
            )
        self._frame = PushedFrame(Image(pixels), None if stamp is None else int(stamp), found, scan, bool(new_log))

    def step(
        self,
        ctx: Context,
        position: PushedSourceState,
        command: Command | None = None,
        route: PlannedRoute | None = None,
    ) -> Out | None:
        """The frame that was pushed; None without one. `command` and `route` are the caller's to obey."""
        frame, self._frame = self._frame, None
        if frame is None:
            return None
        image, stamp, rows, scan, new_log = frame
        stamp = position.stamp + INTERVAL_NS if stamp is None else stamp
        first = position.ticks == 0 or new_log
        if not first and stamp <= position.stamp:
            raise BadInput(
                f"step: stamp={stamp} is not after that of the image before ({position.stamp}); leave this frame out, "
                "or start a new log with new_log=True"
            )
        camera = self._camera(image.pixels)
        if not camera.complete:
            camera = self._completed(ctx, camera, image.pixels, position, new_log)
        if new_log and position.ticks:
            position.log, position.frame = position.log + 1, 0
        before = np.array([position.x, position.y, position.heading])
        motion, odometry = rows["motion"], rows["odometry"]
        if odometry is None:
            odometry = compose(before, motion) if motion is not None else before
        elif motion is None and position.placed and not new_log:
            motion = between(before, odometry)
        driven = 0.0 if motion is None or first else float(np.hypot(motion[0], motion[1]))
        if driven > MAX_MOTION_M:
            raise BadInput(
                f"step: {driven:g} m since the image before, expected at most {MAX_MOTION_M:g}; "
                "leave it out, or start a new log with new_log=True"
            )
        seconds = 1.0 if frame.stamp is None else (stamp - position.stamp) / 1e9
        turned = 0.0 if motion is None or first else abs(float(motion[2]))
        if not first and (driven > LIMITS.speed * seconds or turned > LIMITS.turn * seconds):
            ctx.warn(
                f"a motion of {driven:.3g} m and {turned:.3g} rad in {seconds:.3g} s is faster than robots are: "
                "are these metres and radians since the image before?"
            )
        measured = rows["motion"] is not None or rows["odometry"] is not None
        if measured:
            ctx.fact("odometry", "measured")
        elif not first and (readers := [each for each in ctx.readers.get("motion", ()) if each != SCENE]):
            reader = readers[0]
            ctx.count("no_motion", detail=f"frame {position.ticks} came without motion, which '{reader}' reads")
            ctx.warn(f"frames came without motion, which '{reader}' reads: push motion=(x, y, turn), or odometry=")
        tick = Tick(position.ticks, stamp, position.log, position.frame, first)
        position.ticks, position.frame, position.stamp = position.ticks + 1, position.frame + 1, stamp
        position.x, position.y, position.heading = (float(number) for number in odometry)
        position.placed = measured or (position.placed and not new_log)
        return self.Out(
            tick=tick,
            image=image,
            camera=camera,
            odometry=pose_of(odometry) if measured else None,
            motion=None if motion is None or first else motion_of(motion),
            truth=pose_of(rows["truth"]),
            scan=scan,
        )

    def _camera(self, pixels: Pixels) -> Camera:
        size = pixels.shape[1], pixels.shape[0]
        if self._opened is None:
            self._opened = self._camera_of(str(self.camera), size)
        camera = self._opened
        if (camera.width, camera.height_px) != size:
            wanted = f"{camera.width} x {camera.height_px}"
            raise BadInput(f"step: the image has {size[0]} x {size[1]} pixels, and the camera takes {wanted}")
        return camera

    def _completed(
        self, ctx: Context, camera: Camera, pixels: Pixels, position: PushedSourceState, new_log: bool
    ) -> Camera:
        """A camera with what it leaves open, as the first image of the log shows it; each log has its own."""
        if new_log:
            position.camera, self._whole = "", None
        if self._whole is None:
            whole = parse_camera(position.camera, "camera") if position.camera else camera.found_in(pixels)
            if whole is None:
                raise BadInput(
                    "step: no ring of a mirror is found in the image; leave this frame out, or give centre and mask "
                    "in a camera.yaml"
                )
            if not position.camera and whole.ring is not None:
                ctx.warn(f"assumed: {ring_found_in('the images', whole.ring, position.ticks)}")
            position.camera, self._whole = write_camera(whole), whole
        return self._whole

    def _camera_of(self, name: str, size: tuple[int, int]) -> Camera:
        return named_camera(name, lambda: size)[0]


def _pixels(image: Pixels | bytes) -> Pixels:
    if isinstance(image, bytes | bytearray | memoryview):
        size = memoryview(image).nbytes
        if size > MAX_FILE_BYTES:
            raise BadInput(f"step: image has {size:,} bytes, expected at most {MAX_FILE_BYTES:,}")
        try:
            image = decode_image(bytes(image))
        except Undecodable as error:
            raise BadInput(f"step: the image cannot be decoded ({error}); leave this frame out") from None
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.shape[2:] not in ((), (3,)):
        kind = f"{image.dtype}{image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise BadInput(f"step: image is {kind}, expected uint8 of (rows, columns, 3), or the bytes of an image file")
    _refuse_masked("image", image)
    if image.ndim < 2 or not image.size:
        raise BadInput(f"step: image has the shape {image.shape}, expected (rows, columns, 3)")
    if image.shape[0] * image.shape[1] > MAX_PIXELS:
        size_in_words = f"{image.shape[1]:,} x {image.shape[0]:,}"
        raise BadInput(f"step: image has {size_in_words} pixels, expected at most {MAX_PIXELS:,}")
    own: Pixels = np.array(image, order="C")  # the caller's may change
    image = own if own.ndim == 3 else np.asarray(cv2.cvtColor(own, cv2.COLOR_GRAY2BGR), np.uint8)
    if is_blank(image):
        raise BadInput("step: the image is blank; leave this frame out")
    return image


def _sound_scan(scan: Scan | None) -> Scan | None:
    if scan is None:
        return None
    if isinstance(scan, Scan) and np.size(scan.ranges) > MAX_READINGS:
        raise BadInput(f"step: scan has {np.size(scan.ranges):,} readings, expected at most {MAX_READINGS:,}")
    wrong = wrong_output(scan, Scan, optional=False)
    if wrong is not None:
        raise BadInput(f"step: scan {wrong}")
    _refuse_masked("scan", scan.ranges)
    return replace(scan, ranges=np.array(scan.ranges))


def _refuse_masked(name: str, given: object) -> None:
    """Refuse an array with values that its owner has masked: they are not known, and would be taken as valid."""
    if np.ma.is_masked(given):
        raise BadInput(f"step: {name} has masked values, expected an array without a mask; fill them, or leave it out")


def _row(name: str, given: Sequence[float]) -> Array:
    row = np.empty(0)
    _refuse_masked(name, given)
    with suppress(TypeError, ValueError, OverflowError, LookupError):  # no three numbers; a large array is not copied
        if len(given) == 3 and np.ndim(given[0]) == 0 and not isinstance(given, str | bytes | Mapping):
            row = np.array([math.nan if np.iscomplexobj(number) else float(number) for number in given])
    if row.shape != (3,) or not (np.abs(row) <= MAX_NUMBER).all():  # NaN too
        raise BadInput(
            f"step: {name}={cut(given)}, expected three finite numbers (m, m, rad), not complex, within {MAX_NUMBER:g}"
        )
    return row
