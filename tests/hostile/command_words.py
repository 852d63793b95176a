"""What is typed, and configurations: words of the command line, files of a --config-dir, experiments."""

import functools
import os
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from conftest import DRIVE, GRID, ROOT, TOUR

from omninav.pipeline.cli.main import main
from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.small_files import read_yaml

from .harness import Format, Wrong, as_refused
from .mutations import TEXT, Files, line, on, word

VARIANT = b"""\
# @package _global_
defaults: [retrieval_mcl, _self_]
nodes:
  fusion: {number: 5000}
wires:
  match: {features: features.features}
"""


def words() -> Sequence[Files]:
    """Words that `check` finds nothing wrong with."""
    log, grid = f"log={DRIVE}\ntour={TOUR}\n".encode(), f"grid={GRID}\n".encode()
    return [
        {"words": b"variant=retrieval_mcl\n" + log + grid + b"seed=3\nnodes.fusion.number=5000"},
        {"words": b"variant=omniview_mcl\n" + log + b"match=selective\nnodes.match.headings=72\nstart=uniform"},
    ]


def variants() -> Sequence[Files]:
    """A variant of the user's own in a folder of configurations."""
    return [{"conf/variant/mine.yaml": VARIANT}]


@functools.cache
def experiments() -> Sequence[Files]:
    """Experiments of ours, without what they stand on."""
    found = sorted((ROOT / "conf" / "experiment").rglob("*.yaml"))
    return [{"experiment.yaml": file.read_bytes()} for file in found if b"claims:" in file.read_bytes()][:6]


def checked(folder: Path, files: Files) -> Any:
    """`omninav check` with these words."""
    typed = files["words"].decode("utf-8", "surrogateescape").split("\n")
    _check(folder, typed)


def checked_variant(folder: Path, files: Files) -> Any:
    """`omninav check` of this variant."""
    _check(
        folder, ["--config-dir", str(folder / "conf"), "variant=mine", f"log={DRIVE}", f"tour={TOUR}", f"grid={GRID}"]
    )


def experiment(folder: Path, files: Files) -> Any:
    """An experiment's file."""
    plain = read_yaml(folder / "experiment.yaml")
    if not isinstance(plain, dict):
        raise BadInput("no mapping")
    read_experiment({key: value for key, value in plain.items() if key not in ("defaults", "set")}, "full")


def _check(folder: Path, typed: Sequence[str]) -> None:
    before, path = Path.cwd(), list(sys.path)
    said = StringIO()
    os.chdir(folder)
    try:
        with redirect_stderr(said), redirect_stdout(StringIO()):
            code = main(["check", *typed])
    except SystemExit as ended:  # of argparse: an option that there is not
        code = int(ended.code or 0) if isinstance(ended.code, int | None) else 2
    finally:
        os.chdir(before)
        sys.path[:] = path
    if code == 2:
        as_refused(said.getvalue())
    elif code:
        raise Wrong(f"exit {code}: {said.getvalue()[:200]!r}")


WORDS = Format("overrides", words, [on((word, word, line))], checked, cases=8, cpu_s=8)
CONFIG = Format("configuration", variants, [on(TEXT)], checked_variant, cases=8, cpu_s=8)
EXPERIMENT = Format("experiment", experiments, [on(TEXT)], experiment)
