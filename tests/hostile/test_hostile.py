"""Every reader makes of any input a sound value or one line, in a second and 300 MB."""

from pathlib import Path

import pytest

from hostile.formats import FORMATS
from hostile.harness import Case, Format, judge, minimal

SEED = 1


@pytest.mark.parametrize("format", FORMATS, ids=lambda format: format.name)
def test_every_input_gives_a_sound_value_or_one_line(format: Format, tmp_path: Path):
    folder, failed = tmp_path / "input", {}
    for number in range(format.cases):
        case = Case.of(f"{SEED} {format.name} {number}", len(format.samples()))
        if judge(format, case, folder)[0] == "failed":
            case, message = minimal(format, case, folder)
            failed[message] = case
    assert not failed
