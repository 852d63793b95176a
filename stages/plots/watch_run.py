"""A run, watched while it runs."""

from typing import Annotated, Literal

from omninav.pipeline import Bounds, Context, Stage
from omninav.stages.values.map_places import AnyMap

from .foxglove_server import PORT, foxglove_server
from .rerun_view import RerunView
from .show_tick import ShownTick
from .tick_messages import PathSoFar, tick_messages


class WatchRun(Stage):
    """Shows each tick in Foxglove (open connection, ws://localhost:8765) or in Rerun.

    Foxglove's topics are those of `result.mcap` (see `ResultMessages`), and `foxglove_layout.json` of any run shows
    them. Who connects late gets the last message of each topic; of topics that nobody watches no message is made.
    Rerun's viewer connects to rerun+http://localhost:9876/proxy at any time, and a run's folder keeps what it shows as
    `result.rrd`. Nothing else that a run writes depends on it. Raises `BadInput` where foxglove-sdk or rerun-sdk is
    missing or the port is taken.
    """

    viewer: bool | Annotated[int, Bounds(ge=1, le=65535)] | Literal["rerun"] = False
    """True: Foxglove at port 8765; a number: Foxglove at this port; rerun: Rerun; false: nothing is shown."""
    host: str = "127.0.0.1"
    """Address on which Foxglove is served: this machine alone; 0.0.0.0: every machine that reaches this one may watch.
    """

    def setup(self, ctx: Context) -> None:
        """Start the server, or clear what it showed of an earlier run."""
        if self.viewer == "rerun":
            self._rerun = RerunView(ctx.folder)
        elif self.viewer is not False:
            self._server = foxglove_server(self.host, PORT if self.viewer is True else int(self.viewer))
            self._server.clear()

    def step(self, ctx: Context, before: PathSoFar, shown: ShownTick, map: AnyMap | None = None) -> None:
        if self.viewer == "rerun":
            self._rerun.show(shown, map)
        elif self.viewer is not False:
            self._server.send(shown.tick.stamp, tick_messages([shown], before))
