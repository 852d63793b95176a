"""Which slips are tried: cosmic-ray's operators, each replaced by its nearest neighbours, and those of array code."""

from collections.abc import Iterator

import parso
from cosmic_ray.operators.operator import Operator
from cosmic_ray.operators.provider import OperatorProvider
from parso.tree import NodeOrLeaf

Span = tuple[tuple[int, int], tuple[int, int]]

NAMES = {
    "abs": "float",
    "all": "any",
    "any": "all",
    "argmax": "argmin",
    "argmin": "argmax",
    "atan2": "hypot",
    "arctan2": "hypot",
    "ceil": "floor",
    "cos": "sin",
    "cumsum": "asarray",
    "degrees": "radians",
    "diff": "sort",
    "first": "last",
    "floor": "ceil",
    "isfinite": "isnan",
    "isnan": "isfinite",
    "max": "min",
    "maximum": "minimum",
    "mean": "median",
    "median": "mean",
    "min": "max",
    "minimum": "maximum",
    "nanmax": "nanmin",
    "nanmedian": "nanmean",
    "nanmin": "nanmax",
    "ones": "zeros",
    "radians": "degrees",
    "sin": "cos",
    "sqrt": "square",
    "std": "var",
    "sum": "max",
    "var": "std",
    "wrap": "float",
    "zeros": "ones",
}
AUGMENTED = {"+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "|=": "&=", "&=": "|="}


class CalledName(Operator):
    """A function is taken for its neighbour: the least for the largest, the mean for the median, sine for cosine."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        """Where it is called: `max(` or `.max(`."""
        after = node.get_next_leaf()
        if node.type == "name" and node.value in NAMES and after is not None and after.value == "(":
            yield node.start_pos, node.end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """The neighbour in its place."""
        node.value = NAMES[node.value]
        return node

    @classmethod
    def examples(cls) -> tuple[()]:
        """None."""
        return ()


class AugmentedAssignment(CalledName):
    """`x += y` becomes `x -= y`."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        """At the operator."""
        if node.type == "operator" and node.value in AUGMENTED:
            yield node.start_pos, node.end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """Its opposite."""
        node.value = AUGMENTED[node.value]
        return node


class Membership(CalledName):
    """`x in y` becomes `x not in y`, and the other way round."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        """At the word, or the two words."""
        if node.type == "comparison" and node.children[1].get_code().strip() in ("in", "not in"):
            yield node.children[1].start_pos, node.children[1].end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """Its opposite."""
        word = node.children[1].get_code().strip()
        node.children[1] = parso.parse(" not in" if word == "in" else " in")
        return node


class ComprehensionCondition(CalledName):
    """`if x` of a comprehension becomes `if not (x)`."""

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        """At the condition."""
        if node.type == "comp_if":
            yield node.children[1].start_pos, node.children[1].end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """The condition the other way round."""
        node.children[1] = parso.parse(f" not ({node.children[1].get_code().strip()})")
        return node


BINARY = {"Add": "Sub", "Sub": "Add", "Mul": "Div", "Div": "Mul", "FloorDiv": "Mul", "Mod": "FloorDiv", "Pow": "Mul"}
BITS = {"BitAnd": "BitOr", "BitOr": "BitAnd"}
LIMIT = {"Lt": "LtE", "LtE": "Lt", "Gt": "GtE", "GtE": "Gt"}
"""Whether a value at the limit counts."""
SIDE = {"Lt": "GtE", "LtE": "Gt", "Gt": "LtE", "GtE": "Lt", "Eq": "NotEq", "NotEq": "Eq", "Is": "IsNot", "IsNot": "Is"}
PUBLISHED = [
    *(f"ReplaceBinaryOperator_{old}_{new}" for old, new in (BINARY | BITS).items()),
    *(f"ReplaceComparisonOperator_{old}_{new}" for table in (LIMIT, SIDE) for old, new in table.items()),
    *(f"ReplaceUnaryOperator_Delete_{old}" for old in ("USub", "Not", "Invert")),
    *("AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ExceptionReplacer"),
    *("NumberReplacer", "ZeroIterationForLoop"),
]
OURS = (CalledName, AugmentedAssignment, Membership, ComprehensionCondition)
OPERATORS: list[Operator] = [*(OperatorProvider()[name]() for name in PUBLISHED), *(each() for each in OURS)]
