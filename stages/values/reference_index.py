"""An index of a map's references by appearance."""

from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value
from omninav.pipeline.graph.contents import RowsOf, Shape

Floats = npt.NDArray[np.float32]


class ReferenceIndex(Value):
    """A short code of each reference of a map, in lists of similar ones: an inverted file with product quantisation.

    A view as a vector (D,), less `mean` (D,), times `axes` (D, d), is a short vector. That of reference r lies in list
    `lists[r]` around `centroids[lists[r]]` (d,); how it differs from there is in `codes[r]`: four bits for each pair of
    dimensions, the number of an entry of `codebooks` (d / 2, 16, 2), the first pair in the low bits of the first byte.
    """

    costly: ClassVar[bool] = True

    mean: Annotated[Floats, Shape("D")]
    axes: Annotated[Floats, Shape("D", "d")]
    centroids: Annotated[Floats, Shape("L", "d")]
    codebooks: Annotated[Floats, Shape("M", 16, 2)]
    lists: Annotated[npt.NDArray[np.int32], Shape("R"), RowsOf("L")]
    codes: Annotated[npt.NDArray[np.uint8], Shape("R", "bytes")]

    def __len__(self) -> int:
        return len(self.lists)
