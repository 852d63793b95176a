"""omninav's own configurations are read faster than Hydra reads them, and to the same content."""

from pathlib import Path

import pytest
from hydra import initialize
from hydra._internal.core_plugins.importlib_resources_config_source import ImportlibResourcesConfigSource
from hydra.core.global_hydra import GlobalHydra

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.cli.config_groups import group_options, listed_groups, suggest_option
from omninav.pipeline.cli.config_sources import OwnFiles
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.pipeline.graph.registry import is_role, of_role
from omninav.pipeline.run.prepared_run import prepare_run

CONF = Path(__file__).resolve().parents[2] / "conf"


def test_every_configuration_is_read_as_hydra_reads_it():
    own, hydras = OwnFiles("own", "own://omninav.conf"), ImportlibResourcesConfigSource("hydra", "pkg://omninav.conf")
    files = [str(file.relative_to(CONF)) for file in sorted(CONF.rglob("*.yaml"))]
    assert len(files) > 100
    for file in files:
        found, expected = own.load_config(file), hydras.load_config(file)  # which refuses a key that is there twice
        assert (found.config, found.header) == (expected.config, expected.header), file


def test_a_stage_is_an_option_of_its_role_without_a_file():
    assert not (CONF / "match" / "l2.yaml").exists()
    with composed(["variant=omniview_mcl", "match=l2"]) as config:
        assert config.nodes.match._target_ == "omninav.stages.match.l2.L2Match"
        assert config.wires.match.map == "artifacts.map"  # the wires are the variant's


def test_a_variant_without_its_first_line_is_told_so(tmp_path: Path):
    (tmp_path / "variant").mkdir()
    for content in ("nodes: {match: {headings: 3}}", ""):
        (tmp_path / "variant" / "mine.yaml").write_text(content)
        with (
            composed(["--config-dir", str(tmp_path), "variant=mine"]) as config,
            pytest.raises(ProblemsFound, match="# @package _global_"),
        ):
            complete(config)


def test_a_config_dir_that_is_one_folder_too_deep_is_told_so(tmp_path: Path):
    folder = tmp_path / "variant"
    folder.mkdir()
    (folder / "mine.yaml").write_text("# @package _global_\n")
    with (
        pytest.raises(ProblemsFound, match=f"type --config-dir {tmp_path}$"),
        composed(["--config-dir", str(folder), "variant=mine"]),
    ):
        pass


def test_every_stage_of_a_group_is_among_its_options():
    roles = [group for group in listed_groups() if is_role(group)]
    assert {"features", "match", "fusion", "control"} <= {*roles}
    own = OwnFiles("own", "own://omninav.conf")
    for role in roles:
        names = {entry.name.partition(".")[2] for entry in of_role(role)}
        assert names <= {*group_options(role)} == {*own.list(role, None)}
        assert all(own.is_config(f"{role}/{name}") for name in names)


def test_a_file_that_holds_no_stage_or_several_is_no_option():
    own = OwnFiles("own", "own://omninav.conf")
    assert not own.is_config("match/calibration")
    assert "calibration" not in group_options("match")
    assert not own.is_config("fusion/growing_prior")
    assert not own.is_config("geometry/plane")
    assert not own.is_group("geometry")


def test_another_program_of_hydras_in_the_same_process_does_not_find_them():
    with composed(["variant=omniview_mcl"]):
        pass
    with initialize(config_path=None, version_base="1.3"):
        providers = {each.provider for each in GlobalHydra.instance().config_loader().get_search_path().get_path()}
        assert "hydra" in providers
        assert "main" not in providers


@pytest.mark.parametrize(("defaults", "hinted"), [("", True), ("  - override /source: null\n", False)])
def test_a_source_of_ones_own_is_told_how_to_replace_the_option(tmp_path: Path, defaults: str, hinted: bool):
    (tmp_path / "variant").mkdir()
    node = "nodes: {source: {_target_: toys.Count}}\n"
    head = f"# @package _global_\ndefaults:\n  - omniview_cml\n{defaults}  - _self_\n"
    (tmp_path / "variant" / "mine.yaml").write_text(f"{head}variant: mine\n{node}")
    with composed(["--config-dir", str(tmp_path), "variant=mine"]) as config:
        settings = complete(config)
    with pytest.raises(ProblemsFound) as found:  # of the wires, in any case
        prepare_run(settings)
    assert ("write `override /source: null` below `defaults:`" in str(found.value)) is hinted
    assert ("Count has no parameter" in str(found.value)) is hinted


def test_an_option_that_is_offered_twice_is_told_to_be_left_out_once(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OMNINAV_STAGES", "features.lab=toys:Scale,features.lab=toys:Add")
    said = suggest_option("features", "lab", ["hsv"], "options")
    assert said == "'features.lab' is toys:Scale and toys:Add in OMNINAV_STAGES; leave all but one out"
