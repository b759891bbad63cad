"""Deviation: how far two motions of the same joints differ, joint by joint."""
from __future__ import annotations

from typing import Optional

import numpy as np

BLOCK = 1024                            # states that are evaluated together
CURVE = 2048                            # points of a curve that is kept, at most
DECADES = (1e-12, 1e-9, 1e-6, 1e-3, 1.0)   # rad or m


class Deviation:
    """
    Differences of positions and velocities of `joints` joints, as states are added; read after close().

    states: how many were added. equal: all are equal, bit for bit. largest: (2, joints) of positions, rad or m, and of
    velocities, rad/s or m/s; largest_at: (2, joints), the times of these, s. apart: (joints,) the first time at which a
    position differs by more than `threshold`, s, NaN where none does. grown: the first time at which any position
    differs by more than each of DECADES.
    """

    def __init__(self, joints: int, threshold: float):
        self.threshold, self.states, self.equal = threshold, 0, True
        self.largest, self._squares = np.zeros((2, joints)), np.zeros((2, joints))
        self.largest_at = np.zeros((2, joints))
        self.apart, self.grown = np.full(joints, np.nan), np.full(len(DECADES), np.nan)
        self._times, self._rows = [], []          # not evaluated yet
        self._curve, self._width = [], 1          # (time, (2, joints) largest) of every `width` states

    def add(self, time: float, position: np.ndarray, velocity: np.ndarray, other_position: np.ndarray,
            other_velocity: np.ndarray) -> None:
        """Add one state, s, and arrays (joints,)."""
        self._times.append(time)
        self._rows.append((position, velocity, other_position, other_velocity))
        if len(self._times) == BLOCK:
            self.close()

    def close(self) -> Deviation:
        """Evaluate what was added; return self."""
        if not self._times:
            return self
        times, rows = np.array(self._times), np.array(self._rows)        # (states,), (states, 4, joints)
        self._times, self._rows = [], []
        self.equal = self.equal and rows[:, :2].tobytes() == rows[:, 2:].tobytes()
        differences = np.abs(rows[:, 2:] - rows[:, :2])
        self.states += len(times)
        with np.errstate(over='ignore'):   # of a motion that runs away
            self._squares += (differences**2).sum(axis=0)
        where = differences.argmax(axis=0)
        largest = np.take_along_axis(differences, where[None], axis=0)[0]
        self.largest_at = np.where(largest > self.largest, times[where], self.largest_at)
        self.largest = np.maximum(largest, self.largest)
        self.apart = _first(self.apart, times, differences[:, 0] > self.threshold)
        self.grown = _first(self.grown, times, differences[:, 0].max(axis=1)[:, None] > np.array(DECADES))
        self._keep(times, differences)
        return self

    @property
    def rms(self) -> np.ndarray:
        """Root mean squares (2, joints) of the differences."""
        return np.sqrt(self._squares / max(self.states, 1))

    @property
    def apart_from(self) -> Optional[float]:
        """First time, s, at which a position differs by more than `threshold`, None where none does."""
        return None if np.isnan(self.apart).all() else float(np.nanmin(self.apart))

    @property
    def curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (points,) and the largest differences (points, 2, joints) from each time to the next."""
        return np.array([time for time, _ in self._curve]), np.array([rows for _, rows in self._curve])

    def _keep(self, times: np.ndarray, differences: np.ndarray) -> None:
        """Append to the curve; if it gets too long, merge its points in pairs."""
        for start in range(0, len(times), self._width):
            self._curve.append((times[start], differences[start:start + self._width].max(axis=0)))
        while len(self._curve) > CURVE:
            pairs = zip(self._curve[::2], [*self._curve[1::2], self._curve[-1]])
            self._curve = [(time, np.maximum(rows, more)) for (time, rows), (_, more) in pairs]
            self._width *= 2


def _first(before: np.ndarray, times: np.ndarray, beyond: np.ndarray) -> np.ndarray:
    """Return `before`, with the time of the first true row of `beyond` (states, n) where it is NaN and there is one."""
    return np.where(np.isnan(before) & beyond.any(axis=0), times[beyond.argmax(axis=0)], before)
