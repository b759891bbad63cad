"""Requests to a thread that ticks: answered between two ticks, left or withdrawn in a long one, never lost."""
from queue import SimpleQueue
from threading import Event, Thread
from time import monotonic_ns

from live import PATIENCE
import pytest

from planar_chain_sim.ros.requests import between_ticks, Requests

LONG_AGO = 10**18   # ns


class Owner:
    """Something with a thread that answers when it is let."""

    def __init__(self):
        self.woken, self.logged, self.done = Event(), [], []
        self.requests = Requests(self.woken.set)

    @between_ticks
    def act(self, what):
        self.done.append(what)
        return True, f'{what} done'

    @between_ticks(timeout=1e8, withdraw=True)
    def look(self, what):
        return self.act(what)


@pytest.fixture
def owner():
    owner = Owner()
    yield owner
    owner.requests.end()


def asked(function, *arguments):
    """Call a function in another thread and return the queue that gets its answer."""
    answers = SimpleQueue()
    Thread(target=lambda: answers.put(function(*arguments)), daemon=True).start()
    return answers


def answer_all(owner, count):
    """Be the thread that ticks until so many requests are done."""
    owner.requests.thread = None
    while len(owner.done) < count:
        assert owner.woken.wait(PATIENCE)
        owner.woken.clear()
        owner.requests.answer(owner.logged.append)


def test_requests_of_other_threads_are_done_in_order_by_the_owner(owner):
    first = asked(owner.act, 'a')
    answer_all(owner, 1)
    second = asked(owner.act, 'b')
    answer_all(owner, 2)
    assert first.get(timeout=PATIENCE) == (True, 'a done') and second.get(timeout=PATIENCE) == (True, 'b done')
    assert owner.done == ['a', 'b'] and not owner.requests and owner.logged == []


def test_the_owner_itself_does_not_wait(owner):
    import threading
    owner.requests.thread = threading.current_thread()
    assert owner.look('at once') == (True, 'at once done')


def test_the_time_out_counts_from_the_beginning_of_the_tick(owner):
    """Of 1e8 s: whoever asks in a tick that began long before that has an answer now."""
    owner.requests.in_tick_since = monotonic_ns() - LONG_AGO
    assert asked(owner.look, 'x').get(timeout=PATIENCE) == (
        False, 'not done: the simulation is in a tick that takes longer than 1e+08 s')
    assert not owner.requests, 'withdrawn'
    assert owner.requests.tick_under_way.startswith('a tick is under way for 10000000')
    for what in 'abc':
        assert asked(owner.act, what).get(timeout=PATIENCE)[1].startswith('still under way after 2 s')
    owner.requests.in_tick_since = None
    owner.requests.thread = None
    owner.requests.answer(owner.logged.append)
    assert owner.done == ['a', 'b', 'c'] and owner.logged == [f'late answer to act: {what} done' for what in 'abc']


def test_at_the_end_nobody_waits(owner):
    waiting = asked(owner.look, 'x')
    assert owner.woken.wait(PATIENCE)
    owner.requests.end()
    assert waiting.get(timeout=PATIENCE) == (False, 'the simulation is ending')
    assert owner.act('y') == (False, 'the simulation is ending')
