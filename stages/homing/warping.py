"""The homing vector of two whole images, where their features do not tell."""

import math
from dataclasses import replace
from typing import Annotated

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State
from omninav.stages.camera.equirectangular import camera_behind
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.image import Image, Panorama

from .column_table import ColumnTable
from .min_warping import Columns, warped

MIN_FEATURES = 18
"""Features that must agree with a vector of two views alone; with fewer, whole images decide."""
COLUMNS = 180
"""Columns that an image is brought to; a multiple of 4."""
MIN_COLUMNS = 20
"""Columns that must match better than by chance; with fewer the local map's vector stays, or the target is lost."""


class MinWarpingState(State):
    """`target`: the number of the target; `depth_ratio`: at the first vector towards it, 0 before that."""

    target: int = -1
    depth_ratio: float = 0.0


class MinWarping(Stage):
    """Computes the way from the robot to the target view by warping whole columns of one image to those of the other.

    Möller, Krzykawski & Gerstmayr 2010: for every direction and turn, how well do the columns of one view match those
    of the other, each at the place and magnification in which a robot that has moved so would see it, at a distance of
    its own? Columns count by how rare as good a match is. Where enough features agree, the local map's own vector
    is given on, a doubtful one too: it is the more accurate one. The vector of whole images is `new`: no second image
    has to confirm it. The camera moves on a plane and is upright.

    `ratio` is over the depth ratio at the target's first vector, `distance` the same; metres are not known. Raises
    BadInput for an image without its camera, and a camera that does not see the full circle.
    """

    max_turn_deg: Annotated[float, Bounds(ge=0, le=180)] = 180.0
    """Largest turn to both sides by which the target's heading may differ from the robot's; 180: any. With a compass
    less."""

    class Out(Outputs):
        """Absent where there is no target."""

        vector: HomingVector | None = None

    def setup(self, ctx: Context) -> None:
        """No tables yet: the camera comes with the first image."""
        self._table = ColumnTable(COLUMNS)
        self._target: tuple[Image | Panorama, Columns] | None = None

    def step(
        self,
        ctx: Context,
        state: MinWarpingState,
        image: Image | Panorama,
        vector: HomingVector,
        target: Image | Panorama | None = None,
        camera: Camera | None = None,
    ) -> Out:
        """One homing vector; `vector`: the local map's, `target`: the image to go to."""
        if vector.number != state.target:
            state.target, state.depth_ratio = vector.number, 0.0
        weak = vector.state == "lost" or (vector.state in ("new", "doubtful") and vector.inliers < MIN_FEATURES)
        if not weak or target is None:
            return self.Out(vector=vector)
        if self._target is None or self._target[0] is not target:
            self._target = target, self._columns(target, camera)
        here = self._columns(image, camera)
        found = warped(here, self._target[1], math.radians(self.max_turn_deg))
        if found.columns < MIN_COLUMNS:
            ctx.count("too_few_columns")
            if not vector.is_found:
                why = f"{vector.why}; {found.columns} columns of the image match, {MIN_COLUMNS} are needed"
                vector = replace(vector, why=why)
            return self.Out(vector=vector)
        state.depth_ratio = state.depth_ratio or max(found.depth_ratio, 1e-3)
        ratio = found.depth_ratio / state.depth_ratio
        return self.Out(
            vector=HomingVector(
                number=vector.number,
                direction=float(wrap(found.direction)),
                turn=float(wrap(found.turn)),
                distance=ratio,
                ratio=ratio,
                depth_ratio=found.depth_ratio,
                metres=None,
                inliers=found.columns,
                state="new",
            )
        )

    def _columns(self, image: Image | Panorama, camera: Camera | None) -> Columns:
        seen_by = camera_behind(image, camera)
        if seen_by is None:
            raise BadInput("homing: a camera's image without its camera; wire it: wires.homing.camera=source.camera")
        return self._table.columns(image.pixels, seen_by)
