"""Size of a map."""

from omninav.pipeline import Context, Metrics, MetricStage, Quantity
from omninav.stages.values.maps import ReferenceGraph

QUANTITIES = {
    "map.references": Quantity(title="References in the map", context=True),
    "map.edges": Quantity(title="Edges of the map"),
    "map.size_bytes": Quantity(title="Map size", better="lower"),
    "map.pose_source": Quantity(setting=True),
    "map.reference_size_bytes": Quantity(title="Size of a reference", better="lower"),
}


class MapSize(MetricStage):
    """Measures the size of the map: bytes of its arrays as stored, references, edges, and where its poses come from."""

    def step(self, ctx: Context, map: ReferenceGraph) -> MetricStage.Out:
        size = map.features.nbytes + map.poses.nbytes + map.edges.nbytes
        ctx.fact("map_poses", map.pose_source)
        values = {
            "size_bytes": size,
            "references": len(map),
            "edges": len(map.edges),
            "reference_size_bytes": size / len(map) if len(map) else None,
            "pose_source": map.pose_source,
        }
        return self.Out(metrics=Metrics({"map": values}, QUANTITIES))
