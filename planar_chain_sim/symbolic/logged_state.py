"""The state at a time in a log of the simulator or of rollout, and the chain as it was then."""
from __future__ import annotations

from math import isfinite

from ..errors import Mistake
from ..recording.following import Following
from ..recording.log_reader import LogFile


def state_at(log: LogFile, time: float) -> tuple:
    """
    Return chain, time, position, velocity, effort of the tick nearest to a simulated time, s.

    The chain is as it was at that time. The effort is that of actuators and wrenches. Mistake: a time that the log does
    not hold. LogError: what cannot be read.
    """
    following = Following(log)
    simulation = following.simulation
    step, tick = simulation.step, simulation.tick
    first, wanted = tick, round(time / step) if isfinite(time) else None
    for tick, message in following.states():
        if tick == wanted:
            state = following.decode(message)
            simulation.set_state(state.position, state.velocity)
            return (simulation.chain, tick * step, state.position, state.velocity,
                    state.effort + simulation.wrench_effort)
    raise Mistake(f'--time {time!r}: log {str(log.path)!r} holds the states from {first * step:g} s to '
                  f'{tick * step:g} s')
