"""Maps."""

from typing import Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value

from .pose import PoseSource


class ReferenceGraph(Value):
    """Reference views at known poses, joined by edges along the drive (Gross & Koenig 2004, section 2).

    `poses`: (R, 3) x, y (m), heading (rad) of the robot when the view was taken. `features`: (R, segments, bins) in
    the units of the features stage. `kind`: which features these are. `edges`: (E, 2) indices of neighbours along the
    drive. `pose_source`: where the poses come from.
    """

    poses: npt.NDArray[np.float64]
    features: npt.NDArray[np.float32]
    kind: Literal["histograms", "colours"]
    edges: npt.NDArray[np.int64]
    pose_source: PoseSource

    def __len__(self) -> int:
        return len(self.poses)
