"""The words of a command line that change a configuration: which of them do not fit it, and what to type instead.

Hydra stops at the first word that it cannot use and names nothing that is like it. Here all words are looked at, beside
the configuration that the fitting ones give. Everything here is called where Hydra is initialised.
"""

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, RangeSweep, ValueType
from hydra.errors import HydraException
from omegaconf import OmegaConf

from omninav.pipeline.graph.parameters import BadStage
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, shown, suggest
from omninav.pipeline.graph.registry import UnknownStage, resolve
from omninav.pipeline.graph.signature import signature

from .composition_cache import compose
from .config_groups import replaced, suggest_option
from .hydra_session import HYDRA_KEYS, not_settable
from .stand_ins import decisive_settings, exchanged

MAX_JOBS = 100_000
"""Jobs of a sweep, and values of each setting that varies."""
MAX_LISTED = 10_000
"""Files of a folder of `--config-dir` that are looked at for a name that is like a mistyped one."""
OF_ARTIFACTS_GRAPH = re.compile(r"^\+?(?=artifacts\.\w+\.(nodes|wires)\.)")
"""The beginning of a word that changes the graph which makes an artifact."""
WITHIN_GRAPH = ("nodes.", "wires.", "artifacts.", "saves.")


def invalid_overrides(words: Sequence[str], folders: Sequence[str], message: str) -> list[Problem]:
    """Every word that fits no group or setting; or Hydra's `message`, where no word is to blame.

    `folders` are those of `--config-dir`.
    """
    problems, parsed = parsed_words(words)
    groups = _groups(folders)
    swaps = [word for word in parsed if word.key_or_group in groups]
    unknown = [[*_unknown_option(word, _options(word.key_or_group, folders), folders)] for word in swaps]
    options = [problem for found in unknown for problem in found]
    deciding = [word for word in parsed if word.key_or_group in decisive_settings()]
    known = [word for word, found in zip(swaps, unknown, strict=True) if not found]
    plain = _plain([*known, *deciding], folders)
    for word in parsed if plain else ():
        # Which nodes there are, and what can be set of them, depends on the options: unknown ones come first.
        if word not in swaps and not (options and word.key_or_group.startswith(WITHIN_GRAPH)):
            problems += _unknown_setting(word, plain, groups)
    problems += options
    if not problems and message.startswith(("Ambiguous value", "Sweep parameters")):
        problems = [_several_values(word) for word in parsed if word.is_sweep_override()]
    if not problems and (lacking := re.search(r"Could not find '([\w/]+)/(\w+)'", message)):
        group, option = lacking.groups()
        near = suggest_option(group, option, _options(group, folders), "options")
        if group.startswith("hydra/"):
            near += "; packages as hydra-submitit-launcher, hydra-joblib-launcher and hydra-optuna-sweeper have others"
            return [Problem(group, f"there is no '{option}'", near)]
        if "/" not in group and group != "variant":
            near = f"a stage of your own is offered by OMNINAV_STAGES={group}.{option}=FILE.py:CLASS; {near}"
        return [Problem(group, f"the defaults of a file choose '{option}', which there is not", near)]
    if not problems and (lacking := re.search(r"Could not override '(hydra\.(sweeper|launcher)[\w.]+)'", message)):
        return [Problem(lacking[1], f"this {lacking[2]} has no such setting", f"choose another: hydra/{lacking[2]}=…")]
    return problems or [Problem("command line", " ".join(message.partition("Config search path")[0].split()))]


def composed_of(words: Sequence[str], folders: Sequence[str] = ()) -> Any:
    """The configuration that words describe. Raises `ProblemsFound` with every word that does not fit."""
    try:
        return compose(with_unlisted_parameters(words, folders))
    except HydraException as error:
        cause = f": {error.__cause__}".partition("\n")[0] if str(error).startswith("Error merging") else ""
        raise ProblemsFound(invalid_overrides(words, folders, f"{error}{cause}")) from None


