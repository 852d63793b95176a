"""The results in docs/experiments belong to the experiments' files as they are now, and are told whole on the pages."""

import re
from pathlib import Path

import pytest

from omninav.pipeline.cli.composed_experiments import judged_experiments
from omninav.pipeline.experiment.page import markdown_page
from omninav.pipeline.experiment.pages import Judged, by_chance, claims_of, sources
from omninav.pipeline.experiment.verdicts import Verdict

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "experiments"
MADE = re.compile(r"Made with omninav [\w.]+, commit [0-9a-f]{12}( with changes that are not committed)?")


@pytest.fixture(scope="module")
def committed() -> Judged:
    return judged_experiments(RESULTS)


def test_the_claims_say_how_many_verdicts_chance_would_give(committed: Judged) -> None:
    claims = [found for source in sources(committed) for found in claims_of(committed, source)]
    cases = [len(verdict.cases) for *_, verdict in claims]
    assert f"The {len(claims)} verdicts have {sum(cases)} cases" in by_chance(committed)
    assert f"some {sum(1.0 - 0.975**number for number in cases):.0f} that do not hold" in by_chance(committed)


def test_every_committed_result_judges_the_claims_of_its_file_and_shows_its_conditions(committed: Judged) -> None:
    for experiment, result in committed:
        assert set(result.verdicts) == set(experiment.claims), experiment.name
        assert set(result.cells) == set(experiment.measures), experiment.name
        shown = {
            (*(condition.labels[row] for row in experiment.page.rows), condition.labels[experiment.page.columns])
            for condition in experiment.conditions()
        }
        for measure, cells in result.cells.items():
            assert {cell.at for cell in cells if cell.figure is not None} <= shown, (experiment.name, measure)
            assert shown <= {cell.at for cell in cells}, (experiment.name, measure)
        assert MADE.fullmatch(result.made_with), experiment.name


def test_a_page_says_what_its_result_file_does(committed: Judged) -> None:
    for experiment, result in committed:
        page = str(markdown_page(experiment, result, ())[f"{experiment.name}.md"])
        said = re.findall(r"\| (holds(?: in \d+ of \d+ runs)?|does not hold|undecided) \|\n", page)
        assert said == [Verdict((each,)).words for key in experiment.claims for each in result.verdicts[key]]
        for key, verdict in result.judged(experiment).items():
            assert f"\n| {experiment.claims[key].statement} (" in page
            assert f"): **{verdict.words}** |" in page


def test_the_five_papers_have_claims_and_a_page_each(committed: Judged) -> None:
    pages = {page: page.read_text() for page in RESULTS.glob("*.md")}
    assert len(sources(committed)) == 5
    for source in sources(committed):
        assert len(list(claims_of(committed, source))) > 15
        (page,) = (text for text in pages.values() if f"{{{{ claims {source} }}}}" in text)
        assert len(re.findall(r"^\{\{ (?:table|plot) ", page, re.MULTILINE)) == 2
