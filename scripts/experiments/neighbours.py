"""Processes that spin beside a measurement, for the scripts of this folder."""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time

PR_SET_PDEATHSIG = 1


@contextlib.contextmanager
def busy(count=1, cpu=None):
    """`count` of them, on `cpu` alone if it is given. They end with the block, and with the process
    that began them: a run that is killed leaves nobody spinning beside the next."""

    def prepare():
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if cpu is not None:
            os.sched_setaffinity(0, {cpu})

    spin = [sys.executable, "-c", "while True: pass"]
    processes = [subprocess.Popen(spin, preexec_fn=prepare) for _ in range(count)]
    try:
        time.sleep(0.2 if count else 0)
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
