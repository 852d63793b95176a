"""The page of settings, from the comments of conf/config.yaml."""

import re
from pathlib import Path

CONFIG = Path(__file__).parents[2] / "conf/config.yaml"
SETTING = re.compile(r"^( *)(\w+):\s*([^#]*?)\s*(?:#\s*(.*))?$")
NOT_TYPED = ("defaults", "inputs", "nodes", "wires", "artifacts", "saves", "hydra", "variant")
"""What a variant's file says, not its user."""


def settings_page() -> str:
    """A row for each setting: its name as it is typed, default and meaning."""
    rows: list[list[str]] = []
    path: list[str] = []
    for line in CONFIG.read_text(encoding="utf-8").split("\n"):
        more = re.match(r"^ +# (.*)$", line)
        if more and rows:
            rows[-1][2] += f" {more[1]}"
            continue
        found = SETTING.match(line)
        if not found or line.startswith("#"):
            continue
        indent, name, value, meaning = found.groups()
        path = [*path[: len(indent) // 2], name]
        if path[0] not in NOT_TYPED:
            rows.append([".".join(path), value, meaning or ""])
    table = "\n".join(f"| `{name}` | {f'`{value}`' if value else ''} | {_cell(text)} |" for name, value, text in rows)
    return (
        "# Settings\n\nWhat stands on a command line as `name=value`, for every variant that has use for it. "
        "Parameters of single stages are `nodes.NODE.PARAMETER=VALUE`; they are listed with the stages.\n\n"
        f"| setting | default | meaning |\n|---|---|---|\n{table}\n"
    )


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
