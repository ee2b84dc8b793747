"""A Slurm cluster on loopback: a controller and some nodes as child processes, all of their state
below one folder.

No munge: daemons and commands are one user's, on addresses that nobody else can reach, so
authentication none is enough. The daemons stay in the foreground and die with the test, however
that ends.
"""
import contextlib
import ctypes
import getpass
import os
import pathlib
import signal
import socket
import subprocess
import time

PR_SET_PDEATHSIG = 1

CONFIGURATION = """ClusterName=loopback
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={controller}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/none
CredType=cred/none
AuthInfo=cred_expire=5
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
SwitchType=switch/none
TmpFS={folder}
PropagateResourceLimits=NONE
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""  # cred_expire is also how long a job waits before it starts again; less is refused
NODE = ("NodeName=n{index} NodeHostname=localhost NodeAddr=127.0.0.1 Port={port} CPUs={cpus} "
        "State=UNKNOWN\n")


def free_ports(count):
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]


def die_with_parent():
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


class LoopbackCluster:
    def __init__(self, folder, nodes):
        self.folder = pathlib.Path(folder)
        self.nodes = nodes
        self.daemons = []
        self.environment = {
            name: value for name, value in os.environ.items() if not name.startswith("SLURM_")
        }
        self.environment["SLURM_CONF"] = str(self.folder / "slurm.conf")

    def __enter__(self):
        (self.folder / "state").mkdir()
        controller, *ports = free_ports(1 + self.nodes)
        text = CONFIGURATION.format(controller=controller, user=getpass.getuser(),
                                    folder=self.folder)
        for index, port in enumerate(ports, 1):
            (self.folder / f"spool-n{index}").mkdir()
            text += NODE.format(index=index, port=port, cpus=os.cpu_count())
        (self.folder / "slurm.conf").write_text(text, encoding="utf-8")
        try:
            self.start("slurmctld", "-D", "-c", "-i")
            for index in range(1, self.nodes + 1):
                self.start("slurmd", "-D", "-N", f"n{index}", "-c")
            idle = lambda: self.command("sinfo", "-h", "-t", "idle", "-o", "%D").strip()
            self.wait_for(lambda: idle() == str(self.nodes), "all nodes to be idle", 60)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for daemon in reversed(self.daemons):
            daemon.terminate()
        for daemon in self.daemons:
            try:
                daemon.wait(timeout=10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()

    def start(self, *command):
        with open(self.folder / "daemons.log", "ab") as log:
            self.daemons.append(
                subprocess.Popen(command, env=self.environment, stdout=log, stderr=log,
                                 preexec_fn=die_with_parent))

    def command(self, *command, **variables):
        run = subprocess.run(command, env=self.environment | variables, capture_output=True,
                             text=True, check=False)
        return run.stdout if run.returncode == 0 else ""

    def wait_for(self, condition, what, limit_s):
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise AssertionError(f"waited {limit_s} s for {what}\n{self.logs()}")
            time.sleep(0.1)

    def logs(self):
        return "".join(f"--- {path.name}\n{path.read_text(errors='replace')[-3000:]}"
                       for path in sorted(self.folder.glob("*.log")))
