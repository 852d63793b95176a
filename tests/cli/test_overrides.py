"""Words that do not fit a configuration: which ones, and what to type instead."""

from collections.abc import Iterator

import pytest

from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.overrides import invalid_overrides, jobs_to_try, with_unlisted_parameters
from omninav.pipeline.graph.problems import BadInput


@pytest.fixture(autouse=True)
def _configured() -> Iterator[None]:
    with hydra_started():
        yield


def test_where_no_word_is_to_blame_hydras_own_message_is_given_in_one_line():
    (problem,) = invalid_overrides(["seed=3"], (), "In 'config': something\n  else\nConfig search path:\n  here")
    assert (problem.where, problem.what) == ("command line", "In 'config': something else")


def test_an_option_that_a_file_chooses_and_nobody_offers_is_named_with_what_offers_it():
    (problem,) = invalid_overrides(["seed=3"], (), "In 'config': Could not find 'match/mine'\nAvailable options …")
    assert (problem.where, problem.what) == ("match", "the defaults of a file choose 'mine', which there is not")
    assert problem.hint.startswith("a stage of your own is offered by OMNINAV_STAGES=match.mine=FILE.py:CLASS; ")


def test_a_change_of_an_artifacts_graph_is_not_blamed_for_another_word():
    words = with_unlisted_parameters(["+artifacts.map.nodes.source.stop=40"], ())
    (found,) = invalid_overrides(words, (), "Error merging override hydra.sweeper.n_trials=abc")
    assert found.what == "Error merging override hydra.sweeper.n_trials=abc"


def test_an_unknown_option_comes_before_what_depends_on_it():
    found = invalid_overrides(["match=l3", "nodes.match.nothing=1"], (), "")
    assert [problem.where for problem in found] == ["match"]


def test_an_option_that_is_gone_says_what_took_its_place():
    found = invalid_overrides(["candidates=near_belief", "variant=omninav_map_words"], (), "")
    assert [problem.what for problem in found] == ["there is no 'near_belief'", "there is no 'omninav_map_words'"]
    assert "candidates=index" in found[0].hint
    assert "omninav map variant=omninav candidates=words log=T" in found[1].hint


@pytest.mark.parametrize("word", ["video=none", "~nodes.video", "~nodes.belief_plot", "~nodes.retrieval_plot"])
def test_what_the_report_now_shows_frame_by_frame_is_said_where_it_is_left_out(word: str):
    (found,) = invalid_overrides([word], (), "")
    assert found.what == "this setting is gone"
    assert "frame by frame" in found.hint


def test_a_sweep_is_tried_by_its_first_choices_and_each_other_option_of_a_group():
    jobs = list(jobs_to_try(["match=selective,l2", "seed=0,1", "day=2"], ()))
    assert jobs == [["match=selective", "seed=0", "day=2"], ["match=l2", "seed=0", "day=2"]]


@pytest.mark.parametrize(
    ("word", "hint"),
    [
        ("source=glob(zz*)", "its options are closed_loop, "),
        ("day=glob(*)", "options of groups"),
        ("day=range(5,1)", "range("),
    ],
)
def test_a_sweep_of_no_value_is_refused(word: str, hint: str):
    with pytest.raises(BadInput, match="means no value") as refused:
        list(jobs_to_try([word], ()))
    assert hint in str(refused.value)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["seed=1,2,1"], "seed: seed=1 stands twice in the sweep; its jobs would be the same"),
        (["seed=1,2", "seed=3"], "seed=1,2 and seed=3 are typed; leave one of them out"),
    ],
)
def test_a_sweep_of_the_same_jobs_and_one_that_would_be_passed_over_are_refused(words: list[str], said: str):
    with pytest.raises(BadInput, match=said):
        list(jobs_to_try(words, ()))


def test_a_parameter_that_the_configuration_does_not_list_is_added_and_a_misspelled_one_is_not():
    words = ["nodes.match.headings=18", "nodes.match.headngs=18", "seed=3"]
    assert with_unlisted_parameters(words, ()) == ["++nodes.match.headings=18", "nodes.match.headngs=18", "seed=3"]
