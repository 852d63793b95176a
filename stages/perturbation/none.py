"""No perturbation: the panorama as it is."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.image import Panorama


class NoPerturbation(Stage):
    """Passes the panorama on unchanged: the reference condition of an experiment."""

    class Out(Outputs):
        panorama: Panorama

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Change nothing."""
        return self.Out(panorama=panorama)
