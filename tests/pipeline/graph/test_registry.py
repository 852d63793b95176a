"""Finding stages: built in, installed, from the environment, by path; and plugins that are broken."""

import importlib
from pathlib import Path

import pytest

import toys
from omninav.pipeline import Context
from omninav.pipeline.engine.code_version import module_version
from omninav.pipeline.graph import registry
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.registry import (
    UnknownStage,
    entries,
    is_listed,
    only_listed,
    plugins,
    refuse_untyped,
    resolve,
)

STAGE = """
from omninav.pipeline import Context, Outputs, Stage
from toys import Number

class Twice(Stage):
    '''Twice a number.'''

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(number=Number(2 * number.value))
"""


@pytest.fixture
def stage_file(tmp_path: Path) -> Path:
    path = tmp_path / "twice.py"
    path.write_text(STAGE)
    return path


def test_a_stage_is_found_by_its_full_name_and_by_file(stage_file: Path):
    assert resolve("toys.Scale") is toys.Scale
    assert resolve("toys:Scale") is toys.Scale
    assert resolve(f"{stage_file}:Twice").__doc__ == "Twice a number."


def test_a_file_that_has_changed_is_loaded_anew_and_its_stages_have_the_version_that_was_loaded(stage_file: Path):
    first = resolve(f"{stage_file}:Twice")
    stage_file.write_text(STAGE.replace("2 * number", "3 * number"))  # of the same size, in the same second
    assert module_version(first.__module__) != module_version(resolve(f"{stage_file}:Twice").__module__)
    second = resolve(f"{stage_file}:Twice")()
    assert [stage.step(Context("twice"), toys.Number(1.0)).number.value for stage in (first(), second)] == [2.0, 3.0]


def test_the_files_that_a_path_parameter_names_are_inputs_of_a_stage(tmp_path: Path):
    class Weighted(toys.Scale):
        weights: Path = tmp_path / "weights"

    assert Weighted().inputs_digest() is None  # there is no such file
    digests = set()
    for text in ("1", "2"):
        (tmp_path / "weights").write_text(text)
        digests.add(Weighted().inputs_digest())
    assert len(digests - {None}) == 2


