"""A map of views that adapts: it learns places, weights them by confirmation and forgets them."""

import math
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.view_similarity import similarity
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import floored, merged, moments, squared_distances
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold

from .view_updates import PendingUpdates, ready_updates, start_over, view_event, within_cap

DEFAULT_LENGTH_SCALE_M = 0.3
"""Distance over which views are similar where the threshold does not tell."""
Forgetting = Literal["active", "passive", "none"]
StateCovariance = Literal["first", "every_update"]
Components = tuple[Array, Array, Array, Array]
MIN_SIMILARITY = 0.2
"""Similarity from which a view learns the state."""
MIN_WEIGHT = 0.01
"""Weight below which a component is removed."""
MERGE_BELOW = 7.81
"""Squared Mahalanobis distance below which components are merged."""
FITS_BELOW = 7.81
"""Squared Mahalanobis distance up to which a component fits the state."""
FORGET_GAIN = 2.0
"""Sum of a state's sigmas at which it forgets with `beta_forget`, in distances over which views are similar."""


class AdaptiveViews(Stage):
    """Learns views and the poses they are seen from, with weights that grow by confirmation and fade otherwise.

    Gross, Koenig & Mueller 2005, section 2.3, for each update (a view and the state in which it was seen):

    1. A view at or above the novelty threshold (E_max) from all others is inserted as a new one, without components.
    2. Views with a similarity S of at least `MIN_SIMILARITY` get the state as a new component, its heading turned to
       theirs (erratum 12 in docs/papers.md), with weight 0 and count S over the sum of S of all views (equation 11,
       erratum 6). Components closer than `MERGE_BELOW` are merged (equations 12 to 14, divided by the counts' sum:
       erratum 7), weights added and capped at 1 (erratum 8).
    3. Weights of views within the threshold: w = beta S + (1 - beta S) w of components that fit the state, at squared
       distance <= `FITS_BELOW` (equation 16); w = (1 - beta S) w of the others (17), unless `forgetting` is `none`.
       With `forgetting: active`, components of all other views near the state: w = (1 - b) w with b = beta_forget
       max(1 - distance / s, 0) `FORGET_GAIN` s / (sigma_x + sigma_y), in [0, 1] (18, 19, errata 10 and 11); s is the
       distance over which views are similar, as measured with the threshold.
    4. Components below `MIN_WEIGHT` are removed, and views without any (erratum 9: after the weights have grown).

    Updates wait until there is a threshold, all but a map's first. The paper does not learn from a state of several
    modes. Here each mode of weight p updates the views with S p >= `MIN_SIMILARITY`, with p times the count, and w =
    beta S p + (1 - beta S) w with p of all modes that fit.
    """

    forgetting: Forgetting = "active"
    """`active`; `passive`, the model of Porta & Kroese that Table 1 compares with; or `none`."""
    beta: Annotated[float, Bounds(gt=MIN_WEIGHT / MIN_SIMILARITY, le=1)] = 0.1
    """Learning rate of the weights; with less, a new place could be dropped as it is learned."""
    state_covariance: StateCovariance = "first"
    """Updates in which a state's covariance counts: the `first` of a component, or `every_update` (equation 14 to
    the letter). The state has most of its covariance from the same map, so that with `every_update` covariances grow
    without end and forgetting, which equation 19 divides by them, ceases. With `first` later states add the spread of
    their means and the minimal covariance ("coding a stable and reliable estimation", section 2.2)."""
    beta_forget: Annotated[float, Bounds(ge=0, le=1)] = 0.2
    """Rate of active forgetting."""
    min_sigma_m: Annotated[float, Bounds(ge=0)] = 0.1
    """Smallest standard deviation of a state's position: a view looks similar over some distance."""
    min_sigma_deg: Annotated[float, Bounds(ge=0)] = 2.0
    """Smallest standard deviation of its heading."""
    max_views: Annotated[int, Bounds(ge=0)] = 0
    """Views of the map, above which the weakest are removed; 0: no limit."""

    class Out(Outputs):
        """The map and its changes in this tick."""

        map: ViewMixtures
        events: ViewEvent | None = None

    def step(
        self,
        ctx: Context,
        updates: MapUpdates | None,
        threshold: NoveltyThreshold | None,
        map: ViewMixtures,
        waiting: PendingUpdates,
    ) -> Out:
        map.keep_threshold(threshold)
        before = map.ids
        start_over(updates, map, waiting)
        ready = ready_updates(() if updates is None else updates.items, threshold, map, waiting)
        if not ready:
            return self.Out(map=map)
        changed: list[Ints] = []
        seen: dict[int, int] = {}
        full = False
        for update in ready:
            seen[map.next_id] = update.index  # if the view is new
            changed.append(self._apply(update, threshold, map))
            kept = within_cap(map, self.max_views)
            full = full or not kept.all()
            map.keep_views(kept)
            map.step()
        ids = np.concatenate([*changed, np.array(list(seen))])
        return self.Out(map=map, events=view_event(map, before, ids, seen, "full" if full else "forgotten"))

    def _apply(self, update: MapUpdate, threshold: NoveltyThreshold | None, map: ViewMixtures) -> Ints:
        # Gives the ids of the views whose components changed.
        view = update.view
        state = _floored(update.state, self.min_sigma_m, np.radians(self.min_sigma_deg))
        if not len(state):
            return np.empty(0, np.int64)
        map.check_kind(view)
        distances = view.distances(map.views) if len(map) else np.empty(0)
        within = 0.0 if threshold is None else threshold.distance
        matched = distances < within
        if not matched.any():
            map.add_view(view.values, type(view).__name__)
            distances, matched = np.append(distances, 0.0), np.append(matched, True)
        similarities = np.where(matched, similarity(distances, within), 0.0)
        rows = np.flatnonzero(matched)
        turns = np.zeros(len(map))
        turns[rows] = view.turns(map.views[rows])
        self._add_components(state, similarities, turns, map)
        length_scale_m = (
            threshold.metres if threshold is not None and threshold.settled else 0.0
        ) or DEFAULT_LENGTH_SCALE_M
        weights = self._updated_weights(state, map, matched, similarities, turns, length_scale_m)
        touched: Ints = map.ids[np.unique(map.owner[weights != map.weights])]
        map.put(weights=weights)
        map.keep_components(map.weights >= MIN_WEIGHT)
        map.keep_views(np.bincount(map.owner, minlength=len(map)) > 0)
        return touched

    def _add_components(self, state: GaussianMixture, similarities: Array, turns: Array, map: ViewMixtures) -> None:
        # Phase 2: the state becomes a component of each view that is similar enough.
        total = similarities.sum()
        rows = np.flatnonzero(similarities * state.weights.max() >= MIN_SIMILARITY)
        min_covariance = np.diag([self.min_sigma_m, self.min_sigma_m, np.radians(self.min_sigma_deg)]) ** 2
        mixtures = []
        for row in rows.tolist():
            kept = similarities[row] * state.weights >= MIN_SIMILARITY
            means = state.means[kept]
            means[:, 2] = wrap(means[:, 2] - turns[row])
            mine = map.owner == row
            known = (map.means[mine], map.covariances[mine], map.counts[mine], map.weights[mine])
            counts = state.weights[kept] * (similarities[row] / total)
            new = (means, state.covariances[kept], counts, np.zeros(len(means)))
            if self.state_covariance == "first":
                known, new = _confirm(known, new, MERGE_BELOW, min_covariance)
            means, covariances, counts, weights = (np.concatenate(both) for both in zip(known, new, strict=True))
            mixtures.append(merged(means, covariances, counts, MERGE_BELOW, shares=weights))
        if len(rows):
            means, covariances, counts, weights = (np.concatenate(each) for each in zip(*mixtures, strict=True))
            owners = np.repeat(rows, [len(parts[0]) for parts in mixtures])
            map.put_mixtures(owners, means, covariances, np.minimum(weights, 1.0), counts)

    def _updated_weights(
        self,
        state: GaussianMixture,
        map: ViewMixtures,
        matched: Bools,
        similarities: Array,
        turns: Array,
        length_scale_m: float,
    ) -> Array:
        # Phase 3, equations 16 to 19: weights (C,) of the components of all views, by a state of several modes.
        weights = map.weights.copy()
        for row in np.flatnonzero(matched).tolist():
            mine, modes = map.owner == row, state.means - [0.0, 0.0, turns[row]]
            fits = squared_distances(modes, state.covariances, map.means[mine], map.covariances[mine]) <= FITS_BELOW
            fitting = (state.weights[:, None] * fits).sum(axis=0)
            gained = self.beta * similarities[row]
            fading = gained * fitting if self.forgetting == "none" else gained
            weights[mine] = np.minimum(gained * fitting + (1.0 - fading) * weights[mine], 1.0)
        if self.forgetting == "active":
            others = ~matched[map.owner]
            retained = np.ones(np.count_nonzero(others))
            for mean, covariance, share in zip(state.means, state.covariances, state.weights, strict=True):
                distances = np.hypot(*(map.means[others, :2] - mean[:2]).T)
                spread = math.sqrt(covariance[0, 0]) + math.sqrt(covariance[1, 1])
                lost = self.beta_forget * (1.0 - distances / length_scale_m) * (FORGET_GAIN * length_scale_m) / spread
                retained *= 1.0 - share * np.clip(lost, 0.0, 1.0)
            weights[others] *= retained
        return weights


