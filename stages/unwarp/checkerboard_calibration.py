"""A camera from images of a flat checkerboard: its numbers, and where the board was, by least squares."""

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, cast

import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera, Ring
from omninav.stages.camera.ocamcalib import OCamCalib
from omninav.stages.geometry.arrays import Array

Model = Literal["ocamcalib", "hyperbolic", "fisheye"]
Make = Callable[[tuple[int, int], Ring, Array], Camera]
MIN_BOARDS = 3
"""Views of a board: with fewer, focal length and distance cannot be separated."""
SHAPES = (1.02, 1.08, 1.2, 1.5, 2.0)
TOP_DEG = (0.0, 10.0, 20.0, 30.0, 45.0)
"""Mirrors that are tried as a start: `k` of `mirror_camera`, and the elevation of the image's rim."""
REFINED = 2
"""Number of the best candidates that are refined."""
MAX_STEPS = 60
"""Largest number of steps of a refinement."""
FAR_PX = 1e3
"""Residual of a corner that a camera does not show at all."""
OUTLIER_PX = 1.0
"""Residual above which a corner counts less: a board is blurred, or bent."""


class BoardFit(NamedTuple):
    """`camera`; `residuals` (boards, corners, 2): reprojected less found corners (pixels); `poses` (boards, 6): the
    boards' rotation vectors and places in the camera's frame (radians, squares)."""

    camera: Camera
    residuals: Array
    poses: Array

    @property
    def rms_px(self) -> Array:
        """Root mean square distance of each board's corners (boards,)."""
        return np.asarray(np.sqrt(np.mean(np.sum(self.residuals**2, axis=2), axis=1)))


def board_points(columns: int, rows: int) -> Array:
    """The inner corners of a board (columns x rows, 3), in squares, in OpenCV's order."""
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float64)
    return np.stack([x.ravel(), y.ravel(), np.zeros(columns * rows)], axis=1)


def mirror_camera(size: tuple[int, int], ring: Ring, numbers: Array) -> HyperbolicMirror:
    """A hyperbolic mirror by gamma_x, gamma_y, centre x, centre y and log(k - 1).

    Both half axes together have one effect: p = gamma x / (|X| - k z) with k = (2 a^2 + b^2) / (2 e a), the unified
    model of Geyer & Daniilidis 2000 with xi = 1 / k. With a = 1, e = k + sqrt(k^2 - 1).
    """
    gamma_x, gamma_y, x, y, shape = (float(number) for number in numbers)
    k = 1.0 + math.exp(min(max(shape, -7.0), 3.0))  # from nearly a parabola to nearly a flat mirror
    e = k + math.sqrt(k * k - 1.0)
    b = math.sqrt(e * e - 1.0)
    scale = 2.0 * e / (b * b)
    return HyperbolicMirror(*size, gamma_x * scale, gamma_y * scale, x, y, 1.0, b, ring.inner, ring.outer)


def lens_camera(size: tuple[int, int], ring: Ring, numbers: Array) -> Fisheye:
    """An equidistant lens by focal length and centre."""
    focal, x, y = (float(number) for number in numbers)
    return Fisheye(*size, focal, x, y, ring.outer, ring.inner)


def mirror_starts(ring: Ring) -> list[Array]:
    """Numbers of `mirror_camera` to begin with: the rim of the image at several elevations, of several mirrors."""
    starts = []
    for k in SHAPES:
        for top in np.radians(TOP_DEG):
            gamma = ring.outer * (1.0 - k * math.sin(top)) / math.cos(top)
            if gamma > 0.0:
                starts.append(np.array([gamma, gamma, ring.centre_x, ring.centre_y, math.log(k - 1.0)]))
    return starts


def lens_starts(ring: Ring) -> list[Array]:
    """Numbers of `lens_camera` to begin with: several fields of view."""
    fields = np.radians([60.0, 80.0, 90.0, 100.0, 110.0])
    return [np.array([ring.outer / half, ring.centre_x, ring.centre_y]) for half in fields]


def polynomial_camera(size: tuple[int, int], ring: Ring, numbers: Array) -> OCamCalib:
    """Any mirror: centre, c and d, and a0, a2, a3 and a4 in units of the outer radius; e would only turn the camera."""
    x, y, c, d, *heights = (float(number) for number in numbers)
    heights = [heights[0], 0.0, *heights[1:]]
    polynomial = tuple(height * ring.outer ** (1 - power) for power, height in enumerate(heights))
    return OCamCalib(*size, polynomial, y, x, ring.outer, ring.inner, c, d, looks="down")


def polynomial_start(ring: Ring, mirror: HyperbolicMirror) -> Array:
    """Numbers of `polynomial_camera` that look as a hyperbolic mirror does."""
    radii = np.linspace(max(ring.inner, 0.1 * ring.outer), ring.outer, 50)
    rays, looks = mirror.unproject(np.stack([mirror.centre_x + radii, np.full(50, mirror.centre_y)], axis=1))
    heights = rays[:, 2] / np.hypot(rays[:, 0], rays[:, 1]) * radii / ring.outer
    powers = (radii[:, None] / ring.outer) ** np.array([0, 2, 3, 4])
    fitted = np.linalg.lstsq(powers[looks], heights[looks], rcond=None)[0]
    stretch = mirror.focal_y / mirror.focal_x
    return np.concatenate([[mirror.centre_x, mirror.centre_y, stretch, 0.0], fitted])


