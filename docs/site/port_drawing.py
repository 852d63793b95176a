"""A stage as a box with its ports, as SVG that follows the page's colours."""

from html import escape

from omninav.pipeline.graph.ports import type_name
from omninav.pipeline.graph.signature import Port, Signature

ROW, TITLE, CHARACTER, GAP = 20, 30, 6.6, 26


def drawing(name: str, signature: Signature) -> str:
    """Inputs on the left, outputs on the right, each with its type; what may be missing is drawn hollow."""
    inputs, outputs = list(signature.inputs.values()), list(signature.outputs.values())
    left, right = (max([_width(port) for port in ports], default=0) for ports in (inputs, outputs))
    middle = max(180.0, CHARACTER * 1.25 * len(name) + 24)
    height = TITLE + ROW * max(len(inputs), len(outputs), 1) + 8
    x, end = left + GAP, left + GAP + middle
    parts = [
        f'<rect x="{x:.0f}" y="1" width="{middle:.0f}" height="{height - 2}" rx="6" class="box"/>',
        f'<text x="{x + middle / 2:.0f}" y="20" text-anchor="middle" class="name">{escape(name)}</text>',
    ]
    for ports, at, anchor, away in ((inputs, x, "end", -1), (outputs, end, "start", 1)):
        for row, port in enumerate(ports):
            y = TITLE + ROW * row + 6
            hollow = ' class="hollow"' if port.optional else ""
            parts.append(f'<circle cx="{at:.0f}" cy="{y}" r="4"{hollow}/>')
            parts.append(f'<text x="{at + 10 * away:.0f}" y="{y + 4}" text-anchor="{anchor}">{_words(port)}</text>')
    width = end + right + GAP
    return (
        f'<svg class="ports" viewBox="0 0 {width:.0f} {height}" style="max-width: {width:.0f}px" role="img" '
        f'aria-label="ports of {escape(name)}">{"".join(parts)}</svg>'
    )


def _type(port: Port) -> str:
    return ("all " if port.collects else "") + type_name(port.type)


def _words(port: Port) -> str:
    return f'{escape(port.name)} <tspan class="type">{escape(_type(port))}</tspan>'


def _width(port: Port) -> float:
    return CHARACTER * (len(port.name) + len(_type(port)) + 1) + 14
