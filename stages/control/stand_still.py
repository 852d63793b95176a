"""The command before there is one."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.command import Command


class StandStill(Stage):
    """Says stop: the first value of a closed loop's command."""

    class Out(Outputs):
        command: Command

    def step(self, ctx: Context) -> Out:
        """Speed 0, turning 0."""
        return self.Out(command=Command(0.0, 0.0))
