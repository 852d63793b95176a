"""A map of views that follows what the robot sees: it learns places, trusts them more or less, and forgets them."""

from typing import Annotated, Literal

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.view_similarity import Shape, similarity
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import (
    apart,
    floored,
    merged,
    moments,
    squared_distance,
    squared_distances,
)
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures
from omninav.stages.values.views import NoveltyThreshold

from .before_threshold import BeforeThreshold, due
from .view_cap import within_cap
from .view_events import view_event

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
UNMEASURED_M = 0.3
Forgetting = Literal["active", "passive", "none"]
Doubt = Literal["once", "again"]
Components = tuple[Array, Array, Array, Array]


class AdaptiveViews(Stage):
    """Learns views and the places they are seen from, with weights that grow where they fit and fade where they do not.

    Gross, Koenig & Mueller 2005, section 2.3, for each lesson (a view and the state in which it was seen):

    1. A view whose distance to all kept ones is at or above the limit (E_max) is kept as a new one, with no place yet.
    2. Views alike by S >= `least_similarity` take the state in as a new component, its heading turned to theirs
       (erratum 12), with weight 0 and count S over the sum of S of all views (equation 11, erratum 6). Components
       nearer than `merge_below` become one (equations 12 to 14, divided by the counts' sum: erratum 7), weights added
       and capped at 1 (erratum 8). `doubt` says what the state's own covariance does to a component it merges with.
    3. Weights of views nearer than the limit: w = beta S + (1 - beta S) w of components that fit the state, squared
       distance <= `fits_below` (equation 16); w = (1 - beta S) w of the others (17), unless `forgetting` is `none`.
       With `forgetting: active`, components of all other views within `near_m` of the state: w = (1 - b) w with b =
       beta_forget max(1 - distance / fade_m, 0) gain_m / (sigma_x + sigma_y), in [0, 1] (18, 19, errata 10 and 11).
    4. Components below `least_weight` go, and views without any (erratum 9: after the weights have grown; checked to be
       below beta least_similarity, so that none dies at birth). Above `max_views` (0: no limit) the weakest views go.

    MapUpdates wait until there is a limit, all but the first of a map.

    `forgetting: passive` is the model of Porta & Kroese that Table 1 compares with. A state of several modes, which the
    paper does not learn from, teaches each mode by its weight p: it is taken in where S p >= `least_similarity`, the
    count is p times as much, and w = beta S p + (1 - beta S) w with p of all modes that fit. `least_m` and `least_deg`
    are the least standard deviations with which a place is taken in: a view looks alike over some way. `near_m` and
    `fade_m`: none is the way over which the limit says that views look alike (0.3 m where it does not say). `gain_m`:
    none is twice that way, so that a state as uncertain as views look alike forgets at `beta_forget`.

    `doubt: again` is equation 14 to the letter: each state adds its covariance to that of the component, which holds
    the spread of the means already. But the state has most of its covariance from the same map, so that the map teaches
    itself its own doubt, again and again: covariances grow without end, covariance intersection never takes any back,
    and forgetting, which equation 19 divides by them, dies down. With `once` a place has the covariance of the first
    state it was seen in, which fades as states confirm it: they add the spread of their means, and no more doubt of
    their own than `least_m` and `least_deg` ("coding a stable and reliable estimation", section 2.2).
    """

    shape: Shape = "linear"
    forgetting: Forgetting = "active"
    beta: Annotated[float, Bounds(gt=0, le=1)] = 0.1
    least_similarity: Annotated[float, Bounds(gt=0, le=1)] = 0.2
    merge_below: Annotated[float, Bounds(ge=0)] = 7.81
    fits_below: Annotated[float, Bounds(gt=0)] = 7.81
    doubt: Doubt = "once"
    beta_forget: Annotated[float, Bounds(ge=0, le=1)] = 0.2
    near_m: Annotated[float, Bounds(gt=0)] | None = None
    fade_m: Annotated[float, Bounds(gt=0)] | None = None
    gain_m: Annotated[float, Bounds(gt=0)] | None = None
    least_weight: Annotated[float, Bounds(ge=0, lt=1)] = 0.01
    least_m: Annotated[float, Bounds(ge=0)] = 0.1
    least_deg: Annotated[float, Bounds(ge=0)] = 2.0
    max_views: Annotated[int, Bounds(ge=0)] = 0

    class Out(Outputs):
        """The map, and what this tick did to it."""

        map: ViewMixtures
        events: ViewEvent | None = None

    def __post_init__(self) -> None:
        """A component's first weight must outlive its first tick."""
        if self.least_weight > (1.0 - 1e-9) * self.beta * self.least_similarity:
            raise ValueError(
                f"least_weight: {self.least_weight:g} is not below beta * least_similarity = "
                f"{self.beta * self.least_similarity:g}, so that a new place could be dropped as it is learned"
            )

    def step(
        self,
        ctx: Context,
        updates: MapUpdates | None,
        threshold: NoveltyThreshold | None,
        map: ViewMixtures,
        waiting: BeforeThreshold,
    ) -> Out:
        """Learn from what this tick has to teach."""
        map.take_limit(threshold)
        ready = due(() if updates is None else updates.items, threshold, map, waiting)
        if not ready:
            return self.Out(map=map)
        before = map.names
        changed: list[Ints] = []
        seen: dict[int, int] = {}
        full = False
        for lesson in ready:
            seen[map.next_name] = lesson.index  # if it is a new one
            changed.append(self._learn(lesson, threshold, map))
            kept = within_cap(map, self.max_views)
            full = full or not kept.all()
            map.keep_views(kept)
            map.step()
        names = np.concatenate([*changed, np.array(list(seen))])
        return self.Out(map=map, events=view_event(map, before, names, seen, "full" if full else "forgotten"))

    def _learn(self, lesson: MapUpdate, limit: NoveltyThreshold | None, map: ViewMixtures) -> Ints:
        # The names of the views whose places changed.
        view = lesson.view
        state = _floored(lesson.state, self.least_m, np.radians(self.least_deg))
        if not len(state):
            return np.empty(0, np.int64)
        map.check_kind(view)
        distances = view.distances(map.views) if len(map) else np.empty(0)
        within = 0.0 if limit is None else limit.distance
        matched = distances < within
        if not matched.any():
            map.add_view(view.values, type(view).__name__)
            distances, matched = np.append(distances, 0.0), np.append(matched, True)
        alike = np.where(matched, similarity(distances, within, self.shape), 0.0)
        rows = np.flatnonzero(matched)
        turns = np.zeros(len(map))
        turns[rows] = view.turns(map.views[rows])
        self._take_in(state, alike, turns, map)
        weights = np.empty(len(map.weights))
        alike_m = (limit.metres if limit is not None and limit.settled else 0.0) or UNMEASURED_M
        _weigh(
            state.means,
            state.covariances,
            state.weights,
            map.owner,
            map.means,
            map.covariances,
            map.weights,
            matched,
            alike,
            turns,
            self.beta,
            self.fits_below,
            self.forgetting != "none",
            self.beta_forget if self.forgetting == "active" else 0.0,
            self.near_m or alike_m,
            self.fade_m or alike_m,
            self.gain_m or 2.0 * alike_m,
            weights,
        )
        touched: Ints = map.names[np.unique(map.owner[weights != map.weights])]
        map.put_weights(weights)
        map.keep_components(map.weights >= self.least_weight)
        map.keep_views(np.bincount(map.owner, minlength=len(map)) > 0)
        return touched

    def _take_in(self, state: GaussianMixture, alike: Array, turns: Array, map: ViewMixtures) -> None:
        # Phase 2: the state becomes a component of each view that is alike enough.
        total = alike.sum()
        rows = np.flatnonzero(alike * state.weights.max() >= self.least_similarity)
        least = np.diag([self.least_m, self.least_m, np.radians(self.least_deg)]) ** 2
        mixtures = []
        for row in rows.tolist():
            kept = alike[row] * state.weights >= self.least_similarity
            means = state.means[kept]
            means[:, 2] = wrap(means[:, 2] - turns[row])
            mine = map.owner == row
            known = (map.means[mine], map.covariances[mine], map.counts[mine], map.weights[mine])
            counts = state.weights[kept] * (alike[row] / total)
            new = (means, state.covariances[kept], counts, np.zeros(len(means)))
            if self.doubt == "once":
                known, new = _confirmed(known, new, self.merge_below, least)
            means, covariances, counts, weights = (np.concatenate(both) for both in zip(known, new, strict=True))
            mixtures.append(merged(means, covariances, counts, self.merge_below, shares=weights))
        if len(rows):
            means, covariances, counts, weights = (np.concatenate(each) for each in zip(*mixtures, strict=True))
            owners = np.repeat(rows, [len(parts[0]) for parts in mixtures])
            map.put_mixtures(owners, means, covariances, np.minimum(weights, 1.0), counts)


