"""Composes as Hydra does, and what the conditions of an experiment or the jobs of a sweep have in common only once."""

import functools
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import ConfigCompositionException, HydraException
from omegaconf import OmegaConf, open_dict
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from omninav.pipeline.graph.problems import BadInput

CONFIG = "config"
"""The file that every configuration is composed from."""
TYPED = "typed"
"""The key of a configuration that holds all that was typed."""
RUN_ALONE = "hydra.mode=RUN"
"""The word that tells Hydra that a job belongs to no sweep."""


def compose(words: Sequence[str]) -> Any:
    """The configuration that words describe, where Hydra has been started. Raises Hydra's errors."""
    with hydra_errors():
        return from_options(functools.partial(_of_options, GlobalHydra.instance().hydra), parsed(words))


def parsed(words: Sequence[str]) -> list[Override]:
    """Reads words as Hydra does. Raises its errors."""
    return [*OverridesParser.create().parse_overrides([*words])]


def from_options(kept: Callable[[tuple[str, ...]], bytes], words: Sequence[Override]) -> Any:
    """Sets words in the configuration that their options give, whose bytes `kept` returns. Raises Hydra's errors.

    Nearly all of Hydra's time goes into finding and merging the files of options (`variant=…`, `executor=…`). So what
    options give is kept, and all else (`day=2`) is set in a copy of it. What was set is listed under `typed`.
    """
    settings = [word for word in words if _is_setting(word)]
    config = pickle.loads(kept(tuple(str(word.input_line) for word in words if word not in settings)))
    for word in settings:
        try:
            _set(config, word)
        except OmegaConfBaseException as error:
            raise ConfigCompositionException(f"Error merging override {word.input_line}") from error
    OmegaConf.update(config, TYPED, [word.key_or_group for word in words], force_add=True)
    return config


@contextmanager
def hydra_errors() -> Iterator[None]:
    """Whatever Hydra stumbles over is an error of Hydra's."""
    try:
        yield
    except (HydraException, OmegaConfBaseException, BadInput):
        raise
    except RecursionError:
        raise ConfigCompositionException("files of options include each other in their defaults") from None
    except (
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        AssertionError,
    ) as error:
        raise ConfigCompositionException(f"{type(error).__name__}: {error}") from None


def _set(config: Any, word: Override) -> None:
    """Set, add or take out what a word names, as Hydra does and with its words where that cannot be."""
    key, value, line = word.key_or_group, word.value(), word.input_line
    if word.package is not None:
        raise ConfigCompositionException(
            f"Override {line} looks like a config group override, but config group '{key}' does not exist."
        )
    if word.is_delete():
        there = OmegaConf.select(config, key, throw_on_missing=False)
        if there is None:
            raise ConfigCompositionException(f"Could not delete from config. '{key}' does not exist.")
        if value is not None and value != there:
            raise ConfigCompositionException(
                f"Could not delete from config. The value of '{key}' is {there} and not {value}."
            )
        above, _, name = key.rpartition(".")
        with open_dict(config):
            del (OmegaConf.select(config, above) if above else config)[name]
        return
    add = word.is_add() or word.is_force_add()
    there = OmegaConf.select(config, key, throw_on_missing=False) if word.is_add() else None
    if there is not None and not isinstance(value, dict | list):
        raise ConfigCompositionException(
            f"Could not append to config. An item is already at '{key}'.\n"
            f"Either remove + prefix: '{str(line)[1:]}'\n"
            f"Or add a second + to add or override '{key}': '+{line}'\n"
        )
    try:
        OmegaConf.update(config, key, value, merge=True, force_add=add)
    except (ConfigAttributeError, ConfigKeyError) as error:
        what = f"Could not override '{key}'.\nTo append to your config use +{line}"
        raise ConfigCompositionException(what) from error


@functools.lru_cache(maxsize=256)
def _of_options(session: Any, options: tuple[str, ...]) -> bytes:
    # A configuration is read from its bytes five times as fast as it is copied. A run of the same options needs it too.
    return pickle.dumps(hydra.compose(CONFIG, overrides=[*options, RUN_ALONE]))


def _is_setting(word: Override) -> bool:
    """Tells if Hydra sets a word in what it has composed. Sweeps and keys under `hydra.` are refused before."""
    key = word.key_or_group
    if word.is_sweep_override() or key.replace("/", ".").partition(".")[0] == "hydra":
        return False
    sources = GlobalHydra.instance().config_loader().get_sources()
    return isinstance(word.value(), dict) or not any(source.is_group(key) for source in sources)
