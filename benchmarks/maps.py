"""Maps on disk: what writing, opening, reading and checking a map of 10^3 to 10^6 references costs.

    python benchmarks/maps.py                       # up to 10^6 references, a file of 2.9 GB
    python benchmarks/maps.py --references 100000 --folder /tmp

Seconds are the processor's, which other programs do not change. Each map is opened in a process of its own. Its
references are 1000 histograms of 36 x 20 over and over: what a file costs does not depend on what they are.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from omninav.pipeline.engine.artifact import check_artifact, read_artifact, write_artifact
from omninav.pipeline.graph.stored_rows import GatheredRows
from omninav.stages.values.maps import ReferenceGraph

SEGMENTS, BINS, BASE = 36, 20, 1000
SIZES = (1_000, 10_000, 100_000, 1_000_000)
READ = 1000
"""References read at once, at random."""


def made(references: int) -> ReferenceGraph:
    """A map along a spiral, whose features are gathered as they are written."""
    rng = np.random.default_rng(0)
    features = rng.random((BASE, SEGMENTS, BINS)).astype(np.float32)
    features /= features.sum(axis=2, keepdims=True)
    angle = np.sqrt(np.arange(references) + 1.0)
    poses = np.stack([angle * np.cos(angle), angle * np.sin(angle), angle % 6.0], axis=1)
    edges = np.stack([np.arange(references - 1), np.arange(1, references)], axis=1)
    rows = GatheredRows([(features, np.arange(references) % BASE)])
    return ReferenceGraph(poses, rows, "histograms", edges, "truth")


def opened(file: Path) -> dict[str, float]:
    """Processor seconds and megabytes of opening a map and reading of it, in this process."""
    before = _resident()
    start = time.process_time()
    map = read_artifact(file)
    opening = time.process_time() - start
    assert isinstance(map, ReferenceGraph)
    after = _resident()
    rng, first, again = np.random.default_rng(1), [], []
    for _ in range(10):
        rows = rng.integers(0, len(map), READ)
        for times in (first, again):
            start = time.process_time()
            map.features[rows]
            times.append(time.process_time() - start)
    return {
        "open_s": opening,
        "open_mb": after - before,
        "first_read_s": first[0],
        "read_s": statistics.median(again),
        "read_mb": _resident() - before,
    }


def _resident() -> float:
    """Megabytes of this process, with the pages of files that it has touched."""
    status = Path("/proc/self/status").read_text()
    return sum(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1000


def row(folder: Path, references: int) -> dict[str, float]:
    """All figures of one size."""
    file = folder / f"{references}.omap"
    start = time.process_time()
    write_artifact(file, made(references))
    writing = time.process_time() - start
    size = file.stat().st_size / 1e6
    command = [sys.executable, __file__, "--open", str(file)]
    rounds = [json.loads(subprocess.check_output(command, text=True)) for _ in range(3)]
    start = time.process_time()
    check_artifact(file)
    checking = time.process_time() - start
    file.unlink()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    found = {name: statistics.median(each[name] for each in rounds) for name in rounds[0]}
    return {"size_mb": size, "write_s": writing, **found, "check_s": checking, "peak_mb": peak}


def main() -> None:
    """Print a line for each size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--references", type=int, default=SIZES[-1])
    parser.add_argument("--folder", default=None, help="where the files are written; none: a temporary one")
    parser.add_argument("--open", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.open:
        print(json.dumps(opened(Path(given.open))))
        return
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        for number, references in enumerate(size for size in SIZES if size <= given.references):
            found = row(Path(folder), references)
            if not number:
                print(" | ".join(["references", *found]))
            print(" | ".join([f"{references:,}", *(f"{value:.4g}" for value in found.values())]), flush=True)


if __name__ == "__main__":
    main()
