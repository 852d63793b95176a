"""Places to start from, drawn at random: many trials in a world without choosing any."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.recordings.recording import UnreadableRecording

from .streams import stream
from .world import World

CLEARANCE_M = 0.1
"""Between the robot's body and everything, where it starts."""
TRIES = 10_000


def drawn_pose(world: World, rng: np.random.Generator) -> Array:
    """A pose (x, y, heading): uniform over a world's free floor, any heading.

    Raises `UnreadableRecording` where the world has no free floor.
    """
    return drawn_way_back(world, rng, 0.0)[0]


def drawn_way_back(world: World, rng: np.random.Generator, metres: float) -> tuple[Array, Array]:
    """Such a pose, and one `metres` away from which the straight way back is free; both face anywhere.

    Raises `UnreadableRecording` where the world has no room for that.
    """
    config = world.config
    rng = stream(config.draw_seed, "start", int(rng.integers(2**31)))  # others in other worlds
    steps = np.linspace(0.0, 1.0, 1 + math.ceil(metres / 0.1))[:, None]
    for _ in range(TRIES):
        place, angle = rng.uniform((0.0, 0.0), config.size), rng.uniform(-math.pi, math.pi)
        headings = rng.uniform(-math.pi, math.pi, 2)
        other = place + metres * np.array([math.cos(angle), math.sin(angle)])
        inside = (other > 0.0).all() and (other < config.size).all()
        if inside and world.is_free(place + steps * (other - place), config.robot.radius + CLEARANCE_M).all():
            return np.append(place, headings[0]), np.append(other, headings[1])
    raise UnreadableRecording(
        f"a drawn start: world '{config.name}' has no free way of {metres:g} m; use another world"
    )
