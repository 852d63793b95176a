"""Right matches before the first wrong one, of made-up pictures whose points are known."""

import dataclasses
from collections.abc import Sequence
from typing import Literal

import numpy as np
import pytest
from measured_drives import figures

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.geometry.appearance.feature_matching import Pairs
from omninav.stages.metrics.first_matches import FirstMatches, JudgedMatches, half_widths, pairs_apart, shifted, summary
from omninav.stages.values.depths import Depths
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments
from omninav.stages.values.pose import Pose

LOOKS = np.random.default_rng(5).integers(0, 255, (20, 128)).astype(np.uint8)
A_METRE_APART = [Pose(x, 0.0, 0.0) for x in (0.0, 1.0)]
APART_M = "omninav.stages.metrics.first_matches.APART_M"
Search = Literal["both_ways", "one_way"]
Best = Literal["clearest", "nearest"]
both_searches = pytest.mark.parametrize("search", ["both_ways", "one_way"])
Patches, Columns = tuple[LocalFeatures, Depths], tuple[VerticalSegments, Depths]


@pytest.fixture(autouse=True)
def one_metre_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(APART_M, (1.0,))


def matches(
    one: Patches | Columns, other: Patches | Columns, known: Sequence[bool] = (True, True), lens=(), **parameters
) -> dict:
    """Measures the matches of two images a metre apart; `known`: the image whose depths are given."""
    features = [one[0], other[0]]
    depths = [depth if there else None for (_, depth), there in zip((one, other), known, strict=True)]
    if isinstance(one[0], VerticalSegments):
        return figures(FirstMatches(by="columns", **parameters), A_METRE_APART, (), features, depths, lens)["matches"]
    return figures(FirstMatches(**parameters), A_METRE_APART, features, (), depths, lens)["matches"]


def test_thirty_pairs_are_taken_of_each_distance_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(APART_M, (0.5, 1.0, 2.0))
    poses = np.column_stack([np.arange(100) * 0.5, np.zeros(100), np.zeros(100)])
    found = figures(FirstMatches(), [Pose(*map(float, pose)) for pose in poses])["matches"]
    assert [(each["m"], each["pairs"]) for each in found["apart"]] == [(0.5, 30), (1.0, 30), (2.0, 30)]
    assert found["all"]["pairs"] == 90
    assert pairs_apart(poses, 0.5, 3) == [(0, 1), (49, 50), (98, 99)]
    assert pairs_apart(poses, 1.75, 3) == [(0, 4), (48, 52), (95, 99)]
    assert pairs_apart(poses, 1000.0, 10) == []


def test_without_truth_nothing_can_be_said() -> None:
    with pytest.raises(BadInput, match="true pose"):
        FirstMatches().step(Context("m"), [None, None], [None, None])


SIDES = np.array([(0.5, y, z) for y in (-40.0, 40.0) for z in np.linspace(-9.0, 9.0, 10)])
"""Points far to both sides of the way, so that an angle in one view is the same in the other."""


LENS = Equirectangular(360, 90, 180.0, elevation_top=np.pi / 4, elevation_bottom=-np.pi / 4)
"""A degree a pixel."""


def turned(bearings: np.ndarray, axis: int, degrees: float) -> np.ndarray:
    """Bearings turned about an axis of the robot."""
    angle, (one, other) = np.radians(degrees), [(1, 2), (2, 0), (0, 1)][axis]
    found = bearings.copy()
    found[..., one] = np.cos(angle) * bearings[..., one] - np.sin(angle) * bearings[..., other]
    found[..., other] = np.sin(angle) * bearings[..., one] + np.cos(angle) * bearings[..., other]
    return found


def sides(x: float, axis: int = 2, degrees: float = 0.0, colour: float = 0.0) -> Patches:
    away = SIDES - (x, 0.0, 0.0)
    metres = np.linalg.norm(away, axis=1)
    bearings = turned(away / metres[:, None], axis, degrees)
    points, _ = LENS.project(bearings)
    colours = np.full((20, 3), [colour, 0.0, 0.0], np.float32)
    patches = LocalFeatures(bearings, points, LOOKS, colours, np.full(20, 8.0, np.float32))
    return patches, Depths(metres, np.zeros((0, 2)))


