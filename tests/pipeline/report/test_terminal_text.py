import io

from rich.console import Console
from rich.control import Control
from rich.text import Text

from omninav.pipeline.report.terminal_text import PlainTexts, plain


def test_control_characters_of_a_text_are_shown_and_never_sent():
    assert plain("a\x1b[2J\x00\x7f\x9f\tb\nÄ\xa0") == "a\\x1b[2J\\x00\\x7f\\x9f\tb\nÄ\xa0"
    said = io.StringIO()
    console = Console(file=said, force_terminal=True, color_system="standard")
    console.print(PlainTexts(Text("evil\x9b2J", "bold")))
    console.print(PlainTexts(Control.home()), end="")  # what the program itself sends stays
    assert said.getvalue() == "\x1b[1mevil\\x9b2J\x1b[0m\n\x1b[H"