def test_the_environment_offers_a_stage_by_name(stage_file: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OMNINAV_STAGES", f"match.twice={stage_file}:Twice, match.scale=toys:Scale")
    assert resolve("match.twice").__name__ == "Twice"
    mine = [entry for entry in entries() if entry.origin == "environment"]
    assert [(e.name, e.role, e.summary) for e in mine] == [
        ("match.twice", "match", "Twice a number."),
        ("match.scale", "match", "A number times a factor."),
    ]


def test_an_installed_package_offers_a_stage_by_entry_point(stage_file: Path, monkeypatch: pytest.MonkeyPatch):
    install(stage_file.parent, "twice", "match.twice = twice:Twice", monkeypatch)
    assert ("match.twice", "installed") in [(e.name, e.origin) for e in plugins()]
    assert resolve("match.twice").__name__ == "Twice"


def install(folder: Path, package: str, points: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a distribution with these entry points on the path."""
    info = folder / f"{package}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[omninav.stages]\n{points}\n")
    monkeypatch.syspath_prepend(str(folder))
    importlib.invalidate_caches()


def test_entry_points_of_one_name_or_without_a_role_are_problems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for package, points in (("one", "match.twice = toys:Scale\nlone = toys:Scale"), ("two", "match.twice = toys:Add")):
        install(tmp_path, package, points, monkeypatch)
    said = {entry.name: entry.problem for entry in plugins() if entry.origin == "installed"}
    assert "offered by several packages (toys:Add and toys:Scale)" in said["match.twice"]
    assert "must name it role.name, as in match.lone" in said["lone"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("import not_there_at_all\n", "ModuleNotFoundError: No module named 'not_there_at_all'"),
        ("raise SystemExit(3)\n", "SystemExit: 3"),
        ("class Twice: pass\n", "is not a Stage"),
        ("from toys import Scale\nclass Twice(Scale):\n    def step(self, ctx, a): pass\n", "'a' has no type"),
        ("", "has no 'Twice'; its stages: none"),
    ],
)
def test_a_broken_plugin_is_a_row_with_its_problem_and_the_others_stay(
    content: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "broken.py").write_text(content)
    monkeypatch.setenv("OMNINAV_STAGES", f"match.broken={tmp_path}/broken.py:Twice,match.scale=toys:Scale")
    rows = {entry.name: entry for entry in entries() if entry.origin == "environment"}
    assert said in rows["match.broken"].problem
    assert rows["match.scale"].problem == ""


def test_a_plugin_of_the_name_of_a_built_in_stage_is_a_problem(stage_file: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OMNINAV_STAGES", f"match.l2={stage_file}:Twice")
    assert "'match.l2' is of omninav itself" in next(entry for entry in plugins() if entry.name == "match.l2").problem


def test_two_files_of_one_name_are_a_problem(stage_file: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OMNINAV_STAGES", f"match.twice={stage_file}:Twice,match.twice=toys:Scale")
    first, second = plugins()
    assert f"'match.twice' is {stage_file}:Twice and toys:Scale in OMNINAV_STAGES; leave all but" in first.problem
    assert f"'match.twice' is toys:Scale and {stage_file}:Twice" in second.problem


def test_an_entry_that_is_not_understood_says_what_to_write_and_a_missing_file_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.setenv("OMNINAV_STAGES", "my_stage.py, lone=toys:Scale, match.a=toys.Scale, match.scale=toys:Scale")
    *wrong, right = plugins()
    assert [entry.name for entry in wrong] == ["my_stage.py", "lone=toys:Scale", "match.a=toys.Scale"]
    assert all("write role.name=package.module:Class" in entry.problem for entry in wrong)
    assert (right.name, right.target, right.problem) == ("match.scale", "toys:Scale", "")
    (tmp_path / "copied.py").write_text("from .reference_match import ReferenceMatch\n")
    with pytest.raises(UnknownStage, match=r"outside of omninav write absolute imports, as `from omninav\.stages\."):
        resolve(f"{tmp_path / 'copied.py'}:Copied")
    with pytest.raises(UnknownStage, match=r"there is no file .*nothing\.py"):
        resolve("nothing.py:Twice")


def test_stages_of_a_role_are_those_of_its_files_and_those_that_others_offer(monkeypatch: pytest.MonkeyPatch):
    found = registry.built_in_stage("match", "l2")
    assert (found.name, found.role, found.origin) == ("match.l2", "match", "built in")
    assert found in [*registry.of_role("match")]
    others = ("match.reference_match", "match.none", "none.l2")
    assert not any(registry.built_in_stage(*name.split(".")) for name in others)
    assert [registry.is_role(name) for name in ("match", "none", "no/role")] == [True, False, False]
    monkeypatch.setenv("OMNINAV_STAGES", "match.scale=toys:Scale,values.whole=toys:Whole")
    offered = [(each.name, each.summary) for role in ("values", "match") for each in registry.offered(role)]
    assert offered == [("values.whole", "A Number of a narrower kind."), ("match.scale", "A number times a factor.")]


def test_what_a_folder_names_is_run_where_it_is_listed_or_typed(stage_file: Path, monkeypatch: pytest.MonkeyPatch):
    target = f"{stage_file}:Twice"
    with only_listed(["notes.txt", "./record.sh"]):
        refuse_untyped("./record.sh")
        for wrong, again in ((lambda: refuse_untyped("rm -r"), "'rm -r'$"), (lambda: resolve(target), stage_file)):
            with pytest.raises(BadInput, match=f"is not run unasked; if you trust it, .*FOLDER {again}"):
                wrong()
        monkeypatch.setenv("OMNINAV_STAGES", f"match.twice={target}")
        listed = (target, "match.twice", "omninav.stages.match.l2.L2", "match.thrice", "omninav.stages.x y.Z")
        assert [*map(is_listed, listed)] == [True] * 3 + [False] * 2
        assert resolve(target).__name__ == "Twice"
    monkeypatch.delenv("OMNINAV_STAGES")
    with only_listed([str(stage_file)]):
        assert resolve(target).__name__ == "Twice"
    with pytest.raises(BadInput, match="a run that was started keeps its settings"), only_listed(["+nodes.x.gain=1"]):
        pass
    refuse_untyped("rm -r")  # of one's own configuration
