"""Jobs in processes of their own, by several executors: messages, errors, deaths, memory and orphans."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.jobs import perform, worker_pool
from omninav.pipeline.jobs.executors import BUILT_IN, ExecutorSettings, cores, executor_of, read_executor
from omninav.pipeline.jobs.job import Job
from omninav.pipeline.jobs.job_progress import Heartbeat, JobProgress
from omninav.pipeline.jobs.worker_pool import WorkerPool, _Mailbox

TESTS = str(Path(__file__).resolve().parents[2])


def job(name: str, folder: Path, **given: object) -> Job:
    return Job(name, f"pool_jobs:{name.partition(' ')[0]}", given, folder / f"{name}.log")


def test_a_job_that_fails_or_dies_is_reported_and_the_others_finish(tmp_path: Path):
    jobs = [job(name, tmp_path, messages=3, mark=str(tmp_path / "mark")) for name in ("die", "fail", "count")]
    jobs.append(job("die_once", tmp_path, mark=str(tmp_path / "mark")))
    messages, ended = [], {}
    with WorkerPool(ExecutorSettings(workers=2), tmp_path) as workers:
        outcomes = workers.run(
            jobs,
            lambda job, message: messages.append((job.name, message["number"])),
            lambda job, outcome: ended.update({job.name: outcome}),
        )
    assert outcomes == ended
    assert outcomes["fail"].error == "ValueError: no such number"
    assert outcomes["die"].error.startswith("its process was ended by SIGKILL")
    assert outcomes["die_once"].error is None
    assert (outcomes["count"].error, outcomes["count"].value) == (None, 3)
    assert messages == [("count", 0), ("count", 1), ("count", 2)]
    assert (tmp_path / "count.log").read_text() == "counted\n"
    assert "Traceback" in (tmp_path / "fail.log").read_text()
    assert len((tmp_path / "die.log").read_text().splitlines()) == 3  # attempts
    assert {path.suffix for path in tmp_path.iterdir()} == {".log", ""}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_jobs_end_as_they_do_elsewhere_where_their_logs_meet_a_full_disk(tmp_path: Path):
    jobs = [job(name, tmp_path) for name in ("fail once", "fail again")]
    for each in jobs:
        each.log.symlink_to("/dev/full")
    with WorkerPool(ExecutorSettings(workers=1), tmp_path) as workers:
        outcomes = workers.run(jobs)
    assert [outcome.error for outcome in outcomes.values()] == ["ValueError: no such number"] * 2


def test_a_job_that_takes_too_much_memory_is_ended_and_named_with_what_it_took(tmp_path: Path):
    greedy = job("take", tmp_path, megabytes=300, seconds=60, mark=str(tmp_path / "mark"))
    with WorkerPool(ExecutorSettings(workers=1, memory=200_000_000), tmp_path) as workers:
        outcome = workers.run([greedy])["take"]
    assert re.fullmatch(r"it took [23]\d\d MB of memory, more than executor.memory=200 MB allows", outcome.error)
    wait_for(lambda: not lives(int((tmp_path / "mark").read_text())))


CLIENT = """
import signal
import sys
from pathlib import Path
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background jobs ignore
sys.path.append({tests!r})
from omninav.pipeline.jobs.executors import ExecutorSettings
from omninav.pipeline.jobs.job import Job
from omninav.pipeline.jobs.worker_pool import WorkerPool
folder = Path(sys.argv[1])
given = {{"megabytes": 1, "seconds": 60, "mark": str(folder / "mark")}}
with WorkerPool(ExecutorSettings(workers=1), folder) as workers:
    workers.run([Job("take", "pool_jobs:take", given, folder / "take.log")])
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_jobs_end_soon_after_whoever_started_them(tmp_path: Path, how: signal.Signals):
    client = subprocess.Popen([sys.executable, "-c", CLIENT.format(tests=TESTS), str(tmp_path)], stderr=-3)
    wait_for((tmp_path / "mark").exists)
    time.sleep(0.1)
    job_process = int((tmp_path / "mark").read_text())
    assert lives(job_process)
    client.send_signal(how)
    client.wait()
    wait_for(lambda: not lives(job_process))


@pytest.mark.parametrize(("held", "lease_s"), [("token", 1.0), ("another's", 60.0), (None, 60.0)])
def test_a_job_ends_whose_client_gives_no_sign_of_life_or_has_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, held: str | None, lease_s: float
):
    monkeypatch.setattr(perform, "LEASE_S", lease_s)
    lease = tmp_path / ".client"
    if held is not None:
        lease.write_text(held)
    endless = job("take", tmp_path, megabytes=1, seconds=60, mark=str(tmp_path / "mark"))
    ended = perform.perform(endless.text(0, lease, "token", None))
    assert ended["error"] == "stopped, because the process that started it has ended"
    wait_for(lambda: not lives(int((tmp_path / "mark").read_text())))


