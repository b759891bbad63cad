"""Reads a log from its start: yields its states in order and applies the changes between them to a simulation."""
from __future__ import annotations

from typing import Callable, Iterator

import numpy as np

from .cdr import CdrError, decode_joint_state, JointStateMessage
from .events import apply_event, decode_event, EVENTS
from .log_reader import LogFile, LogMessage
from .run_settings import simulation_of
from ..chain.chain import Chain
from ..chain.joint_arrays import joint_array
from ..errors import LogError


class Following:
    """
    The simulation that a log begins with, changed as the log is read; LogError: the log makes none.

    simulation: its chain, wrenches and payloads are those of the state last read; the reader may advance it.
    effort: (joints,), N m or N, acts on the motion that follows.
    notes: sentences about what was assumed, none for a log.
    `told(event, before)` is called after each change with its event and the chain as it was before.
    """

    def __init__(self, log: LogFile, told: Callable[[dict, Chain], object] = lambda event, before: None):
        self._log, self._told, self.notes = log, told, []
        self.simulation = simulation_of(log)
        self.effort = np.zeros(self.simulation.chain.joint_count)

    def states(self) -> Iterator[tuple[int, LogMessage]]:
        """Yield the tick and the message of each state; LogError at a message that cannot be used."""
        state_topic, events_topic = (self._log.settings[key] for key in ('state_topic', 'events_topic'))
        tick = self.simulation.tick
        for message in self._log.messages:
            if message.topic == events_topic:
                try:
                    event = decode_event(message.data)
                    if event['kind'] in EVENTS and EVENTS[event['kind']].changes_run:
                        self._change(event, tick)
                except ValueError as error:
                    raise self.error(f'a message on {message.topic} cannot be used ({error})') from None
            elif message.topic == state_topic:
                ahead = (message.sequence - tick) % 2**32   # the log keeps ticks modulo 2^32
                if ahead > 1:
                    raise self.error(f'its state of tick {message.sequence} does not follow tick {tick}')
                tick += ahead
                yield tick, message

    def decode(self, message: LogMessage) -> JointStateMessage:
        """Return the state in a message; LogError: there is none, or it is of other joints."""
        try:
            state = decode_joint_state(message.data)
        except CdrError as error:
            raise self.error(f'a message on {message.topic} cannot be used ({error})') from None
        if state.names != self.simulation.chain.joint_names:
            raise self.error(f'its state of tick {message.sequence} names other joints than its chain')
        for quantity in ('position', 'velocity', 'effort'):
            if getattr(state, quantity).shape != self.effort.shape:
                raise self.error(f'its state of tick {message.sequence} lacks values of {quantity}')
        return state

    def error(self, why: str) -> LogError:
        """Return the LogError with this reason."""
        return LogError(f'log {str(self._log.path)!r}: {why}')

    def _change(self, event: dict, tick: int) -> None:
        """Apply an event to the state of `tick`; ValueError: that is impossible."""
        kind, data, before = event['kind'], event['data'], self.simulation.chain
        if event['tick'] != tick:
            raise self.error(f"event '{kind}' of tick {event['tick']} comes at tick {tick}")
        if EVENTS[kind].apply:
            apply_event(self.simulation, kind, data)
        if kind == 'reset':
            self.effort = np.zeros_like(self.effort)
        if 'effort' in EVENTS[kind].keys and data.get('effort') is not None:
            self.effort = joint_array('effort', data['effort'], self.effort.shape).copy()
        self._told(event, before)
