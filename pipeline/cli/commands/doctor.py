"""`omninav doctor`: versions, plugins, and what may be missing."""

import os
import platform
from pathlib import Path

from omninav.pipeline.engine.code_version import LIBRARIES, version
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.registry import entries


def command(arguments: list[str]) -> int:
    """Print what is installed, and which plugins cannot be used (then 1)."""
    if arguments:
        raise BadInput(f"doctor: '{arguments[0]:.60}' is not read; type omninav doctor alone")
    print(f"omninav {version('omninav')}, Python {platform.python_version()}, {os.cpu_count()} cores")
    rows = list(entries())
    for name in LIBRARIES:
        print(f"  {name:26} {version(name)}")
    broken = [entry for entry in rows if entry.problem]
    others = [entry for entry in rows if entry.origin != "built in" and not entry.problem]
    own = f"{len(rows) - len(others) - len(broken)} built-in stages"
    print(f"{own}, {len(others)} from packages and OMNINAV_STAGES, {len(broken)} unusable")
    for entry in broken:
        print(f"  {entry.name} [{entry.origin}]: {entry.problem}")
    writable = "" if os.access(".", os.W_OK) else ", which cannot be written: change to another folder"
    print(f"results go to {Path('runs').resolve()}{writable}")
    return 1 if broken else 0
