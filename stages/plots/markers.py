"""Maps, beliefs and homing vectors as visualization_msgs/MarkerArray, for the 3D views of Foxglove and RViz."""

from typing import Any

import numpy as np

from omninav.pipeline.mcap.message_types import standard_types
from omninav.stages.geometry.arrays import Array
from omninav.stages.plots.pose_messages import BASE, MAP, Fields, header, quaternion, ros_point
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.view_mixtures import ViewMixtures

Colour = tuple[float, float, float]
ARROW, LINES, POINTS, TEXT = 0, 5, 8, 9
"""Types of visualization_msgs/Marker."""
AXIS_M = 0.02
"""Width of the line that an ellipse's axis is drawn as, metres."""
DARK, LIGHT, PINK, GREEN = (0.35, 0.4, 0.45), (0.65, 0.68, 0.72), (0.8, 0.47, 0.65), (0.0, 0.62, 0.45)


def map_markers(map: AnyMap, stamp: int) -> Fields:
    """A map of any kind.

    References as points and edges as lines; mixtures as points and the axes of their ellipses; of a topological map its
    places with their names, the links along the images between them, and the images.
    """
    if isinstance(map, ViewMixtures):
        means = weighted_points(stamp, "places", DARK, 0.1, map.means[:, :2], map.weights)
        return {"markers": [means, gaussian_markers(stamp, "ellipses", DARK, map.means, map.covariances, map.weights)]}
    spots = map.poses[:, :2]
    if isinstance(map, TopologicalMap):
        ways = [spots[map.whole_way(link)] for link in range(len(map.links))]
        ends = np.concatenate([np.empty((0, 2)), *(np.repeat(way, 2, axis=0)[1:-1] for way in ways)])
        places = spots[map.places]
        return {
            "markers": [
                marker(stamp, "images", POINTS, 0.06, LIGHT, points(spots)),
                marker(stamp, "links", LINES, 0.03, LIGHT, points(ends)),
                marker(stamp, "places", POINTS, 0.2, DARK, points(places)),
                *(
                    _text(stamp, n, name, place)
                    for n, (name, place) in enumerate(zip(map.names, places, strict=True))
                    if name
                ),
            ]
        }
    return {
        "markers": [
            marker(stamp, "references", POINTS, 0.12, DARK, points(spots)),
            marker(stamp, "edges", LINES, 0.03, LIGHT, points(spots[map.edges.ravel()])),
        ]
    }


def gaussian_markers(
    stamp: int, namespace: str, colour: Colour, means: Array, covariances: Array, weights: Array
) -> Fields:
    """Gaussians (K, …) as a list of lines: the two axes of each, one standard deviation to either side."""
    return weighted_points(
        stamp, namespace, colour, AXIS_M, axis_ends(means, covariances), np.repeat(weights, 4), LINES
    )


def axis_ends(means: Array, covariances: Array) -> Array:
    """Ends of the two axes of each Gaussian's ellipse (K, …), one standard deviation to either side: (4 K, 2)."""
    spread, axes = np.linalg.eigh(covariances[:, :2, :2])
    arms = np.swapaxes(axes * np.sqrt(np.maximum(spread, 0.0))[:, None, :], 1, 2)  # (K, axis, xy)
    ends: Array = means[:, None, None, :2] + np.stack([-arms, arms], axis=2)
    return ends.reshape(-1, 2)


def weighted_points(
    stamp: int, namespace: str, colour: Colour, size: float, places: Array, weights: Array, kind: int = POINTS
) -> Fields:
    """Points (N, 2), or ends of lines, each as opaque as its weight in [0, 1]."""
    rgba = standard_types().types["std_msgs/msg/ColorRGBA"]
    shown = marker(stamp, namespace, kind, size, colour, points(places))
    return shown | {"colors": [rgba(*colour, weight) for weight in opacity(weights).tolist()]}


def homing_arrow(stamp: int, direction: float, length: float) -> Fields:
    """Draws a homing vector as an arrow from the robot: its direction (rad) and length (m)."""
    arrow = marker(stamp, "homing", ARROW, 0.08, GREEN, [], BASE)
    arrow["pose"] = {"orientation": quaternion(direction)}
    arrow["scale"]["x"] = length
    return arrow


def arrow_length(vector: HomingVector) -> float:
    """Length of a homing vector's arrow (m): as long as it is far where that is known, and at most 2 m."""
    return 1.0 if vector.metres is None else float(np.clip(vector.metres, 0.1, 2.0))


def points(places: Array) -> list[Any]:
    """Points (N, 2) as message objects."""
    point = standard_types().types["geometry_msgs/msg/Point"]
    return [point(x, y, 0.0) for x, y in places.tolist()]


def marker(
    stamp: int, namespace: str, kind: int, size: float, colour: Colour, at: list[Any], frame: str = MAP
) -> Fields:
    """A visualization_msgs/Marker of one colour."""
    return {
        "header": header(stamp, frame),
        "ns": namespace,
        "type": kind,
        "pose": {"orientation": quaternion(0.0)},
        "scale": {"x": size, "y": size, "z": size},
        "color": dict(zip("rgba", (*colour, 1.0), strict=True)),
        "points": at,
    }


def _text(stamp: int, number: int, text: str, place: Array) -> Fields:
    name = marker(stamp, "names", TEXT, 0.3, DARK, [])
    name["pose"]["position"] = ros_point(*place) | {"z": 0.3}
    return name | {"id": number, "text": text}


def opacity(weights: Array) -> Array:
    """Opacity of what has these weights: never so little that it cannot be seen."""
    return np.clip(weights, 0.1, 1.0)
