"""When ticks are due and how states are stamped, with a clock that the test moves."""
import ctypes
import os
import platform
from struct import unpack_from
import sys
from threading import Thread

import pytest

from planar_chain_sim.ros.pacing import Pacing, SCHED_SETATTR, TIME_SLICE, wake_punctually

MS = 1_000_000
WALL = 1_700_000_000_000_000_000


def test_due_times_do_not_add_up_rounding():
    pacing = Pacing(1.0 / 300.0, WALL)
    pacing.anchor(0, 5 * MS)
    assert pacing.due(300 * 3600) == 5 * MS + 3600 * 10**9
    assert pacing.stamp(300 * 3600) == WALL + pacing.due(300 * 3600)


def test_dropped_time_shifts_due_times_and_stamps_alike():
    pacing = Pacing(1e-3, WALL)
    pacing.anchor(0, 0)
    assert pacing.drop(11, 500 * MS) == 489 * MS
    assert pacing.due(11) == 500 * MS and pacing.stamp(11) == WALL + 500 * MS
    assert pacing.due(12) == 501 * MS and pacing.stamp(12) == WALL + 501 * MS


def test_stamps_never_go_back_when_steps_ran_ahead_of_the_clock():
    pacing = Pacing(1e-3, WALL)
    pacing.anchor(0, 0)
    ahead = pacing.stamp(1000)         # a thousand steps by service within 10 ms
    pacing.anchor(1000, 10 * MS)
    assert pacing.due(1000) == 10 * MS
    assert pacing.stamp(1000) == ahead and pacing.stamp(1001) == ahead + MS


def test_after_a_pause_stamps_are_of_now():
    pacing = Pacing(1e-3, WALL)
    pacing.anchor(0, 0)
    pacing.anchor(20, 7000 * MS)
    assert pacing.stamp(20) == WALL + 7000 * MS


def test_slower_than_real_time_stamps_follow_the_wall():
    pacing = Pacing(1e-3 / 0.5, WALL)
    pacing.anchor(0, 0)
    assert pacing.stamp(1000) == WALL + 2000 * MS


@pytest.mark.skipif(sys.platform != 'linux' or platform.machine() not in SCHED_SETATTR, reason='needs Linux here')
def test_a_punctual_thread_is_woken_without_slack_and_keeps_its_nice_value():
    def look():
        os.setpriority(os.PRIO_PROCESS, 0, 3)  # of this thread
        for ask in (lambda: None, wake_punctually):
            ask()
            attributes = ctypes.create_string_buffer(56)
            assert libc.syscall(SCHED_SETATTR[platform.machine()] + 1, 0, attributes, 56, 0) == 0   # sched_getattr
            seen.append((libc.prctl(30, 0, 0, 0, 0), *unpack_from('<IQi4xQ', attributes, 4)))       # PR_GET_TIMERSLACK

    libc, seen = ctypes.CDLL(None), []
    thread = Thread(target=look)
    thread.start()
    thread.join()
    assert len(seen) == 2
    before, (slack, policy, flags, nice, runtime) = seen
    assert before[0] > 1 and before[4] != TIME_SLICE
    assert (slack, policy, nice) == (1, os.SCHED_OTHER, 3)
    version = tuple(int(part) for part in platform.release().split('.')[:2])
    if version >= (6, 12):   # the first that has time slices for each thread
        assert runtime == TIME_SLICE
