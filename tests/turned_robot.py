"""What the robot of the built-in world sees from a pose, as its camera has it and as a panorama."""

import functools
import math
from collections.abc import Callable

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline import Context
from omninav.stages.simulator.cameras import camera_of, camera_rays
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.world import World
from omninav.stages.unwarp.panorama import UnwarpPanorama
from omninav.stages.values.image import Image, Panorama

CAMERA = camera_of(DEMO)
Look = Callable[[str, float], Image | Panorama]


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles within pi of 0."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@functools.cache
def scene():
    """The built-in world and its camera's rays."""
    return World(DEMO).scene, camera_rays(CAMERA)


@functools.cache
def look(kind: str, heading: float, x: float = 5.0, y: float = 5.0) -> Image | Panorama:
    """The robot's view at a heading (rad): of kind mirror or panorama."""
    picture = Image(render(*scene(), (x, y, heading), 0.9))
    if kind == "mirror":
        return picture
    unwarp, context = UnwarpPanorama(columns=720, rows=160), Context("unwarp")
    unwarp.setup(context)
    panorama: Panorama = unwarp.step(context, image=picture, camera=CAMERA).panorama
    return panorama


both_kinds = pytest.mark.parametrize("kind", ["mirror", "panorama"])
