"""A built graph as a picture: SVG drawn here, and Mermaid text for Markdown.

The picture is drawn from the graph that runs, never from a second description. What runs before the loop stands left of
what runs every tick, and what runs after it stands below. Wires go from left to right (longest-path layers, ordered
by barycentres); delayed wires go back below the rest. What "after" stages take is written on them, because a line from
every stage to every view would hide the loop.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Protocol

from omninav.pipeline.graph.signature import Signature

FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
INK, QUIET, WIRE, TRUTH, DELAY = "#1d2733", "#5b6775", "#7b8896", "#b3261e", "#0072b2"
BANDS = {
    "before": ("before the loop", "#eef2f8", "#5b7db1"),
    "tick": ("every tick", "#eef7f1", "#2f8f5b"),
    "after": ("after the last tick", "#f5f0f9", "#8456a8"),
}
TITLE, ROW, PAD, GAP, LANE = 36.0, 16.0, 8.0, 18.0, 20.0
COLUMN_GAP, BAND_GAP, TOP = 54.0, 24.0, 44.0


class DrawnNode(Protocol):
    """What a picture needs to know of a node."""

    @property
    def name(self) -> str: ...
    @property
    def target(self) -> str: ...
    @property
    def lifetime(self) -> str: ...
    @property
    def signature(self) -> Signature: ...
    @property
    def parameters(self) -> Mapping[str, Any]: ...


class DrawnWire(Protocol):
    """What a picture needs to know of a wire."""

    @property
    def to_node(self) -> str: ...
    @property
    def to_port(self) -> str: ...
    @property
    def from_node(self) -> str: ...
    @property
    def from_port(self) -> str: ...
    @property
    def delay(self) -> int: ...
    @property
    def hold(self) -> bool: ...
    @property
    def collect(self) -> bool: ...
    @property
    def initial(self) -> str | None: ...


class DrawnGraph(Protocol):
    """What a picture needs to know of a graph."""

    @property
    def nodes(self) -> Mapping[str, DrawnNode]: ...
    @property
    def wires(self) -> Sequence[DrawnWire]: ...


# Mermaid


def mermaid(graph: DrawnGraph) -> str:
    """The graph as a Mermaid flowchart. Delayed and initial wires are dotted, collected ones thick."""
    lines = ["flowchart LR"]
    outside = sorted({_node_of(origin) for w in graph.wires for origin in _origins(w)} - set(graph.nodes))
    lines += [f"  {_id(name)}[({name})]" for name in outside]
    for lifetime, (title, _, _) in BANDS.items():
        names = [node.name for node in graph.nodes.values() if node.lifetime == lifetime]
        if names:
            lines.append(f'  subgraph {lifetime}_band["{title}"]')
            lines += [f"    {_id(n)}[{_quoted(f'{n}<br/>{_class_name(graph.nodes[n].target)}')}]" for n in names]
            lines.append("  end")
    joined: dict[tuple[str, str, str], list[str]] = {}
    for wire in graph.wires:
        name = wire.to_port if wire.from_port == wire.to_port else f"{wire.from_port} → {wire.to_port}"
        if wire.delay:
            joined.setdefault((wire.from_node, "-.", wire.to_node), []).append(f"{name}, {_later(wire)}")
        else:
            kind = "==" if wire.collect else "--"
            joined.setdefault((wire.from_node, kind, wire.to_node), []).append(name + (", held" if wire.hold else ""))
        if wire.initial:
            start, _, port = wire.initial.partition(".")
            joined.setdefault((start, "-.", wire.to_node), []).append(f"{port}, first value")
    arrow = {"--": "-->", "-.": ".->", "==": "==>"}
    for (start, kind, end), names in joined.items():
        lines.append(f"  {_id(start)} {kind} {_quoted('<br/>'.join(names))} {arrow[kind]} {_id(end)}")
    readers = sorted({w.to_node for w in graph.wires if _reads_truth(graph, f"{w.from_node}.{w.from_port}")})
    readers = sorted({*readers, *(w.to_node for w in graph.wires if w.initial and _reads_truth(graph, w.initial))})
    if readers:
        lines.append(f"  classDef truth stroke:{TRUTH},stroke-width:2px")
        lines.append(f"  class {','.join(_id(name) for name in readers)} truth")
    return "\n".join(lines) + "\n"


def _id(name: str) -> str:
    return "n_" + re.sub(r"\W", "_", name)


def _quoted(text: str) -> str:
    return '"' + text.replace('"', "#quot;") + '"'


# what the picture shows


@dataclass
class _Row:
    """A port on a box. `origins`: for an input, what enters it."""

    name: str
    origins: list[str] = field(default_factory=list)
    text: str = ""
    truth: bool = False


@dataclass
class _Box:
    name: str
    subtitle: str
    hover: str
    lifetime: str
    inputs: list[_Row]
    outputs: list[_Row]
    source: bool = False
    outside: bool = False
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0

    @property
    def rows(self) -> int:
        return (
            len(self.inputs) + len(self.outputs)
            if self.lifetime == "after"
            else max(len(self.inputs), len(self.outputs))
        )

    @property
    def height(self) -> float:
        return TITLE + ROW * self.rows + (PAD if self.rows else 0)

    def input_y(self, port: str) -> float:
        return self.y + TITLE + ROW * (next(i for i, row in enumerate(self.inputs) if row.name == port) + 0.5)

    def output_y(self, port: str) -> float:
        return self.y + TITLE + ROW * (next(i for i, row in enumerate(self.outputs) if row.name == port) + 0.5)


@dataclass
class _Pass:
    """Where a long wire goes through a layer between boxes. All readers of one output share it."""

    origin: str
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0
    height: float = 7.0


_Item = _Box | _Pass


def svg(graph: DrawnGraph) -> str:
    """The graph as an SVG text, the same for the same graph. Hovering a box or a wire tells the rest."""
    boxes = _boxes(graph)
    flow = [box for box in boxes.values() if box.lifetime != "after"]
    layers, links = _layers(graph, boxes, flow)
    _order(layers, links)
    _place(layers, links)
    return _Painter(graph, boxes, layers, links).paint()


def _boxes(graph: DrawnGraph) -> dict[str, _Box]:
    read = {origin for wire in graph.wires for origin in _origins(wire)}
    boxes: dict[str, _Box] = {}
    for name in sorted({_node_of(origin) for origin in read} - set(graph.nodes)):
        ports = sorted(origin.partition(".")[2] for origin in read if _node_of(origin) == name)
        rows = [_Row(port, text=port) for port in ports]
        boxes[name] = _Box(
            name, "file or other run", "made before this run, or by another graph", "before", [], rows, outside=True
        )
    for node in graph.nodes.values():
        inputs = [_input_row(graph, node, wire) for wire in graph.wires if wire.to_node == node.name]
        ports = [p for p in node.signature.outputs if f"{node.name}.{p}" in read] or list(node.signature.outputs)
        if node.lifetime == "after":
            ports = [p for p in node.signature.outputs if f"{node.name}.{p}" in read]
        outputs = [_Row(port, text=port, truth=_reads_truth(graph, f"{node.name}.{port}")) for port in ports]
        source = node.signature.is_source
        boxes[node.name] = _Box(
            node.name, _class_name(node.target), _hover(node), node.lifetime, inputs, outputs, source
        )
    for box in boxes.values():
        box.width = _box_width(box)
    return boxes


def _input_row(graph: DrawnGraph, node: DrawnNode, wire: DrawnWire) -> _Row:
    origins = _origins(wire)
    row = _Row(wire.to_port, origins, wire.to_port, any(_reads_truth(graph, origin) for origin in origins))
    if node.lifetime == "after":
        row.text = f"{wire.to_port} ← {wire.from_node}.{wire.from_port}"
    elif wire.hold:
        row.text = f"{wire.to_port} (held)"
    return row


def _box_width(box: _Box) -> float:
    title = max(_text_width(box.name, 13), _text_width(box.subtitle, 10))
    left = max((_text_width(row.text, 10.5) for row in box.inputs), default=0.0)
    right = max((_text_width(row.text, 10.5) for row in box.outputs), default=0.0)
    ports = max(left, right) if box.lifetime == "after" else left + right + (14 if left and right else 0)
    return max(92.0, title + 22, ports + 22)


def _text_width(text: str, size: float) -> float:
    narrow = sum(character in "iljtfr.,()[] :" for character in text)
    return size * (0.58 * (len(text) - narrow) + 0.33 * narrow)


def _hover(node: DrawnNode) -> str:
    lines = [f"{node.name}: {node.target}", node.signature.summary]
    for name, parameter in node.signature.parameters.items():
        lines.append(f"{name} = {node.parameters.get(name, parameter.default)!r}")
    return "\n".join(line for line in lines if line)


def _class_name(target: str) -> str:
    return target.rpartition(".")[2]


def _node_of(origin: str) -> str:
    return origin.partition(".")[0]


def _origins(wire: DrawnWire) -> list[str]:
    return [f"{wire.from_node}.{wire.from_port}", *([wire.initial] if wire.initial else [])]


def _reads_truth(graph: DrawnGraph, origin: str) -> bool:
    node, _, port = origin.partition(".")
    given = graph.nodes[node].signature.outputs.get(port) if node in graph.nodes else None
    return given is not None and given.truth


def _later(wire: DrawnWire) -> str:
    return "one tick later" if wire.delay == 1 else f"{wire.delay} ticks later"


# where things stand


@dataclass(frozen=True)
class _Link:
    """A drawn piece of a wire between two neighbouring layers."""

    start: _Item
    end: _Item
    origin: str
    port: str
    """The input port at `end`, '' where `end` is a `_Pass`."""
    initial: bool = False

    @property
    def start_y(self) -> float:
        return self.start.y if isinstance(self.start, _Pass) else self.start.output_y(self.origin.partition(".")[2])

    @property
    def end_y(self) -> float:
        return self.end.y if isinstance(self.end, _Pass) else self.end.input_y(self.port)


def _layers(graph: DrawnGraph, boxes: dict[str, _Box], flow: list[_Box]) -> tuple[list[list[_Item]], list[_Link]]:
    """Boxes by the longest path that leads to them; long wires get a passage in every layer between."""
    names = {box.name for box in flow}
    edges: list[tuple[str, str, str, bool]] = []  # origin, to node, to port, is it a first value
    for wire in graph.wires:
        if wire.to_node in names:
            if not wire.delay:
                edges.append((f"{wire.from_node}.{wire.from_port}", wire.to_node, wire.to_port, False))
            if wire.initial and _node_of(wire.initial) != wire.to_node:
                edges.append((wire.initial, wire.to_node, wire.to_port, True))
    depth = dict.fromkeys(names, 0)
    for _ in names:  # nodes are few: relax until nothing moves
        floor = max((depth[b.name] for b in flow if b.lifetime == "before"), default=-1) + 1
        wanted = {box.name: floor if box.lifetime == "tick" else 0 for box in flow}
        for origin, to_node, _, _ in edges:
            wanted[to_node] = max(wanted[to_node], depth[_node_of(origin)] + 1)
        if wanted == depth:
            break
        depth = wanted
    # a box without inputs stands just before its first reader, not far left of it
    for box in flow:
        readers = [depth[to] for origin, to, _, _ in edges if _node_of(origin) == box.name]
        entered = any(to == box.name for _, to, _, _ in edges)
        if readers and not entered and not box.source and box.lifetime == "tick":
            depth[box.name] = max(depth[box.name], min(readers) - 1)
    layers: list[list[_Item]] = [[] for _ in range(max(depth.values(), default=-1) + 1)]
    for box in flow:
        layers[depth[box.name]].append(box)
    links: list[_Link] = []
    passages: dict[tuple[str, int], _Pass] = {}
    for origin, to_node, port, initial in edges:
        here: _Item = boxes[_node_of(origin)]
        for layer in range(depth[_node_of(origin)] + 1, depth[to_node]):
            if (origin, layer) not in passages:
                passages[origin, layer] = _Pass(origin)
                layers[layer].append(passages[origin, layer])
                links.append(_Link(here, passages[origin, layer], origin, "", initial))
            here = passages[origin, layer]
        links.append(_Link(here, boxes[to_node], origin, port, initial))
    return layers, links


def _order(layers: list[list[_Item]], links: list[_Link]) -> None:
    """Order each layer by the barycentre of its neighbours, sweeping there and back; the best order seen is kept."""
    best, fewest = [list(layer) for layer in layers], _crossings(layers, links)
    for sweep in range(24):
        forward = sweep % 2 == 0
        sequence = range(1, len(layers)) if forward else range(len(layers) - 2, -1, -1)
        for number in sequence:
            _stack(layers)
            centre = {id(item): _barycentre(item, links, forward) for item in layers[number]}
            layers[number].sort(key=lambda item: (centre[id(item)], item.y))
        now = _crossings(layers, links)
        if now < fewest:
            best, fewest = [list(layer) for layer in layers], now
    for number, layer in enumerate(best):
        layers[number] = layer


def _stack(layers: list[list[_Item]]) -> None:
    for layer in layers:
        y = -sum(item.height + GAP for item in layer) / 2
        for item in layer:
            item.y = y
            y += item.height + GAP


def _barycentre(item: _Item, links: Iterable[_Link], forward: bool) -> float:
    if forward:
        around = [link.start_y for link in links if link.end is item]
    else:
        around = [link.end_y for link in links if link.start is item]
    return sum(around) / len(around) if around else item.y + item.height / 2


def _crossings(layers: list[list[_Item]], links: list[_Link]) -> int:
    _stack(layers)
    count = 0
    for layer in layers:
        leaving = [(link.start_y, link.end_y) for item in layer for link in links if link.start is item]
        for number, (start, end) in enumerate(leaving):
            count += sum((start - s) * (end - e) < 0 for s, e in leaving[:number])
    return count


def _place(layers: list[list[_Item]], links: list[_Link]) -> None:
    """Heights at which wires run as straight as the order of the boxes allows."""
    _stack(layers)
    for sweep in range(16):
        for layer in layers if sweep % 2 == 0 else layers[::-1]:
            wishes = []
            for item in layer:
                pulls = [link.start_y - (link.end_y - item.y) for link in links if link.end is item]
                pulls += [link.end_y - (link.start_y - item.y) for link in links if link.start is item]
                wishes.append(sum(pulls) / len(pulls) if pulls else item.y)
            for item, y in zip(layer, _apart(wishes, [item.height + GAP for item in layer]), strict=True):
                item.y = y


def _apart(wishes: Sequence[float], sizes: Sequence[float]) -> list[float]:
    """Positions nearest to the wishes (least squares) at which things of these sizes follow without overlap."""
    offsets = [sum(sizes[:number]) for number in range(len(sizes))]
    blocks: list[tuple[float, int]] = []  # mean of wish minus offset, and how many share it
    for wish, offset in zip(wishes, offsets, strict=True):
        mean, count = wish - offset, 1
        while blocks and blocks[-1][0] > mean:
            other, others = blocks.pop()
            mean, count = (mean * count + other * others) / (count + others), count + others
        blocks.append((mean, count))
    spread = [mean for mean, count in blocks for _ in range(count)]
    return [mean + offset for mean, offset in zip(spread, offsets, strict=True)]


# the drawing


class _Painter:
    def __init__(
        self, graph: DrawnGraph, boxes: dict[str, _Box], layers: list[list[_Item]], links: list[_Link]
    ) -> None:
        self.graph, self.boxes, self.layers, self.links = graph, boxes, layers, links
        self.after = [box for box in boxes.values() if box.lifetime == "after"]
        self.delayed = [
            w for w in graph.wires if w.delay and w.from_node in boxes and boxes[w.to_node].lifetime != "after"
        ]
        self.under: list[str] = []
        self.over: list[str] = []

    def paint(self) -> str:
        bands = self._columns()
        low, high = self._vertical()
        lanes = list(dict.fromkeys(f"{w.from_node}.{w.from_port}" for w in self.delayed))
        floor = high + LANE * len(lanes) + (10 if lanes else 0)
        bottom = max(floor, low + 60) + 12
        left, right = 12.0, max((end for _, end in bands.values()), default=12.0)
        for lifetime, (start, end) in bands.items():
            self._band(lifetime, start, TOP - 32, end, bottom)
        if self.after:
            top = bottom + 12 if bands else TOP - 32
            right, bottom = self._cards(left, right, top)
            self._band("after", left, top, right, bottom)
        for link in self.links:
            self._link(link)
        for passage in (item for layer in self.layers for item in layer if isinstance(item, _Pass)):
            self.under.append(
                _path(f"M{passage.x:.1f} {passage.y:.1f} h{passage.width:.1f}", self._colour(passage.origin))
            )
        for number, origin in enumerate(lanes):
            self._lane(origin, high + 14 + LANE * number)
        for box in self.boxes.values():
            self._box(box)
        width, height = max(right + 12, 430.0), bottom + 36
        legend = self._legend(16, bottom + 20)
        content = "\n".join([*self.under, *self.over, *legend])
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="{FONT}" role="img" aria-label="the graph">\n'
            f"<title>{escape(f'{len(self.graph.nodes)} stages, {len(self.graph.wires)} wires')}</title>\n"
            f"{_rect(0, 0, width, height, '#ffffff', 'none', 0)}\n{content}\n</svg>\n"
        )

    def _band(self, lifetime: str, left: float, top: float, right: float, bottom: float) -> None:
        title, fill, ink = BANDS[lifetime]
        self.under.append(_rect(left, top, right - left, bottom - top, fill, "none", 10))
        self.under.append(_text(left + 14, top + 20, title, 12, ink, weight="600"))

    def _columns(self) -> dict[str, tuple[float, float]]:
        """x of every layer, and where the bands begin and end."""
        bands: dict[str, tuple[float, float]] = {}
        x = 12.0
        previous = ""
        for layer in self.layers:
            lifetime = next((item.lifetime for item in layer if isinstance(item, _Box)), previous)
            if lifetime != previous:
                x += BAND_GAP + 12 if previous else 0.0
                bands[lifetime] = (x, x)
                x += 24
            else:
                x += COLUMN_GAP
            width = max((item.width for item in layer if isinstance(item, _Box)), default=20.0)
            for item in layer:
                item.x = x + (width - item.width) / 2 if isinstance(item, _Box) else x
                if isinstance(item, _Pass):
                    item.width = width
            x += width
            bands[lifetime] = (bands[lifetime][0], x + 24)
            previous = lifetime
        return bands

    def _vertical(self) -> tuple[float, float]:
        """Shift everything to begin at the top; returns the upper and lower edge of what flows."""
        items = [item for layer in self.layers for item in layer]
        top = min((item.y for item in items), default=0.0)
        for item in items:
            item.y += TOP + 4 - top
        return TOP + 4, max((item.y + item.height for item in items), default=TOP + 4)

    def _cards(self, left: float, right: float, top: float) -> tuple[float, float]:
        """Cards of the "after" stages side by side below the loop, each in the shortest column: right, bottom."""
        if not self.after:
            return right, top
        width = max(box.width for box in self.after)
        right = max(right, left + 28 + width)
        columns = min(len(self.after), max(1, int((right - left - 28 + 14) // (width + 14))))
        width = (right - left - 28 + 14) / columns - 14 if columns < len(self.after) else width
        ends = [top + TITLE] * columns
        for box in self.after:
            column = ends.index(min(ends))
            box.x, box.y, box.width = left + 14 + column * (width + 14), ends[column], width
            ends[column] += box.height + 12
        return right, max(ends)

    def _colour(self, origin: str) -> str:
        return TRUTH if _reads_truth(self.graph, origin) else WIRE

    def _link(self, link: _Link) -> None:
        x0 = link.start.x + link.start.width
        x1, y0, y1 = link.end.x, link.start_y, link.end_y
        colour = self._colour(link.origin)
        bend = max(20.0, (x1 - x0) / 2)
        dash = "2 3" if link.initial else ""
        what = f"{link.origin} → {_described(link.end, link.port)}" + (" (first value)" if link.initial else "")
        curve = f"M{x0:.1f} {y0:.1f} C{x0 + bend:.1f} {y0:.1f} {x1 - bend:.1f} {y1:.1f} {x1:.1f} {y1:.1f}"
        self.under.append(_path(curve, colour, dash, what))
        if isinstance(link.end, _Box):
            self.over.append(_arrow(x1, y1, colour))

    def _lane(self, origin: str, y: float) -> None:
        """All delayed readers of one output: down, back below everything, and up to each reader."""
        start = self.boxes[_node_of(origin)]
        x0, y0 = start.x + start.width, start.output_y(origin.partition(".")[2])
        wires = [w for w in self.delayed if f"{w.from_node}.{w.from_port}" == origin]
        out = x0 + 13
        colour = TRUTH if _reads_truth(self.graph, origin) else DELAY
        for wire in wires:
            end = self.boxes[wire.to_node]
            x1, y1 = end.x, end.input_y(wire.to_port)
            back = x1 - 15
            first = f", first value: {wire.initial}" if wire.initial else ""
            what = f"{origin} → {wire.to_node}.{wire.to_port}, {_later(wire)}{first}"
            self.under.append(
                _path(_rounded([(x0, y0), (out, y0), (out, y), (back, y), (back, y1), (x1, y1)]), colour, "6 4", what)
            )
            self.over.append(_arrow(x1, y1, colour))
        words = f"{origin} · {_later(wires[0])}"
        ends = [self.boxes[w.to_node].x - 15 for w in wires]
        middle = (out + min(ends)) / 2
        width = _text_width(words, 10.5) + 10
        self.over.append(_rect(middle - width / 2, y - 8, width, 16, "#ffffff", colour, 8))
        self.over.append(_text(middle, y + 3.5, words, 10.5, colour, anchor="middle"))

    def _box(self, box: _Box) -> None:
        ink = BANDS[box.lifetime][2]
        parts = [f"<title>{escape(box.hover)}</title>"]
        dash = "4 3" if box.outside else ""
        parts.append(_rect(box.x, box.y, box.width, box.height, "#ffffff", ink, 7, dash, 2.2 if box.source else 1.3))
        parts.append(_text(box.x + 10, box.y + 16, box.name, 13, INK, weight="700"))
        parts.append(_text(box.x + 10, box.y + 29, box.subtitle, 10, QUIET))
        for row in box.inputs:
            y, colour = box.input_y(row.name), TRUTH if row.truth else INK
            parts.append(_text(box.x + 10, y + 3.5, row.text, 10.5, colour, weight="600" if row.truth else ""))
        shift = ROW * len(box.inputs) if box.lifetime == "after" else 0.0
        for row in box.outputs:
            y, colour = box.output_y(row.name) + shift, TRUTH if row.truth else INK
            parts.append(_text(box.x + box.width - 10, y + 3.5, row.text, 10.5, colour, anchor="end"))
            parts.append(
                f'<circle cx="{box.x + box.width:.1f}" cy="{y:.1f}" r="3" fill="{TRUTH if row.truth else ink}"/>'
            )
        self.over.append("<g>" + "".join(parts) + "</g>")

    def _legend(self, x: float, y: float) -> list[str]:
        entries = [
            (WIRE, "", "this tick"),
            (WIRE, "2 3", "first value"),
            (DELAY, "6 4", "a later tick"),
            (TRUTH, "", "ground truth"),
        ]
        drawn = []
        for colour, dash, words in entries:
            drawn.append(_path(f"M{x:.1f} {y:.1f} h26", colour, dash))
            drawn.append(_text(x + 32, y + 3.5, words, 10.5, QUIET))
            x += 32 + _text_width(words, 10.5) + 22
        return drawn


def _described(item: _Item, port: str) -> str:
    return f"{item.name}.{port}" if isinstance(item, _Box) else "…"


def _rounded(points: Sequence[tuple[float, float]], radius: float = 7.0) -> str:
    """A path along right angles with rounded corners."""
    path = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        into = _towards(corner, before, radius)
        onward = _towards(corner, after, radius)
        path += f" L{into[0]:.1f} {into[1]:.1f} Q{corner[0]:.1f} {corner[1]:.1f} {onward[0]:.1f} {onward[1]:.1f}"
    return path + f" L{points[-1][0]:.1f} {points[-1][1]:.1f}"


def _towards(corner: tuple[float, float], other: tuple[float, float], distance: float) -> tuple[float, float]:
    dx, dy = other[0] - corner[0], other[1] - corner[1]
    length = max(abs(dx) + abs(dy), 1e-9)
    share = min(distance, length / 2) / length
    return corner[0] + dx * share, corner[1] + dy * share


def _path(shape: str, colour: str, dash: str = "", hover: str = "") -> str:
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    title = f"<title>{escape(hover)}</title>" if hover else ""
    return f'<path d="{shape}" fill="none" stroke="{colour}" stroke-width="1.5"{dashed}>{title}</path>'


def _arrow(x: float, y: float, colour: str) -> str:
    return f'<path d="M{x - 7:.1f} {y - 4:.1f} L{x:.1f} {y:.1f} L{x - 7:.1f} {y + 4:.1f} Z" fill="{colour}"/>'


def _rect(
    x: float,
    y: float,
    width: float,
    height: float,
    fill: str,
    ink: str,
    radius: float,
    dash: str = "",
    stroke: float = 1.0,
) -> str:
    line = "" if ink == "none" else f' stroke="{ink}" stroke-width="{stroke:g}"'
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    size = f'width="{width:.1f}" height="{height:.1f}" rx="{radius:g}"'
    return f'<rect x="{x:.1f}" y="{y:.1f}" {size} fill="{fill}"{line}{dashed}/>'


def _text(x: float, y: float, words: str, size: float, colour: str, weight: str = "", anchor: str = "") -> str:
    extra = (f' font-weight="{weight}"' if weight else "") + (f' text-anchor="{anchor}"' if anchor else "")
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" fill="{colour}"{extra}>{escape(words)}</text>'
