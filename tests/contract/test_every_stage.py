"""What every built-in stage promises."""

import dataclasses
import inspect

import pytest
import yaml

from omninav.pipeline import Tick, Value
from omninav.pipeline.engine.codec import decode, encode
from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.registry import Entry, built_in, resolve
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.graph.value import VALUE_TYPES

ENTRIES = list(built_in())
by_name = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.target.rpartition(".")[2])


def test_there_are_stages():
    assert len(ENTRIES) > 20
    assert len({entry.target for entry in ENTRIES}) == len(ENTRIES)


@by_name
def test_it_says_in_its_first_line_what_it_is(entry: Entry):
    assert 20 < len(entry.summary) <= 120
    assert entry.summary.endswith(".")


@by_name
def test_its_ports_carry_values(entry: Entry):
    read = signature(resolve(entry.target))
    for port in [*read.inputs.values(), *read.outputs.values()]:
        kinds = [port.type] if inspect.isclass(port.type) else list(getattr(port.type, "__args__", [port.type]))
        kinds = [k for k in kinds if k is not Ellipsis]
        assert all(inspect.isclass(kind) and issubclass(kind, Value) for kind in kinds), (port.name, port.type)


@by_name
def test_its_defaults_pass_its_own_checks(entry: Entry):
    for parameter in signature(resolve(entry.target)).parameters.values():
        if parameter.default is not dataclasses.MISSING:
            _, problems = convert(parameter.default, parameter.type, parameter.name)
            assert not problems, [str(problem) for problem in problems]


@by_name
def test_each_of_its_parameters_says_what_it_means(entry: Entry):
    silent = [p.name for p in signature(resolve(entry.target)).parameters.values() if not p.meaning]
    assert not silent, f"write a docstring below each of these fields: {', '.join(silent)}"


@by_name
def test_its_state_can_be_saved_from_the_first_tick_on(entry: Entry):
    state = signature(resolve(entry.target)).state
    if state is not None:
        fresh = state[1]()
        fields = {field.name: getattr(fresh, field.name) for field in dataclasses.fields(fresh)}  # type: ignore[arg-type]
        assert decode(encode(fields)).keys() == fields.keys()


def test_every_value_says_what_it_is():
    ours = {name: cls for name, cls in VALUE_TYPES.items() if name.startswith("omninav.")}
    assert Tick in ours.values()
    for name, cls in ours.items():
        text = vars(cls).get("__doc__") or ""
        assert text, name
        assert not text.startswith(f"{cls.__name__}("), f"{name} has no docstring of its own"


def test_the_names_of_stages_in_yaml_are_read_as_text():
    for entry in ENTRIES:
        assert yaml.safe_load(entry.target) == entry.target
