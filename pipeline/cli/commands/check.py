"""`omninav check`: everything that is wrong with a configuration; nothing is run."""

from omninav.pipeline.cli.composition import complete, composed, configured_variants, read_words
from omninav.pipeline.cli.experiments import condition_words, planned_experiment
from omninav.pipeline.cli.overrides import search
from omninav.pipeline.experiment.conditions import open_inputs
from omninav.pipeline.experiment.runner import ExperimentRun
from omninav.pipeline.graph.graph import LIFETIMES
from omninav.pipeline.graph.ground_truth import truth_readers
from omninav.pipeline.run.inputs import refuse_missing
from omninav.pipeline.run.plan import input_digests, plan


def command(arguments: list[str]) -> int:
    """Compose and check a configuration, open its inputs, and print what would run."""
    words, folders = read_words(arguments)
    of_conditions = condition_words(words)
    with composed([word for word in arguments if word not in of_conditions]) as config:
        if config.get("experiment") is not None:
            return _check_experiment(planned_experiment(config, arguments, search(folders)))
        planned = plan(complete(config, configured_variants(search(folders))))
    refuse_missing(planned.config)
    input_digests(planned)  # opens every file that the run reads
    graph = planned.graph
    before, tick, after = (len(graph.of_lifetime(kind)) for kind in LIFETIMES)
    print(f"{planned.variant}: nothing wrong with it. {len(graph.nodes)} nodes, {len(graph.wires)} wires")
    print(f"{before} stages run before the loop, {tick} every tick, {after} after it")
    print(f"ground truth is read by: {', '.join(truth_readers(graph)) or 'nobody'}")
    return 0


def _check_experiment(run: ExperimentRun) -> int:
    """What an experiment would run. Its conditions are composed and checked by now."""
    experiment = run.experiment
    open_inputs(run.all_runs)
    factors = ", ".join(f"{len(experiment.labels(factor))} {factor}" for factor in experiment.sweep)
    runs = sum(len(each.seeds) for each in run.all_runs)
    print(f"{experiment.name}, profile {run.profile}: nothing wrong with it")
    over = f" in each of {len(experiment.scenarios)} scenarios" if experiment.scenarios else ""
    conditions = len(experiment.conditions())
    print(f"{conditions} conditions ({factors}), each with {experiment.repetitions} repetitions{over}")
    references = len(run.all_runs) - len(run.conditions)
    print(f"{runs} runs in all" + (f", {references} of them reference runs" if references else ""))
    print(f"claims to be judged: {len(experiment.claims)}")
    readers = sorted({name for each in run.conditions if each.planned for name in truth_readers(each.planned.graph)})
    print(f"ground truth is read by: {', '.join(readers) or 'nobody'}")
    return 0
