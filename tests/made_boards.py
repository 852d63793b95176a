"""Checkerboards around cameras that are known."""

import numpy as np
from scipy.spatial.transform import Rotation

from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.unwarp.checkerboard_calibration import board_points

MIRROR = HyperbolicMirror(640, 480, 497.0, 497.0, 322.0, 236.0, 28.095, 23.4125, 34.0, 238.0)
LENS = Fisheye(640, 480, 150.0, 316.0, 243.0, 236.0)
COLUMNS, ROWS = 6, 5


def boards(elevation: float, count: int = 6) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses of boards around the camera, facing it, turned and tilted: rotation, and place in squares."""
    found = []
    for number in range(count):
        away = unit_vectors(2 * np.pi * number / count + 0.3, elevation)
        side = np.cross([0.0, 0.0, 1.0], away)
        side /= np.linalg.norm(side)
        facing = np.stack([side, np.cross(away, side), away], axis=1)
        rotation = (
            facing @ Rotation.from_euler("xyz", [0.4 * (-1) ** number, 0.2 * (number - 2), 0.3 * number]).as_matrix()
        )
        place = 7.0 * away - rotation @ np.array([(COLUMNS - 1) / 2, (ROWS - 1) / 2, 0.0])
        found.append((rotation, place))
    return found


def seen(camera: Camera, elevation: float) -> list[np.ndarray]:
    points = [board_points(COLUMNS, ROWS) @ rotation.T + place for rotation, place in boards(elevation)]
    return [camera.project(each)[0] for each in points]


def worst_deg(camera: Camera, true: Camera) -> float:
    """Largest angle between the rays of the two cameras, over the pixels where boards were."""
    pixels = np.concatenate(seen(true, -0.1))
    one, other = camera.unproject(pixels)[0], true.unproject(pixels)[0]
    return float(np.degrees(np.arccos(np.clip((one * other).sum(axis=1), -1, 1)).max()))
