"""No disturbance: the panorama as it is."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.image import Panorama


class NoPerturbation(Stage):
    """Hands the panorama on as it is: the undisturbed end of an experiment."""

    class Out(Outputs):
        """The same panorama."""

        panorama: Panorama

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Change nothing."""
        return self.Out(panorama=panorama)
