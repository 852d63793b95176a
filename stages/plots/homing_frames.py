"""A frame of a drive by homing: what is followed in the image, the target view, and the homing vector on the floor."""

import math

import numpy as np

from omninav.pipeline.report.chart import Layer
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.homing import LOST, DrivingStatus, HomingVector, PathProgress
from omninav.stages.values.image import Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import decoded, encoded
from omninav.stages.values.topological_map import TopologicalMap

from .draw_homing import draw_robot_view, draw_target_view, is_known
from .homing_snapshot import EncodedHomingView

COLOURS = (
    "Features in the robot's image: blue tracked, yellow found again, green matched again, orange crosses lost; in the "
    "target view those that are not followed are light."
)
"""Sentence of the caption that names the features' colours."""


def images(snapshot: EncodedHomingView, target: Pixels | None) -> list[tuple[str, bytes]]:
    """Captions and JPEG bytes: the robot's image with its features and the vector, and the target view."""
    seen = draw_robot_view(decoded(snapshot.jpeg), snapshot)
    if snapshot.vector is None:
        return [("image", encoded(seen))]
    going_to = draw_target_view(target, snapshot, snapshot.size)
    return [("image", encoded(seen)), (f"target: {snapshot.target or 'a view'}", encoded(going_to))]


def draw_vector(layer: Layer, pose: Array, vector: HomingVector | None, goal: Array) -> None:
    """The homing vector from the robot's true pose (3,), as long as by odometry or else a metre, dashed; a ring where
    the target view was truly taken, `goal` (3,)."""
    layer.ring(goal, "orange")
    if vector is None or not is_known(vector):
        return
    length = 1.0 if vector.metres is None else max(vector.metres, 0.05)
    towards = pose[2] + vector.direction
    tip = pose[:2] + length * np.array([math.cos(towards), math.sin(towards)])
    lost = not vector.is_found
    layer.line(np.stack([pose[:2], tip]), "grey" if lost else "orange", 2.2, dashed=lost or vector.metres is None)


def draw_route(layer: Layer, route: PlannedRoute | None, map: TopologicalMap) -> None:
    """The views of a planned route, joined."""
    if route is not None and len(route.places):
        layer.line(map.poses[map.views_along(route.places)[0]], "green", 2.0)


def facts(
    snapshot: EncodedHomingView, progress: PathProgress | None, status: DrivingStatus | None
) -> list[tuple[str, str]]:
    """Names and texts of the vector, the way along the path and the robot's state."""
    vector, found = snapshot.vector, []
    if vector is not None and not vector.is_found:
        found.append(("homing vector", f"the target is {vector.state}"))
    elif vector is not None:
        left = f"{100 * vector.ratio:.0f} % of the distance left"
        far = left if vector.metres is None else f"{vector.metres:.2f} m"
        found.append(("homing vector", f"{far}, turn {math.degrees(vector.turn):.0f}°"))
        lost = int(np.count_nonzero(snapshot.kinds == LOST))
        found.append(("features", f"{vector.inliers} agree, {lost} of {len(snapshot.kinds)} lost"))
    if progress is not None:
        found.append(("path", f"view {min(progress.at + 1, progress.of)} of {progress.of}"))
    if status is not None:
        found.append(("robot", f"{status.state}, {status.why}" if status.why else status.state))
    return found
