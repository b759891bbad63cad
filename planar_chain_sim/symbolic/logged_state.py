"""The state at a time in a log of the simulator or of rollout, and the chain as it was then."""
from __future__ import annotations

from math import isfinite

from ..changes import apply_change, CHANGES
from ..errors import LogError, Mistake
from ..recording.cdr import CdrError, decode_joint_state
from ..recording.log_reader import Log
from ..recording.resimulation import event_of
from ..simulation import Simulation


def state_at(log: Log, start: Simulation, time: float) -> tuple:
    """
    Return time, position, velocity, effort of the tick next to a simulated time, s.

    `start` is the simulation the log begins with; its chain becomes that of the time asked for. The effort is that of
    actuators and wrenches. Mistake: a time that the log does not hold. LogError: what cannot be read.
    """
    wanted = round(time / start.step) if isfinite(time) else None
    tick = first = start.tick
    for message in log.messages:
        if message.topic == log.settings['events_topic']:
            _follow(log, start, message)
        if message.topic != log.settings['state_topic']:
            continue
        tick += (message.sequence - tick) % 2**32   # the log keeps ticks modulo 2^32
        if tick == wanted:
            try:
                state = decode_joint_state(message.data)
            except CdrError as error:
                raise LogError(f'log {str(log.path)!r}: its state of tick {tick} cannot be read ({error})') from None
            if state.names != start.chain.joint_names:
                raise LogError(f'log {str(log.path)!r}: its state of tick {tick} names other joints than its chain')
            start.set_state(state.position, state.velocity)
            return tick * start.step, state.position, state.velocity, state.effort + start.wrench_effort
    raise Mistake(f'--time {time!r}: log {str(log.path)!r} holds the states from {first * start.step:g} s to '
                  f'{tick * start.step:g} s')


def _follow(log: Log, simulation: Simulation, message) -> None:
    """Let a change of the log act on the chain."""
    try:
        event = event_of(message)
        if event['kind'] in CHANGES:
            apply_change(simulation, event['kind'], event['data'])
    except ValueError as error:
        raise LogError(f'log {str(log.path)!r}: a message on {message.topic} cannot be followed ({error})') from None
