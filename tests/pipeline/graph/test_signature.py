"""What is read off a stage class: parameters with their meaning, and what is wrong with a class that cannot be read."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pytest

import toys
from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.pipeline.graph.parameters import BadStage
from omninav.pipeline.graph.signature import signature

ZERO = toys.Number(0.0)


class Widened(toys.Scale):
    """A number times a factor, and then some."""

    offset: Annotated[float, Bounds(ge=0)] = 0.5
    """What is added
    in the end (m)."""
    silent: int = 3


class Overridden(Widened):
    """Says anew what its base says."""

    offset: float = 1.0
    """Added first (m)."""


def test_a_parameter_carries_its_type_bounds_default_and_meaning():
    offset = signature(Widened).parameters["offset"]
    assert (offset.default, offset.meaning) == (0.5, "What is added in the end (m).")
    assert offset.type == Annotated[float, Bounds(ge=0)]
    assert signature(Widened).parameters["silent"].meaning == ""


def test_a_parameter_of_a_base_class_keeps_its_meaning_unless_it_is_said_anew():
    assert signature(Widened).parameters["factor"].meaning == "What the number is multiplied by."
    assert signature(Overridden).parameters["offset"].meaning == "Added first (m)."


def test_a_class_without_source_has_parameters_without_meaning():
    made = type("Made", (Stage,), {"__annotations__": {"size": int}, "size": 3, "step": toys.Constant.step})
    assert signature(made).parameters["size"].meaning == ""


class NoStep(Stage): ...


class Untyped(Stage):
    def step(self, ctx: Context, number) -> None: ...


class Bare(Stage):
    def step(self, ctx: Context) -> int: ...


class Nameless(Stage):
    def step(self, ctx: Context, number: "Nowhere") -> None: ...  # noqa: F821


class WithoutContext(Stage):
    def step(self, number: toys.Number, other: toys.Number) -> None: ...


class UntypedParameter(Stage):
    gain = 3

    def step(self, ctx: Context) -> None: ...


class OtherDefault(Widened):
    offset = 2.0


class OutOfBounds(Stage):
    gain: Annotated[float, Bounds(gt=0)] = -1.0
    """Factor."""

    def step(self, ctx: Context) -> None: ...


class OfNoKind(Stage):
    gain: complex = 2j
    """Factor."""

    def step(self, ctx: Context) -> None: ...


class Silent(toys.Constant):
    def step(self, ctx: Context): ...


class NoType(Stage):
    def step(self, ctx: Context, number: "toys.Nowhere") -> None: ...


class Needy(Stage):
    class Memory(State):
        """Its memory."""

        seen: int

    def step(self, ctx: Context, memory: Memory) -> None: ...


@pytest.mark.parametrize(
    ("cls", "message"),
    [
        (NoType, "an annotation is no type: AttributeError: module 'toys' has no attribute 'Nowhere'"),
        (Needy, "'seen' of its Memory has no default; write one"),
        (WithoutContext, "step: its first argument is 'number'; write `def step\\(self, ctx: Context, …\\)`"),
        (UntypedParameter, "'gain' has no type, and so sets no parameter; write `gain: int = 3`"),
        (OtherDefault, "'offset' has no type, and so sets no parameter; write `offset: float = 2.0`"),
        (OutOfBounds, "the default of 'gain': -1.0 is out of bounds, expected float > 0; write another"),
        (OfNoKind, "'gain' cannot be a complex; parameters are numbers, words, Literal"),
        (Silent, "step does not state that it gives its Out; write `-> Out`"),
        (NoStep, "has no step method; write `def step"),
        (Untyped, "argument 'number' has no type; write `number: SomeValue`"),
        (Bare, "write a nested `class Out\\(Outputs\\)`"),
        (Nameless, "import the name at module level"),
    ],
)
def test_a_class_that_cannot_be_read_says_what_to_write(cls: type[Stage], message: str):
    with pytest.raises(BadStage, match=message):
        signature(cls)


def test_a_class_is_summed_up_by_the_first_line_of_its_own_docstring():
    class Described(Widened):
        """Gives less.

        And more of it.
        """

    class Silent(Described):
        more: int = 1

    assert [signature(cls).summary for cls in (Described, Silent)] == ["Gives less.", ""]


def test_inputs_are_read_with_what_may_be_missing_and_what_is_collected():
    class Taking(Stage):
        class Memory(State):
            seen: int = 0

        def step(
            self,
            ctx: Context,
            maybe: toys.Number | None,
            memory: Memory,
            all: Annotated[Sequence[toys.Number], "as they came"],
            gaps: Sequence[toys.Number | None],
            unset: toys.Number = ZERO,
        ) -> None: ...

    read = signature(Taking)
    ports = {
        p.name: "".join("01"[flag] for flag in (p.optional, p.collects, p.keeps_gaps)) for p in read.inputs.values()
    }
    assert ports == {"maybe": "100", "all": "010", "gaps": "011", "unset": "100"}
    assert {port.type for port in read.inputs.values()} == {toys.Number}
    assert (read.state, read.is_source, signature(toys.Steered).is_source) == (("memory", Taking.Memory), False, True)


def test_a_context_keeps_what_a_stage_notes_and_draws_from_its_own_generator():
    ctx, other = (Context("match", np.random.default_rng(seed)) for seed in (7, 0))
    assert (ctx.used_rng, ctx.rng.random(), ctx.used_rng) == (False, np.random.default_rng(7).random(), True)
    assert Context("match").rng.random() == np.random.default_rng(0).random()
    for number, detail in ((1, ""), (2, "frame 1"), (3, "frame 2")):
        ctx.count("blank", number, detail)
        ctx.warn("It is dark.")
        ctx.fact("noise", number)
        ctx.fact("pace", number, of_run=True)
    ctx.count("blank")
    other.read = frozenset({"pose"})
    assert [ctx.is_read("views"), other.is_read("views"), other.is_read("pose")] == [True, False, True]
    other.restore(ctx.generator_state(), ctx.notes())
    assert (other.counts, other.details, other.warnings) == ({"blank": 7}, {"blank": "frame 1"}, ["It is dark."])
    assert (other.facts, ctx.run_facts, other.run_facts, other.used_rng) == ({"noise": 3}, {"pace": 3}, {}, True)
    assert other.rng.random() == ctx.rng.random()


def test_the_default_of_an_output_says_that_it_may_be_absent():
    class Sometimes(toys.Constant):
        class Out(Outputs):
            number: toys.Number | None
            other: toys.Number | None = None
            always: toys.Number | toys.Word

        def step(self, ctx: Context) -> Out:
            return self.Out(number=None, always=toys.Number(1.0))

    assert [port.optional for port in signature(Sometimes).outputs.values()] == [True, True, False]
    assert not any(port.truth for port in signature(Sometimes).outputs.values())
