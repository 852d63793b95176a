import pytest
from conftest import TOUR

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.run.prepared_run import prepare_run

from .conftest import ROOT


@pytest.mark.parametrize(
    ("variant", "late"),
    [("omniview_mcl", {"messages", "publish_belief"}), ("omniview_cml", {"messages", "map_update", "mapping"})],
)
def test_the_pose_is_published_before_anything_that_can_wait(variant: str, late: set[str]):
    camera = ROOT / "tests/data/camera.yaml"
    words = [f"variant={variant}", "source=live", "publish=ros2", "log=live", f"camera={camera}"]
    with composed([*words, *([f"tour={TOUR}"] if variant == "omniview_mcl" else [])]) as config:
        nodes = list(prepare_run(complete(config)).graph.nodes)
    assert late < set(nodes[nodes.index("publish") :])