def _several_values(word: Override) -> Problem:
    text = str(word.input_line)
    name, _, values = text.partition("=")
    listed = f"'{name}=[{values}]' for a list, or " if isinstance(word.value(), ChoiceSweep) else ""
    decimals = re.fullmatch(r"-?\d+,\d+", values)
    fraction = f"; decimal fractions have a point: {values.replace(',', '.')}" if decimals else ""
    return Problem(
        name, f"{shown(values)} are several values", f"type {listed}omninav -m {text} … for a run with each{fraction}"
    )


def with_unlisted_parameters(words: Sequence[str], folders: Sequence[str]) -> list[str]:
    """The words, in which a parameter that a stage has and its configuration does not list is added (`++nodes.…`).

    A configuration lists only what differs from the stage's defaults, and Hydra sets only what is listed. Changes to
    the graph that makes an artifact are added too, whether or not the variant has some of its own.
    """
    words = [OF_ARTIFACTS_GRAPH.sub("++", word) for word in words]
    if not any(word.startswith("nodes.") for word in words):
        return list(words)
    _, parsed = parsed_words(words)
    deciding = {*_groups(folders), *decisive_settings()}
    plain = _plain([word for word in parsed if word.key_or_group in deciding], folders)
    return [f"++{word}" if word.startswith("nodes.") and _unlisted(word, plain) else word for word in words]


def _unlisted(word: str, config: Mapping[str, Any]) -> bool:
    _, name, inside = _deepest(config, word.partition("=")[0])
    return name is not None and isinstance(inside, Mapping) and name in _parameters_of(inside)[0]


def parsed_words(words: Sequence[str]) -> tuple[list[Problem], list[Override]]:
    """Words as Hydra reads them, and a problem for each that it cannot read."""
    problems: list[Problem] = []
    parsed: list[Override] = []
    for text in words:
        try:
            parsed += _parse(text)
        except HydraException:
            problems.append(Problem(text, "cannot be read", _how_to_write(text)))
    return problems, parsed


def _how_to_write(word: str) -> str:
    if "=" not in word and Path(word).exists():
        return f"a file or folder is typed behind the setting that reads it: log={word}"
    if re.search(r"\s[\w.+~/]+=", word):
        return (
            "quotes hold several words together: type each by itself, name=value name=value; one value with = in it "
            f"is typed in quotes within quotes: '{word.partition('=')[0]}=\"…\"'"
        )
    name, _, value = word.partition("=")
    if value and not name.isascii():
        return "names before = are written in a to z, digits, _ and ."
    if re.fullmatch(r"\+{0,2}[\w./@]+", name) and re.fullmatch(r"[^'\"\\$[{][^'\"\\$]*", value):
        return f"write quotes within quotes: \"{name}='{value}'\""
    return "write name=value, and quotes within quotes around odd characters: \"name='a=b.yaml'\""


def _parse(word: str) -> list[Override]:
    """A word as Hydra reads it. Raises Hydra's errors, and `BadInput` for a sweep of very many values."""
    try:
        parsed: list[Override] = OverridesParser.create().parse_overrides([word])
    except (ValueError, ArithmeticError, RecursionError, AssertionError) as error:
        raise HydraException(str(error)) from None
    for one in parsed:
        _number_of_values(one)
    return parsed


def _number_of_values(word: Override) -> int:
    """Number of values that a word means, without listing them. Raises `BadInput` where they are too many."""
    value, number = word.value(), 1.0
    if isinstance(value, RangeSweep):
        start, stop, step = (float(edge or 0) for edge in (value.start, value.stop, value.step))
        number = max(1.0, (stop - start) / step) if step else math.inf
    elif isinstance(value, ChoiceSweep):
        number = len(value.list)
    if not number <= MAX_JOBS:
        raise BadInput(f"{word.key_or_group}: {shown(word.input_line)} is a sweep of more than {MAX_JOBS:,} values")
    return int(number)


