"""Pages of many experiments from their result files: one each, an index, and the list of the papers' claims."""

import re
from collections.abc import Iterator, Mapping, Sequence

from .intervals import CONFIDENCE
from .page import markdown_page, number
from .plots import plots_of
from .result import ExperimentResult
from .specification import Claim, Experiment, comparison_of
from .verdicts import Verdict, headline

INDEX, CLAIMS = "results.md", "claims.md"
"""Files with the index and with the papers' claims."""
TAIL = (1.0 - CONFIDENCE) / 2.0
"""Share of 95 % intervals that are wholly above the true value, and as many below."""
VARIANT = re.compile(r"(?<!\S)variant=(\S+)")
"""The variant in the words of a condition; the last one counts."""
Judged = Sequence[tuple[Experiment, ExperimentResult]]
"""Experiments, each with its result."""


def pages(judged: Judged) -> dict[str, str | bytes]:
    """Every page and plot, by the name of its file."""
    found: dict[str, str | bytes] = {INDEX: index_page(judged), CLAIMS: claims_page(judged)}
    for experiment, result in judged:
        found |= markdown_page(experiment, result, plots_of(experiment, result))
    return found


def index_page(judged: Judged) -> str:
    """A row for each experiment: its page, its command, and the verdict on its claims."""
    rows = []
    for experiment, result in judged:
        verdicts = result.judged(experiment)
        titles = [
            "; ".join(
                experiment.claims[key].statement.rstrip(".") for key, each in verdicts.items() if each.holds is held
            )
            for held in (False, None)
        ]
        link = f"[{experiment.title}]({experiment.name}.md)"
        scenarios = scenarios_of(result)
        rows.append((link, f"`{result.command}`", scenarios, f"**{headline(verdicts.values())}**", *titles))
    head = ("page", "command", "scenarios", "verdict", "does not hold", "undecided")
    return f"# All experiments\n\n{_table(head, rows)}"


def scenarios_of(result: ExperimentResult) -> str:
    """The scenarios that a result is of: `draw 1 to draw 6`."""
    named = re.search(r"scenarios \(([^)]*)\)", result.repeated)
    labels = named[1].split(", ") if named else []
    in_a_row = len(labels) > 2 and all(label.startswith("draw ") for label in labels)
    return f"{labels[0]} to {labels[-1].removeprefix('draw ')}" if in_a_row else ", ".join(labels)


def claims_page(judged: Judged) -> str:
    """The papers' claims, paper by paper: each with its place, the experiment that judges it, verdict and value."""
    blocks = ["# What the papers claim, and what we find", by_chance(judged)]
    for source in sources(judged):
        rows = [
            (
                claim.paper,
                claim.where,
                f"[{experiment.title}]({experiment.name}.md): {claim.statement}",
                verdict.words,
                _ours(experiment, claim, verdict),
            )
            for experiment, claim, verdict in claims_of(judged, source)
        ]
        table = _table(("claim", "where", "experiment", "verdict", "ours"), rows)
        blocks += [f"## {source}", counts(judged, source), table, *struck(judged, source)]
    return "\n\n".join(blocks)


def sources(judged: Judged) -> list[str]:
    """The papers whose claims are judged."""
    return list(dict.fromkeys(experiment.source for experiment, _ in judged if experiment.source))


def claims_of(judged: Judged, source: str) -> Iterator[tuple[Experiment, Claim, Verdict]]:
    """A paper's claims with the verdicts on them; those that only we expect, or that are struck, are left out."""
    for experiment, result in judged:
        for key, verdict in result.judged(experiment).items():
            claim = experiment.claims[key]
            if experiment.source == source and claim.where and not claim.struck:
                yield experiment, claim, verdict


