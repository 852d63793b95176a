import re

from sample_metrics import measured, sweep_row

from omninav.pipeline.report.sweep_page import write_sweep_page


def test_a_failed_job_stands_in_the_sweeps_page_with_its_error_and_log(tmp_path):
    good, bad = tmp_path / "0", tmp_path / "1"
    for folder, file in ((good, "report.html"), (bad, "run.log")):
        folder.mkdir()
        (folder / file).write_text("x")
    rows = [
        sweep_row(0, measured(), good, overrides="seed=0"),
        sweep_row(1, None, bad, overrides="seed=1", status="failed", error="stage 'x' failed: <no>"),
    ]
    page = write_sweep_page(tmp_path, rows).read_text()
    assert 'href="0/report.html"' in page
    assert 'href="1/run.log"' in page
    assert "stage &#39;x&#39; failed: &lt;no&gt;" in page
    assert "2 jobs: 1 complete, 1 failed" in page
    assert "0.050" in page
    assert "http" not in page


def test_what_is_the_same_in_all_jobs_is_said_once_and_the_best_is_marked(tmp_path):
    rows = [sweep_row(n, metrics) for n, metrics in enumerate((measured(loss_rate=0.5), measured()))]
    page = write_sweep_page(tmp_path, rows).read_text()
    assert "all jobs: Position error, median, after convergence: 0.050 m, Converged: after 12 frames<" in page
    assert set(re.findall("<th>([^<]*)</th>", page)) == {"job", "jobs", "Loss rate (%)"}
    assert re.findall(r'<td class="best">([^<]*)</td>', page) == ["12.5"]


def test_a_sweeps_page_shows_what_varies_in_columns_of_its_own(tmp_path):
    typed = "variant=a ++nodes.x.gain={} seed=3"
    rows = [sweep_row(n, measured(loss_rate=3.3e-14 * n), overrides=typed.format(n)) for n in range(2)]
    page = write_sweep_page(tmp_path, rows).read_text()
    assert '<th class="text">nodes.x.gain</th>' in page
    assert '<td class="text"><code>1</code></td>' in page
    assert "Set for all jobs: <code>variant=a seed=3</code>" in page
    assert "++" not in page.partition("<body>")[2].partition("<script>")[0]
    assert "e-14" not in page
