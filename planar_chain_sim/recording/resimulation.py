"""
resimulate: run a log's chain, method, step and changes again and compare with its states, bit for bit.

The changes are the log's events: one that carries an `effort` sets what is held from its tick on, kinds of the table
CHANGES do what they did. How and when commands arrived plays no part any more.
"""
from __future__ import annotations

from dataclasses import dataclass
import json
from math import inf
import sys
from typing import Optional

import numpy as np

from .cdr import CdrError, decode_joint_state, decode_string
from .log_reader import Log, LogMessage, read_log
from .run_settings import simulation_of
from ..changes import apply_change, CHANGES
from ..command_line import Parser, run_command, tell
from ..dynamics import joint_array
from ..errors import LogError, SimulationError
from ..simulation import Simulation

QUANTITIES = ('position', 'velocity', 'effort')


@dataclass(frozen=True)
class Difference:
    """The first place where a log and its re-run part: time s, tick, joint, quantity, and both values."""

    time: float
    tick: int
    joint: str
    quantity: str
    logged: float
    computed: float

    def __str__(self):
        return (f"t = {self.time!r} s, tick {self.tick}, joint '{self.joint}': {self.quantity} "
                f'is {self.logged!r} in the log and {self.computed!r} when computed again')


@dataclass(frozen=True)
class Verdict:
    """Outcome of a re-run: number of states compared and the first difference, None where all are equal."""

    states: int
    ticks: int
    difference: Optional[Difference]


def resimulate(log: Log) -> Verdict:
    """Run `log` again up to its end or its first difference; LogError where it cannot be followed."""
    rerun = _Rerun(log)
    for message in log.messages:
        difference = rerun.follow(message)
        if difference is not None:
            return Verdict(rerun.states, rerun.simulation.tick, difference)
    if rerun.states == 0:
        raise LogError(f'log {str(log.path)!r}: it holds no state to compare with')
    return Verdict(rerun.states, rerun.simulation.tick, None)


class _Rerun:
    """The simulation of a log as it follows the log's messages one by one."""

    def __init__(self, log: Log):
        self._log = log
        self.simulation: Simulation = simulation_of(log)
        self._held = np.zeros(self.simulation.chain.joint_count)
        self._topics = log.settings['state_topic'], log.settings['events_topic']
        self.states = 0

    def follow(self, message: LogMessage) -> Optional[Difference]:
        state_topic, events_topic = self._topics
        if message.topic == events_topic:
            try:
                event = event_of(message)
                self._change(event)
            except ValueError as error:
                raise self._unreadable(f'a message on {message.topic} cannot be followed ({error})') from None
        elif message.topic == state_topic:
            try:
                logged = decode_joint_state(message.data)
            except CdrError as error:
                raise self._unreadable(f'a message on {message.topic} cannot be followed ({error})') from None
            return self._compare(message, logged)
        return None

    def _change(self, event: dict) -> None:
        """Let an event act at its tick, which is where the re-run stands; ValueError: it cannot."""
        effort = event['data'].get('effort')
        if effort is None and event['kind'] not in CHANGES:
            return
        if event['tick'] != self.simulation.tick:
            why = f"event '{event['kind']}' of tick {event['tick']} comes at tick {self.simulation.tick}"
            raise self._unreadable(why)
        if event['kind'] in CHANGES:
            apply_change(self.simulation, event['kind'], event['data'])
        if event['kind'] == 'reset':
            self._held = np.zeros_like(self._held)
        if effort is not None:
            self._held = joint_array('effort', effort, self._held.shape).copy()

    def _compare(self, message: LogMessage, logged) -> Optional[Difference]:
        simulation = self.simulation
        ahead = (message.sequence - simulation.tick) % 2**32   # the log keeps ticks modulo 2^32
        if ahead > 1:
            raise self._unreadable(f'its state of tick {message.sequence} does not follow tick {simulation.tick}')
        if logged.names != simulation.chain.joint_names:
            raise self._unreadable(f'its state of tick {message.sequence} names other joints than its chain')
        if ahead:
            try:
                simulation.advance(1, self._held)
            except SimulationError as error:
                raise self._unreadable(f'its states go on where the simulation stops ({error})') from None
        self.states += 1
        computed = {quantity: getattr(simulation, quantity) for quantity in QUANTITIES}
        if all(getattr(logged, quantity).tobytes() == computed[quantity].tobytes() for quantity in QUANTITIES):
            return None
        for quantity in QUANTITIES:
            if getattr(logged, quantity).shape != computed[quantity].shape:
                raise self._unreadable(f'its state of tick {message.sequence} lacks values of {quantity}')
        return self._first_difference(logged, computed)

    def _first_difference(self, logged, computed: dict) -> Difference:
        for joint, name in enumerate(self.simulation.chain.joint_names):
            for quantity in QUANTITIES:
                got, wanted = getattr(logged, quantity)[joint], computed[quantity][joint]
                if got.tobytes() != wanted.tobytes():
                    where = self.simulation.time, self.simulation.tick, name, quantity
                    return Difference(*where, float(got), float(wanted))
        raise AssertionError('unreachable: some bit differs')

    def _unreadable(self, why: str) -> LogError:
        return LogError(f'log {str(self._log.path)!r}: {why}')


def event_of(message: LogMessage) -> dict:
    """Return the event of a message, {'tick': int, 'kind': str, 'data': dict}; ValueError: it is none."""
    try:
        # A number too long for a double is not finite; as an int it would be an error of another kind.
        event = json.loads(decode_string(message.data), parse_int=lambda text: int(text) if len(text) < 20 else inf)
    except (CdrError, RecursionError) as error:
        raise ValueError(str(error)) from None
    wanted = {'tick': int, 'kind': str, 'data': dict}
    if not isinstance(event, dict) or not all(isinstance(event.get(key), kind) for key, kind in wanted.items()):
        raise ValueError('it is no event, which has a tick, a kind and data')
    return event


def main(arguments=None) -> int:
    """Exit 0: every state equal, bit for bit; 1: different, first difference on stdout; 2: unreadable."""
    return run_command('resimulate', _resimulate_file, arguments)


def _resimulate_file(arguments) -> int:
    parser = Parser('resimulate',
                    'Run the chain of a log again, with its method, step and changes, and compare all states '
                    'bit for bit.\n\nExit code 0: equal; 1: different; 2: the log cannot be read, or a bug is shown.',
                    'resimulate run.mcap')
    parser.add_argument('log', help='MCAP log of the simulator or of rollout')
    log = read_log(parser.parse_args(arguments).log)
    verdict = resimulate(log)
    torn = '' if log.complete else '; the log was not closed properly, what is whole was compared'
    if verdict.difference is not None:
        tell(f'different: {verdict.difference}{torn}')
        return 1
    tell(f'equal: {verdict.states} states over {verdict.ticks} ticks, bit for bit{torn}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
