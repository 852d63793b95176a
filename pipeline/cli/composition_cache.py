"""Composes as Hydra does, and what the conditions of an experiment have in common only once."""

import functools
import pickle
from collections.abc import Sequence
from typing import Any

import hydra
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.hydra import Hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override

from .hydra_session import hydra_errors


def compose(words: Sequence[str]) -> Any:
    """The configuration that words describe, where Hydra has been started. Raises Hydra's errors.

    Nearly all of Hydra's time goes into finding and merging the files of options (`variant=…`, `engine=…`). So what
    options give is kept, and all else (`day=2`) is set in a copy of it, by Hydra's own function.
    """
    session = GlobalHydra.instance().hydra
    with hydra_errors():
        parsed = OverridesParser.create().parse_overrides([*words])
        settings = [word for word in parsed if _is_setting(word)]
        options = tuple(str(word.input_line) for word in parsed if word not in settings)
        config = pickle.loads(_of_options(session, options))
        ConfigLoaderImpl._apply_overrides_to_config(settings, config)
    return config


@functools.lru_cache(maxsize=256)
def _of_options(session: Hydra, options: tuple[str, ...]) -> bytes:
    # A configuration is read from its bytes five times as fast as it is copied.
    return pickle.dumps(hydra.compose("config", overrides=[*options]))


def _is_setting(word: Override) -> bool:
    """Whether Hydra sets a word in what it has composed. Sweeps and what stands under `hydra.` it refuses before."""
    key = word.key_or_group
    if word.is_sweep_override() or key.replace("/", ".").partition(".")[0] == "hydra":
        return False
    loader: Any = GlobalHydra.instance().config_loader()
    return isinstance(word.value(), dict) or not loader.repository.group_exists(key)
