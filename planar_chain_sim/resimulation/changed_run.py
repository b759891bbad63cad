"""ChangedRun: the changes of a recorded run once more, on another chain, by another method or with another step."""
from __future__ import annotations

from collections import Counter
from dataclasses import replace
from fractions import Fraction
from typing import Mapping, Optional

import numpy as np

from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..chain.quantities import changed_chain, QUANTITIES
from ..errors import Mistake, SimulationError
from ..motion.integrators import METHODS
from ..motion.simulation import Simulation
from ..recording.events import apply_event

COARSEST = 1000      # parts of a step, the smallest that two steps must have in common
BORDER = 1e-9        # of a step: nearer than this is the same time


def changed_simulation(own: Simulation, chain: Optional[Chain] = None, parameters: Mapping[str, float] = {},
                       method: Optional[str] = None, step: Optional[float] = None,
                       tolerance: Optional[float] = None) -> Simulation:
    """
    Return a simulation like `own`, which is at its start, but for what is given.

    A joint that both chains have starts where it starts in `own`, unless the chains differ in its initial state.
    Mistake, ChainError: what is given cannot be.
    """
    chain = own.own_chain if chain is None else chain
    if parameters:
        chain = chain.with_parameters(parameters)
    mine, theirs = common_joints(chain, own.chain)
    if method is None:
        method = own.method
    if tolerance is None and (method == 'auto' or METHODS[method].adaptive):
        tolerance = own.tolerance
    try:
        simulation = Simulation(chain, method, own.step if step is None else step, tolerance, own.form_asked)
    except ValueError as error:   # of step, tolerance or form
        raise Mistake(f'--{error}') from None
    try:
        state = initial_state(chain)
        for values, before, started in zip(state, initial_state(own.own_chain), (own.position, own.velocity)):
            values[mine] = np.where(values[mine] == before[theirs], started[theirs], values[mine])
        simulation.set_state(*state)
        tick = round(own.tick * own.step / simulation.step)
        simulation.restore(replace(simulation.checkpoint(), tick=tick))
    except ValueError as error:   # a position beyond a stop
        raise Mistake(f'the changed run cannot start where the recorded one did: {error}') from None
    return simulation


def common_joints(chain: Chain, other: Chain) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the joints of one name in both chains; Mistake: there are none."""
    mine = [k for k, name in enumerate(chain.joint_names) if name in other.joint_names]
    if not mine:
        raise Mistake(f'chain {chain.name!r} has the joints {", ".join(chain.joint_names[:16])}, must share one with '
                      f'{other.name!r}, which has {", ".join(other.joint_names[:16])}')
    return np.array(mine), np.array([other.joint_names.index(chain.joint_names[k]) for k in mine])


def steps_in_common(step: float, own: float) -> Fraction:
    """Return `step` / `own`, the lengths of two steps, as a fraction; Mistake: their ticks do not meet."""
    ratio = Fraction(step / own).limit_denominator(COARSEST)
    if not abs(ratio * own - step) <= BORDER * step:
        raise Mistake(f'--step is {step:g} s, must be one whose ticks meet those of the recorded step of {own:g} s, '
                      f'for example {own / 2:g} or {2 * own:g}')
    return ratio


class ChangedRun:
    """
    `simulation`, from changed_simulation(), under the changes of a run that `own` began and goes on with.

    A change at a tick of the recorded run acts at the same time; where that is no tick of this run, at its next one:
    `late` has the changes of which that is true, `latest` is the longest delay, s. `unused`: what has no place here, a
    sentence -> how often. `stopped`: the error that ended the motion. `shift` is added to the velocities, rad/s or m/s,
    wherever the state is set.
    """

    def __init__(self, own: Simulation, simulation: Simulation, shift: float = 0.0):
        self._own, self.simulation, self._shift = own, simulation, shift
        self.mine, self.theirs = common_joints(simulation.chain, own.chain)
        self._start, self._ratio = own.tick, steps_in_common(simulation.step, own.step)
        self._effort = np.zeros(simulation.chain.joint_count)
        self.late, self.latest, self.unused = 0, 0.0, Counter()
        self.stopped: Optional[SimulationError] = None
        self._ticks = 0
        self._push()

    def meets(self, tick: int) -> bool:
        """Whether a tick of the recorded run is one of this run too."""
        return (tick - self._start) % self._ratio.numerator == 0

    def advance_to(self, tick: int) -> None:
        """Advance to the first tick at or after that of the recorded run; not beyond an end of the motion."""
        ticks = -(-(tick - self._start) * self._ratio.denominator // self._ratio.numerator)
        if ticks > self._ticks and not self.stopped:
            try:
                self.simulation.advance(ticks - self._ticks, self._effort)
            except SimulationError as error:
                self.stopped = error
        self._ticks = ticks

    def change(self, event: dict, before: Chain, effort: np.ndarray) -> None:
        """Repeat an event of the recorded run, whose chain was `before` and whose efforts are `effort` now; Mistake."""
        tick, kind, data = event['tick'], event['kind'], event['data']
        self.advance_to(tick)
        if self.stopped:
            return
        delay = self._ticks * self.simulation.step - (tick - self._start) * self._own.step
        if not self.meets(tick):
            self.late, self.latest = self.late + 1, max(self.latest, delay)
        self._effort[self.mine] = effort[self.theirs]
        try:
            if kind == 'parameter' and data['name'] in QUANTITIES:
                self._set_quantity(data['name'], before)
            elif kind == 'state':
                position, velocity = self.simulation.position, self.simulation.velocity
                position[self.mine] = np.array(data['position'], float)[self.theirs]
                velocity[self.mine] = np.array(data['velocity'], float)[self.theirs]
                self.simulation.set_state(position, velocity)
            elif kind in ('wrench', 'payload') and data['body'] not in {
                    body.name for body in self.simulation.chain.bodies}:
                self.unused[f"{kind} on the body '{data['body']}', which the other chain does not have"] += 1
            elif kind in ('wrench', 'payload', 'reset'):
                apply_event(self.simulation, kind, data)
        except ValueError as error:
            raise Mistake(f'the {kind} at t = {tick * self._own.step:.12g} s cannot be repeated in the changed run '
                          f'({error})') from None
        if kind in ('state', 'reset'):
            self._push()

    def _set_quantity(self, name: str, before: Chain) -> None:
        """Change the numbers of a quantity that the event has changed, and no others."""
        get, chain = QUANTITIES[name].get, self.simulation.chain
        values, old, new = get(chain), get(before), get(self._own.chain)
        pairs = ((0, 0), (1, 1)) if name == 'gravity' else zip(self.mine.tolist(), self.theirs.tolist())
        for mine, theirs in pairs:
            if old[theirs] != new[theirs]:
                values[mine] = new[theirs]
        self.simulation.replace_chain(changed_chain(chain, name, values))

    def _push(self) -> None:
        if self._shift:
            self.simulation.set_state(self.simulation.position, self.simulation.velocity + self._shift)
