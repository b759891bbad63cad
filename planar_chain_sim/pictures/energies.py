"""Energy along a run, and its error: what work and losses do not explain; the parts of a run between its changes."""
from __future__ import annotations

from typing import Iterator, NamedTuple

import numpy as np

from .source import Source
from ..chain.chain import Chain
from ..errors import LogError
from ..mechanics.dynamics import energy
from ..motion.energy_balance import EnergyBalance, ROWS
from ..motion.simulation import Simulation
from ..recording.events import apply_event, EVENTS

POINTS = 1000     # of the error, about
JUMPS = ('reset', 'state')   # events after which the row of their tick is another state: the motion there is not logged


class Stretch(NamedTuple):
    """
    Rows `first` to `last` of a source between two changes: the chain, and the Wrench on bodies by their names.

    `anew`: chain or state were changed at its first row.
    """

    first: int
    last: int
    chain: Chain
    wrenches: dict
    anew: bool


def stretches(source: Source) -> Iterator[Stretch]:
    """Yield the parts of a run between changes of chain, state and wrenches; LogError: an impossible one."""
    simulation, first, last, anew = Simulation(source.chain), 0, len(source.time) - 1, False
    start = round(float(source.time[0] / source.step))
    for event in source.events:
        if event['kind'] not in EVENTS or EVENTS[event['kind']].apply is None:
            continue
        row = min(max(event['tick'] - start, 0), last)
        if row > first:
            end = row - 1 if event['kind'] in JUMPS else row
            if end > first:
                yield Stretch(first, end, simulation.chain, simulation.wrenches, anew)
            first, anew = row, False
        try:
            apply_event(simulation, event['kind'], event['data'])
        except ValueError as error:
            raise LogError(f'log {source.name!r}: its event {event["kind"]!r} of tick {event["tick"]} is impossible '
                           f'({error})') from None
        anew = anew or event['kind'] != 'wrench'
    if first < last:
        yield Stretch(first, last, simulation.chain, simulation.wrenches, anew)


def energies(source: Source, rows: np.ndarray) -> np.ndarray:
    """Return kinetic and potential energy, J, (2, rows), at rows that ascend; a payload counts while it is there."""
    result = np.zeros((2, len(rows)))
    for part in stretches(source):
        mine = slice(*np.searchsorted(rows, [part.first, part.last + 1]))
        if mine.start < mine.stop:
            result[:, mine] = energy(part.chain, source.position[rows[mine]], source.velocity[rows[mine]])
    return result


def energy_error(source: Source) -> tuple[np.ndarray, np.ndarray]:
    """
    Return times, s, and energy in excess of the balance, J, at them.

    It begins again at 0 after a change of the chain or the state.
    """
    every = min(ROWS, max(1, len(source.effort) // POINTS))
    rows, errors = [0], [0.0]
    balance = EnergyBalance(source.chain, source.step, source.position[0], source.velocity[0], np.concatenate)
    moved = np.stack((source.position[1:], source.velocity[1:], source.effort), axis=1)
    for part in stretches(source):
        balance.release()
        if part.anew:
            balance.restart(part.chain, source.position[part.first], source.velocity[part.first])
            rows.append(part.first)
            errors.append(0.0)
        for body, wrench in part.wrenches.items():
            balance.push(body, (wrench.force.real, wrench.force.imag), wrench.moment, wrench.axes)
        for first in range(part.first, part.last, every):
            last = min(part.last, first + every)
            balance.add(moved[first:last])
            balance.fold()
            rows.append(last)
            errors.append(balance.error)
    return source.time[rows], np.array(errors)
