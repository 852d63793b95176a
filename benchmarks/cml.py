"""Concurrent map building: a whole step of each variant, without the image work, against the size of the map.

`python -m benchmarks.cml [PICTURE.png]` prints the time of every stage for every size, and draws them.
"""

import math
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np

from .changing_field import Kind, graph_on_field, texture_of, view_at
from .table import Row

REFERENCES = (200, 500, 1000, 2000, 4000)
KINDS: dict[str, Kind] = {"particle_cml": "coefficients", "omniview_cml": "spectrum"}
STEPS, WARM = 120, 60
SPACING = 0.3
"""Metres between references: a map of 2000 covers 180 m²."""
NEIGHBOURS = 12
"""How many references a view resembles: the limit is the median distance to the next one."""


def rows() -> list[Row]:
    """A step at 2000 references, and how much longer it takes at 4000 (linear at worst)."""
    found = []
    for variant in KINDS:
        taken = {references: step_ms(variant, references) for references in (2000, 4000)}
        what, peer = f"{variant}: a step with 4000 references", "with 2000 references"
        found.append(Row(f"{variant}: a step with 2000 references", taken[2000], "ms", limit=20.0))
        found.append(Row(what, taken[4000], "ms", peer, taken[2000], limit=2.0, of_peer=True))
    return found


def step_ms(variant: str, references: int) -> float:
    """Median milliseconds that all stages from the views on take together, in a drive over a map of that size."""
    return float(np.median(sum(stage_ms(variant, references).values())))


def stage_ms(variant: str, references: int) -> dict[str, np.ndarray]:
    """Milliseconds of CPU time that each stage takes in each step."""
    from omninav.pipeline.engine.artifact import write_artifact
    from omninav.pipeline.engine.engine import Engine
    from omninav.stages.values.view_mixtures import ViewMixtures

    kind = KINDS[variant]
    side = math.ceil(math.sqrt(references))
    field = {"width": side * SPACING + 1.0, "depth": side * SPACING + 1.0}
    texture = texture_of(*field.values())
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)[:references]
    map = ViewMixtures.empty()
    for x, y in 0.5 + SPACING * places:
        pose = np.array([x, y, 0.0])
        view = view_at(pose, texture, kind)
        row = map.add_view(view.values, type(view).__name__)
        map.add_component(row, pose, np.diag([0.04, 0.04, 0.01]), 0.5, 5.0)
    far = np.array([side * SPACING / 2 + 0.65, side * SPACING / 2 + 0.65, 0.3])
    limit = float(np.sort(view_at(far, texture, kind).distances(map.views))[NEIGHBOURS])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "map.omap"
        write_artifact(file, map)
        source = {"steps": STEPS, "every": 0, "kind": kind, **field}
        graph = graph_on_field(variant, source, limit, f"map={file}", "start=truth")
        engine = Engine(graph, {"map": map}, wanted=["mapping.map"])
        with patch.object(time, "perf_counter", time.process_time):  # other work on the machine must not count
            engine.run()
    behind = [node.name for node in graph.of_lifetime("tick") if not node.signature.is_source]
    return {name: np.nan_to_num(np.asarray(engine.calls[name].times)[WARM:]) * 1e3 for name in behind}


def drawn(times: dict[str, dict[int, float]]) -> bytes:
    """Milliseconds a step over the references, one line a variant, with the limit."""
    from omninav.pipeline.report.plot_style import plot

    with plot(6.4, 3.6) as canvas:
        axes = canvas.canvas.add_subplot()
        for variant, colour in zip(times, ("#0072B2", "#D55E00"), strict=False):
            axes.plot(list(times[variant]), list(times[variant].values()), "o-", color=colour, label=variant)
        axes.plot(2000, 20.0, "_", color="#111111", markersize=24, markeredgewidth=2, label="limit at 2000")
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("references in the map")
        axes.set_ylabel("CPU time of a step (ms)")
        axes.legend(loc="upper left")
    return canvas.content


def main() -> int:
    """Print the time of every stage for every size of the map; draw the sums where a file is named."""
    from omninav.pipeline.files import write_whole

    sums: dict[str, dict[int, float]] = {}
    for variant in KINDS:
        times = {references: stage_ms(variant, references) for references in REFERENCES}
        print(f"{variant}: median CPU time of a step, ms, without the image work")
        print(f"{'references':14}" + "".join(f"{references:8d}" for references in REFERENCES))
        for name in times[REFERENCES[0]]:
            print(f"{name:14}" + "".join(f"{np.median(times[references][name]):8.2f}" for references in REFERENCES))
        sums[variant] = {references: float(np.median(sum(each.values()))) for references, each in times.items()}
        print(f"{'together':14}" + "".join(f"{each:8.2f}" for each in sums[variant].values()))
    if len(sys.argv) > 1:
        write_whole(Path(sys.argv[1]), drawn(sums))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
