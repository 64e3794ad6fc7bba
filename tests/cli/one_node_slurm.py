"""A Slurm of one node, this machine, on the loopback device, with all its files in one folder."""

import getpass
import os
import shutil
import socket
import subprocess
import time
from contextlib import ExitStack, contextmanager

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "sinfo")


def is_installed():
    return all(shutil.which(program, path=_path()) for program in PROGRAMS)


def _path():
    return f"{os.environ['PATH']}:/usr/sbin"


@contextmanager
def slurm(folder):
    """Run one; gives the environment in which its commands find it. What it started is ended."""
    user, name = getpass.getuser(), socket.gethostname().split(".")[0]
    folder.chmod(0o755)
    for each in ("state", "spool"):
        (folder / each).mkdir()
    key = folder / "munge.key"
    key.write_bytes(os.urandom(128))
    key.chmod(0o600)
    ports = [_free_port() for _ in range(2)]
    configuration = folder / "slurm.conf"
    configuration.write_text(
        f"""ClusterName=one
SlurmctldHost={name}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
NodeName={name} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
"""
    )
    environment = {**os.environ, "PATH": _path(), "SLURM_CONF": str(configuration)}
    munge = [f"--{kind}-file={folder}/munge.{kind}" for kind in ("key", "pid", "log", "seed")]
    with ExitStack() as processes:

        def begin(*command):
            log = processes.enter_context((folder / f"{command[0]}.out").open("w"))
            process = subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)
            processes.callback(_end, process)

        begin("munged", "--foreground", "--force", "--num-threads=2", f"--socket={folder}/munge.socket", *munge)
        _wait_until((folder / "munge.socket").exists)
        begin("slurmctld", "-D")
        begin("slurmd", "-D")
        _wait_until(lambda: "idle" in _output(environment, "sinfo", "--noheader"))
        yield environment


def _output(environment, *command):
    return subprocess.run(command, env=environment, capture_output=True, text=True).stdout


def _end(process):
    process.terminate()
    process.wait()


def _wait_until(happened):
    until = time.monotonic() + 120.0
    while not happened():
        assert time.monotonic() < until, "Slurm does not start; see its files"
        time.sleep(0.1)


def _free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]
