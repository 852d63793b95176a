"""Unwarps whatever picture the recording has, by its camera's projection."""

import math

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.models import Camera, Cylindrical, Donut, Equirectangular, Fisheye, HyperbolicMirror

from .donut import donut_table
from .equirectangular import equirectangular_table
from .fisheye import fisheye_table
from .hyperbolic import hyperbolic_table
from .strip import strip_table
from .table import Table, TableUnwarp


def table_for(camera: Camera, columns: int, rows: int) -> Table:
    """The table for a camera of any projection that sees the full circle; raises BadInput for any other."""
    match camera:
        case HyperbolicMirror():
            return hyperbolic_table(camera, columns, rows)
        case Donut():
            if None in (camera.centre_x, camera.centre_y, camera.inner_radius_px, camera.outer_radius_px):
                raise BadInput(
                    "camera: a donut without centre_x, centre_y, inner_radius_px and outer_radius_px; "
                    "give them in camera.yaml, or use unwarp=donut, which finds them in the picture"
                )
            return donut_table(camera, columns, rows)
        case Cylindrical():
            return strip_table(camera, columns, rows)
        case Equirectangular():
            return equirectangular_table(camera, columns, rows, math.pi / 2, -math.pi / 2)
        case Fisheye():
            return fisheye_table(camera, columns, rows)
        case _:
            raise BadInput(
                f"camera: a {type(camera).__name__} camera does not see the full circle, so that it makes no panorama; "
                "use a recording of an omnidirectional one (hyperbolic, donut, cylindrical, equirectangular, fisheye)"
            )


class UnwarpByCamera(TableUnwarp):
    """Panorama by whatever projection the recording's camera has, so that one variant runs on all recordings.

    Raises BadInput where the camera does not see the full circle, or is a donut whose ring has yet to be found
    (`unwarp=donut` finds it).
    """

    def table(self, camera: Camera) -> Table:
        """Where in its pictures each pixel of the panorama lies."""
        return table_for(camera, self.columns, self.rows)