def _confirm(known: Components, new: Components, below: float, min_covariance: Array) -> tuple[Components, Components]:
    # The known components, each merged with the means of the new ones nearest to it, which get the minimal covariance
    # instead of their own; and the new ones that are near none.
    means, covariances, counts, weights = (each.copy() for each in known)
    left = np.ones(len(new[0]), np.bool_)
    if len(means):
        for k in range(len(left)):
            squared = squared_distances(new[0][k : k + 1], new[1][k : k + 1], means, covariances)[0]
            j = int(squared.argmin())
            if squared[j] >= below:
                continue
            left[k] = False
            means[j], covariances[j], counts[j] = moments(
                np.stack([means[j], new[0][k]]),
                np.stack([covariances[j], min_covariance]),
                np.array([counts[j], new[2][k]]),
            )
    return (means, covariances, counts, weights), (new[0][left], new[1][left], new[2][left], new[3][left])


def _floored(state: GaussianMixture, metres: float, radians: float) -> GaussianMixture:
    # The state with weights that sum to 1 and a minimal covariance.
    present = state.weights > 0.0
    covariances = state.covariances[present]
    if metres > 0.0 and radians > 0.0 and len(covariances):
        covariances = floored(covariances, (metres, metres, radians))
    weights = state.weights[present]
    return GaussianMixture(state.means[present], covariances, weights / weights.sum() if len(weights) else weights)
