"""Updates of a map: views with the state in which they were seen."""

from omninav.pipeline import Value

from .belief import GaussianMixture
from .sessions import Sessions
from .views import WholeView


class MapUpdate(Value):
    """A view and the robot's state when it was seen, a mixture of Gaussians.

    `index`: the tick at which the view was seen. `reconstructed`: the state was computed afterwards, between two
    unimodal states.
    """

    view: WholeView
    state: GaussianMixture
    index: int
    reconstructed: bool = False


class MapUpdates(Value):
    """The updates of a tick, in the order in which the views were seen; often none.

    `open_from`: updates of views seen in this tick or later may be repeated with better states, and then replace the
    earlier ones. None: a repeated update is one more. `relearn`: the map forgets all it holds before it learns these.
    `sessions`: what the map keeps of all drives, where that is to change.
    """

    items: tuple[MapUpdate, ...]
    open_from: int | None = None
    relearn: bool = False
    sessions: Sessions | None = None
