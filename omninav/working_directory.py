"""The working directory decides nothing: libraries that look for their settings there do not find them."""

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType

READERS = {
    "numba.core.config": (b"'.numba_config.yaml'", b"''"),
    "matplotlib": (b"yield 'matplotlibrc'", b"yield ''"),
    "cv2": (
        b" + ':' + os.environ.get('LD_LIBRARY_PATH', '')",
        b" + (os.environ.get('LD_LIBRARY_PATH') and ':' + os.environ['LD_LIBRARY_PATH'] or '')",
    ),
}
"""Module that reads the working directory, or (cv2) makes processes that are started later look for libraries there:
how its source says so, and what is put in its place."""
VARIABLES = ("SKIP_DEFAULT_XML", "SKIP_DEFAULT_XML_FILE")
"""Reports whether Fast DDS, below and from version 3, leaves XML profiles in the working directory unread."""


def ignore_working_directory() -> None:
    """Let the `READERS` and Fast DDS, if they are loaded from now on, read nothing there."""
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
    if libraries := os.environ.get("LD_LIBRARY_PATH"):  # an empty place in it is the working directory
        os.environ["LD_LIBRARY_PATH"] = ":".join(filter(None, libraries.split(":")))
    if not any(isinstance(finder, _Readers) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Readers())
    numba = sys.modules.get("numba.core.config")
    with suppress(AttributeError):  # loaded before us, it would look again whenever it compiles
        if set(numba._env_reloader.old_environ) <= set(os.environ):  # type: ignore[union-attr]
            numba._config_fname = ""  # type: ignore[union-attr]


class _Readers(MetaPathFinder):
    """Finds the modules in `READERS`, and nothing else."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Finds the module where Python would, with our loader."""
        spec = PathFinder.find_spec(fullname, path, target) if fullname in READERS else None
        if spec is None or not isinstance(spec.loader, SourceFileLoader):
            return None
        spec.loader = _Loader(fullname, spec.loader.path)
        return spec


class _Loader(SourceFileLoader):
    """Compiles a module's source with the file's name replaced; what is compiled in `__pycache__` still has it."""

    def get_code(self, fullname: str) -> CodeType:
        """The module's code."""
        path = self.get_filename(fullname)
        code: CodeType = self.source_to_code(self.get_data(path).replace(*READERS[fullname]), path)
        return code
