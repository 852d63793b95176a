"""What a configuration, a folder and a word may and may not cause; see docs/security.md."""

import errno
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from conftest import DATA, DRIVE, ROOT, TOUR, needs_data

from omninav.pipeline.cli.main import main
from omninav.pipeline.files import write_json
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.recordings.opening import open_recording

LOGS = (f"tour={TOUR}", f"log={DRIVE}")
MARK = "open('EXECUTED', 'w')\n"
STAGE = """
from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.match.selective import SelectiveMatch

class Mine(SelectiveMatch):
    '''As the built-in one.'''
"""
HYDRA = {
    "hydra.callbacks": {"callbacks": {"x": {"_target_": "os.mknod", "path": "EXECUTED"}}},
    "hydra.job_logging": {"job_logging": {"version": 1, "handlers": {"x": {"()": "open", "file": "EXECUTED"}}}},
    "hydra.hydra_logging": {"hydra_logging": {"version": 1, "handlers": {"x": {"()": "os.mknod", "path": "EXECUTED"}}}},
    "hydra.job": {"job": {"env_set": {"LD_PRELOAD": "evil.so"}}},
    "hydra.launcher._target_": {"launcher": {"_target_": "os.mknod", "path": "EXECUTED"}},
    "hydra.launcher.x._target_": {"launcher": {"x": {"_target_": "os.mknod", "path": "EXECUTED"}}},
    "hydra.sweeper.custom_search_space": {"sweeper": {"custom_search_space": "os.mknod"}},
    "hydra.help": {"help": {"template": "x"}},
    "hydra.output_subdir": {"output_subdir": "/tmp/elsewhere"},
    "hydra.searchpath": {"searchpath": ["pkg://evil"]},
}


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def quoted(word: str) -> str:
    """A value of a word as Hydra reads it back."""
    return "'" + word.replace("'", "\\'") + "'"


def mine(hydra: dict[str, object]) -> None:
    """A folder of configurations `mine`, whose match=mine also sets something of Hydra's."""
    content = {"hydra": hydra, "nodes": {"match": {"_target_": "omninav.stages.match.selective.SelectiveMatch"}}}
    (Path("mine") / "match").mkdir(parents=True)
    Path("mine/match/mine.yaml").write_text("# @package _global_\n" + yaml.safe_dump(content))


@pytest.mark.parametrize(
    ("command", "where"),
    [(("check",), where) for where in HYDRA]
    + [(command, "hydra.callbacks") for command in (("graph",), ("simulate", "live=dds"), (), ("-m",))],
)
def test_what_a_configuration_says_of_hydra_is_refused_before_anything_is_called(
    command: tuple[str, ...], where: str, capsys: pytest.CaptureFixture[str]
) -> None:
    mine(HYDRA[where])
    assert main([*command, "--config-dir=mine", "match=mine"]) == 2
    said = capsys.readouterr().err
    assert "1 problem:" in said
    assert where.rpartition(".")[0] if where.endswith("_target_") else where in said
    assert [path.name for path in Path().iterdir()] == ["mine"]


