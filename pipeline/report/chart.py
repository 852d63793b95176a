"""Charts as small SVG drawings, without matplotlib: cheap to make, sharp at every size, readable on light and dark.

Colours are names: inside a page they follow its style sheet, elsewhere each has a value of its own.
"""

import base64
import math
from collections.abc import Sequence
from html import escape
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Colour = Literal["blue", "orange", "green", "pink", "ink", "grey", "quiet", "line"]
Symbol = Literal["line", "dashes", "dot", "square", "ring"]

COLOURS: dict[Colour, str] = {
    "blue": "#0072b2",
    "orange": "#d55e00",
    "green": "#009e73",
    "pink": "#c3609a",
    "ink": "#1b2430",
    "grey": "#8a8f98",
    "quiet": "#5c6773",
    "line": "#dfe3e8",
}
"""Okabe & Ito's (2008), as they are on white."""
BEGINNING = '<svg class="chart"'
"""First characters of every chart, and of no other drawing."""
WIDTH = 560.0
"""Pixels for which a drawing is made; it is shown at any width."""
LEFT, RIGHT, TOP, BOTTOM, ROW = 64.0, 12.0, 30.0, 50.0, 24.0
"""Pixels around the axes, and of a row of the legend; wide enough for the larger letters of a narrow page."""
STRETCHES = 1000
"""Stretches of a line that has more than four points for each."""


def ink(colour: Colour) -> str:
    """A colour as CSS."""
    return f"var(--{colour},{COLOURS[colour]})"


class Scale:
    """Scales values `low` to `high` to pixels `start` to `end`, linearly or logarithmically."""

    def __init__(self, low: float, high: float, start: float, end: float, log: bool = False) -> None:
        self.low, self.high, self.start, self.end, self.log = low, high, start, end, log

    def __call__(self, values: npt.ArrayLike) -> Array:
        """Pixels of values of any shape; NaN stays, and so does what a logarithm does not have."""
        found = np.asarray(values, np.float64)
        low, high = self.low, self.high
        if self.log:
            found = np.log10(np.where(found > 0, found, np.nan))
            low, high = np.log10(low), np.log10(high)
        pixels: Array = self.start + (found - low) * ((self.end - self.start) / (high - low))
        return pixels

    @property
    def per_unit(self) -> float:
        """Pixels of one unit of a linear scale."""
        return abs((self.end - self.start) / (self.high - self.low))

    def ticks(self) -> list[float]:
        """Round values at a readable distance."""
        if self.log:
            low, high = int(np.floor(np.log10(self.low))), int(np.ceil(np.log10(self.high)))
            steps = (1.0, 10.0) if high - low > 2 else (1.0, 2.0, 5.0)
            found = {float(f"{step * 10.0**power:.6g}") for power in range(low, high + 1) for step in steps}
            return sorted(value for value in found if self.low <= value <= self.high)
        wanted = max(2.0, abs(self.end - self.start) / 70)
        rough = (self.high - self.low) / wanted
        power = 10.0 ** np.floor(np.log10(rough))
        step = next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= rough * 0.999)
        first, last = np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9)
        return [float(f"{n * step:.9g}") + 0.0 for n in np.arange(first, last + 1)]  # no -0


