"""Worlds as `conf/world` describes them."""

from functools import cache
from pathlib import Path

from omegaconf import OmegaConf

from omninav.pipeline.graph.ports import convert
from omninav.stages.simulator.config import WorldConfig

WORLDS = Path(__file__).parents[1] / "conf" / "world"


@cache
def world_of(name: str) -> WorldConfig:
    """The world of a file, upon the empty one."""
    files = [OmegaConf.load(WORLDS / f"{each}.yaml") for each in ("empty", name)]
    described = OmegaConf.to_container(OmegaConf.merge(*files))
    assert isinstance(described, dict)
    described.pop("defaults", None)
    world, problems = convert(described, WorldConfig, "world")
    assert isinstance(world, WorldConfig)
    assert not problems
    return world


DEMO = world_of("home_store_demo")
