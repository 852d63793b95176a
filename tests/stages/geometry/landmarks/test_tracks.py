import numpy as np

from omninav.stages.geometry.landmarks.tracks import joined_matches


def joined(matches, image):
    first, second = np.array(matches, np.int64).reshape(-1, 2).T
    tracks = joined_matches(first, second, np.array(image, np.int64))
    return [tracks.features[a:b].tolist() for a, b in zip(tracks.starts[:-1], tracks.starts[1:], strict=True)], tracks


def test_features_that_match_through_others_are_one_track_and_single_ones_none() -> None:
    found, tracks = joined([(0, 2), (2, 5), (1, 3)], [0, 0, 1, 1, 1, 2, 2])
    assert sorted(found) == [[0, 2, 5], [1, 3]]
    assert len(tracks) == 2
    assert [found[owner] for owner in tracks.owners] == [track for track in found for _ in track]


def test_a_match_that_gives_a_track_two_features_of_an_image_is_left_out() -> None:
    image = [0, 0, 1, 2]
    assert joined([(0, 2), (1, 3), (2, 3)], image)[0] == [[0, 2], [1, 3]]  # the surest first
    assert joined([(2, 3), (0, 2), (1, 3)], image)[0] == [[0, 2, 3]]


def test_long_tracks_are_compared_whole_when_they_meet() -> None:
    image = [0, 1, 2, 3, 0, 4]
    assert joined([(0, 1), (1, 2), (4, 5), (3, 5), (2, 3)], image)[0] == [[0, 1, 2], [3, 4, 5]]


def test_without_matches_there_is_no_track() -> None:
    for image in ([], [0, 1]):
        found, tracks = joined([], image)
        assert found == []
        assert (len(tracks), len(tracks.owners)) == (0, 0)
