"""Compiled functions are kept on disk, and never older than what they were compiled from."""

import subprocess
import sys
from pathlib import Path

import pytest

FILES = {
    "pack/__init__.py": "",
    "pack/caller.py": """
from omninav.pipeline.engine.compiled import compiled
from .callee import tripled
from .constant import ADDED
from .made import made

@compiled(nogil=True)
def called(x):
    return tripled(x) + ADDED + made(x)
""",
    "pack/callee.py": """
from omninav.pipeline.engine.compiled import compiled

@compiled()
def tripled(x):
    return 3.0 * x
""",
    "pack/constant.py": "ADDED = 0.5\n",
    "pack/made.py": """
import numba

def factory(factor):
    @numba.njit
    def function(x):
        return factor * x
    return function

made = factory(0.0)
""",
}
RUN = """
from omninav.pipeline.engine.compile_notice import compile_notice
from pack.caller import called
told = []
with compile_notice(told.append):
    print(called(2.0), len(called.stats.cache_hits), len(called.stats.cache_misses), len(told))
"""


def run(place: Path) -> list[float]:
    """What the caller gives, and how often its code was found on disk and compiled."""
    environment = {"PYTHONPATH": f"{place}:{Path(__file__).resolve().parents[3]}", "PATH": "/usr/bin:/bin"}
    ended = subprocess.run(
        [sys.executable, "-c", RUN], env=environment, capture_output=True, text=True, check=True, cwd=place
    )
    return [float(number) for number in ended.stdout.split()]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_function_is_compiled_again_when_what_it_calls_or_reads_in_another_file_has_changed(package: Path) -> None:
    assert run(package) == [6.5, 0, 1, 1]  # the notice comes once, though two functions are compiled
    assert run(package) == [6.5, 1, 0, 0]
    for name, old, new, result in (
        ("callee", "3.0", "4.0", 8.5),
        ("constant", "0.5", "1.5", 9.5),
        ("made", "0.0", "1.0", 11.5),
    ):
        file = package / "pack" / f"{name}.py"
        file.write_text(file.read_text().replace(old, new))
        assert run(package)[:3] == [result, 0, 1], name


def test_code_that_is_damaged_on_disk_is_compiled_again(package: Path) -> None:
    run(package)
    for suffix in ("nbi", "nbc"):
        for file in (package / "pack" / "__pycache__").glob(f"caller*.{suffix}"):
            file.write_bytes(file.read_bytes()[:60])
        assert run(package) == [6.5, 0, 1, 1], suffix


def test_no_stage_leaves_its_code_to_numbas_own_cache() -> None:
    stages = Path(__file__).resolve().parents[3] / "stages"
    files = {file.name: file.read_text() for file in stages.rglob("*.py")}
    assert sum("@compiled(" in text for text in files.values()) > 30
    assert [name for name, text in files.items() if "njit(cache" in text or "jit(cache" in text] == []
