"""An index of a map's references by appearance."""

from abc import abstractmethod
from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline import RowsOf, Shape, Value
from omninav.stages.geometry.arrays import Bytes, Floats


class ReferenceIndex(Value):
    """Index of the references of a map that look like a view: short vectors of them, in one of two forms.

    A view as a vector (D,), less `mean` (D,), times `axes` (D, d), is a short vector.
    """

    costly: ClassVar[bool] = True

    mean: Annotated[Floats, Shape("D")]
    axes: Annotated[Floats, Shape("D", "d")]

    @abstractmethod
    def __len__(self) -> int:
        """Number of references."""


class ShortVectors(ReferenceIndex):
    """The short vectors (R, d) themselves, to be compared one and all."""

    vectors: Annotated[Floats, Shape("R", "d")]

    def __len__(self) -> int:
        return len(self.vectors)


class InvertedLists(ReferenceIndex):
    """A short code of each reference, in lists of similar ones: an inverted file with product quantisation.

    The short vector of reference r is in list `lists[r]` around `centroids[lists[r]]` (d,); how it differs from there
    is in `codes[r]`: four bits for each pair of dimensions, the number of an entry of `codebooks` (d / 2, 16, 2), the
    first pair in the low bits of the first byte.
    """

    centroids: Annotated[Floats, Shape("L", "d")]
    codebooks: Annotated[Floats, Shape("M", 16, 2)]
    lists: Annotated[npt.NDArray[np.int32], Shape("R"), RowsOf("L")]
    codes: Annotated[Bytes, Shape("R", "bytes")]

    def __len__(self) -> int:
        return len(self.lists)
