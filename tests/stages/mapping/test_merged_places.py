import numpy as np
import pytest
from made_tour import Landmarks, Mapped, along, furnished_alike, mapped, scattered
from made_views import between_looks, made_hypotheses, made_views

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.place_clusters import medoids
from omninav.stages.mapping.learned_words import LearnPlaceWords
from omninav.stages.mapping.merged_places import MergePlaces, distances_along, merged_places, same_spots
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.match.place_words import MatchPlaceWords
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import LoopHypotheses, TopologicalMap

SQUARE = [(8.0, 8.0), (32.0, 8.0), (32.0, 32.0), (8.0, 32.0), (8.0, 8.0)]
WORLD = Landmarks(scattered(40.0, 40.0))


def merged(tour: Mapped, **parameters: float) -> LoopHypotheses:
    return MergePlaces(**parameters).step(Context("places"), tour.views, tour.hypotheses).hypotheses


def map_of(tour: Mapped, found: LoopHypotheses) -> TopologicalMap:
    return TopologicalMapping().step(Context("mapping"), tour.views, found).map


def side_by_side(map: TopologicalMap) -> int:
    """Medoids that are within a metre of another."""
    at = map.poses[map.places, :2]
    apart = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) + 99.0 * np.eye(len(at))
    return int((apart.min(axis=1) < 1.0).sum())


def own_is_closest(map: TopologicalMap, found: LoopHypotheses) -> float:
    """Share of the tour's views whose place has the closest medoid."""
    return float((map.nearest_places(found.poses) == found.place).mean())


@pytest.fixture(scope="module")
def twice() -> Mapped:
    second = [(x + 0.3, y + 0.4) for x, y in SQUARE]
    return mapped(WORLD, [along(SQUARE, 1.2) + along(second, 1.3)])


def test_places_of_two_passes_do_not_stand_side_by_side(twice: Mapped) -> None:
    found = merged(twice)
    map = map_of(twice, found)
    assert side_by_side(map) == 0
    assert own_is_closest(map, found) > max(0.7, own_is_closest(twice.map, twice.hypotheses))


def test_without_a_spacing_every_view_stays_where_it_was(twice: Mapped) -> None:
    assert merged(twice, min_spacing=0.0).place.tolist() == twice.hypotheses.place.tolist()
    assert merged(twice).place.tolist() != twice.hypotheses.place.tolist()


def test_what_looks_alike_by_chance_stays_apart() -> None:
    out = mapped(furnished_alike(), [along(SQUARE, 1.2)])
    found = merged(out)
    map = map_of(out, found)
    assert np.hypot(*(found.poses - map.poses[map.places[found.place]])[:, :2].T).max() < 6.0


def test_images_that_have_nothing_in_common_are_places_of_their_own() -> None:
    nowhere = mapped(Landmarks(scattered(1.0, 1.0)), [along([(50.0, 50.0), (60.0, 50.0)], 2.0)])
    assert merged(nowhere).place.tolist() == [0, 1, 2, 3, 4]
    assert merged(mapped(WORLD, [along(SQUARE[:2], 1.2)[:1]])).place.tolist() == [0]


def test_a_place_is_known_by_the_words_of_all_its_views(twice: Mapped) -> None:
    found = merged(twice)
    map = map_of(twice, found)
    words = LearnPlaceWords(words=900).step(Context("words"), twice.views, found).words
    for row in range(0, len(found.poses), 5):
        x, y, heading = (float(number) for number in found.poses[row])
        out = MatchPlaceWords().step(Context("match"), WORLD.seen(Pose(x, y, heading + 1.0)), map, words)
        assert out.similarities is not None
        assert out.answers is not None
        assert int(out.similarities.values.argmax()) == found.place[row]
        assert row in out.answers.references


