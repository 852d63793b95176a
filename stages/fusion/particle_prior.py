"""The first belief of a log."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.particles import uniform_around
from omninav.stages.values.belief import Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose, StartPose

RADIUS = 2.0
"""Distance from a reference, in appearance length scales, up to which a uniform belief extends without `area`."""


class ParticlePrior(Stage):
    """Draws the first particles of a log: uniform over the map or around a known pose.

    Absent at all later images. Raises BadInput where `at` is `truth` and the log has no true pose, or `uniform` and
    there is neither free space nor a map.
    """

    at: Literal["uniform", "truth", "origin"] | StartPose = "uniform"
    """First pose: `uniform` over the free space (port `area`) or around the map's references, with all headings;
    `truth` or `origin`, with sigmas of 0.1 m and 0.1 rad; or [x, y, heading, sigma_xy, sigma_heading] (m, rad)."""
    number: Annotated[int, Bounds(ge=1)] = 5000
    """Particles."""

    class Out(Outputs):
        """The belief to begin with; absent at all later images."""

        belief: Particles | None = None

    def step(
        self,
        ctx: Context,
        map: ReferenceGraph | None,
        truth: Pose | None = None,
        length_scale: LengthScale | None = None,
        area: FreeSpace | None = None,
        restart: Reinitialise | None = None,
        tick: Tick | None = None,
    ) -> Out:
        """Give the first belief, also where somebody asks a running robot to start again (`restart`).

        `tick`: needed where no other input comes with each image, so that this is asked at each.
        """
        if not ctx.tick.first_of_log and restart is None:
            return self.Out()
        where = self.at if restart is None else restart.at or "uniform"
        if where == "uniform" and area is not None:
            poses = area.draw(ctx.rng, self.number)
        elif where == "uniform":
            if map is None or not len(map):
                raise BadInput(
                    "start: `uniform` needs a map with references; use start=origin, start=truth, or give a map"
                )
            unit = metres_of(length_scale)
            poses = uniform_around(map.poses, RADIUS * unit, self.number, ctx.rng)
        else:
            if where == "truth":
                if truth is None:
                    raise BadInput("start: this log has no true pose at its first image; use start=uniform")
                x, y, heading, metres, radians = truth.x, truth.y, truth.heading, 0.1, 0.1
            elif where == "origin":
                x, y, heading, metres, radians = 0.0, 0.0, 0.0, 0.1, 0.1
            else:
                x, y, heading, metres, radians = where
            noise = ctx.rng.standard_normal((self.number, 3)) * (metres, metres, radians)
            poses = noise + np.array([x, y, heading])
            poses[:, 2] = wrap(poses[:, 2])
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))
