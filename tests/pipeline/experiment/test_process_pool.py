"""Jobs in processes of their own: messages, errors and deaths."""

from pathlib import Path

from omninav.pipeline.experiment.process_pool import Job, run_jobs


def test_a_job_that_fails_or_dies_is_reported_and_the_others_finish(tmp_path: Path):
    jobs = [
        Job(name, f"pool_jobs:{name}", {"messages": 3}, tmp_path / f"{name}.log") for name in ("die", "fail", "count")
    ]
    messages, ended = [], {}
    errors = run_jobs(
        jobs,
        2,
        lambda job, message: messages.append((job.name, message["number"])),
        lambda job, error: ended.update({job.name: error}),
    )
    assert errors == {"die": "its process was ended by SIGKILL", "fail": "ValueError: no such number"}
    assert ended == {**errors, "count": None}
    assert messages == [("count", 0), ("count", 1), ("count", 2)]
    assert (tmp_path / "count.log").read_text() == "counted\n"
    assert "Traceback" in (tmp_path / "fail.log").read_text()
