"""Requests to the thread that ticks: made by other threads, answered between two ticks."""
from __future__ import annotations

from collections import deque
from functools import wraps
from queue import Empty, SimpleQueue
from threading import current_thread, Thread
from time import monotonic_ns
from typing import Callable, Optional

ANSWER_TIMEOUT = 2.0   # s
LAST_CHANCE = 0.05     # s for the answer to a request that comes during a long tick
ENDING = 'the simulation is ending'


class Request:
    """Work for the tick thread and the queue for its answer; `late`: the caller no longer waits."""

    def __init__(self, name: str, work: Callable):
        self.name, self.work, self.reply, self.late = name, work, SimpleQueue(), False


class Requests:
    """
    The requests to one thread.

    `wake()` ends its sleep. in_tick_since: when the tick under way began, ns, None between two ticks; set by its owner.
    """

    def __init__(self, wake: Callable[[], None]):
        self._wake, self._waiting, self._ended = wake, deque(), False
        self.thread: Optional[Thread] = None
        self.in_tick_since: Optional[int] = None

    def __bool__(self):
        return bool(self._waiting)

    @property
    def tick_under_way(self) -> str:
        """Say how long the tick under way has taken, '' between two ticks."""
        since = self.in_tick_since
        return '' if since is None else f'a tick is under way for {(monotonic_ns() - since) * 1e-9:.1f} s'

    def end(self) -> None:
        """Refuse all further requests."""
        self._ended = True

    def ask(self, name: str, work: Callable, timeout: float, withdraw: bool):
        """
        Let the tick thread call `work()` between two ticks; return its answer, (success, sentence or result).

        If the tick under way takes longer than `timeout`, s, counted from its beginning, the answer is (False,
        sentence). The work is then done after that tick and its answer logged, or not done at all if `withdraw`.
        """
        request = Request(name, work)
        self._waiting.append(request)
        self._wake()
        now = monotonic_ns()
        since = self.in_tick_since
        until = max((now if since is None else since) + round(timeout * 1e9), now + round(LAST_CHANCE * 1e9))
        while not self._ended:
            try:
                return request.reply.get(timeout=0.05 if request.late else max(min(until - monotonic_ns(), 50_000_000),
                                                                               0) * 1e-9)
            except Empty:
                if monotonic_ns() < until or request.late:
                    continue
            if not withdraw:
                return self._leave(request)
            try:
                self._waiting.remove(request)
                return False, f'not done: the simulation is in a tick that takes longer than {timeout:g} s'
            except ValueError:
                request.late = True   # it is being served already, which takes no tick
        return False, ENDING

    def answer(self, log: Callable[[str], None]) -> None:
        """Serve the waiting requests; `log(sentence)` takes the answers for which nobody waits any more."""
        while self._waiting:
            try:
                request = self._waiting.popleft()
            except IndexError:   # withdrawn
                return
            done, answer = request.work()
            request.reply.put((done, answer))
            if request.late:
                log(f'late answer to {request.name}: {answer}')

    @staticmethod
    def _leave(request: Request):
        """Stop waiting for an answer, which then goes to the log."""
        request.late = True
        try:
            return request.reply.get_nowait()
        except Empty:
            return False, (f'still under way after {ANSWER_TIMEOUT:g} s, as a tick takes long; the result follows '
                           'in the log and on ~/events')


def between_ticks(method: Optional[Callable] = None, *, timeout: float = ANSWER_TIMEOUT, withdraw: bool = False):
    """
    Make a method, which returns (success, sentence or result), callable from any thread.

    It always runs in the tick thread, between two ticks. `timeout`, `withdraw`: of Requests.ask. The method's object
    has its Requests as `requests`.
    """
    if method is None:
        return lambda method: between_ticks(method, timeout=timeout, withdraw=withdraw)

    @wraps(method)
    def call(self, *arguments):
        if current_thread() is self.requests.thread:
            return method(self, *arguments)
        return self.requests.ask(method.__name__, lambda: method(self, *arguments), timeout, withdraw)
    return call
