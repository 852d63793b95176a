"""`check_stage` names what is wrong with stages and frames."""

from typing import Any

import numpy as np
import pytest

import toys
from omninav.pipeline import Context, Outputs, Stage
from omninav.testing import check_stage


class Reused(Stage):
    """Gives the same array in every frame, changed."""

    class Out(Outputs):
        big: toys.Big

    def setup(self, ctx: Context) -> None:
        self.buffer = np.zeros(3)

    def step(self, ctx: Context, number: toys.Number) -> Out:
        self.buffer[:] = number.value
        return self.Out(big=toys.Big(self.buffer))


class Demanding(Stage):
    """Gives back what it gets, and needs a factor."""

    factor: float
    """The factor."""

    class Out(Outputs):
        number: toys.Number

    def step(self, ctx: Context, number: toys.Number) -> Out:
        return self.Out(number=number)


class Short(Reused):
    """Short."""


ONE = {"number": toys.Number(1.0)}


@pytest.mark.parametrize(
    ("stage", "frames", "said"),
    [
        (Reused, [ONE, {"number": toys.Number(2.0)}], "frame 0: its output is changed in a later frame"),
        (Demanding, [ONE], r"factor has no default; check a stage that is made with it: Demanding\(factor=…\)"),
        (Demanding(factor=1.0), ONE, "frames is a dict, expected a list"),
        (Demanding(factor=1.0), [None], "frame 0 is a NoneType, expected its inputs by name: number"),
        (Demanding(factor=1.0), [{"nope": 1}], "frame 0: there is no input nope; inputs: number"),
        (Demanding(factor=1.0), [ONE, {}], "frame 1: number is missing"),
        (Short, [], "with a full stop, of 21 to 120 characters"),
    ],
)
def test_what_is_wrong_is_named(stage: Any, frames: Any, said: str) -> None:
    with pytest.raises(AssertionError, match=said):
        check_stage(stage, frames)


def test_a_stage_that_keeps_its_promises_passes() -> None:
    assert check_stage(Demanding(factor=1.0), [ONE, ONE])[1]["number"].value == 1.0
