"""When each tick is due: at absolute times of the steady clock, so that lateness does not add up."""
from __future__ import annotations

import ctypes
import os
from struct import pack
import sys
from typing import Optional

LONGEST_LATENESS = 500_000_000  # ns; ticks that are later than this are not caught up with, the time is dropped
LAST_STAMP = 2**31 * 10**9 - 1  # ns; ROS counts no further, which is in January 2038 since the epoch
TIME_SLICE = 100_000  # ns, the shortest that Linux allows: threads with shorter slices run sooner
SCHED_SETATTR = {'x86_64': 314, 'aarch64': 274}  # machine -> number of the system call, for which glibc has no function


def wake_punctually() -> None:
    """
    Let the calling thread wake up on time, as far as Linux allows that without privileges; no failure is reported.

    By default Linux wakes a thread up to 50 us late, to save energy, and may first let another thread use up a time
    slice of some ms. Since Linux 6.12 a thread with shorter slices runs first.
    """
    if sys.platform != 'linux':
        return
    libc = ctypes.CDLL(None)
    libc.prctl(29, 1, 0, 0, 0)  # PR_SET_TIMERSLACK, ns
    number = SCHED_SETATTR.get(os.uname().machine)
    if number and os.sched_getscheduler(0) == os.SCHED_OTHER:
        # struct sched_attr: size, policy, flags, nice as it is, priority, runtime, deadline, period
        attributes = pack('<IIQiIQQQ', 48, os.SCHED_OTHER, 0, os.getpriority(os.PRIO_PROCESS, 0), 0, TIME_SLICE, 0, 0)
        libc.syscall(number, 0, attributes, 0)


def simulated_time(tick: int, step: float) -> int:
    """Return the simulated time of a tick, ns."""
    return round(tick * step * 1e9)


class Pacing:
    """
    Wall times of ticks: tick k is due at start + (k - start tick) * period, and its state is stamped with that time.

    `period`: s of wall time per tick; 0: every tick is due at once, where the owner anchors each. `wall_minus_steady`:
    ns from the steady clock to the epoch, fixed once, so that no step of the system clock ever shows in a stamp.
    `stamp_minus_due`: the same while stamps follow the clock, more after steps that ran ahead of it. `step`: s of
    simulated time per tick, where stamps are that instead. All times are int ns; `now` is of the steady clock.
    """

    def __init__(self, period: float, wall_minus_steady: int, step: Optional[float] = None):
        self.period, self._step = period * 1e9, step
        self.wall_minus_steady = wall_minus_steady
        self._tick = self._start = self.stamp_minus_due = 0
        self._asked: Optional[int] = None  # tick whose due time is kept

    def anchor(self, tick: int, now: int) -> None:
        """Make `tick` due now, at the start or after a pause. Its stamp is now, or later if stamps are ahead."""
        self.stamp_minus_due = max(self.wall_minus_steady, self.stamp(tick) - now)
        self._tick, self._start, self._asked = tick, now, None

    def set_period(self, period: float, tick: int, now: int) -> None:
        """Set another period from `tick` on, which is due now."""
        self.anchor(tick, now)
        self.period = period * 1e9

    def due(self, tick: int) -> int:
        """Return when `tick` is due, on the steady clock."""
        if tick != self._asked:  # the loop asks before it sleeps, after it slept and for the stamp
            self._asked, self._due = tick, self._start + round((tick - self._tick) * self.period)
        return self._due

    def stamp(self, tick: int) -> int:
        """Return the time of the state at `tick`, since the epoch or simulated: it never goes back."""
        time = simulated_time(tick, self._step) if self._step else self.due(tick) + self.stamp_minus_due
        return time if time < LAST_STAMP else LAST_STAMP

    def drop(self, tick: int, now: int) -> int:
        """Make `tick` due now, and shift stamps by the same time; return that time, ns."""
        late = now - self.due(tick)
        self._tick, self._start, self._asked = tick, now, None
        return late