def beside(degrees: float = 0.0, axis: int = 2, colour: float = 0.0, **parameters) -> dict:
    """Measures matches of points to the sides, seen turned in the second image."""
    return matches(sides(0.0), sides(1.0, axis, degrees, colour), **parameters)


@pytest.mark.parametrize(("degrees", "share"), [(1.9, 1.0), (2.1, 0.0)])
def test_a_patch_is_right_up_to_two_degrees_from_where_its_partner_is_seen(degrees: float, share: float) -> None:
    found = beside(degrees)
    assert (found["depths_known"], found["all"]["pairs"], found["all"]["right_share"]) == (1, 1, share)
    assert found["all"]["by_chance"] == 0.0


def test_the_camera_and_not_the_robots_middle_moves_from_one_view_to_the_other() -> None:
    lens = dataclasses.replace(LENS, position_x=5.0)
    one, other = sides(0.0), sides(1.0, 2, -90.0)
    robot = [Pose(-5.0, 0.0, 0.0), Pose(1.0, -5.0, np.pi / 2)]
    stage, seen = FirstMatches(), ([one[0], other[0]], (), [one[1], other[1]])
    assert figures(stage, robot, *seen, [lens])["matches"]["all"]["right_share"] == 1.0
    assert figures(stage, robot, *seen, [LENS])["matches"]["all"]["right_share"] == 0.0


@pytest.mark.parametrize(("degrees", "share"), [(1.35, 1.0), (1.5, 0.0)])
def test_without_depths_it_is_right_where_both_are_a_degree_from_one_plane(degrees: float, share: float) -> None:
    found = beside(degrees, axis=0, known=(False, False))
    assert (found["depths_known"], found["all"]["right_share"]) == (0, share)


@both_searches
@pytest.mark.parametrize(("colour", "matched"), [(0.45, 20.0), (0.55, 0.0)])
def test_patches_of_other_colours_are_not_matched(search: Search, colour: float, matched: float) -> None:
    assert beside(colour=colour, search=search)["all"]["right"] == matched


@pytest.mark.parametrize(("degrees", "share"), [(3.9, 1.0), (4.1, 0.0)])
def test_a_large_patch_is_right_up_to_half_of_its_diameter(degrees: float, share: float) -> None:
    assert beside(degrees, lens=(None, LENS))["all"]["right_share"] == share


def columns(x: float, higher_deg: float = 0.0) -> Columns:
    """Twenty upright edges 40 m to the left, from 1 m below the camera to a metre above, their upper ends moved up."""
    feet = np.stack([np.linspace(-15.0, 15.0, 20) - x, np.full(20, 40.0)], axis=1)
    level = np.hypot(*feet.T)
    elevations = np.arctan2([1.0, -1.0], level[:, None]) + np.radians([higher_deg, 0.0])
    looks = np.random.default_rng(3).normal(size=(20, 10)).astype(np.float32)
    azimuths = np.arctan2(feet[:, 1], feet[:, 0])
    segments = VerticalSegments(azimuths, elevations, looks, np.ones(20, np.float32), np.zeros((20, 2, 2)))
    return segments, Depths(np.zeros(0), np.hypot(level, 1.0)[:, None].repeat(2, axis=1))


@pytest.mark.parametrize("best", ["clearest", "nearest"])
@pytest.mark.parametrize(("degrees", "right"), [(0.0, 20.0), (2.9, 20.0), (3.1, 0.0)])
def test_a_column_is_right_where_both_of_its_ends_are(best: Best, degrees: float, right: float) -> None:
    found = matches(columns(0.0), columns(1.0, degrees), best=best)["all"]
    assert (found["pairs"], found["right"], found["first_right"]) == (1, right, right)


@pytest.mark.parametrize("end", [0, 1])
def test_a_column_is_wrong_where_one_of_its_ends_is(end: int) -> None:
    second, far = columns(1.0)
    elevations = second.elevations.copy()
    elevations[:, end] += np.radians(9.0)
    moved = dataclasses.replace(second, elevations=elevations)
    assert matches(columns(0.0), (moved, far))["all"]["right"] == 0.0


@pytest.mark.parametrize(("degrees", "right"), [(1.35, 20.0), (1.5, 0.0)])
def test_without_depths_a_column_is_right_where_both_ends_are_in_a_plane(degrees: float, right: float) -> None:
    assert matches(columns(0.0), columns(1.0, degrees), (False, False))["all"]["right"] == right


