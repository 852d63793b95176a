"""Compiled functions, kept on disk for as long as nothing that they were compiled from has changed."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import caching, config

from .code_version import module_version, version
from .compile_notice import compiling

FunctionCache: Any = caching.FunctionCache
Index: Any = caching.IndexDataCacheFile
Function = TypeVar("Function", bound=Callable[..., Any])
FRAMEWORK = __name__.rpartition(".engine.")[0]
"""No compiled function calls what is there."""
CACHE_SETTINGS = ("CACHE_DIR", "CACHE_LOCATOR_CLASSES")
"""numba's settings of where it keeps machine code, which it unpickles."""


def compiled(**options: Any) -> Callable[[Function], Function]:
    """Compile a function as `numba.njit` with these options does, and keep the machine code on disk.

    With `cache=True` numba itself compiles again when the function's own file has changed, and its code holds that of
    the functions which it calls, and the constants that it reads. So here it is compiled again when any file has
    changed that its module imports of its own package, directly or not.
    """

    def decorated(function: Function) -> Function:
        dispatcher: Any = numba.njit(**options)(function)
        with suppress(RuntimeError):  # no folder can be written to: it is compiled in every process
            dispatcher._cache = CompiledCache(function)
        return dispatcher  # type: ignore[no-any-return]

    return decorated


class CompiledCache(FunctionCache):  # type: ignore[misc]
    """The machine code of one function, in the folder that numba chooses, whatever the working directory."""

    def __init__(self, function: Callable[..., Any]) -> None:
        with _settings_of_the_environment():
            super().__init__(function)
        stamp = (module_version(function.__module__, FRAMEWORK), np.__version__, version("llvmlite"))
        self._cache_file = Index(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Machine code that was kept for a signature; None where there is none, or it is damaged."""
        found = None
        try:
            found = super().load_overload(sig, target_context)
        except Exception:
            with suppress(OSError):
                self.flush()
        if found is None:
            compiling()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep it; where the disk is full it is compiled again the next time."""
        with suppress(OSError):
            super().save_overload(sig, data)


@contextmanager
def _settings_of_the_environment() -> Iterator[None]:
    """numba's `CACHE_SETTINGS` as environment variables have them: where somebody imported numba before omninav, it has
    read them from the working directory too."""
    before = {name: getattr(config, name) for name in CACHE_SETTINGS if hasattr(config, name)}
    vars(config).update({name: os.environ.get(f"NUMBA_{name}", "") for name in before})
    try:
        yield
    finally:
        vars(config).update(before)