def test_a_job_goes_on_as_long_as_its_client_gives_signs_of_life(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(perform, "LEASE_S", 2.0)
    monkeypatch.setattr(worker_pool, "RENEW_S", 0.05)
    slow = job("take", tmp_path, megabytes=1, seconds=3, mark=str(tmp_path / "mark"))
    with WorkerPool(ExecutorSettings(workers=1), tmp_path) as workers:
        assert workers.run([slow])["take"].error is None


def test_a_process_takes_one_job_after_another_unless_it_keeps_too_much(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def processes(*names: str) -> list[int]:
        with WorkerPool(ExecutorSettings(workers=1), tmp_path) as workers:
            outcomes = workers.run([job(name, tmp_path) for name in names])
        return [int(outcomes[name].value) for name in names]

    first, second = processes("process a", "process b")
    assert first == second
    monkeypatch.setattr(perform, "MAX_LEFT", 1_000_000)
    first, second = processes("process c", "process d")
    assert first != second


def test_a_job_uses_one_thread(tmp_path: Path):
    pytest.importorskip("threadpoolctl")
    with WorkerPool(ExecutorSettings(workers=1), tmp_path) as workers:
        outcome = workers.run([job("threads", tmp_path)])["threads"]
    assert outcome.error is None, outcome.error
    assert set(outcome.value) == {1}


def test_jobs_run_on_a_cluster_of_dask_as_they_do_here(tmp_path: Path):
    distributed = pytest.importorskip("distributed", reason="pip install 'omninav[dask]'")
    jobs = [job(name, tmp_path, messages=3, mark=str(tmp_path / "mark")) for name in ("fail", "die_once", "count")]
    messages = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        settings = ExecutorSettings("dask", options={"address": cluster.scheduler_address})
        with WorkerPool(settings, tmp_path) as workers:
            outcomes = workers.run(jobs, lambda job, message: messages.append(message["number"]))
            assert workers.number == 2
    errors = {name: outcome.error for name, outcome in outcomes.items()}
    assert errors == {"fail": "ValueError: no such number", "die_once": None, "count": None}
    assert messages == [0, 1, 2]


def test_what_crosses_to_a_cluster_is_text(tmp_path: Path):
    crossed = []

    class Noting(ThreadPoolExecutor):
        def submit(self, fn, /, *args, **kwargs):
            crossed.append((fn, args, kwargs))
            return super().submit(fn, *args, **kwargs)

    with WorkerPool(ExecutorSettings(workers=1), tmp_path) as workers:
        workers.start(Noting(1))
        workers.run([job("count", tmp_path, messages=1)])
    ((function, (text,), named),) = crossed
    assert f"{function.__module__}.{function.__name__}" == "omninav.pipeline.jobs.perform.perform"
    assert json.loads(text)["given"] == {"messages": 1}
    assert not named


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("slrum", r"executor: there is no executor 'slrum'\n +did you mean 'slurm'"),
        ({"name": "local", "workers": 0}, "executor.workers: 0, expected a whole number >= 1"),
        ({"workers": 100_001}, "executor.workers: 100001, expected a whole number >= 1"),
        ({"workers": True}, "executor.workers: True, expected a whole number >= 1"),
        ({"name": "local", "memory": "4"}, "executor.memory: '4', expected a size with its unit"),
    ],
)
def test_settings_of_an_engine_that_make_no_sense_are_refused(given: object, message: str):
    with pytest.raises(ProblemsFound, match=message):
        read_executor(given)


def test_settings_of_an_executor_are_numbers(monkeypatch: pytest.MonkeyPatch):
    read = read_executor({"name": "slurm", "workers": 100_000, "memory": "4GB", "queue": "long"})
    assert (read.name, read.workers, read.memory, read.options) == ("slurm", 100_000, 4 * 10**9, {"queue": "long"})
    assert read_executor(None) == ExecutorSettings("local", None, None)
    for text, size in (("1.5 MiB", 1.5e6), ("20k", 2e4), ("1TB", 1e12)):
        assert read_executor({"workers": 1, "memory": text}).memory == size
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0: {0, 2, 3}}[process])
    assert [executor_of(ExecutorSettings(workers=n))._max_workers for n in (None, 2)] == [3, 2]
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert cores() == 1


