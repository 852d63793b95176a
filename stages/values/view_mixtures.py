"""Maps that are learned while they are used: views, each with the poses from which it may be seen."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import BadInput, Bounds, Covariances, RowsOf, Shape, Value
from omninav.stages.geometry.arrays import Array, Bools, Floats, Ints

from .growable_arrays import GrowableArrays
from .pose import PoseSource
from .sessions import Sessions
from .views import NoveltyThreshold, WholeView


class ViewMixtures(GrowableArrays, Value):
    """Views and for each a mixture of Gaussians over the poses from which it is seen (Porta & Kroese 2004, section 3;
    Gross, Koenig & Mueller 2005, equations 9 and 10). Changed in place by the stage that learns it.

    Views: `views` (R, D) float32 as `WholeView.values`; `kind` the class of view; `ids` (R,), never used again; `born`
    (R,), the map's step at which each was inserted. Components, of all views in one list: `owner` (C,) row of the view;
    `means` (C, 3) x, y (m), heading (rad); `covariances` (C, 3, 3); `weights` (C,) in [0, 1], which need not sum to 1;
    `counts` (C,) how many observations each has taken in (eta). A component's heading is that of a robot that sees the
    view as it was kept: the pose that fits a view seen turned by t has the heading plus t. `steps`: views learned from
    so far. `next_id`: the id of the next view. `pose_source`: the source of the first pose. `threshold`: the settled
    novelty threshold, None until there is one. `sessions`: the drives that the map was learned
    from, to straighten it by later ones; None: not kept.
    """

    in_place = True

    views: Annotated[Floats, Shape("R", "D")]
    kind: str
    ids: Annotated[Ints, Shape("R"), Bounds(ge=0)]
    born: Annotated[Ints, Shape("R"), Bounds(ge=0)]
    owner: Annotated[Ints, Shape("C"), RowsOf("R")]
    means: Annotated[Array, Shape("C", 3)]
    covariances: Annotated[Array, Shape("C", 3, 3), Covariances()]
    weights: Annotated[Array, Shape("C"), Bounds(ge=0, le=1)]
    counts: Annotated[Array, Shape("C"), Bounds(ge=0)]
    steps: Annotated[int, Bounds(ge=0)]
    next_id: Annotated[int, Bounds(ge=0)]
    pose_source: PoseSource
    threshold: NoveltyThreshold | None = None
    sessions: Sessions | None = None

    @classmethod
    def empty(cls) -> "ViewMixtures":
        """A map with no view yet; what its views are is settled by the first."""
        none = np.empty(0, np.int64)
        return cls(
            np.empty((0, 0), np.float32),
            "",
            none,
            none,
            none,
            np.empty((0, 3)),
            np.empty((0, 3, 3)),
            np.empty(0),
            np.empty(0),
            0,
            0,
            "estimate",
        )

    def __len__(self) -> int:
        return len(self.views)

    def check_kind(self, view: WholeView) -> None:
        """Raises BadInput where this view is not of the map's kind."""
        kind, size = type(view).__name__, len(view.values)
        if len(self) and (self.kind != kind or self.views.shape[1] != size):
            raise BadInput(
                f"map: its views are {self.kind} of {self.views.shape[1]} numbers, the current one is {kind} of "
                f"{size}; use the features it was learned with, or learn a new one"
            )

    def add_view(self, values: Floats, kind: str) -> int:
        """Keep a view, with no place yet; gives its row. Raises ValueError where it is not of the map's kind."""
        if not len(self) and not self.next_id:
            self.put(views=np.empty((0, len(values)), np.float32), kind=kind)
        if kind != self.kind or len(values) != self.views.shape[1]:
            raise ValueError(f"{kind} of {len(values)} numbers in a map of {self.kind} of {self.views.shape[1]}")
        self.append("views", values)
        self.append("ids", np.int64(self.next_id))
        self.append("born", np.int64(self.steps))
        self.put(next_id=self.next_id + 1)
        return len(self) - 1

    def add_component(self, owner: int, mean: Array, covariance: Array, weight: float, count: float) -> int:
        """Give a view one more place; gives the component's row."""
        self.append("owner", np.int64(owner))
        self.append("means", mean)
        self.append("covariances", covariance)
        self.append("weights", np.float64(weight))
        self.append("counts", np.float64(count))
        return len(self.weights) - 1

    def put_mixtures(self, owners: Ints, means: Array, covariances: Array, weights: Array, counts: Array) -> None:
        """Replace all places of the views that `owners` (N,) names, at once: N components."""
        self.keep_components(~np.isin(self.owner, owners))
        fields = {"owner": owners, "means": means, "covariances": covariances, "weights": weights, "counts": counts}
        self.put(**{name: np.concatenate([getattr(self, name), rows]) for name, rows in fields.items()})

    def keep_components(self, kept: Bools) -> None:
        """Drop all other components (C,)."""
        if not kept.all():
            for name in ("owner", "means", "covariances", "weights", "counts"):
                self.put(**{name: getattr(self, name)[kept]})

    def keep_views(self, kept: Bools) -> None:
        """Drop all other views (R,) and their components. The order of the rest stays."""
        if kept.all():
            return
        self.keep_components(kept[self.owner])
        row = np.cumsum(kept) - 1
        self.put(owner=row[self.owner])
        for name in ("views", "ids", "born"):
            self.put(**{name: getattr(self, name)[kept]})

    def step(self) -> None:
        self.put(steps=self.steps + 1)

    def forget_all(self) -> None:
        """Drop all views; their ids are not used again."""
        self.keep_views(np.zeros(len(self), np.bool_))

    def keep_threshold(self, threshold: NoveltyThreshold | None) -> None:
        """Keep the novelty threshold with which the map is learned, once that is settled."""
        if threshold is not None and threshold.settled:
            self.put(threshold=threshold)


class ViewEvent(Value):
    """The changes of a tick to a map of views, small enough to be collected over a drive.

    `views` and `components`: their number after the tick. `inserted`: (m,) ids of new views, and `seen` (m,) the ticks
    in which they were seen, perhaps long before. `removed`: ids of removed views; `why`: the reason. `changed`: (n,)
    ids of views whose mixtures changed, with the weight `weights` (n,) and the x, y (m) `places` (n, 2) of the heaviest
    component of each, and `parts` (n,), its number of components.
    """

    views: Annotated[int, Bounds(ge=0)]
    components: Annotated[int, Bounds(ge=0)]
    inserted: Annotated[Ints, Shape("m")]
    seen: Annotated[Ints, Shape("m")]
    removed: Annotated[Ints, Shape("removed")]
    why: Literal["", "forgotten", "merged", "full"]
    changed: Annotated[Ints, Shape("n")]
    weights: Annotated[Array, Shape("n"), Bounds(ge=0)]
    places: Annotated[Array, Shape("n", 2)]
    parts: Annotated[Ints, Shape("n")]


class MixturesNow(Value):
    """Components of some views after a tick: `ids` (C,) of their views, `means` (C, 3) m and rad, `weights` (C,)."""

    ids: Annotated[Ints, Shape("C")]
    means: Annotated[Floats, Shape("C", 3)]
    weights: Annotated[Floats, Shape("C"), Bounds(ge=0)]
