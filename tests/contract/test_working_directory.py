"""A folder of data decides nothing: no library reads its settings, and none runs its code."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import DATA, DRIVE, ROOT, TOUR, needs_data
from contract.watched_folder import watched

MARK = "open(r'{folder}/EXECUTED', 'w')\n"
MODULES = """
    numpy scipy yaml hydra cv2 pickle sitecustomize usercustomize poselib joblib config logging struct resource mcap
    rosbags conftest evil pyarrow pandas PIL
"""
"""Modules that are imported somewhere, or that settings name."""
SHARED_LIBRARIES = """
    libz.so libm.so libtbb.so libsvml.so libddsc.so libfaiss.so
    libz.so.1 libm.so.6 libc.so.6 libtbb.so.12 libgomp.so.1 libddsc.so.11
"""
ROS2_PYTHON = Path(os.environ.get("OMNINAV_ROS2_PYTHON", ROOT / ".venv-ros2/bin/python"))


def hostile(folder: Path) -> list[str]:
    """Lay into a folder all that some library or program would read there, and say what lies there then."""
    numba = "cache_dir: nb\ndisable_jit: 1\nnum_threads: 0\ncache_locator_classes: evil.Locator\n"
    files = {
        ".numba_config.yaml": numba,
        "matplotlibrc": "backend: module://evil\ntext.usetex: True\nanimation.ffmpeg_path: ./evil\n",
        "DEFAULT_FASTRTPS_PROFILES.xml": "<dds><profiles/></dds>",
        "DEFAULT_FASTDDS_PROFILES.xml": "<dds><profiles/></dds>",
        "cyclonedds.xml": "<Domain><Tracing><OutputFile>EXECUTED</OutputFile></Tracing></Domain>",
        "zenoh.json5": "{plugins_loading: {enabled: true, search_dirs: ['.']}}",
        "dask.yaml": "distributed: {nanny: {preload: [evil]}, worker: {preload: [evil]}}",
        ".config/dask/dask.yaml": "distributed: {nanny: {preload: [evil]}, worker: {preload: [evil]}}",
        ".env": "OMNINAV_STAGES=features.x=evil.py:X\n",
        ".git/config": "[core]\n\trepositoryformatversion = 0\n\tfsmonitor = touch {folder}/EXECUTED; false\n",
        ".git/HEAD": "ref: refs/heads/main\n",
        ".git/objects/info/packs": "",
        ".git/refs/heads/main": "0" * 40 + "\n",
        ".gitattributes": "* filter=x\n",
        "config.yaml": "hydra: {callbacks: {x: {_target_: os.mknod, path: EXECUTED}}}\n",
        "conf/config.yaml": "hydra: {callbacks: {x: {_target_: os.mknod, path: EXECUTED}}}\n",
        "hydra_plugins/x/__init__.py": MARK,
        "pyvenv.cfg": "home = .\n",
        "pyproject.toml": "[tool.numba]\n",
        "setup.cfg": "[numba]\n",
        ".netrc": "",
        "fonts.conf": "",
        "optuna.db": "",
        "x86_64/libz.so.1": "",
        **dict.fromkeys(SHARED_LIBRARIES.split(), ""),
        **{f"{name}.py": MARK for name in MODULES.split()},
    }
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content.replace("{folder}", str(folder)))
    (folder / "nb").mkdir()
    (folder / "matplotlibrc").write_bytes(b"\xff\xfe" + (folder / "matplotlibrc").read_bytes())
    return sorted(path.name for path in folder.iterdir())


def python(folder: Path, *words: str, program: str = sys.executable, **environment: str) -> str:
    """What Python prints in a folder, where it ends well."""
    settings = {**os.environ, "COLUMNS": "120", **environment}
    ended = subprocess.run(
        [program, "-P", *words], cwd=folder, capture_output=True, text=True, env=settings, timeout=300
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


@pytest.mark.parametrize("more", [(), ("-m", "seed=0", "executor=local", "executor.workers=1")], ids=["run", "sweep"])
def test_a_run_reads_nothing_of_the_folder_that_it_is_started_in(tmp_path: Path, more: tuple[str, ...]) -> None:
    before = hostile(tmp_path)
    with watched(tmp_path) as seen:
        python(tmp_path, "-m", "omninav", "variant=omniview_mcl", f"log={DRIVE}", f"tour={TOUR}", *more)
    assert seen == {"runs"}
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*before, "runs"])


LIBRARIES = """
    numba matplotlib.pyplot cv2 scipy networkx poselib rosbags.highlevel mcap pyarrow rich pandas onnxruntime faiss
    joblib optuna dask distributed dask_jobqueue zenoh foxglove