def _refuse_no_values(word: Override, folders: Sequence[str]) -> None:
    """Raise `BadInput` where a word means no value, so that its sweep has no job."""
    value, name = word.value(), word.key_or_group
    if isinstance(value, Glob):
        options = _options(name, folders)
        listed = f"its options are {', '.join(options)}" if options else "options of groups alone are found by glob"
        empty, hint = not value.filter(options), listed
    else:
        empty = isinstance(value, RangeSweep) and next(word.sweep_iterator(), None) is None
        hint = "write range(first, beyond the last, step)"
    if empty:
        raise BadInput(f"{name}: {shown(word.input_line)} means no value; {hint}")


def _refuse_same_jobs(texts: Sequence[str], word: Override, first: Override) -> None:
    """Raise `BadInput` where a swept word has a value twice, or where `first` sets the same and is passed over."""
    double = next((text for number, text in enumerate(texts) if text in texts[:number]), None)
    if double is not None:
        raise BadInput(f"{word.key_or_group}: {double} stands twice in the sweep; its jobs would be the same")
    if word is not first and (word.is_sweep_override() or first.is_sweep_override()):
        raise BadInput(f"{first.input_line} and {word.input_line} are typed; leave one of them out")


def _plain(swaps: Sequence[Override], folders: Sequence[str]) -> dict[str, Any]:
    """The configuration with these options alone, the first of each that is swept; {} where there is none."""
    try:
        config = compose([text for word in swaps for text in _texts(word)[:1]])
        plain: Any = OmegaConf.to_container(config, resolve=False)
        for name, node in exchanged(config):
            plain["nodes"][name]["_target_"] = node["_target_"]  # lists what it listed, and has other parameters
    except HydraException:
        plain = {}
    return dict(plain)


def jobs_to_try(words: Sequence[str], folders: Sequence[str]) -> Iterator[list[str]]:
    """Jobs of a sweep of which one is misspelled if any job is: the first choices, and each other option of a group."""
    groups = set(_groups(folders))
    choices = []
    jobs = 1
    given: dict[str, Override] = {}
    for word in words:
        try:
            parsed = _parse(word)[0]
        except HydraException:
            choices.append([word])
            continue
        jobs *= _number_of_values(parsed)
        texts = _texts(parsed)
        _refuse_no_values(parsed, folders)
        _refuse_same_jobs(texts, parsed, given.setdefault(parsed.key_or_group, parsed))
        choices.append(texts if parsed.key_or_group in groups else texts[:1])
    if jobs > MAX_JOBS and not any(word.startswith("hydra/sweeper=") for word in words):
        raise BadInput(f"-m: a sweep of {jobs:,} jobs, expected at most {MAX_JOBS:,}; leave some values out")
    choices = [texts for texts in choices if texts]
    firsts = [texts[0] for texts in choices]
    yield firsts
    for number, texts in enumerate(choices):
        for other in texts[1:]:
            yield [*firsts[:number], other, *firsts[number + 1 :]]


def _texts(word: Override) -> list[str]:
    """A word as each job of a sweep gets it; itself where it is not swept."""
    if word.is_delete() or not word.is_sweep_override():
        return [str(word.input_line)]
    if word.value_type == ValueType.GLOB_CHOICE_SWEEP or not word.is_discrete_sweep():
        return []
    return [f"{word.get_key_element()}={value}" for value in word.sweep_string_iterator()]


def _groups(folders: Sequence[str]) -> list[str]:
    found = {name for name in GlobalHydra.instance().config_loader().list_groups("") if name != "hydra"}
    for folder in folders:
        found |= {file.relative_to(folder).parts[0] for file in _configurations(Path(folder))}
    return sorted(found)


