import functools
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import graph_of, mapped_room, room, seen_from, tour_poses, with_landmarks

from omninav.pipeline import BadInput, Context
from omninav.pipeline.graph.contents import violation
from omninav.stages.map_files.references import cut_references, joined_references, thinned_references
from omninav.stages.sensor.landmark_pose import LandmarkPose, LandmarkPoseState
from omninav.stages.values.maps import ReferenceGraph

POSE = np.array([3.1, 2.9, 0.4])
AWAY = np.array([50.0, 0.0, 0.0])


@functools.cache
def other_room() -> ReferenceGraph:
    """A room 50 m away, mapped by itself."""
    seen = [seen_from(room(1), pose) for pose in tour_poses()]
    map = with_landmarks(graph_of(tour_poses()), seen)
    return map.moved(map.poses + AWAY)


def found_in(map: ReferenceGraph, seed: int = 0) -> list[float] | None:
    """The pose that an image of a room has in a map."""
    fix = LandmarkPose().step(Context("landmark_pose"), LandmarkPoseState(), seen_from(room(seed), POSE), map).fix
    return None if fix is None else fix.poses[0].tolist()


def test_images_are_found_in_a_thinned_and_in_a_cut_map() -> None:
    map = mapped_room()
    thin, cut = thinned_references(map, 1.1), cut_references(map, map.poses[:, 0] < 5.0)
    for part in (thin, cut):
        assert violation(part) is None
        assert len(part) == part.landmarks.references < len(map)
        assert len(part.landmarks) < len(map.landmarks) or part is thin
        assert found_in(part) == pytest.approx(POSE, abs=1e-3)
    assert cut.landmarks.points[:, 0].max() < 5.0 + 3.01


def test_what_no_reference_of_a_part_sees_is_gone() -> None:
    map = mapped_room()
    assert found_in(cut_references(map, map.poses[:, 0] > 9.0)) is None


def test_two_rooms_that_were_mapped_apart_are_one_map() -> None:
    one, other = mapped_room(), other_room()
    sigmas = np.linspace(0.0, 0.3, 3 * len(one)).reshape(-1, 3)
    sure = replace(one.landmarks, sigma_rad=0.01, found_rate=0.5, variance_factor=2.0, pose_sigmas=sigmas)
    vague = replace(other.landmarks, sigma_rad=0.03, found_rate=0.25, variance_factor=3.0, pose_sigmas=None)
    both = joined_references([replace(one, landmarks=sure), replace(other, landmarks=vague)], "truth")
    assert violation(both) is None
    share = (len(sure) + 1) / (len(sure) + len(vague) + 2)
    assert both.landmarks.sigma_rad**2 == pytest.approx(0.0001 * share + 0.0009 * (1 - share))
    assert (both.landmarks.found_rate, both.landmarks.variance_factor) == (0.25, 3.0)
    assert (both.landmarks.pose_sigmas == np.concatenate([sigmas, np.zeros((len(other), 3))])).all()
    assert len(both.landmarks) == len(mapped_room().landmarks) + len(other_room().landmarks)
    assert found_in(both) == pytest.approx(POSE, abs=1e-3)
    assert found_in(both, seed=1) == pytest.approx(POSE + AWAY, abs=1e-3)


@pytest.mark.parametrize("first", [True, False])
def test_what_a_tour_showed_of_its_camera_stays_whichever_map_is_first(first: bool) -> None:
    right, wrong = np.array([0.0, 0.0, 0.3]), np.array([0.0, 0.0, 0.2])
    one, other = mapped_room(), other_room()
    described = replace(one, landmarks=replace(one.landmarks, described=right, mount=right))
    found = replace(other, landmarks=replace(other.landmarks, described=wrong, mount=right, delay_s=0.1))
    both = joined_references([described, found] if first else [found, described], "truth").landmarks
    assert [both.mounted(each, True)[2] for each in (right, wrong)] == pytest.approx([0.0, 0.1])
    assert both.delay_s == 0.1


def test_maps_of_a_mirror_and_of_a_panorama_are_one_map() -> None:
    one, other = mapped_room(), other_room()
    reflected = replace(other, landmarks=other.landmarks.as_mirrored(True))
    assert (reflected.landmarks.descriptors != other.landmarks.descriptors).any()
    both, plain = joined_references([one, reflected], "truth"), joined_references([one, other], "truth")
    assert (both.landmarks.mirrored, reflected.landmarks.mirrored) == (False, True)
    assert (both.landmarks.descriptors == plain.landmarks.descriptors).all()
    assert found_in(both, seed=1) == pytest.approx(POSE + AWAY, abs=1e-3)


def test_parts_of_one_map_keep_their_words() -> None:
    map = mapped_room()
    left = map.poses[:, 0] < 5.0
    both = joined_references([cut_references(map, left), cut_references(map, ~left)], "truth")
    rows = np.concatenate([np.flatnonzero(left), np.flatnonzero(~left)])
    assert both.landmarks.words.weights.tolist() == map.landmarks.words.of_views(rows).weights.tolist()
    assert both.landmarks.words.words.tolist() == map.landmarks.words.of_views(rows).words.tolist()
    assert found_in(both) == pytest.approx(POSE, abs=1e-3)


@pytest.mark.parametrize("first", [True, False])
def test_references_of_a_map_without_landmarks_see_none_in_a_joined_one(first: bool) -> None:
    plain = graph_of(tour_poses() + AWAY)
    both = joined_references([plain, mapped_room()] if first else [mapped_room(), plain], "truth")
    assert violation(both) is None
    sees = np.diff(both.landmarks.starts) > 0
    assert (sees == (both.poses[:, 0] < 20.0)).all()
    assert found_in(both) == pytest.approx(POSE, abs=1e-3)


def test_maps_without_landmarks_stay_without() -> None:
    assert joined_references([graph_of(tour_poses())] * 2, "truth").landmarks is None
    assert thinned_references(graph_of(tour_poses()), 1.0).landmarks is None


def test_landmarks_of_other_descriptors_do_not_join() -> None:
    map = mapped_room()
    short = replace(map, landmarks=replace(map.landmarks, descriptors=map.landmarks.descriptors[:, :64].copy()))
    with pytest.raises(BadInput, match="descriptors of their landmarks have 64 and 128 numbers"):
        joined_references([map, short], "truth")


def test_references_learned_since_are_as_uncertain_as_the_others_in_the_mean() -> None:
    map = mapped_room()
    sigmas = np.linspace(0.0, 0.3, 3 * len(map)).reshape(-1, 3)
    landmarks = replace(map.landmarks, pose_sigmas=sigmas)
    taken = landmarks.of_references(np.array([3, len(map), 1]))
    assert taken.pose_sigmas == pytest.approx(np.array([sigmas[3], sigmas.mean(axis=0), sigmas[1]]))
