"""Makes a map of views from a tour with known poses."""

import math
from collections.abc import Sequence

import numpy as np

from omninav.pipeline import BadInput, Context, Outputs, Stage
from omninav.stages.values.pose import Pose
from omninav.stages.values.projection import Projection
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import WholeView

from .pose_of_view import warn_of_few

SIGMA_M = 0.25
"""Standard deviation of a learned position, metres."""
SIGMA_DEG = 10.0
"""Standard deviation of its heading, degrees."""


class SupervisedViews(Stage):
    """Stores each view of a tour with one Gaussian at its true pose: the training set of appearance-based localisation.

    Porta & Kröse 2004, section 2: T = {(x_i, z_i)} and the Gaussians phi(x|x_j) of equation 4, whose spread is not
    given. With `projection` wired, views are projected by it first. Views without a true pose are left out. Raises
    BadInput where none has one.
    """

    class Out(Outputs):
        map: ViewMixtures

    def step(
        self,
        ctx: Context,
        views: Sequence[WholeView | None],
        truth: Sequence[Pose | None],
        projection: Projection | None = None,
    ) -> Out:
        map = ViewMixtures.empty()
        map.put(pose_source="truth")
        covariance = np.diag([SIGMA_M**2, SIGMA_M**2, math.radians(SIGMA_DEG) ** 2])
        for view, pose in zip(views, truth, strict=True):
            if view is None or pose is None:
                ctx.count("view_without_pose", detail="without ground truth no pose is known (mapping)")
                continue
            values = view.values if projection is None else projection.components @ view.values
            row = map.add_view(values, type(view).__name__)
            map.add_component(row, np.array([pose.x, pose.y, pose.heading]), covariance, 1.0, 1.0)
            map.step()
        if not len(map):
            raise BadInput(
                "mapping: the tour has no ground truth; name it: tour_settings.truth=FILE or topics.truth=TOPIC"
            )
        ctx.fact("map_poses", "truth")
        warn_of_few(ctx, len(map))
        return self.Out(map=map)
