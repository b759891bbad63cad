"""Many scenes at once, in the lanes of vectors and over threads; each gets the bits of a single run."""
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import os
from typing import Any, Optional, Sequence, TYPE_CHECKING, Union

import numpy as np

from .integrators import method_data, METHODS
from .simulation import Simulation, stop_error, whole_ticks
from .. import _kernel
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state, joint_array, refuse_beyond_stops
from ..chain.section import counted
from ..mechanics.plan import plan_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class BatchRun:
    """
    Roll-outs of many scenes.

    `time` (ticks+1,) s; `position`, `velocity` (scenes, ticks+1, joints); `effort` (scenes, ticks, joints) that acted;
    `ticks` (scenes,) done; `failures`: scene -> SimulationError, of those that stopped early. A scene that failed
    keeps its last good state in the rows after it, with no effort. Where the last states alone were asked for, `time`,
    `position` and `velocity` have one row, that of the end, and `effort` has none.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    ticks: np.ndarray
    failures: dict

    def __repr__(self) -> str:
        scenes, rows, joints = self.position.shape
        kept = f'{rows} states each' if rows > 1 else 'the last state alone'
        return (f'BatchRun: {counted(scenes, "scene")}, {counted(joints, "joint")}, to t = {self.time[-1]:g} s, '
                f'{kept}; '
                f'{len(self.failures) or "none"} failed')


def rollout_batch(chain: Union[Chain, Sequence[Chain]], position: Optional[ArrayLike] = None,
                  velocity: Optional[ArrayLike] = None, effort: Optional[ArrayLike] = None, *, duration: float,
                  step: float = 1e-3, method: str = 'auto', tolerance: Optional[float] = None, form: str = 'auto',
                  threads: Optional[int] = None, every_tick: bool = True) -> BatchRun:
    """
    Simulate many scenes for `duration` s; the leading axis of every array is the scene, and 1 there means: all alike.

    `chain`: one for all scenes, or a sequence of one each with equally many joints; those that differ in numbers alone
    run as fast as one. `position`, `velocity`: (joints,) or (scenes, joints), None: the chain's own initial state.
    `effort`: None, (joints,) or (scenes, joints) held, (scenes, ticks, joints) a row per tick; (1, ticks, joints) gives
    all scenes the same rows. `threads`: None: as many as this process has cores. `every_tick` False keeps the last
    states alone. A scene that fails stops by itself, see BatchRun.failures. ValueError: bad shapes, values or
    arguments, as in Simulation and rollout.
    """
    chains: list[Any] = [chain]
    if isinstance(chain, Iterable) and not isinstance(chain, (str, bytes, Mapping)):
        chains = list(chain)
    if not chains:
        raise ValueError(f'chain is {chain!r:.80}, must be a Chain or a sequence of them')
    for each in chains:
        plan_of(each)   # which refuses what is none and one that cannot be
    joints = chains[0].joint_count
    for k, each in enumerate(chains):
        if each.joint_count != joints:
            raise ValueError(f'chain[{k}] ({each.name}) has {each.joint_count} joints, must have {joints} as chain[0]')
    simulations = [Simulation(each, method, step, tolerance, form) for each in chains]
    ticks = whole_ticks(duration, simulations[0].step)
    own = [np.array(rows) for rows in zip(*map(initial_state, chains))]
    given = {'position': own[0] if position is None else position, 'velocity': own[1] if velocity is None else velocity,
             'effort': np.zeros(joints) if effort is None else effort}
    given = {name: _leading_axis(name, values, ticks, joints) for name, values in given.items()}
    scenes = _scene_count({'chain': len(chains), **{name: len(values) for name, values in given.items()}})
    position, velocity = (np.ascontiguousarray(np.broadcast_to(given[name], (scenes, joints)))
                          for name in ('position', 'velocity'))
    if len(chains) == 1:
        refuse_beyond_stops(chains[0], position)
    else:
        for each, row in zip(chains, position):
            refuse_beyond_stops(each, row)
    reached, rate, acted, done, outcome, joint = _kernel.roll_batch(
        [(plan_of(each.chain).model, each.form == 'dense', method_data(METHODS[each.method], each.tolerance))
         for each in simulations],
        simulations[0].step, ticks, position, velocity, given['effort'], bool(every_tick), _thread_count(threads), 0)
    time = np.arange(ticks + 1) * simulations[0].step
    failures = {}
    for scene in map(int, np.flatnonzero(outcome)):
        tick = int(done[scene])
        row = tick if every_tick else 0
        failures[scene] = stop_error(
            chains[scene % len(chains)], tick, float(time[tick]), int(outcome[scene]), int(joint[scene]),
            reached[scene, row].copy(), rate[scene, row].copy(), f'scene {scene}: ')
    return BatchRun(time if every_tick else time[-1:], reached, rate, acted, done, failures)


def _leading_axis(name: str, values: ArrayLike, ticks: int, joints: int) -> np.ndarray:
    """`values` with an axis of scenes, an effort with one of ticks too; ValueError: no such shape, not finite."""
    wanted = [(joints,), ('scenes', joints)] + [('scenes', ticks, joints)] * (name == 'effort')
    try:
        shape = np.shape(values)
    except ValueError:   # rows of different lengths
        raise ValueError(f'{name} is {values!r:.80}, must have {" or ".join(map(_written, wanted))}') from None
    if shape[len(shape) > 1:] not in [rows[len(rows) > 1:] for rows in wanted] or shape[0] == 0:
        raise ValueError(f'{name} has shape {shape}, must have {" or ".join(map(_written, wanted))}')
    array = joint_array(name, values, shape)
    array = array.reshape((1,) * (len(shape) == 1) + shape)
    return array[:, None] if name == 'effort' and array.ndim == 2 else array


def _written(shape: tuple) -> str:
    return f'({", ".join(map(str, shape))}{"," * (len(shape) == 1)})'


def _scene_count(counts: dict) -> int:
    """Return the one count that is not 1; ValueError names two arguments that disagree."""
    name, most = next(((name, count) for name, count in counts.items() if count != 1), ('chain', 1))
    for other, count in counts.items():
        if count not in (1, most):
            raise ValueError(f'{other} has {count} scenes, must have 1 or {most} as {name}')
    return most


def _thread_count(threads: Optional[int]) -> int:
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1
    if not isinstance(threads, (int, np.integer)) or isinstance(threads, (bool, np.timedelta64)) or not (
            0 < threads < 2 ** 16):
        raise ValueError(f'threads is {threads!r}, must be a whole number > 0 or None')
    return int(threads)
