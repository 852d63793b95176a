"""What a simulated picture costs: two cameras in four home stores, on the day with the most people, beside one wall."""

import resource
import time

import numpy as np
from omegaconf import OmegaConf

from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.graph.ports import convert
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.simulator.cameras import camera_of, camera_rays
from omninav.stages.simulator.config import WorldConfig
from omninav.stages.simulator.people import RobotTrack
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.world import World

from .table import Row

WORLDS = ("home_store_demo", "home_store_small", "home_store_mid", "home_store")
STRIP = Cylindrical(720, 180, 360.0, elevation_top=0.6, elevation_bottom=-0.8, height=0.9)
CAMERAS = (("640x480 mirror", camera_of(WorldConfig()), 30.0), ("720x180 panorama", STRIP, 50.0))
POSES = 8
"""Places all over the free floor, each seen a few times."""


def rows() -> list[Row]:
    """Frames per second, with people, lights, vignetting and noise; how long a world takes to build, and memory."""
    found: list[Row] = []
    first: dict[str, float] = {}
    for name in WORLDS:
        start = time.perf_counter()
        world = _world(name)
        scene = world.scene
        built = time.perf_counter() - start
        extent = f"{world.config.size[0]:g} x {world.config.size[1]:g} m, {len(world.boxes)} boxes"
        for seen_by, camera, least in CAMERAS:
            rays = camera_rays(camera, vignetting=0.12, robot_radius=0.25)
            taken = []
            for pose, people in _moments(world):
                render(scene, rays, pose, 0.9, noise=2.0, people=people)
                tries = []
                for key in range(5):
                    start = time.perf_counter()
                    render(scene, rays, pose, 0.9, noise=2.0, key=key, people=people)
                    tries.append(time.perf_counter() - start)
                taken.append(min(tries))  # a place's own price, whatever else the machine does
            rate = 1.0 / float(np.median(taken))
            first.setdefault(seen_by, rate)
            peer = {} if name == WORLDS[0] else {"peer": f"in {WORLDS[0]}", "peer_value": first[seen_by]}
            what = f"{seen_by}, {name} ({extent})"
            found.append(Row(what, rate, "1/s", **peer, limit=least, higher_is_better=True))  # type: ignore[arg-type]
        found.append(Row(f"a day of {name} ready to be seen", built, "s", limit=20.0))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    found.append(Row("memory of a process that has built and seen all of them", peak, "MB", limit=1000.0))
    return found


def world_config(name: str) -> WorldConfig:
    """A world of `conf/world`."""
    with hydra_started():
        described = OmegaConf.to_container(compose([f"world={name}"]).world, resolve=True)
    config, problems = convert(described, WorldConfig, "world")
    assert not problems, problems
    assert isinstance(config, WorldConfig)
    return config


def _world(name: str) -> World:
    """A world on its busiest day."""
    config = world_config(name)
    busiest = max(range(len(config.days)), key=lambda day: config.days[day].people)
    return World(config, busiest)


def _moments(world: World) -> list[tuple[np.ndarray, tuple]]:  # type: ignore[type-arg]
    """Poses on the free floor and who is about, some beside the robot."""
    rng = np.random.default_rng(5)
    points = rng.uniform((0.0, 0.0), world.config.size, (2000, 2))
    points = points[world.clearance(points) > 0.4][:POSES]
    times = np.arange(0.0, 40.0, 0.05)
    moments = []
    for point, heading in zip(points, rng.uniform(-np.pi, np.pi, POSES), strict=False):
        pose = np.array([*point, heading])
        moments.append((pose, world.crowd.at(39.0, RobotTrack(times, np.tile(pose, (len(times), 1))))))
    return moments
