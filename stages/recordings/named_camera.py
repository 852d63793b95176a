"""The camera of images that do not state it: named by a user, or assumed where they look like one."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from omninav.pipeline import nearest, user_path
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.model import Camera, camera_models
from omninav.stages.values.image import Pixels

from .camera_yaml import read_camera
from .recording import UnreadableRecording

DARK = 24
"""Mean grey level of what is outside the circles of two fisheyes; JPEG and video compression let no black be 0."""

MIN_ASPECT = 1.5
"""Smallest ratio of columns to rows of an image that goes full circle."""


def named_camera(name: str, size: Callable[[], tuple[int, int]]) -> tuple[Camera, list[Path]]:
    """The camera of a camera.yaml, or of a projection of which an image's size is enough, and the files it is from.

    `size`: gives width and height of an image (pixels). Raises `UnreadableRecording` for a projection that needs more.
    """
    path, models = user_path(name), camera_models()
    if name not in models and (path.exists() or path.suffix in (".yaml", ".yml") or len(path.parts) > 1):
        return read_camera(path), [path]
    width, height = size() if name in models else (0, 0)
    if name == "dual_fisheye" and width < 1.5 * height:
        raise UnreadableRecording(
            f"camera={name}: images of {width} x {height} are no two fisheyes side by side; join a video's two tracks: "
            "`ffmpeg -i VIDEO -filter_complex [0:v:0][0:v:1]hstack both.mp4`"
        )
    if name == "equirectangular" and width < MIN_ASPECT * height:
        raise UnreadableRecording(
            f"camera={name}: images of {width} x {height} are no equirectangular ones, twice as wide as high, "
            "or wider where they are a strip; a mirror's are camera=donut, or better a camera.yaml with its numbers"
        )
    camera = models[name].of_size(width, height) if name in models else None
    if camera is None:
        known = [model for model, kind in models.items() if kind.of_size(64, 32) is not None]
        near = nearest(name, known)
        what = "needs its numbers" if name in models else "there is no such file or projection"
        hint = f"did you mean '{near}'?" if near else f"type camera=PATH/camera.yaml, or one of {', '.join(known)}"
        raise UnreadableRecording(f"camera={name:.60}: {what}; {hint}")
    return camera, []


def assumed_camera(name: str, pixels: Pixels) -> tuple[Camera, str]:
    """The camera of a log's images where nobody states it, by one of them, and a sentence on what was assumed.

    Raises `UnreadableRecording` saying what to type, where they are not twice as wide as high.
    """
    height, width = pixels.shape[:2]
    if width != 2 * height:
        raise UnreadableRecording(
            f"{name}: nothing states how its images of {width} x {height} are to be read; type "
            "camera=PATH/camera.yaml, or camera=perspective (an ordinary camera), donut (a mirror), fisheye, "
            "dual_fisheye or equirectangular (from straight up to straight down); a panorama strip needs a camera.yaml "
            "(projection: cylindrical, or equirectangular with its elevations)"
        )
    if _two_circles(pixels):
        raise UnreadableRecording(
            f"{name}: this looks like two fisheyes side by side; type camera=dual_fisheye, or export it as "
            "equirectangular with the camera's own program"
        )
    sentence = f"{name}: equirectangular, as images twice as wide as high are (camera=… says otherwise)"
    return Equirectangular.of_size(width, height), sentence


def _two_circles(pixels: Pixels) -> bool:
    """Tells if an image twice as wide as high is dark outside two circles side by side, not in the same rows inside.

    A panorama without a zenith is dark there too, but all around.
    """
    height, width = pixels.shape[:2]
    rows, columns = np.mgrid[0:height, 0:width]
    across, down = (columns % height) - (height - 1) / 2, rows - (height - 1) / 2
    away = np.hypot(across, down)
    ends = abs(down) > 0.3 * height
    outside, inside = pixels[ends & (away > 0.53 * height)], pixels[ends & (away < 0.45 * height)]
    return bool(len(inside) and outside.mean() < DARK and inside.mean() > 2 * DARK)
