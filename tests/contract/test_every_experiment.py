"""What experiments of maps that are learned on the way show, and that conditions of all experiments can be built."""

import functools
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from offenders import assert_each

from omninav.pipeline.cli.composed_experiments import resolved_but_for_the_experiment, without_graph
from omninav.pipeline.cli.composition import complete
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.overrides import with_unlisted_parameters
from omninav.pipeline.experiment.intervals import MIN_GROUPS
from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.run.prepared_run import prepare_run

CONF = Path(__file__).resolve().parents[2] / "conf" / "experiment"
NAMES = [
    f"{folder}/{path.stem}"
    for folder in ("particle_cml", "omniview_cml", "cml")
    for path in sorted((CONF / folder).glob("*.yaml"))
]
ALL = [path.relative_to(CONF).with_suffix("").as_posix() for path in sorted(CONF.glob("*/*.yaml"))]


@pytest.fixture(autouse=True, scope="module")
def hydra():
    with hydra_started():
        yield


@functools.cache
def settings_of(name: str):
    """Composes the command that an experiment's file names."""
    command = (CONF / f"{name}.yaml").read_text().split("\n")[1].partition("  omninav ")[2]
    return resolved_but_for_the_experiment(without_graph(shlex.split(command)))


@functools.cache
def experiment(name: str, profile: str):
    return read_experiment(settings_of(name)["experiment"], profile)


def typed(found, condition):
    scenario = next(iter(found.scenarios.values()), "")
    parts = (found.common, found.set, condition.overrides, scenario)
    own = [word for part in parts for word in shlex.split(part)]
    named = any(word.startswith("variant=") for word in own)
    return with_unlisted_parameters(own if named else [f"variant={found.variant}", *own], [])


def test_every_experiment_can_be_read_by_the_command_in_its_file():
    assert_each(ALL, can_be_read)


def can_be_read(name):
    inherited = re.search(r"^defaults: \[(\S+),", (CONF / f"{name}.yaml").read_text(), re.MULTILINE)
    assert inherited is None or inherited[1].startswith("/experiment/"), "else a user's file cannot inherit it"
    folder, _, stem = name.partition("/")
    for profile in ("full", "quick"):
        found = experiment(name, profile)
        measures_alone = folder in ("peers", "recordings") or stem in ("home_store", "office", "grid")  # to start from
        assert found.claims or measures_alone
        assert found.conditions()


def test_each_page_shows_how_far_odometry_alone_would_have_gone_wrong():
    assert_each(NAMES, shows_odometry_alone)


def shows_odometry_alone(name):
    found = experiment(name, "full")
    paths = [path for measure in found.measures.values() for path in measure.path]
    assert any(path.endswith("odometry_alone.final_error_m") for path in paths)


@pytest.mark.parametrize("name", ["particle_cml/slip", "particle_cml/kidnap", "omniview_cml/figure_6"])
def test_it_is_a_claim_that_odometry_alone_ends_two_metres_off(name):
    claims = [claim for claim in experiment(name, "full").claims.values() if claim.measure == "odometry_end"]
    assert [claim.at_least for claim in claims] == [2.0]


def with_each_level(conditions):
    """Few conditions among which each level of each factor occurs; the only one where there are no factors."""
    left = {level for condition in conditions for level in condition.labels.items()}
    chosen = conditions[:1]
    while left := left - {level for condition in chosen for level in condition.labels.items()}:
        chosen = [*chosen, max(conditions, key=lambda condition: len(left & condition.labels.items()))]
    return chosen


def test_the_first_condition_of_each_experiment_can_be_built():
    assert_each(ALL, lambda name: can_be_built(name, experiment(name, "full").conditions()[:1]))


@pytest.mark.nightly
@pytest.mark.parametrize("folder", sorted({name.partition("/")[0] for name in ALL}))
def test_a_condition_of_each_level_of_each_factor_can_be_built(folder):
    names = [name for name in ALL if name.startswith(f"{folder}/")]
    assert_each(names, lambda name: can_be_built(name, with_each_level(experiment(name, "full").conditions())))


def can_be_built(name, conditions):
    found = experiment(name, "full")
    for condition in conditions:
        prepared = prepare_run(complete(compose(typed(found, condition))))
        if name in NAMES:
            assert {"errors", "error_curves", "map_history"} <= set(prepared.graph.nodes)


def test_nothing_is_claimed_that_too_few_scenarios_leave_undecided():
    assert_each(ALL, has_enough_scenarios)


def has_enough_scenarios(name):
    found = experiment(name, "full")
    assert not found.claims or len(found.scenarios) >= MIN_GROUPS


def test_at_a_small_scale_no_test_world_is_looked_at():
    assert_each(ALL, looks_at_no_test_world)


def looks_at_no_test_world(name):
    config = settings_of(name)
    for profile in {"quick", "development"} & set(config["experiment"].get("profiles", {})):
        typed = " ".join(read_experiment(config["experiment"], profile).all_scenarios.values())
        assert {int(draw) for draw in re.findall(r"world\.draw=(\d+)", typed)} <= {0, *range(7, 18)}


def test_no_verdict_is_counted_twice():
    assert_each(ALL, makes_each_comparison_once)


def makes_each_comparison_once(name):
    words = {"statement": "", "paper": "", "where": "", "quote": "", "struck": ""}
    compared = [replace(claim, **words) for claim in experiment(name, "full").claims.values()]
    assert all(one != other for k, one in enumerate(compared) for other in compared[:k])