def struck(judged: Judged, source: str) -> list[str]:
    """A sentence and a list: a paper's claims that do not count, with the reasons; nothing where there are none."""
    lines = [
        f"* {claim.paper} ([{experiment.title}]({experiment.name}.md)): {claim.struck}"
        for experiment, _ in judged
        if experiment.source == source
        for claim in experiment.claims.values()
        if claim.struck
    ]
    return ["Struck, and judged on their pages alone:", "\n".join(lines)] if lines else []


def counts(judged: Judged, source: str) -> str:
    """A sentence: how many of a paper's claims are judged, and how; and the same of those about the printed system."""
    of_paper = list(claims_of(judged, source))
    held = [verdict.holds for *_, verdict in of_paper]
    printed = [verdict.holds for experiment, claim, verdict in of_paper if as_printed(experiment, claim)]
    of_printed = f"; of {len(printed)} as printed {_shares(printed)}" if printed else ""
    if len(printed) == len(held):
        of_printed = "; all are of the system as printed"
    return f"Of {len(held)} claims of this paper {_shares(held)}{of_printed}."


def as_printed(experiment: Experiment, claim: Claim) -> bool:
    """Tells whether a claim is about a printed system: by a label of either side, or by all its conditions' variant."""
    sides = (claim.of, getattr(claim, comparison_of(claim)))
    if any("as printed" in str(label) for side in sides if isinstance(side, Mapping) for label in side.values()):
        return True
    about = [each.overrides for each in experiment.conditions() if each.fits(claim.of)]
    typed = [f"variant={experiment.variant} {experiment.common} {overrides}" for overrides in about]
    return bool(typed) and all("as_printed" in VARIANT.findall(words)[-1] for words in typed)


def by_chance(judged: Judged) -> str:
    """A sentence: how many verdicts on the papers' claims chance would give, by the cases that each claim has."""
    claims = [(claim, len(verdict.cases)) for each in sources(judged) for _, claim, verdict in claims_of(judged, each)]
    strict = [cases for claim, cases in claims if not claim.lowest and claim.not_above is None]
    fail, hold = sum(1.0 - (1.0 - TAIL) ** cases for _, cases in claims), sum(TAIL**cases for cases in strict)
    return (
        f"The {len(claims)} verdicts have {sum(cases for _, cases in claims)} cases, each on a 95 % interval; a claim "
        "fails with one of its cases. Were no figure different from what it is compared with, chance would give at "
        f"most some {fail:.0f} that do not hold, and some {hold:.0f} that do; the {len(claims) - len(strict)} with a "
        "margin would mostly hold."
    )


def _shares(held: Sequence[bool | None]) -> str:
    return f"{held.count(True)} hold, {held.count(False)} do not, and {held.count(None)} are undecided"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for row in rows:
        cells = (" ".join(cell.split()).replace("|", r"\|") for cell in row)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _ours(experiment: Experiment, claim: Claim, verdict: Verdict) -> str:
    """The measure, our value, what it is compared with and the difference's interval; of several cases the range."""
    title = experiment.measures[claim.measure].title
    known = [(case, case.ours) for case in verdict.cases if case.ours is not None]
    if not known:
        return f"{title}: –"
    case, ours = known[0]
    measure = f"{title}{', ratio' if case.ratio else ''}"
    if len(verdict.cases) == 1:
        beside = "" if case.other is None else f", beside {_value(case.other)} ({case.against})"
        between = "" if case.interval is None else f", difference {' to '.join(map(_value, case.interval))}"
        return f"{measure}: {_value(ours)}{beside}{between}"
    values = sorted(value for _, value in known)
    held = [case.holds for case in verdict.cases]
    undecided = f", {held.count(None)} undecided" if None in held else ""
    cases = f"{held.count(True)} of {len(held)} cases hold{undecided}"
    return f"{measure}: {_value(values[0])} to {_value(values[-1])}; {cases}"


def _value(value: float) -> str:
    """Three digits or four; whole numbers as such."""
    whole = float(value).is_integer() or abs(value) >= 100.0
    return number(value, 0 if whole else 1 if abs(value) >= 10.0 else 2)
