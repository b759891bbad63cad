"""A run from its start to its end in one call: states and efforts as arrays."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Optional, TYPE_CHECKING, Union

import numpy as np

from .simulation import Simulation, whole_ticks
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..chain.section import counted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Run:
    """A rollout: `time` (ticks+1,) s; `position`, `velocity` (ticks+1, joints); `effort` (ticks, joints) that acted."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray

    def __repr__(self) -> str:
        ticks, joints = self.effort.shape
        step = f' of {self.time[1] - self.time[0]:g} s' if ticks else ''
        return f'Run: {counted(ticks, "tick")}{step}, {counted(joints, "joint")}, to t = {self.time[-1]:g} s'


def rollout(chain: Chain, duration: float, step: float = 1e-3, method: str = 'auto',
            effort: Union[ArrayLike, Callable[..., ArrayLike], None] = None, tolerance: Optional[float] = None,
            form: str = 'auto', position: Optional[ArrayLike] = None, velocity: Optional[ArrayLike] = None) -> Run:
    """
    Simulate `duration` s from `position` and `velocity` (joints,); where one is None, from that of the chain.

    `effort`: None, (joints,) held, (ticks, joints) a row per tick, or a callable once per tick, (time, position,
    velocity) -> (joints,). ValueError: bad arguments, a position beyond a stop, a duration that is no whole number of
    steps. SimulationError as in Simulation.advance.
    """
    simulation = Simulation(chain, method, step, tolerance, form)
    if position is not None or velocity is not None:
        own = initial_state(chain)
        simulation.set_state(own[0] if position is None else position, own[1] if velocity is None else velocity)
    ticks, joints = whole_ticks(duration, simulation.step), chain.joint_count
    position, velocity = np.empty((ticks + 1, joints)), np.empty((ticks + 1, joints))
    acted = np.empty((ticks, joints))
    position[0], velocity[0] = simulation.position, simulation.velocity
    if callable(effort):
        for k in range(ticks):
            wanted = effort(simulation.time, position[k].copy(), velocity[k].copy())
            simulation.advance(1, wanted, (position[k + 1:k + 2], velocity[k + 1:k + 2], acted[k:k + 1]))
    else:
        simulation.advance(ticks, effort, (position[1:], velocity[1:], acted))
    return Run(np.arange(ticks + 1) * simulation.step, position, velocity, acted)