def test_messages_are_read_line_by_line_as_they_are_written(tmp_path: Path):
    one, got = job("count", tmp_path), []
    mailbox = _Mailbox(lambda job, message: got.append(message))
    for part, expected in (("", []), ('1\n{"a"', [1]), (": 2}", [1]), ("\n3\n", [1, {"a": 2}, 3])):
        with one.messages.open("a") as file:
            file.write(part)
        mailbox.read([one])
        assert got == expected


def test_the_frames_of_jobs_are_added_up():
    progress, sent = JobProgress(4), []
    assert (progress.done, progress.total, progress.ended) == (0, None, 0)
    progress.on_message("a", {"frames": 30, "of": 100})
    progress.on_message("a", {"note": "no frames"})
    progress.on_message("b", {"frames": 1, "of": 51})
    assert (progress.done, progress.total) == (31, 151 + 2 * 76)  # silent ones count as the mean of the others
    progress.end("a")
    progress.end("b", well=False)
    assert (progress.done, progress.total, progress.ended) == (101, 101 + 2 * 50, 2)
    progress.on_message("c", {"frames": 5})
    assert progress.total is None
    for silent in ("c", "d"):
        progress.end(silent)
    assert (progress.done, progress.total, progress.ended) == (106, 106, 4)
    heart = Heartbeat(sent.append)
    for done in range(1, 53):
        heart.update("map", done, 52)
    assert [message["frames"] for message in sent] == [1, 25, 50, 52]
    assert sent[0]["of"] == 52


def test_what_is_no_executor_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(BUILT_IN, "mine", "builtins:id")
    with pytest.raises(BadInput, match="executor=mine: builtins:id gives a int, expected an Executor"):
        executor_of(ExecutorSettings("mine"))


def test_slurm_is_refused_at_once_where_its_command_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed", reason="pip install 'omninav[dask]'")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BadInput, match="executor=slurm: there is no command 'sbatch' here"):
        executor_of(ExecutorSettings("slurm"))


@pytest.fixture
def sbatch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A command `sbatch` that accepts a job which never begins, to be written over."""
    pytest.importorskip("distributed", reason="pip install 'omninav[slurm]'")
    pytest.importorskip("dask_jobqueue", reason="pip install 'omninav[slurm]'")
    monkeypatch.setattr("omninav.pipeline.jobs.dask_executor.SILENT_S", 0.1)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    script = tmp_path / "sbatch"
    script.write_text("#!/bin/sh\necho Submitted batch job 7\n")
    script.chmod(0o755)
    (tmp_path / "scancel").symlink_to("/bin/true")
    return script


def test_slurm_leaves_ctrl_c_as_it_was(sbatch: Path, monkeypatch: pytest.MonkeyPatch):
    for name in [name for name in sys.modules if name.startswith("dask_jobqueue")]:
        monkeypatch.delitem(sys.modules, name)
    before = signal.getsignal(signal.SIGINT)
    executor_of(ExecutorSettings("slurm", workers=1)).shutdown()
    assert signal.getsignal(signal.SIGINT) is before


def test_slurm_says_why_it_starts_no_worker(sbatch: Path, capsys: pytest.CaptureFixture[str]):
    executor_of(ExecutorSettings("slurm", workers=2)).shutdown()
    assert "waiting for Slurm, 0 of 2 workers so far" in capsys.readouterr().err
    sbatch.write_text("#!/bin/sh\necho sbatch: error: invalid partition >&2\nexit 1\n")
    with pytest.raises(BadInput, match=r"sbatch starts no worker: sbatch: error: invalid partition$"):
        executor_of(ExecutorSettings("slurm", workers=2))


def test_no_client_is_made_for_what_is_no_address(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed", reason="pip install 'omninav[dask]'")
    monkeypatch.setattr("omninav.pipeline.jobs.dask_executor.Client", None)
    with pytest.raises(BadInput, match=r"executor.address=garbage: no scheduler answers there"):
        executor_of(ExecutorSettings("dask", options={"address": "garbage"}))


def test_an_engine_that_cannot_be_reached_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    distributed = pytest.importorskip("distributed", reason="pip install 'omninav[dask]'")

    def impatient(where: str, timeout: float, **given: object) -> object:
        return distributed.Client(where, timeout=timeout / 10, **given)

    monkeypatch.setattr("omninav.pipeline.jobs.dask_executor.Client", impatient)
    settings = ExecutorSettings("dask", options={"address": "tcp://127.0.0.1:9"})
    with pytest.raises(BadInput, match=r"tcp://127.0.0.1:9: no scheduler answers"), WorkerPool(settings, tmp_path) as w:
        w.run([job("nothing", tmp_path)])


def lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)
