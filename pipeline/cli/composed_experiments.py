"""Experiments on the command line: which words are for their conditions, and how these are composed."""

import shlex
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from hydra.errors import HydraException
from omegaconf import OmegaConf
from rich.table import Table as TerminalTable
from rich.text import Text

from omninav.pipeline.experiment.best import best_condition
from omninav.pipeline.experiment.conditions import results_by_condition
from omninav.pipeline.experiment.pages import Judged
from omninav.pipeline.experiment.result import ExperimentResult, read_result, result_files
from omninav.pipeline.experiment.runner import ExperimentRun, prepare_experiment
from omninav.pipeline.experiment.specification import FULL, Experiment, read_experiment
from omninav.pipeline.experiment.verdicts import Verdict, unmeasured
from omninav.pipeline.graph.problems import BadInput, counted

from .arguments import condition_arguments
from .composition import complete, read_words
from .composition_cache import compose
from .config_groups import config_file, listed_groups
from .hydra_session import hydra_started
from .overrides import composed_of
from .terminal import show, shown

MORE_SCENARIOS = "undecided"
"""The profile that adds scenarios for claims which the others leave undecided."""


def run_experiment(config: Any, arguments: Sequence[str]) -> int:
    """Run every condition and repetition of an experiment's file, and write its page. 1 where a job failed."""
    run = prepared_experiment(config, arguments)
    well = run.run()
    for problem in unmeasured(run.experiment, results_by_condition(run.conditions)):
        print(problem, file=sys.stderr)
    verdicts = run.verdicts()
    if verdicts:
        show(verdict_table(run.experiment, verdicts))
        left_open = [case for verdict in verdicts.values() if verdict.holds is None for case in verdict.cases]
        if any(case.scenarios == 1 for case in left_open):
            print("undecided: one scenario says nothing about the next; a verdict needs several")
        if left_open and run.profile == FULL and MORE_SCENARIOS in run.experiment.profiles:
            print(f"undecided: profile={MORE_SCENARIOS} judges by more scenarios as well, once")
    best = best_condition(run.experiment, results_by_condition(run.conditions, bool(run.experiment.development)))
    if best is not None:
        print(f"best over {counted(len(run.experiment.development) or 1, 'scenario')}: {best[0].name}: {best[1]}")
    print(f"page: {shown(run.folder / (run.experiment.name + '.html'))}", flush=True)
    return 0 if well else 1


def verdict_table(experiment: Experiment, verdicts: Mapping[str, Verdict]) -> TerminalTable:
    """A line for each claim: its verdict, the claim, and how many of its cases hold where not all do."""
    table = TerminalTable.grid(padding=(0, 3, 0, 0))
    for key, verdict in verdicts.items():
        holding = sum(case.holds is True for case in verdict.cases)
        cases = f" ({holding} of {len(verdict.cases)} cases hold)" if 0 < holding < len(verdict.cases) else ""
        word = Text(verdict.words, "bold red" if verdict.holds is False else "")
        table.add_row(word, Text(f"{experiment.claims[key].statement}{cases}"))
    return table


def resolved_but_for_the_experiment(config: Any) -> dict[str, Any]:
    """A composed configuration as plain dicts: what the experiment's file interpolates is left to its conditions.

    It may name what only a condition has.
    """
    others = OmegaConf.masked_copy(config, [key for key in config if key != "experiment"])
    plain: Any = OmegaConf.to_container(others, resolve=True)
    return {**plain, "experiment": OmegaConf.to_container(config.experiment)}


def judged_experiments(folder: Path, config_dirs: Sequence[str] = ()) -> Judged:
    """The results in a folder, each with its experiment as the file that its command names has it now."""
    results = [(path, read_result(path)) for path in result_files(folder)]
    with hydra_started(config_dirs):
        return [(_experiment_of(path, result, config_dirs), result) for path, result in results]


def _experiment_of(path: Path, result: ExperimentResult, config_dirs: Sequence[str]) -> Experiment:
    typed, _ = read_words(shlex.split(result.command)[1:])
    keys = [word.lstrip("+~").partition("=")[0].partition(".")[0] for word in typed]
    words = [word for word, key in zip(typed, keys, strict=True) if key in ("experiment", "profile")]
    plain = resolved_but_for_the_experiment(without_graph(words, config_dirs)) if "experiment" in keys else {}
    if plain.get("experiment", {}).get("name") != result.name:
        raise BadInput(f"{path}: its command, `{result.command}`, is not of the experiment '{result.name}'")
    return read_experiment(plain["experiment"], str(plain.get("profile") or FULL))


def without_graph(words: Sequence[str], config_dirs: Sequence[str] = ()) -> Any:
    """The configuration of an experiment, without a variant's graph where it can be: that takes half of the time."""
    options = (item for item in config_file()["defaults"] if isinstance(item, dict))
    chosen = (name for option in options for name, value in option.items() if value and name in listed_groups())
    with suppress(HydraException):
        return compose([*(f"~{name}" for name in chosen if name != "executor"), *words])
    return composed_of(words, config_dirs)


def prepared_experiment(config: Any, arguments: Sequence[str]) -> ExperimentRun:
    """The experiment of a composed configuration, with every condition checked. Raises `ProblemsFound`."""
    plain = resolved_but_for_the_experiment(config)
    typed, folders = read_words(arguments)

    def composed(words: Sequence[str]) -> dict[str, Any]:
        return complete(composed_of(words, folders))

    words = [*condition_arguments(typed), f"cache={plain['cache'] or 'null'}"]
    return prepare_experiment(plain, composed, words, ["omninav", *arguments])