"""


def test_no_library_reads_the_folder_or_sends_later_processes_there(tmp_path: Path) -> None:
    hostile(tmp_path)
    there = [name for name in LIBRARIES.split() if importlib.util.find_spec(name.partition(".")[0])]
    program = f"import importlib, omninav, subprocess, sys\nfor name in {there}: importlib.import_module(name)\n"
    program += "subprocess.run([sys.executable, '-P', '-c', 'import numpy'], check=True)\n"
    if importlib.util.find_spec("cyclonedds"):
        program += "from omninav.stages.live.dds_transport import open_transport\nopen_transport(97).close()\n"
    with watched(tmp_path) as seen:
        python(tmp_path, "-c", program)
    assert seen == set()


@pytest.mark.skipif(not ROS2_PYTHON.exists(), reason="no rclpy: OMNINAV_ROS2_PYTHON names no Python that has it")
def test_fast_dds_reads_no_profiles_of_the_folder(tmp_path: Path) -> None:
    hostile(tmp_path)
    program = f"import sys; sys.path.append({str(ROOT)!r}); import omninav, rclpy; c = rclpy.Context(); "
    program += "rclpy.init(context=c, domain_id=96); rclpy.create_node('x', context=c)"
    with watched(tmp_path) as seen:
        python(tmp_path, "-c", program, program=str(ROS2_PYTHON))
    assert seen == set()


@needs_data
@pytest.mark.parametrize("name", ["folder_with_numba_config", "folder_with_numba_config_binary"])
def test_where_numba_came_first_its_settings_there_move_no_cache_of_ours(tmp_path: Path, name: str) -> None:
    (tmp_path / ".numba_config.yaml").write_bytes((DATA / "hostile/new" / name / ".numba_config.yaml").read_bytes())
    kept = (
        "import omninav; from omninav.stages.geometry.probability.particles import {0} as f; print(f._cache.cache_path)"
    )
    from omninav.stages.geometry.probability import particles

    function = next(key for key, value in vars(particles).items() if hasattr(value, "_cache"))
    words = [f"import numba; {kept.format(function)}"] if name == "folder_with_numba_config" else []
    for program in [*words, kept.format(function)]:
        folder = python(tmp_path, "-c", program).strip()
        assert not Path(tmp_path, folder).is_relative_to(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [".numba_config.yaml"]


def test_what_numba_has_read_before_stays_and_later_folders_are_not_read(tmp_path: Path) -> None:
    program = (
        "import numba, os, omninav; from numba.core import config; open('.numba_config.yaml', 'w').write('{}'); "
        "config.reload_config(); print(config.DISABLE_JIT)"
    )
    assert python(tmp_path, "-c", program.format("disable_jit: 1")).strip() == "0"


def test_the_version_is_of_omninavs_own_checkout_and_no_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from omninav.pipeline.engine import code_version

    for command in (
        ["init", "-q"],
        ["-c", "user.name=x", "-c", "user.email=x", "commit", "-q", "--allow-empty", "-mx"],
        ["config", "core.fsmonitor", f"touch {tmp_path}/EXECUTED; false"],
    ):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    site = tmp_path / "venv/site-packages/omninav/pipeline/run"
    site.mkdir(parents=True)
    monkeypatch.setattr(code_version, "__file__", str(site / "code_version.py"))
    assert code_version.git_commit() is None
    assert not (tmp_path / "EXECUTED").exists()


def test_a_number_of_threads_with_which_numba_cannot_be_imported_is_left_out() -> None:
    words = [sys.executable, "-c", "import omninav.pipeline.engine.compiled"]
    for number in ("0", "-1"):
        ended = subprocess.run(words, env={**os.environ, "NUMBA_NUM_THREADS": number}, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stderr
