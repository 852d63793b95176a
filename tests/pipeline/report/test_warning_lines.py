from omninav.pipeline.report.warning_lines import grouped, warning_lines


def test_what_is_said_of_several_files_is_one_line_with_a_count():
    said = ["map: No odometry in tour.mcap: made", "No odometry in logs/drive 2.mcap: made", "The disk is full"]
    assert grouped(said) == ["map: No odometry in tour.mcap: made (and 1 more like this)", "The disk is full"]
    guessed = [f"{of}assumed: walk.mp4: 30 images per second" for of in ("map: ", "")]
    assert grouped(guessed) == [f"{guessed[0]} (and 1 more like this)"]
    assert grouped([f"frame {n}: too dark" for n in range(3)]) == ["frame 0: too dark (and 2 more like this)"]


def test_different_causes_stay_apart():
    said = ["tour.mcap: images are mirrored", "tour.mcap: images are blank"]
    assert grouped(said) == said


def test_skipped_data_is_a_warning_where_a_first_case_is_known():
    dropped = {"source.undecodable_image": {"count": 3, "first": "frame 7"}, "source.seen": {"count": 5, "first": ""}}
    assert warning_lines({"warnings": ["a"], "dropped": dropped}) == [
        "a",
        "undecodable image, 3 times (first: frame 7)",
    ]
    once = {"grid_is_a_stand_in": {"count": 1, "first": "made from the tour's path"}}
    assert warning_lines({"dropped": once}) == ["grid is a stand in (made from the tour's path)"]
