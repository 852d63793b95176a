"""Every variant gives the figures that golden.json holds; `python tests/variants/renew_golden.py` renews them."""

from pathlib import Path

import pytest
from golden_figures import RUNS, measured, read_golden

from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.hydra_session import hydra_started

VARIANTS = Path(__file__).resolve().parents[2] / "conf" / "variant"
RELATIVE = 0.01
"""On one machine figures are exactly equal; other versions of libraries round otherwise."""
SHARP = {"omniview_mcl_as_printed": 0.15}
"""Relative tolerance of a filter with so few particles of weight that the last digits of another processor (with or
without AVX-512) draw another one, and its figures move by up to 11 %."""

ANOTHERS = {"landmark_nav", "peer", "plain_matching", "topological_localisation", "topological_localisation_as_printed"}
"""Their map is that of another variant, or images as they are."""


def test_every_variant_is_run():
    variants = {path.stem for path in VARIANTS.glob("*.yaml")}
    with hydra_started():
        artifacts = {variant: compose([f"variant={variant}"]).artifacts.get("map") for variant in variants - ANOTHERS}
    learned = {f"{variant}_map" for variant, map in artifacts.items() if map is not None and map.get("choices")}
    assert RUNS.keys() - {"simulate"} == variants | learned
    assert sorted(read_golden()) == sorted(RUNS)


@pytest.mark.parametrize("variant", sorted(RUNS))
def test_its_figures_are_as_before(variant: str, tmp_path: Path, shared_cache: Path):
    found, golden = measured(variant, tmp_path, shared_cache), read_golden()[variant]
    assert found.keys() == golden.keys()
    relative = SHARP.get(variant, RELATIVE)
    different = {
        name: (value, found[name])
        for name, value in golden.items()
        if found[name] != (pytest.approx(value, rel=relative, abs=1e-4) if isinstance(value, float) else value)
    }
    assert not different, f"golden and found; python tests/variants/renew_golden.py {variant} renews them"