def test_words_of_another_map_are_refused_and_a_map_without_words_says_nothing(twice: Mapped) -> None:
    words = LearnPlaceWords(words=50).step(Context("words"), twice.views, merged(twice)).words
    seen, stage = WORLD.seen(Pose(8.0, 8.0, 0.0)), MatchPlaceWords()
    assert stage.step(Context("match"), seen, twice.map).similarities is None
    with pytest.raises(BadInput, match="give those that were saved with it"):
        stage.step(Context("match"), seen, map_of(twice, merged(twice, min_spacing=0.5)), words)


def merged_by_hand(
    looks: list[float],
    place: list[int],
    accepted: list[tuple[int, int]],
    orders: list[int] | None = None,
    **parameters: object,
) -> list[int]:
    """Places after merging: views match where they look less than 0.1 apart."""
    at = between_looks(looks)
    known = {name: parameters.pop(name, None) for name in ("tours", "owners")}
    views = made_views(at, (at < 0.1).astype(float), orders=orders, **known)  # type: ignore[arg-type]
    found = made_hypotheses(views, place, [*accepted, (0, len(looks) - 1)], len(accepted))  # the last one was refused
    stage = MergePlaces(**parameters)  # type: ignore[arg-type]
    return stage.step(Context("places"), views, found).hypotheses.place.tolist()


