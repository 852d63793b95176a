"""`make soak`: 100,000 steps of a map that forgets, in a field whose look keeps changing. Nothing may keep growing.

The graph is that of `variant=omniview_cml`, run by the engine with its checkpoints; only the source is made up, and
what is collected for the report is left out. Printed every twentieth of the way: references and components, the map's
bytes, the process's memory, milliseconds a step, and how far off the estimate was. Exit status 1 where the map or the
memory still grows in the last half. Some ten minutes on a free core. `benchmarks/soak.py STEPS` takes fewer, but the
bounds are for quarters of 25,000: references swing by a fifth over some thousand steps.
"""

import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
ROWS = 20
MOST_VIEWS, MOST_MB = 1.10, 4.0
"""What the last quarter may have more than the third: references on average, as a ratio, and megabytes."""


def megabytes() -> float:
    """Memory that this process holds now."""
    import os

    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> int:
    """Soak, print the table, and say whether anything still grows."""
    import numpy as np

    from benchmarks.changing_field import graph_on_field
    from omninav.pipeline.engine.engine import Engine, EngineOptions
    from omninav.stages.metrics.map_size import stored_bytes

    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    variant = sys.argv[2] if len(sys.argv) > 2 else "omniview_cml"
    graph = graph_on_field(variant, {"steps": steps})
    taken: list[tuple[float, ...]] = []
    errors: list[float] = []
    began = [time.perf_counter()]
    print(f"{variant}, {steps} steps, {len(graph.nodes)} nodes")
    heads = ("steps", "references", "components", "map kB", "memory MB", "ms/step", "error m")
    print(" ".join(f"{head:>10}" for head in heads))

    def progress(done: int, total: int | None) -> None:
        pose, true = engine.values["estimate.estimate"].pose, engine.values["source.truth"]
        errors.append(float(np.hypot(pose.x - true.x, pose.y - true.y)))
        if done % max(1, steps // 200) == 0:
            map = engine.values["mapping.map"]
            taken.append((done, len(map), len(map.weights), stored_bytes(map) / 1e3, megabytes()))
        if done % max(1, steps // ROWS) == 0:
            row = taken[-1]
            now = time.perf_counter()
            each = 1e3 * (now - began[0]) / max(1, steps // ROWS)
            began[0] = now
            numbers = [f"{number:10.0f}" for number in row[:4]]
            print(" ".join([*numbers, f"{row[4]:10.1f}", f"{each:10.2f}", f"{np.mean(errors):10.2f}"]), flush=True)
            errors.clear()

    with tempfile.TemporaryDirectory() as folder:
        options = EngineOptions(memory=Path(folder), identity="soak", checkpoint_s=30.0, on_tick=progress)
        engine = Engine(graph, {}, options, wanted=["mapping.map"])
        engine.run()
    table = np.array(taken)
    quarters = np.array_split(table, 4)
    views = quarters[3][:, 1].mean() / quarters[2][:, 1].mean()
    timed = 8e-6 * len(graph.nodes) * steps / 4  # the engine keeps how long each node took in each step: 8 bytes
    memory = quarters[3][:, 4].mean() - quarters[2][:, 4].mean() - timed
    print(f"references, last quarter over third: {views:.3f} (at most {MOST_VIEWS:g})")
    beside = f"(at most {MOST_MB:g}) beside {timed:.1f} MB of step times"
    print(f"memory, last quarter less third: {memory:+.1f} MB {beside}")
    return 0 if views <= MOST_VIEWS and memory <= MOST_MB else 1


if __name__ == "__main__":
    raise SystemExit(main())
