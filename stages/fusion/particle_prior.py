"""The first belief of a log."""

from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, Tick
from omninav.stages.geometry.probability.particles import uniform_around
from omninav.stages.values.belief import Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import OWN_FRAMES, SOURCE_WORDS, Pose

from .first_pose import Where, first_pose, particles_around

RADIUS = 2.0
"""Distance from a reference, in appearance length scales, up to which a uniform belief extends without `area`."""


class ParticlePrior(Stage):
    """Draws the first particles of a log: uniform over the map or around a known pose.

    Absent at all later images. Raises BadInput where `at` is `truth` and the log has no true pose, or `uniform` and
    there is neither free space nor a map.
    """

    at: Where = "uniform"
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
        """Give the first belief, also where a running robot is to start again (`restart`).

        `tick`: needed where no other input comes with each image, so that this is asked at each.
        """
        if not ctx.tick.first_of_log and restart is None:
            return self.Out()
        where = self.at if restart is None else restart.at or "uniform"
        if where == "truth" and map is not None and map.pose_source in OWN_FRAMES:
            ctx.warn(
                f"start=truth: the map's poses are from {SOURCE_WORDS[map.pose_source]}, whose frame is not that of "
                "the true poses unless both begin alike; start=uniform does without"
            )
        if where != "uniform":
            return self.Out(belief=particles_around(*first_pose(where, truth), self.number, ctx.rng))
        if area is not None:
            poses = area.draw(ctx.rng, self.number)
        else:
            if map is None or not len(map):
                raise BadInput(
                    "start: `uniform` needs a map with references; use start=origin, start=truth, or give a map"
                )
            unit = metres_of(length_scale)
            poses = uniform_around(map.poses, RADIUS * unit, self.number, ctx.rng)
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))
