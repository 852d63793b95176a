"""Times of stages, from the times that their calls wrote down."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline.engine.engine import Engine


def stage_times(engine: Engine, groups: Sequence[Sequence[str]] = ()) -> dict[str, Any]:
    """Median, 95th percentile and maximum per stage in milliseconds, and the loop's ticks per second.

    The ticks per second leave out the first tick, in which code is compiled and files are opened, and what was read
    from the cache (`cached`: its nodes): it did not run.

    `step` is the same of what all stages but the source took together, tick by tick; `together` that of each group of
    stages, its names joined by `+`, where every one of them has run.
    """
    times = {name: np.asarray(call.times) * 1e3 for name, call in engine.calls.items()}
    ran = {name: took for name, took in times.items() if np.isfinite(took).any()}
    ticking = [node for node in engine.graph.of_lifetime("tick") if node.name in ran]
    behind = [node.name for node in ticking if not node.signature.is_source]
    stages = {
        name: {"lifetime": engine.calls[name].node.lifetime, "calls": int(np.isfinite(took).sum())} | _spread_ms(took)
        for name, took in ran.items()
    }
    per_tick = sum(_mean_ms(ran[node.name]) for node in ticking)
    return {
        "ticks": engine.ticks,
        "ticks_per_second": 1e3 / per_tick if per_tick else None,
        "cached": sorted(engine.replay.nodes & {node.name for node in engine.graph.of_lifetime("tick")})
        if engine.replay is not None
        else [],
        "step": _spread_ms(np.nansum([ran[name] for name in behind], axis=0)) if behind else None,
        "together": {
            "+".join(group): _spread_ms(np.nansum([ran[name] for name in group], axis=0))
            for group in groups
            if set(group) <= set(behind)
        },
        "stages": stages,
    }


def _mean_ms(times: Any) -> float:
    later = times[1:][np.isfinite(times[1:])]
    return float(later.mean()) if len(later) else float(np.nanmean(times))


def _spread_ms(times: Any) -> dict[str, float]:
    p50, p95 = np.nanpercentile(times, [50, 95])
    return {"p50_ms": float(p50), "p95_ms": float(p95), "max_ms": float(np.nanmax(times))}
