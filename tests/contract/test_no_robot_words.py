"""The framework knows no robot, neither in names nor in prose, and runs a graph of other stages without ours."""

import re
import subprocess
import sys
from pathlib import Path

PIPELINE = Path(__file__).parents[2] / "pipeline"
FILES = sorted(path for path in PIPELINE.rglob("*") if path.suffix in (".py", ".html", ".md", ".css"))
TEXT = """
    camera cameras fisheye heading headings image images kidnapped kidnapping landmark lidar localisation
    localise map maps mirror odometry omnidirectional panorama panoramas pose poses robot robots room route
    routes tour tours wheel wheels world worlds
"""
WORDS = frozenset(TEXT.split())
NOT_MEANT = r"\bmap\(|\bimage/|\*map\b|<image\b|\bimage-rendering"
"""The built-in function, media types, and an element of SVG with its style."""


def words(line: str) -> set[str]:
    """The words of a line, those within names too: `max_pose_error`, `PoseError`."""
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", re.sub(NOT_MEANT, "", line))
    return {part.lower() for part in parts}


def test_words_are_found_within_names():
    assert {"pose", "camera", "map"} <= words("def max_pose(CameraModel, map=artifacts.map)")
    assert not words("map(str, values), 'image/png'") & WORDS


def test_no_file_of_the_framework_has_a_word_of_robots():
    assert len(FILES) > 100
    found = [
        f"{file.relative_to(PIPELINE)}:{number}: {', '.join(sorted(words(line) & WORDS))}"
        for file in FILES
        for number, line in enumerate(file.read_text().split("\n"), 1)
        if words(line) & WORDS
    ]
    assert not found, "\n".join(found)


def test_a_run_of_other_stages_imports_none_of_a_robots(tmp_path: Path):
    program = (
        "import sys, pathlib, toy_runs\n"
        "toy_runs.ended(toy_runs.noisy_sum(pathlib.Path('runs')))\n"
        "print([name for name in sys.modules if name.startswith('omninav.stages')])\n"
    )
    environment = {"PYTHONPATH": f"{PIPELINE.parent}:{PIPELINE.parent / 'tests'}", "PATH": "/usr/bin:/bin"}
    command = [sys.executable, "-c", program]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, cwd=tmp_path)
    assert ended.stdout == "[]\n", ended.stderr
    assert (tmp_path / "runs" / "latest" / "report.html").is_file()
