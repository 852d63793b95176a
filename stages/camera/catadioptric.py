"""The hyperbolic mirror: pixels to rays and back, in closed form.

Mirror frame: origin at the mirror's focus, z up along the axis; image u runs along mirror x and image v along mirror
y. The mirror is (z+e)^2/a^2 - (x^2+y^2)/b^2 = 1 with e = sqrt(a^2+b^2), the camera's centre is t_c = (0, 0, -2e) and
looks along +z (Svoboda & Pajdla; equations 15, 16 and 20 of the paper behind `topological_nav`, as erratum 33
corrects them). `a` and `b` share any one unit; rays have no length, so that the unit does not matter.
"""

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def back_project(
    pixels: npt.ArrayLike,
    focal_x: float,
    focal_y: float,
    centre_x: float,
    centre_y: float,
    skew: float,
    a: float,
    b: float,
) -> Array:
    """Unit rays (..., 3) in the mirror frame that pixels (..., 2), columns u and v, look along.

    q = K^-1 p, F = b^2 / (e - a |q|), ray = F q + t_c, valid iff |q| < e / a; NaN where it is not (erratum 33).
    """
    pixels = np.asarray(pixels, dtype=np.float64)
    e = math.hypot(a, b)
    qy = (pixels[..., 1] - centre_y) / focal_y
    qx = (pixels[..., 0] - centre_x - skew * qy) / focal_x
    reach = e - a * np.sqrt(qx * qx + qy * qy + 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(reach > 0.0, b * b / reach, np.nan)
        ray = np.stack([scale * qx, scale * qy, scale - 2.0 * e], axis=-1)
        unit: Array = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    return unit


def project(
    rays: npt.ArrayLike,
    focal_x: float,
    focal_y: float,
    centre_x: float,
    centre_y: float,
    skew: float,
    a: float,
    b: float,
) -> Array:
    """Pixels (..., 2), columns u and v, at which rays (..., 3) of any length but zero in the mirror frame are seen.

    lambda = b^2 / (a |X| - e X_3), p ~ K (lambda X - t_c), valid iff a |X| > e X_3; NaN where it is not. (The largest
    root, as the paper has it, lands on the wrong sheet for steep downward rays; this form never does: erratum 33.)
    """
    rays = np.asarray(rays, dtype=np.float64)
    e = math.hypot(a, b)
    reach = a * np.linalg.norm(rays, axis=-1) - e * rays[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(reach > 0.0, b * b / reach, np.nan)
        depth = scale * rays[..., 2] + 2.0 * e
        qx, qy = scale * rays[..., 0] / depth, scale * rays[..., 1] / depth
    return np.stack([focal_x * qx + skew * qy + centre_x, focal_y * qy + centre_y], axis=-1)
