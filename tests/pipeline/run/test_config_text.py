"""A run's configuration as text: equal to what it was written from, and nothing in it twice."""

import re

import yaml
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline.cli.composition import complete
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.graph.small_files import parse_yaml
from omninav.pipeline.run.config_text import config_text

ROOM = {"walls": [[float(n), 0.5, "brick and plaster"] for n in range(8)], "doors": {"width": 0.9, "at": [1, 2]}}
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-9.0, 9.0) | st.sampled_from(["", "a b", "null", "1"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abcd"), inner, max_size=3),
    max_leaves=12,
)


def test_a_long_part_that_stands_again_is_an_alias_named_after_its_key():
    text = config_text({"source": {"room": ROOM, "day": 1}, "plan": {"room": dict(ROOM)}, "room": ROOM})
    assert text.count("brick") == 8
    assert re.findall(r"[&*]\w+", text) == ["&room", "*room", "*room"]
    changed = {**ROOM, "doors": {"width": 1, "at": [1, 2]}}
    rooms = [ROOM, ROOM, changed, changed]
    text = config_text({f"node_{n}": {"room": room, "number": n} for n, room in enumerate(rooms)})
    assert re.findall(r"[&*]\w+", text) == ["&room", "&walls", "*room", "&room_2", "*walls", "*room_2"]


def test_a_short_part_stands_in_one_line_each_time():
    assert config_text({"a": {"x": [1, 2], "y": None}, "b": {"x": [1, 2], "y": None}, "c": []}) == (
        "{a: {x: [1, 2], y: null}, b: {x: [1, 2], y: null}, c: []}\n"
    )


@given(st.dictionaries(st.sampled_from("abcd"), PLAIN), PLAIN)
def test_what_is_read_is_what_was_written_and_its_parts_are_apart(settings, part):
    settings = {**settings, "one": [part, [part] * 3], "other": {"again": [part, [part] * 3], "room": ROOM, "e": ROOM}}
    found = parse_yaml(config_text(settings), "config.yaml")
    assert found == settings
    found["other"]["room"]["walls"].clear()
    assert found["other"]["e"] == ROOM


def test_the_default_s_configuration_is_short_and_has_its_world_once():
    with hydra_started():
        plain = complete(compose([]))
    text = config_text(plain)
    assert len(text.splitlines()) <= 410
    assert text.count("shelves:") == 1
    assert yaml.safe_load(text) == plain
