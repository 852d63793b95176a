"""Names the bands of a drawn graph, and writes its stages and delays as every drawing of it does."""

from omninav.pipeline.graph.graph import Wire

LIFETIMES = {"before": "before the loop", "tick": "every tick", "after": "after the last tick"}
"""The bands of a drawing."""


def class_name(target: str) -> str:
    """`package.module.Stage` and `folder/file.py:Stage` -> `Stage`."""
    return target.replace(":", ".").rpartition(".")[2]


def delay_in_words(wire: Wire) -> str:
    """`one tick later`."""
    return "one tick later" if wire.delay == 1 else f"{wire.delay} ticks later"
