"""Two drives through a level of a game engine, as logs: corridors that look alike, and other brightness at last.

    pip install vizdoom
    python benchmarks/game_level.py --out FOLDER [--level map01] [--seed 0] [--people] [--offset 2]

Writes `tour.mcap` and `drive.mcap` with images, odometry and truth. ViZDoom (MIT) brings Freedoom's levels (BSD). A
panorama is stitched of four views of 90 degrees. The tour visits points all over the level; the drive visits half of
them in another order, on other lines. Levels of the image (0 to 1) are raised to `GAMMA`: another one in the drive.
With --people the level's figures stand about in the drive, as they do not in the tour.
"""

import argparse
import importlib
import itertools
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter, gaussian_filter1d  # type: ignore[attr-defined]
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from omninav.pipeline.mcap.writer import written_log
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.geometry.plane.se2 import distances_along, wrap
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.simulator.config import OdometryNoise
from omninav.stages.simulator.odometry import draw_bias, odometry

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

UNITS = 32.0
"""Of the engine, per metre."""
CELL = 16.0
"""Width (units) of the cells on which routes are planned."""
MAX_STEP, MIN_HEIGHT, CLEARANCE = 24.0, 56.0, 28.0
"""What a player climbs, how high a passage has to be, and how far (units) routes keep off walls."""
STEP_M, STEP_RAD, STEP_NS = 0.025, math.radians(3.0), 50_000_000
"""Between two readings of odometry: 0.5 m/s, or 60 degrees a second."""
STEPS_PER_IMAGE = 8
SIDE, HEIGHT = (320, 240), 160
"""Pixels of a view, and rows of the panorama, which has 720 columns."""
PIXEL_RATIO, TANGENT = 1.2, 0.44
"""Height of the engine's pixels over their width; tangent of the panorama's highest elevation."""
GAMMA = {"tour": 0.6, "drive": 0.85}
POINTS = 12
AVOIDED = 20.0
"""Factor of the cost of cells near the tour's way, for a drive beside it."""


