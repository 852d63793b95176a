"""Every `omninav …` command in README and docs composes and builds with today's names."""

import re
import shlex
from pathlib import Path

import pytest
from offenders import assert_each

from omninav.pipeline.cli.commands.simulate import LIVE, is_live
from omninav.pipeline.cli.commands.tool import tool_from
from omninav.pipeline.cli.composed_experiments import resolved_but_for_the_experiment
from omninav.pipeline.cli.composition import complete
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.config_groups import learnable
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.main import COMMANDS
from omninav.pipeline.cli.overrides import jobs_to_try, with_unlisted_parameters
from omninav.pipeline.cli.tools import tool_class, tools
from omninav.pipeline.run.prepared_run import prepare_run

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/**/*.md")])
NO_GRAPH = set(COMMANDS) - {"check", "graph", "simulate"}
"""Commands that compose no configuration."""
OWN = {"experiment", "profile", "runs", "cache"}
"""What is typed for an experiment and not for its conditions."""


def commands(page: Path) -> list[str]:
    """The lines of code blocks, and the inline code, that begin with `omninav`; without their comments."""
    text = page.read_text()
    found = re.findall(r"^(?:\$ )?(omninav(?: .*)?)$", "\n".join(re.findall(r"```\w*\n(.*?)```", text, re.S)), re.M)
    found += re.findall(r"`(omninav [^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.S))
    return list(dict.fromkeys(re.split(r"\s+#", line)[0].strip() for line in found))


OTHERS = ("--config-dir", "edges", "brightness")
"""In commands with stages that are not installed here."""
CASES = {line: page for page in PAGES for line in commands(page) if not any(word in line for word in OTHERS)}
"""Line -> a page that it is on; without those of a stage that the reader writes."""
ON_PAGES = {page.relative_to(ROOT).as_posix(): [line for line, of in CASES.items() if of == page] for page in PAGES}


@pytest.fixture(autouse=True, scope="module")
def hydra():
    with hydra_started():
        yield


@pytest.mark.parametrize("page", [page for page, lines in ON_PAGES.items() if lines])
def test_the_commands_on_a_page_compose(page: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    assert_each(ON_PAGES[page], command_composes)


def command_composes(line: str) -> None:
    words = shlex.split(line)[1:]
    command = words.pop(0) if words and words[0] in COMMANDS else ""
    if command in NO_GRAPH:
        return
    if words[:1] and words[0] in learnable() and not any(word.isidentifier() for word in words[1:2]):
        words[0] = f"learn={words[0]}"
    typed = [command, *words] if command and not is_live(words) else words
    tool = next((one for one in (" ".join(typed[:1]), " ".join(typed[:2])) if one in tools()), None)
    if tool is not None:
        arguments = typed[len(tool.split()) :]
        if arguments:  # else a page speaks of it
            tool_from(tool_class(tool), arguments)
        return
    words = [word for word in words if "=" in word and "…" not in word and not word.startswith("hydra")]
    for job in jobs_to_try([*LIVE, *words] if command == "simulate" else words, []):
        composed(job)


def composed(words: list[str]) -> None:
    """Compose and build what a command describes; of an experiment its variant with what is typed for conditions."""
    own = [word for word in words if word.lstrip("+").partition("=")[0].partition(".")[0] in OWN]
    rest = [
        word for word in words if word not in own and not word.startswith(("map=", "words="))
    ]  # no saved map is there
    if any(word.startswith("+experiment=") for word in own):
        config = resolved_but_for_the_experiment(compose(own))
        if not rest:
            return  # what its conditions are is checked where all experiments are
        rest = [f"variant={config['experiment']['variant']}", *rest]
    named = [word for word in rest if word.startswith("variant=")]
    if len(rest) < len(words) and named in ([], ["variant=omniview_mcl"]):
        rest += ["tour=T", *(() if any(word.startswith("log=") for word in rest) else ("log=L",))]

    prepare_run(complete(compose(with_unlisted_parameters(rest, []))))