@pytest.mark.parametrize("given", [(True, False), (False, True)])
@pytest.mark.parametrize(
    "pair", [(sides(0.0), sides(1.0, degrees=1.9)), (columns(0.0), columns(1.0, 2.0))], ids=["patches", "columns"]
)
def test_depths_of_one_view_alone_do_not_judge_a_match(pair: tuple, given: tuple[bool, bool]) -> None:
    found = matches(*pair, known=given)
    assert found["depths_known"] == 1
    assert found["all"] == matches(*pair, known=(False, False))["all"]


def test_patches_and_columns_are_counted_together_the_best_of_both_first() -> None:
    patches, segments = [sides(x) for x in (0.0, 1.0)], [columns(0.0), columns(1.0, 9.0)]
    depths = [Depths(one.patches, other.ends) for (_, one), (_, other) in zip(patches, segments, strict=True)]
    given = A_METRE_APART, [each for each, _ in patches], [each for each, _ in segments], depths
    found = [figures(FirstMatches(by=by), *given)["matches"]["all"] for by in ("patches", "columns", "both")]
    assert [each["right"] for each in found] == [20.0, 0.0, 20.0]
    assert [each["right_share"] for each in found] == [1.0, 0.0, 0.5]


def test_the_second_image_is_of_other_light_where_there_is_one() -> None:
    segments, depths = zip(columns(0.0), columns(1.0), strict=True)
    others, other_depths = zip(columns(0.0), columns(1.0, 9.0), strict=True)
    lit = {"other_segments": others, "other_depths": other_depths}
    given = FirstMatches(by="columns"), A_METRE_APART, (), segments, depths
    plain, other = (figures(*given, **more)["matches"]["all"] for more in ({}, lit))
    assert (plain["right"], plain["found_again"]) == (20.0, 1.0)
    assert (other["matched"], other["right"], other["found_again"]) == (20.0, 0.0, 0.0)
    few = segments[1].chosen(slice(0, 5)), Depths(depths[1].patches, depths[1].ends[:5])
    assert matches(columns(0.0), few)["all"]["found_again"] == 0.25  # of twenty in the first image


def test_a_pair_without_features_has_no_match_and_no_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(APART_M, (1.0, 5.0))
    none = {"right_share": None, "found_again": None, "by_chance": None}
    found = figures(FirstMatches(), A_METRE_APART)["matches"]
    assert found["apart"] == [
        {"m": 1.0, "pairs": 1, "matched": 0.0, "first_right": 0.0, "right": 0.0, **none},
        {"m": 5.0, "pairs": 0, "matched": None, "first_right": None, "right": None, **none},
    ]
    assert found["depths_known"] == 0


def test_images_without_a_true_pose_make_no_pair() -> None:
    poses = [None, *[Pose(x, 0.0, 0.0) for x in (0.0, 0.9, 1.0)]]
    views = [None, *[sides(x)[0] for x in (0.0, 0.9, 1.0)]]
    found = figures(FirstMatches(), poses, views)["matches"]["all"]
    assert (found["pairs"], found["right"]) == (1, 20.0)


def test_figures_of_pairs_are_medians_and_shares_of_all_matches() -> None:
    yes, no = True, False
    rights = np.array([yes, yes, no, yes]), np.array([no]), np.array([yes] * 5)
    judged = [JudgedMatches(*each) for each in zip(rights, (0.1, 0.3, np.nan), (20, 7, 5), strict=True)]
    assert summary(judged) == {
        "pairs": 3,
        "matched": 4.0,
        "first_right": 2.0,
        "right": 3.0,
        "right_share": 0.8,
        "found_again": 0.25,
        "by_chance": pytest.approx(0.2),
    }


@pytest.mark.parametrize("partners", [[0], [1, 0], [2, 0, 1], [3, 4, 0, 1, 2]])
def test_a_partner_of_another_is_half_of_them_away_and_at_least_one(partners: list[int]) -> None:
    number = len(partners)
    pairs = shifted(Pairs(np.arange(number), np.arange(number), np.zeros(number), np.zeros(number)))
    assert (pairs.first.tolist(), pairs.second.tolist()) == (list(range(number)), partners)


