"""Time that a wrong hypothesis stays in the belief."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.drive import Drive

NEAR_M = 1.5
"""Distance up to which a component belongs to the hypothesis, metres."""
POINTS = 30
"""Length of the list."""


class FalseHypothesisDuration(MetricStage):
    """Measures how many updates wrong hypotheses stay in a belief of Gaussians, and how their weight falls until then.

    Gross, Koenig & Müller 2005, section 2.1: "the weights of all unsupported components will be reduced passively …
    after a number of update cycles they can be deleted". A hypothesis is followed along odometry from the frame in
    which it was stated; it is gone once the belief has no component within `NEAR_M` of where it would be.

    `wrong_hypotheses`: `number`; `updates`, the mean number until they were gone, or until the end; `kept`, how many
    were there at the end; `weight`, a list over the updates from the first on: the mean of their weights, 0 once they
    are gone. One that is there when the drive ends is in as many entries as it had updates, and the list ends where
    none had more. Nothing where there is no wrong hypothesis.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[GaussianMixture],
        wrong: Sequence[GaussianMixture | None],
    ) -> MetricStage.Out:
        motions = np.nan_to_num(drive.motion)
        places: dict[int, Array] = {}  # of the wrong hypotheses that are not gone yet, by the row of their statement
        weights: dict[int, list[float]] = {}
        for row, (belief, stated) in enumerate(zip(beliefs, wrong, strict=True)):
            places = {born: compose(place, motions[row]) for born, place in places.items()}
            if stated is not None:
                places[row], weights[row] = stated.means[0], []
            for born in list(places):
                away = np.hypot(*(belief.means[:, :2] - places[born][:2]).T)
                weights[born].append(float(belief.weights[away <= NEAR_M].sum()))
                if not weights[born][-1]:
                    del places[born]
        if not weights:
            return self.Out()
        lives = [len(each) - (born not in places) for born, each in weights.items()]
        after = {born: np.nan if born in places else 0.0 for born in weights}
        curve = np.array([(each + [after[born]] * POINTS)[:POINTS] for born, each in weights.items()])
        curve = curve[:, np.isfinite(curve).any(axis=0)]
        values = {
            "number": len(weights),
            "updates": float(np.mean(lives)),
            "kept": len(places),
            "weight": np.nanmean(curve, axis=0).tolist(),
        }
        return self.Out(metrics=Metrics({"wrong_hypotheses": values}))
