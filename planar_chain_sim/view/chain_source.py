"""A chain that moves here, in real time, without ROS; it follows the changes of its file."""
from __future__ import annotations

from collections import deque
from pathlib import Path
from threading import Event
from time import monotonic
from typing import Any, Callable, Mapping, Optional, Sequence

import numpy as np

from .grips import Grips
from .scene import Scene, State
from .source import Source
from ..chain.chain import Chain
from ..chain.hold import Hold
from ..chain.joint_arrays import initial_state
from ..chain.quantities import changed_chain, QUANTITIES, to_json
from ..chain_file import find_chain_file, load_chain
from ..errors import ChainError, Mistake, SimulationError
from ..motion.simulation import Interrupted, Simulation

PERIOD = 0.005        # s between two turns of the loop
LOOK_PERIOD = 0.2     # s between two looks at the file
MOST_LATE = 0.5       # s of lateness that is made up for; more is dropped
STEP = 1e-3           # s, a tick
FASTEST = 1e3


class ChainSource(Source):
    """
    Simulates a chain file in a thread of its own, from start() to close(). ChainError: a bad file at the beginning.

    If it becomes bad later, the arm stays as it is and the status has the error.
    """

    kind = 'chain'

    def __init__(self, path: str, hold: Hold = None) -> None:
        super().__init__()
        self._path, self._hold = find_chain_file(path), hold
        self._stamp = self._looked()
        self._loaded = load_chain(path, hold)
        self._simulation = Simulation(self._loaded, step=STEP)
        self._grips = Grips()
        self._requests: deque[Callable[[], None]] = deque()
        self._wake = Event()
        self._paused, self._factor, self._fault, self._end = False, 1.0, '', ''
        self._states: Optional[tuple[State, ...]] = None
        self._measured, self._lateness = 1.0, 0.0
        self._show()

    def close(self) -> None:
        """End the thread."""
        self._stopping = True
        self._wake.set()
        self._simulation.interrupt()
        super().close()

    def states(self) -> Optional[Sequence[State]]:
        """Return the newest state."""
        return self._states

    def leave(self, page: Any) -> None:
        """Let go of all that a page holds."""
        self._grips.release(page)

    def act(self, page: Any, action: Mapping[str, Any]) -> None:
        """Do what a page asks for; Mistake: it has no effect."""
        do, chain = action['do'], self._simulation.chain
        if do == 'effort':
            self._grips.hold(page, chain, action['joint'], action['value'])
        elif do == 'pull':
            if self._states:
                self._grips.pull(page, chain, self._states[0].position, action['body'], action['point'], action['to'])
        elif do == 'release':
            self._grips.release(page)
        elif do == 'set':
            self._ask(self._setting(action['name'], action['value']))
        elif do == 'pause':
            self._ask(lambda: self._pause(action['value']))
        elif do == 'step':
            if not self._paused:
                raise Mistake('one tick can be made only while paused')
            self._ask(self._step)
        elif do == 'reset':
            self._ask(self._reset)
        else:
            super().act(page, action)

    def _ask(self, work: Callable[[], None]) -> None:
        """Let the simulation's thread do something between two turns."""
        self._requests.append(work)
        self._wake.set()

    def _setting(self, name: str, value: Any) -> Callable[[], None]:
        """Return a function that sets a value; Mistake: the value is impossible."""
        if name in QUANTITIES:
            try:
                changed_chain(self._simulation.chain, name, _floats(value))
            except ValueError as error:
                raise Mistake(str(error)) from None
            return lambda: self._change(name, _floats(value))
        if not isinstance(value, float):
            raise Mistake(f'{name} is {value!r:.80}, must be a number')
        if name == 'real_time_factor':
            if not 1e-6 <= value <= FASTEST:
                raise Mistake(f'real_time_factor is {value:g}, must be from 1e-06 to {FASTEST:g}')
            return lambda: self._set_factor(value)
        if name == 'payload_mass':
            if not 0.0 <= value <= 1e9:
                raise Mistake(f'payload_mass is {value:g} kg, must be from 0 to 1e9')
            return lambda: self._set_payload(value)
        raise Mistake(f'{name!r:.80} cannot be set')

    # What follows runs in the simulation's thread.

    def _run(self) -> None:
        looked = begun = monotonic()
        self._anchor()
        before = self._simulation.time, begun
        while not self._stopping:
            while self._requests:
                try:
                    self._requests.popleft()()
                except ValueError as error:   # the simulation refuses it
                    self.complaints.say(str(error))
            now = monotonic()
            if now - looked >= LOOK_PERIOD:
                looked = now
                self._follow_file()
            moved = self._simulation.time - before[0]
            if now - before[1] >= 0.5:
                self._measured, before = max(moved, 0.0) / (now - before[1]), (self._simulation.time, now)
            if not self._paused and not self._end:
                self._catch_up(monotonic())
            self._pull()
            self._publish()
            self._wake.wait(PERIOD)
            self._wake.clear()

    def _anchor(self) -> None:
        """Count time from here."""
        self._begin, self._done = monotonic(), 0

    def _catch_up(self, now: float) -> None:
        """Make the ticks that are due."""
        step = self._simulation.step
        due = int((now - self._begin) * self._factor / step) - self._done
        late = due * step / self._factor
        self._lateness = max(late - PERIOD, 0.0)
        if late > MOST_LATE:
            self.events.say({'tick': self._simulation.tick, 'kind': 'dropped_time', 'data': {'seconds': late}})
            self._anchor()
            return
        end = now + 4 * PERIOD
        while due > 0 and monotonic() < end and not self._end:
            ticks = min(due, max(1, round(PERIOD * self._factor / step)))
            self._advance(ticks)
            due -= ticks
            self._done += ticks

    def _advance(self, ticks: int) -> None:
        """Move under what pages hold."""
        simulation = self._simulation
        held, effort = self._grips.efforts(), np.zeros(simulation.chain.joint_count)
        for joint, value in held.items():
            if joint in simulation.chain.joint_names:
                effort[simulation.chain.joint_names.index(joint)] = value
        self._pull()
        try:
            simulation.advance(ticks, effort)
        except Interrupted:   # by close()
            return
        except SimulationError as error:
            self._end = str(error)
            self.events.say({'tick': simulation.tick, 'kind': 'divergence' if error.ran_away else 'stopped',
                             'data': {'message': str(error)}})
            self._tell_status()
        for event in simulation.take_events():
            self.events.say({'tick': event.tick, 'kind': event.kind,
                             'data': {'joint': event.joint, 'time': event.time, 'speed': event.speed}})

    def _pull(self) -> None:
        """Apply the pulls that pages hold, and remove those that they have let go."""
        simulation = self._simulation
        pulled = {pull.body: pull for pull in self._grips.pulls() if pull.body in simulation.chain.body_index}
        for body in {*simulation.wrenches, *pulled}:
            if body in pulled:
                force, moment, _ = pulled[body].load(simulation.chain, simulation.position, simulation.velocity)
                simulation.set_wrench(body, (force.real, force.imag), moment, 'world')
            else:
                simulation.set_wrench(body)

    def _publish(self) -> None:
        simulation = self._simulation
        before = self._states[0] if self._states else None
        wrenches = simulation.wrenches
        if before is not None and before.tick == simulation.tick and before.wrenches == wrenches and (
                np.array_equal(before.position, simulation.position)):
            return
        self._states = (State(simulation.time, simulation.tick, simulation.position, simulation.velocity,
                              simulation.effort, wrenches, self._measured, self._lateness),)

    def _pause(self, paused: bool) -> None:
        if paused != self._paused:
            self._paused = paused
            self._anchor()
            self._event('pause' if paused else 'resume')
            self._tell_status()

    def _step(self) -> None:
        if self._paused and not self._end:
            self._advance(1)
            self._event('step')

    def _reset(self) -> None:
        self._grips.clear()
        self._simulation.set_state(*initial_state(self._simulation.chain))
        self._simulation.clear_wrenches()
        self._end = ''
        self._anchor()
        self._event('reset')
        self._tell_status()

    def _set_factor(self, value: float) -> None:
        self._factor = value
        self._anchor()
        self._event('parameter', name='real_time_factor', value=value)
        self._tell_status()

    def _change(self, name: str, values: list) -> None:
        """Set a quantity of the chain."""
        simulation = self._simulation
        simulation.replace_chain(changed_chain(simulation.chain, name, values))
        self._event('parameter', name=name, value=to_json(values))
        self._show()

    def _set_payload(self, mass: float) -> None:
        simulation = self._simulation
        body = simulation.own_chain.bodies[-1].name
        for payload in simulation.payloads:
            simulation.drop(payload)
        if mass:
            name, taken = 'payload', simulation.chain.body_index
            while name in taken:
                name += '_'
            simulation.attach(body, mass, name=name)
        self._event('payload', body=body, mass=mass)
        self._show()

    def _event(self, kind: str, **data: Any) -> None:
        self.events.say({'tick': self._simulation.tick, 'kind': kind, 'data': data})

    def _looked(self) -> Optional[tuple]:
        """Return time, size and inode of the file; None if there is no file."""
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino

    def _follow_file(self) -> None:
        """Load the file if it has changed."""
        stamp = self._looked()
        if stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            chain = load_chain(self._path, self._hold)
        except ChainError as error:
            self._fault = str(error)
        else:
            self._fault = ''
            if chain != self._loaded:
                self._take(chain)
        self._tell_status()

    def _take(self, chain: Chain) -> None:
        """Go on with another chain; from its initial state where that, or the joints, are others."""
        before, self._loaded = self._loaded, chain
        simulation = self._simulation
        self._grips.clear()
        if not self._end and _goes_on(before, chain, simulation.position):
            for payload in simulation.payloads:
                simulation.drop(payload)
            simulation.replace_chain(chain)
        else:
            self._simulation, self._end = Simulation(chain, step=STEP), ''
            self._anchor()
        self._event('reload', file=Path(self._path).name)
        self._show()

    def _show(self) -> None:
        """Show the arm as it is now."""
        simulation = self._simulation
        self.show([Scene(simulation.chain, len(simulation.own_chain.bodies))])
        self._tell_status()
        self._publish()

    def _tell_status(self) -> None:
        simulation = self._simulation
        chain = simulation.chain
        payload = chain.bodies[-1].mass if simulation.payloads else 0.0
        self.status = {
            'sentence': self._fault or self._end or ('paused' if self._paused else 'running'),
            'fault': bool(self._fault or self._end), 'paused': self._paused, 'name': str(self._path),
            'can': ['pause', 'step', 'reset', 'effort', 'pull', 'gravity', 'damping', 'real_time_factor',
                    'payload_mass'],
            'values': {'gravity': QUANTITIES['gravity'].get(chain), 'damping': QUANTITIES['damping'].get(chain),
                       'real_time_factor': self._factor, 'payload_mass': payload}}


def _goes_on(before: Chain, chain: Chain, position: np.ndarray) -> bool:
    """Tell whether a motion can go on at this position with another chain, and has begun as that would."""
    return (chain.joint_names, len(chain.bodies)) == (before.joint_names, len(before.bodies)) and all(
        map(np.array_equal, initial_state(chain), initial_state(before))) and all(
        joint.lower <= place <= joint.upper for joint, place in zip(chain.joints, position))


def _floats(value: Any) -> list:
    """Return a list of numbers; Mistake: it is none."""
    if not isinstance(value, list):
        raise Mistake(f'the value is {value!r:.80}, must be a list of numbers')
    return value
