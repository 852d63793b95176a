"""Whole views as one vector each, as maps learned during their use keep them."""

from abc import abstractmethod
from dataclasses import replace
from typing import Annotated, Self

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.appearance.rotated_distances import turned_distances, turns_of_nearest
from omninav.stages.geometry.appearance.spectra import best_turns, spectral_distances
from omninav.stages.geometry.arrays import Array, Floats, Ints


class WholeView(Value):
    """A view described by one vector. `values`: (D,) float32, what a map keeps of it.

    A view knows how far it is from kept ones and how far the robot has turned between them, so that maps and their
    stages need not know what the vector means.
    """

    values: Annotated[Floats, Shape("D")]

    @abstractmethod
    def distances(self, kept: Floats) -> Array:
        """Distances to kept views (R, D) of the same kind: (R,), 0 for equal views, whatever the robot's heading."""

    @property
    def rows(self) -> Floats:
        """All that is needed to compare the view with kept ones: (H, D), of which the first row is `values`."""
        return self.values[None]

    def like(self, rows: Floats) -> Self:
        """A view of the same kind with these `rows`."""
        return replace(self, values=rows[0])

    @abstractmethod
    def turns(self, kept: Floats) -> Array:
        """Turn of the robot, counter-clockwise, against its heading in each kept view (R, D): (R,) rad."""


class Coefficients(WholeView):
    """Coefficients of a linear projection of the panorama (DCT, PCA).

    `turned`: (H, D), row h what a robot turned counter-clockwise by 2 pi h / H would see; row 0 is `values`. A single
    row compares views as they are, at one heading only, and all turns are 0.
    """

    turned: Annotated[Floats, Shape("H", "D")]

    @property
    def rows(self) -> Floats:
        return self.turned

    def like(self, rows: Floats) -> Self:
        return replace(self, values=rows[0], turned=rows)

    def distances(self, kept: Floats) -> Array:
        return turned_distances(self.turned, kept)

    def turns(self, kept: Floats) -> Array:
        return turns_of_nearest(self.turned, kept)


class Spectrum(WholeView):
    """Fourier coefficients of averaged segments around the robot.

    `values` holds a spectrum of (channels, frequencies) complex numbers as float32: all real parts, then all imaginary
    ones. Its size alone does not change when the robot turns. `channels`: how many; `segments`: how many samples around
    the robot they were made from.
    """

    channels: Annotated[int, Bounds(ge=1)]
    segments: Annotated[int, Bounds(ge=1)]

    def distances(self, kept: Floats) -> Array:
        return spectral_distances(self.values, kept, self.channels, self.segments)

    def turns(self, kept: Floats) -> Array:
        return best_turns(self.values, kept, self.channels, self.segments)


class NoveltyThreshold(Value):
    """The distance between views above which a view is new: delta_y, E_max. In the views' unit.

    `settled`: False while it is still being measured. `metres`: the distance driven until a view is new, as measured so
    far; 0 where it is not known.
    """

    distance: Annotated[float, Bounds(ge=0)]
    settled: bool = True
    metres: Annotated[float, Bounds(ge=0)] = 0.0


class Neighbours(Value):
    """The map's views within the novelty threshold of the current one, nearest first.

    `rows`: (J,) their rows in the map. `distances`: (J,) in the views' unit. `similarities`: (J,) in [0, 1], 1 at
    distance 0, falling to 0 at the threshold. `turns`: (J,) how far the robot is turned, counter-clockwise, from
    its heading in each of them, radians. `nearest`: the distance to the nearest view of the whole map, inf without one.
    """

    rows: Annotated[Ints, Shape("J"), Bounds(ge=0)]
    distances: Annotated[Array, Shape("J"), Bounds(ge=0)]
    similarities: Annotated[Array, Shape("J"), Bounds(ge=0, le=1)]
    turns: Annotated[Array, Shape("J")]
    nearest: float
