"""The list of papers' claims: beside each the experiment that judges it, with its verdict and figure."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.problems import Problem, ProblemsFound, suggest
from omninav.pipeline.graph.small_files import read_yaml

from .page import number
from .verdicts import Verdict, in_words

CLAIMS = "claims.yaml"
"""The list's name, in the folder of the pages."""
BEGIN, END = "<!-- claims: omninav experiments -->", "<!-- end of the claims -->"
HEAD = ("claim", "where", "experiment", "verdict", "ours")
UNRUN, UNJUDGED, NOT_HERE = "not run yet", "no experiment", "not testable here"


@dataclass(frozen=True)
class ListedClaim:
    """A paper's statement, and one of three: which verdict judges it, what an experiment needs, why none can be."""

    claim: str
    """The paper's statement in our words, with its figure."""
    where: str
    """Place in the paper: section, figure, table, equation."""
    experiment: str = ""
    """The page that judges it, without `.md`."""
    statement: str = ""
    """The page's claim that does, as its verdict file has it, or will have it once it is run."""
    case: str = ""
    """Labels of the cases that count (`second, 60`), as the file has them; '' where all do."""
    needs: str = ""
    """Missing part of an experiment of it; there is none yet."""
    not_here: str = ""
    """Why no experiment of ours can judge it."""


@dataclass(frozen=True)
class ClaimList:
    """Content of `claims.yaml`."""

    page: str
    """The page that the tables are written into, from the list's folder."""
    papers: Mapping[str, tuple[ListedClaim, ...]]
    """Paper -> its claims, in the paper's order."""


def claim_tables(path: Path, found: Mapping[str, Sequence[Verdict]]) -> tuple[Path, str]:
    """The page that a list goes into, and its Markdown: how many claims there are of each kind, a table for each paper.

    `found`: page -> its verdicts. A page or a statement that no verdict file has is not run yet. Raises BadInput where
    the list cannot be read, ProblemsFound with all that is wrong in it: a case that the verdict does not have too.
    """
    listed, problems = convert(read_yaml(path), ClaimList, str(path))
    if problems:
        raise ProblemsFound(problems)
    page = Path(os.path.normpath(path.parent / listed.page))
    away = os.path.relpath(path.parent, page.parent)
    blocks, verdicts = [], []
    for paper, claims in listed.papers.items():
        lines = [f"### {paper}", "", f"| {' | '.join(HEAD)} |", f"|{'---|' * len(HEAD)}"]
        for index, claim in enumerate(claims):
            try:
                cells = _cells(claim, found, away, f"{path}: {paper}[{index}]")
            except ProblemsFound as error:
                problems += error.problems
                continue
            escaped = (" ".join(cell.split()).replace("|", r"\|") for cell in cells)
            lines.append(f"| {' | '.join(escaped)} |")
            verdicts.append(cells[3])
        blocks.append("\n".join(lines))
    if problems:
        raise ProblemsFound(problems)
    return page, "\n\n".join([_counts(verdicts), *blocks]) + "\n"


def _cells(claim: ListedClaim, found: Mapping[str, Sequence[Verdict]], away: str, where: str) -> tuple[str, ...]:
    """A claim's row, in the order of `HEAD`."""
    given = [claim.experiment, claim.needs, claim.not_here]
    if sum(map(bool, given)) != 1 or bool(claim.experiment) != bool(claim.statement):
        raise ProblemsFound([Problem(where, "expected one of: experiment with statement, needs, not_here")])
    if not claim.experiment:
        told = f"needs {claim.needs}" if claim.needs else claim.not_here
        return claim.claim, claim.where, told, UNJUDGED if claim.needs else NOT_HERE, ""
    verdict = _judged(claim, found, where)
    if verdict is None:
        return claim.claim, claim.where, f"{claim.experiment}: {claim.statement}", UNRUN, ""
    case = f" ({claim.case})" if claim.case else ""
    link = f"[{claim.experiment}]({away}/{claim.experiment}.md): {verdict.claim}{case}"
    return claim.claim, claim.where, link, in_words(verdict.holds), _ours(verdict)


def _judged(claim: ListedClaim, found: Mapping[str, Sequence[Verdict]], where: str) -> Verdict | None:
    """The verdict that a claim names, with the cases that it names; None where there is none yet."""
    verdicts = [verdict for verdict in found.get(claim.experiment, ()) if verdict.claim == claim.statement]
    if not verdicts:
        return None
    labels = {label.strip() for label in claim.case.split(",") if label.strip()}
    fitting = [
        Verdict(verdict.claim, verdict.measure, verdict.paper, cases)
        for verdict in verdicts
        if (cases := tuple(case for case in verdict.cases if labels <= set(case.where.split(", "))))
    ]
    there = [case.where for verdict in verdicts for case in verdict.cases]
    if not fitting:
        raise _unknown(f"{where}.case", claim.case, there, f"cases of '{claim.statement}'")
    if len(fitting) > 1:
        what = f"{len(fitting)} claims of {claim.experiment} read '{claim.statement}'"
        raise ProblemsFound([Problem(f"{where}.case", what, f"name a case: {', '.join(there)}")])
    return fitting[0]


def _unknown(where: str, name: str, options: Sequence[str], kind: str) -> ProblemsFound:
    return ProblemsFound([Problem(where, f"there is no '{name}'", suggest(name, options, kind))])


def _ours(verdict: Verdict) -> str:
    """The measure, our figure, what it is compared with and the difference's interval; of several cases the range."""
    known = [(case, case.ours) for case in verdict.cases if case.ours is not None]
    if not known:
        return f"{verdict.measure}: –"
    case, ours = known[0]
    measure = f"{verdict.measure}{', ratio' if case.ratio else ''}"
    if len(verdict.cases) == 1:
        beside = "" if case.other is None else f", beside {_figure(case.other)} ({case.against})"
        between = "" if case.interval is None else f", difference {' to '.join(map(_figure, case.interval))}"
        return f"{measure}: {_figure(ours)}{beside}{between}"
    figures = sorted(figure for _, figure in known)
    held = [case.holds for case in verdict.cases]
    undecided = f", {held.count(None)} undecided" if None in held else ""
    cases = f"{held.count(True)} of {len(held)} cases hold{undecided}"
    return f"{measure}: {_figure(figures[0])} to {_figure(figures[-1])}; {cases}"


def _figure(value: float) -> str:
    """Three digits or four; whole numbers as such."""
    whole = float(value).is_integer() or abs(value) >= 100.0
    return number(value, 0 if whole else 1 if abs(value) >= 10.0 else 2)


def _counts(verdicts: Sequence[str]) -> str:
    """Counts the claims by verdict."""
    words = [in_words(held) for held in (True, False, None)]
    judged = [f"{word}: {verdicts.count(word)}" for word in (*words, UNRUN)]
    beside = [verdicts.count(kind) for kind in (UNJUDGED, NOT_HERE)]
    return (
        f"{len(verdicts)} claims: {len(verdicts) - sum(beside)} have an experiment ({'; '.join(judged)}), "
        f"{beside[0]} have none and {beside[1]} cannot be tested here."
    )
