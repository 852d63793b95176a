"""Positions of the boxes and wires of a drawn graph.

Wires go from left to right: layers by the longest path, ordered by barycentres. What runs before the loop is drawn left
of what runs every tick. A wire that is longer than a layer passes between the boxes of those that it crosses.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from omninav.pipeline.graph.graph import Graph, Node, Wire, node_of

from .drawn_graph import class_name

TITLE, ROW, PAD, GAP = 36.0, 16.0, 8.0, 18.0
"""Pixels: a box's title, a port's row, the space below the ports, and between boxes."""


@dataclass(frozen=True)
class Row:
    """A port on a box: its name, what is written there, and whether it is ground truth."""

    name: str
    text: str
    truth: bool = False


@dataclass
class Box:
    """A node as it is drawn: its title, its ports, and its position."""

    name: str
    subtitle: str
    hover: str
    lifetime: str
    inputs: list[Row]
    outputs: list[Row]
    source: bool = False
    outside: bool = False
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0

    @cached_property
    def height(self) -> float:
        """Its height in pixels."""
        numbers = len(self.inputs), len(self.outputs)
        rows = sum(numbers) if self.lifetime == "after" else max(numbers)
        return TITLE + ROW * rows + (PAD if rows else 0)

    def input_y(self, port: str) -> float:
        """Point at which a wire enters."""
        return self.y + TITLE + ROW * (next(i for i, row in enumerate(self.inputs) if row.name == port) + 0.5)

    def output_y(self, port: str) -> float:
        """Point at which a wire leaves."""
        return self.y + TITLE + ROW * (next(i for i, row in enumerate(self.outputs) if row.name == port) + 0.5)


@dataclass
class Passage:
    """Point at which a long wire goes through a layer between boxes. All readers of one output share it."""

    origin: str
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0
    height: float = 7.0


Item = Box | Passage


@dataclass(frozen=True)
class Layout:
    """The boxes of a graph by name; layers of what flows from left to right; and the links between layers."""

    boxes: dict[str, Box]
    layers: list[list[Item]]
    links: list["Link"]


def layout(graph: Graph) -> Layout:
    """Boxes with their widths, layers in order, and the heights at which the items of each layer are."""
    boxes = _boxes(graph)
    layers, links = _layers(graph, boxes, [box for box in boxes.values() if box.lifetime != "after"])
    _order(layers, links)
    _place(layers, links)
    return Layout(boxes, layers, links)


def _boxes(graph: Graph) -> dict[str, Box]:
    read = {origin for wire in graph.wires for origin in wire.origins}
    boxes: dict[str, Box] = {}
    for name in sorted({node_of(origin) for origin in read} - set(graph.nodes)):
        ports = sorted(origin.partition(".")[2] for origin in read if node_of(origin) == name)
        rows = [Row(port, port) for port in ports]
        boxes[name] = Box(
            name, "file or other run", "made before this run, or by another graph", "before", [], rows, outside=True
        )
    for node in graph.nodes.values():
        inputs = [_input_row(graph, node, wire) for wire in graph.inputs_of(node.name)]
        ports = [p for p in node.signature.outputs if f"{node.name}.{p}" in read]
        if not ports and node.lifetime != "after":
            ports = list(node.signature.outputs)
        outputs = [Row(port, port, graph.is_truth(f"{node.name}.{port}")) for port in ports]
        source = node.signature.is_source
        boxes[node.name] = Box(node.name, class_name(node.target), _hover(node), node.lifetime, inputs, outputs, source)
    for box in boxes.values():
        box.width = _box_width(box)
    return boxes


def _input_row(graph: Graph, node: Node, wire: Wire) -> Row:
    text = f"{wire.to_port} (held)" if wire.hold else wire.to_port
    if node.lifetime == "after":
        text = f"{wire.to_port} ← {wire.origin}"
    return Row(wire.to_port, text, any(map(graph.is_truth, wire.origins)))


def _box_width(box: Box) -> float:
    title = max(text_width(box.name, 13), text_width(box.subtitle, 10))
    left = max((text_width(row.text, 10.5) for row in box.inputs), default=0.0)
    right = max((text_width(row.text, 10.5) for row in box.outputs), default=0.0)
    ports = max(left, right) if box.lifetime == "after" else left + right + (14 if left and right else 0)
    return max(92.0, title + 22, ports + 22)


def text_width(text: str, size: float) -> float:
    """About how wide a text is in pixels."""
    narrow = sum(character in "iljtfr.,()[] :" for character in text)
    return size * (0.58 * (len(text) - narrow) + 0.33 * narrow)


def _hover(node: Node) -> str:
    lines = [f"{node.name}: {node.target}", node.signature.summary]
    for name, parameter in node.signature.parameters.items():
        lines.append(f"{name} = {node.parameters.get(name, parameter.default)!r}")
    return "\n".join(line for line in lines if line)


@dataclass(frozen=True)
class Link:
    """A drawn piece of a wire between two neighbouring layers."""

    start: Item
    end: Item
    origin: str
    port: str
    """The input port at `end`, '' where `end` is a `Passage`."""
    initial: bool = False

    @property
    def start_y(self) -> float:
        """Its first point."""
        return self.start.y if isinstance(self.start, Passage) else self.start.output_y(self.origin.partition(".")[2])

    @property
    def end_y(self) -> float:
        """Its last point."""
        return self.end.y if isinstance(self.end, Passage) else self.end.input_y(self.port)


def _layers(graph: Graph, boxes: dict[str, Box], flow: list[Box]) -> tuple[list[list[Item]], list[Link]]:
    """Boxes by the longest path that leads to them; long wires get a passage in every layer between."""
    names = {box.name for box in flow}
    edges: list[tuple[str, str, str, bool]] = []  # origin, to node, to port, is it a first value
    for wire in graph.wires:
        if wire.to_node in names:
            if not wire.delay:
                edges.append((wire.origin, wire.to_node, wire.to_port, False))
            if wire.initial and node_of(wire.initial) != wire.to_node:
                edges.append((wire.initial, wire.to_node, wire.to_port, True))
    depth = dict.fromkeys(names, 0)
    for _ in names:  # nodes are few: relax until nothing moves
        floor = max((depth[b.name] for b in flow if b.lifetime == "before"), default=-1) + 1
        wanted = {box.name: floor if box.lifetime == "tick" else 0 for box in flow}
        for origin, to_node, _, _ in edges:
            wanted[to_node] = max(wanted[to_node], depth[node_of(origin)] + 1)
        if wanted == depth:
            break
        depth = wanted
    # a box without inputs is just before its first reader, not far left of it
    for box in flow:
        readers = [depth[to] for origin, to, _, _ in edges if node_of(origin) == box.name]
        entered = any(to == box.name for _, to, _, _ in edges)
        if readers and not entered and not box.source and box.lifetime == "tick":
            depth[box.name] = max(depth[box.name], min(readers) - 1)
    layers: list[list[Item]] = [[] for _ in range(max(depth.values(), default=-1) + 1)]
    for box in flow:
        layers[depth[box.name]].append(box)
    links: list[Link] = []
    passages: dict[tuple[str, int], Passage] = {}
    for origin, to_node, port, initial in edges:
        here: Item = boxes[node_of(origin)]
        for layer in range(depth[node_of(origin)] + 1, depth[to_node]):
            if (origin, layer) not in passages:
                passages[origin, layer] = Passage(origin)
                layers[layer].append(passages[origin, layer])
                links.append(Link(here, passages[origin, layer], origin, "", initial))
            here = passages[origin, layer]
        links.append(Link(here, boxes[to_node], origin, port, initial))
    return layers, links


def _order(layers: list[list[Item]], links: list[Link]) -> None:
    """Order each layer by the barycentre of its neighbours, sweeping there and back; the best order seen is kept."""
    entering, leaving = _by_item(links)
    for layer in layers:
        _stack(layer)
    best, fewest = [list(layer) for layer in layers], _crossings(layers, leaving)
    for sweep in range(24):
        forward = sweep % 2 == 0
        sequence = range(1, len(layers)) if forward else range(len(layers) - 2, -1, -1)
        for number in sequence:
            around = entering if forward else leaving
            centre = {id(item): _barycentre(item, around[id(item)], forward) for item in layers[number]}
            layers[number].sort(key=lambda item: (centre[id(item)], item.y))
            _stack(layers[number])
        now = _crossings(layers, leaving)
        if now < fewest:
            best, fewest = [list(layer) for layer in layers], now
    for number, layer in enumerate(best):
        layers[number] = layer


Links = dict[int, list[Link]]
"""Links by the `id` of an item."""


def _by_item(links: Iterable[Link]) -> tuple[Links, Links]:
    """The links that enter each item, and those that leave it."""
    entering: Links = defaultdict(list)
    leaving: Links = defaultdict(list)
    for link in links:
        entering[id(link.end)].append(link)
        leaving[id(link.start)].append(link)
    return entering, leaving


def _stack(layer: list[Item]) -> None:
    y = -sum(item.height + GAP for item in layer) / 2
    for item in layer:
        item.y = y
        y += item.height + GAP


def _barycentre(item: Item, links: Iterable[Link], forward: bool) -> float:
    around = [link.start_y if forward else link.end_y for link in links]
    return sum(around) / len(around) if around else item.y + item.height / 2


def _crossings(layers: list[list[Item]], leaving: Links) -> int:
    count = 0
    for layer in layers:
        ends = [(link.start_y, link.end_y) for item in layer for link in leaving[id(item)]]
        start, end = np.array(ends).reshape(-1, 2).T
        crossed = np.subtract.outer(start, start) * np.subtract.outer(end, end) < 0
        count += int(np.count_nonzero(crossed)) // 2
    return count


def _place(layers: list[list[Item]], links: list[Link]) -> None:
    """Heights at which wires run as straight as the order of the boxes allows."""
    entering, leaving = _by_item(links)
    for layer in layers:
        _stack(layer)
    for sweep in range(16):
        for layer in layers if sweep % 2 == 0 else layers[::-1]:
            wishes = []
            for item in layer:
                pulls = [link.start_y - (link.end_y - item.y) for link in entering[id(item)]]
                pulls += [link.end_y - (link.start_y - item.y) for link in leaving[id(item)]]
                wishes.append(sum(pulls) / len(pulls) if pulls else item.y)
            for item, y in zip(layer, _spaced(wishes, [item.height + GAP for item in layer]), strict=True):
                item.y = y


def _spaced(wishes: Sequence[float], sizes: Sequence[float]) -> list[float]:
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
