"""Size of a map."""

import dataclasses
from typing import Any

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.values.maps import ReferenceGraph

SPECS = {
    "map.references": MetricSpec(title="References in the map", context=True),
    "map.edges": MetricSpec(title="Edges of the map"),
    "map.size_bytes": MetricSpec(title="Map size", better="lower"),
    "map.pose_source": MetricSpec(setting=True),
    "map.reference_size_bytes": MetricSpec(title="Size of a reference", better="lower"),
}


class MapSize(MetricStage):
    """Measures the size of the map: bytes of its arrays as stored, references, edges, and where its poses come from."""

    def step(self, ctx: Context, map: ReferenceGraph) -> MetricStage.Out:
        size = stored_bytes(map)
        ctx.fact("map_poses", map.pose_source)
        values = {
            "size_bytes": size,
            "references": len(map),
            "edges": len(map.edges),
            "reference_size_bytes": size / len(map) if len(map) else None,
            "pose_source": map.pose_source,
        }
        return self.Out(metrics=Metrics({"map": values}, SPECS))


def stored_bytes(value: Any) -> int:
    """Bytes of a value's arrays, and of those of the values that it holds."""
    fields = [getattr(value, field.name) for field in dataclasses.fields(value)]
    return sum(stored_bytes(each) if dataclasses.is_dataclass(each) else getattr(each, "nbytes", 0) for each in fields)
