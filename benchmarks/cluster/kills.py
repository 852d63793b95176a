"""One experiment by every executor, with something killed in the middle: its verdicts must be the same bytes.

`python benchmarks/cluster/kills.py FOLDER [-- WORD …]`: the words of the experiment, by default Figure 3 in small.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.cluster.one_node_slurm import OneNodeSlurm, wait_for

WORDS = ["+experiment=omniview_mcl/figure_3", "profile=quick"]
LIMIT_S = 1800.0
PORT = 26786
AT = 0.3
"""What share of the repetitions is done when something is killed."""


class Client:
    """The command, in a folder of its own."""

    def __init__(self, folder: Path, words: list[str], *more: str, **environment: str) -> None:
        self.folder = folder
        self._words = [sys.executable, "-m", "omninav", *words, *more]
        self._words += [f"runs={folder}", f"cache={folder}/.cache"]
        self._environment = {**os.environ, **environment}
        self.begun = time.monotonic()
        self.start()

    def start(self) -> None:
        """Type the command, or type it again."""
        self.folder.mkdir(parents=True, exist_ok=True)
        log = (self.folder / "said").open("ab")
        self.process = subprocess.Popen(self._words, env=self._environment, stdout=log, stderr=log, cwd=self.folder)

    def wait_for_results(self, number: int) -> None:
        """Wait until some repetitions are done."""
        wait_for(lambda: self.process.poll() is not None or len(self.results()) >= number, "results", LIMIT_S)
        if self.process.poll() is not None:
            raise SystemExit(f"it ended too soon: {self.folder / 'said'}")

    def results(self) -> list[Path]:
        """The files of the repetitions that are done."""
        return sorted(self.folder.glob("*/conditions/*/seed_*.json"))

    def end(self) -> int:
        """Its exit code."""
        return self.process.wait(LIMIT_S)

    def contents(self) -> tuple[bytes, dict[str, Any]]:
        """The verdicts, byte by byte, and the metrics of every repetition."""
        (result,) = self.folder.glob("*/*.result.json")
        found = {}
        for file in self.results():
            plain = json.loads(file.read_text())
            found[f"{file.parent.name}/{file.name}"] = {name: plain[name] for name in ("seed", "metrics", "context")}
        return json.dumps(json.loads(result.read_bytes())["verdicts"]).encode(), found


class Dask:
    """A scheduler and two workers, started as one does by hand; a context manager."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Dask":
        self.start("scheduler")
        self.start("worker 0")
        self.start("worker 1")
        return self

    def __exit__(self, *_: object) -> None:
        for name in list(self._running):
            self.kill(name, signal.SIGTERM)

    def start(self, name: str) -> None:
        """Start a part."""
        what = name.partition(" ")[0]
        own = ["--port", str(PORT), "--no-dashboard"] if what == "scheduler" else [f"tcp://127.0.0.1:{PORT}"]
        own += (
            [] if what == "scheduler" else ["--nthreads", "1", "--no-dashboard", "--no-nanny", "--death-timeout", "60"]
        )
        module = "distributed.cli.dask_scheduler" if what == "scheduler" else "distributed.cli.dask_worker"
        log = (self._folder / f"{name.replace(' ', '_')}.out").open("ab")
        words = [sys.executable, "-c", f"from {module} import main; main()", *own]
        self._running[name] = subprocess.Popen(words, stdout=log, stderr=log, cwd=self._folder)

    def kill(self, name: str, how: signal.Signals = signal.SIGKILL) -> None:
        """End a part."""
        process = self._running.pop(name)
        process.send_signal(how)
        process.wait(60)


def worker_of_slurm(folder: Path) -> int:
    """The process of a worker that Slurm has started for the experiment in `folder`."""
    for each in Path("/proc").iterdir():
        if each.name.isdigit():
            try:
                words = (each / "cmdline").read_bytes().split(b"\0")
                if b"dask_worker" in b" ".join(words) and (each / "cwd").resolve().is_relative_to(folder):
                    return int(each.name)
            except OSError:
                continue
    raise SystemExit("no worker was found")


def main() -> None:
    """Run all, one after the other, and print a row for each."""
    place = Path(sys.argv[1]).resolve()
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else WORDS
    print("| executor | killed in the middle | exit codes | seconds | repetitions kept | verdicts | all metrics |")
    print("|---|---|---|---:|---:|---|---|", flush=True)
    alone = Client(place / "local", words, "executor.workers=2")
    reference_code = alone.end()
    reference = alone.contents()
    total = len(alone.results())
    middle = int(AT * total)

    def row(where: str, killed: str, client: Client, codes: list[int], kept: int) -> None:
        verdicts, metrics = client.contents()
        same = ["same bytes" if verdicts == reference[0] else "DIFFER", "same" if metrics == reference[1] else "DIFFER"]
        seconds = time.monotonic() - client.begun
        shown = " then ".join(map(str, codes))
        print(f"| {where} | {killed} | {shown} | {seconds:.0f} | {kept} of {total} | {' | '.join(same)} |", flush=True)

    row("local, 2 workers", "nothing", alone, [reference_code], 0)

    def case(name: str, killed: str, how: Callable[[Client], list[int]], *more: str, **environment: str) -> None:
        client = Client(place / f"{name}_{killed}".replace(" ", "_").replace(",", ""), words, *more, **environment)
        client.wait_for_results(middle)
        kept = len(client.results())
        codes = how(client)
        row(name, killed, client, codes, kept)

    def client_dies(client: Client) -> list[int]:
        client.process.kill()
        first = client.end()
        client.start()
        return [first, client.end()]

    def nothing(client: Client) -> list[int]:
        return [client.end()]

    case("local, 1 worker", "nothing", nothing, "executor.workers=1")
    with OneNodeSlurm(place / "slurm_parts", port=PORT + 100) as slurm:
        on_slurm = ("executor=slurm", "executor.workers=2", "executor.memory=2GB")

        def slurm_worker_dies(client: Client) -> list[int]:
            os.kill(worker_of_slurm(client.folder), signal.SIGKILL)
            return [client.end()]

        def job_is_cancelled(client: Client) -> list[int]:
            slurm.command("scancel", slurm.command("squeue", "--noheader", "--format=%A").split()[0])
            return [client.end()]

        def controller_dies(client: Client) -> list[int]:
            slurm.kill("slurmctld")
            time.sleep(5)
            slurm.start_controller()
            return [client.end()]

        case("slurm", "worker", slurm_worker_dies, *on_slurm, **slurm.environment)
        case("slurm", "batch job", job_is_cancelled, *on_slurm, **slurm.environment)
        case("slurm", "controller", controller_dies, *on_slurm, **slurm.environment)
        case("slurm", "client", client_dies, *on_slurm, **slurm.environment)
    with Dask(place / "dask_parts") as dask:
        address = ("executor=dask", f"executor.address=tcp://127.0.0.1:{PORT}")

        def worker_dies(client: Client) -> list[int]:
            dask.kill("worker 0")
            dask.start("worker 2")
            return [client.end()]

        def scheduler_dies(client: Client) -> list[int]:
            dask.kill("scheduler")
            first = client.end()
            dask.start("scheduler")
            dask.start("worker 3")
            client.start()
            return [first, client.end()]

        case("dask", "worker", worker_dies, *address)
        case("dask", "client", client_dies, *address)
        case("dask", "scheduler", scheduler_dies, *address)
    case("local, 2 workers", "client", client_dies, "executor.workers=2")


if __name__ == "__main__":
    main()