def test_half_a_patch_is_the_less_of_across_and_down_and_nothing_where_the_lens_does_not_see() -> None:
    lens = Equirectangular(360, 45, 180.0, elevation_top=np.pi / 4, elevation_bottom=-np.pi / 4)  # two degrees a row
    bearings, _ = lens.unproject(np.array([[100.0, 22.0], [100.0, 22.0]]))
    patches = sides(0.0)[0].chosen(np.array([0, 1]))
    patches = dataclasses.replace(patches, bearings=bearings, points=np.array([[100.0, 22.0]] * 2))
    assert np.degrees(half_widths(patches, lens)) == pytest.approx([4.0, 4.0], abs=0.01)


@pytest.mark.parametrize("step", [(1, 0), (-1, 0), (0, 1), (0, -1), None])
def test_half_a_patch_is_what_the_lens_sees_of_it(step: tuple[int, int] | None) -> None:
    patches = sides(0.0)[0].chosen(np.array([0]))
    middle, reach = patches.points[0], patches.sizes[0] / 2.0
    edge = turned(patches.bearings, 2, 5.0)

    class Keyhole(Equirectangular):
        """A lens that sees one of the patch's four ends."""

        def unproject(self, points):
            seen = step is not None and np.allclose(points[0], middle + reach * np.array(step))
            return (edge if seen else np.full((1, 3), np.nan)), np.array([seen])

    widths = np.degrees(half_widths(patches, Keyhole(360, 90, 180.0)))
    apart = np.degrees(np.arccos(np.clip(patches.bearings[0] @ edge[0], -1.0, 1.0)))
    assert widths == pytest.approx([0.0 if step is None else apart], abs=1e-6)


def looking(first: np.ndarray, second: np.ndarray, **parameters) -> dict[str, float]:
    """What is found of two views of points far to the sides, a metre apart, that look so: descriptors (20, 128)."""
    views = []
    for x, looks in ((0.0, first), (1.0, second)):
        patches, depths = sides(x)
        views.append((dataclasses.replace(patches, descriptors=looks.astype(np.uint8)), depths))
    return matches(*views, **parameters)["all"]


PLAIN = np.clip(LOOKS, 20, 200).astype(np.int64)


def with_entry(looks: np.ndarray, row: int, entry: int, more: int) -> np.ndarray:
    changed = looks.copy()
    changed[row, entry] += more
    return changed


@both_searches
def test_the_clearest_come_first_or_the_nearest(search: Search) -> None:
    # Two that look alike but for 10, and are seen as each other, 3 off; all others far from each other, and 50 off.
    first = PLAIN.copy()
    first[1] = with_entry(first, 0, 0, 10)[0]
    second = first + 5
    second[:, 100:] -= 5
    second[0], second[1] = first[1], first[0]
    second[:2, 1] += 3
    assert looking(first, second, search=search, best="clearest")["first_right"] == 18.0
    assert looking(first, second, search=search, best="nearest")["first_right"] == 0.0


def test_one_way_two_patches_may_have_one_partner_and_both_ways_not() -> None:
    first = PLAIN.copy()
    first[1] = with_entry(first, 0, 0, 10)[0]
    second = PLAIN.copy()
    second[1] = 255 - second[1]
    assert looking(first, second, search="one_way")["matched"] == 20.0
    assert looking(first, second, search="both_ways")["matched"] == 19.0


@pytest.mark.parametrize(("second_nearest", "matched"), [(13.0, 20.0), (12.0, 19.0)])
def test_a_partner_is_clearer_than_the_second_by_a_fifth(second_nearest: float, matched: float) -> None:
    second = PLAIN.copy()
    second[0, 0] += 10  # 10 from its partner, and this far from another of the second view
    second[1] = PLAIN[0]
    second[1, 1] += int(second_nearest)
    first = PLAIN.copy()
    first[1] = 255 - first[1]
    assert looking(first, second, search="one_way")["matched"] == matched - 1.0  # none looks like the second patch


def test_by_equation_2_an_entry_that_varies_much_counts_for_little() -> None:
    first = 100 + 4 * np.sign(LOOKS.astype(np.int64) - 127)
    second = first.copy()
    first[:, 0], second[:, 0] = 12 * np.arange(20), 12 * np.arange(20)[::-1]
    assert looking(first, second, patch_distance="mahalanobis")["right"] == 20.0
    assert looking(first, second)["right"] < 15.0
