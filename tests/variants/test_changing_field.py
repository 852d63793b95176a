"""The made-up field of the benchmarks feeds the variants that map while they localise."""

from pathlib import Path

import pytest

from omninav.pipeline.engine.engine import Engine


@pytest.mark.parametrize("variant", ["omniview_cml", "particle_cml"])
def test_a_variant_maps_a_field_of_which_there_are_no_images(variant: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2])
    from benchmarks.changing_field import graph_on_field

    graph = graph_on_field(variant, {"steps": 60}, 1.0)
    engine = Engine(graph, wanted=["mapping.map"])
    assert len(engine.run()["mapping.map"]) > 3
    assert engine.ticks == 60
