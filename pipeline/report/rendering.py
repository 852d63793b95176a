"""Pages from our own templates."""

from importlib.resources import files
from typing import Any


def render(template: str, **values: Any) -> str:
    """A page from a template of ours; text is escaped in HTML and stays as it is elsewhere."""
    from jinja2 import Environment, FunctionLoader
    from markupsafe import Markup

    folder = files(__package__).joinpath("templates")
    loader = FunctionLoader(lambda name: folder.joinpath(name).read_text(encoding="utf-8"))
    environment = Environment(
        loader=loader, autoescape=template.endswith(".html"), trim_blocks=True, lstrip_blocks=True
    )
    css, script = (Markup(folder.joinpath(name).read_text(encoding="utf-8")) for name in ("page.css", "report.js"))
    return environment.get_template(template).render(css=css, script=script, **values)