class Layer:
    """Marks on the axes of a chart; points are (N, 2 or more) in its units, and rows with NaN are left out."""

    def __init__(self, x: Scale, y: Scale) -> None:
        self.x, self.y = x, y
        self.marks: list[str] = []

    @property
    def svg(self) -> str:
        """All marks."""
        return "".join(self.marks)

    def _pixels(self, points: Array) -> Array:
        pixels: Array = np.column_stack([self.x(points[:, 0]), self.y(points[:, 1])])
        return pixels

    def line(
        self, points: Array, colour: Colour, width: float = 1.5, dashed: bool = False, opacity: float = 1.0
    ) -> None:
        """A line, interrupted at NaN; see `drawn_points` for what is left out of a long one."""
        words, drawing = [], False
        for x, y in drawn_points(self._pixels(points)).tolist():
            known = math.isfinite(x + y)
            if known:
                words.append(f"{'L' if drawing else 'M'}{x:.1f} {y:.1f}")
            drawing = known
        dashes = ";stroke-dasharray:5 4" if dashed else ""
        self._path("".join(words), f"stroke:{ink(colour)};stroke-width:{width:g}{dashes}", opacity)

    def dots(self, points: Array, colour: Colour, radius: float = 1.6, opacity: float = 1.0) -> None:
        """A disc at each point."""
        pixels = self._pixels(points)
        shown = np.unique(np.round(pixels[np.isfinite(pixels).all(axis=1)], 1), axis=0)
        spots = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in shown.tolist())
        self._path(spots, f"stroke:{ink(colour)};stroke-width:{2 * radius:g};stroke-linecap:round", opacity)

    def discs(self, points: Array, radii: Array, colour: Colour, opacity: float = 1.0) -> None:
        """Discs of different radii (pixels); those smaller than a pixel are left out."""
        for (x, y), radius in zip(self._pixels(points).tolist(), radii.tolist(), strict=True):
            if radius >= 1.0 and np.isfinite((x, y)).all():
                look = f"fill:{ink(colour)};fill-opacity:{opacity:.2g}"
                self.marks.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" style="{look}"/>')

    def ring(self, point: Array, colour: Colour, radius: float = 6.0) -> None:
        """A circle of a radius in pixels around a point."""
        ((x, y),) = self._pixels(point[None, :2]).tolist()
        if np.isfinite((x, y)).all():
            look = f"fill:none;stroke:{ink(colour)};stroke-width:2.2"
            self.marks.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" style="{look}"/>')

    def square(self, point: Array, colour: Colour) -> None:
        """A square around a point."""
        ((x, y),) = self._pixels(point[None, :2]).tolist()
        if np.isfinite((x, y)).all():
            where = f'x="{x - 4:.1f}" y="{y - 4:.1f}" width="8" height="8"'
            self.marks.append(f'<rect {where} style="fill:{ink(colour)}"/>')

    def crosses(self, points: Array, colour: Colour, half: float = 4.0) -> None:
        """A cross at each point."""
        arms = "".join(
            f"M{x - half:.1f} {y - half:.1f}l{2 * half:g} {2 * half:g}m0 {-2 * half:g}l{-2 * half:g} {2 * half:g}"
            for x, y in self._pixels(points).tolist()
            if math.isfinite(x + y)
        )
        self._path(arms, f"stroke:{ink(colour)};stroke-width:2")

    def text(self, point: Array, words: str) -> None:
        """Words beside a point."""
        ((x, y),) = self._pixels(point[None, :2]).tolist()
        self.marks.append(_text(x + 5, y - 4, words, "start"))

    def dart(self, place: Array, colour: Colour, size: float = 9.0) -> None:
        """A dart of a length in pixels at x, y that points along an angle (rad, counter-clockwise from x): (3,)."""
        ((x, y),) = self._pixels(place[None, :2]).tolist()
        if not np.isfinite((x, y, place[2])).all():
            return
        turns = place[2] + np.array([0.0, 2.5, np.pi, -2.5])
        lengths = np.array([1.25, 1.0, 0.45, 1.0]) * size
        tips = zip((x + lengths * np.cos(turns)).tolist(), (y - lengths * np.sin(turns)).tolist(), strict=True)
        corners = " ".join(f"{a:.1f},{b:.1f}" for a, b in tips)
        look = f"fill:{ink(colour)};stroke:var(--ground,#fff);stroke-width:1"
        self.marks.append(f'<polygon points="{corners}" style="{look}"/>')

    def ellipses(self, means: Array, covariances: Array, opacities: Array, colour: Colour, sigmas: float = 2.0) -> None:
        """Gaussians (K, ≥2), (K, ≥2, ≥2) as ellipses of `sigmas` standard deviations, lines as opaque as given."""
        spread, axes = np.linalg.eigh(covariances[:, :2, :2])
        radii = sigmas * self.x.per_unit * np.sqrt(np.maximum(spread, 0.0))
        turns = -np.degrees(np.arctan2(axes[:, 1, 1], axes[:, 0, 1]))
        rows = zip(self._pixels(means).tolist(), radii.tolist(), turns.tolist(), opacities.tolist(), strict=True)
        for (x, y), (short, long), turn, opacity in rows:
            if np.isfinite((x, y, short, long)).all():
                shape = f'rx="{max(long, 0.8):.1f}" ry="{max(short, 0.8):.1f}"'
                seen = f"opacity:{opacity:.2g};fill-opacity:0.25"
                look = f"fill:{ink(colour)};stroke:{ink(colour)};{seen}"
                place = f"translate({x:.1f} {y:.1f}) rotate({turn:.0f})"
                self.marks.append(f'<ellipse {shape} transform="{place}" style="{look}"/>')

    def raster(self, png: bytes, extent: tuple[float, float, float, float]) -> None:
        """PNG bytes over x from, x to, y from, y to; its first row is at the top."""
        (left, right), (low, high) = self.x(extent[:2]).tolist(), self.y(extent[2:]).tolist()
        where = f'x="{left:.1f}" y="{high:.1f}" width="{right - left:.1f}" height="{low - high:.1f}"'
        data = base64.b64encode(png).decode()
        look = 'preserveAspectRatio="none" style="image-rendering:pixelated"'
        self.marks.append(f'<image {where} {look} href="data:image/png;base64,{data}"/>')

    def upright(self, x: float, colour: Colour, text: str = "") -> None:
        """A line from bottom to top, with words beside it."""
        at = float(self.x(x))
        self._path(f"M{at:.1f} {self.y.start:.1f}V{self.y.end:.1f}", f"stroke:{ink(colour)};stroke-width:1.2")
        if text:
            self.marks.append(_text(at + 4, self.y.end + 14, text, "start"))

    def band(self, x: tuple[float, float], colour: Colour) -> None:
        """A band from bottom to top, at least two pixels wide."""
        first, last = self.x(x).tolist()
        where = f'x="{first:.1f}" y="{self.y.end:.1f}" width="{max(last - first, 2.0):.1f}"'
        look = f"fill:{ink(colour)};fill-opacity:0.25"
        self.marks.append(f'<rect {where} height="{abs(self.y.start - self.y.end):.1f}" style="{look}"/>')

    def level(self, y: float, colour: Colour) -> None:
        """A dotted line from left to right."""
        look = f"stroke:{ink(colour)};stroke-width:1;stroke-dasharray:2 3"
        self._path(f"M{self.x.start:.1f} {float(self.y(y)):.1f}H{self.x.end:.1f}", look)

    def _path(self, words: str, look: str, opacity: float = 1.0) -> None:
        if words:
            seen = "" if opacity == 1.0 else f";opacity:{opacity:.2g}"
            self.marks.append(f'<path d="{words}" style="fill:none;stroke-linejoin:round;{look}{seen}"/>')


