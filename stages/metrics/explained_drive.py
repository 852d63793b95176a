"""Explains a drive: where it was not tracked, and why."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage, Table
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.stretches import Stretches

from .causes import stretches
from .frames_table import columns_of
from .stretches import Log, row_of, summaries

COLUMNS = ("images", "time (s)", "driven (m)", "state", "what happened", "what says so", "what to do")


class ExplainDrive(Stage):
    """Finds the stretches in which a drive was searching, unsure, blind or wrong, and why, as `omninav explain`.

    Causes come from what each image said of the estimate (`MeasureEvidence`), by fixed rules: docs/explain.md.
    """

    lost_m: Annotated[float, Bounds(gt=0)] = 2.5
    """Position error (m) above which a sure estimate is wrong, where truth is known."""

    class Out(Outputs):
        """The stretches, for plots, and as a table of the report."""

        stretches: Stretches | None = None
        table: Table | None = None

    def step(self, ctx: Context, drive: Drive) -> Out:
        """The whole run at once; nothing where it has no estimate."""
        if not known(drive.estimate).any():
            return self.Out()
        logs = [Log(columns_of(log)) for log in drive.by_log]
        found = stretches(logs, self.lost_m)
        rows = tuple(row_of(stretch, len(logs) > 1) for stretch in found)
        caption = " ".join(summaries(logs))
        return self.Out(
            stretches=Stretches(tuple(found)),
            table=Table("explanation", "What happened, stretch by stretch", caption, COLUMNS, rows, order=5),
        )
