"""What every built-in stage promises."""

import yaml
from offenders import assert_each

from omninav.pipeline import Tick
from omninav.pipeline.graph.registry import built_in, resolve
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.graph.value import VALUE_TYPES
from omninav.testing import check_stage

ENTRIES = list(built_in())


def test_there_are_stages():
    assert len(ENTRIES) > 20
    assert len({entry.target for entry in ENTRIES}) == len(ENTRIES)


def test_each_keeps_what_every_stage_promises():
    assert_each([entry.target for entry in ENTRIES], lambda target: check_stage(resolve(target)))


def test_what_a_simulator_tells_is_truth_but_for_its_images_and_its_walls():
    for entry in ENTRIES:
        if ".simulator." in entry.target:
            told = signature(resolve(entry.target)).outputs.values()
            assert {port.name for port in told if not port.truth} <= {"image", "grid"}, entry.target


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
