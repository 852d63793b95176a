"""Visibility areas and the weights they give, at the size of Wolf, Burgard & Burkhardt 2005: 936 images, 37 x 14 m."""

import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context
from omninav.stages.sensor.line_of_sight import axes_of, visibility_areas
from omninav.stages.sensor.visibility import Visibility
from omninav.stages.sensor.visibility_index import looks_at, seen_from
from omninav.stages.sensor.visibility_similarity import CUTOFF_SIGMAS
from omninav.stages.values.belief import Particles
from omninav.stages.values.grid import FREE, OCCUPIED, FreeSpace, OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

from .table import Row, medians, milliseconds

Array = npt.NDArray[np.float64]

IMAGES, SAMPLES, ROOMS = 936, 5000, 8


def rows() -> list[Row]:
    """Areas of ordinary cameras and of panoramas: how long they take, how large they are, and weights of samples."""
    grid = _floor()
    space = FreeSpace(grid.centres(*np.nonzero(grid.cells == FREE)), grid.resolution)
    poses = space.draw(np.random.default_rng(0), IMAGES)
    return [
        *_of(grid, space, poses, 1, 1, "windows", 5.0),
        *_of(grid, space, poses[: IMAGES // 8], 8, 36, "panoramas of 8 sectors", 5.0),
        *_of(grid, space, poses, 8, 36, "panoramas of 8 sectors", None),
    ]


def _floor() -> OccupancyGrid:
    """A corridor between two rows of rooms with doors and furniture: 37 x 14 m in cells of 10 cm."""
    cells = np.full((140, 370), FREE, np.uint8)
    cells[[0, 60, 80, -1], :] = cells[:, [0, -1]] = OCCUPIED
    rng = np.random.default_rng(1)
    for room in range(ROOMS):
        left, width = room * 370 // ROOMS, 370 // ROOMS
        cells[:60, left] = cells[80:, left] = OCCUPIED
        for row in (60, 80):
            door = left + int(rng.integers(5, width - 15))
            cells[row, door : door + 10] = FREE
        for low in (5, 85):
            for _ in range(4):
                y, x = low + int(rng.integers(40)), left + int(rng.integers(5, width - 15))
                cells[y : y + 8, x : x + 12] = OCCUPIED
    return OccupancyGrid(cells, 0.1, (0.0, 0.0))


def _of(
    grid: OccupancyGrid, space: FreeSpace, poses: Array, sectors: int, headings: int, what: str, limit: float | None
) -> list[Row]:
    visibility_areas(poses[:2], grid, axes_of(sectors))  # compiled
    began = time.perf_counter()
    areas = visibility_areas(poses, grid, axes_of(sectors))
    taken, images = time.perf_counter() - began, len(poses)
    whole = ReferenceGraph(
        poses, np.zeros((images, sectors, 1), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth"
    )
    alike = Similarities(np.random.default_rng(2).uniform(0.4, 0.9, (images, headings)).astype(np.float32))
    particles = Particles(space.draw(np.random.default_rng(3), SAMPLES), np.full(SAMPLES, 1 / SAMPLES))
    near = Visibility().distance_sigma_m or np.inf
    looks = looks_at(areas, poses, each_view=True)
    lists = seen_from(areas, looks, CUTOFF_SIGMAS * near)
    listing = medians({"ours": lambda: seen_from(areas, looks, CUTOFF_SIGMAS * near)}, rounds=3)["ours"]

    def weighing(sensor: Visibility) -> Callable[[], object]:
        ctx = Context("sensor")
        sensor.setup(ctx)
        return lambda: sensor.step(ctx, alike, particles, whole, areas)

    weights = medians({"near": weighing(Visibility()), "all": weighing(Visibility(distance_sigma_m=None))}, rounds=20)
    return [
        Row(f"visibility areas of {images} {what}, 37 x 14 m at 10 cm", taken, "s", limit=10.0),
        Row("the same, stored", areas.nbytes / 1e6, "MB", limit=2.0),
        Row(f"lists of the views within {CUTOFF_SIGMAS * near:g} m of each cell", listing, "s", limit=5.0),
        Row("the same, in memory", lists.items.nbytes / 1e6, "MB"),
        milliseconds(f"weights of {SAMPLES} samples, views near them", weights["near"], limit=limit),
        milliseconds("the same, all views in sight (the paper's)", weights["all"], limit=5.0),
    ]
