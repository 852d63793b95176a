"""Pages of experiments say what their result files say, and no more."""

import json
from pathlib import Path
from typing import Any

import pytest

from omninav.pipeline.cli.main import main
from omninav.pipeline.experiment.page import markdown_page
from omninav.pipeline.experiment.pages import Judged, by_chance, claims_page, counts, index_page
from omninav.pipeline.experiment.result import Cell, ExperimentResult, result_text
from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.experiment.verdicts import Case
from omninav.pipeline.graph.problems import BadInput

RESULTS = Path(__file__).resolve().parents[3] / "docs" / "experiments"
CLAIM = {"statement": "it holds", "measure": "error", "at_most": 9.0}
WHOLE = CLAIM | {"paper": "they say so", "where": "Table 1"}
FILE = {
    "name": "one",
    "title": "One",
    "source": "A paper 2004",
    "about": "About it.",
    "variant": "none",
    "sweep": {"day": {"first": "", "second": ""}},
    "measures": {"error": {"title": "Error (cm)", "path": ["error"]}},
    "page": {"rows": [], "columns": "day"},
    "claims": {
        "whole": WHOLE,
        "part": CLAIM | {"statement": "… too", "paper": "as printed: so", "where": "section 2", "quote": "so it is"},
        "ours": CLAIM | {"statement": "so we think", "quote": "not said"},
        "unrun": CLAIM | {"paper": "it will", "where": "section 3"},
    },
}


REPEATED = "3 repetitions of each condition with seeds 0 to 2, 1 in each of 3 scenarios (draw 1, draw 2, draw 3)"


def case(where: str, holds: bool | None, ours: float, scenarios: int = 7) -> Case:
    return Case(where, ours, 9.0, "the limit", ours - 9.0, (-1.0, 1.5), holds, 7, 7, scenarios=scenarios)


def judged(**verdicts: tuple[Case, ...]) -> Judged:
    result = ExperimentResult("one", "omninav +experiment=one", "full", "", REPEATED, verdicts, {})
    return [(read_experiment(FILE, "full"), result)]


def test_each_claim_of_a_paper_stands_with_its_place_verdict_and_figure() -> None:
    found = judged(
        whole=(case("first", True, 3.0), case("second", False, 1234.5)),
        part=(case("second", None, 5.25),),
        ours=(case("first", True, 1.0),),
    )
    link = "[One](one.md)"
    text = claims_page(found)
    assert f"| they say so | Table 1 | {link}: it holds | does not hold | Error (cm): 3 to 1234; 1 of 2 cases" in text
    shown = "Error (cm): 5.25, beside 9 (the limit), difference -1 to 1.50"
    assert f"| as printed: so | section 2 | {link}: … too | undecided | {shown} |" in text
    assert counts(found, "A paper 2004") == "Of 2 claims of this paper 0 hold, 1 do not, and 1 are undecided."
    assert "so we think" not in text  # no paper says it
    assert "it will" not in text  # no result judges it
    page = str(markdown_page(*found[0], ())["one.md"])
    assert "| … too (Error (cm)): **undecided** | as printed: so (section 2): “so it is” | second | 5.2 |" in page
    assert "| so we think (Error (cm)): **holds** | not said | first | 1.0 |" in page


@pytest.mark.parametrize(
    "changed",
    [
        {"variant": "one_as_printed"},
        {"common": "variant=one_as_printed", "variant": "other"},
        {"sweep": {"day": {"first": "variant=one_as_printed", "second": "variant=one_as_printed"}}},
        {"sweep": {"day": {"as printed": ""}}, "claims": {"whole": WHOLE | {"of": {"day": "as printed"}}}},
    ],
)
def test_a_claim_counts_as_printed_by_the_system_that_was_measured(changed: dict[str, Any]) -> None:
    ((_, result),) = judged(whole=(case("", True, 3.0),))
    found = [(read_experiment(FILE | changed, "full"), result), *judged(whole=(case("", None, 3.0),))]
    assert "; of 1 as printed 1 hold, 0 do not, and 0 are undecided." in counts(found, "A paper 2004")
    assert counts(found[:1], "A paper 2004").endswith(" undecided; all are of the system as printed.")


