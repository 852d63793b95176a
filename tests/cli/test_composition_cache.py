"""Configurations that are composed from what was kept are those that Hydra composes."""

from collections.abc import Iterator
from typing import Any
from unittest.mock import patch

import hydra
import pytest
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import OmegaConf

from omninav.pipeline.cli import composition_cache
from omninav.pipeline.cli.composition import composed
from omninav.pipeline.cli.composition_cache import CONFIG, RUN_ALONE, TYPED, compose
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.graph.problems import ProblemsFound


@pytest.fixture(autouse=True)
def _configured() -> Iterator[None]:
    with hydra_started():
        yield


def as_hydras(config: Any) -> str:
    """The YAML of a configuration, without the names that were typed, of which Hydra's has no list."""
    return OmegaConf.to_yaml(OmegaConf.masked_copy(config, [key for key in config if key != TYPED]))


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["variant=omninav", "seed=3", "nodes.prior.number=7", "++nodes.match.headings=18"],
        ["world=office", "match=l2", "+nodes.sensor.new=[1,{a:2}]", "topics.image=/omni", "rate=null"],
        ["world.draw=1", "world={draw:2}", "~nodes.fusion", "~match", "cuts=[[3,6]]"],
        ["tour='a=b.mcap'", "+experiment=particle_cml/slip", "log=${tour}"],
    ],
)
def test_words_give_what_hydra_makes_of_them(words: list[str]):
    assert as_hydras(compose(words)) == OmegaConf.to_yaml(hydra.compose("config", overrides=words))


def test_jobs_are_what_hydra_makes_of_them_with_its_own_part():
    checked = GlobalHydra.instance().hydra.config_loader
    words = ["variant=omniview_cml", "tour='a=b.mcap'", "++nodes.match.headings=18", "~match", "log=${tour}"]
    alone = [*words, "hydra.run.dir=there/${hydra.job.override_dirname}", RUN_ALONE]
    hydras = OmegaConf.to_yaml(checked._hydras.load_configuration(CONFIG, alone, RunMode.RUN))
    for _ in range(2):  # composed, and from what was kept
        assert as_hydras(checked.load_configuration(CONFIG, alone, RunMode.RUN)) == hydras
    master = checked._hydras.load_configuration(CONFIG, ["hydra.sweep.subdir=of_${seed}", "seed=1,2"], RunMode.MULTIRUN)
    job, hydras = (each.load_sweep_config(master, words) for each in (checked, checked._hydras))
    assert as_hydras(job) == OmegaConf.to_yaml(hydras)


def test_options_are_composed_once_and_what_was_set_is_not_kept():
    composition_cache._of_options.cache_clear()
    with patch("omninav.pipeline.cli.composition_cache.hydra.compose", wraps=hydra.compose) as hydras:
        first, second = compose(["world=office", "seed=3"]), compose(["day=2", "world=office"])
        first.nodes.match = None
        third = compose(["world=office"])
    assert hydras.call_count == 1
    assert [config.seed for config in (first, second, third)] == [3, 0, 0]
    assert [config.day for config in (first, second, third)] == [1, 2, 1]
    assert third.nodes.match is not None


def test_a_later_command_of_a_process_composes_nothing_again_unless_other_stages_are_offered(monkeypatch):
    composition_cache._of_options.cache_clear()
    with patch("omninav.pipeline.cli.composition_cache.hydra.compose", wraps=hydra.compose) as hydras:
        for seed in (3, 4):
            with composed(["world=office", f"seed={seed}"]) as config:
                assert config.seed == seed
        assert hydras.call_count == 1
        for name in ("One", "Other"):
            monkeypatch.setenv("OMNINAV_STAGES", f"match.of_a_test=stages.py:{name}")
            with composed(["world=office", "match=of_a_test"]) as config:
                assert config.nodes.match._target_ == f"stages.py:{name}"


@pytest.mark.parametrize("word", ["sead=3", "match=l3", "+seed=3", "++match=l2", "seed=1,2", "a@b=1", "=", "day={"])
def test_words_that_do_not_fit_are_refused_as_by_hydra(word: str):
    with pytest.raises(HydraException) as expected:
        hydra.compose("config", overrides=[word])
    with pytest.raises(HydraException) as found:
        compose([word])
    assert str(found.value) == str(expected.value)


@pytest.mark.parametrize("word", ["hydra.searchpath=[a]", "hydra={job:{chdir:true}}", "hydra.job.chdir=true"])
def test_what_cannot_be_set_of_hydra_is_refused_here_too(word: str):
    with pytest.raises(ProblemsFound, match="hydra"):
        compose([word])
