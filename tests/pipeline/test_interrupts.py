"""Interrupts reach the main thread whatever it waits for."""

import signal
import subprocess
import sys

import pytest

from gsac.pipeline.cli import execute

MISSED = """
import os, signal, sys, threading, time
from gsac.pipeline.interrupts import interrupts_heard

def miss():
    time.sleep(0.2)  # the main thread waits by now; the signal comes to this thread, so that its wait goes on
    signal.pthread_kill(threading.get_ident(), signal.Signals[sys.argv[1]])

def wait_for_a_byte():
    os.read(os.pipe()[0], 1)

def wait_for_a_thread():
    threading.Event().wait()

signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whatever the tests themselves run under
with interrupts_heard():
    threading.Thread(target=miss).start()
    try:
        globals()[sys.argv[2]]()
    except KeyboardInterrupt:
        print("heard")
"""

HANGUP = """
import os, signal
from gsac.pipeline.interrupts import interrupts_heard

signal.signal(signal.SIGHUP, signal.SIG_IGN)
with interrupts_heard():
    os.kill(os.getpid(), signal.SIGHUP)
print("done")
"""


@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.parametrize("wait", ["wait_for_a_byte", "wait_for_a_thread"])
def test_an_interrupt_that_no_wait_of_the_main_thread_has_noticed_ends_that_wait(how, wait):
    done = subprocess.run([sys.executable, "-c", MISSED, how, wait], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (0, "heard\n", "")


def test_signals_have_their_handlers_of_before_after_a_command():
    def handlers():
        return [signal.getsignal(how) for how in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGURG)]

    before = handlers()
    execute([])
    assert handlers() == before


def test_a_command_under_nohup_outlives_its_terminal():
    done = subprocess.run([sys.executable, "-c", HANGUP], capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stdout) == (0, "done\n")
