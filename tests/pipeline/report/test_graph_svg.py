import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from omninav.pipeline.graph.graph import Graph, Node, Wire
from omninav.pipeline.graph.parameters import Parameter
from omninav.pipeline.graph.signature import Port, Signature
from omninav.pipeline.graph.stage import Stage
from omninav.pipeline.report.graph_layout import text_width
from omninav.pipeline.report.graph_svg import svg
from omninav.pipeline.report.mermaid import mermaid

DRAWN = Path(__file__).with_name("drawn_graph.svg")


def graph(nodes: dict[str, tuple[str, str]], wires: list[str], **more: Wire) -> Graph:
    """`nodes`: name -> (lifetime, outputs); `wires`: "to.port < from.port"."""
    made = {}
    for name, (lifetime, outputs) in nodes.items():
        ports = {port: Port(port, int, truth=port == "truth") for port in outputs.split()}
        parameters = {"gain": Parameter("gain", float, 1.5)}
        read = Signature({}, ports, parameters, None, f"Makes <{name}> & more.", name == "source")
        made[name] = Node(name, f"robot.stages.{name.title()}", Stage(), read, {"gain": 2.5}, lifetime)
    plain = [Wire(*to.split("."), *start.split(".")) for to, start in (wire.split(" < ") for wire in wires)]
    return Graph(made, [*plain, *more.values()])


def loop() -> Graph:
    return graph(
        {
            "source": ("tick", "tick image truth"),
            "start": ("tick", "belief"),
            "see": ("tick", "seen"),
            "move": ("tick", "belief"),
            "fuse": ("tick", "belief"),
            "score": ("after", "metrics"),
        },
        [
            "start.truth < source.truth",
            "see.image < source.image",
            "see.map < artifacts.map",
            "fuse.seen < see.seen",
            "fuse.belief < move.belief",
        ],
        back=Wire("move", "belief", "fuse", "belief", delay=1, initial="start.belief"),
        whole=Wire("score", "truth", "source", "truth", collect=True),
        held=Wire("score", "beliefs", "fuse", "belief", collect=True),
    )


def boxes(text: str) -> dict[str, tuple[float, float, float, float]]:
    """Where each node's box stands: x, y, width, height by name."""
    found = {}
    for group in ET.fromstring(text).iter("{http://www.w3.org/2000/svg}g"):
        rect = group.find("{http://www.w3.org/2000/svg}rect")
        name = group.find("{http://www.w3.org/2000/svg}text").text
        found[name] = tuple(float(rect.get(key)) for key in ("x", "y", "width", "height"))
    return found


def test_wires_of_a_tick_lead_from_left_to_right_and_what_runs_after_the_loop_stands_below_it():
    placed = boxes(svg(loop()))
    assert set(placed) == {"source", "start", "see", "move", "fuse", "score", "artifacts"}
    for pair in ("source see", "see fuse", "move fuse", "source start", "artifacts source"):
        start, end = (placed[name] for name in pair.split())
        assert start[0] + start[2] < end[0], pair
    lowest = max(y + height for name, (_, y, _, height) in placed.items() if name != "score")
    assert placed["score"][1] > lowest


@pytest.mark.parametrize("views", [0, 1, 8, 19])
def test_boxes_never_overlap_hold_their_names_and_lie_inside_the_drawing(views):
    made = loop()
    for number in range(views):
        name, read = f"view_{'x' * views}_{number}", Signature({}, {"figure": Port("figure", int)}, {}, None, "", False)
        made.nodes[name] = Node(name, "x.View", Stage(), read, {}, "after")
        made.wires.append(Wire(name, "ticks", "source", "tick", collect=True))
    text = svg(made)
    assert all(width >= text_width(name, 13) + 22 for name, (_, _, width, _) in boxes(text).items())
    placed = list(boxes(text).values())
    width, height = (float(ET.fromstring(text).get(key)) for key in ("width", "height"))
    for number, (x, y, w, h) in enumerate(placed):
        assert 0 <= x <= width - w
        assert 0 <= y <= height - h
        for ox, oy, ow, oh in placed[:number]:
            assert x + w <= ox or ox + ow <= x or y + h <= oy or oy + oh <= y