def test_chance_follows_from_the_cases_of_each_claim() -> None:
    many = tuple(case(str(number), True, 3.0) for number in range(60))
    assert "2 verdicts have 61 cases" in by_chance(judged(whole=many, part=(case("", True, 3.0),)))
    assert "at most some 1 that do not hold, and some 0 that do" in by_chance(judged(whole=many))


@pytest.mark.parametrize(
    ("ours", "shown"),
    [(0.125, "0.12"), (9.96, "9.96"), (10.06, "10.1"), (99.46, "99.5"), (100.4, "100"), (-12.5, "-12.5")],
)
def test_figures_have_three_digits_or_four(ours: float, shown: str) -> None:
    assert f"| holds | Error (cm): {shown}, beside 9 (the limit)" in claims_page(judged(whole=(case("", True, ours),)))


def test_the_index_and_the_page_say_of_which_draws_a_result_is() -> None:
    found = judged(whole=(case("", None, 1.0, 3), case("", True, 1.0, 6)), ours=(case("", True, 1.0),))
    assert (
        "| [One](one.md) | `omninav +experiment=one` | draw 1 to 3 | **1 of 2 hold, 1 undecided** |  | it holds |"
        in index_page(found)
    )
    assert "1 in each of 3 scenarios (draw 1, draw 2, draw 3)" in str(markdown_page(*found[0], ())["one.md"])


def test_a_table_shows_means_with_what_is_beyond_them_and_the_paper_s_figures() -> None:
    cells = (Cell(("first",), 5.26, 0.5, 6.0, 2, 3, 4.0), Cell(("second",), 7.0, None, 7.04, 3, 3))
    result = ExperimentResult("one", "omninav", "full", "", REPEATED, {}, {"error": cells})
    page = str(
        markdown_page(read_experiment(FILE | {"published": {"error": {"first": 9}}}, "full"), result, ())["one.md"]
    )
    assert "| all | 5.3 ± 0.5, median 6.0, 2 of 3, development 4.0 (9.0) | 7.0 |" in page


def test_a_struck_claim_counts_no_more_and_is_named_with_its_reason() -> None:
    claims = {**FILE["claims"], "part": {**FILE["claims"]["part"], "struck": "the limit is ours"}}
    (_, result), *_ = judged(whole=(case("", True, 3.0),), part=(case("", False, 5.25),))
    found = [(read_experiment(FILE | {"claims": claims}, "full"), result)]
    assert counts(found, "A paper 2004") == "Of 1 claims of this paper 1 hold, 0 do not, and 0 are undecided."
    assert "* as printed: so ([One](one.md)): the limit is ours" in claims_page(found)
    assert "(section 2): “so it is” Struck: the limit is ours." in str(markdown_page(*found[0], ())["one.md"])


def test_the_command_writes_pages_plots_index_and_claims(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results, built = tmp_path / "results", tmp_path / "deep/pages"
    results.mkdir()
    name = "omniview_mcl_timing"
    (results / f"{name}.result.json").write_bytes((RESULTS / f"{name}.result.json").read_bytes())
    assert main(["experiments", str(results), str(built)]) == 0
    assert f"index: {built / 'results.md'}\nclaims: {built / 'claims.md'}\n" in capsys.readouterr().out
    assert {path.name for path in built.iterdir()} == {"results.md", "claims.md", f"{name}.md", f"{name}.png"}
    assert f"({name}.md)" in (built / "results.md").read_text()
    assert f"]({name}.png)" in (built / f"{name}.md").read_text()


def test_what_is_no_result_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "one.result.json"
    ((_, result),) = judged(whole=(case("", True, 1.0),))
    plain = json.loads(result_text(result))
    for content, message in (
        (None, "no result is in it"),
        ("nothing", "is no result of an experiment"),
        ('{"name": "one"}', "verdicts: missing"),
        (json.dumps(plain), "there is no 'one'"),
        (json.dumps(plain | {"command": "omninav match=l2"}), "is not of the experiment 'one'"),
        (json.dumps(plain | {"command": "omninav +experiment=light/lamps"}), "is not of the experiment 'one'"),
    ):
        if content is not None:
            file.write_text(content)
        assert main(["experiments", str(tmp_path), str(tmp_path / "pages")]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "pages").exists()
    with pytest.raises(BadInput, match="name the folder with results, and one for the pages"):
        __import__("omninav.pipeline.cli.commands.experiments", fromlist=["command"]).command([str(tmp_path)])
