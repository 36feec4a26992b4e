"""Python processes that a test talks to."""

import contextlib
import subprocess
import sys


@contextlib.contextmanager
def starter(script, *fixed):
    """start(*arguments): a process of the script with these arguments after the fixed ones, once it has said its first line.

    All are killed at the end.
    """
    started = []

    def start(*arguments):
        process = subprocess.Popen([sys.executable, "-c", script, *map(str, fixed), *arguments], stdin=subprocess.PIPE,
                                   stdout=subprocess.PIPE, text=True)
        started.append(process)
        process.stdout.readline()
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()
