"""The list of what papers claim says what verdict files say, and names nothing that they do not have."""

import json
from pathlib import Path

import pytest

from omninav.pipeline.cli.main import main
from omninav.pipeline.experiment import claims, index
from omninav.pipeline.experiment.verdicts import Case, Verdict

GOOD = "experiment: one, statement: it holds"
UNRUN = ("experiment: one, statement: it will", "experiment: two, statement: it holds")


def verdict(statement: str, *cases: tuple[str, bool | None, float]) -> Verdict:
    plain = (
        Case(where, ours, 9.0, "the limit", ours - 9.0, (-1.0, 1.5), holds, 7, 7, scenarios=7)
        for where, holds, ours in cases
    )
    return Verdict(statement, "Error (cm)", "", tuple(plain))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one page, two of whose claims read alike, and the page that the list goes into."""
    pages = tmp_path / "pages"
    pages.mkdir()
    (tmp_path / "papers.md").write_text(f"# Papers\n\n{claims.BEGIN}\nformer\n{claims.END}\n\nafter\n")
    (pages / "README.md").write_text(f"# Ours\n\n{index.BEGIN}\n{index.END}\n")
    (pages / "one.md").write_text("# One\n\nAbout it.\n\n```\nomninav +experiment=one\n```\n")
    found = [
        verdict("it holds", ("first, 60", True, 3.0), ("second, 60", False, 1234.5)),
        verdict("… too", ("first, 60", True, 4.25)),
        verdict("… too", ("second, 60", None, 5.25)),
    ]
    (pages / "one.verdicts.json").write_text(json.dumps([each.plain() for each in found]))
    return pages


def written(folder: Path, *listed: str) -> int:
    """What the command returns where these claims are listed of one paper."""
    lines = [f"  - {{claim: they say so, where: Table 1, {each}}}" for each in listed]
    text = "\n".join(["page: ../papers.md", "papers:", " A paper 2004:", *lines])
    (folder / "claims.yaml").write_text(f"{text}\n")
    return main(["experiments", str(folder)])


def test_each_claim_stands_with_its_verdict_and_figure(folder: Path) -> None:
    listed = [GOOD, f"{GOOD}, case: second", "experiment: one, statement: … too, case: 'second, 60'"]
    assert written(folder, *listed, "needs: two of them", "not_here: no third", *UNRUN) == 0
    text = (folder.parent / "papers.md").read_text()
    link = "| they say so | Table 1 | [one](pages/one.md)"
    for row in (
        f"{link}: it holds | does not hold | Error (cm): 3 to 1234; 1 of 2 cases hold |",
        f"{link}: it holds (second) | does not hold | Error (cm): 1234, beside 9 (the limit), difference -1 to 1.50 |",
        f"{link}: … too (second, 60) | undecided | Error (cm): 5.25, beside 9 (the limit), difference -1 to 1.50 |",
        "| they say so | Table 1 | needs two of them | no experiment |  |",
        "| they say so | Table 1 | no third | not testable here |  |",
        "| they say so | Table 1 | one: it will | not run yet |  |",
        "| they say so | Table 1 | two: it holds | not run yet |  |",
        "7 claims: 5 have an experiment (holds: 0; does not hold: 2; undecided: 1; not run yet: 2), 1 have none and 1 ",
        "### A paper 2004\n",
    ):
        assert row in text
    assert "former" not in text
    assert text.endswith(f"{claims.END}\n\nafter\n")


@pytest.mark.parametrize(
    ("ours", "shown"),
    [(0.125, "0.12"), (9.96, "9.96"), (10.06, "10.1"), (99.46, "99.5"), (100.4, "100"), (-12.5, "-12.5")],
)
def test_figures_have_three_digits_or_four(folder: Path, ours: float, shown: str) -> None:
    (folder / "one.verdicts.json").write_text(json.dumps([verdict("it holds", ("first", True, ours)).plain()]))
    assert written(folder, GOOD) == 0
    assert f"| holds | Error (cm): {shown}, beside 9 (the limit)" in (folder.parent / "papers.md").read_text()


def test_every_fault_of_a_paper_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert written(folder, "experiment: one", GOOD, f"{GOOD}, case: third") == 2
    message = capsys.readouterr().err
    assert "A paper 2004[0]" in message
    assert "A paper 2004[2]" in message


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (f"{GOOD}, case: third", "there is no 'third' cases of 'it holds': first, 60, second, 60"),
        ("experiment: one, statement: … too", "2 claims of one read '… too' name a case: first, 60, second, 60"),
        (f"{GOOD}, needs: more", "expected one of: experiment with statement, needs, not_here"),
        ("experiment: one", "expected one of: experiment with statement, needs, not_here"),
        ("verdict: holds", "no parameter 'verdict'"),
    ],
)
def test_what_no_verdict_file_has_is_named_with_what_there_is_and_nothing_is_written(
    folder: Path, capsys: pytest.CaptureFixture[str], wrong: str, said: str
) -> None:
    before = (folder.parent / "papers.md").read_text()
    assert written(folder, GOOD, wrong) == 2
    message = " ".join(capsys.readouterr().err.split())
    assert "claims.yaml" in message
    assert "A paper 2004[1]" in message
    assert said in message
    assert (folder.parent / "papers.md").read_text() == before
