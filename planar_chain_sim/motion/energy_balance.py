"""
EnergyBalance: compares a run's energy with its energy at the start, work and losses: d(T + V)/dt = tau q' - losses.

The work of an effort that is constant within a tick is exactly tau (q_1 - q_0). The loss of a law without stored energy
is the integral of d q'^2 over the tick, by Simpson's rule with the middle rate of the cubic that both ends define,
3/2 (q_1 - q_0)/h - 1/4 (q'_0 + q'_1); its error is O(step^4). The work of a force that turns with its body is computed
in the same way.
"""
from __future__ import annotations

from typing import Callable

import numpy as np

from ..chain.chain import Chain
from ..chain.tree import BASE
from ..mechanics.dynamics import energy
from ..mechanics.joint_forces import JOINT_FORCES

ROWS = 1024  # ticks between two sums


class EnergyBalance:
    """
    Sums over the ticks since restart().

    error: J, energy in excess of what the balance says; size: J, the largest of its terms, at least 1e-300.
    Both are of the last fold(). `read`: turns a list of what add() took into an array (ticks, 3, joints), at most ROWS.
    """

    def __init__(self, chain: Chain, step: float, position, velocity, read: Callable[[list], np.ndarray] = np.array):
        self._step, self._read, self._rows = step, read, []
        self._forces = {}   # index of a body -> force and moment on it over each tick
        self.restart(chain, position, velocity)

    def restart(self, chain: Chain, position, velocity) -> None:
        """Start again from a state (joints,), after the chain or the state was changed from outside."""
        self._chain, self._indices = chain, {body.name: index for index, body in enumerate(chain.bodies)}
        for rows in self._forces.values():
            for values in rows:
                values[:] = values[len(self._rows)]   # as they act from now on
        self._rows.clear()
        self._losses = [(k, joint, law) for k, joint in enumerate(chain.joints) for law in JOINT_FORCES
                        if law.energy is None and law.acts_on(joint)]
        self._last = np.array([position, velocity])
        self._start = sum(energy(chain, position, velocity))
        self._work = self._loss = self.error = 0.0
        self.size = max(abs(self._start), 1e-300)

    def push(self, body: str, force, moment: float, axes: str = 'body') -> None:
        """
        Add a wrench from the last tick on: force [x, y], N, at a body's joint point, and moment, N m.

        `axes`: of the 'body' or of the 'world'.
        """
        index = self._indices[body]
        forces, moments, turns = self._forces.setdefault(
            index, (np.zeros(ROWS, complex), np.zeros(ROWS), np.zeros(ROWS)))
        done = len(self._rows)
        forces[done:], moments[done:], turns[done:] = complex(*force), moment, axes == 'body'

    def release(self) -> None:
        """Remove all wrenches. Their work since the last fold() is lost, so call restart() next."""
        self._forces.clear()

    def add(self, row) -> None:
        """Add one more tick: position and velocity at its end and the effort that acted over it, for `read`."""
        self._rows.append(row)
        if len(self._rows) == ROWS:
            self.fold()

    def fold(self) -> None:
        """Update the sums and the error to the last tick; both may overflow before the state itself does."""
        if self._rows:
            with np.errstate(all='ignore'):
                self._fold()

    def _fold(self) -> None:
        rows = self._read(self._rows)
        count = len(rows)
        self._rows.clear()
        position, velocity = (np.vstack((last, ends)) for last, ends in zip(self._last, rows[:, :2].swapaxes(0, 1)))
        self._last = rows[-1, :2].copy()
        travel = np.diff(position, axis=0)
        middle = 1.5 / self._step * travel - 0.25 * (velocity[1:] + velocity[:-1])
        self._work += float((rows[:, 2] * travel).sum())
        for index, (force, moment, turns) in self._forces.items():
            self._work += self._work_of(index, force[:count], moment[:count], turns[:count], position, velocity)
            force[:], moment[:], turns[:] = force[-1], moment[-1], turns[-1]
        for k, joint, law in self._losses:
            first, half, last = (-law.effort(joint, 0.0, rate) * rate
                                 for rate in (velocity[:-1, k], middle[:, k], velocity[1:, k]))
            self._loss += self._step / 6.0 * float((first + 4.0 * half + last).sum())
        kinetic, potential = energy(self._chain, position[-1], velocity[-1])
        self.error = kinetic + potential - self._start - self._work + self._loss
        self.size = max(self.size, kinetic, abs(potential), abs(self._work), self._loss)

    def _work_of(self, index: int, force, moment, turns, position, velocity) -> float:
        """Return the work of a wrench on a body, J, over the ticks between rows of joint states; `turns`: 1 or 0."""
        step = self._step
        place, rate, angle, turning = _motion_of(self._chain, index, position, velocity)
        travel = np.diff(place)
        middle = 1.5 / step * travel - 0.25 * (rate[1:] + rate[:-1])
        middle_angle = 0.5 * (angle[1:] + angle[:-1]) + step / 8.0 * (turning[:-1] - turning[1:])
        # the rates in the axes in which the force stands: the body's own, or the world's
        along = (np.exp(-1j * angle[:-1] * turns) * rate[:-1] + 4.0 * np.exp(-1j * middle_angle * turns) * middle
                 + np.exp(-1j * angle[1:] * turns) * rate[1:])
        return float((step / 6.0 * (force.conjugate() * along).real + moment * np.diff(angle)).sum())


def _motion_of(chain: Chain, index: int, position, velocity) -> tuple:
    """Return position and velocity of a body's joint point, its angle and rate, for rows (n, joints) of states."""
    names, path = chain.joint_names, []
    while index != BASE:
        path.append(chain.bodies[index])
        index = chain.bodies[index].carrier
    place = rate = np.zeros(len(position), complex)
    angle = turning = np.zeros(len(position))
    for body in reversed(path):
        turn, reach, reaching = np.exp(1j * angle), body.origin, 0.0
        if body.slide:
            slide, along = names.index(body.slide.name), np.exp(1j * body.slide.axis)
            reach, reaching = reach + position[:, slide] * along, velocity[:, slide] * along
        place, rate = place + reach * turn, rate + (reaching + 1j * turning * reach) * turn
        angle = angle + body.angle
        if body.rotation:
            rotation = names.index(body.rotation.name)
            angle = angle + body.rotation.axis * position[:, rotation]
            turning = turning + body.rotation.axis * velocity[:, rotation]
    return place, rate, angle, turning
