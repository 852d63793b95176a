"""A run as Rerun draws it."""

import socket
import time
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.map_places import AnyMap, map_poses
from omninav.stages.values.maps import ReferenceGraph

from .show_tick import ROW, ShownTick

PORT = 9876
"""Rerun's own default."""
ARROW_M = 0.5
"""Length of the arrows that show headings (m)."""
CLOSING_S = 5.0
"""Longest time that a closed server keeps its port."""
MEMORY = "512MB"
"""The server keeps so much for viewers that connect late."""
GREY, BLUE, GREEN, ORANGE = (150, 150, 150), (60, 110, 220), (40, 160, 60), (240, 140, 20)


class RerunView:
    """A recording that a server sends to Rerun's viewer, and that a file in a run's folder keeps.

    Entities, in the map frame (m): `world/map` (references), `world/landmarks`, `world/belief`, `world/similar` (the
    most similar references), `world/truth`, `world/estimate` and its `path`; `panorama`, and `confidence`. In a long
    run only some ticks have what is only looked at, as in `result.mcap`. A run that is resumed writes a second file, of
    the same recording; ticks since its last checkpoint are in both. Rerun itself writes what is shown within seconds,
    and closes the file with the process. Raises `BadInput` where rerun-sdk is missing or the server's port is taken.
    """

    def __init__(self, folder: Path | None, port: int = PORT) -> None:
        try:
            import rerun
        except ImportError:
            raise BadInput("watch: rerun-sdk is not installed: pip install 'omninav[rerun]'") from None
        earlier = _open.pop(port, None)
        if earlier is not None:  # of an earlier run of this process
            earlier.close()
        _await_port(port, 0.0 if earlier is None else CLOSING_S)
        self._rr: Any = rerun
        self._stream = rerun.RecordingStream("omninav", recording_id=None if folder is None else str(folder.absolute()))
        sinks: list[Any] = [rerun.GrpcServerSink(bind_ip="127.0.0.1", port=port, server_memory_limit=MEMORY)]
        if folder is not None:
            sinks.append(rerun.FileSink(_free(folder)))
        self._stream.set_sinks(*sinks, default_blueprint=_blueprint())
        self._map_size, self._last = 0, np.full(2, np.nan)
        self._ticks = 0
        _open[port] = self

    def show(self, shown: ShownTick, map: AnyMap | None) -> None:
        """Show a tick."""
        if self._ticks % shown.views_every:
            shown = shown.without_views()
        self._ticks += 1
        rr, log, row = self._rr, self._stream.log, shown.numbers.view(ROW)[0]
        self._stream.set_time("time", timestamp=np.datetime64(shown.tick.stamp, "ns"))
        if shown.tick.first_of_log:
            self._map_size, self._last = 0, np.full(2, np.nan)
        if map is not None and len(map) > 1.1 * self._map_size:
            self._map_size = len(map)
            self._show_map(map)
        for name, colour in (("truth", GREEN), ("estimate", ORANGE)):
            if np.isfinite(row[name]).all():
                log(f"world/{name}", rr.Arrows3D(**_arrow(row[name]), colors=colour, radii=0.03))
        if np.isfinite(row["estimate"]).all():
            if np.isfinite(self._last).all():
                step = _level(np.stack([self._last, row["estimate"][:2]]))
                log("world/estimate/path", rr.LineStrips3D([step], colors=ORANGE))
            self._last = row["estimate"][:2].copy()
        if shown.belief is not None:
            log("world/belief", rr.Points3D(_level(shown.belief[:, :2]), colors=BLUE, radii=rr.Radius.ui_points(2.0)))
        if shown.similar is not None:
            log("world/similar", rr.Points3D(_level(shown.similar[:, :2]), radii=0.1 * shown.similar[:, 2]))
        if shown.jpeg is not None:
            log("panorama", rr.EncodedImage(contents=shown.jpeg, media_type="image/jpeg"))
        if np.isfinite(row["confidence"]):
            log("confidence", rr.Scalars(float(row["confidence"])))

    def close(self) -> None:
        """Finish the file, and end the server."""
        self._stream.disconnect()

    def _show_map(self, map: AnyMap) -> None:
        rr = self._rr
        self._stream.log("world/map", rr.Points3D(_level(map_poses(map)[:, :2]), colors=GREY, radii=0.04))
        if isinstance(map, ReferenceGraph) and map.landmarks is not None:
            self._stream.log("world/landmarks", rr.Points3D(map.landmarks.points, colors=GREY, radii=0.02))


def _await_port(port: int, patience_s: float) -> None:
    """Return once a port can be listened on. Raises `BadInput` where that takes longer."""
    end = time.monotonic() + patience_s
    while True:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
                return
            except OSError as error:
                if time.monotonic() >= end:
                    what = f"127.0.0.1:{port} cannot be listened on ({error})"
                    raise BadInput(f"watch: {what}; is another run watched?") from None
        time.sleep(0.05)


_open: dict[int, RerunView] = {}
"""The view at each port."""


def _free(folder: Path) -> Path:
    """The first of `result.rrd`, `result_2.rrd`, … that is not there."""
    names = (f"result_{number}.rrd" if number > 1 else "result.rrd" for number in range(1, 10_000))
    return next(path for path in map(folder.joinpath, names) if not path.exists())


def _blueprint() -> Any:
    """The map on the left, beside it the panorama over the confidence; the path from its beginning to now."""
    import rerun
    from rerun import blueprint

    bounds = rerun.TimeRangeBoundary
    path = blueprint.VisibleTimeRanges(timeline="time", start=bounds.infinite(), end=bounds.cursor_relative())
    views = (
        blueprint.Spatial3DView(origin="world", name="map", overrides={"world/estimate/path": path}),
        blueprint.Vertical(
            blueprint.Spatial2DView(origin="panorama", name="panorama"),
            blueprint.TimeSeriesView(origin="confidence", name="confidence"),
        ),
    )
    return blueprint.Blueprint(blueprint.Horizontal(*views), collapse_panels=True)


def _arrow(pose: Array) -> dict[str, Array]:
    ahead = ARROW_M * np.array([np.cos(pose[2]), np.sin(pose[2]), 0.0])
    return {"origins": _level(pose[None, :2]), "vectors": ahead[None]}


def _level(points: Array) -> Array:
    """Points (N, 2) on the floor: (N, 3)."""
    return np.column_stack([points, np.zeros(len(points))])
