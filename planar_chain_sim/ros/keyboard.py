"""Keys of the terminal that a program runs in, one by one as they are pressed; the terminal is always put back."""
from __future__ import annotations

from contextlib import suppress
import os
from select import select
import signal
import sys
import termios
from typing import Any

ARROW_RIGHT = 'right arrow'
SEQUENCES = {b'\x1b[C': ARROW_RIGHT, b'\x1bOC': ARROW_RIGHT}   # as terminals send it in their two modes
STDIN = 0


class Keyboard:
    """
    A context in which keys can be read from the terminal on stdin without Enter, and are not shown.

    Where stdin is no terminal there are no keys. In a background job the terminal is left alone: there are keys when
    the job comes to the foreground. What Ctrl-C, Ctrl-Z and the like send stay signals; the terminal is put back before
    they act. To be used in the main thread.
    """

    def __init__(self):
        self._saved: Any = None   # settings of the terminal, while others are in force
        self._handlers: dict = {}  # former ones
        self._open = sys.stdin is not None and os.isatty(STDIN)

    def __enter__(self) -> Keyboard:
        if self._open:
            handlers: dict = {signal.SIGTSTP: self._leave, signal.SIGQUIT: self._leave, signal.SIGTTIN: signal.SIG_IGN,
                              signal.SIGCONT: lambda number, frame: self._take()}
            for number, handler in handlers.items():
                if signal.getsignal(number) != signal.SIG_IGN:
                    self._handlers[number] = signal.signal(number, handler)
            self._take()
        return self

    def __exit__(self, *exception) -> None:
        self._give_back()
        self._open = False
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    @property
    def attached(self) -> bool:
        """Whether keys come here now: there is a terminal, and this process is in its foreground."""
        with suppress(OSError):
            return self._open and os.tcgetpgrp(STDIN) == os.getpgrp()
        return False

    def wait(self, seconds: float) -> list:
        """Return the keys that are pressed within this time, as soon as there are any: characters and ARROW_RIGHT."""
        if not self._saved:
            self._take()   # where the job has come to the foreground
        ready, _, _ = select([STDIN] if self.attached else [], [], [], max(seconds, 0.0))
        if not ready or not self.attached:
            return []
        try:
            pressed = os.read(STDIN, 1024)
        except OSError:   # in the background since a moment ago, or the terminal has gone
            pressed = b''
        self._open = pressed != b'' or not self.attached
        return self._keys(pressed)

    @staticmethod
    def _keys(pressed: bytes) -> list:
        keys = []
        while pressed:
            sequence = next((each for each in SEQUENCES if pressed.startswith(each)), pressed[:1])
            keys.append(SEQUENCES.get(sequence, sequence.decode('latin-1')))
            pressed = pressed[len(sequence):]
        return keys

    def _take(self) -> None:
        """Let keys come one by one and unseen, if the terminal is ours now."""
        if self.attached:
            with suppress(termios.error):
                saved = self._saved or termios.tcgetattr(STDIN)
                changed = [*saved[:3], saved[3] & ~(termios.ICANON | termios.ECHO), *saved[4:]]
                termios.tcsetattr(STDIN, termios.TCSANOW, changed)
                self._saved = saved

    def _give_back(self) -> None:
        if self._saved and self.attached:
            with suppress(termios.error):
                termios.tcsetattr(STDIN, termios.TCSANOW, self._saved)
        self._saved = None

    def _leave(self, number, frame) -> None:
        """Put the terminal back, then stop or end as this signal does without a handler."""
        self._give_back()
        signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
        signal.signal(number, self._leave)   # when it goes on
