"""The context of a stage at an image."""

import numpy as np

from omninav.pipeline import Context, Tick


def at_tick(index: int = 0, first: bool = False, log: int = 0) -> Context:
    """At an image of this number, a second after the one before; with a generator of its own, of one seed."""
    ctx = Context("stage", np.random.default_rng(0))
    ctx.tick = Tick(index, index * 10**9, log, index, first)
    return ctx
