"""`omninav check`: everything that is wrong with a configuration; nothing is left behind."""

import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from omninav.pipeline.cli.arguments import condition_arguments, read_flags
from omninav.pipeline.cli.composition import complete, composed, read_words
from omninav.pipeline.cli.jobs import no_run_in
from omninav.pipeline.cli.objective import check_objective
from omninav.pipeline.engine.artifact import read_artifact
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.engine.prefix import prefix_nodes
from omninav.pipeline.graph.graph import LIFETIMES, Graph
from omninav.pipeline.graph.ground_truth import truth_readers
from omninav.pipeline.graph.problems import BadInput, counted
from omninav.pipeline.graph.recordable import Recordable
from omninav.pipeline.graph.stage import Source
from omninav.pipeline.jobs.executors import read_executor
from omninav.pipeline.run.prepared_run import PreparedRun, check_inputs, prepare_run

MAX_TRIED = 1 << 26
"""Bytes of an artifact's file with which a first tick is tried: reading and preparing a larger one takes long."""

HYDRA_FOLDERS = ("hydra.run.dir", "hydra.sweep.dir")
"""Settings of Hydra that name the folders of runs."""


def command(arguments: list[str]) -> int:
    """Compose and check a configuration, open its inputs, and print what would run."""
    words, _ = read_words(arguments)
    if read_flags(arguments).multirun:
        raise BadInput("check: it checks one run; type it without -m, with one value of each setting")
    of_conditions = condition_arguments(words)
    with composed([word for word in arguments if word not in of_conditions]) as config:
        if config.get("experiment") is not None:
            return _check_experiment(config, arguments)
        read_executor(OmegaConf.to_container(config.executor, resolve=True))
        prepared = prepare_run(complete(config))
    check_objective(prepared.config.get("objective"), prepared.graph)
    check_inputs(prepared)
    _refuse_unwritable(prepared.config, words)
    for graph in (*(artifact.graph for artifact in prepared.artifacts if artifact.graph is not None), prepared.graph):
        engine = Engine(graph, {}, EngineOptions(prepared.seed))
        engine.check_source()
        engine.set_up_source()
        if not _is_simulated(graph):
            _try_first_tick(graph, _small_files(prepared) if graph is prepared.graph else None, prepared.seed)
    graph = prepared.graph
    before, tick, after = (len(graph.of_lifetime(kind)) for kind in LIFETIMES)
    sizes = f"{counted(len(graph.nodes), 'node')}, {counted(len(graph.wires), 'wire')}"
    print(f"{prepared.variant}: nothing wrong with it. {sizes}")
    print(f"{counted(before, 'stage')} before the first tick, {tick} in every tick, {after} after the last one")
    print(_said_of_truth(truth_readers(graph)))
    return 0


def _small_files(prepared: PreparedRun) -> dict[str, Path] | None:
    """The files of all artifacts, where all are files small enough to be tried in passing."""
    files = {each.name: each.file for each in prepared.artifacts if each.file is not None}
    small = all(file.stat().st_size <= MAX_TRIED for file in files.values())
    return files if small and len(files) == len(prepared.artifacts) else None


def _try_first_tick(graph: Graph, files: Mapping[str, Path] | None, seed: int) -> None:
    """Run the first tick as the run will: with artifacts of `files`, or without them what follows from the log alone.

    Stages that give nothing, since they leave files or show something, are left out.
    """
    source = graph.source
    if source is None or not isinstance(source.stage, Source) or not source.stage.repeatable:
        return
    ticking = prefix_nodes(graph) if files is None else [node.name for node in graph.of_lifetime("tick")]
    outputs = [origin for name in ticking for origin in graph.nodes[name].origins]
    artifacts = {name: read_artifact(file) for name, file in (files or {}).items()}
    engine = Engine(graph.leading_to(outputs), artifacts, EngineOptions(seed, checkpoint_s=math.inf))
    engine.begin()
    engine.tick()


def _is_simulated(graph: Graph) -> bool:
    """Tells whether the ticks of a graph have yet to be computed: one of them may take minutes."""
    source = graph.source
    return source is not None and isinstance(source.stage, Recordable) and source.stage.recording_key() is not None


def _refuse_unwritable(config: Mapping[str, Any], words: Sequence[str] = ()) -> None:
    """Raise `BadInput` where runs or what is cached cannot be written, or a run is where this one is to be."""
    folders = {setting: config.get(setting) for setting in ("runs", "cache")}
    typed = (word.partition("=") for word in words)
    folders |= {name: value.strip("'\"") for name, _, value in typed if name in HYDRA_FOLDERS and "$" not in value}
    if "hydra.run.dir" in folders:
        no_run_in(Path(str(folders["hydra.run.dir"])))
    for setting, folder in folders.items():
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


def _check_experiment(config: Any, arguments: Sequence[str]) -> int:
    """Composes and checks each condition that an experiment would run."""
    from omninav.pipeline.cli.composed_experiments import prepared_experiment
    from omninav.pipeline.experiment.conditions import open_inputs

    run = prepared_experiment(config, arguments)
    experiment = run.experiment
    open_inputs(run.conditions)
    _refuse_unwritable(run.conditions[0].config)
    factors = ", ".join(f"{len(experiment.labels(factor))} {factor}" for factor in experiment.sweep)
    runs = sum(len(each.seeds) for each in run.conditions)
    print(f"{experiment.name}, profile {run.profile}: nothing wrong with it")
    kind = "scenario" if experiment.scenarios else "development draw"
    number = len(experiment.named_scenarios)
    over = f" in each of {counted(number, kind)}" if number else ""
    conditions = counted(len(experiment.conditions()), "condition")
    print(f"{conditions} ({factors}), each with {counted(experiment.repetitions, 'repetition')}{over}")
    print(f"{counted(runs, 'run')} in all")
    print(f"claims to be judged: {len(experiment.claims)}")
    readers = sorted({name for each in run.conditions for name in truth_readers(each.prepared.graph)})
    print(_said_of_truth(readers))
    return 0


def _said_of_truth(readers: list[str]) -> str:
    named = ("prior (only with start=truth)" if name == "prior" else name for name in readers)
    return f"nodes that read ground truth: {', '.join(named) or 'none'}"
