"""`omninav variants`: what `variant=` can be, and what each takes."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from hydra import compose
from omegaconf import OmegaConf

from omninav.pipeline.cli.composition import offer_plugins, read_words
from omninav.pipeline.cli.config_groups import group_files, suggest_option
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.run.inputs import Input, read_inputs

INDENT = 27
"""Columns before what a variant does."""


def command(arguments: list[str]) -> int:
    """Print what all variants, or those that are named, do and take; what several share is explained once."""
    arguments, folders = read_words(arguments)
    offer_plugins()  # a variant of one's own may name a stage of one's own
    own = [Path(folder) / "variant" for folder in folders]
    found = [*group_files("variant"), *(file for folder in own for file in sorted(folder.glob("*.yaml")))]
    summaries = {file.name.removesuffix(".yaml"): _summary(file.read_text(encoding="utf-8")) for file in found}
    for word in arguments:
        if word not in summaries:
            raise BadInput(
                f"variants: there is no variant {word}; {suggest_option('variant', word, summaries, 'variants')}"
            )
    with hydra_started(folders):
        default = str(compose("config").variant)
        names = arguments or sorted(summaries, key=lambda name: (name != default, name))
        inputs = {name: _inputs(name) for name in names}
    uses = Counter((setting, given.meaning) for taken in inputs.values() for setting, given in taken.items())
    shared = {setting: meaning for (setting, meaning), number in reversed(uses.most_common()) if number > 1}
    for name, taken in inputs.items():
        print(f"{name:{INDENT}} {'the default: ' if name == default else ''}{summaries[name]}")
        named = [setting for setting, given in taken.items() if shared.get(setting) == given.meaning]
        if named:
            print(f"{'':{INDENT}}   {', '.join(f'{setting}=' for setting in named)}")
        for setting, given in taken.items():
            if setting not in named:
                _explain(setting, given.meaning, given.required, INDENT + 3)
    if shared:
        print()
    for setting, meaning in sorted(shared.items()):
        _explain(setting, meaning, False, 0)
    return 0


def _summary(text: str) -> str:
    comments = (line for line in text.split("\n") if line.startswith("# ") and "@package" not in line)
    return next(comments, "").lstrip("# ")


def _inputs(variant: str) -> Mapping[str, Input]:
    declared = compose("config", overrides=[f"variant={variant}"]).inputs
    return read_inputs({"inputs": OmegaConf.to_container(declared)})


def _explain(setting: str, meaning: str, required: bool, indent: int) -> None:
    print(f"{'':{indent}}{f'{setting}=…':10} {meaning}{' (required)' if required else ''}")
