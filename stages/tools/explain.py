"""Explains a run on the terminal."""

from typing import Any

import numpy as np

from omninav.pipeline import BadInput, Context, Tool, user_path
from omninav.pipeline.api.run import Run
from omninav.pipeline.report.warning_lines import grouped, warning_lines
from omninav.stages.metrics.causes import stretches
from omninav.stages.metrics.stretches import logs_of, row_of, summaries

UNUSED = ("blank_image", "undecodable_image", "wrong_size", "missing_image")
"""Kinds of images that are skipped, as recordings count them."""


class ExplainRun(Tool):
    """Prints where a run was searching, unsure, blind or wrong, what happened there, what to do, and its warnings.

    Raises BadInput for a folder that is no run, or whose run did not end or estimates no pose.
    """

    example = "runs/latest"

    run_folder: str = "runs/latest"
    """The run's folder."""

    def run(self, ctx: Context) -> None:
        ended = Run(user_path(self.run_folder))
        columns, lost_m = columns_of_run(ended), float(ended.settings.get("lost_m", 2.5))
        if not np.isfinite(columns["estimate_x"].astype(float)).any():
            raise BadInput(
                f"{self.run_folder}: {ended.manifest.get('variant')} estimates no pose, so there is nothing to explain;"
                " `omninav variants` shows what localises"
            )
        if ended.status != "complete":
            error = ended.manifest.get("error", "it did not end")
            print(f"the run is {ended.status} ({error:.300}); this is of its first {len(columns['estimate_x'])} images")
        logs = logs_of(columns)
        print("\n".join(summaries(logs)))
        dropped = ended.manifest.get("dropped", {}).items()
        if unused := sum(each["count"] for kind, each in dropped if kind.rpartition(".")[2] in UNUSED):
            print(f"{unused} of {unused + len(columns['log'])} images could not be used, and have no estimate.")
        for stretch in stretches(logs, lost_m):
            images, seconds, metres, state, cause, evidence, advice = row_of(stretch, len(logs) > 1)
            print(f"\nimages {images:<9} {seconds:>12} s {metres:>6} m   {state:<10} {cause}\n  {evidence}")
            if advice:
                print(f"  -> {advice}")
        for line in grouped(warning_lines(ended.manifest)):
            print(f"\nwarning: {line}")


def columns_of_run(run: Run) -> dict[str, Any]:
    """The columns of `frames.csv` of a run that has ended, as arrays."""
    table = run.frames
    names = getattr(table, "column_names", None) or list(table.columns)  # of pyarrow, or pandas
    return {str(name): np.asarray(table[name]) for name in names}
