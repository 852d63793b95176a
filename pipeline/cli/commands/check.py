"""`omninav check`: everything that is wrong with a configuration; nothing is left behind."""

import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from omninav.pipeline.cli.composition import complete, composed, read_words
from omninav.pipeline.cli.experiments import condition_words, planned_experiment
from omninav.pipeline.engine.artifact import check_artifact, read_artifact
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.engine.prefix import lineage, prefix_nodes
from omninav.pipeline.experiment.conditions import open_inputs
from omninav.pipeline.experiment.runner import ExperimentRun
from omninav.pipeline.experiment.specification import DEVELOPMENT
from omninav.pipeline.graph.graph import LIFETIMES, Graph
from omninav.pipeline.graph.ground_truth import truth_readers
from omninav.pipeline.graph.problems import BadInput, counted
from omninav.pipeline.graph.recordable import Recordable
from omninav.pipeline.graph.stage import Source
from omninav.pipeline.jobs.executors import read_engine
from omninav.pipeline.run.inputs import refuse_missing
from omninav.pipeline.run.plan import Plan, input_digests, plan

MAX_TRIED = 1 << 26
"""Bytes of an artifact's file with which a first tick is tried: reading and preparing a larger one takes long."""


def command(arguments: list[str]) -> int:
    """Compose and check a configuration, open its inputs, and print what would run."""
    words, _ = read_words(arguments)
    of_conditions = condition_words(words)
    with composed([word for word in arguments if word not in of_conditions]) as config:
        if config.get("experiment") is not None:
            return _check_experiment(planned_experiment(config, arguments))
        read_engine(OmegaConf.to_container(config.engine, resolve=True))
        planned = plan(complete(config))
    refuse_missing(planned.config)
    input_digests(planned)  # opens every file that the run reads
    for artifact in planned.artifacts:
        if artifact.file is not None:
            check_artifact(artifact.file)
    _refuse_unwritable(planned.config)
    for graph in (*(artifact.graph for artifact in planned.artifacts if artifact.graph is not None), planned.graph):
        engine = Engine(graph, {}, EngineOptions(planned.seed))
        engine.check_source()
        engine.set_up_source()
        if not _is_simulated(graph):
            engine.try_once(lineage(graph, prefix_nodes(graph)))
    if not _is_simulated(planned.graph):
        _try_first_tick(planned)
    graph = planned.graph
    before, tick, after = (len(graph.of_lifetime(kind)) for kind in LIFETIMES)
    sizes = f"{counted(len(graph.nodes), 'node')}, {counted(len(graph.wires), 'wire')}"
    print(f"{planned.variant}: nothing wrong with it. {sizes}")
    print(f"{counted(before, 'stage')} before the loop, {tick} in every tick, {after} after it")
    print(f"ground truth is read by: {', '.join(truth_readers(graph)) or 'no stage'}")
    return 0


def _try_first_tick(planned: Plan) -> None:
    """Run the first tick where all artifacts are files small enough to be tried in passing, as its run would.

    Stages that give nothing, since they leave files or show something, are left out.
    """
    source, files = planned.graph.source, {each.name: each.file for each in planned.artifacts}
    if source is None or not isinstance(source.stage, Source) or not source.stage.repeatable:
        return
    if all(file is not None and file.stat().st_size <= MAX_TRIED for file in files.values()):
        artifacts = {name: read_artifact(file) for name, file in files.items() if file is not None}
        ticking = planned.graph.of_lifetime("tick")
        outputs = [f"{node.name}.{port}" for node in ticking for port in node.signature.outputs]
        options = EngineOptions(planned.seed, checkpoint_s=math.inf)
        engine = Engine(planned.graph.leading_to(outputs), artifacts, options)
        engine.begin()
        engine.tick()


def _is_simulated(graph: Graph) -> bool:
    """Tells whether the ticks of a graph have yet to be computed: one of them may take minutes."""
    source = graph.source
    return source is not None and isinstance(source.stage, Recordable) and source.stage.recording_key() is not None


def _refuse_unwritable(config: Mapping[str, Any]) -> None:
    """Raise `BadInput` where runs or what is cached cannot be written."""
    for setting in ("runs", "cache"):
        folder = config.get(setting)
        if folder is None:
            continue
        place = Path(str(folder)).absolute()
        try:
            while not place.exists():
                place = place.parent
            with tempfile.TemporaryFile(dir=place) as trial:
                trial.write(bytes(4096))
        except OSError as error:
            what = f"{place}: nothing can be written there ({error.strerror})"
            raise BadInput(f"{setting}={folder}: {what}; type {setting}=FOLDER") from None


def _check_experiment(run: ExperimentRun) -> int:
    """What an experiment would run. Its conditions are composed and checked by now."""
    experiment = run.experiment
    open_inputs(run.all_runs)
    _refuse_unwritable(run.all_runs[0].config)
    factors = ", ".join(f"{len(experiment.labels(factor))} {factor}" for factor in experiment.sweep)
    runs = sum(len(each.seeds) for each in run.all_runs)
    print(f"{experiment.name}, profile {run.profile}: nothing wrong with it")
    over = f" in each of {len(experiment.scenarios)} scenarios" if experiment.scenarios else ""
    over += f", and in that of {DEVELOPMENT}" if experiment.development else ""
    conditions = counted(len(experiment.conditions()), "condition")
    print(f"{conditions} ({factors}), each with {counted(experiment.repetitions, 'repetition')}{over}")
    references = len(run.all_runs) - len(run.conditions)
    print(f"{counted(runs, 'run')} in all" + (f", {references} of them reference runs" if references else ""))
    print(f"claims to be judged: {len(experiment.claims)}")
    readers = sorted({name for each in run.conditions if each.planned for name in truth_readers(each.planned.graph)})
    print(f"ground truth is read by: {', '.join(readers) or 'no stage'}")
    return 0
