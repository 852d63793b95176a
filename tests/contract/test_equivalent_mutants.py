"""What tests/mutants/equivalent.txt says of the code is said of lines that are there."""

from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
LISTED = REPOSITORY / "tests" / "mutants" / "equivalent.txt"


def test_every_line_that_is_listed_is_in_its_file():
    gone = []
    for block in LISTED.read_text().split("\n\n")[1:]:
        file, before, after, because = block.strip().split("\n")
        lines = [line.strip() for line in (REPOSITORY / file).read_text().splitlines()]
        assert before.strip() != after.strip()
        assert because.strip()
        if before.strip() not in lines:
            gone.append(f"{file}: {before}")
    assert not gone
