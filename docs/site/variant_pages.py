"""The page of all variants, each with its inputs and its graph, from their files."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hydra import compose
from omegaconf import OmegaConf

from omninav.pipeline.cli.composition import complete
from omninav.pipeline.cli.config_groups import group_files
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.report.graph_svg import svg
from omninav.pipeline.run.inputs import read_inputs
from omninav.pipeline.run.prepared_run import prepare_run

GOAL = Path(__file__).resolve().parents[1] / "experiments" / "topological_nav_homing_vectors_campus.png"
NEEDED = {"topological_nav": ["goal=kitchen"], "landmark_nav": [f"goal={GOAL}"]}
"""Settings without which a variant does not run, as it is drawn."""


def variants_page() -> dict[str, str]:
    """The page, and a picture for each variant."""
    lines = ["# Variants", "", "A variant is a graph of stages in a file of `conf/variant`."]
    pictures = {}
    with hydra_started():
        default = f"{compose('config').variant}.yaml"
        for file in sorted(group_files("variant"), key=lambda file: (file.name != default, file.name)):
            name = file.name.removesuffix(".yaml")
            config = compose("config", overrides=[f"variant={name}", *NEEDED.get(name, [])])
            lines += _described(name, file.read_text(encoding="utf-8"), config.inputs)
            pictures[f"reference/{name}.svg"] = svg(prepare_run(complete(config)).graph)
    return {"reference/variants.md": "\n".join(lines)} | pictures


def _described(name: str, text: str, declared: Any) -> Iterator[str]:
    says = next(line for line in text.split("\n") if line.startswith("# ") and "@package" not in line).lstrip("# ")
    what, _, typed = says.partition("  omninav ")
    yield f"\n## {name}\n\n{what[:1].upper()}{what[1:]}\n\n```\nomninav {typed}\n```\n"
    inputs = read_inputs({"inputs": OmegaConf.to_container(declared)})
    if inputs:
        yield "| input | what | |\n|---|---|---|"
        for setting, given in inputs.items():
            yield f"| `{setting}=…` | {re.sub(r'[|]', chr(92) + '|', given.meaning)} | {'required' * given.required} |"
    yield f"\n[![The graph of {name}]({name}.svg){{ .graph }}]({name}.svg)\n"
