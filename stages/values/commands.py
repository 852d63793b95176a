"""Requests to a robot while it runs."""

from omninav.pipeline import Value

from .pose import StartPose


class Reinitialise(Value):
    """The belief is to start again: at a pose (x, y, heading, sigma_xy, sigma_heading; m, rad), or uniform (None)."""

    at: StartPose | None = None


GOAL_TOPIC = "/goal_pose"
"""Topic on which a running robot is sent somewhere; as a goal: it waits to be."""


class GoalPoint(Value):
    """Goal of the robot: a point in the map frame (m)."""

    x: float
    y: float
