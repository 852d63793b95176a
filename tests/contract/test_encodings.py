"""Text files are UTF-8 wherever we run: every place that opens one says so."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RUNNING = {"run", "Popen", "check_output", "check_call"}


def silent_calls(tree: ast.AST) -> Iterator[int]:
    """Lines of calls that read or write text in whatever encoding the machine has."""
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call):
            continue
        keywords = {word.arg for word in call.keywords}
        name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        modes = [arg.value for arg in call.args[:2] if isinstance(arg, ast.Constant) and isinstance(arg.value, str)]
        modes += [w.value.value for w in call.keywords if w.arg == "mode" and isinstance(w.value, ast.Constant)]
        opens = name == "open" and isinstance(call.func, ast.Name) and not any("b" in mode for mode in modes)
        opens |= name in ("open", "fdopen") and any(mode in ("r", "w", "a", "x", "r+", "w+") for mode in modes)
        texts = name in ("read_text", "write_text") or (name in RUNNING and keywords & {"text", "universal_newlines"})
        in_zip = isinstance(call.func, ast.Attribute) and getattr(call.func.value, "id", "") == "archive"
        if (opens or texts) and not in_zip and "encoding" not in keywords:
            yield call.lineno


@pytest.mark.parametrize("room", ["pipeline", "stages"])
def test_every_text_file_is_opened_as_utf_8(room: str) -> None:
    files = sorted((ROOT / room).glob("**/*.py"))
    assert len(files) > 50
    silent = [f"{file.relative_to(ROOT)}:{n}" for file in files for n in silent_calls(ast.parse(file.read_bytes()))]
    assert not silent, "add encoding='utf-8'"


def test_a_call_without_an_encoding_is_found() -> None:
    text = (
        "open(f)\nPath(f).read_text()\nPath(f).open('w')\nrun(a, text=True)\nopen(f, 'rb')\nopen(f, encoding='utf-8')"
    )
    assert list(silent_calls(ast.parse(text))) == [1, 2, 3, 4]
