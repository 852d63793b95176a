"""`omninav variants`: what `variant=` can be, and what each takes."""

import functools
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omninav.pipeline.cli.arguments import read_flags
from omninav.pipeline.cli.config_groups import config_file, group_files, option_content, suggest_option
from omninav.pipeline.cli.variant_inputs import inputs_of
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.small_files import read_yaml

INDENT = 27
"""Columns before what a variant does."""


def command(arguments: list[str]) -> int:
    """Print what all variants, or those that are named, do and take; what several share is explained once."""
    flags = read_flags(arguments)
    arguments, own = flags.overrides, Path(flags.config_dir) if flags.config_dir else None
    found = [*group_files("variant"), *(sorted((own / "variant").glob("*.yaml")) if own else ())]
    texts = {file.name.removesuffix(".yaml"): file.read_bytes().decode("utf-8", "replace") for file in found}
    summaries = {name: _summary(text) for name, text in texts.items()}
    for word in arguments:
        if word not in summaries:
            raise BadInput(
                f"variants: there is no variant {word}; {suggest_option('variant', word, summaries, 'variants')}"
            )
    default = next(item["variant"] for item in config_file()["defaults"] if "variant" in item)
    names = arguments or sorted(summaries, key=lambda name: (name != default, name))
    read = functools.cache(functools.partial(_option, own))
    inputs = {name: inputs_of(name, config_file()["defaults"], read) for name in names}
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


def _option(own: Path | None, group: str, option: str) -> Mapping[str, Any]:
    """The content of an option's file, of omninav's or in the folder of one's own. Raises `BadInput`."""
    content = option_content(group, option)
    file = None if content or own is None else own / group / f"{option}.yaml"
    if file is None or not file.is_file():
        return content
    content = read_yaml(file) or {}
    fits = isinstance(content, dict) and isinstance(content.get("inputs") or {}, dict)
    if not fits or not isinstance(content.get("defaults", []), list):
        raise BadInput(f"{file}: expected names and values, with a list as defaults: and names as inputs:")
    return content


def _explain(setting: str, meaning: str, required: bool, indent: int) -> None:
    print(f"{'':{indent}}{f'{setting}=…':10} {meaning}{' (required)' if required else ''}")