def test_a_delayed_wire_is_dashed_and_labelled_with_its_delay():
    text = svg(loop())
    assert "one tick later" in text
    dashed = [line for line in text.splitlines() if 'stroke-dasharray="6 4"' in line and "<title>" in line]
    assert len(dashed) == 1
    assert "fuse.belief → move.belief, one tick later, first value: start.belief" in dashed[0]


def test_readers_of_ground_truth_are_red_and_hovering_shows_class_summary_and_parameters_escaped():
    text = svg(loop())
    assert "see: robot.stages.See\nMakes &lt;see&gt; &amp; more.\ngain = 2.5" in text
    red = re.findall(r'<text[^>]*fill="#b3261e"[^>]*>([^<]*)</text>', text)
    assert "truth" in red
    assert "truth ← source.truth" in red
    assert "class n_score,n_start truth" in mermaid(loop())


def everything() -> Graph:
    """The loop with what few graphs have: a late reader of ground truth, two lanes, and cards in several columns."""
    made = loop()
    made.wires.append(Wire("see", "late", "source", "truth", delay=2))
    made.wires.append(Wire("see", "last", "move", "belief", hold=True))
    made.nodes["bias"] = Node("bias", "x.Bias", Stage(), made.nodes["move"].signature, {}, "tick")
    made.wires.append(Wire("fuse", "bias", "bias", "belief"))  # it stands just before its reader
    for number in range(8):
        read = Signature({}, {"figure": Port("figure", int)}, {}, None, "", False)
        made.nodes[f"view_{number}"] = Node(f"view_{number}", "x.View", Stage(), read, {}, "after")
        ports = ["ticks", "beliefs"][: 1 + (number == 2)]
        made.wires.extend(Wire(f"view_{number}", port, "source", "tick", collect=True) for port in ports)
    return made


def test_a_graph_is_drawn_as_was_found_good_by_eye():
    """Look at a new drawing before it takes the old one's place: `python tests/pipeline/report/test_graph_svg.py`."""
    assert svg(everything()).splitlines() == DRAWN.read_text("utf-8").splitlines()


def test_a_graph_is_always_drawn_alike_and_fetches_nothing():
    assert svg(loop()) == svg(loop())
    assert re.findall(r"https?://[^\"\s<]+", svg(loop())) == ["http://www.w3.org/2000/svg"]


def test_chains_of_boxes_are_drawn_without_crossings():
    two = graph(
        {"source": ("tick", "a b"), "c": ("tick", "x"), "d": ("tick", "x"), "e": ("tick", "x"), "f": ("tick", "x")},
        ["d.in < source.a", "c.in < source.b", "e.in < c.x", "f.in < d.x"],
    )
    placed = boxes(svg(two))
    assert placed["d"][1] < placed["c"][1]
    assert placed["f"][1] < placed["e"][1]


def test_an_empty_graph_can_be_drawn_and_a_small_one_has_room_for_its_legend():
    one = [graph({"a": (lifetime, "")}, []) for lifetime in ("tick", "after")]
    for made, top in zip((Graph({}, []), *one), (156, 156, 132), strict=True):
        drawn = ET.fromstring(svg(made))
        assert (drawn.get("width"), drawn.get("height")) == ("430", f"{top}"), made
    assert mermaid(Graph({}, [])) == "flowchart LR\n"


def test_mermaid_names_nodes_wires_bands_and_delays():
    text = mermaid(loop())
    assert text.startswith("flowchart LR\n")
    assert 'n_source -- "image" --> n_see' in text
    assert 'n_fuse -. "belief, one tick later" .-> n_move' in text
    assert 'n_start -. "belief, first value" .-> n_move' in text
    assert 'n_source == "truth" ==> n_score' in text
    assert 'subgraph after_band["after the last tick"]' in text
    assert text.count("subgraph") == text.count("\n  end\n")


if __name__ == "__main__":
    DRAWN.write_text(svg(everything()), "utf-8")
