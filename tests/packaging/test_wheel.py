"""The wheel and the sdist: what they hold, and that an installed wheel runs away from the checkout."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("omninav", "hydra_plugins", "pipeline", "stages", "conf", "pyproject.toml", "README.md", "LICENSE")
BACKEND = tuple(map(int, importlib.metadata.version("setuptools").split(".")[:2]))
pytestmark = pytest.mark.skipif(BACKEND < (77, 0), reason="setuptools is older than 77: pip install -e '.[dev]'")
UNUSED = shutil.ignore_patterns("__pycache__", "*.egg-info")


def call(*words: str | Path, cwd: Path, **environment: str) -> str:
    ended = subprocess.run(
        list(map(str, words)), cwd=cwd, capture_output=True, text=True, timeout=600, env={**os.environ, **environment}
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def build(kind: str, source: Path, place: Path) -> Path:
    """A wheel or an sdist by the backend that pyproject.toml names, without a network."""
    place.mkdir(exist_ok=True)
    code = f"import sys; from setuptools import build_meta; build_meta.build_{kind}(sys.argv[1])"
    call(sys.executable, "-c", code, place, cwd=source, PYTHONPATH="")
    (built,) = place.iterdir()
    return built


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what the packages are built from, links as links, and a test."""
    place = tmp_path_factory.mktemp("checkout")
    for name in NAMES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, place / name, symlinks=True, ignore=UNUSED)
        else:
            shutil.copy(ROOT / name, place)
    (place / "tests").mkdir()
    shutil.copy(__file__, place / "tests")
    return place


@pytest.fixture(scope="module")
def sdist(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("sdist", checkout, tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="module")
def wheel(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", checkout, tmp_path_factory.mktemp("wheel"))


def content(wheel: Path) -> dict[str, int]:
    """What a wheel installs, by name, with its checksum."""
    with zipfile.ZipFile(wheel) as archive:
        return {member.filename: member.CRC for member in archive.infolist() if ".dist-info/" not in member.filename}


def test_the_wheel_holds_every_module_every_option_and_the_templates_and_no_test(wheel: Path):
    kinds = {
        "pipeline": ("*.py", "py.typed", "templates/*"),
        "stages": ("*.py", "py.typed", "*.json"),
        "conf": ("*.py", "*.yaml", "*.txt"),
    }
    expected = {
        f"omninav/{path.relative_to(ROOT)}"
        for folder, patterns in kinds.items()
        for pattern in patterns
        for path in (ROOT / folder).rglob(pattern)
    }
    assert "omninav/conf/config.yaml" in expected
    assert set(content(wheel)) == expected | {
        f"omninav/{name}" for name in ("__init__.py", "__main__.py", "testing.py", "working_directory.py", "py.typed")
    } | {"hydra_plugins/omninav_launcher.py"}


def test_the_sdist_builds_the_same_wheel(wheel: Path, sdist: Path, tmp_path: Path):
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    assert content(build("wheel", source, tmp_path / "wheel")) == content(wheel)


def test_an_installed_wheel_makes_a_map_and_localises_in_it_in_an_empty_folder(wheel: Path, tmp_path: Path):
    """In an environment of its own, into which only the dependencies of this one are linked: it compiles anew."""
    venv.create(tmp_path / "environment", with_pip=False)
    (tmp_path / "empty").mkdir()
    (installed,) = (tmp_path / "environment").glob("lib/python*/site-packages")
    offline = ("--no-deps", "--no-index", "--no-compile")
    call(sys.executable, "-m", "pip", "install", "-q", *offline, "--target", installed, wheel, cwd=tmp_path)
    dependencies = Path(importlib.metadata.distribution("numpy").locate_file(""))
    (installed / "dependencies.pth").write_text(f"{dependencies}\n")
    python, empty = tmp_path / "environment" / "bin" / "python", tmp_path / "empty"
    where = call(python, "-c", "import omninav; print(omninav.__file__)", cwd=empty, PYTHONPATH="").strip()
    assert Path(where).is_relative_to(installed)
    logs = (f"{word}={ROOT / 'tests' / 'data' / file}.mcap" for word, file in (("tour", "tour"), ("log", "drive")))
    words = ("variant=plain_matching", *logs, "nodes.source.stop=5")
    call(python, "-m", "omninav", *words, cwd=empty, PYTHONPATH="")
    assert (empty / "runs" / "latest" / "report.html").exists()
    assert [path.name for path in empty.iterdir()] == ["runs"]
