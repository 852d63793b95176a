"""The source of drives along a route of a simulated world."""

from pathlib import Path
from typing import Any

from omninav.pipeline import Context, digest_text
from omninav.stages.recordings.recording import Recording
from omninav.stages.simulator.config import DayNumber, Kidnapping, WorldConfig
from omninav.stages.simulator.record_log import record_log
from omninav.stages.simulator.simulated_recording import SimulatedRecording, drive_digest, in_order

from .log import LogSource
from .playback import Playback

DRIVE = "drive.mcap"
"""A simulated drive in the folder of its recording."""


class SimulatedSource(Playback):
    """Drives along a route of a simulated world; images are rendered as they are asked for.

    It gives what `LogSource` gives of the drive once it is written as a log. An experiment writes it, and its
    conditions read the log. Raises `UnreadableRecording` for a route that the world does not have.
    """

    world: WorldConfig = WorldConfig()
    """The simulated world."""
    route: str = "drive"
    """Which of the world's routes is driven."""
    day: DayNumber | tuple[DayNumber, ...] = 1
    """On which day of the world, or one after the other on several."""
    kidnappings: tuple[Kidnapping, ...] = ()
    """When and how the robot is lifted: {at: 30.0, turn: 1.5} or {at: 30.0, to: [x, y, heading]} (s, m, rad)."""

    def recordings(self) -> list[Recording]:
        """Plan the drives, one for each day."""
        return [SimulatedRecording(self.world, self.route, day, self.kidnappings) for day in in_order(self.day)]

    def recording_key(self) -> str | None:
        """The hash of the drives; None for a route that the world does not have."""
        if self.route not in self.world.routes:
            return None
        days = in_order(self.day)
        return digest_text(*(drive_digest(self.world, self.route, day, self.kidnappings) for day in days))

    def recording_name(self) -> str:
        """World, route and days."""
        return f"{self.world.label} {self.route} day {self.day}{' with kidnappings' if self.kidnappings else ''}"

    def record(self, ctx: Context, folder: Path) -> None:
        """Write an MCAP log, with camera.yaml, floor plan and grid beside it."""
        record_log(folder / DRIVE, self.world, self.route, self.day, self.kidnappings, ctx)

    def replay(self, folder: Path) -> dict[str, Any]:
        """Read the log in place of the world that it is of."""
        reader = f"{LogSource.__module__}.{LogSource.__qualname__}"
        own = dict.fromkeys(("world", "route", "day", "kidnappings"))
        return {"_target_": reader, "log": str(folder / DRIVE), **own}