ROUNDS = [0.0, 0.3, 5.0, 5.3, 9.0, 9.3, 0.01, 0.31, 5.01, 5.31, 9.01, 9.31]
SIDE_BY_SIDE = [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
FAR_ALONG = [*range(6), *range(20, 26)]


def test_near_an_accepted_hypothesis_views_that_match_join_the_places_of_two_passes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one = [0, 0, 1, 1, 2, 2] * 2
    assert merged_by_hand(ROUNDS, SIDE_BY_SIDE, [(0, 6)], FAR_ALONG) == one
    assert merged_by_hand(ROUNDS, SIDE_BY_SIDE, [], FAR_ALONG) == SIDE_BY_SIDE
    # Views 2 and 8 are two along on both passes, 4 together; the pairs further on are not within 5.
    monkeypatch.setattr("omninav.stages.mapping.merged_places.NEIGHBOUR_VIEWS", 5.0)
    near = merged_by_hand(ROUNDS, SIDE_BY_SIDE, [(0, 6)], FAR_ALONG)
    assert near == [0, 0, 1, 1, 2, 2, 0, 0, 1, 1, 3, 3]
    assert merged_by_hand(ROUNDS, SIDE_BY_SIDE, [(0, 6)], FAR_ALONG, min_spacing=0.005) == SIDE_BY_SIDE


def test_a_view_belongs_to_the_medoid_that_is_nearest_along_the_drive() -> None:
    # Medoids are 0.2 and 1.0; 0.55 was taken for the second and is 0.35 from the first.
    assert merged_by_hand([0.1, 0.2, 0.3, 0.55, 1.0, 1.1], [0, 0, 0, 1, 1, 1], []) == [0, 0, 0, 0, 1, 1]
    # Where another tour begins nothing leads from one to the other.
    apart = merged_by_hand([0.1, 0.2, 0.3, 0.55, 1.0, 1.1], [0, 0, 0, 1, 1, 1], [], tours=[1, 1, 1, 2, 2, 2])
    assert apart == [0, 0, 0, 1, 1, 1]


def test_a_known_place_holds_together_and_takes_new_views_in_by_any_of_its_own() -> None:
    # Known places of 0 and 0.2, and of 5 and 5.2; a new view looks as 0 does, 0.25 from the medoid 0.2 by way of it.
    looks, known = [0.0, 0.2, 5.0, 5.2, 0.05, 7.0], {"tours": [0, 0, 0, 0, 1, 1], "owners": [0, 0, 1, 1, -1, -1]}
    place, accepted = [0, 0, 1, 1, 2, 3], [(0, 4)]
    assert merged_by_hand(looks, place, accepted, **known, min_spacing=0.3) == [0, 0, 1, 1, 0, 2]
    assert merged_by_hand(looks, place, accepted, **known, min_spacing=0.01) == [0, 0, 1, 1, 2, 3]
    # The known places stay two, however near the tour shows them to be.
    assert merged_by_hand(looks, place, [(0, 4), (2, 4)], **known, min_spacing=99.0)[:4] == [0, 0, 1, 1]


def test_views_of_a_known_map_were_not_driven_in_their_order_those_of_a_tour_were(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Known: 0 and its path image 5, then place 5.1. New: 5.05, where the path image is, and 5.2 after it. Along the
    # drive they are 1.05 and 1.2 from 0 (a step is 1 at most), and no way leads to 5.1.
    known = {"tours": [0, 0, 0, 1, 1], "owners": [0, 0, 1, -1, -1]}
    monkeypatch.setattr("omninav.stages.mapping.merged_places.MIN_SHARE", 1.5)
    found = merged_by_hand([0.0, 5.0, 5.1, 5.05, 5.2], [0, 0, 1, 2, 3], [(1, 3)], **known, min_spacing=2.0)
    assert found == [0, 0, 1, 0, 0]


NUMBER = 12
AT = np.concatenate([np.arange(NUMBER), np.arange(NUMBER) + 0.1])
"""Places (m) of the views of two passes along one path."""
DISTANCES = 0.05 * np.abs(AT[:, None] - AT)
SHARES = np.where(np.abs(AT[:, None] - AT) < 0.5, 0.6, 0.1)
PLACE = np.concatenate([np.arange(NUMBER) // 4, 3 + (np.arange(NUMBER) + 2) // 4])
"""Clusters of four views, which on the second pass begin two views earlier."""
NEW = np.full(2 * NUMBER, -1)
ALONG = np.array([(n, n + 1) for n in range(2 * NUMBER - 1) if n != NUMBER - 1])
ACCEPTED = np.array([[5, NUMBER + 5]])


def edges() -> np.ndarray:
    return np.concatenate([ALONG, same_spots(SHARES, np.arange(2 * NUMBER), ACCEPTED, 0.4, 20.0)])


def test_pairs_of_one_spot_are_near_an_accepted_one() -> None:
    orders = np.arange(2 * NUMBER)
    assert same_spots(SHARES, orders, ACCEPTED, 0.4, 20.0).tolist() == [[n, n + NUMBER] for n in range(NUMBER)]
    assert same_spots(SHARES, orders, ACCEPTED, 0.4, 4.0).tolist() == [[n, n + NUMBER] for n in range(3, 8)]
    assert len(same_spots(SHARES, orders, ACCEPTED[:0], 0.4, 20.0)) == 0
    assert len(same_spots(SHARES, orders, ACCEPTED, 0.7, 20.0)) == 0


def test_distances_go_along_the_drive_and_over_to_the_other_pass() -> None:
    found = distances_along(DISTANCES, edges(), np.array([2]))[0]
    assert found[NUMBER + 7] == pytest.approx(0.05 * 5.1)
    assert np.isinf(distances_along(DISTANCES, ALONG, np.array([2]))[0, NUMBER:]).all()


def test_places_side_by_side_are_merged_where_a_pair_was_accepted_and_views_go_to_the_nearest() -> None:
    place = merged_places(DISTANCES, edges(), PLACE, NEW, 0.12)
    assert PLACE.max() + 1 == 7
    assert place.max() + 1 == 3
    assert (place[:NUMBER] == place[NUMBER:]).mean() > 0.8
    middle = AT[medoids(DISTANCES, place)]
    nearest = np.abs(AT[:, None] - middle).min(axis=1)
    assert np.abs(AT - middle[place]) == pytest.approx(nearest, abs=0.2)
    apart = merged_places(DISTANCES, ALONG, PLACE, NEW, 0.12)
    assert not set(apart[:NUMBER]) & set(apart[NUMBER:])


def test_places_of_a_known_map_stay_and_new_views_go_to_them() -> None:
    known = np.where(np.arange(2 * NUMBER) < NUMBER, PLACE, -1)
    place = merged_places(DISTANCES, edges(), PLACE, known, 0.12)
    assert place[:NUMBER].tolist() == PLACE[:NUMBER].tolist()
    assert set(place) == {0, 1, 2}
