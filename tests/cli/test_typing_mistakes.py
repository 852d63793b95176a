"""Command lines as newcomers mistype them: one line each, which says what to type."""

from pathlib import Path

import pytest
from conftest import DRIVE, TOUR

from omninav.pipeline.cli.main import main


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(list(words)) == 2, words
    err = capsys.readouterr().err
    assert "Traceback" not in err
    return "\n".join(line for line in err.splitlines() if not line.startswith("{"))


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["log", "=", "a.mcap"], "no spaces around =: type log=a.mcap"),
        (["log=", "a.mcap"], "no spaces around =: type log=a.mcap"),
        (["check", "log", "=a.mcap"], "=a.mcap: there is no name before =: type log=a.mcap"),
        (["=x"], "=x: there is no name before =: type name=x"),
        (["+=x"], "+=x: there is no name behind +: type +name=value"),
        (["++=x"], "++=x: there is no name behind ++: type ++name=value"),
        (["~"], "~: there is no name behind ~: type ~name=value"),
        (["a+=b"], "a+=b: cannot be read\n      write name=value"),
        (
            ["log=ümlaut.mcap"],
            "log=ümlaut.mcap: cannot be read\n      write quotes within quotes: \"log='ümlaut.mcap'\"",
        ),
        (["\u2013help"], "\u2013help: this begins with a typographic dash; type --help"),
        (["check", "\u2014config-dir", "my"], "type --config-dir"),
        (["log=\u201ca.mcap\u201d"], "these are typographic quotes; type ' or \" in their place"),
        (["check", "seed\u00a0=1"], "a space in it is a no-break space; type it again"),
        (["--log", "a.mcap"], "--log: there is no such flag; settings have no dashes: type log=…"),
        (["check", "--log=a.mcap"], "--log=a.mcap: there is no such flag; settings have no dashes: type log=a.mcap"),
        (["check", "-help"], "a short flag is a single letter; did you mean --help?"),
        (["check", "speed=0,5"], "speed: '0,5' are several values\n      type 'speed=[0,5]' for a list, or"),
        (["check", "speed=0,5"], "for a run with each; decimal fractions have a point: 0.5"),
        (["check", "variant=omniviewmcl"], "did you mean 'variant=omniview_mcl'? (one of "),
        (["check", "varient=omniview_mcl"], "did you mean 'variant=omniview_mcl'? (one of "),
        (["stages", "matsh.selective"], "did you mean 'omninav stages match.selective'? (one of "),
        (["check", "--hepl"], "--hepl: there is no such flag; did you mean --help?"),
        (["report", "--config-dri", "my"], "--config-dri: there is no such flag; did you mean --config-dir?"),
        (["stagse"], "did you mean 'omninav stages'? commands: camera, check, compare,"),
        (["stagse"], "report, resume, simulate, stages, variants"),
        (["mapp"], "did you mean 'omninav map'?"),
        (["cammera", "look"], "did you mean 'omninav camera'?"),
        (["log=a.mcap", "log=b.mcap"], "log: a.mcap and b.mcap are typed; leave one of them out (both, where it takes"),
        (["variant=omninav", "variant=wander"], "variant: omninav and wander are typed; leave one of them out"),
        (["check", "+seeed=0"], "seeed: there is no such setting\n      did you mean 'seed'?"),
        (["check", "+nodes.x=[1,2]"], "nodes.x: a node needs `_target_`\n      type ++nodes.x._target_="),
        (["check", "+nodes.ü=5"], "cannot be read\n      names before = are written in a to z"),
        (["check", "log=${nix}"], "log: Interpolation key 'nix' not found"),
        (["check", "artifacts.map.inherit=[3]"], "1 problem:\n  artifacts.map.inherit[0]: 3 (int)"),
        (["check", "features=onnx", "model=3"], "type 'nodes.features.model=\"3\"' for a text"),
        (["-m", "hydra/launcher=nix", "seed=0,1"], "hydra/launcher: there is no 'nix'\n      options: basic, "),
        (["check", "nodes=abc"], "nodes: expected a mapping, found 'abc'"),
        (["check", "seed=0,1"], "type 'seed=[0,1]' for a list, or omninav -m seed=0,1 … for a run with each"),
        (["check", "seed=range(3)"], "seed: 'range(3)' are several values\n      type omninav -m seed=range(3) …"),
        (["log=nothere.mcap"], "  nothere.mcap: no such file"),
        (["check", "log=nothere.mcap"], "  map: this variant needs a map, and none is given"),
        (["check", "log="], "  log: nothing follows the =\n      name it, as log=FILE, or leave log= out"),
        (["check", "map= "], "  map: nothing follows the ="),
        (["log=~/nothere.mcap"], f"  {Path.home()}/nothere.mcap: no such file"),
        ([str(DRIVE)], f"a file or folder is typed behind the setting that reads it: log={DRIVE}"),
        (["check", "variant=omninav match=l2"], "quotes hold several words together: type each by itself"),
        (["check variant=omninav"], "quotes hold several words together: type each by itself"),
        (["map", "show", str(DRIVE.parent)], f"{DRIVE.parent}: this is a folder, expected a file"),
        (["resume", str(DRIVE)], f"{DRIVE}: not a run folder"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_mistyped_word_is_named_with_what_to_type(
    words: list[str], wanted: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert wanted in said(capsys, *words)


def test_a_folder_that_is_not_there_is_not_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drives").mkdir()
    assert "nothere: not a run folder" in said(capsys, "resume", "nothere")
    assert "is typed behind the setting that reads it: omninav log=drives" in said(capsys, "drives")
    assert [path.name for path in tmp_path.iterdir()] == ["drives"]


def test_a_stage_is_named_as_it_is_typed_for_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stages", "match=l2"]) == 0
    assert "use  match=l2" in capsys.readouterr().out


def test_a_file_may_be_called_by_odd_characters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    name = "\u201ctour\u201d 9\u202fPM.mcap"
    (tmp_path / name).symlink_to(TOUR)
    assert main(["check", f"tour='{name}'", f"log={DRIVE}"]) == 0, capsys.readouterr().err


@pytest.fixture
def folder(tmp_path: Path) -> str:
    """A folder of `--config-dir` with a variant of somebody's own."""
    (tmp_path / "my/variant").mkdir(parents=True)
    (tmp_path / "my/variant/mine.yaml").write_text(
        "# @package _global_\n# somebody's own.  omninav variant=mine\n"
        "defaults: [plain_matching, _self_]\nvariant: mine\n"
    )
    return str(tmp_path / "my")


def test_config_dir_stands_before_or_behind_every_command(
    folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = ["variant=mine", f"tour={TOUR}", f"log={DRIVE}"]
    drawn = ["graph", *run, f"out={tmp_path}"]
    for words in (["check", *run], drawn, ["stages", "match.l2"], ["variants", "mine"], ["doctor"]):
        for line in (["--config-dir", folder, *words], [*words, f"--config-dir={folder}"]):
            assert main(line) == 0, capsys.readouterr().err
    out = capsys.readouterr().out
    assert out.count("mine: nothing wrong with it") == 2
    assert out.count("somebody's own.") == 2
    assert (tmp_path / "mine.svg").is_file()
    assert main(["variants", "--config-dir", folder]) == 0
    listed = capsys.readouterr().out
    assert "\nmine " in listed
    assert "\nomniview_mcl " in listed


def test_ones_own_file_with_the_name_of_a_built_in_one_is_refused(folder: str, capsys) -> None:
    own = Path(folder) / "variant" / "omniview_mcl.yaml"
    own.write_text("# @package _global_\ndefaults: [plain_matching, _self_]\nvariant: omniview_mcl\n")
    assert f"{own}: omninav has a file of this name" in said(capsys, "check", f"--config-dir={folder}", "variant=mine")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("defaults: [mine]", "variant mine: its files include each other"),
        ("defaults: plain_matching", "mine.yaml: expected names and values"),
        ("inputs: [log]", "mine.yaml: expected names and values"),
        ("- 1", "mine.yaml: expected names and values"),
    ],
)
def test_an_own_variant_whose_inputs_cannot_be_read_is_refused(
    folder: str, text: str, problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (Path(folder) / "variant/mine.yaml").write_text(text)
    assert main(["variants", "--config-dir", folder]) == 2
    assert problem in capsys.readouterr().err


def test_own_options_that_include_each_other_and_a_folder_of_runs_are_named(folder: str, capsys) -> None:
    for name, other in (("one", "two"), ("two", "one")):
        (Path(folder) / f"variant/{name}.yaml").write_text(f"# @package _global_\ndefaults: [{other}]\n")
    told = said(capsys, "check", f"--config-dir={folder}", "variant=one")
    assert "files of options include each other in their defaults" in told
    (Path(folder) / "0").mkdir()
    (Path(folder) / "0/manifest.json").write_text("{}")
    assert f"continue a sweep by its own command: omninav -m … hydra.sweep.dir={folder}" in said(
        capsys, "resume", folder
    )


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    from importlib.metadata import version

    import omninav

    assert omninav.__version__ == version("omninav")
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"omninav {omninav.__version__}\n"
