"""Tables of finished experiments, and of what papers claim, from verdict files."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput

from .claims import BEGIN as CLAIMS_BEGIN
from .claims import CLAIMS, claim_tables
from .claims import END as CLAIMS_END
from .verdicts import Verdict, headline, verdict_of

BEGIN, END = "<!-- table: omninav experiments -->", "<!-- end of the table -->"
HEAD = ("page", "command", "scenarios", "verdict", "does not hold", "undecided")


def write_index(folder: Path) -> list[Path]:
    """Write the table of a folder's pages into its README.md, and that of its `claims.yaml` into the page it names.

    Returns both. Each table goes between two marks of its page. Raises BadInput where a file is not as a page is
    written, ProblemsFound for a list of claims that names what is not there.
    """
    readme = folder / "README.md"
    _between(readme, BEGIN, END, "")
    written = {readme: _between(readme, BEGIN, END, index_table(folder))}
    if (folder / CLAIMS).exists():
        found = {page_of(path).stem: read_verdicts(path) for path in verdict_files(folder)}
        page, tables = claim_tables(folder / CLAIMS, found)
        written[page] = _between(page, CLAIMS_BEGIN, CLAIMS_END, f"\n{tables}\n")
    for page, text in written.items():
        write_whole(page, text)
    return list(written)


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
        cells = (f"[{title}]({page.name})", f"`{command}`", _scenarios(verdicts), f"**{headline(verdicts)}**", *others)
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def _scenarios(verdicts: Sequence[Verdict]) -> str:
    """Over how many scenarios the claims were judged."""
    return str(max((case.scenarios for verdict in verdicts for case in verdict.cases), default=0))


def read_verdicts(path: Path) -> list[Verdict]:
    """The verdicts of a file as they stand in it."""
    try:
        return [verdict_of(plain) for plain in json.loads(_read(path))]
    except (ValueError, TypeError, KeyError) as error:
        raise BadInput(f"{path}: is no list of verdicts ({type(error).__name__}: {error})") from None


def page_of(verdicts: Path) -> Path:
    """The page beside a verdict file."""
    return verdicts.with_name(verdicts.name.removesuffix(".verdicts.json") + ".md")


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
