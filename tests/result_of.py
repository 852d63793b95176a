"""The messages of a run made by hand, tick by tick, and the log that they become."""

from pathlib import Path

from small_run import SmallRun

from omninav.pipeline import Context
from omninav.stages.plots.result_log import ResultLog
from omninav.stages.plots.show_tick import ShownTick, ShowTick, ShowTickState


def shown_of(run: SmallRun, beliefs=None, map=None, max_views=2000, **inputs) -> list[ShownTick]:
    """What `ShowTick` keeps of a small run; `inputs` are the same for every tick."""
    stage, before = ShowTick(particles=30, max_views=max_views), ShowTickState()
    rows = zip(run.ticks, run.motion, run.truth, run.estimates, beliefs or run.beliefs, strict=True)
    return [
        stage.step(Context("shown"), before, *row, map=run.map if map is None else map, **inputs).kept for row in rows
    ]


def write_result(folder: Path, run: SmallRun, beliefs=None, map=None, **inputs) -> Path:
    """Write `result.mcap` of a small run."""
    ResultLog().step(Context("log", folder=folder), run.drive, shown_of(run, beliefs, map, **inputs), map)
    return folder / "result.mcap"
