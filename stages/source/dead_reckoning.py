"""Motion where nothing measured it: turns by a visual compass, and a guessed speed."""

import math
from collections.abc import Iterable

import cv2
import numpy as np

from omninav.pipeline import BadInput, Context, State
from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.geometry.appearance.visual_compass import turn_between
from omninav.stages.geometry.arrays import Floats
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.unwarp.table import RemapTable, remap_table
from omninav.stages.values.image import Image, column_azimuths
from omninav.stages.values.pose import AssumedMotion, Motion

COLUMNS, ROWS = 360, 24
"""Size of the panoramas that the compass compares, pixels."""
BAND = math.radians(30.0)
"""Elevation (rad) above and below the horizon that they reach: the surroundings turn, floor and sky do not."""
BLUR_PX = 1.0
"""Standard deviation of the blur of their columns: between images, leaves and noise change."""
NOMINAL_SPEED = 0.5
"""Metres per second of a path that is only drawn."""
GUESSED_S = 0.5
"""Seconds for which a speed may be off one way: variances of guesses grow in proportion to time, so that images add up
to the same at any rate, and this interval is that of two images a second, at which it was measured."""
MIN_SPEED_SIGMA = 0.5
"""Metres per second by which any guessed speed may be off, for `GUESSED_S`."""
COMPASS_SIGMA = math.radians(3.0)
"""Standard deviation of a turn that the compass finds between two images (rad), near walls that pass by."""
BLIND_SIGMA = 0.5
"""Radians per second that a robot may turn, for `GUESSED_S`, where a camera sees too little of the circle for a
compass."""
VISUAL_ODOMETRY = "visual_odometry"
"""Node that sees the motion in the images, so that none has to be guessed for what reads it."""
SCENE = "scene"
"""Node that looks for the robot's own body, and does without motion."""


class VisualCompass:
    """Keeps of each image a small panorama, and tells turns from two of them."""

    def __init__(self) -> None:
        self._camera: Camera | None = None
        self._table: RemapTable | None = None

    def view(self, image: Image, camera: Camera) -> Floats | None:
        """Part of an image that is kept: (rows, columns) grey about the horizon; None without the full circle."""
        if camera is not self._camera:
            self._camera, self._table = camera, _table(camera)
        if self._table is None:
            return None
        grey = cv2.cvtColor(self._table.remap(image.pixels), cv2.COLOR_BGR2GRAY).astype(np.float32)
        ends = int(4 * BLUR_PX)
        around = np.concatenate([grey[:, -ends:], grey, grey[:, :ends]], axis=1)
        return np.asarray(cv2.GaussianBlur(around, (0, 0), BLUR_PX)[:, ends:-ends], np.float32)


class DeadReckoning(State):
    """Position of a source by its odometry, measured or guessed (m, rad), and what the compass keeps of the last image
    (`view`)."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    view: Floats | None = None

    def advance(self, motion: Motion) -> None:
        """Add a motion."""
        moved = compose((self.x, self.y, self.heading), (motion.x, motion.y, motion.turn))
        self.x, self.y, self.heading = (float(value) for value in moved)


def dead_reckon(
    compass: VisualCompass, speed: float, position: DeadReckoning, image: Image, camera: Camera, seconds: float | None
) -> AssumedMotion | None:
    """The assumed motion to an image, by which `position` moves on; None at the first image of a log.

    `speed`: m/s. `seconds`: since the image before; None: there is none.
    """
    before, position.view = position.view, compass.view(image, camera)
    if seconds is None:
        return None
    motion = assumed_motion(before, position.view, seconds, speed)
    position.advance(motion)
    return motion


def assumed_motion(before: Floats | None, after: Floats | None, seconds: float, speed: float) -> AssumedMotion:
    """Straight on by a guessed speed (m/s) for some seconds, with half of the turn before and half of it after."""
    turn, sigma_turn = 0.0, BLIND_SIGMA * math.sqrt(seconds * GUESSED_S)
    if before is not None and after is not None:
        turn, sigma_turn = turn_between(before, after), COMPASS_SIGMA
    way = speed * seconds
    sigma_m = max(speed, MIN_SPEED_SIGMA) * math.sqrt(seconds * GUESSED_S)
    return AssumedMotion(way * math.cos(turn / 2), way * math.sin(turn / 2), turn, sigma_m, sigma_turn)


def assumed_speed(ctx: Context, name: str, camera: Camera | None, speed: float | None, has_truth: bool) -> float:
    """The speed (m/s) by which a log without odometry and positions is driven, with a warning.

    `name`: of the log. `camera`: None where it is not known yet.
    Where none is given, a nominal one, for drawing. Raises `UnreadableRecording` where a node reads motion tick by
    tick and none is given, or one makes a map of positions and the speed is 0, naming it and what to type.
    """
    maps = [] if has_truth else ctx.readers.get("odometry", [])  # with it, positions are true
    everyone = list(dict.fromkeys([*ctx.readers.get("motion", []), *maps]))
    maps, readers = ([each for each in some if each not in (VISUAL_ODOMETRY, SCENE)] for some in (maps, everyone))
    if speed is None and readers:
        raise UnreadableRecording(
            f"{name} has neither odometry nor a position for every image, needed by {_listed(readers)}; type "
            "speed=0.5 to guess it (m/s, turns are seen in the images), or take a variant that sees motion in the "
            "images (omninav; of others that have a particle filter: landmarks=sift) or needs none: "
            "topological_localisation"
        )
    if maps and not speed:
        raise UnreadableRecording(
            f"{name}: with speed=0 all its images were taken at one place, and {_listed(maps)} makes a map of "
            "positions; type speed=0.5 (m/s)"
        )
    if VISUAL_ODOMETRY in everyone:
        ctx.warn(f"No odometry in {name}: motion is seen in the images")
        return NOMINAL_SPEED if speed is None else speed
    if speed is None:
        ctx.warn(f"No odometry in {name}: its path is drawn as if driven at {NOMINAL_SPEED:g} m/s (speed=… sets it)")
        return NOMINAL_SPEED
    path = f", and {_listed(maps)} places its references along that path" if maps else ""
    around = camera is None or _table(camera) is not None
    turns = "seen in the images" if around else "not known, as its camera does not see the full circle"
    ctx.warn(f"No odometry in {name}: guessed from a speed of {speed:g} m/s; turns are {turns}{path}")
    return speed


def _listed(nodes: Iterable[str]) -> str:
    return " and ".join(f"'{node}'" for node in nodes)


def _table(camera: Camera) -> RemapTable | None:
    """The panorama about the horizon of a camera, or of the middle of what it sees; None without the full circle."""
    try:
        seen = camera.elevations
    except BadInput:
        return None
    if seen is None:
        return None
    top, bottom = min(seen[0], BAND), max(seen[1], -BAND)
    if top <= bottom:
        top, bottom = seen
    elevations = top + (bottom - top) * (np.arange(ROWS) + 0.5) / ROWS
    return remap_table(camera, unit_vectors(column_azimuths(COLUMNS), elevations[:, None]))[0]
