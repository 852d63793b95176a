"""Images of the same place on another day."""

import dataclasses

import numpy as np
from world_files import DEMO

from omninav.pipeline import Context
from omninav.stages.simulator.config import Day
from omninav.stages.simulator.other_day import OtherDay
from omninav.stages.values.image import Pixels
from omninav.stages.values.pose import Pose


def taken(light: tuple[float, float, float], x: float = 2.0, people: int = 0, noise: float = 0.0) -> Pixels:
    days = (Day(), Day(light=light, people=people))
    sensor = dataclasses.replace(DEMO.sensor, noise=noise)
    stage = OtherDay(world=dataclasses.replace(DEMO, days=days, sensor=sensor))
    context = Context("other_day", np.random.default_rng(0))
    stage.setup(context)
    return stage.step(context, Pose(x, 2.0, 0.5)).image.pixels


def test_the_day_lights_the_same_place_and_nobody_is_there() -> None:
    plain, dim = taken((1.0, 1.0, 1.0)), taken((0.25, 0.5, 0.5), people=20)
    means = dim.reshape(-1, 3).mean(axis=0) / plain.reshape(-1, 3).mean(axis=0)
    assert means[0] < means[1]
    assert np.corrcoef(plain[..., 1].ravel(), dim[..., 1].ravel())[0, 1] > 0.98  # the same bodies at the same pixels
    assert np.corrcoef(plain[..., 1].ravel(), taken((1.0, 1.0, 1.0), 2.6)[..., 1].ravel())[0, 1] < 0.9
    assert np.array_equal(dim, taken((0.25, 0.5, 0.5)))


def test_noise_is_the_stages_own() -> None:
    one, other = taken((1.0, 1.0, 1.0), noise=4.0), taken((1.0, 1.0, 1.0), noise=4.0)
    assert np.array_equal(one, other)
    assert not np.array_equal(one, taken((1.0, 1.0, 1.0)))
