"""A simulated robot that follows commands: the source of a closed loop."""

from dataclasses import field
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Source, State, Tick
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.simulator import route_planning
from omninav.stages.simulator.bodies import box_array
from omninav.stages.simulator.cameras import shutter_times
from omninav.stages.simulator.config import DayNumber, Kidnapping, WorldConfig
from omninav.stages.simulator.drawn_plan import ONE_PLAN
from omninav.stages.simulator.drawn_starts import drawn_pose, drawn_way_back
from omninav.stages.simulator.obstacles import gather
from omninav.stages.simulator.odometry import draw_bias, measured
from omninav.stages.simulator.people import Person, RobotTrack
from omninav.stages.simulator.ranges import measure, round_bodies
from omninav.stages.simulator.robot import COLLISIONS, DISTANCE, around, at_rest, limits, reach, steer, teleport
from omninav.stages.simulator.robot_camera import RobotCamera
from omninav.stages.simulator.simulated_recording import DAY_0_NS, refuse_no_room, scan_value, simulation_digest
from omninav.stages.simulator.streams import stream
from omninav.stages.simulator.world import World
from omninav.stages.values.command import Command
from omninav.stages.values.commands import GoalPoint
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.homing import PathProgress
from omninav.stages.values.image import Image
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.scan import Scan

TRACK_TICKS = 2500
"""Ticks of its path that people who keep the robot company know of."""
CARRIED_AT_S = 0.5
"""Seconds after which a robot with a drawn start is carried away."""


class ClosedLoopState(State):
    """The robot as it is: its state (see `robot`; empty before the first tick), odometry pose, ticks made.

    `track` (N, 4): time (s) and pose at the last ticks; people who keep it company follow it. `crowd` (P, 5): where
    everybody is. `unseen` (3,): odometry since the last image, where later ones were lost; empty: none was. `ended`:
    ticks since its last route has. `asked`: goals that it was given. `commanded`: it had one.
    """

    robot: Array = field(default_factory=lambda: np.zeros(0))
    track: Array = field(default_factory=lambda: np.zeros((0, 4)))
    crowd: Array = field(default_factory=lambda: np.zeros((0, 5)))
    odometry: Array = field(default_factory=lambda: np.zeros(3))
    unseen: Array = field(default_factory=lambda: np.zeros(0))
    ticks: int = 0
    ended: int = 0
    asked: int = 0
    commanded: bool = False


