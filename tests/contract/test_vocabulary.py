"""Names in code, configuration and files are the field's words, and docstrings say what things are."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("pipeline", "stages", "conf", "examples", "benchmarks")
WORDS = """
    ABOUT AROUND AfterLifts Answers AnswersNearBy Arrangement Arrival AtOnce BeforeThreshold Behind
    CorrectPastStates DECK DriveSoFar DriveTally DrivenPlan FADED FirstViewsLimit GuessedMotion GuessedPose HANGS
    HypothesisLife Inbox Intake KeepSessions LEAST LeftBehind LeftOver Lesson Likeness Looked MatchPlaces
    MeanAtFirst NEARNESSES NOBODY OnceRight OwnPlace PlaceGrid Placed PlannedWay Reckoned Remark ReturnsHome
    ShortestWay Spool Stated Tell ViewLimit ViewReach VisitedPlaces Waiting WorldPlan WrongPlaces after_lifts
    agreed album alike anew answers_near_by anywhere apart aside asks at_once before_threshold beside boundary
    careful_references catalog chance clean_rate closing columns_alone consensus creep crew disturbance doubt
    driving empty_map far_in_drive film first_belief fresh gives growing guessed_motion heard how_compared
    hypothesis_life idle kept_sessions known_poses largest left_behind left_over lesson lessons longest
    mean_at_first misfit misfits near_rate nearness ordinary own_place pace past_states path_images patience
    picture pictures put_down put_right random_samples reckon restless retrace returns_home right_rate said
    selective_few settled_speed sift_and_columns splice splices spool stands_for strangers stray_deg taught tell
    told_rate view_limit view_reach wandered wants way work_through
"""
"""Those that keep an ordinary meaning (column, detour, limit, moments, near, reach, share) cannot be found by name."""
REPLACED = frozenset(WORDS.split())
PREFIXES = ("least_", "most_", "longest_", "largest_")


def names_in_code(path: Path) -> Iterator[str]:
    """Classes, functions, arguments, fields and module constants; what other libraries name is not ours to choose."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.arg):
            yield node.arg if isinstance(node, ast.arg) else node.name
        if isinstance(node, ast.ClassDef | ast.Module):
            for line in node.body:
                targets = line.targets if isinstance(line, ast.Assign) else [getattr(line, "target", None)]
                yield from (target.id for target in targets if isinstance(target, ast.Name))
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr


def keys(content: object) -> Iterator[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield str(key)
            yield from keys(value)
    elif isinstance(content, list):
        for value in content:
            yield from keys(value)


def own_names(path: Path) -> Iterator[str]:
    """File name without suffix, and what is named inside."""
    yield path.stem
    if path.suffix == ".py":
        yield from names_in_code(path)
    else:
        yield from keys(yaml.safe_load(path.read_text()))


def test_no_replaced_word_names_anything():
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".yaml")]
    assert len(files) > 300
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in files
        for name in own_names(path)
        if name.lstrip("_") in REPLACED or name.lstrip("_").startswith(PREFIXES)
    }
    assert not found, "another word is used for these, see docs/glossary.md:\n" + "\n".join(sorted(found))


def test_no_docstring_begins_with_what_of_where_who_or_how():
    begins = re.compile(r'^\s*"""(What|Of|Where|Who|Whoever|How)\b.*', re.MULTILINE)
    files = [path for folder in ("pipeline", "stages", "omninav") for path in (ROOT / folder).rglob("*.py")]
    assert len(files) > 300
    files += [ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]  # code to be copied
    found = {
        f"{path.relative_to(ROOT)}: {hit[0].strip()}" for path in files for hit in begins.finditer(path.read_text())
    }
    assert not found, "begin docstrings with a verb or the thing itself, as CONTRIBUTING.md says:\n" + "\n".join(
        sorted(found)
    )