def _options(group: str, folders: Sequence[str]) -> list[str]:
    """All options of a group, those in folders within it with their folder (`omniview_mcl/figure_3`)."""
    loader = GlobalHydra.instance().config_loader()
    found = set(loader.get_group_options(group))
    for inner in loader.list_groups(group):
        found |= {f"{inner}/{option}" for option in _options(f"{group}/{inner}", ())}
    for folder in folders:
        place = Path(folder) / group
        found |= {str(file.relative_to(place).with_suffix("")) for file in _configurations(place)}
    return sorted(found)


def _configurations(folder: Path) -> Iterator[Path]:
    """The files of configuration in a folder and in those within it; links to folders are not followed."""
    files = (Path(place, name) for place, _, names in os.walk(folder) for name in names)
    return (file for file in islice(files, MAX_LISTED) if file.suffix == ".yaml")


def _unknown_option(word: Override, options: Sequence[str], folders: Sequence[str]) -> Iterator[Problem]:
    if word.is_delete():
        return
    group = word.key_or_group
    too_deep = [path for path in map(Path, folders) if path.absolute().name == group]
    for text in _texts(word):
        option = text.partition("=")[2].strip("'\"")
        if option not in options and not option.startswith("["):
            hint = suggest_option(group, option, options, "options", prefix=f"{group}=")
            for path in too_deep:
                hint = f"--config-dir names the folder above `{group}`: type --config-dir {path.parent}"
            yield Problem(group, f"there is no '{option}'", hint)


def _unknown_setting(word: Override, config: Mapping[str, Any], groups: list[str]) -> Iterator[Problem]:
    path = word.key_or_group
    if path.partition(".")[0].partition("/")[0] == "hydra":
        if not path.replace("/", ".").startswith(tuple(name.replace("/", ".") for name in HYDRA_KEYS)):
            yield not_settable(path)
        return
    value = str(word.input_line).partition("=")[2]
    parents, name, inside = _deepest(config, path)
    gone = next(
        (each for each in replaced() if path == each or (not word.is_add() and path.startswith(f"{each}."))), None
    )
    if gone is not None:
        yield Problem(gone, "this setting is gone", replaced()[gone])
        return
    if word.is_add() or word.is_force_add():
        if name is None and not word.is_force_add() and not isinstance(inside, Mapping):
            yield Problem(path, "it is there already", f"type {path}={value}")
        return
    if name is None or "/" in path:
        return
    options = [str(key) for key in inside]
    above = ".".join(parents)
    if word.is_delete():
        hint = suggest(name, options, "there are", f"~{above}.")
        yield Problem(path, "there is nothing of that name to take out", hint)
        return
    if not parents:
        options = [key for key in {*options, *groups} if key not in ("hydra", "nodes", "wires", "artifacts", "saves")]
        yield Problem(path, "there is no such setting or group", suggest(name, options, "there are", "", f"={value}"))
        return
    parameters, stage = _parameters_of(inside)
    if name in parameters:
        return
    rest = path.removeprefix(f"{above}.{name}")
    what = f"{stage} has no parameter '{name}'" if stage else f"there is no '{name}' in '{above}'"
    hint = suggest(name, parameters or options, "there are", f"{above}.", f"{rest}={value}")
    yield Problem(path, what, hint if parameters else f"{hint}; to add it, type +{path}={value}")


def _deepest(config: Mapping[str, Any], path: str) -> tuple[list[str], str | None, Any]:
    """Extent of a path: the names that exist, the first that does not (None if all do), and what is there."""
    parents: list[str] = []
    inside: Any = config
    for name in path.split("."):
        if not isinstance(inside, Mapping):
            return parents, None, inside
        if name not in inside:
            return parents, name, inside
        inside = inside[name]
        parents.append(name)
    return parents, None, inside


def _parameters_of(node: Mapping[str, Any]) -> tuple[list[str], str]:
    """The parameters of the stage that a node's configuration names, and the stage's name; none where it names none."""
    try:
        cls = resolve(str(node["_target_"]))
        return list(signature(cls).parameters), cls.__name__
    except (KeyError, UnknownStage, BadStage):
        return [], ""
