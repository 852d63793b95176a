"""Maps of references for tests: poses and what is seen there, without edges."""

import numpy as np
from numpy.typing import ArrayLike

from omninav.stages.geometry.appearance.segments import FeatureKind
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import PoseSource


def references(
    poses: ArrayLike, features: np.ndarray | None = None, kind: FeatureKind = "histograms", source: PoseSource = "truth"
) -> ReferenceGraph:
    """A map of references at poses (N, 3), which look like nothing where no features are given."""
    at = np.asarray(poses, np.float64)
    looks = np.zeros((len(at), 1, 1), np.float32) if features is None else features
    return ReferenceGraph(at, looks, kind, np.zeros((0, 2), np.int64), source)