class ClosedLoop(Source):
    """Simulates a robot that obeys the last command; every tick gives image, odometry, ranges and contacts.

    It starts at rest. The command of the tick before holds until this tick; without one it brakes. `motion` is what its
    wheels measure between two images, as in a log, `tick_motion` since the tick before; the first tick has neither.
    Noise is drawn from the run's seed, goods and textures from the world's. Images are blurred as in a log
    (`world.sensor.shutter`), by the motion at their tick: nobody knows the next command.
    An image that is lost or late on its way (`world.delivery`) is absent, and counted. Raises `UnreadableRecording`
    for a place to start, or to go to, where the robot has no room, BadInput for goals where nothing reads them.
    """

    world: WorldConfig = WorldConfig()
    """The world, with the robot that drives in it."""
    day: DayNumber = 1
    """As the world is on this day."""
    route: str = "drive"
    """The robot starts where this route of the world does, and faces along it."""
    start: tuple[float, float, float] | Literal["drawn"] | None = None
    """Pose from which it starts instead: x, y (m), heading (rad); `drawn`: anywhere on the free floor, another
    place for every seed."""
    carried_m: Annotated[float, Bounds(ge=0)] = 0.0
    """With a drawn start: how far away (m) it is put down after half a second, where the straight way back is
    free."""
    kidnapped_every_m: Annotated[float, Bounds(ge=0)] = 0.0
    """Metres that it drives until it is put down elsewhere, anywhere on the free floor, again and again; 0:
    never."""
    seconds: Annotated[float, Bounds(gt=0)] = 60.0
    """Longest drive, s."""
    rate_hz: Annotated[float, Bounds(ge=1, le=1000)] = 5.0
    """Ticks a second."""
    rest_s: Annotated[float, Bounds(ge=0)] = 1.0
    """Time that it continues once the planned route, or a path without one, has ended: it has arrived, or given up."""
    goals: tuple[tuple[float, float], ...] = ()
    """Points that it is asked to drive on to, x, y (m), each once its route has ended: it has arrived, or given up."""
    kidnappings: tuple[Kidnapping, ...] = ()
    """When and how it is lifted: {at: 30.0, turn: 1.5} or {at: 30.0, to: [x, y, heading]} (s, m, rad)."""

    class Out(Outputs):
        tick: Tick
        image: Image | None = None
        camera: Camera
        odometry: Pose
        motion: Motion | None = None
        tick_motion: Motion | None = None
        scan: Scan
        goal: GoalPoint | None = None
        truth: Pose
        tally: EpisodeStatistics

    def setup(self, ctx: Context) -> None:
        """Build the world; the bodies in it are looked up by place."""
        if self.goals and not ctx.is_read("goal"):
            raise BadInput("nodes.source.goals: this variant drives to no points; leave them out")
        if self.carried_m and self.start != "drawn":
            raise BadInput("nodes.source.carried_m: only a robot with a drawn start is carried; add start=drawn")
        if self.start is None and self.route in self.world.routes and self.world.routes[self.route].kidnappings:
            ctx.warn(f"The kidnappings of the route '{self.route}' are for logs of it; here kidnappings=… states them.")
        world = World(self.world, self.day)
        if world.config.plan == "drawn":
            ctx.warn(f"{world.config.label}: {ONE_PLAN}")
        self._world, self._scene = world, world.scene
        self._room = gather(box_array(world.obstacles), world.config.size, reach(self.world.robot))
        self._limits = limits(self.world.robot)
        self._camera = RobotCamera(self.world, "closed loop", self.day)
        self._bias = draw_bias(self.world.odometry, stream(self.world.draw_seed, "odometry bias", self.day))
        self._kidnappings = self.kidnappings
        self._first = self._first_pose(world, ctx.rng)
        refuse_no_room(self.world, self._room, self._first.tolist(), "start")
        for kidnapping in self._kidnappings:
            if kidnapping.to is not None:
                refuse_no_room(self.world, self._room, kidnapping.to, "kidnappings")
        for goal in self.goals:
            refuse_no_room(self.world, self._room, goal, "goals")

    def inputs_digest(self) -> str | None:
        """sha256 over the world and the code that simulates it."""
        return simulation_digest(self.world)

    def length(self) -> int | None:
        """Ticks in all."""
        return int(self.seconds * self.rate_hz)

    def step(
        self,
        ctx: Context,
        simulation: ClosedLoopState,
        command: Command | None = None,
        route: PlannedRoute | None = None,
        progress: PathProgress | None = None,
    ) -> Out | None:
        """Drive on under the last command, then perceive; None when the time, or the route, is over."""
        goal = None
        if (route is not None and route.state in ("arrived", "gave up")) or (progress is not None and progress.arrived):
            if simulation.asked < len(self.goals):
                goal = GoalPoint(*self.goals[simulation.asked])
                simulation.asked += 1
            else:
                simulation.ended += 1
        simulation.commanded |= command is not None
        if simulation.ticks >= int(self.seconds * self.rate_hz) or simulation.ended > self.rest_s * self.rate_hz:
            self._warn_at_end(ctx, simulation, route is not None or progress is not None)
            return None
        motion = None
        if simulation.ticks == 0:
            simulation.robot = at_rest(self._first)
        else:
            motion = self._drive(ctx, simulation, command or Command(0.0, 0.0))
        out = self._perceive(ctx, simulation, motion, goal)
        simulation.ticks += 1
        return out

    def _warn_at_end(self, ctx: Context, simulation: ClosedLoopState, has_goal: bool) -> None:
        seconds = simulation.ticks / self.rate_hz
        if has_goal and simulation.ended == 0:
            ctx.warn(
                f"The time is over after {seconds:g} s, and the robot was still under way; "
                "nodes.source.seconds=… gives it more."
            )
        if not simulation.commanded:
            ctx.warn(f"No command came in {seconds:g} s, and the robot stood: does its controller give a `command`?")
        late = [f"{each.at:g}" for each in self._kidnappings if each.at > (simulation.ticks - 1) / self.rate_hz]
        if late:
            ctx.warn(f"The drive ended after {seconds:g} s: the robot was not carried at {', '.join(late)} s.")

    def _drive(self, ctx: Context, simulation: ClosedLoopState, command: Command) -> Motion:
        """One tick under a command, and what the wheels measure of it."""
        robot, now = simulation.robot, simulation.ticks / self.rate_hz
        before, driven = robot[:3].copy(), robot[DISTANCE]
        people = round_bodies(self._people(simulation))
        steer(robot, command.speed, command.turning, self._limits, 1.0 / self.rate_hz, self._room, people)
        rolled = measured(between(before, robot[:3])[None], self.world.odometry, self._bias, ctx.rng)[0]
        simulation.odometry = compose(simulation.odometry, rolled)
        for kidnapping in self._kidnappings:
            if now - 1.0 / self.rate_hz < kidnapping.at <= now:
                teleport(robot, kidnapping)
        if self.kidnapped_every_m and robot[DISTANCE] // self.kidnapped_every_m > driven // self.kidnapped_every_m:
            x, y, heading = drawn_pose(self._world, ctx.rng).tolist()
            teleport(robot, Kidnapping(at=now, to=(x, y, heading)))
            ctx.count("kidnapped")
        return Motion(*rolled.tolist())

    def _perceive(
        self, ctx: Context, simulation: ClosedLoopState, motion: Motion | None, goal: GoalPoint | None
    ) -> Out:
        pose, now = simulation.robot[:3], simulation.ticks / self.rate_hz
        people = self._meet(simulation, now)
        metres = measure(self._room, round_bodies(people)[None], pose[None], self.world.ranges, ctx.rng)[0]
        stamp = DAY_0_NS + self.day * 86400 * 10**9 + 8 * 3600 * 10**9 + round(now * 1e9)
        image, since = self._look(ctx, simulation.robot, now, people), motion
        if motion is not None and len(simulation.unseen):
            since = Motion(*compose(simulation.unseen, (motion.x, motion.y, motion.turn)).tolist())
        simulation.unseen = np.zeros(0)
        if image is None:
            simulation.unseen = np.zeros(3) if since is None else np.array([since.x, since.y, since.turn])
            since = None
        return self.Out(
            tick=Tick(index=simulation.ticks, stamp=stamp, frame=simulation.ticks, first_of_log=simulation.ticks == 0),
            image=image,
            camera=self._camera.described,
            odometry=Pose(*simulation.odometry.tolist()),
            motion=since,
            tick_motion=motion,
            scan=scan_value(self.world, metres),
            goal=goal,
            truth=Pose(*pose.tolist()),
            tally=EpisodeStatistics(int(simulation.robot[COLLISIONS]), float(simulation.robot[DISTANCE])),
        )

    def _look(self, ctx: Context, robot: Array, now: float, people: tuple[Person, ...]) -> Image | None:
        sensor, delivery = self.world.sensor, self.world.delivery
        fate, key = ctx.rng.uniform(size=2), int(ctx.rng.integers(2**62))
        if fate[0] < delivery.dropped or fate[1] < delivery.late:
            ctx.count("lost_image" if fate[0] < delivery.dropped else "late_image")
            return None
        poses = around(robot, shutter_times(sensor, 0.0))
        return Image(self._camera.image(self._scene, poses, now, key, people))

    def _meet(self, simulation: ClosedLoopState, now: float) -> tuple[Person, ...]:
        """The robot is where it is now, and people have walked on until then: everybody who is about."""
        crowd, before = self._world.crowd, simulation.track
        simulation.track = np.vstack([before, [now, *simulation.robot[:3]]])[-TRACK_TICKS:]
        track = RobotTrack(simulation.track[:, 0], simulation.track[:, 1:])
        if len(before):
            simulation.crowd = crowd.advanced(simulation.crowd, float(before[-1, 0]), now, track)
        else:
            simulation.crowd = crowd.initial_state(track)
        return self._people(simulation)

    def _people(self, simulation: ClosedLoopState) -> tuple[Person, ...]:
        """People who are about at the last tick that was made."""
        return self._world.crowd.visible(simulation.crowd, float(simulation.track[-1, 0]))

    def _first_pose(self, world: World, rng: np.random.Generator) -> Array:
        if self.start == "drawn":
            pose, put = drawn_way_back(world, rng, self.carried_m)
            if self.carried_m:
                x, y, heading = put.tolist()
                self._kidnappings = (Kidnapping(at=CARRIED_AT_S, to=(x, y, heading)),)
        elif self.start is not None:
            pose = np.array(self.start)
        elif self.route in world.config.routes:
            way = route_planning.plan(world, world.config.routes[self.route])
            ahead = next((point for point in way if np.hypot(*(point - way[0])) > 0.1), way[-1]) - way[0]
            pose = np.array([*way[0], np.arctan2(ahead[1], ahead[0])])
        else:
            raise UnreadableRecording(
                f"world '{self.world.name}' has no route '{self.route}' to start from; it has: "
                f"{', '.join(sorted(self.world.routes)) or 'none'}; or type nodes.source.start=[x,y,heading]"
            )
        return pose
