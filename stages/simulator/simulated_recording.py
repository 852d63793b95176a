"""Drives through a simulated world as recordings; images are rendered when asked for."""

import dataclasses
import json
import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from omninav.pipeline import digest_file, digest_text
from omninav.pipeline.engine.code_version import module_version, surroundings
from omninav.stages import camera, simulator
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane import odometry_noise, se2
from omninav.stages.recordings.recording import Recording, UnreadableRecording
from omninav.stages.recordings.stamps import ascending
from omninav.stages.values.image import Pixels
from omninav.stages.values.scan import Scan

from . import route_planning
from .bodies import box_array
from .cameras import shutter_times
from .config import Day, Kidnapping, WorldConfig
from .drawn_plan import ONE_PLAN, laid_out
from .obstacles import Obstacles, gather, nearest
from .odometry import draw_bias, odometry
from .people import Person, RobotTrack
from .ranges import measure, round_bodies
from .renderer import Scene
from .robot import NO_PEOPLE, SimulatedDrive, drive, reach
from .robot_camera import RobotCamera
from .streams import stream
from .world import World

DAY_0_NS = 1_767_571_200 * 10**9
"""Midnight before day 0, 2026-01-05 UTC, in nanoseconds."""
FIRST_IMAGE_S = 0.52
"""Seconds from the start of a drive to its first image, so that odometry begins before it."""
JITTER_SHARES = (1.0, 0.5, 0.25, 0.0)
"""Shares of the path's jitter that are tried one after the other, until the robot touches nothing."""
MIN_DRIVEN = 0.8
"""Smallest share of its planned path that a robot drives without a warning: cut corners cost less."""
IMAGE_LATENCY_NS = 42_000_000
"""Nanoseconds from an image's stamp to its arrival."""