@pytest.mark.parametrize(
    "words",
    [
        ("+hydra.callbacks.x._target_=os.mknod", "+hydra.callbacks.x.path=EXECUTED"),
        ("+hydra.job_logging.handlers={x: {'()': os.mknod, path: EXECUTED}}",),
        ("hydra/job_logging=default",),
        ("+hydra.job.env_set.LD_PRELOAD=evil.so",),
        ("hydra.job.env_copy=[NOT_SET]",),
        ("hydra/launcher=joblib", "+hydra.launcher.x._target_=os.mknod"),
        ("hydra.launcher._target_=os.mknod",),
        ("hydra.searchpath=[pkg://evil]",),
        ("hydra.verbose=true",),
        ("~hydra",),
        ("hydra=null",),
    ],
)
def test_words_that_change_hydra_are_refused(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", *words]) == 2
    assert main([*words]) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    "flag", ["--experimental-rerun=x", "--config-path=.", "--config-name=mine", "--shell-completion", "--nothing"]
)
def test_flags_that_are_not_ours_are_refused(flag: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([flag]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_launchers_and_sweepers_of_installed_packages_take_their_parameters() -> None:
    words = ("hydra/launcher=joblib", "hydra.launcher.n_jobs=2", "hydra.sweep.dir=there", "hydra.run.dir=there")
    assert main(["check", *words]) == 0


def hostile_folder() -> None:
    """A folder of data whose modules leave a file when they are imported."""
    Path("hydra_plugins/x").mkdir(parents=True)
    Path("hydra_plugins/x/__init__.py").write_text(MARK)
    for name in ("numpy", "yaml", "hydra", "cv2", "pickle", "omninav_x", "sitecustomize", "poselib", "joblib"):
        Path(f"{name}.py").write_text(MARK)


def test_python_m_omninav_runs_no_code_of_a_folder_of_data() -> None:
    hostile_folder()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for words in (["check"], ["stages", "match"]):
        command = [sys.executable, "-m", "omninav", *words]
        subprocess.run(command, check=True, capture_output=True, timeout=120, env=environment)
    assert not Path("EXECUTED").exists()


def test_a_stage_of_ones_own_is_found_here_and_the_path_is_as_before() -> None:
    Path("mine_here.py").write_text("import beside_mine\n" + STAGE)
    Path("beside_mine.py").write_text("")
    before = list(sys.path)
    assert main(["check", "nodes.match._target_=mine_here.Mine"]) == 0
    assert main(["check", "nodes.match._target_=mine_here.py:Mine"]) == 0
    assert sys.path == before


@pytest.mark.parametrize("target", ["evil_here.X", "evil_here.py:X", "antigravity.X", "omninav.stages.match/../x.py:X"])
def test_resume_runs_only_stages_that_are_listed_or_typed_again(
    target: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from omninav.pipeline.graph.registry import UnknownStage, only_listed, resolve

    Path("evil_here.py").write_text(MARK + STAGE)
    with only_listed(()), pytest.raises(BadInput, match="is not run unasked; if you trust it, name it"):
        resolve(target)
    assert not Path("EXECUTED").exists()
    with only_listed(()):
        assert resolve("omninav.stages.match.selective.SelectiveMatch").__name__ == "SelectiveMatch"
    with only_listed(["evil_here", "evil_here.py"]), pytest.raises((UnknownStage, BadInput)):
        resolve(target)
    assert Path("EXECUTED").exists() == target.startswith("evil_here")


def test_a_program_that_a_folder_names_is_run_only_where_it_is_typed_again(capsys: pytest.CaptureFixture[str]) -> None:
    program = f"{sys.executable} -c \"open('EXECUTED', 'w'); raise SystemExit('gave up')\""
    words = ["variant=peer", f"command={quoted(program)}", *LOGS, "nodes.source.stride=8", "plots=none"]
    assert main(words) == 2
    again = Path("runs/latest").resolve()
    for typed in ((), ("python",), (program,)):
        Path("EXECUTED").unlink()
        capsys.readouterr()
        assert main(["resume", str(again), *typed]) == 2
        assert Path("EXECUTED").exists() == (typed == (program,))
        said = capsys.readouterr().err
        assert ("gave up" if typed == (program,) else "is a program, and is not run unasked; if you trust it") in said
        Path("EXECUTED").touch()


def test_neither_an_experiments_folder_nor_a_report_runs_a_program_unasked(capsys: pytest.CaptureFixture[str]) -> None:
    program = f"{sys.executable} -c \"import sys; open('EXECUTED', 'w'); open(sys.argv[1] + '/poses.csv', 'w')\""
    words = [f"command={quoted(program)}", *LOGS, "nodes.source.stride=8", "cache=null"]
    Path("conf/experiment").mkdir(parents=True)
    experiment = {"name": "foreign", "title": "Foreign", "about": "Foreign.", "variant": "peer", "repetitions": 1}
    experiment |= {"sweep": {"images": {"few": "nodes.source.stride=8"}}, "page": {"rows": [], "columns": "images"}}
    experiment |= {"measures": {"median": {"title": "Error", "path": ["position_error_m.median"]}}}
    Path("conf/experiment/foreign.yaml").write_text("# @package experiment\n" + yaml.safe_dump(experiment))
    Path("there").mkdir()
    for start, said in (
        (["--config-dir=conf", "+experiment=foreign"], "is a program, and is not run unasked"),
        (["-m", "variant=peer"], "it is of a sweep, not of an experiment"),
    ):
        state = {"argv": ["omninav", *start, *words], "cwd": str(Path.cwd())}
        write_json(Path("there/experiment.json"), state)
        assert main(["resume", "there"]) != 0
        pages = [page.read_text() for page in Path().glob("runs/foreign_full/*.html")]
        assert said in "".join([capsys.readouterr().err, *pages])
        assert not Path("EXECUTED").exists()
    assert main(["variant=peer", *words, "plots=none"]) == 0
    Path("EXECUTED").unlink()
    assert main(["report", "runs/latest", "plots=few"]) == 2
    assert not Path("EXECUTED").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("seed=" + "9" * 5000,),
        ("a" * 20_000,),
        ("=" + "(" * 9000,),
        ("seed=${oc.decode:" + "[" * 500 + "}",),
        ("log=\0",),
        ("log=\udcff",),
        ("log=${log}",),
        ("log=" + "x" * 5000,),
        ("--config-dir", "x" * 300),
        ("+" + ".".join("a" * 500) + "=1",),
        ("lost_m=nan",),
        ("checkpoint_s=nan",),
        ("seed=1e400",),
        ("start=[1e400,0,0,1,1]",),
        ("start=[1,2,90,1,1]",),
        ("kidnappings=[{at: 1e308, turn: 1e308}]",),
        ("'log=\"~nobody_of_that_name/x.mcap\"'",),
        ("log=/dev/zero",),
        ("-m", "seed=range(1000000000000)"),
        ("-m", "seed=range(1000)", "day=range(1000)"),
        ("-m", "seed=range(0,1,0)"),
        ("runs=/proc/nowhere",),
        ("cache=/dev/null/x",),
    ],
    ids=lambda words: " ".join(words)[:30].encode("ascii", "replace").decode(),
)
def test_hostile_words_are_refused_in_a_few_short_lines(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    began = time.process_time()
    assert main([*(() if "-m" in words else ("check",)), *words]) == 2
    said = capsys.readouterr().err
    assert len(said) < 3000
    assert len(said.splitlines()) < 8
    assert time.process_time() - began < 5  # on a busy machine; less than one on a quiet one
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.ENOSPC, "No space left on device; free some space"),
        (errno.EROFS, "Read-only file system; nothing can be written there; name another place, of a run: runs=FOLDER"),
        (errno.EACCES, "Permission denied; it cannot be read or written by you"),
    ],
)
def test_a_folder_that_cannot_be_used_is_one_line(
    number: int, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number), "runs/here")

    monkeypatch.setattr("omninav.pipeline.cli.commands.doctor.entries", refuse)
    assert main(["doctor"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"runs/here: {said}")
    assert "resume" not in line


def test_a_working_directory_that_is_gone_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("gone").mkdir()
    monkeypatch.chdir("gone")
    Path("../gone").rmdir()
    assert main(["check"]) == 2
    assert capsys.readouterr().err == "the folder that you are in is gone; change to another: cd FOLDER\n"


def test_a_run_where_nothing_can_be_written_is_one_line_without_a_pointer_to_a_log(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("a_file").touch()
    assert main(["runs=a_file/runs", "cache=null"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "a_file" in line
    assert "run.log" not in line


def test_files_in_a_folder_of_configurations_are_read_within_limits(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine/match").mkdir(parents=True)
    target = "_target_: omninav.stages.match.selective.SelectiveMatch\n"
    for name, content in {
        "bomb": "a: &a [x,x,x,x,x,x,x,x,x]\n"
        + "".join(f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)),
        "digits": f"{target}headings: {'9' * 5000}\n",
        "tag": f"{target}headings: !!python/object/apply:os.mknod [EXECUTED]\n",
        "list": "- 1\n",
        "nul": "a: \0\n",
    }.items():
        Path(f"mine/match/{name}.yaml").write_text(content)
        assert main(["check", "--config-dir=mine", f"match={name}"]) == 2
        said = capsys.readouterr().err
        assert f"mine/match/{name}.yaml" in said
        assert len(said.splitlines()) == 1
    os.mkfifo("mine/match/pipe.yaml")
    assert main(["check", "--config-dir=mine", "match=pipe"]) == 2
    assert not Path("EXECUTED").exists()


@needs_data
def test_the_shared_examples_are_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hostile = DATA / "hostile"
    assert main(["check", f"--config-dir={hostile / 'config_with_callback'}", "match=mine"]) == 2
    capsys.readouterr()
    cameras = {file.name: [f"camera={file}"] for file in hostile.glob("camera_*.yaml")}
    grids = {f"{file.name}/map.yaml": ["variant=retrieval_mcl", f"grid={file}"] for file in hostile.glob("grid_*")}
    for name, words in (cameras | grids).items():
        assert main(["check", f"log={DRIVE}", f"tour={DRIVE}", *words]) == 2
        said = capsys.readouterr().err
        assert name in said
        assert len(said.splitlines()) == 1
    for layout in sorted(hostile.glob("layout_*.yaml")):
        with pytest.raises(BadInput, match=rf"{layout.name}: frames\."):
            open_recording(f"{layout}:{hostile}")
    for table in sorted(hostile.glob("csv_*.csv")):
        folder = tmp_path / table.stem
        folder.mkdir()
        shutil.copy(table, folder)
        with pytest.raises(BadInput, match=rf"{table.name}, line \d+: "):
            open_recording(f"antworld:{folder}")
        shutil.rmtree(folder)
    assert not list(tmp_path.iterdir())


def test_a_link_to_itself_in_place_of_a_run_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    Path("runs").mkdir()
    Path("runs/latest").symlink_to("latest")
    assert main(["resume", "runs/latest"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert main(["check", "map=runs/latest", "log=drive.mcap"]) == 2
    assert "map: runs/latest: there is no such file" in capsys.readouterr().err


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_where_output_is_closed_nothing_is_said(monkeypatch: pytest.MonkeyPatch, closed: str) -> None:
    monkeypatch.setattr(sys, closed, None)
    assert main(["stages"]) == 0
