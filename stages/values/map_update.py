"""What a map learns from: views with the state in which they were seen."""

from omninav.pipeline import Value

from .belief import GaussianMixture
from .views import WholeView


class MapUpdate(Value):
    """A view and where the robot was believed to be when it saw it: one Gaussian, or a mixture of them.

    `index`: the tick at which the view was seen. `reconstructed`: whether the state was worked out afterwards, between
    two states that were certain.
    """

    view: WholeView
    state: GaussianMixture
    index: int
    reconstructed: bool = False


class MapUpdates(Value):
    """What a tick has to teach, in the order in which it was seen; often nothing.

    `open_from`: lessons seen in this tick or later may be given once more, their states better known by then, and take
    the place of what was learned. None: a lesson that is given again is one more.
    """

    items: tuple[MapUpdate, ...]
    open_from: int | None = None
