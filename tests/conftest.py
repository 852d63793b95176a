"""What several tests need: the command line, here or in its own process, and the built-in world's features once."""

import fcntl
import gc
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from background_runs import run_here
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]
RECORDINGS = ROOT / "tests" / "data"
"""Small recordings of a simulated home store, rendered by tests/data/make.py."""
TOUR, DRIVE, GRID = RECORDINGS / "tour.mcap", RECORDINGS / "drive.mcap", RECORDINGS / "map.yaml"
DATA = ROOT.parent / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.exists(), reason=f"third parties' recordings are not here: {DATA}")

settings.register_profile(
    "omninav", deadline=None, max_examples=40
)  # the first call of a compiled function takes what it takes
settings.load_profile("omninav")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # what one process compiles, those that tests start later read
gc.set_threshold(50_000)  # as in `omninav`: what pytest has imported is looked through less often


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whole runs first: where a long file is the last one, the other process has nothing to do."""
    items.sort(key=lambda item: item.path.relative_to(ROOT / "tests").parts[0] in ("pipeline", "stages"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `--dist loadfile` files go to processes whole, and those of `contract` to one: they compose the same."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    scheduler = LoadFileScheduling(config, log)
    of_file = scheduler._split_scope
    scheduler._split_scope = lambda id: "contract" if id.startswith("tests/contract/") else of_file(id)
    return scheduler


Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache folder that all tests of a session share, in whichever process they run, and none of another session."""
    place = tmp_path_factory.getbasetemp()
    return (place.parent if "PYTEST_XDIST_WORKER" in os.environ else place) / "omninav-cache"


@pytest.fixture
def omninav(tmp_path: Path) -> Command:
    """Runs `omninav …` in an empty folder and in this process, which has imported everything already."""

    def run(*words: str, check: bool = False) -> subprocess.CompletedProcess[str]:
        ended = run_here(tmp_path, *words)
        if check:
            assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended

    return run


@pytest.fixture
def omninav_process(tmp_path: Path) -> Command:
    """Runs `omninav …` in an empty folder and in a process of its own, where environment or imports are another's."""

    def run(*words: str, check: bool = False, **environment: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "omninav", *words]
        settings = {**os.environ, "COLUMNS": "120", **environment}
        ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=settings, timeout=600)
        if check:
            assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended

    return run


@pytest.fixture(scope="session")
def demo(shared_cache: Path) -> Path:
    """A finished run of the embedded default, made once for all tests."""
    place = shared_cache.parent / "omninav-demo"
    place.mkdir(exist_ok=True)
    with (place / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (place / "runs" / "latest" / "report.html").exists():
            command = [sys.executable, "-m", "omninav", f"cache={shared_cache}"]
            ended = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=600)
            assert ended.returncode == 0, ended.stdout + ended.stderr
    return place / "runs" / "latest"
