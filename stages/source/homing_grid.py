"""Views all around a target, one by one: what homing makes of each is a field of vectors."""

import math
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Source, State, Tick, digest_text
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording, UnreadableRecording
from omninav.stages.simulator.config import DayNumber, WorldConfig
from omninav.stages.simulator.drawn_starts import drawn_pose
from omninav.stages.simulator.first_hits import first_hits
from omninav.stages.simulator.robot_camera import RobotCamera
from omninav.stages.simulator.simulated_recording import simulation_digest
from omninav.stages.simulator.world import World
from omninav.stages.values.image import Image, Pixels
from omninav.stages.values.pose import Pose


class HomingGridState(State):
    """Number of views so far."""

    views: int = 0


class HomingGrid(Source):
    """Renders the view at a target first, then views from a grid of points around it.

    Goedemé et al. 2007, section 8.4.1. In a simulated world they are rendered where a robot has room and from where
    nothing between hides the target's spot, each with a heading drawn at random; people are not there. In a recorded
    log with true poses the target is the image taken closest to it, and the views are all others within the radius, as
    they were taken. Raises `UnreadableRecording` for a target without room, and for a log without true poses.
    """

    log: str | None = None
    """The log that the views are of; null: they are rendered."""
    camera: str | None = None
    """A camera.yaml in place of the log's own."""
    world: WorldConfig = WorldConfig()
    """The world that they are rendered of."""
    day: DayNumber = 0
    """As the world is on this day."""
    target: tuple[float, float, float] | Literal["drawn"] = (10.0, 8.0, 0.5)
    """x, y (m), heading (rad), of which only x and y matter in a log; `drawn`: anywhere on the free floor, another
    place for every seed."""
    spacing_m: Annotated[float, Bounds(gt=0)] = 1.0
    """Distance of neighbouring points of the grid, in x and in y."""
    radius_m: Annotated[float, Bounds(gt=0)] = 8.0
    """Greatest distance of a view from the target."""

    class Out(Outputs):
        """One tick a second; the first is the target's."""

        tick: Tick
        image: Image
        camera: Camera
        truth: Pose

    def setup(self, ctx: Context) -> None:
        """Build the world, or open the log, and choose the points."""
        recording = self._recording
        if recording is None:
            self._views: RenderedViews | RecordedViews = RenderedViews(
                self.world, self.day, self.target, self.spacing_m, self.radius_m, ctx.rng
            )
        elif self.target == "drawn":
            raise UnreadableRecording("target: of a log none is drawn; type nodes.source.target=[x,y,0]")
        else:
            self._views = RecordedViews(recording, self.target, self.radius_m)

    def inputs_digest(self) -> str | None:
        """sha256 over the world and the code that simulates it, or over the log."""
        recording = self._recording
        return digest_text("homing grid", simulation_digest(self.world) if recording is None else recording.digest())

    @cached_property
    def _recording(self) -> Recording | None:
        """The log, opened once."""
        return None if self.log is None else open_recording(self.log, camera=self.camera)

    def length(self) -> int | None:
        """Views in all."""
        return len(self._views.poses)

    def step(self, ctx: Context, placed: HomingGridState) -> Out | None:
        """The next view that can be read; None when there were enough."""
        while placed.views < len(self._views.poses):
            row = placed.views
            placed.views += 1
            pixels = self._views.image(row)
            if pixels is not None:
                return self.Out(
                    tick=Tick(index=row, stamp=row * 10**9, frame=row, first_of_log=row == 0),
                    image=Image(pixels),
                    camera=self._views.camera,
                    truth=Pose(*self._views.poses[row].tolist()),
                )
            ctx.count("undecodable_image", detail=f"view {row}")
        return None


class RenderedViews:
    """Views of a simulated world: images, and `poses` (N, 3) at which they are taken, the target's first."""

    def __init__(
        self,
        config: WorldConfig,
        day: int,
        target: tuple[float, float, float] | Literal["drawn"],
        spacing: float,
        radius: float,
        rng: np.random.Generator,
    ) -> None:
        world = World(config, day)
        if target == "drawn":
            x, y, heading = drawn_pose(world, rng).tolist()
            target = x, y, heading
        if not world.is_free([target[:2]], config.robot.radius)[0]:
            raise UnreadableRecording(
                f"target: no room for the robot at {target[0]:g}, {target[1]:g} of world '{config.name}'; choose "
                "another place on the floor plan (nodes.source.target)"
            )
        points = grid_around(target, spacing, radius)
        points = points[world.is_free(points, config.robot.radius)]
        points = points[in_sight(world, target, points)]
        headings = rng.uniform(-math.pi, math.pi, len(points))
        self.poses = np.concatenate([[target], np.column_stack([points, headings])])
        self._camera, self._scene = RobotCamera(config, "homing grid", day), world.scene
        self.camera: Camera = self._camera.described

    def image(self, row: int) -> Pixels | None:
        """Rendered now, with the camera's noise; all are of one moment, and of one exposure."""
        return self._camera.image(self._scene, self.poses[row : row + 1], 0.0, key=row)


class RecordedViews:
    """Views of a log, as `RenderedViews`, around that which was taken closest to a point."""

    def __init__(self, recording: Recording, target: tuple[float, float, float], radius: float) -> None:
        if recording.truth is None or not np.isfinite(recording.truth).all(axis=1).any():
            raise UnreadableRecording(f"{recording.name}: without true poses there is no target; use another log")
        metres = np.hypot(*(recording.truth[:, :2] - target[:2]).T)
        middle = int(np.nanargmin(metres))
        metres = np.hypot(*(recording.truth[:, :2] - recording.truth[middle, :2]).T)
        others = np.flatnonzero((metres <= radius) & (metres > 0.0))
        self._rows = np.concatenate([[middle], others])
        self.poses = recording.truth[self._rows]
        self.camera, self._recording = recording.camera, recording

    def image(self, row: int) -> Pixels | None:
        """As it was taken."""
        return self._recording.image(int(self._rows[row]))


def grid_around(target: tuple[float, float, float], spacing: float, radius: float) -> Array:
    """Points (N, 2) `spacing` m apart in x and y around a target, without itself, at most `radius` m away."""
    steps = spacing * np.arange(-math.floor(radius / spacing), math.floor(radius / spacing) + 1)
    y, x = np.meshgrid(steps, steps, indexing="ij")
    metres = np.hypot(x, y).ravel()
    near = (metres <= radius + 1e-9) & (metres > 0.0)
    return np.column_stack([x.ravel()[near] + target[0], y.ravel()[near] + target[1]])


def in_sight(world: World, target: tuple[float, ...], points: Array) -> Bools:
    """Tell of points (N, 2) whether no body is between them and a target at the height of the camera: (N,)."""
    away = np.column_stack([points - target[:2], np.zeros(len(points))])
    metres = np.linalg.norm(away, axis=1)
    eye = (target[0], target[1], world.config.eye_height)
    seen: Bools = first_hits(world.boxes, world.config.height, eye, away / metres[:, None]) > metres
    return seen
