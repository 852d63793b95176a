"""The command line: what it prints, what it leaves, and its exit codes."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline.cli.commands.tool import tool_from
from omninav.pipeline.cli.config_groups import learnable
from omninav.pipeline.cli.main import COMMANDS, main
from omninav.pipeline.cli.tools import tool_class, tools
from omninav.pipeline.graph.parameters import read_parameters

ROOT = Path(__file__).resolve().parents[2]
HELP = (ROOT / "conf" / "help.txt").read_text(encoding="utf-8")
TOOLS = [f"{one} {other}" for one, other in re.findall(r"^  (camera|map) (\w+)", HELP, re.MULTILINE)]


@pytest.mark.parametrize("words", sorted({*COMMANDS, *learnable(), *tools()}))
def test_every_command_explains_itself(words, capsys):
    main([*words.split(), "--help"])
    told = capsys.readouterr().out
    assert told.startswith(f"omninav {words}")
    assert "{group" not in told
    arguments = read_parameters(tool_class(words)) if words in TOOLS else {}
    assert not [name for name in arguments if f"  {name}=" not in told]


def test_the_example_of_every_tool_fits_its_arguments():
    assert {*TOOLS, "data", "explain", "video", "simulate"} == {*tools()}
    for name in tools():
        tool_from(tool_class(name), tool_class(name).example.split())


def test_the_first_word_of_two_explains_all_that_it_begins(capsys):
    main(["map", "--help"])
    told = capsys.readouterr().out
    tools = [tool for tool in TOOLS if tool.startswith("map ")]
    assert len(tools) > 3
    assert all(f"omninav {tool} " in told for tool in tools)
    assert "omninav camera" not in told


def test_help_answers_and_hydras_own_flags_are_intact(omninav):
    assert "omninav resume runs/latest" in omninav("--help", check=True).stdout
    first, *_, live = (omninav(*words, "--help", check=True).stdout for words in ([], ["live"]))
    assert "transport=dds|rclpy|zenoh" in first
    assert all(name in live for name in ("dds", "rclpy", "zenoh"))
    shown = omninav("--cfg", "job", "--package", "wires.fusion", "match=l2", check=True).stdout
    assert "likelihood: sensor.likelihood" in shown
    assert "--multirun" in omninav("--hydra-help", check=True).stdout


@pytest.mark.parametrize("command", [(), ("check",)])
def test_every_problem_is_printed_with_suggestions_and_nothing_is_made(omninav, tmp_path: Path, command):
    wrong = ("+nodes.match.headngs=72", "wires.sensor.map=nowhere.map", "seed=-1")
    ended = omninav(*command, "variant=omniview_mcl", *wrong)
    assert ended.returncode == 2
    for said in (
        "3 problems",
        "did you mean 'nodes.match.headings'?",
        "this reads nowhere.map, and there is no node 'nowhere'",
        "artifacts.map",
    ):
        assert said in ended.stderr
    assert "Traceback" not in ended.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["check", "graph"])
def test_a_map_may_be_made_by_a_graph_of_ones_own(omninav, tmp_path: Path, command):
    (tmp_path / "mine" / "graph").mkdir(parents=True)
    own = (ROOT / "conf" / "graph" / "reference_map.yaml").read_text()
    (tmp_path / "mine" / "graph" / "own_map.yaml").write_text(own)
    words = (command, "--config-dir=mine", "variant=omniview_mcl", "artifacts.map.choices.graph=own_map")
    assert omninav(*words).returncode == 0
    assert "there is no 'own_mop'" in omninav(*words[:-1], "artifacts.map.choices.graph=own_mop").stderr


def test_check_says_who_reads_the_truth(omninav):
    said = omninav("check", "variant=omniview_mcl", check=True).stdout
    assert "nothing wrong" in said
    assert " before the first tick, " in said
    readers = said.partition("nodes that read ground truth: ")[2].strip().split(", ")
    drawn = ["frames_plot", "shown", "trajectory_plot"]  # over the built-in world's floor plan
    assert sorted(readers) == sorted(["drive", "prior (only with start=truth)", *drawn])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("variant=omniview_mcl", "log=drive.mcap"),
            "this variant needs a map, and none is given\n      type tour=… to make one, or map=FILE.omap to load one",
        ),
        (("tour=tour.mcap",), "tour is given, but no log\n      type log=…"),
        (("tour=tour.mcap", "map=m.omap", "log=d.mcap"), "leave one of them out"),
        (("match=null",), "'~nodes.match' '~wires.match'"),
        (("evaluation=null",), "to take it out, type '~evaluation'"),
        (("check", "tour=nowhere.mcap", "log=nowhere.mcap"), "nowhere.mcap"),
        (("stages", "matsch"), "did you mean 'omninav stages match'?"),
        (("stages", "l2"), "no role, stage or value 'l2'; did you mean 'omninav stages match.l2'?"),
        (("stages", "Particle"), "did you mean 'omninav stages values.belief.Particles'?"),
        (
            ("nodes.match.headngs=72",),
            "SelectiveMatch has no parameter 'headngs'\n      did you mean 'nodes.match.headi",
        ),
        (("nodes.mtch.headings=72",), "did you mean 'nodes.match.headings=72'?"),
        (("mach=l2",), "did you mean 'match=l2'?"),
        (("mach=l2", "hydra.run.dir=there"), "1 problem:"),
        (("match=l3",), "match: there is no 'l3'\n      did you mean 'match=l2'?"),
        (("tuor=x", "sead=3"), "did you mean 'seed=3'?"),
        (("-m", "match=selective,l3", "seed=range(50)"), "did you mean 'match=l2'?"),
        (("-m", "nodes.match.headngs=18,36"), "did you mean 'nodes.match.headings=18'?"),
        (("check", "nodes.source.stop=[1"), "nodes.source.stop=[1: cannot be read"),
        (("check", "~nodes.macth"), "did you mean '~nodes.match'?"),
        (("check", "+seed=3"), "it is there already\n      type seed=3"),
        (("check", "wires.sensor.mapp=artifacts.map"), "did you mean 'wires.sensor.map=artifacts.map'?"),
        (("check", "~nodes.length_scale"), "if the node was taken out, type '~wires.length_scale' too"),
        (("check", "~nodes.length_scale"), "type '~wires.sensor.length_scale' to leave this input out"),
        (("--config-dir=nowhere",), "there is no folder nowhere"),
        (("variant=wander", "log=d.mcap"), "wander does not take it\n      leave log=… out; its `inputs` are: camera"),
        (("variant=topological_nav",), "goal: topological_nav needs it: where to go"),
        (("+artifacts.map.set={rout: tour}",), "did you mean 'route'?"),
        (("+artifacts.map.inheritd=[unwarp]",), "ArtifactSpecification has no parameter 'inheritd'"),
    ],
)
def test_what_a_newcomer_gets_wrong_is_answered_with_what_to_type(omninav, tmp_path: Path, words, said: str):
    ended = omninav(*words)
    assert ended.returncode == 2
    assert said in ended.stderr
    assert "Traceback" not in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_parameter_that_the_configuration_does_not_list_is_set_like_any_other(omninav, monkeypatch):
    plugin = f"features.edges={ROOT / 'examples' / 'edges' / 'omninav_edges.py'}:EdgeHistogram"
    monkeypatch.setenv("OMNINAV_STAGES", plugin)
    omninav("check", "features=edges", "nodes.features.segments=18", check=True)
    ended = omninav("check", "features=edges", "nodes.features.segmnts=18")
    assert "did you mean 'nodes.features.segments=18'?" in ended.stderr


@pytest.mark.parametrize(
    ("words", "what", "type_"),
    [
        (("features=mean_rgb",), "made with HsvHistogram as 'features'", "type features=hsv_histogram"),
        (("nodes.features.segments=18",), "made with nodes.features.segments=36", "type nodes.features.segments=36"),
    ],
)
def test_a_map_of_other_features_is_refused_before_a_folder_is_made(
    omninav, demo: Path, tmp_path: Path, words, what: str, type_: str
):
    ended = omninav(f"map={demo / 'map.omap'}", *words)
    assert ended.returncode == 2
    assert what in ended.stderr
    assert type_ in ended.stderr
    assert list(tmp_path.iterdir()) == []
    drive = Path(__file__).resolve().parents[1] / "data" / "drive.mcap"
    ended = omninav("check", f"map={demo / 'map.omap'}", f"log={drive}", *words, "artifacts.map.must_match=[]")
    assert "learn the map again with these features" in ended.stderr


def test_stages_lists_roles_in_lines_and_one_stage_with_ports_parameters_and_source(omninav):
    lines = omninav("stages", "match", check=True).stdout.strip().split("\n")
    assert len(lines) > 5
    assert all(re.match(r"match\.\w+ +\S", line) for line in lines)
    assert re.search(r"^live\.publish +PublishBelief: \S", omninav("stages", "live", check=True).stdout, re.MULTILINE)
    selective = omninav("stages", "match.selective", check=True).stdout
    assert omninav("stages", "SelectiveMatch", check=True).stdout == selective
    for part in (
        "in   map: ReferenceGraph",
        "out  similarities: Similarities",
        "headings: int >= 1 = 36\n",
        "from Gross & Koenig 2004, section 2\n",
        "use  match=selective\n",
        "use  _target_: omninav.stages.match.selective.SelectiveMatch\n",
    ):
        assert part in selective, part
    for other, wanted in (
        ("metrics.map_size", []),
        ("sensor.landmark_pose", []),
        ("fusion.place_prior", ["prior=places"]),
    ):
        uses = re.findall("use  (.+)", omninav("stages", other, check=True).stdout)
        assert uses[:-1] == wanted
        assert uses[-1].startswith(f"_target_: omninav.stages.{other}.")
    assert "    field  values: an array of float64 >= 0" in omninav("stages", "Likelihood", check=True).stdout
    assert "    field  better: " in omninav("stages", "MetricSpec", check=True).stdout
    assert "camera.unified.Unified" in omninav("stages", "camera", check=True).stdout


def test_variants_and_doctor_answer(omninav):
    said = omninav("variants", check=True).stdout
    assert re.match(r"omninav +the default: ", said)
    assert "omniview_mcl " in said
    assert "Gross & Koenig 2004" in said
    assert "from packages and OMNINAV_STAGES, 0 unusable" in omninav("doctor", check=True).stdout


def test_a_word_that_doctor_does_not_read_and_a_report_of_nothing_say_what_to_type(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words, said in ((["doctor", "foo"], "type omninav doctor alone"), (["report"], "type omninav report FOLDER")):
        assert main(words) == 2
        assert said in capsys.readouterr().err


def test_graph_draws_the_graph_and_that_of_its_map(omninav, tmp_path: Path):
    said = omninav("graph", "variant=omniview_mcl", "out=drawn", check=True).stdout
    assert f"written to {tmp_path / 'drawn'}" in said
    names = {f"omniview_mcl{of}.{kind}" for of in ("", ".map", ".thumbnails") for kind in ("svg", "mmd")}
    assert {path.name for path in (tmp_path / "drawn").iterdir()} == names


LEFT = """
    .hydra .lock config.yaml foxglove_layout.json frames.csv frames.parquet graph.mmd graph.svg manifest.json map.omap
    metrics.json quantities.json report.html result.mcap run.log thumbnails.omap timing.json trajectory.tum
    trajectory_smoothed.tum truth.tum
