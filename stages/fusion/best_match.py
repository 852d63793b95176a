"""The pose of the most similar reference: plain matching, no filter."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import SinglePose
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import Similarities


class BestMatch(Stage):
    """Reports the pose of the most similar reference, turned by its best heading: no filter, no memory.

    Plain image matching, as a baseline for the filters.
    """

    class Out(Outputs):
        """One pose; absent where the map is empty."""

        belief: SinglePose | None = None

    def step(self, ctx: Context, similarities: Similarities, map: ReferenceGraph) -> Out:
        if not similarities.values.size:
            return self.Out()
        row, column = divmod(int(np.argmax(similarities.values)), similarities.values.shape[1])
        reference = row if similarities.candidates is None else int(similarities.candidates[row])
        x, y, heading = map.poses[reference]
        heading = float(wrap(heading + 2 * np.pi * column / similarities.values.shape[1]))
        return self.Out(belief=SinglePose(Pose(float(x), float(y), heading)))
