"""Drawing the report of a run that has ended with other plots than it had."""

import json
import shutil
import tempfile
from contextlib import chdir
from pathlib import Path

from omninav.pipeline.files import digest_file, write_whole
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.small_files import parse_yaml

from .artifacts import ProgressDisplay
from .execution import execute
from .prepared_run import input_digests, prepare_run
from .resume import complete_run
from .run_folder import CONFIG, start

REPORT = "report.html"


def redraw(folder: Path, plots: str, display: ProgressDisplay | None = None) -> None:
    """Write a complete run's report again with `plots` (few, all or none); all else in its folder stays as it is.

    The run is computed once more, from the caches where they hold its features, because a run keeps no more than its
    results. Raises `BadInput` where it is not complete, where its inputs have changed, or where it gives other metrics
    now.
    """
    run, config = complete_run(folder)
    started = Path(str(run.manifest["cwd"]))
    with chdir(started if started.is_dir() else "."):  # to which its paths are relative
        prepared = prepare_run({**parse_yaml(config, str(folder / CONFIG)), "plots": plots})
        known = run.manifest["inputs"]
        changed = [name for name, digest in input_digests(prepared).items() if known.get(name, digest) != digest]
        if changed:
            raise BadInput(f"{folder}: {', '.join(changed)} changed since the run; start a new one")
        place = Path(tempfile.mkdtemp(prefix=".report.", dir=run.folder))
        try:
            again = start(prepared, run.manifest["argv"], place)
            again.manifest["started"], again.shown_as = run.manifest["started"], run.folder
            execute(again, prepared, display)
            if _metrics(place) != _metrics(run.folder):
                raise BadInput(f"{folder}: it gives other metrics now (the code has changed): start a new run")
            write_whole(run.folder / REPORT, (place / REPORT).read_text(encoding="utf-8"))
        finally:
            shutil.rmtree(place, ignore_errors=True)
        run.manifest["files"][REPORT] = digest_file(run.folder / REPORT)
        run.save()


def _metrics(folder: Path) -> object:
    return json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
