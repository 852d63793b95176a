"""Print the share of mutants that the tests killed, of each session of cosmic-ray in a folder: rates.py FOLDER."""

import re
import sys
from pathlib import Path

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import WorkerOutcome
from scipy.stats import binomtest

ENOUGH = 0.90
"""Least share of mutants that the tests of a folder kill."""


NO_STEP = re.compile(r"^-(?!--).*(Annotated\[|strict=|MetricSpec\()", re.MULTILINE)
"""A changed line that is of types, of a check of our own, or of how pages name a figure."""


def main(folder: Path) -> int:
    """Print a line for each session; 1 where one has too few killed, or none tried."""
    poor = []
    for session in sorted(folder.glob("*.sqlite")):
        with use_db(str(session), WorkDB.Mode.open) as db:
            # cr-rate counts those that a filter has left out as killed.
            done = [result for _, result in db.results if result.worker_outcome == WorkerOutcome.NORMAL]
            tried = [result.is_killed for result in done if not NO_STEP.search(result.diff or "")]
        if sum(tried) < ENOUGH * len(tried) or not tried:
            poor.append(session.stem)
        low, high = binomtest(sum(tried), len(tried)).proportion_ci(method="wilson") if tried else (0.0, 1.0)
        print(f"{session.stem}: {sum(tried)} of {len(tried)} killed (95 % interval {low:.0%} to {high:.0%})")
    if poor:
        print(f"below {ENOUGH:.0%}: {', '.join(poor)}; cr-report --show-diff SESSION shows what survives")
    return 1 if poor else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
