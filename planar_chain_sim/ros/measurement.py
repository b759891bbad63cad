"""Measures a running simulator: pace, lateness, rejected commands, energy."""
from __future__ import annotations

from time import monotonic_ns
from typing import NamedTuple, Optional

from ..errors import SimulationError
from ..motion.energy_balance import EnergyBalance


class Measurement(NamedTuple):
    """
    Counts since the start; `lateness` (mean, largest; s) and `real_time_factor` since the last measurement.

    `missed`: ticks that came more than a period late and were caught up with. `dropped`: s that were not.
    `energy_error`, `energy_size`: of EnergyBalance, J. `rejected`, `ignored`: reason -> count; `superseded`: count.
    `held_up`: s for which the middleware blocked publishing. `waiting`: joints that lockstep waits for, and for how
    long, s. `end`: why the motion ended, or None.
    """

    tick: int
    paused: bool
    real_time_factor: float
    missed: int
    dropped: float
    lateness: tuple[float, float]
    energy_error: float
    energy_size: float
    rejected: dict
    ignored: dict
    superseded: int
    held_up: float
    waiting: tuple[tuple, float]
    end: Optional[SimulationError]


class Meter:
    """
    Counts while the tick thread runs; only that thread uses it.

    balance: the EnergyBalance, which takes the state messages (bytes) of `layout`, one for each tick.
    """

    def __init__(self, simulation, layout):
        self.balance = EnergyBalance(simulation.chain, simulation.step, simulation.position, simulation.velocity,
                                     layout.numbers_of)
        self._step = simulation.step
        self._missed, self._dropped = 0, 0.0
        self._ticks = self._sum = self._largest = 0  # wake-ups and their lateness, ns, since the last look
        self._last = simulation.tick, monotonic_ns()

    def change(self, simulation, kind: str, data: dict) -> None:
        """Note an event that changes the run: a wrench does work from now on, other kinds begin a new balance."""
        if kind == 'wrench':
            self.balance.push(**data)
        else:
            self.restart(simulation)

    def restart(self, simulation) -> None:
        """Start a new energy balance after the state or the chain was changed from outside."""
        self.balance.restart(simulation.chain, simulation.position, simulation.velocity)

    def add_lateness(self, late: int, period: float) -> None:
        """Count a wake-up with its lateness, ns, at this period, ns."""
        self._ticks += 1
        self._sum += late
        if late > self._largest:
            self._largest = late
        if late > period > 0.0:
            self._missed += 1

    def add_dropped(self, seconds: float) -> None:
        """Count time, s, that was dropped."""
        self._dropped += seconds

    def measure(self, tick: int, intake, end: Optional[SimulationError], paused: bool, held_up: int,
                waiting: tuple) -> Measurement:
        """Return a Measurement and start the next one; `held_up`: ns."""
        self.balance.fold()
        now, (last_tick, last) = monotonic_ns(), self._last
        lateness = self._sum / max(self._ticks, 1) * 1e-9, self._largest * 1e-9
        factor = (tick - last_tick) * self._step / max((now - last) * 1e-9, 1e-9)
        self._ticks = self._sum = self._largest = 0
        self._last = tick, now
        return Measurement(tick, paused, factor, self._missed, self._dropped, lateness, self.balance.error,
                           self.balance.size, dict(intake.rejected), dict(intake.ignored), intake.superseded,
                           held_up * 1e-9, waiting, end)