class Level:
    """A level, and a player in it who can be put anywhere."""

    def __init__(self, name: str, people: bool) -> None:
        vizdoom: Any = importlib.import_module("vizdoom")
        game = vizdoom.DoomGame()
        game.set_doom_game_path(str(Path(vizdoom.__file__).parent / "freedoom2.wad"))
        game.set_doom_map(name)
        game.set_screen_resolution(vizdoom.ScreenResolution.RES_320X240)
        game.set_screen_format(vizdoom.ScreenFormat.BGR24)
        game.set_window_visible(False)
        for hidden in ("hud", "weapon", "crosshair", "decals", "particles", "effects_sprites", "messages"):
            getattr(game, f"set_render_{hidden}")(False)
        game.set_sectors_info_enabled(True)
        game.set_available_buttons([vizdoom.Button.TURN_LEFT_RIGHT_DELTA])
        shown = vizdoom.GameVariable
        game.set_available_game_variables([shown.POSITION_X, shown.POSITION_Y, shown.ANGLE])
        game.add_game_args("+sv_cheats 1 +fov 90" + ("" if people else " -nomonsters"))
        game.set_episode_timeout(0)
        game.set_seed(0)
        game.init()
        game.send_game_command("god")
        game.send_game_command("freeze")  # figures stand where the level puts them
        self._game = game
        for _ in range(35):  # the player cannot turn at first
            self._turn(0.0)
        self.walls = _walls(game.get_state().sectors)
        self.start = self.pose()[:2]
        self._maps = [_columns_of(side) for side in range(4)]

    def pose(self) -> Array:
        """Of the player (m, m, rad)."""
        x, y, angle = self._game.get_state().game_variables
        return np.array([x / UNITS, y / UNITS, float(wrap(math.radians(angle)))])

    def panorama(self, pose: Array, gamma: float) -> tuple[npt.NDArray[np.uint8], Array]:
        """What is seen at a pose, and the pose that the engine gave the player."""
        self._game.send_game_command(f"warp {pose[0] * UNITS:.2f} {pose[1] * UNITS:.2f}")
        self._turn(float(wrap(pose[2] - self.pose()[2])))
        for _ in range(3):  # the eyes rise to their height only afterwards
            self._turn(0.0)
        reached = self.pose()
        parts = []
        for columns, rows in self._maps:  # to the right of the last one
            view = self._game.get_state().screen_buffer
            parts.append(cv2.remap(view, columns, rows, cv2.INTER_LINEAR))
            self._turn(-math.pi / 2)
        whole = np.concatenate(parts, axis=1)
        bright = np.round(255.0 * (np.arange(256) / 255.0) ** gamma).astype(np.uint8)
        return bright[np.roll(whole, 3 * whole.shape[1] // 8, axis=1)], reached

    def _turn(self, angle: float) -> None:
        self._game.make_action([-math.degrees(angle)])


def _columns_of(side: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Where each pixel of a quarter of the panorama lies in the view that shows it."""
    width, height = SIDE
    azimuth = np.radians((np.arange(180) + 0.5) / 2 - 45.0)
    tangent = TANGENT * (1.0 - 2.0 * (np.arange(HEIGHT) + 0.5) / HEIGHT)
    columns = width / 2 * (1.0 + np.tan(azimuth)) - 0.5
    rows = height / 2 - 0.5 - PIXEL_RATIO * width / 2 * tangent[:, None] / np.cos(azimuth)
    return np.broadcast_to(columns, rows.shape).astype(np.float32), rows.astype(np.float32)


def _walls(sectors: Any) -> Array:
    """Lines (N, 4) in metres that a robot does not cross: walls, steps too high, passages too low."""
    sides: dict[tuple[float, ...], list[Any]] = {}
    walls = []
    for sector in sectors:
        for line in sector.lines:
            ends = sorted([(line.x1, line.y1), (line.x2, line.y2)])
            sides.setdefault((*ends[0], *ends[1]), []).append(sector)
            if line.is_blocking:
                walls.append((*ends[0], *ends[1]))
    for ends_of, beside in sides.items():
        floors, ceilings = [one.floor_height for one in beside], [one.ceiling_height for one in beside]
        if max(floors) - min(floors) > MAX_STEP or min(ceilings) - max(floors) < MIN_HEIGHT:
            walls.append(ends_of)
    return np.unique(np.array(walls), axis=0) / UNITS


def free_cells(walls: Array) -> tuple[Bools, Array]:
    """Cells (rows of y, columns of x) that keep off all walls, and the corner (m) of the first."""
    cell = CELL / UNITS
    corner = walls.reshape(-1, 2).min(axis=0) - 1.0
    shape = np.ceil((walls.reshape(-1, 2).max(axis=0) + 1.0 - corner) / cell).astype(int)
    drawn = np.zeros((shape[1], shape[0]), np.uint8)
    for wall in np.round((walls.reshape(-1, 2, 2) - corner) / cell - 0.5).astype(int):
        cv2.line(drawn, tuple(wall[0].tolist()), tuple(wall[1].tolist()), 1)
    around = np.hypot(*np.mgrid[-2:3, -2:3]) <= CLEARANCE / CELL
    return ~binary_dilation(drawn > 0, around), corner


class Routes:
    """Ways over free cells, which differ by the costs of the cells."""

    def __init__(self, free: Bools, corner: Array, rng: np.random.Generator, avoided: Array, offset: float) -> None:
        self.corner = corner
        cost = np.exp(0.7 * _unit(gaussian_filter(rng.normal(size=free.shape), 2.0)))
        if len(avoided) and offset:
            rows, columns = np.floor((avoided - corner) / (CELL / UNITS)).astype(int)[:, ::-1].T
            driven_over = np.zeros(free.shape, np.bool_)
            driven_over[rows, columns] = True
            cost[distance_transform_edt(~driven_over) * CELL / UNITS < offset] *= AVOIDED
        number = np.full(free.shape, -1)
        number[free] = np.arange(int(free.sum()))
        self.cells, cost, number = np.argwhere(free), np.pad(cost, 1), np.pad(number, 1, constant_values=-1)
        edges = []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            rows, columns = slice(1 + dy, 1 + dy + free.shape[0]), slice(1 + dx, 1 + dx + free.shape[1])
            one, other = number[1:-1, 1:-1], number[rows, columns]
            both = (one >= 0) & (other >= 0)
            length = math.hypot(dx, dy) * 0.5 * (cost[1:-1, 1:-1] + cost[rows, columns])
            edges.append(np.stack([length[both], one[both], other[both]]))
        lengths, starts, ends = np.concatenate(edges, axis=1)
        size = (len(self.cells),) * 2
        self.graph = coo_array((lengths, (starts.astype(int), ends.astype(int))), size).tocsr()

    def nearest(self, point: Array) -> int:
        """The cell at a point (m)."""
        return int(np.hypot(*(self.metres(np.arange(len(self.cells))) - point).T).argmin())

    def metres(self, cells: Any) -> Array:
        """Middles of cells: (N, 2)."""
        return self.corner + (self.cells[cells][:, ::-1] + 0.5) * CELL / UNITS

    def far_points(self, start: int, number: int, within: float) -> list[int]:
        """Cells, each as far as can be from those before, `within` metres on the path from the first."""
        reach = dijkstra(self.graph, False, start)
        far, found = np.where(reach * CELL / UNITS <= within, reach, 0.0), [start]
        while len(found) < number:
            found.append(int(far.argmax()))
            far = np.minimum(far, dijkstra(self.graph, False, found[-1]))
        return found

    def path(self, points: list[int]) -> Array:
        """Through all points, as (N, 2) metres, 2 cm apart and without corners."""
        cells: list[int] = []
        for one, other in itertools.pairwise(points):
            before = dijkstra(self.graph, False, one, return_predecessors=True)[1]
            back = [other]
            while back[-1] != one:
                back.append(int(before[back[-1]]))
            cells += back[:0:-1]
        xy = self.metres([*cells, points[-1]])
        along = distances_along(xy)
        even = np.arange(0.0, along[-1], 0.02)
        dense = np.stack([np.interp(even, along, xy[:, n]) for n in (0, 1)], axis=1)
        return gaussian_filter1d(dense, 0.35 / 0.02, axis=0, mode="nearest")

    def nearest_first(self, points: list[int]) -> list[int]:
        """The points in an order that keeps the drive short, and back to the first."""
        ordered, left = [points[0]], points[1:]
        while left:
            reach = dijkstra(self.graph, False, ordered[-1])
            ordered.append(min(left, key=lambda cell: float(reach[cell])))
            left.remove(ordered[-1])
        return [*ordered, points[0]]


def _unit(values: Array) -> Array:
    return values / values.std()


def driven(path: Array) -> Array:
    """Poses (N, 3) at every reading of odometry: the robot turns on the spot where the path is sharper than it can."""
    poses = [np.array([*path[0], math.atan2(*(path[10] - path[0])[::-1])])]
    at = 0
    while at < len(path) - 1:
        ahead = at + 1
        while ahead < len(path) - 1 and np.hypot(*(path[ahead] - poses[-1][:2])) < STEP_M:
            ahead += 1
        to = path[ahead] - poses[-1][:2]
        turn = float(wrap(math.atan2(to[1], to[0]) - poses[-1][2]))
        if abs(turn) > 4 * STEP_RAD:
            poses.append(poses[-1] + (0.0, 0.0, math.copysign(STEP_RAD, turn)))
            continue
        heading = poses[-1][2] + float(np.clip(turn, -STEP_RAD, STEP_RAD))
        poses.append(np.array([*path[ahead], heading]))
        at = ahead
    return np.array(poses)


def write(level: Level, poses: Array, path: Path, gamma: float, rng: np.random.Generator) -> None:
    """Render a drive and write it."""
    top = math.atan(TANGENT)
    camera = Cylindrical(720, HEIGHT, 360.0, elevation_top=top, elevation_bottom=-top, height=1.28)
    shown: dict[int, Any] = {}
    for number in range(0, len(poses), STEPS_PER_IMAGE):
        shown[number], poses[number] = level.panorama(poses[number], gamma)
    noise = OdometryNoise()
    rolled = odometry(poses, noise, draw_bias(noise, rng), rng)
    text = write_camera(camera)
    with written_log(path) as log:
        log.attach("camera.yaml", text.encode(), "application/yaml")
        for number, (pose, seen) in enumerate(zip(poses, rolled, strict=True)):
            stamp = (number + 1) * STEP_NS
            at = {"header": {"frame_id": "odom"}, "child_frame_id": "base_link", "pose": {"pose": _message(seen)}}
            log.write("/odom", "nav_msgs/msg/Odometry", stamp, at)
            truth = {"header": {"frame_id": "map"}, "pose": _message(pose)}
            log.write("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", stamp, truth)
            if number in shown:
                packed = cv2.imencode(".jpg", shown[number], [cv2.IMWRITE_JPEG_QUALITY, 90])[1].ravel()
                image = {"header": {"frame_id": "omni_camera"}, "format": "jpeg", "data": packed}
                log.write("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", stamp, image)
    path.with_suffix(".camera.yaml").write_text(text)


def _message(pose: Array) -> dict[str, Any]:
    turned = {"z": math.sin(pose[2] / 2), "w": math.cos(pose[2] / 2)}
    return {"position": {"x": float(pose[0]), "y": float(pose[1])}, "orientation": turned}


def main() -> None:
    """Write both logs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--level", default="map01", help="of Freedoom, phase 2: map01 to map32")
    parser.add_argument("--seed", type=int, default=0, help="of routes and of odometry's errors")
    parser.add_argument("--within", type=float, default=40.0, help="metres on the path from the start that are visited")
    parser.add_argument("--people", action="store_true", help="figures stand about in the drive")
    parser.add_argument("--offset", type=float, default=0.0, help="metres that the drive keeps off the tour's way")
    given = parser.parse_args()
    tour = np.empty((0, 2))
    given.out.mkdir(parents=True, exist_ok=True)
    for name in ("tour", "drive"):
        level = Level(given.level, people=given.people and name == "drive")
        rng = np.random.default_rng([given.seed, name == "drive"])
        routes = Routes(*free_cells(level.walls), rng, tour, given.offset)
        if name == "tour":
            points = routes.nearest_first(routes.far_points(routes.nearest(level.start), POINTS, given.within))
        chosen = points if name == "tour" else rng.permutation(points[:-1])[: POINTS // 2].tolist()
        poses = driven(routes.path(chosen))
        tour = poses[:, :2] if name == "tour" else tour
        write(level, poses, given.out / f"{name}.mcap", GAMMA[name], rng)
        metres = np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
        print(f"{given.out / name}.mcap: {-(-len(poses) // STEPS_PER_IMAGE)} images, {metres:.0f} m")


if __name__ == "__main__":
    main()