class Chart:
    """Axes with units, one layer of marks, and a legend.

    `equal`: as many pixels for a unit of y as of x, within `height` (least, greatest).
    """

    def __init__(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        x_label: str,
        y_label: str,
        *,
        equal: bool = False,
        log: bool = False,
        height: tuple[float, float] = (190.0, 520.0),
    ) -> None:
        inner = WIDTH - LEFT - RIGHT
        across, up = x[1] - x[0], y[1] - y[0]
        tall = float(np.clip(inner * up / across, *height)) if equal else height[0]
        if equal:  # the part that is shown grows to the shape of the axes
            unit = max(across / inner, up / tall)
            x = ((x[0] + x[1] - unit * inner) / 2, (x[0] + x[1] + unit * inner) / 2)
            y = ((y[0] + y[1] - unit * tall) / 2, (y[0] + y[1] + unit * tall) / 2)
        self.tall = tall
        self.x, self.y = Scale(*x, LEFT, WIDTH - RIGHT), Scale(*y, TOP + tall, TOP, log)
        self.labels, self.base = (x_label, y_label), Layer(self.x, self.y)
        self._legend: list[tuple[str, Colour, Symbol]] = []

    def layer(self) -> Layer:
        """A further layer, to be laid over the chart."""
        return Layer(self.x, self.y)

    def name(self, words: str, colour: Colour, symbol: Symbol = "line") -> None:
        """Put an entry into the legend, once."""
        if (words, colour, symbol) not in self._legend:
            self._legend.append((words, colour, symbol))

    def unnamed(self) -> None:
        """Leave the legend to another chart of the same drawing."""
        self._legend.clear()

    def parts(self, top: float) -> tuple[str, float]:
        """The drawing below `top`, and where it ends."""
        x, y, right, bottom = self.x, self.y, WIDTH - RIGHT, TOP + self.tall
        out = [f'<g transform="translate(0 {top:g})">']
        out += [f'<path d="M{at:.1f} {TOP}V{bottom:.1f}" class="grid"/>' for at in x(x.ticks()).tolist()]
        out += [f'<path d="M{LEFT} {at:.1f}H{right:.1f}" class="grid"/>' for at in y(y.ticks()).tolist()]
        inside = f'x="{LEFT:g}" y="{TOP:g}" width="{right - LEFT:g}" height="{self.tall:g}"'
        box = f'viewBox="{LEFT:g} {TOP:g} {right - LEFT:g} {self.tall:g}"'
        out.append(f'<svg {inside} {box}>{self.base.svg}<g class="overlay"></g></svg>')
        out.append(f'<path d="M{LEFT} {TOP}V{bottom:.1f}H{right:.1f}" class="axis"/>')
        out += [_text(at, bottom + 18, f"{n:g}", "middle") for n, at in zip(x.ticks(), x(x.ticks()), strict=True)]
        out += [_text(LEFT - 6, at + 4, f"{n:g}", "end") for n, at in zip(y.ticks(), y(y.ticks()), strict=True)]
        out.append(_text((LEFT + right) / 2, bottom + 40, self.labels[0], "middle"))
        out.append(_text(8, TOP - 12, self.labels[1], "start"))
        legend, rows = self._drawn_legend(bottom + BOTTOM)
        out += [*legend, "</g>"]
        return "".join(out), top + bottom + BOTTOM + ROW * rows

    def svg(self) -> bytes:
        """The whole drawing."""
        return stacked([self])

    def _drawn_legend(self, top: float) -> tuple[list[str], int]:
        out, left, row = [], LEFT - 30, 0
        for words, colour, symbol in self._legend:
            wide = 44 + 9.3 * len(words)
            if left + wide > WIDTH and left > LEFT:
                left, row = LEFT - 30, row + 1
            out += [_symbol(left, top + ROW * (row + 0.4), colour, symbol)]
            out += [_text(left + 30, top + ROW * (row + 0.4) + 5, words, "start")]
            left += wide
        return out, row + 1 if self._legend else 0


