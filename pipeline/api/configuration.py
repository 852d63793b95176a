"""A configuration, composed and checked, as an object that shows itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.graph_svg import svg
from omninav.pipeline.run.config_text import config_text
from omninav.pipeline.run.prepared_run import PreparedRun, check_inputs, prepare_run

from .arguments import arguments_of
from .plain_errors import plain_errors


@dataclass(frozen=True, repr=False)
class Configuration:
    """A variant with all its settings, composed and checked.

    In a notebook it shows its graph.
    """

    words: tuple[str, ...]
    """Words of the command line that it was composed of."""
    settings: Mapping[str, Any]
    """All of it as plain data, written out: what a run's `config.yaml` holds."""

    @property
    def variant(self) -> str:
        """The variant's name."""
        return str(self.settings.get("variant"))

    @cached_property
    def prepared(self) -> PreparedRun:
        """The checked graph and where its artifacts come from."""
        return prepare_run(self.settings)

    def with_(self, *words: str, **settings: Any) -> "Configuration":
        """The same with more words: `configuration.with_("match=l2", seed=3)`."""
        return compose(*self.words, *words, **settings)

    def __repr__(self) -> str:
        return f"Configuration({' '.join(self.words) or 'the embedded default'}: {self.variant})"

    def __str__(self) -> str:
        """All of it as YAML."""
        return config_text(self.settings)

    def _repr_html_(self) -> str:
        return f"<p><b>{escape(self.variant)}</b> <code>{escape(' '.join(self.words))}</code></p>{self._repr_svg_()}"

    def _repr_svg_(self) -> str:
        return svg(self.prepared.graph)


def compose(*words: str, **settings: Any) -> Configuration:
    """A configuration of words as on the command line: `compose("omniview_mcl", "match=l2", seed=3)`.

    A first word without `=` names the variant, `"--config-dir=FOLDER"` a folder of configurations of your own; keywords
    are settings. Nothing runs, and no log is opened. Raises `ProblemsFound` with everything that is wrong, and
    `BadInput`.
    """
    typed = arguments_of(words, settings)
    if any(word.lstrip("+").startswith("experiment=") for word in typed):
        raise BadInput(f"{' '.join(typed)}: experiments run on the command line: omninav {' '.join(typed)}")
    with composed(typed) as config:
        made = Configuration(tuple(typed), complete(config))
    _ = made.prepared  # raises what is wrong with the graph
    return made


@plain_errors()
def check(*words: str, **settings: Any) -> Configuration:
    """`compose`, and open every file that the run would read, so that nothing is found to be missing later."""
    made = compose(*words, **settings)
    check_inputs(made.prepared)
    return made


def configured(words: tuple[Any, ...], settings: Mapping[str, Any]) -> Configuration:
    """A configuration that was composed already, or is composed of words now."""
    if words and isinstance(words[0], Configuration):
        return words[0].with_(*words[1:], **settings) if len(words) > 1 or settings else words[0]
    return compose(*words, **settings)
