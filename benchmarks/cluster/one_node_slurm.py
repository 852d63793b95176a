"""A real Slurm on this machine alone, from Debian's packages: `apt-get install slurm-wlm munge`.

`python benchmarks/cluster/one_node_slurm.py FOLDER` starts it and prints what to export; Ctrl-C ends it. Whoever starts
it is its Slurm user, and runs its jobs. It keeps no accounting and puts no job into a control group.
"""

import os
import pwd
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

CONF = """\
ClusterName=omninav
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmdPort={port_of_node}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0
KillWait=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} Boards=1 CoresPerSocket={cpus} ThreadsPerCore=1 RealMemory={memory}
PartitionName=short Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


class OneNodeSlurm:
    """The daemons; a context manager. `environment` is what Slurm's commands need."""

    def __init__(self, folder: Path, cpus: int = 2, port: int = 26817) -> None:
        self.folder = folder.resolve()
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        user, host = pwd.getpwuid(os.getuid()).pw_name, socket.gethostname().partition(".")[0]
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2**20 * 9 // 10
        values = {"user": user, "host": host, "port": port, "port_of_node": port + 1, "cpus": cpus, "memory": memory}
        text = CONF.format(folder=self.folder, **values)
        (self.folder / "slurm.conf").write_text(text)
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        self.folder.chmod(0o755)
        self.environment = {"SLURM_CONF": str(self.folder / "slurm.conf")}

    def __enter__(self) -> "OneNodeSlurm":
        try:
            socket_file = self.folder / "munge.socket"
            parts = [
                f"--{name}={self.folder}/munge.{name.removesuffix('-file')}"
                for name in ("key-file", "pid-file", "log-file")
            ]
            seed = f"--seed-file={self.folder}/munge.seed"
            self._start("munged", "/usr/sbin/munged", "-F", "-f", f"--socket={socket_file}", *parts, seed)
            wait_for(socket_file.exists, "munged")
            self.start_controller()
            self._start("slurmd", "/usr/sbin/slurmd", "-D")
            wait_for(lambda: "idle" in self.command("sinfo", "--noheader", "--format=%T"), "slurmd")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if "slurmd" in self._running:
            self.command("scancel", "--user", pwd.getpwuid(os.getuid()).pw_name)
        for name in ("slurmd", "slurmctld", "munged"):
            self.kill(name, signal.SIGTERM)

    def start_controller(self) -> None:
        """Start what decides where jobs run; its queue is as it was left."""
        self._start("slurmctld", "/usr/sbin/slurmctld", "-D")

    def kill(self, name: str, how: signal.Signals = signal.SIGKILL) -> None:
        """End a daemon."""
        process = self._running.pop(name, None)
        if process is not None:
            process.send_signal(how)
            process.wait(20)

    def command(self, *words: str) -> str:
        """What one of Slurm's commands prints; '' where it fails."""
        ended = subprocess.run(
            words, env={**os.environ, **self.environment}, capture_output=True, text=True, timeout=30
        )
        return ended.stdout

    def _start(self, name: str, *words: str) -> None:
        log = (self.folder / f"{name}.out").open("ab")
        environment = {**os.environ, **self.environment}
        self._running[name] = subprocess.Popen(words, env=environment, stdout=log, stderr=log, start_new_session=True)


def wait_for(condition: Callable[[], bool], what: str, seconds: float = 60.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"{what} did not come up within {seconds:.0f} s")
        time.sleep(0.1)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    with OneNodeSlurm(Path(sys.argv[1])) as slurm:
        print(*(f"export {name}={value}" for name, value in slurm.environment.items()), sep="\n", flush=True)
        signal.pause()
