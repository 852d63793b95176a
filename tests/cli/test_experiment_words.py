"""What the words of an experiment's file mean in each of its conditions."""

from omninav.pipeline.cli.composed_experiments import prepared_experiment
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.hydra_session import hydra_started


def test_an_interpolation_is_of_the_condition_and_not_of_the_line_that_asks_for_the_experiment() -> None:
    words = ["+experiment=topological_nav/comparison", "profile=quick"]
    with hydra_started():
        config = compose(words)
        assert "other_day" not in config.get("nodes", {})
        config.experiment.about = "${nodes.other_day.world.name}"
        prepared = prepared_experiment(config, words)
    assert prepared.experiment.about == "${nodes.other_day.world.name}"  # which only the conditions have
    worlds = {
        (run.config["world"]["name"], run.config["nodes"]["other_day"]["world"]["name"])
        for run in prepared.conditions
        if "other_day" in run.config["nodes"]
    }
    assert worlds
    assert all(world == other for world, other in worlds)
    assert "home_store_demo" not in {world for world, _ in worlds}  # the world of a line that names none
