"""One look for every plot: units on axes, the same bytes every time, no state of pyplot's."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omninav.pipeline.files import user_path
from omninav.pipeline.graph.problems import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#111111", "#8a8f98", "#E69F00", "#56B4E9")
"""Okabe & Ito's colours (2008), which colour-blind readers tell apart, dark enough on white."""

SOFTWARE = "omninav"
"""Name of the program in the file of a plot, which other programs' pictures lack."""

HEAD_BYTES = 200
"""Length of the beginning of a PNG that names its program, bytes."""

RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same plot on every machine
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#666666",
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.5,
    "lines.solid_joinstyle": "round",
    "figure.facecolor": "white",
}


class Drawing:
    """A plot being drawn; `content` holds its bytes once the `plot` block has ended."""

    def __init__(self, canvas: "Canvas") -> None:
        self.canvas = canvas
        self.content = b""


@contextmanager
def plot(width: float, height: float, dpi: int = 110) -> Iterator[Drawing]:
    """A blank plot of width x height inches in the house style, as PNG, without pyplot's global state."""
    import matplotlib
    from matplotlib.figure import Figure as Canvas

    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # a user's own matplotlibrc must not change the bytes
        matplotlib.rcParams.update(RC)
        drawn = Drawing(Canvas(figsize=(width, height), dpi=dpi, layout="constrained"))
        yield drawn
        buffer = io.BytesIO()
        drawn.canvas.savefig(buffer, format="png", metadata={"Software": SOFTWARE})
        drawn.content = buffer.getvalue()


def plot_file(out: str) -> Path:
    """The file of a plot. Raises BadInput where it is no .png, or another program's picture would be lost."""
    path = user_path(out)
    if path.suffix != ".png":
        raise BadInput(f"out={out:.100}: a picture is written to a file that ends in .png; type out=NAME.png")
    if path.is_file() and f"Software\0{SOFTWARE}".encode() not in path.read_bytes()[:HEAD_BYTES]:
        raise BadInput(f"out={out:.100}: it is there, and omninav did not draw it; type another name, or delete it")
    return path
