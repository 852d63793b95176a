"""A variant's map by itself: `omninav map`, `learn=map`, and what took the place of the variants that made maps."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from conftest import TOUR

from omninav.pipeline.cli.composition import complete
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.config_groups import group_files, replaced, suggest_option
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.main import main
from omninav.pipeline.cli.overrides import with_unlisted_parameters
from omninav.pipeline.engine.code_version import graph_digest
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run

CHANGED = {
    "omninav": ("nodes.features.segments=18",),
    "omniview_mcl": ("features=mean_rgb", "nodes.unwarp.columns=180"),
    "omniview_mcl_as_printed": ("nodes.features.bins=joint",),
    "particle_cml_baseline": ("nodes.unwarp.columns=180",),
    "plain_matching": ("features=haar_integral",),
    "retrieval_mcl": ("nodes.features.root=false", "rate=2"),
    "retrieval_mcl_as_printed": ("features=haar_integral",),
    "topological_localisation": ("nodes.features.contrast=0.03",),
    "topological_localisation_as_printed": ("features=rotation_reduced_sift",),
    "topological_nav": ("nodes.global_descriptor.max_pixels=5000",),
}
"""Variants whose map is learned on the way, each with words that change what describes its views."""

MAPPING = ("particle_cml", "omniview_cml", "omniview_cml_as_printed")
"""Variants that map while they localise."""

MAPS = ("_map", "_map_as_printed")


@pytest.fixture
def hydra() -> Iterator[None]:
    with hydra_started():
        yield


def prepared(*words: str) -> PreparedRun:
    return prepare_run(complete(compose(with_unlisted_parameters(words, []))))


@pytest.mark.usefixtures("hydra")
@pytest.mark.parametrize("variant", CHANGED)
def test_a_map_by_itself_is_the_one_that_is_made_on_the_way(variant: str) -> None:
    digests = set()
    for words in ((), CHANGED[variant]):
        way = prepared(f"variant={variant}", *words)
        made = next(artifact for artifact in way.artifacts if artifact.name == "map")
        alone = prepared(f"variant={variant}", "learn=map", *words)
        assert made.graph is not None
        assert made.variant == alone.variant == f"{variant}_map"
        assert graph_digest(alone.graph.leading_to([alone.saves["map"]])) == graph_digest(made.graph)
        assert set(alone.saves) >= {"map"}
        digests.add(graph_digest(alone.graph))
    assert len(digests) == 2


@pytest.mark.usefixtures("hydra")
@pytest.mark.parametrize("variant", ["omninav", "retrieval_mcl", "omniview_mcl_as_printed"])
def test_visual_words_are_learned_with_a_map_by_itself_as_on_the_way(variant: str) -> None:
    typed = ("candidates=words", "nodes.local_features.contrast=0.03")
    way, alone = prepared(f"variant={variant}", *typed), prepared(f"variant={variant}", "learn=map", *typed)
    for name in ("map", "words"):
        made = next(artifact for artifact in way.artifacts if artifact.name == name)
        assert made.graph is not None
        saved = alone.saves[name]
        assert graph_digest(alone.graph.leading_to([saved])) == graph_digest(made.graph)


def test_the_parameters_of_a_stage_that_was_swapped_are_taken_out(capsys: pytest.CaptureFixture[str]) -> None:
    typed = ["variant=omniview_mcl_as_printed", "artifacts.map.choices.mapping=image_database"]
    assert main(["check", *typed]) == 2
    said = capsys.readouterr().err
    assert "artifacts.map.nodes.mapping.vicinity_m: ImageDatabase has no parameter 'vicinity_m'" in said
    assert "type '~artifacts.map.nodes.mapping' to take out those of the variant's own stage" in said
    for taken_out in ("~artifacts.map.nodes.mapping", "~artifacts.map.nodes"):
        assert main(["check", *typed, taken_out]) == 0
    assert main(["check", typed[0], "learn=map", "mapping=image_database"]) == 0


@pytest.mark.usefixtures("hydra")
def test_the_words_typed_change_the_map_as_they_would_its_variant() -> None:
    words = ("variant=omniview_mcl_as_printed", "learn=map", "nodes.mapping.distance_m=0.9")
    mapping = prepared(*words).graph.nodes["mapping"].stage
    assert (mapping.distance_m, mapping.vicinity_m) == (0.9, 0.5)
    swapped = prepared("variant=omninav", "learn=map", "mapping=image_database").graph.nodes["mapping"]
    assert swapped.target.endswith("ImageDatabase")


@pytest.mark.usefixtures("hydra")
@pytest.mark.parametrize("variant", MAPPING)
def test_what_maps_while_it_localises_has_true_poses_for_a_first_map_alone(variant: str) -> None:
    first, usual = prepared(f"variant={variant}", "learn=map").graph, prepared(f"variant={variant}")
    assert "pose_fixes" in first.nodes
    assert first.nodes["straightened"].stage.max_distance == 0
    assert "pose_fixes" not in usual.graph.nodes
    assert not usual.artifacts
    made = prepared(
        f"variant={variant}", "artifacts.map.required=true", "features=dct", "+artifacts.map.inherit=[features]"
    )
    (map,) = made.artifacts
    assert map.graph is not None
    assert "pose_fixes" in map.graph.nodes
    assert map.graph.nodes["features"].target.endswith("CosineTransform")


def test_a_variant_that_made_a_map_says_what_to_type(capsys: pytest.CaptureFixture[str]) -> None:
    gone = {name: hint for name, hint in replaced().items() if "omninav map " in hint and name.endswith(MAPS)}
    assert len(gone) == 11
    variants = {file.name.removesuffix(".yaml") for file in group_files("variant")}  # each is checked elsewhere
    for name, hint in gone.items():
        assert suggest_option("variant", name.partition("=")[2], [], "variants") == hint
        assert hint.partition("omninav map variant=")[2].partition(" log=T")[0] in variants
    name, hint = next(iter(gone.items()))
    for words in (["check", name], [name, "log=T"], ["variants", name.partition("=")[2]], ["-m", name, "seed=0,1"]):
        assert main(words) == 2
        assert hint in capsys.readouterr().err
    assert main(["check", "variant=omninav_mop"]) == 2
    assert "omninav map" not in capsys.readouterr().err


def test_another_way_to_make_a_map_is_named_where_the_variant_was_typed(capsys: pytest.CaptureFixture[str]) -> None:
    for plus in ("", "+"):
        assert main(["check", "variant=omniview_mcl", f"{plus}artifacts.map.variant=retrieval_mcl_map"]) == 2
        assert "artifacts.map.choices.mapping=NAME for another stage" in capsys.readouterr().err


def test_a_variant_without_a_map_says_so_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["map", "variant=homing"], ["check", "learn=map", "variant=homing"]):
        assert main(words) == 2
        assert "variant=homing has no 'map' to learn" in capsys.readouterr().err
    assert main(["check", "learn=mop"]) == 2
    assert "did you mean 'learn=map'?" in capsys.readouterr().err


def test_a_third_partys_variant_has_its_map(omninav, tmp_path: Path) -> None:
    (tmp_path / "mine" / "variant").mkdir(parents=True)
    own = "# @package _global_\ndefaults: [omniview_mcl, override /features: haar_integral, _self_]\nvariant: mine\n"
    own += "artifacts: {map: {nodes: {mapping: {distance_m: 0.7}}}}\nnodes: {features: {segments: 24}}\n"
    (tmp_path / "mine" / "variant" / "mine.yaml").write_text(own)
    omninav("map", "--config-dir=mine", "variant=mine", f"log={TOUR}", "nodes.source.stop=4", "plots=none", check=True)
    config = yaml.safe_load((tmp_path / "runs" / "latest" / "config.yaml").read_text())
    assert config["variant"] == "mine_map"
    assert config["nodes"]["mapping"]["distance_m"] == 0.7
    target = "omninav.stages.features.haar_integral.HaarIntegral"
    assert config["nodes"]["features"] == {"_target_": target, "segments": 24}
    assert (tmp_path / "runs" / "latest" / "map.omap").is_file()


def test_a_sweep_of_maps_names_its_jobs_by_what_was_typed(omninav, tmp_path: Path) -> None:
    words = ("map", "-m", "variant=omniview_mcl,retrieval_mcl", f"log={TOUR}", "nodes.source.stop=3")
    omninav(*words, "hydra.sweep.dir=sweep", check=True)
    for number, variant in enumerate(("omniview_mcl", "retrieval_mcl")):
        folder = tmp_path / "sweep" / str(number)
        typed = [word.lstrip("+") for word in yaml.safe_load((folder / ".hydra" / "overrides.yaml").read_text())]
        assert sorted(typed) == sorted(["learn=map", f"variant={variant}", f"log={TOUR}", "nodes.source.stop=3"])
        assert yaml.safe_load((folder / "manifest.json").read_text())["variant"] == f"{variant}_map"