def calibrated(model: Model, size: tuple[int, int], ring: Ring, corners: Sequence[Array], board: Array) -> BoardFit:
    """The camera of a model that explains the corners (N, 2) of several images of a board (N, 3) best.

    `ring`: the part of the image that shows the world, as far as it is known; centre and radii of it are the start.
    From the best of several starts, whose boards are placed by linear equations, all numbers and all boards are
    refined together by least squares (with a loss that is linear above `OUTLIER_PX`), as by Mei & Rives 2007, "Single
    view point omnidirectional camera calibration from planar grids", ICRA. The same images give the same bytes. Raises
    BadInput for fewer than `MIN_BOARDS`, and where no start fits.
    """
    if len(corners) < MIN_BOARDS:
        raise BadInput(f"calibrate: {MIN_BOARDS} different views of the board are needed, {len(corners)} found")
    found = np.stack(corners)
    make: Make = lens_camera if model == "fisheye" else mirror_camera
    starts = lens_starts(ring) if model == "fisheye" else mirror_starts(ring)
    tried: list[tuple[float, int, Array, Array]] = []
    for numbers in starts:
        camera = make(size, ring, numbers)
        poses = _placed(camera, found, board)
        if poses is not None:
            tried.append(
                (float(np.median(np.abs(_residuals(camera, poses, board, found)))), len(tried), numbers, poses)
            )
    if not tried:
        raise BadInput(f"calibrate: no {model} camera explains these boards; is it another kind? (projection=…)")
    refined = [_refined(make, size, ring, start, poses, board, found) for _, _, start, poses in sorted(tried)[:REFINED]]
    best = min(refined, key=lambda each: float(np.median(each.rms_px)))
    if model == "ocamcalib":
        start = polynomial_start(ring, cast(HyperbolicMirror, best.camera))
        best = _refined(polynomial_camera, size, ring, start, best.poses, board, found)
    return best


def _refined(
    make: Make,
    size: tuple[int, int],
    ring: Ring,
    start: Array,
    poses: Array,
    board: Array,
    found: Array,
) -> BoardFit:
    from scipy.optimize import least_squares

    def parts(numbers: Array) -> tuple[Camera, Array]:
        return make(size, ring, numbers[: len(start)]), numbers[len(start) :].reshape(-1, 6)

    def errors(numbers: Array) -> Array:
        return _residuals(*parts(numbers), board, found).ravel()

    begin = np.concatenate([start, poses.ravel()])
    ended = least_squares(  # type: ignore[operator]
        errors, begin, loss="soft_l1", f_scale=OUTLIER_PX, x_scale="jac", max_nfev=MAX_STEPS
    )
    camera, poses = parts(ended.x)
    return BoardFit(camera, _residuals(camera, poses, board, found), poses)


def _residuals(camera: Camera, poses: Array, board: Array, found: Array) -> Array:
    points = np.einsum("nij,pj->npi", _rotations(poses[:, :3]), board) + poses[:, None, 3:]
    pixels, _ = camera.project(points)
    return np.nan_to_num(np.clip(pixels - found, -FAR_PX, FAR_PX), nan=FAR_PX)


def _rotations(vectors: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def _placed(camera: Camera, found: Array, board: Array) -> Array | None:
    """Pose of each board by linear equations: ray x (r1 x + r2 y + t) = 0. None where a corner has no ray."""
    from scipy.spatial.transform import Rotation

    rays, looks = camera.unproject(found)
    if not looks.all():
        return None
    plane = np.column_stack([board[:, :2], np.ones(len(board))])
    centre, scale = plane[:, :2].mean(axis=0), np.abs(plane[:, :2]).max()
    poses = []
    for seen in rays:
        cross = np.zeros((len(seen), 3, 3))
        cross[:, 0, 1], cross[:, 0, 2] = -seen[:, 2], seen[:, 1]
        cross[:, 1, 0], cross[:, 1, 2] = seen[:, 2], -seen[:, 0]
        cross[:, 2, 0], cross[:, 2, 1] = -seen[:, 1], seen[:, 0]
        shifted = np.column_stack([(plane[:, :2] - centre) / scale, plane[:, 2]])
        rows = np.einsum("nij,nk->nikj", cross, shifted).reshape(-1, 9)
        solution = np.linalg.svd(rows)[2][-1].reshape(3, 3)  # columns of [r1 r2 t], one after the other
        r1, r2, t = solution[0] / scale, solution[1] / scale, solution[2]
        length = (np.linalg.norm(r1) + np.linalg.norm(r2)) / 2.0
        toward = np.copysign(1.0, np.median((shifted @ solution * seen).sum(axis=1)))
        r1, r2, t = (toward / length * part for part in (r1, r2, t))
        u, _, v = np.linalg.svd(np.stack([r1, r2, np.cross(r1, r2)], axis=1))
        rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
        place = t - rotation[:, :2] @ centre
        poses.append(np.concatenate([Rotation.from_matrix(rotation).as_rotvec(), place]))
    return np.array(poses)
