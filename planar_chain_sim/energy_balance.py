"""
EnergyBalance: the energy a run has, against what it had and what went in and out: d(T + V)/dt = tau q' - losses.

The work of an effort that is constant within a tick is tau (q_1 - q_0), exactly. What a law without stored energy takes
is the integral of d q'^2 over the tick, by Simpson's rule with the middle rate of the cubic that both ends define,
3/2 (q_1 - q_0)/h - 1/4 (q'_0 + q'_1): an error of O(step^4).
"""
from __future__ import annotations

import numpy as np

from .chain import Chain
from .dynamics import energy

ROWS = 1024  # ticks between two sums


class EnergyBalance:
    """
    Sums over the ticks since restart().

    error: J, energy in excess of what the balance says; size: J, the largest of its terms, at least 1e-300.
    Both are of the last fold().
    """

    def __init__(self, chain: Chain, step: float, position, velocity):
        self._step = step
        self._position, self._velocity, self._effort = (np.empty((ROWS + 1, chain.joint_count)) for _ in range(3))
        self.restart(chain, position, velocity)

    def restart(self, chain: Chain, position, velocity) -> None:
        """Begin anew from a state (joints,), where the chain or the state was changed from outside."""
        self._chain, self._count = chain, 0
        self._damping = np.array([joint.damping for joint in chain.joints])
        self._friction = np.array([joint.friction for joint in chain.joints])
        self._position[0], self._velocity[0] = position, velocity
        self._start = sum(energy(chain, position, velocity))
        self._work = self._loss = self.error = 0.0
        self.size = max(abs(self._start), 1e-300)

    def add(self, position, velocity, effort) -> None:
        """Take the end of one more tick and the effort (joints,) that acted over it."""
        self._count += 1
        row = self._count
        self._position[row], self._velocity[row], self._effort[row] = position, velocity, effort
        if row == ROWS:
            self.fold()

    def fold(self) -> None:
        """Bring the sums and the error up to the last tick; both may overflow before the state itself does."""
        with np.errstate(all='ignore'):
            self._fold()

    def _fold(self) -> None:
        count = self._count
        position, velocity = self._position[:count + 1], self._velocity[:count + 1]
        travel = np.diff(position, axis=0)
        middle = 1.5 / self._step * travel - 0.25 * (velocity[1:] + velocity[:-1])
        self._work += float((self._effort[1:count + 1] * travel).sum())
        for law in (lambda rate: self._damping * rate**2, lambda rate: self._friction * abs(rate)):
            self._loss += self._step / 6.0 * float((law(velocity[:-1]) + 4.0 * law(middle) + law(velocity[1:])).sum())
        kinetic, potential = energy(self._chain, position[-1], velocity[-1])
        self.error = kinetic + potential - self._start - self._work + self._loss
        self.size = max(self.size, kinetic, abs(potential), abs(self._work), self._loss)
        self._position[0], self._velocity[0], self._count = position[-1].copy(), velocity[-1].copy(), 0