"""
"""Files of a run that has ended."""


def test_the_embedded_default_localises_and_leaves_everything_a_run_should(demo: Path):
    assert {path.name for path in demo.iterdir()} == {*LEFT.split()}
    manifest = json.loads((demo / "manifest.json").read_text())
    assert manifest["status"] == "complete"
    assert manifest["facts"]["odometry"] == "measured"
    metrics = json.loads((demo / "metrics.json").read_text())
    assert metrics["frames"] == len((demo / "trajectory.tum").read_text().split("\n")) - 1
    after, alone = metrics["after_convergence"], metrics["odometry_alone"]
    for name in ("position_error_m", "heading_error_deg"):
        assert {*metrics[name]} == {*alone[name]} == {"mean", "median", "std", "p90", "max"}
    assert metrics["map"]["references"] > 50
    assert after["position_error_m"]["median"] < 0.35
    assert after["position_error_m"]["p90"] < alone["position_error_m"]["p90"]
    assert after["heading_error_deg"]["median"] < 5


def test_compare_and_report_print_tables(omninav, demo: Path, tmp_path: Path):
    said = omninav("compare", str(demo), str(demo), check=True).stdout
    assert "position error" in said.lower()
    assert "report.html" in omninav("report", str(demo), check=True).stdout
    explained = omninav("explain", str(demo), check=True)
    assert "Sure of the estimate" in explained.stdout
    assert "doing" not in explained.stderr
    assert 'id="confidence_over_time"' in (demo / "report.html").read_text()
    assert "What happened, stretch by stretch" in (demo / "report.html").read_text()
    assert omninav("compare", str(demo)).returncode == 2
    assert omninav("report", str(tmp_path)).returncode == 2
    assert "nowhere: there is no such folder" in omninav("compare", str(demo), "nowhere").stderr
    assert "several side by side: omninav compare" in omninav("report", str(demo), str(demo)).stderr
    for command, word in (("report", "lost_m=1"), ("resume", "seed=3")):
        assert "keeps its settings" in omninav(command, str(demo), word).stderr
    cut_off = shutil.copytree(demo, tmp_path / "cut_off")
    (cut_off / "config.yaml").write_text("")
    assert "cut_off/config.yaml: expected names and values" in omninav("compare", str(demo), str(cut_off)).stderr


def test_the_latest_runs_map_gives_the_same_run_as_its_tour_and_another_seed_another_run(
    omninav, demo: Path, tmp_path: Path
):
    latest = tmp_path / "runs" / "latest"
    latest.parent.mkdir()
    for seed, same in ((0, True), (1, False)):
        latest.unlink(missing_ok=True)
        latest.symlink_to(demo.resolve())
        omninav(f"seed={seed}", "map=runs/latest/map.omap", "nodes.source.stop=8", "cache=null", check=True)
        rows = (latest / "trajectory.tum").read_text().splitlines()
        assert latest.resolve() != demo.resolve()
        assert (rows == (demo / "trajectory.tum").read_text().splitlines()[:8]) is same
        assert (latest / "map.omap").read_bytes() == (demo / "map.omap").read_bytes()


def test_resume_of_what_is_no_run_or_has_ended_says_so(omninav, demo: Path):
    ended = omninav("resume", "nothing_here")
    assert ended.returncode == 2
    assert "not a run folder" in ended.stderr
    said = omninav("resume", str(demo), check=True).stdout
    assert "was complete" in said
    rows = [re.split("  +", line) for line in said.splitlines() if re.search("\\S  +\\S", line)]
    assert 6 <= len(rows) <= 10  # the figures that one looks for first, one line each
    assert dict(row[:2] for row in rows)["Converged"].split()[0] in ("at", "after")
    assert len({name for name, *_ in rows}) == len(rows)
    assert "report.html" in said


def test_the_trajectory_is_in_tum_format_with_ascending_header_stamps(demo: Path):
    rows = np.loadtxt(demo / "trajectory.tum")
    assert rows.shape[1] == 8
    assert np.all(np.diff(rows[:, 0]) > 0)
    assert np.allclose(np.linalg.norm(rows[:, 4:], axis=1), 1.0)