class SimulatedRecording(Recording):
    """One drive along a named route of a world on a day.

    The same seed, route, day and kidnappings give the same bytes. Images can be asked for in any order.
    The day decides the line that is driven, the odometry's errors, the noise and which goods were moved. `collisions`
    counts contacts.
    Raises `UnreadableRecording` for a route that the world does not have, or that leads nowhere.
    """

    def __init__(self, world: WorldConfig, route: str, day: int, kidnappings: Sequence[Kidnapping] = ()) -> None:
        super().__init__()
        world = laid_out(world)
        if route not in world.routes:
            raise UnreadableRecording(
                f"world '{world.name}' has no route '{route}'; it has: {', '.join(sorted(world.routes)) or 'none'}"
            )
        self.world, self.route, self.day = world, route, day
        self.name = f"{world.label}, route {route}, day {day}"
        listed = sorted([*world.routes[route].kidnappings, *kidnappings], key=lambda kidnapping: kidnapping.at)
        self.kidnappings = tuple(map(_other_way, listed) if world.drives_backwards else listed)
        self._later_world: World | None = None
        self._day_duration_s = world.routes[route].day_duration_s
        self._camera = RobotCamera(world, route, day)
        self.camera = self._camera.described
        self._start = DAY_0_NS + day * 86400 * 10**9 + (9 + sorted(world.routes).index(route)) * 3600 * 10**9
        self._drive()
        self._schedule_images()
        self._schedule_scans()

    def _drive(self) -> None:
        world = self.world
        try:
            way = route_planning.plan(self._world, world.routes[self.route])
        except route_planning.UnreachableRoute as why:
            raise UnreadableRecording(f"route '{self.route}': {why}") from None
        for kidnapping in self.kidnappings:
            if kidnapping.to is not None:
                refuse_no_room(world, self._room, kidnapping.to, "kidnappings")
        if self._day_duration_s is not None and any(
            later.furniture or later.doors < 1.0 for later in world.days[self.day :]
        ):
            raise UnreadableRecording(
                f"route '{self.route}' lasts several days, and on one of world '{world.name}' furniture or doors move; "
                "lamps, curtains and goods may change while the robot drives, but what it may run into may not"
            )
        driven = self._without_contact(way)
        self._seconds, self.driven, self.collisions = driven.times, driven.poses, driven.collisions
        self.warnings = [f"{self.name}: {ONE_PLAN}"] if world.plan == "drawn" else []
        if not driven.arrived or driven.driven_m < MIN_DRIVEN * driven.planned_m:
            self.warnings.append(
                f"{self.name}: the robot drove {driven.driven_m:.0f} m, its path has {driven.planned_m:.0f} m; see on "
                "the floor plan where it was held up, and try another route, world.robot.radius or look_ahead"
            )
        bias = draw_bias(world.odometry, stream(world.draw_seed, "odometry bias", self.day))
        self.rolled = odometry(driven.poses, world.odometry, bias, self._stream("odometry"), driven.rolled_to)
        self.times = self._stamps(driven.times)
        self.kidnapped = [(int(self.times[row]), kidnapping) for row, kidnapping in driven.kidnappings]
        """Kidnappings that took place, each with the time (ns) at which the robot was put down again."""
        put = np.unique([row for row, _ in driven.kidnappings]).astype(np.int64)
        # Up to that moment it was where its wheels had rolled, so that interpolation does not bridge the jump.
        self._true_seconds = np.insert(driven.times, put, driven.times[put])
        self.true_poses = np.insert(driven.poses, put, driven.rolled_to[put], axis=0)
        unwrapped = np.column_stack([self.true_poses[:, :2], np.unwrap(self.true_poses[:, 2])])
        self._stays = np.append(self._true_seconds, np.inf), np.concatenate([unwrapped, unwrapped[-1:]])
        self.true_times: Ints = np.insert(self.times, put, self.times[put] - 1)
        self.carried: Ints = put + np.arange(len(put))
        """Steps from a true pose to the next one in which the robot was carried, not driven."""

    def _without_contact(self, planned: Array) -> SimulatedDrive:
        """The drive along a planned path (W, 2), off it by the day's jitter, by less where it touches anything."""
        robot, rate = self.world.robot, self.world.timing.odometry
        for share in JITTER_SHARES:
            line = route_planning.jittered(self._world, planned, share * robot.path_jitter_m, self._stream("line"))
            driven = drive(line, robot, rate, room=self._room, kidnappings=self.kidnappings)
            if not driven.collisions:
                break
        return driven

    def _schedule_images(self) -> None:
        timing, delivery = self.world.timing, self.world.delivery
        count = max(0, int(np.floor((self._seconds[-1] - FIRST_IMAGE_S) * timing.images + 1e-9)) + 1)
        if not count:
            raise UnreadableRecording(
                f"route '{self.route}' of world '{self.world.name}' ends before its first image; give it two waypoints "
                "at least 0.3 m apart"
            )
        self._shots = FIRST_IMAGE_S + np.arange(count) / timing.images
        fate = self._stream("delivery").uniform(size=(count, 2))
        stamps = self._stamps(self._shots)
        late = np.where(fate[:, 1] < delivery.late, round(delivery.delay_s * 1e9), 0)
        arrivals = stamps + IMAGE_LATENCY_NS + late
        sent = np.flatnonzero(fate[:, 0] >= delivery.dropped)
        self.sent: list[tuple[int, int, int]] = sorted(
            (int(arrivals[shot]), int(stamps[shot]), int(shot)) for shot in sent
        )
        """Images in the order of arrival: time of arrival, stamp (ns), number of the shot."""
        kept, _, overtaken = ascending(
            [stamp for _, stamp, _ in self.sent]
        )  # in the order in which a reader of the log finds them
        if overtaken:
            self.dropped["backward_stamp"] = len(overtaken)
            stamp = self.sent[overtaken[0]][1]
            self.details["backward_stamp"] = f"{self.name}: an image was overtaken by a later one, stamp {stamp} ns"
        self._received: Ints = np.array([self.sent[number][2] for number in kept], dtype=np.int64)
        self.stamps = stamps[self._received]
        self.truth: Array = self._true(self._shots[self._received])
        self.odometry = se2.interpolate(self._seconds, self.rolled, self._shots[self._received])

    def _schedule_scans(self) -> None:
        rate = self.world.ranges.rate
        self._scan_seconds = np.arange(int(np.floor(self._seconds[-1] * rate + 1e-9)) + 1) / rate
        self.scan_times = self._stamps(self._scan_seconds)
        """Stamps (ns) of all range scans."""
        self._ring_key = int(self._stream("ranges").integers(2**62))

    def _stamps(self, seconds: Array) -> Ints:
        stamps: Ints = self._start + np.round(seconds * 1e9).astype(np.int64)
        return stamps

    def _true(self, seconds: Array) -> Array:
        """Poses (N, 3) of the robot at times (N,); `se2.interpolate` would go through the whole drive each time."""
        times, poses = self._stays  # at the end, for ever
        row = np.maximum(times.searchsorted(seconds, side="right") - 1, 0)
        speed = (poses[row + 1] - poses[row]) / (times[row + 1] - times[row])[:, None]
        found: Array = speed * np.maximum(seconds - times[row], 0.0)[:, None] + poses[row]
        found[:, 2] = se2.wrap(found[:, 2])
        return found

    @cached_property
    def _world(self) -> World:
        return World(self.world, self.day)

    def _scene(self, seconds: float) -> Scene:
        """The world at a time; a long drive may see several days."""
        if self._day_duration_s is None or seconds < self._day_duration_s:
            return self._world.scene
        number = self.day + int(seconds // self._day_duration_s)
        if self._later_world is None or self._later_world.day != number:
            self._later_world = World(self.world, number)
        return self._later_world.scene

    @cached_property
    def _room(self) -> Obstacles:
        return gather(box_array(self._world.obstacles), self.world.size, reach(self.world.robot))

    @cached_property
    def left_out(self) -> list[str]:
        """Rooms and points of the route that cannot be reached on its day."""
        return route_planning.left_out(self._world, self.world.routes[self.route])

    @cached_property
    def _key(self) -> int:
        return int(self._stream("pixels").integers(2**62))

    def _stream(self, purpose: str) -> np.random.Generator:
        return stream(self.world.draw_seed, purpose, self.route, self.day)

    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels:
        """The image of a frame, (height, width, 3) uint8 blue-green-red, rendered now."""
        return self.image_of_shot(int(self._received[frame]))

    def image_of_shot(self, shot: int) -> Pixels:
        """An image by its number among all that were taken, lost ones included."""
        at = float(self._shots[shot])
        poses = self._true(shutter_times(self.world.sensor, at))
        return self._camera.image(self._scene(at), poses, at, self._key + shot, self.people_at(at))

    def scan(self, frame: int) -> Scan | None:
        """The last range scan before a frame."""
        return self.scan_at(int(np.searchsorted(self.scan_times, self.stamps[frame], side="right")) - 1)

    def scan_at(self, turn: int) -> Scan:
        """A range scan by its number."""
        at, ring = self._scan_seconds[turn], self.world.ranges
        people = round_bodies(self.people_at(float(at)))
        rng = np.random.default_rng([self._ring_key, turn])
        metres = measure(self._room, people[None], self._true(at[None]), ring, rng)[0]
        return scan_value(self.world, metres.astype(np.float32).astype(np.float64))  # as a message holds them

    def people_at(self, seconds: float) -> tuple[Person, ...]:
        """The people at a time."""
        return self._world.crowd.at(seconds, RobotTrack(self._seconds, self.driven))

    def digest(self) -> str:
        """sha256 over the days of the world that the drive sees, route, day, kidnappings and the simulator's code."""
        return drive_digest(self.world, self.route, self.day, self.kidnappings)


def _other_way(kidnapping: Kidnapping) -> Kidnapping:
    """A kidnapping on a route that is driven backwards: the robot is put down facing along it."""
    if kidnapping.to is None:
        return kidnapping
    x, y, heading = kidnapping.to
    return dataclasses.replace(kidnapping, to=(x, y, float(se2.wrap(heading + np.pi))))


def drive_digest(world: WorldConfig, route: str, day: int, kidnappings: Sequence[Kidnapping]) -> str:
    """The digest of a drive, which need not be planned for it. `kidnappings` are in order, those of the route included.

    The days before and after the drive do not count: drives of a day are equal whatever other days bring.
    """
    to_come = world.days[day + 1 :] if world.routes[route].day_duration_s is not None else ()
    seen = dataclasses.replace(world, days=(*(Day(),) * day, world.day(day), *to_come))
    done = json.dumps([dataclasses.asdict(each) for each in kidnappings])
    return digest_text(simulation_digest(seen), route, str(day), done)


def refuse_no_room(world: WorldConfig, room: Obstacles, place: Sequence[float], where: str) -> None:
    """Raise `UnreadableRecording` for a place (x, y, heading) where the robot has no room to stand."""
    clear = nearest(room, NO_PEOPLE, float(place[0]), float(place[1]))[0]
    if clear < world.robot.radius:
        raise UnreadableRecording(
            f"{where}: {place[0]:g}, {place[1]:g} of world '{world.name}' is {max(clear, 0.0):.2f} m from an obstacle, "
            f"and the robot's radius is {world.robot.radius:g} m; choose another place on the floor plan"
        )


def in_order(days: int | Sequence[int]) -> list[int]:
    """Days that a route is driven on, each once, in the order of the calendar. Raises `UnreadableRecording`."""
    listed = sorted({days} if isinstance(days, int) else set(days))
    if not listed or listed[0] < 0:
        raise UnreadableRecording("days are numbered from 0; type day=1 or day=[0,1,2]")
    return listed


def simulation_digest(world: WorldConfig) -> str:
    """sha256 over a world and the code and libraries that simulate it."""
    folders = [Path(str(package.__file__)).parent for package in (simulator, camera)]
    code = [file for folder in folders for file in sorted(folder.glob("*.py"))]
    code += [Path(str(module.__file__)) for module in (odometry_noise, se2)]
    described = json.dumps(dataclasses.asdict(world), sort_keys=True)
    known = surroundings(), module_version(__name__)
    return digest_text(described, *known, *(digest_file(path) for path in code))


def scan_value(world: WorldConfig, metres: Array) -> Scan:
    """A range scan as the value that travels on wires."""
    step = 2 * math.pi / world.ranges.readings
    return Scan(metres, -math.pi, step, nearest=0.0, farthest=world.ranges.max_range)
