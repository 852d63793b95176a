import io
import json

from omninav.pipeline.report.progress import Progress, live_line


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def drive(stream, frames, step_s, total):
    clock = Clock()
    with Progress(stream, clock) as progress:
        for frame in range(1, frames + 1):
            clock.now += step_s
            progress.update("localise", frame, total)
    return stream.getvalue()


def lines_of(stream):
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_no_rate_is_stated_of_a_frame_that_took_no_time():
    last = json.loads(drive(io.StringIO(), 1, 1e-6, 1).splitlines()[-1])
    assert (last["frames"], last["frames_per_second"]) == (1, None)


def test_elsewhere_than_in_a_terminal_there_is_a_json_line_every_two_seconds_and_one_at_the_end():
    first, second, *others, last = map(json.loads, drive(io.StringIO(), 67, 0.125, 67).splitlines())
    assert [line["frames"] for line in (first, second, *others, last)] == [17, 33, 49, 65, 67]
    assert (first["graph"], first["of"]) == ("localise", 67)
    rate = 33 / 4  # 33 frames in the 32 steps of 1/8 s since the first
    assert (second["frames_per_second"], second["seconds_left"]) == (round(rate, 1), round((67 - 33) / rate, 1))
    assert last["seconds_left"] == 0


def test_a_terminals_line_changes_at_most_ten_times_a_second():
    text = drive(Terminal(), 2000, 0.001, 2000)
    assert 15 <= text.count("\r") <= 22
    assert text.endswith("\n")
    assert text.count("\n") == 1
    assert "2000/2000 frames" in text


def test_the_first_line_knows_its_rate_when_a_run_is_resumed():
    stream, clock = io.StringIO(), Clock()
    with Progress(stream, clock) as progress:
        for frame in range(501, 540):
            progress.update("localise", frame, 1000)
            clock.now += 0.1
    assert all(line["frames_per_second"] < 12 for line in lines_of(stream))


def test_each_graph_ends_with_its_own_line():
    stream, clock = io.StringIO(), Clock()
    with Progress(stream, clock) as progress:
        for name in ("map", "localise"):
            for frame in (1, 2, 3):
                clock.now += 0.1
                progress.update(name, frame, 3)
    assert [(line["graph"], line["frames"]) for line in lines_of(stream)] == [("map", 3), ("localise", 3)]


def test_nothing_is_said_of_a_run_without_frames():
    stream = io.StringIO()
    with Progress(stream):
        pass
    assert stream.getvalue() == ""


def test_the_live_line_tells_name_frames_rate_and_time_left():
    half, none = "━" * 12 + "─" * 12, "─" * 24
    assert live_line("map", 50, 100, 25.0, 62.0) == f"map  {half}  50/100 frames  25.0 frames/s  1:02 left"
    assert live_line("map", 50, None, 25.0, None) == "map  50 frames  25.0 frames/s"
    assert live_line("drive", 1, None, None, None) == "drive  1 frame"
    assert live_line("t", 1, 200, 0.02, 9950.0, "maps") == f"t  {none}  1/200 maps  50.0 s each  2:45:50 left"
    assert live_line("t", 0, 200, None, None, "maps", "1 running") == f"t  {none}  0/200 maps  1 running"


def test_what_has_no_frames_yet_is_said_at_once_and_gives_way_to_the_first_frame():
    for stream, expected in ((io.StringIO(), '{"doing": "compiling"}\n'), (Terminal(), "compiling …")):
        with Progress(stream, Clock()) as progress:
            progress.say("compiling")
            assert stream.getvalue().endswith(expected)
            progress.update("simulate", 1, 2)
    assert stream.getvalue().count("\n") == 1


def test_what_is_printed_after_the_last_frame_stands_on_a_line_of_its_own():
    stream = Terminal()
    with Progress(stream, Clock()) as progress:
        progress.update("simulate", 2, 2)
        assert stream.getvalue().endswith("\n")
        progress.update("simulate", 2, 2)
    assert stream.getvalue().count("\n") == 1


def test_only_what_this_attempt_did_counts_for_the_rate():
    stream, clock = io.StringIO(), Clock()
    with Progress(stream, clock, unit="repetitions") as progress:
        progress.begin("table", 400, 404)
        for done in (401, 402, 403, 404):
            clock.now += 50.0
            progress.update("table", done, 404)
    assert [line["repetitions_per_second"] for line in lines_of(stream)] == [0.02] * 4
    assert [line["seconds_left"] for line in lines_of(stream)] == [150.0, 100.0, 50.0, 0.0]


def test_what_was_finished_before_has_no_rate():
    stream, clock = io.StringIO(), Clock()
    with Progress(stream, clock, unit="repetitions") as progress:
        progress.begin("table", 404, 404)
        clock.now += 1e-6
        progress.update("table", 404, 404)
    unknown = {"repetitions_per_second": None, "seconds_left": None}
    assert lines_of(stream) == [{"graph": "table", "repetitions": 404, "of": 404, **unknown}]


def test_what_a_stage_says_stands_beside_the_frames_for_a_moment():
    stream, clock = io.StringIO(), Clock()
    with Progress(stream, clock) as progress:
        for second in range(6):  # the same words with other numbers are no news
            progress.say(f"nothing on /odom for {second} s")
            clock.now += 1.0
        progress.update("live", 1, None)
        progress.say("9.5 Hz")
        clock.now += 5.0
        progress.update("live", 2, None)
    lines = lines_of(stream)
    assert [line["doing"] for line in lines[:3]] == [f"nothing on /odom for {second} s" for second in (0, 2, 4)]
    assert [(line["frames"], line.get("note")) for line in lines[3:]] == [(1, "9.5 Hz"), (2, None)]


def test_a_line_that_takes_several_rows_of_the_terminal_is_painted_over(monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    stream = Terminal()
    with Progress(stream, Clock()) as progress:
        progress.say("x" * 30)
        progress.say("y")
    assert stream.getvalue() == f"\r\x1b[J{'x' * 30} …\r\x1b[1A\x1b[Jy …\r\x1b[J"
