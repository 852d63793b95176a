"""`omninav variant=… log=…`, `omninav -m …`, `omninav +experiment=…`: hand over to Hydra, which calls each job."""

import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra import initialize_config_module
from hydra.errors import HydraException

from omninav.pipeline.cli.composition import composed, offer_plugins, read_words
from omninav.pipeline.cli.config_groups import CONF
from omninav.pipeline.cli.experiments import condition_words, run_experiment
from omninav.pipeline.cli.jobs import OUTCOMES, run_job
from omninav.pipeline.cli.overrides import invalid_overrides, jobs_to_try, with_unlisted_parameters
from omninav.pipeline.graph.problems import ProblemsFound


def command(arguments: list[str]) -> int:
    """Run one job, or all of a sweep. Hydra composes the configurations."""
    words, folders = read_words(arguments)
    offer_plugins()  # which parameters there are depends on the stages that are offered
    if any(word.startswith("nodes.") for word in words):
        with initialize_config_module(CONF, version_base="1.3"):
            listed = with_unlisted_parameters(words, folders)
        arguments = [listed[words.index(word)] if word in words else word for word in arguments]
        words = listed

    def job(config: Any) -> None:
        run_job(config, arguments, run_experiment)

    if {"-m", "--multirun"} & set(arguments):
        _refuse_misspelled_sweep(words, folders)
    of_conditions = condition_words(words)
    with tempfile.TemporaryDirectory() as place:
        outcomes = Path(place) / "outcomes"
        os.environ[OUTCOMES] = str(outcomes)
        os.environ["HYDRA_FULL_ERROR"] = "1"  # what Hydra does not understand is raised, and reported by us
        sys.argv = ["omninav", *(word for word in arguments if word not in of_conditions)]
        try:
            hydra.main(config_path=f"pkg://{CONF}", config_name="config", version_base="1.3")(job)()
        except SystemExit as stop:  # a flag that Hydra does not know
            if stop.code:
                return 2
        except HydraException as error:
            with initialize_config_module(CONF, version_base="1.3"):
                raise ProblemsFound(invalid_overrides(words, folders, str(error))) from None
        codes = [int(line) for line in outcomes.read_text().split()] if outcomes.exists() else []
    return max(codes, default=0)


def _refuse_misspelled_sweep(words: Sequence[str], folders: Sequence[str]) -> None:
    """Hydra makes a sweep's folder before it reads the words; so they are read before."""
    with initialize_config_module(CONF, version_base="1.3"):
        jobs = list(jobs_to_try(words, folders))
    for job in jobs:
        with composed([*job, *(f"--config-dir={folder}" for folder in folders)], offer=False):
            pass