def stacked(charts: Sequence[Chart]) -> bytes:
    """Charts one below the other, as one drawing."""
    out, top = [], 0.0
    for chart in charts:
        part, top = chart.parts(top)
        out.append(part)
    look = (
        "<style>.chart text{font:13px system-ui,sans-serif;fill:var(--quiet,#5c6773)}.chart .grid{stroke:var(--line,"
        "#dfe3e8);stroke-width:.7}.chart .axis{fill:none;stroke:var(--quiet,#5c6773)}</style>"
    )
    size = f'xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {top:g}"'
    return f"{BEGINNING} {size}>{look}{''.join(out)}</svg>".encode()


def drawn_points(pixels: Array) -> Array:
    """Those points of a line (N, 2) that are drawn; NaN interrupts it.

    What moves by less than a third of a pixel is left out. Of a line that is still too long, each stretch keeps its
    ends, its highest and its lowest point, and one interruption.
    """
    if not len(pixels):
        return pixels
    fine = np.round(np.nan_to_num(pixels, nan=-1e6) * 3)
    moved = np.append(True, (fine[1:] != fine[:-1]).any(axis=1))
    moved[-1] = True
    pixels = pixels[moved]
    if len(pixels) <= 4 * STRETCHES:
        return pixels
    known = np.asarray(np.isfinite(pixels).all(axis=1))
    kept = [len(pixels) - 1]
    lowest, highest = (np.where(known, pixels[:, 1], beyond) for beyond in (np.inf, -np.inf))
    for start, end in pairwise(np.linspace(0, len(pixels), STRETCHES + 1).astype(int).tolist()):
        kept += [start, end - 1, start + int(lowest[start:end].argmin()), start + int(highest[start:end].argmax())]
        kept += (start + np.flatnonzero(~known[start:end])[:1]).tolist()
    return pixels[np.unique(kept)]


def broken(points: Array, rows: npt.NDArray[np.int64] | Sequence[int]) -> Array:
    """Points with a row of NaN before each of some rows, so that a line is interrupted there."""
    return np.insert(points[:, :2], rows, np.nan, axis=0)


def steps(at: npt.ArrayLike, heights: npt.ArrayLike) -> Array:
    """A line (2 N, 2) that stays at each height (N,) from its place to the next one's, `at` (N + 1,)."""
    return np.column_stack([np.repeat(at, 2)[1:-1], np.repeat(heights, 2)])


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def _symbol(x: float, y: float, colour: Colour, symbol: Symbol) -> str:
    look = f"fill:none;stroke:{ink(colour)};stroke-width:2"
    if symbol == "dot":
        return f'<circle cx="{x + 15:.1f}" cy="{y:.1f}" r="3" style="fill:{ink(colour)}"/>'
    if symbol == "ring":
        return f'<circle cx="{x + 15:.1f}" cy="{y:.1f}" r="5" style="{look}"/>'
    if symbol == "square":
        return f'<rect x="{x + 10:.1f}" y="{y - 5:.1f}" width="10" height="10" style="fill:{ink(colour)}"/>'
    dashes = ";stroke-dasharray:5 4" if symbol == "dashes" else ""
    return f'<path d="M{x + 2:.1f} {y:.1f}h24" style="{look}{dashes}"/>'
