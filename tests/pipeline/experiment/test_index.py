"""The table of finished experiments says what their verdict files say, and no more."""

import json
import re
import shutil
from pathlib import Path

import pytest
from offenders import assert_each

from omninav.pipeline.cli.main import main
from omninav.pipeline.experiment.index import BEGIN, END, index_table, page_of, read_verdicts, verdict_files
from omninav.pipeline.experiment.verdicts import Case, Verdict, in_words
from omninav.pipeline.graph.problems import BadInput

PAGES = Path(__file__).resolve().parents[3] / "docs" / "experiments"
COMMIT = r"commit [0-9a-f]{12}( with changes that are not committed)?"
MADE = re.compile(
    rf"(Made with omninav [\w.]+, {COMMIT}|The commit at which this page was made is not recorded: [^\n]+)\.\n"
    rf"(\nJudged again with omninav [\w.]+, {COMMIT}: [^\n]+\.\n)?\Z"
)


def verdict(*cases: tuple[bool | None, int]) -> Verdict:
    plain = (
        Case("", 1.0, 2.0, "the limit", -1.0, (-1.5, -0.5), holds, many, many, False, many) for holds, many in cases
    )
    return Verdict("it holds", "error", "", tuple(plain))


def test_the_committed_tables_are_what_the_command_writes(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(PAGES, tmp_path / "pages", ignore=shutil.ignore_patterns("*.png")))
    papers = Path(shutil.copy(PAGES.parent / "papers.md", tmp_path))
    before = {path: path.read_text() for path in [papers, *folder.iterdir()]}
    assert main(["experiments", str(folder)]) == 0
    after = {path: path.read_text().replace("](pages/", "](experiments/") for path in [papers, *folder.iterdir()]}
    assert after == before
    assert index_table(PAGES) in (PAGES / "README.md").read_text()


def test_a_page_says_what_its_verdict_file_does_and_which_commit_made_it() -> None:
    assert_each(verdict_files(PAGES), says_what_its_verdicts_do)


def says_what_its_verdicts_do(path: Path) -> None:
    page, verdicts = page_of(path).read_text(), read_verdicts(path)
    said = re.findall(r"\| (holds|does not hold|undecided) \|\n", page)
    assert said == [in_words(case.holds) for verdict in verdicts for case in verdict.cases]
    for verdict in verdicts:
        assert f"\n| {verdict.claim} ({verdict.measure}): **{in_words(verdict.holds)}** |" in page
    assert MADE.search(page)


def test_the_table_says_over_how_many_scenarios_claims_were_judged(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text(f"# Ours\n\n{BEGIN}\nformer\n{END}\n\nwhat follows\n")
    (tmp_path / "one.md").write_text("# One\n\nAbout it.\n\n```\nomninav +experiment=one\n```\n")
    judged = verdict((None, 3), (True, 6))
    (tmp_path / "one.verdicts.json").write_text(json.dumps([judged.plain()]))
    assert main(["experiments", str(tmp_path)]) == 0
    row = "| [One](one.md) | `omninav +experiment=one` | 6 | **undecided** |  | it holds |\n"
    readme = (tmp_path / "README.md").read_text()
    assert readme.endswith(f"{row}{END}\n\nwhat follows\n")
    assert "former" not in readme


def test_what_is_no_page_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readme, verdicts = tmp_path / "README.md", tmp_path / "one.verdicts.json"
    for prepare, message in (
        (lambda: None, "README.md: No such file"),
        (lambda: readme.write_text("# Ours\n"), "needs a line"),
        (lambda: readme.write_text(f"{BEGIN}\n{END}\n"), "no page is in it"),
        (lambda: verdicts.write_text('[{"claim": 1}]'), "no list of verdicts"),
        (lambda: verdicts.write_text("[]"), "one.md: No such file"),
    ):
        prepare()
        assert main(["experiments", str(tmp_path)]) == 2
        said = capsys.readouterr().err
        assert message in said
        assert said.count("\n") == 1
    with pytest.raises(BadInput, match="name the folder"):
        __import__("omninav.pipeline.cli.commands.experiments", fromlist=["command"]).command([])
