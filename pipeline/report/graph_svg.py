"""A built graph as an SVG drawing.

It is drawn from the graph that runs, never from a second description. Delayed wires go back below the rest. The inputs
of stages that run after the loop are written on them, because a line from every stage to every plot would hide the
loop.
"""

from collections.abc import Sequence
from html import escape

from omninav.pipeline.graph.graph import Graph, node_of

from .drawn_graph import LIFETIMES, delay_in_words
from .graph_layout import ROW, TITLE, Box, Item, Layout, Link, Passage, layout, text_width
from .mermaid import TRUTH

FONT = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
INK, QUIET, WIRE, DELAY = "#1d2733", "#5b6775", "#7b8896", "#0072b2"
COLOURS = {"before": ("#eef2f8", "#5b7db1"), "tick": ("#eef7f1", "#2f8f5b"), "after": ("#f5f0f9", "#8456a8")}
"""Ground and ink of the bands."""
LANE, COLUMN_GAP, BAND_GAP, TOP, CORNER_RADIUS = 20.0, 54.0, 24.0, 44.0, 7.0


def svg(graph: Graph) -> str:
    """The graph as an SVG text, the same for the same graph. Hovering over a box or a wire shows the rest."""
    return _Painter(graph, layout(graph)).paint()


class _Painter:
    def __init__(self, graph: Graph, found: Layout) -> None:
        self.graph, self.boxes, self.layers, self.links = graph, found.boxes, found.layers, found.links
        self.after = [box for box in self.boxes.values() if box.lifetime == "after"]
        self.delayed = [
            w
            for w in graph.wires
            if w.delay and w.from_node in self.boxes and self.boxes[w.to_node].lifetime != "after"
        ]
        self.under: list[str] = []
        self.over: list[str] = []

    def paint(self) -> str:
        bands = self._columns()
        high = self._lowered()
        lanes = list(dict.fromkeys(w.origin for w in self.delayed))
        floor = high + LANE * len(lanes) + (10 if lanes else 0)
        bottom = max(floor, TOP + 64) + 12
        left, right = 12.0, max((end for _, end in bands.values()), default=12.0)
        for lifetime, (start, end) in bands.items():
            self._band(lifetime, start, TOP - 32, end, bottom)
        if self.after:
            top = bottom + 12 if bands else TOP - 32
            right, bottom = self._cards(left, right, top)
            self._band("after", left, top, right, bottom)
        for link in self.links:
            self._link(link)
        for passage in (item for layer in self.layers for item in layer if isinstance(item, Passage)):
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
        fill, ink = COLOURS[lifetime]
        self.under.append(_rect(left, top, right - left, bottom - top, fill, "none", 10))
        self.under.append(_text(left + 14, top + 20, LIFETIMES[lifetime], 12, ink, weight="600"))

    def _columns(self) -> dict[str, tuple[float, float]]:
        """x of every layer, and where the bands begin and end."""
        bands: dict[str, tuple[float, float]] = {}
        x = 12.0
        previous = ""
        for layer in self.layers:
            lifetime = next((item.lifetime for item in layer if isinstance(item, Box)), previous)
            if lifetime != previous:
                x += BAND_GAP + 12 if previous else 0.0
                bands[lifetime] = (x, x)
                x += 24
            else:
                x += COLUMN_GAP
            width = max((item.width for item in layer if isinstance(item, Box)), default=20.0)
            for item in layer:
                item.x = x + (width - item.width) / 2 if isinstance(item, Box) else x
                if isinstance(item, Passage):
                    item.width = width
            x += width
            bands[lifetime] = (bands[lifetime][0], x + 24)
            previous = lifetime
        return bands

    def _lowered(self) -> float:
        """Shift everything to begin at the top; returns the lower edge of what flows."""
        items = [item for layer in self.layers for item in layer]
        top = min((item.y for item in items), default=0.0)
        for item in items:
            item.y += TOP + 4 - top
        return max((item.y + item.height for item in items), default=TOP)

    def _cards(self, left: float, right: float, top: float) -> tuple[float, float]:
        """Cards of the "after" stages side by side below the loop, each in the shortest column: right, bottom."""
        width = max(box.width for box in self.after)
        right = max(right, left + 28 + width)
        span = right - left - 14
        columns = min(len(self.after), max(1, int(span // (width + 14))))
        width = span / columns - 14 if columns < len(self.after) else width
        ends = [top + TITLE] * columns
        for box in self.after:
            column = ends.index(min(ends))
            box.x, box.y, box.width = left + 14 + column * (width + 14), ends[column], width
            ends[column] += box.height + 12
        return right, max(ends)

    def _colour(self, origin: str) -> str:
        return TRUTH if self.graph.is_truth(origin) else WIRE

    def _link(self, link: Link) -> None:
        x0 = link.start.x + link.start.width
        x1, y0, y1 = link.end.x, link.start_y, link.end_y
        colour = self._colour(link.origin)
        bend = max(20.0, (x1 - x0) / 2)
        dash = "2 3" if link.initial else ""
        what = f"{link.origin} → {_described(link.end, link.port)}" + (" (first value)" if link.initial else "")
        curve = f"M{x0:.1f} {y0:.1f} C{x0 + bend:.1f} {y0:.1f} {x1 - bend:.1f} {y1:.1f} {x1:.1f} {y1:.1f}"
        self.under.append(_path(curve, colour, dash, what))
        if isinstance(link.end, Box):
            self.over.append(_arrow(x1, y1, colour))

    def _lane(self, origin: str, y: float) -> None:
        """All delayed readers of one output: down, back below everything, and up to each reader."""
        start = self.boxes[node_of(origin)]
        x0, y0 = start.x + start.width, start.output_y(origin.partition(".")[2])
        wires = [w for w in self.delayed if w.origin == origin]
        out = x0 + 13
        colour = TRUTH if self.graph.is_truth(origin) else DELAY
        for wire in wires:
            end = self.boxes[wire.to_node]
            x1, y1 = end.x, end.input_y(wire.to_port)
            back = x1 - 15
            first = f", first value: {wire.initial}" if wire.initial else ""
            what = f"{origin} → {wire.to_node}.{wire.to_port}, {delay_in_words(wire)}{first}"
            self.under.append(
                _path(_rounded([(x0, y0), (out, y0), (out, y), (back, y), (back, y1), (x1, y1)]), colour, "6 4", what)
            )
            self.over.append(_arrow(x1, y1, colour))
        words = f"{origin} · {delay_in_words(wires[0])}"
        ends = [self.boxes[w.to_node].x - 15 for w in wires]
        middle = (out + min(ends)) / 2
        width = text_width(words, 10.5) + 10
        self.over.append(_rect(middle - width / 2, y - 8, width, 16, "#ffffff", colour, 8))
        self.over.append(_text(middle, y + 3.5, words, 10.5, colour, anchor="middle"))

    def _box(self, box: Box) -> None:
        ink = COLOURS[box.lifetime][1]
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
            x += 32 + text_width(words, 10.5) + 22
        return drawn


def _described(item: Item, port: str) -> str:
    return f"{item.name}.{port}" if isinstance(item, Box) else "…"


def _rounded(points: Sequence[tuple[float, float]]) -> str:
    """A path along right angles with rounded corners."""
    path = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        into = _towards(corner, before, CORNER_RADIUS)
        onward = _towards(corner, after, CORNER_RADIUS)
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
