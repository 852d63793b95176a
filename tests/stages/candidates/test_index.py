import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_beliefs import scattered_around
from made_references import references
from view_at_turn import turned_view

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.candidates.around_belief import AroundBelief
from omninav.stages.candidates.index import IndexedCandidates
from omninav.stages.candidates.inverted_file import _joined, _split
from omninav.stages.candidates.reference_index import BuildReferenceIndex, BuildReferenceIndexState
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.reference_index import InvertedLists, ReferenceIndex, ShortVectors

faiss = pytest.importorskip("faiss")

SEGMENTS, BINS, SPACING = 12, 16, 0.25
EXACT, INVERTED = 30_000, 0
DIMENSIONS = "omninav.stages.candidates.reference_index.DIMENSIONS"
EXACT_UP_TO = "omninav.stages.candidates.reference_index.EXACT_UP_TO"
FIELDS = {
    ShortVectors: ("mean", "axes", "vectors"),
    InvertedLists: ("mean", "axes", "centroids", "codebooks", "lists", "codes"),
}


def views(number: int, seed: int = 0) -> np.ndarray:
    """Views along a way: each is a mixture of the places before and after it, a dozen views apart."""
    rng = np.random.default_rng(seed)
    places = rng.random((number // 12 + 2, SEGMENTS, BINS)) ** 4
    at = np.arange(number) / 12
    part = (at % 1)[:, None, None]
    mixed = places[at.astype(int)] * (1 - part) + places[at.astype(int) + 1] * part
    return (mixed / mixed.sum(axis=2, keepdims=True)).astype(np.float32)


def a_map(number: int = 4000) -> ReferenceGraph:
    poses = np.column_stack([SPACING * np.arange(number), np.zeros((number, 2))])
    return references(poses, views(number))


MAP = a_map()


def index_of(
    map: ReferenceGraph, exact_up_to: int = EXACT, state: BuildReferenceIndexState | None = None
) -> ReferenceIndex:
    stage, ctx = BuildReferenceIndex(), Context("reference_index")
    stage.setup(ctx)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DIMENSIONS, 64)
        patch.setattr(EXACT_UP_TO, exact_up_to)
        index = stage.step(ctx, map, state or BuildReferenceIndexState()).index
    assert index is not None
    return index


@pytest.fixture(autouse=True)
def few_headings_and_references(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.candidates.index.GLOBAL_REFERENCES", 200)
    monkeypatch.setattr("omninav.stages.candidates.index.HEADINGS", SEGMENTS)


@pytest.fixture(scope="module", params=[EXACT, INVERTED], ids=["exact", "inverted"])
def index(request: pytest.FixtureRequest) -> ReferenceIndex:
    return index_of(MAP, request.param)


def assert_same(one: ReferenceIndex | None, other: ReferenceIndex) -> None:
    assert type(one) is type(other)
    assert all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in FIELDS[type(other)])


def selected(
    index: ReferenceIndex | None,
    view: np.ndarray,
    map: ReferenceGraph = MAP,
    near: Particles | None = None,
    turn: int = 1,
) -> Candidates:
    stage, ctx = IndexedCandidates(), Context("candidates")
    ctx.tick = Tick(index=turn, stamp=0)
    stage.setup(ctx)
    return stage.step(ctx, SegmentHistograms(view), map, index, near).candidates


def around(near: Particles) -> np.ndarray:
    some = AroundBelief()
    some.setup(Context("candidates"))
    return some.around(MAP, near, None)


def chosen(candidates: Candidates) -> np.ndarray:
    assert candidates.references is not None
    assert candidates.sampling_weight is not None
    return candidates.references[candidates.sampling_weight == 1.0]


def particles_at(x: float, spread: float = 0.05) -> Particles:
    return scattered_around((x, 0, 0), (spread, 0.05, 0.1), 200)


def test_what_is_most_similar_at_any_heading_is_found(index: ReferenceIndex) -> None:
    rng, found = np.random.default_rng(3), []
    for place in rng.integers(0, len(MAP), 20):
        noisy = MAP.features[place] * rng.uniform(0.8, 1.2, (SEGMENTS, BINS)).astype(np.float32)
        view = turned_view(noisy / noisy.sum(axis=1, keepdims=True), float(rng.uniform(-3, 3)))
        exact = np.argsort(-similarities(MAP.features, view, SEGMENTS, "histograms").max(axis=1))[:10]
        among = chosen(selected(index, view))
        found.append(np.isin(exact, among).mean())
        assert exact[0] in among
        assert len(among) <= 200
    assert np.mean(found) > 0.95


def test_the_number_of_a_list_is_in_the_first_bytes_the_lowest_first() -> None:
    lists, codes = np.array([5, 0x1234, 0x0ABCDE], np.int32), np.arange(6, dtype=np.uint8).reshape(3, 2)
    encoded = np.array([[5, 0, 0, 0, 1], [0x34, 0x12, 0, 2, 3], [0xDE, 0xBC, 0x0A, 4, 5]], np.uint8)
    assert _joined(lists, codes, 3).tolist() == encoded.tolist()
    assert [part.tolist() for part in _split(encoded, 3)] == [lists.tolist(), codes.tolist()]


def test_the_index_is_the_same_in_every_run(index: ReferenceIndex) -> None:
    again = index_of(a_map(), EXACT if isinstance(index, ShortVectors) else INVERTED)
    assert_same(index, again)
    one, other = (chosen(selected(each, MAP.features[5])).tobytes() for each in (index, again))
    assert one == other


def test_others_are_sampled_so_that_the_whole_map_is_represented(index: ReferenceIndex) -> None:
    candidates = selected(index, MAP.features[7])
    assert candidates.sampling_weight is not None
    assert candidates.sampling_weight.sum() == pytest.approx(len(MAP))


def test_the_background_is_the_same_at_each_image(index: ReferenceIndex) -> None:
    one, other = (selected(index, MAP.features[place]) for place in (7, 1900))
    sampled = [set(each.references) - set(chosen(each)) for each in (one, other)]  # type: ignore[arg-type]
    assert len(sampled[0] & sampled[1]) > 0.85 * 128


def test_a_known_place_is_looked_after_and_a_kidnapped_robot_is_found(
    index: ReferenceIndex, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("omninav.stages.candidates.index.SIMILAR_REFERENCES", 20)
    near = particles_at(100.0)
    among = chosen(selected(index, MAP.features[3000], near=near))
    assert 3000 in among
    assert set(around(near)) <= set(among)
    assert len(among) <= len(around(near)) + 20


@pytest.mark.parametrize("turned", range(4))
def test_a_kidnapped_robot_is_found_at_any_heading_within_two_images(index: ReferenceIndex, turned: int) -> None:
    view = np.roll(MAP.features[3000], turned, axis=0)  # looked up at every other heading, the others at the next image
    near = particles_at(100.0)
    assert 3000 in np.concatenate([chosen(selected(index, view, near=near, turn=turn)) for turn in (6, 7)])


def test_a_belief_spread_over_the_map_is_as_none(index: ReferenceIndex) -> None:
    view = MAP.features[1234]
    assert np.array_equal(chosen(selected(index, view, near=particles_at(500.0, 200.0))), chosen(selected(index, view)))


def test_references_that_a_map_has_learned_since_are_found(index: ReferenceIndex) -> None:
    map = a_map()
    for n, view in enumerate(views(50, seed=9)):
        map.insert(Pose(-1.0 - n, 0.0, 0.0), view, "histograms")
    assert 4030 in chosen(selected(index, map.features[4030], map))


@pytest.mark.parametrize("form", [EXACT, INVERTED], ids=["exact", "inverted"])
def test_an_index_is_built_anew_when_its_map_has_doubled_and_is_the_same_after_a_kill(
    form: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(DIMENSIONS, 64)
    monkeypatch.setattr(EXACT_UP_TO, form)
    map, state, ctx = a_map(1200), BuildReferenceIndexState(), Context("reference_index")
    stage = BuildReferenceIndex()
    stage.setup(ctx)
    sizes = []
    for n, view in enumerate(views(1300, seed=5)):
        if n % 100 == 0:
            sizes.append(len(stage.step(ctx, map, state).index or ()))
        map.insert(Pose(float(n), 5.0, 0.0), view, "histograms")
    assert sizes == [1200] * 12 + [2400]
    resumed = index_of(map, form, BuildReferenceIndexState(references=2400))
    assert_same(stage.step(ctx, map, state).index, resumed)


def test_small_maps_are_compared_whole() -> None:
    stage, ctx = BuildReferenceIndex(), Context("reference_index")
    stage.setup(ctx)
    assert stage.step(ctx, a_map(500), BuildReferenceIndexState()).index is None
    assert selected(None, MAP.features[0], a_map(500)).references is None


def test_without_faiss_all_references_of_a_large_map_are_looked_through_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kw: Any) -> Any:
        if name == "faiss":
            raise ImportError(name)
        return real(name, *args, **kw)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.setattr(EXACT_UP_TO, 2000)
    stage, ctx = BuildReferenceIndex(), Context("reference_index")
    stage.setup(ctx)
    indices = [stage.step(ctx, MAP, BuildReferenceIndexState()).index for _ in range(2)]
    assert isinstance(indices[0], ShortVectors)
    assert len(ctx.warnings) == 1
    assert "pip install 'omninav[index]'" in ctx.warnings[0]
    assert 123 in chosen(selected(indices[0], MAP.features[123]))


def test_an_index_of_another_map_is_refused(index: ReferenceIndex) -> None:
    with pytest.raises(BadInput, match=r"index is of another map; wire reference_index\.map"):
        selected(index, MAP.features[0], a_map(3000))
    with pytest.raises(BadInput, match="12 segments x 16 bins, the current one of 12 x 5"):
        selected(index, MAP.features[0][:, :5])


def test_codes_that_name_no_list_are_refused(tmp_path: Path) -> None:
    index = index_of(MAP, INVERTED)
    assert isinstance(index, InvertedLists)
    lists = index.lists.copy()
    lists[7] = len(index.centroids)
    broken = InvertedLists(index.mean, index.axes, index.centroids, index.codebooks, lists, index.codes)
    write_artifact(tmp_path / "index.omap", broken)
    with pytest.raises(BadInput, match="not a valid InvertedLists: 'lists'"):
        read_artifact(tmp_path / "index.omap")


@pytest.mark.parametrize("form", [EXACT, INVERTED], ids=["exact", "inverted"])
@pytest.mark.parametrize("shape", [(1, 5), (1, 1), (36, 3)])
def test_views_of_few_numbers_have_an_index_too(shape: tuple[int, int], form: int) -> None:
    features = np.random.default_rng(0).random((1500, *shape)).astype(np.float32) * 255
    assert len(index_of(references(np.zeros((1500, 3)), features, "colours"), form)) == 1500
