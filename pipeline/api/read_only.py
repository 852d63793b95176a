"""Read-only views of a run's values: a run that continues must not change because a program wrote to them."""

import dataclasses
from typing import Any

import numpy as np

from omninav.pipeline.graph.value import Value


def read_only(thing: Any) -> Any:
    """The same value, whose arrays refuse to be written to; they are views, so that nothing large is copied.

    A value that is updated in place is given with the rows that it has now, not with those that it gains later.
    """
    if isinstance(thing, np.ndarray):
        view = thing.view()
        view.flags.writeable = False
        return view
    if isinstance(thing, Value):
        seen = object.__new__(type(thing))
        fields = dataclasses.fields(thing)  # type: ignore[arg-type]
        seen.__dict__.update({field.name: read_only(getattr(thing, field.name)) for field in fields})
        return seen
    if type(thing) in (list, tuple):
        return type(thing)(map(read_only, thing))
    if type(thing) is dict:
        return {name: read_only(inside) for name, inside in thing.items()}
    return thing
