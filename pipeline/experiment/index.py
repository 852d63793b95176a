"""Tables of finished experiments, and of what papers claim: from verdict files, judged again by today's rule."""

import json
import re
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.run.provenance import git_commit

from .claims import BEGIN as CLAIMS_BEGIN
from .claims import CLAIMS, claim_tables
from .claims import END as CLAIMS_END
from .page import made_with
from .verdicts import Verdict, headline, in_words, judged_again, verdict_of

BEGIN, END = "<!-- table: omninav experiments -->", "<!-- end of the table -->"
HEAD = ("page", "command", "verdict", "does not hold", "undecided")
VERDICT_WORDS = "holds|does not hold|undecided"
RULE = "a claim of fewer than six repetitions is undecided"


def write_index(folder: Path) -> tuple[list[str], list[Path]]:
    """Judge the pages of a folder again; write the table of them into its README.md, and that of its `claims.yaml`.

    Of each `NAME.verdicts.json` and `NAME.md`: where today's rule judges a claim otherwise, both files are changed, and
    the page says at which commit. Returns the names of those, and the pages with tables. Each table goes between two
    marks of its page. Raises BadInput where a file is not as a page is written, ProblemsFound for a list of claims that
    names what is not there.
    """
    here = made_with(version("omninav"), git_commit(), "Judged again with")  # before a file of the checkout changes
    readme = folder / "README.md"
    _between(readme, BEGIN, END, "")
    changed = [path.name.partition(".")[0] for path in verdict_files(folder) if _judge_again(path, here)]
    written = {readme: _between(readme, BEGIN, END, index_table(folder))}
    if (folder / CLAIMS).exists():
        found = {page_of(path).stem: read_verdicts(path) for path in verdict_files(folder)}
        page, tables = claim_tables(folder / CLAIMS, found)
        written[page] = _between(page, CLAIMS_BEGIN, CLAIMS_END, f"\n{tables}\n")
    for page, text in written.items():
        write_whole(page, text)
    return changed, list(written)


def _between(page: Path, begin: str, end: str, content: str) -> str:
    """A page's text with other content between two marks."""
    before, found, rest = _read(page).partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended:
        raise BadInput(f"{page}: needs a line {begin} and below it a line {end}: the table goes between them")
    return f"{before}{begin}\n{content}{end}{after}"


def verdict_files(folder: Path) -> list[Path]:
    """The verdict files of a folder, by name. Raises BadInput where there are none."""
    files = sorted(folder.glob("*.verdicts.json"))
    if not files:
        raise BadInput(f"{folder}: no page is in it; a page is NAME.md with NAME.verdicts.json beside it")
    return files


def index_table(folder: Path) -> str:
    """The table in Markdown: a row for each page, with its command, and what its claims come to."""
    lines = [f"| {' | '.join(HEAD)} |", f"|{'---|' * len(HEAD)}"]
    for path in verdict_files(folder):
        page, verdicts = page_of(path), read_verdicts(path)
        title, command = _title_and_command(page)
        others = ["; ".join(v.claim.rstrip(".") for v in verdicts if v.holds is held) for held in (False, None)]
        cells = (f"[{title}]({page.name})", f"`{command}`", f"**{headline(verdicts)}**", *others)
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def read_verdicts(path: Path) -> list[Verdict]:
    """The verdicts of a file as they stand in it."""
    try:
        return [verdict_of(plain) for plain in json.loads(_read(path))]
    except (ValueError, TypeError, KeyError) as error:
        raise BadInput(f"{path}: is no list of verdicts ({type(error).__name__}: {error})") from None


def page_of(verdicts: Path) -> Path:
    """The page beside a verdict file."""
    return verdicts.with_name(verdicts.name.removesuffix(".verdicts.json") + ".md")


def _judge_again(path: Path, here: str) -> bool:
    stated = read_verdicts(path)
    verdicts = [judged_again(verdict) for verdict in stated]
    if [verdict.plain() for verdict in verdicts] == [verdict.plain() for verdict in stated]:
        return False
    page = page_of(path)
    text = f"{_with_verdicts(page, verdicts).rstrip()}\n\n{here}: {RULE}. The figures are as they were made.\n"
    write_whole(page, text)
    write_whole(path, json.dumps([verdict.plain() for verdict in verdicts], indent=1, ensure_ascii=False) + "\n")
    return True


def _with_verdicts(page: Path, verdicts: Sequence[Verdict]) -> str:
    """A page's text with other verdicts: in the last cell of each case's row, and behind the claim in its first row."""
    lines = _read(page).split("\n")
    rows = [number for number, line in enumerate(lines) if re.search(rf"\| ({VERDICT_WORDS}) \|$", line)]
    cases = [(verdict, case) for verdict in verdicts for case in verdict.cases]
    if len(rows) != len(cases):
        raise BadInput(f"{page}: {len(rows)} rows of verdicts, but {len(cases)} in the file beside it; write it again")
    for number, (verdict, case) in zip(rows, cases, strict=True):
        line = re.sub(rf"\| ({VERDICT_WORDS}) \|$", f"| {in_words(case.holds)} |", lines[number])
        lines[number] = re.sub(rf": \*\*({VERDICT_WORDS})\*\* \|", f": **{in_words(verdict.holds)}** |", line, count=1)
    return "\n".join(lines)


def _title_and_command(page: Path) -> tuple[str, str]:
    found = re.match(r"# (.+)\n.*?\n```\n(.+)\n```\n", _read(page), re.DOTALL)
    if found is None:
        raise BadInput(f"{page}: is not as a page is written: a title, what it is about, and its command")
    return found[1].split("\n")[0], found[2].split("\n")[0]


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or 'is no text'}") from None
