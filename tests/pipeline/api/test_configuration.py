import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import omninav
from omninav.pipeline.api.arguments import arguments_of
from omninav.pipeline.api.configuration import configured
from omninav.pipeline.api.session import Step


def test_importing_omninav_imports_nothing_heavy():
    code = (
        "import sys, omninav; print([m for m in ('numpy', 'numba', 'matplotlib', 'hydra', 'cv2') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_every_name_that_is_offered_is_there():
    assert {name for name in omninav.__all__ if getattr(omninav, name, None) is None} == set()
    with pytest.raises(AttributeError, match=r"no attribute 'compos'; it has: .*compose"):
        omninav.compos  # noqa: B018


def test_python_values_become_the_words_that_one_would_type():
    settings = {
        "seed": np.int64(3),
        "log": Path("a b.mcap"),
        "grid": None,
        "validate": True,
        "cuts": [[1, np.float64(2.5)]],
        "nodes": {"match": {"headings": 72}},
    }
    assert arguments_of(("omniview_mcl", "match=l2"), settings) == [
        "variant=omniview_mcl",
        "match=l2",
        "seed=3",
        "log='a b.mcap'",
        "grid=null",
        "validate=true",
        "cuts=[[1,2.5]]",
        "nodes.match.headings=72",
    ]
    with pytest.raises(omninav.BadInput, match="a ndarray cannot be a setting"):
        arguments_of((), {"map": np.zeros(3)})


def test_a_configuration_knows_its_variant_and_draws_its_graph():
    made = omninav.compose("plain_matching", "match=l2", seed=3)
    assert (made.variant, made.settings["seed"]) == ("plain_matching", 3)
    assert "fusion" in made._repr_svg_()
    assert made._repr_svg_() in made._repr_html_()
    assert made.with_(seed=4).settings["seed"] == 4
    assert "_target_: omninav.stages.match.l2" in str(made)


def test_a_configuration_that_is_there_already_takes_more_words():
    made = omninav.compose("plain_matching", seed=3)
    assert configured((made,), {}) is made
    assert configured((made, "match=l2"), {"seed": 4}).words == (*made.words, "match=l2", "seed=4")
    assert configured((made,), {"seed": 5}).settings["seed"] == 5


def test_a_step_has_its_outputs_by_name_and_a_session_refuses_what_means_nothing_to_it():
    names = {"belief": "fuse.belief", "fuse.belief": "fuse.belief", "match.views": "match.views"}
    step = Step({"fuse.belief": np.zeros(2), "more.views": 3}, names)
    assert ([*step], repr(step), step["match.views"]) == ([*names], "Step(belief)", None)
    assert (step.belief is step["fuse.belief"], step.belief.flags.writeable) == (True, False)
    for wrong, said in ((lambda: step.beleif, "did you mean 'belief'"), (lambda: step["mach.views"], "'match.views'")):
        with pytest.raises((AttributeError, KeyError), match=said):
            wrong()
    for settings, said in (({"log": "x"}, "^log=…: .*omninav.run reads"), ({"nodes.match.headigs": 3}, "did you mean")):
        with pytest.raises((omninav.BadInput, omninav.ProblemsFound), match=said):
            omninav.open("plain_matching", **settings)


def test_a_text_with_odd_characters_arrives_as_it_is(tmp_path):
    odd = tmp_path / "it's {a} $b, ${e} c=d\\.mcap"
    assert omninav.compose("omniview_cml", log=odd).settings["log"] == str(odd)


def test_threads_wait_for_each_other_where_there_is_one_hydra():
    with ThreadPoolExecutor(4) as threads:
        composed = threads.map(lambda seed: omninav.compose("plain_matching", seed=seed), range(8))
        assert [made.settings["seed"] for made in composed] == list(range(8))


def test_what_is_wrong_is_an_exception_and_no_exit():
    with pytest.raises(omninav.ProblemsFound, match="did you mean 'seed=3'"):
        omninav.compose("plain_matching", sead=3)
    with pytest.raises(omninav.ProblemsFound, match="no such file"):
        omninav.compose("plain_matching", map="missing.omap", log="missing.mcap")
    with pytest.raises(omninav.BadInput, match="command line"):
        omninav.compose("+experiment=omniview_mcl/table_1")


def test_what_is_too_large_for_a_word_is_refused_before_it_is_written_out():
    itself: list = []
    itself.append(itself)
    for value, what in (
        (range(10**12), "seed: a range of 1,000,000,000,000 items cannot be a setting; expected at most 10,000"),
        (itself, "seed: a list within 20 others cannot be a setting"),
        (10**5000, "seed: a whole number of more than 100 digits cannot be a setting"),
        ((number for number in range(3)), "seed: a generator cannot be a setting"),
    ):
        with pytest.raises(omninav.BadInput, match=what):
            omninav.compose("plain_matching", seed=value)
