"""
resimulate: run a log's chain, method, step and changes again and compare with its states, bit for bit.

The changes are the log's events. How and when commands arrived does not matter here.
"""
from __future__ import annotations

from dataclasses import dataclass
import sys
from typing import Optional

from .following import Following
from .log_reader import LogFile, read_log
from ..chain.section import counted
from ..command_line import Parser, print_line, run_command
from ..errors import LogError, SimulationError

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


def main(arguments=None) -> int:
    """Exit 0: every state equal, bit for bit; 1: different, first difference on stdout; 2: unreadable."""
    return run_command('resimulate', _resimulate_file, arguments)


def _resimulate_file(arguments) -> int:
    parser = Parser('resimulate',
                    'Run the chain of a log again, with its method, step and changes, and compare all states '
                    'bit for bit.\n\nExit code 0: equal; 1: different; 2: the log cannot be read, or there is a bug.',
                    'resimulate run.mcap')
    parser.add_argument('log', help='MCAP log of the simulator or of rollout')
    log = read_log(parser.parse_args(arguments).log)
    verdict = resimulate(log)
    torn = '' if log.complete else '; the log was not closed properly, only its whole chunks were compared'
    if verdict.difference is not None:
        print_line(f'different: {verdict.difference}{torn}')
        return 1
    print_line(f'equal: {counted(verdict.states, "state")} over {counted(verdict.ticks, "tick")}, bit for bit{torn}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