def _confirmed(known: Components, new: Components, below: float, least: Array) -> tuple[Components, Components]:
    # The known components, each having taken in the means of those new ones that it is the nearest to, with the least
    # doubt instead of their own; and the new ones that are not near any.
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
                np.stack([means[j], new[0][k]]), np.stack([covariances[j], least]), np.array([counts[j], new[2][k]])
            )
    return (means, covariances, counts, weights), (new[0][left], new[1][left], new[2][left], new[3][left])


def _floored(state: GaussianMixture, metres: float, radians: float) -> GaussianMixture:
    # The state with weights that sum to 1, each mode no more certain than that.
    present = state.weights > 0.0
    covariances = state.covariances[present]
    if metres > 0.0 and radians > 0.0 and len(covariances):
        covariances = floored(covariances, (metres, metres, radians))
    weights = state.weights[present]
    return GaussianMixture(state.means[present], covariances, weights / weights.sum() if len(weights) else weights)


@numba.njit(cache=True, nogil=True)
def _weigh(
    means: Array,
    covariances: Array,
    shares: Array,
    owner: Ints,
    places: Array,
    spreads: Array,
    weights: Array,
    matched: npt.NDArray[np.bool_],
    alike: Array,
    turns: Array,
    beta: float,
    fits_below: float,
    passive: bool,
    beta_forget: float,
    near: float,
    fade: float,
    gain: float,
    out: Array,
) -> None:
    # Phase 3, equations 16 to 19, for the components (C,) of all views, of a state of several modes.
    mode = np.empty(3)
    for c in range(len(owner)):
        row = owner[c]
        if matched[row]:
            fitting = 0.0
            for k in range(len(shares)):
                mode[:] = means[k]
                mode[2] -= turns[row]
                if apart(mode, covariances[k], places[c], spreads[c], fits_below):
                    continue
                if squared_distance(mode, covariances[k], places[c], spreads[c]) <= fits_below:
                    fitting += shares[k]
            gained = beta * alike[row]
            fading = gained if passive else gained * fitting
            out[c] = min(gained * fitting + (1.0 - fading) * weights[c], 1.0)
        else:
            kept = 1.0
            if beta_forget > 0.0:
                for k in range(len(shares)):
                    distance = np.hypot(places[c, 0] - means[k, 0], places[c, 1] - means[k, 1])
                    if distance < near and distance < fade:
                        spread = np.sqrt(covariances[k, 0, 0]) + np.sqrt(covariances[k, 1, 1])
                        lost = beta_forget * (1.0 - distance / fade) * gain / spread
                        kept *= 1.0 - shares[k] * min(lost, 1.0)
            out[c] = kept * weights[c]
