import numpy as np

from omninav.stages.sensor.compared_rows import ComparedRows


def test_only_what_was_compared_last_has_a_row() -> None:
    rows = ComparedRows(6)
    for compared in ([1, 4], [0, 1, 5], None, [3]):
        chosen, found = rows.of(None if compared is None else np.array(compared))
        wanted = range(6) if compared is None else compared
        assert chosen.tolist() == list(wanted)
        assert found.tolist() == [list(wanted).index(n) if n in wanted else -1 for n in range(6)]
