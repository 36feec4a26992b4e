"""Ctrl-C and a request to end (SIGTERM, SIGHUP) reach the main thread whatever it waits for."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

REQUESTS = (signal.SIGTERM, signal.SIGHUP)
"""Raise KeyboardInterrupt, as Ctrl-C does; a second one ends the process at once. Under nohup a hangup stays ignored."""
NUDGE = signal.SIGURG
"""Only ends the system call that the main thread waits in; processes that do not ask for it never notice it."""
NUDGE_S = 0.1
"""Between nudges."""
NUDGES = 20


@contextlib.contextmanager
def interrupts_heard() -> Iterator[None]:
    """KeyboardInterrupt for as long as the context lasts; outside the main thread signals are left as they are.

    Python calls a signal's handler between two bytecodes. A signal that comes after the last of them, while the main thread goes
    over to a wait (it may first wait for another thread to take the interpreter's lock), would be heard only when the wait is
    over. A thread that is told of each signal at once ends that wait.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    told, tell = os.pipe()
    os.set_blocking(tell, False)
    nohup = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    before = {how: signal.signal(how, _interrupt) for how in REQUESTS if not (nohup and how == signal.SIGHUP)}
    before[NUDGE] = signal.signal(NUDGE, _ignore)
    told_before = signal.set_wakeup_fd(tell, warn_on_full_buffer=False)
    threading.Thread(target=_nudge, args=(told, threading.get_ident()), daemon=True).start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(told_before)
        for how, handler in before.items():
            signal.signal(how, handler or signal.SIG_DFL)  # None: another library's, which Python cannot put back
        os.close(tell)


def _nudge(told: int, main: int) -> None:
    """Ends the main thread's waits for a while after each interrupt. told: gets a byte a signal, and its end."""
    while number := os.read(told, 1):
        if number[0] in (signal.SIGINT, *REQUESTS):
            for _ in range(NUDGES):
                time.sleep(NUDGE_S)
                signal.pthread_kill(main, NUDGE)
    os.close(told)


def _interrupt(signum: int, frame: Any) -> None:
    signal.signal(signum, signal.SIG_DFL)
    raise KeyboardInterrupt


def _ignore(signum: int, frame: Any) -> None:
    pass
