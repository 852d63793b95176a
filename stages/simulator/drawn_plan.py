"""Floor plans that are drawn: another store, office or institute for each draw of a world, of the listed one's kind.

What the world's file lists stays a pattern: names, kinds and furniture of rooms, goods, cash desks, days, and what its
routes are for. Where walls, doors, rooms, aisles and lamps are, and so where routes lead, is drawn from the seed; it is
the same on all days.
"""

from dataclasses import replace

from .config import WorldConfig
from .drawn_office import drawn_office
from .drawn_store import drawn_store

ONE_PLAN = "this world has one plan, which world.plan=drawn does not change; leave that out"
"""Warning of a world that has nothing to draw."""


def laid_out(world: WorldConfig) -> WorldConfig:
    """A world with the floor plan that `world.plan` asks for, listed in full.

    Drawn are worlds with blocks of aisles, and those under a roof with several rooms; others have nothing to draw and
    keep their plan. Raises `BadInput` for rooms along no corridor.
    """
    if world.plan == "paper":
        return world
    drawn = world
    if world.aisle_blocks:
        drawn = drawn_store(world)
    elif len(world.rooms) > 1 and world.ceiling != "sky":
        drawn = drawn_office(world)
    return drawn if drawn is world else replace(drawn, plan="paper", name=f"{world.name}, drawn plan")
