"""
resimulate: run a log's chain, method, step and changes again and compare with its states, bit for bit.

The changes are the log's events. How and when commands arrived does not matter here.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

from ..errors import LogError, SimulationError
from ..recording.following import Following
from ..recording.log_reader import LogFile

COMPARED = ('position', 'velocity', 'effort')


@dataclass(frozen=True)
class Difference:
    """The first difference between a log and its re-run: time s, tick, joint, quantity, and both values."""

    time: float
    tick: int
    joint: str
    quantity: str
    logged: float
    computed: float

    def __str__(self):
        return (f"t = {self.time:.12g} s, tick {self.tick}, joint '{self.joint}': {self.quantity} "
                f'is {self.logged!r} in the log and {self.computed!r} when computed again')


@dataclass(frozen=True)
class Verdict:
    """Outcome of a re-run: states compared, ticks made, and the first difference, None where all are equal."""

    states: int
    ticks: int
    difference: Optional[Difference]


def resimulate(log: LogFile) -> Verdict:
    """Run `log` again up to its end or its first difference; LogError: it cannot be run again."""
    following, states = Following(log), 0
    simulation = following.simulation
    start = simulation.tick
    for tick, message in following.states():
        logged = following.decode(message)
        if tick > simulation.tick:
            try:
                simulation.advance(1, following.effort)
            except SimulationError as error:
                raise following.error(f'its states go on where the simulation stops ({error})') from None
        states += 1
        computed = {quantity: getattr(simulation, quantity) for quantity in COMPARED}
        if any(getattr(logged, quantity).tobytes() != computed[quantity].tobytes() for quantity in COMPARED):
            return Verdict(states, tick - start, _first_difference(simulation, logged, computed))
    if states == 0:
        raise LogError(f'log {str(log.path)!r}: it holds no state to compare with')
    return Verdict(states, simulation.tick - start, None)


def _first_difference(simulation, logged, computed: dict) -> Difference:
    for joint, name in enumerate(simulation.chain.joint_names):
        for quantity in COMPARED:
            got, wanted = getattr(logged, quantity)[joint], computed[quantity][joint]
            if got.tobytes() != wanted.tobytes():
                return Difference(simulation.time, simulation.tick, name, quantity, float(got), float(wanted))
    raise AssertionError('unreachable: some bit differs')
