"""Messages are one line, and name what was probably meant."""

from omninav.pipeline.graph.problems import counted, cut, nearest, one_line, suggest


def test_long_words_lines_and_values_are_cut_and_few_names_are_listed() -> None:
    assert one_line("a\n b\x1b") == r"a b\x1b"
    assert [len(one_line("x" * length)) for length in (300, 301)] == [300, 301]
    assert [len(one_line("ab " * number)) for number in (330, 331)] == [989, 991]
    assert [len(cut("x" * length)) for length in (58, 59)] == [60, 58]
    names = [f"node{number:02}" for number in range(21)]
    assert suggest("nde07", names[:20], "nodes", "a.", "=1").startswith("did you mean 'a.node07=1'? nodes: node00, ")
    assert suggest("nde07", names, "nodes") == "did you mean 'node07'? (one of 21)"
    assert (nearest("abxy", ["abcd"]), nearest("abxy", ["abcd"], 0.6)) == ("abcd", None)
    assert [counted(number, "frame") for number in (1, 1200)] == ["1 frame", "1,200 frames"]
