"""With what a run was made: the commit of omninav itself. Versions of libraries are in `engine/code_version.py`."""

import subprocess
from pathlib import Path


def git_commit() -> str | None:
    """The commit of omninav's own checkout, with a mark where files differ from it; None where there is none."""
    here = Path(__file__).resolve().parents[2]
    own = ["--git-dir", str(here / ".git"), "--work-tree", str(here)]  # no other's, whose settings name programs
    command = ["git", *own, "describe", "--always", "--dirty", "--abbrev=40"]
    try:
        ended = subprocess.run(command, cwd=here, capture_output=True, encoding="utf-8", errors="replace", timeout=5)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return ended.stdout.strip() or None if ended.returncode == 0 else None
