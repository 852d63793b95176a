"""Executors by Dask: a scheduler that runs already, or workers that a batch system such as Slurm starts."""

import logging
import shutil
import signal
import sys
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from typing import Any, TypeVar

from distributed import Client
from distributed.comm import get_address_host_port

from omninav.pipeline.graph.problems import BadInput, counted

from .executors import WORD, ExecutorSettings, own_options

START_S = 60.0
"""Longest wait for a scheduler's answer, seconds."""
SILENT_S = 10.0
"""Longest wait for a first worker before a line says so, seconds."""
WORKER_MEMORY = 1_000_000_000
"""Memory of a worker beside its job, bytes."""
JOB_MEMORY = 4_000_000_000
"""Memory asked of a batch system where nobody states how much a job takes, bytes."""
T = TypeVar("T")


class DaskExecutor(Executor):
    """Dask's own executor, which ends with what was started for it."""

    def __init__(self, client: Any, cluster: Any = None) -> None:
        self._client, self._cluster = client, cluster
        self._executor = client.get_executor(pure=False)

    @property
    def workers(self) -> int:
        """Number of jobs that run at a time, by the workers that are connected now."""
        return sum(int(each["nthreads"]) for each in self._client.scheduler_info(n_workers=-1)["workers"].values())

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> "Future[T]":
        """Submits a job, as every executor does. Raises `RuntimeError` where the scheduler is gone."""
        if self._client.status != "running":
            raise RuntimeError("its scheduler is gone")
        future: Future[T] = self._executor.submit(fn, *args, **kwargs)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the connection, and what was started for it."""
        with suppress(Exception):  # its scheduler may be gone
            self._executor.shutdown(wait and not cancel_futures)
        with suppress(Exception):
            self._client.close(timeout=5)
        if self._cluster is not None:
            with suppress(Exception):  # workers that were refused cannot be closed
                self._cluster.close(timeout=10)


def dask_cluster(settings: ExecutorSettings) -> DaskExecutor:
    """`executor=dask`: the scheduler at `executor.address`, with whatever workers it has."""
    options = own_options(settings, ("address",))
    if "address" not in options:
        raise BadInput("executor=dask: where is its scheduler? type executor.address=tcp://HOST:8786")
    return DaskExecutor(_client(options["address"]))


def slurm(settings: ExecutorSettings) -> DaskExecutor:
    """`executor=slurm`: each worker is a batch job of one core; one that dies is started again."""
    if shutil.which("sbatch") is None:
        raise BadInput("executor=slurm: there is no command 'sbatch' here; type this on a login node of the cluster")
    on_interrupt = signal.getsignal(signal.SIGINT)
    from dask_jobqueue import SLURMCluster

    if signal.getsignal(signal.SIGINT) is not on_interrupt:  # its import lets Ctrl-C end the program with code 0
        signal.signal(signal.SIGINT, on_interrupt)
    options = own_options(settings, ("partition", "time", "account", "interface"))
    workers = settings.workers or 4
    memory = (settings.memory or JOB_MEMORY) + WORKER_MEMORY
    logs = str(settings.folder / "workers") if settings.folder is not None else ""
    _quiet()
    cluster = SLURMCluster(
        cores=1,
        processes=1,
        python=f"{sys.executable} -P",  # it imports nothing from the folder that it is started in
        memory=f"{memory}B",
        job_name="omninav",
        queue=options.get("partition"),
        walltime=options.get("time", "12:00:00"),
        account=options.get("account"),
        interface=options.get("interface"),
        log_directory=logs if WORD.fullmatch(logs) else None,
        scheduler_options={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
    )
    try:
        _submit(cluster, workers)
        client = _client(cluster)
        try:
            client.wait_for_workers(1, timeout=SILENT_S)
        except TimeoutError:
            none = f"0 of {counted(workers, 'worker')} so far"
            print(f"executor=slurm: waiting for Slurm, {none}; `squeue --me` says why", file=sys.stderr, flush=True)
        return DaskExecutor(client, cluster)
    except BaseException:
        with suppress(Exception):
            cluster.close()
        raise


def _submit(cluster: Any, workers: int) -> None:
    """Submit workers, and keep their number. Raises `BadInput` with the words of an `sbatch` that accepts none."""
    cluster.scale(workers)
    with suppress(RuntimeError, ValueError):  # raised or not, whichever of two tasks meets it
        cluster.sync(lambda: cluster)
    if not any(worker.job_id for worker in cluster.workers.values()):
        try:
            cluster.sync(next(iter(cluster.workers.values())).start)
        except (RuntimeError, ValueError) as error:
            words = str(error).rpartition("stderr:\n")[2]
            raise BadInput(f"executor=slurm: sbatch starts no worker: {words}") from None
    cluster.adapt(minimum=workers, maximum=workers)


def _client(where: Any) -> Any:
    _quiet()
    try:
        if isinstance(where, str) and not where.startswith("inproc:"):
            get_address_host_port(where)  # a client of what is no address complains again when it is thrown away
        return Client(where, timeout=START_S if not isinstance(where, str) else 5, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise BadInput(f"executor.address={where}: no scheduler answers there ({error!s:.200})") from None


def _quiet() -> None:
    """Silence Dask's loggers: a lost worker or scheduler is reported in one line here."""
    for name in logging.root.manager.loggerDict:  # each of Dask's has a level of its own
        if name.partition(".")[0] in ("asyncio", "distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
