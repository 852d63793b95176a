"""With what a run was made: versions of libraries, and the commit of omninav itself."""

import importlib.metadata
import subprocess
from pathlib import Path

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "numba", "networkx", "hydra-core", "mcap", "rosbags")


def version(distribution: str) -> str:
    """The installed version of a distribution, or that there is none."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def git_commit() -> str | None:
    """The commit of omninav's own checkout, with a mark where files differ from it; None where there is none."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=40"]
    here = Path(__file__).resolve().parent
    try:
        ended = subprocess.run(command, cwd=here, capture_output=True, text=True, timeout=5)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return ended.stdout.strip() or None if ended.returncode == 0 else None
