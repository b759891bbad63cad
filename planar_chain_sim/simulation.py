"""A chain in time: state, ticks, efforts; no clock, no ROS. Same chain, method, step and efforts: same bits."""
from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite, ulp
from typing import Mapping, NamedTuple, Optional
from warnings import warn

import numpy as np

from . import _kernel
from .chain import Chain
from .dynamics import joint_array, resolve_form, SimulationError
from .integrators import choose_method, DEFAULT_TOLERANCE, method_data, METHODS, STIFF, taylor_order, UNROLLED_SERIES
from .loads import checked_wrench, index_of, on_links, with_payload, without_payload, Wrench
from .plan import damping_rate, plan_of, step_limit

# Outcomes of the kernel's step, in the order of `enum class Outcome` (kernel/integrators.hpp).
_WHY = (None, 'the configuration is singular', 'the state ran away and would not be finite',
        'the steps that the tolerance asks for have become too short to be taken',
        'the step is too long for the iteration that solves it',
        'the step is too long, two half steps lead somewhere else',
        'its events follow one another without time going on')


# In the order of `enum class EventKind` (kernel/events.hpp).
EVENT_KINDS = ('stop_touched', 'stop_left', 'stuck', 'slipped')


class JointEvent(NamedTuple):
    """One of EVENT_KINDS at a joint, at `time`, s, behind tick `tick`; `speed`, rad/s or m/s, of meeting a stop."""

    tick: int
    time: float
    kind: str
    joint: str
    speed: float


@dataclass(frozen=True)
class Checkpoint:
    """What decides how a simulation goes on: its tick and the kernel's state, hidden round-off terms included."""

    tick: int
    state: tuple
    between: Optional[float] = None  # s, time between two ticks
    chain: Optional[Chain] = None    # as it was then, None: the one that there is
    wrenches: Mapping[str, Wrench] = field(default_factory=dict)


def initial_state(chain: Chain) -> tuple[np.ndarray, np.ndarray]:
    """`position` and `velocity` of the chain file, (joints,) each."""
    return (np.array([joint.position for joint in chain.joints], dtype=np.float64),
            np.array([joint.velocity for joint in chain.joints], dtype=np.float64))


def beyond_stop(chain: Chain, index: int, position: float) -> ValueError:
    """Return the error that names a joint and a position of it beyond one of its stops."""
    joint = chain.joints[index]
    return ValueError(f"position of joint '{joint.name}' of {chain.name} is {float(position)!r}, must lie "
                      f'between its stops, {joint.lower!r} and {joint.upper!r}')


def refuse_beyond_stops(chain: Chain, position: np.ndarray) -> None:
    """Raise ValueError that names the first joint of positions (..., joints) that lies beyond one of its stops."""
    for index, joint in enumerate(chain.joints):
        beyond = position[..., index][(position[..., index] < joint.lower) | (position[..., index] > joint.upper)]
        if beyond.size:
            raise beyond_stop(chain, index, beyond.flat[0])


def resolve_method(chain: Chain, method: str, tolerance: Optional[float]):
    """Row of METHODS and tolerance for a name or 'auto'; ValueError: unknown name, a tolerance that cannot be used."""
    if method != 'auto' and method not in METHODS:
        raise ValueError(f"method is {method!r}, must be 'auto' or one of {', '.join(map(repr, METHODS))}")
    adaptive = method == 'auto' or METHODS[method].adaptive
    if tolerance is None:
        tolerance = DEFAULT_TOLERANCE if adaptive else None
    elif not adaptive:
        raise ValueError(f'tolerance is {tolerance!r}, must be None: method {method!r} has a fixed step')
    elif isinstance(tolerance, bool) or not isinstance(tolerance, (int, float, np.floating)) or not 0 < tolerance < 1:
        raise ValueError(f'tolerance is {tolerance!r}, must be a number between 0 and 1')
    name = choose_method(tolerance, damping_rate(chain), chain.joint_count) if method == 'auto' else method
    return METHODS[name], None if tolerance is None else float(tolerance)


def stop_error(chain: Chain, tick: int, time: float, outcome: int, joint: int, position, velocity,
               where: str = '') -> SimulationError:
    """Why the kernel stopped at this last good state, as an error to raise or to keep."""
    name = chain.joint_names[joint]
    body = chain.body_of(name)
    return SimulationError(f"{where}joint '{name}' of body '{body}' of {chain.name} at tick {tick}, t = {time!r} s: "
                           f'{_WHY[outcome]}; the last good state is kept', joint=name, body=body, time=time, tick=tick,
                           position=position, velocity=velocity)


class Simulation:
    """
    A chain that moves tick by tick: tick k is at k * step, the effort is constant within a tick.

    A fixed step that is too long gets a RuntimeWarning: at once with the estimated limit where a joint is stiff, in the
    first 10 s once the errors of all steps add up to 0.03 rad or m, later once a step is far from what two half steps
    give. set_state, restore, another chain, stops and friction's events let the estimate start anew.

    `step` s; `tolerance` belongs to adaptive methods; `form` as in forward_dynamics, one of the compiled.
    ValueError: bad method, step, tolerance or form.
    """

    def __init__(self, chain: Chain, method: str = 'auto', step: float = 1e-3, tolerance: Optional[float] = None,
                 form: str = 'auto'):
        if not (isinstance(step, (int, float, np.floating)) and isfinite(step) and step > 0):
            raise ValueError(f'step is {step!r}, must be a positive finite number of seconds')
        if form == 'reference':
            raise ValueError("form is 'reference', must be 'auto', 'dense' or 'recursive': "
                             'only compiled forms are integrated')
        self.chain, self.step = chain, float(step)
        self._row, self.tolerance = resolve_method(chain, method, tolerance)
        self.method, self._asked = self._row.name, method
        limit = None if self._row.adaptive else step_limit(chain, self._row)
        if limit and self.step > limit[0]:
            warn(f'step is {self.step!r} s, should be below about {limit[0]:.2g} s: method {self.method!r} is unstable '
                 f"beyond, for joint '{limit[1]}' of {chain.name} is stiff", RuntimeWarning, stacklevel=2)
        self.form_asked = form
        self.form, self._why_form = self._resolve_form(form)
        self._stepper = _kernel.Stepper(plan_of(chain).model, method_data(self._row, self.tolerance), self.step,
                                        self.form == 'dense')
        self._tick, self._between = 0, None
        self._counted, self._untaken = (0, 0, 0, 0), []   # of steppers that a changed chain has replaced
        self._own_bodies, self._wrenches = len(chain.bodies), {}   # bodies beyond are payloads
        self.set_state(*initial_state(chain))

    def _resolve_form(self, form: str) -> tuple[str, str]:
        """Form of the equations that is integrated, and why where 'auto' was asked for or there is no other."""
        resolved = resolve_form(self.chain, form)
        if self._row.family != 'taylor':
            return resolved, plan_of(self.chain).why_form if form == 'auto' else ''
        if self.chain.joint_count > UNROLLED_SERIES:
            return 'recursive', f' (the series of more than {UNROLLED_SERIES} joints is not unrolled)'
        if form == 'auto' and plan_of(self.chain).model.refined:
            return 'recursive', ' (auto: light links carry a heavy one)'
        if form == 'auto':
            return 'dense', f' (auto: the series of at most {UNROLLED_SERIES} joints is unrolled)'
        return resolved, ''

    @property
    def tick(self) -> int:
        """Ticks done since the start; the last whole one where advance_to has gone on between two ticks."""
        return self._tick

    @property
    def time(self) -> float:
        """Simulated time, s: tick * step, or where between two ticks advance_to has led."""
        return self._tick * self.step if self._between is None else self._between

    @property
    def position(self) -> np.ndarray:
        """Joint positions (joints,), rad or m, never wrapped."""
        return self._stepper.position

    @property
    def velocity(self) -> np.ndarray:
        """Joint velocities (joints,), rad/s or m/s."""
        return self._stepper.velocity

    @property
    def effort(self) -> np.ndarray:
        """Actuator efforts (joints,) that acted over the last tick, after clamping, N m or N; zero before the first."""
        return self._stepper.effort

    @property
    def acceleration(self) -> np.ndarray:
        """
        Joint accelerations (joints,) at this state under `effort`, computed when asked for, rad/s^2 or m/s^2.

        Zero where a joint sticks or rests on a stop. SimulationError: singular configuration.
        """
        acceleration, joint = self._stepper.acceleration()
        if joint >= 0:
            raise self._error(1, joint)
        return acceleration

    @property
    def statistics(self) -> dict:
        """Counts since the start: evaluations, steps, rejected steps, events."""
        return dict(zip(('evaluations', 'steps', 'rejected_steps', 'events'), self._counts()))

    @property
    def has_events(self) -> bool:
        """Whether the scene has stops or friction; else take_events() has nothing ever."""
        return not {'stops', 'friction'}.isdisjoint(plan_of(self.chain).used)

    def take_events(self) -> list[JointEvent]:
        """Return stops touched and left, joints stuck and slipped since the last call; at most 4096 are kept."""
        fresh = self._stepper.take_events()
        if not fresh and not self._untaken:
            return []
        untaken, self._untaken = self._untaken, []
        return untaken + [
            JointEvent(tick, tick * self.step + offset, EVENT_KINDS[kind], self.chain.joint_names[joint], speed)
            for tick, offset, kind, joint, speed in fresh]

    @property
    def plan(self) -> str:
        """What this scene needs and what is skipped, the method and form chosen and why, on one line."""
        stiff = f'damping decays at {damping_rate(self.chain):.0f} 1/s'
        why = f' (auto: {stiff if self.method == STIFF else "not stiff"})' if self._asked == 'auto' else ''
        order = self._row.order or f'{taylor_order(self.tolerance)} for tolerance {self.tolerance:g}'
        return (f'{plan_of(self.chain)}; method {self.method}{why}, order {order}, tick {self.step:g} s; '
                f'form {self.form}{self._why_form}')

    def set_state(self, position, velocity) -> None:
        """
        Put joint positions and velocities (joints,); time is unchanged, hidden round-off terms are cleared.

        ValueError: bad arrays, a position beyond a stop.
        """
        joint = self._stepper.put_state(position, velocity)
        if joint >= 0:
            raise beyond_stop(self.chain, joint, joint_array('position', position, (self.chain.joint_count,))[joint])

    def replace_chain(self, chain: Chain) -> None:
        """
        Go on from here with a chain that has the same joints, by a plan made anew.

        Time, state and hidden round-off terms stay, as do the method and what stands still; an adaptive method starts
        its steps anew. ValueError, and nothing is changed: other joints.
        """
        if chain.joint_names != self.chain.joint_names:
            raise ValueError(f'chain {chain.name!r} has other joints than {self.chain.name!r}, must have the same')
        fresh = Simulation(chain, self.method, self.step, self.tolerance, self.form_asked)
        self._counted, self._untaken = self._counts(), self.take_events()
        before, self._stepper = self._stepper, fresh._stepper
        self.chain, self.form, self._why_form = chain, fresh.form, fresh._why_form
        bodies, wrenches = {body.name for body in chain.bodies}, self._wrenches
        self._wrenches = {}
        self._put_wrenches({body: wrench for body, wrench in wrenches.items() if body in bodies})
        self._stepper.take_over(before)

    @property
    def wrenches(self) -> dict[str, Wrench]:
        """The wrenches that act, by body."""
        return dict(self._wrenches)

    def set_wrench(self, body: str, force=(0.0, 0.0), moment: float = 0.0, axes: str = 'body') -> None:
        """
        Let a force and a moment act on a body from now on, in place of the last ones; zero takes them away.

        `force` [x, y], N, acts at the body's joint point, in the axes of the 'body', with which it turns, or of the
        'world'; `moment` N m, counter-clockwise (equations.md 6.5). ValueError: no such body, a number that is not
        finite, other axes.
        """
        index_of(self.chain, body)
        wrench = checked_wrench(force, moment, axes)
        wrenches = dict(self._wrenches)
        wrenches.pop(body, None)
        if wrench.force or wrench.moment:
            wrenches[body] = wrench
        self._put_wrenches(wrenches)

    @property
    def wrench_effort(self) -> np.ndarray:
        """Joint efforts (joints,), N m or N, that do the same work as the wrenches in this state (equations.md 6.5)."""
        return self._stepper.wrench_effort()

    def clear_wrenches(self) -> None:
        """Take all wrenches away."""
        self._put_wrenches({})

    def _put_wrenches(self, wrenches: Mapping[str, Wrench]) -> None:
        if wrenches != self._wrenches:
            self._wrenches = dict(wrenches)
            self._stepper.set_wrenches(on_links(self.chain, wrenches))

    def attach(self, body: str, mass: float, position=(0.0, 0.0), inertia_com: float = 0.0,
               name: str = 'payload') -> None:
        """
        Weld a payload to a body: from now on it is part of the chain, for which the plan is made anew.

        `mass` kg, its mass centre at `position` [x, y], m, in the body's frame, `inertia_com` kg m^2 about that. Joint
        velocities stay: it has been moving along with the body. ValueError: no such body, a name that a body has, a
        number that is not finite or too small.
        """
        self.replace_chain(with_payload(self.chain, body, mass, position, inertia_com, name))

    def drop(self, name: str = 'payload') -> None:
        """Let a payload go; joint velocities stay. ValueError: no such payload, or one that carries another."""
        self.replace_chain(without_payload(self.chain, self._own_bodies, name))

    @property
    def payloads(self) -> tuple[str, ...]:
        """Names of the payloads that are attached."""
        return tuple(body.name for body in self.chain.bodies[self._own_bodies:])

    def _counts(self) -> tuple:
        return tuple(before + count for before, count in zip(self._counted, self._stepper.counts))

    def advance(self, ticks: int, effort=None, record: Optional[tuple] = None) -> None:
        """
        Go on for `ticks` ticks under `effort`, N m or N: (joints,) is held, (ticks, joints) a row per tick, None zero.

        `record`: three C-ordered float64 arrays (ticks, joints) that take position, velocity and acted effort of each
        tick. ValueError: bad count, shape or value, before anything moves. SimulationError: singular or not finite; the
        last good state stays.
        """
        stopped = self._stepper.advance(self.time, self._tick, ticks, effort, record)
        if stopped is False:  # not yet what the kernel takes
            ticks, effort, record = self._checked(ticks, effort, record)
            stopped = self._stepper.advance(self.time, self._tick, ticks, effort, record)
            if stopped is False:   # nothing has moved, and nothing may count as done
                raise ValueError(f'ticks {ticks!r}, effort {effort!r:.80} and record {record!r:.80} do not go together')
        done, *why = stopped or (ticks,)
        self._tick += done
        if done:
            self._between = None
        if stopped:
            self._warn_of_coarse_step()
            if why[0]:
                raise self._error(*why)

    def _warn_of_coarse_step(self) -> None:
        """Warn once of a fixed step that is far from what two half steps give."""
        coarse = self._stepper.take_coarse_step()
        if coarse:
            tick, error, joint, summed = coarse
            what = 'the errors of all steps have added up, and the state' if summed else 'it'
            warn(f"step is {self.step!r} s, too long for method '{self.method}': at tick {tick} {what} is off by about "
                 f"{error:.2g} rad or m at joint '{self.chain.joint_names[joint]}' of {self.chain.name}; "
                 'take a shorter step or an adaptive method', RuntimeWarning, stacklevel=3)

    def _error(self, outcome: int, joint: int) -> SimulationError:
        return stop_error(self.chain, self.tick, self.time, outcome, joint, self.position, self.velocity)

    def _checked(self, ticks, effort, record) -> tuple:
        """Return the arguments of advance as the kernel takes them; ValueError."""
        if not isinstance(ticks, (int, np.integer)) or isinstance(ticks, bool) or not 0 <= ticks < 2 ** 63:
            raise ValueError(f'ticks is {ticks!r}, must be a whole number >= 0')
        joints = self.chain.joint_count
        if effort is not None:
            effort = joint_array('effort', effort, (joints,) if _is_flat(effort) else (ticks, joints))
        if record is not None and (not isinstance(record, (tuple, list)) or len(record) != 3
                                   or not all(isinstance(rows, np.ndarray) for rows in record)):
            raise ValueError(f'record is {record!r:.80}, must be three arrays, of position, velocity and effort')
        for rows in record or ():
            if rows.shape != (ticks, joints) or rows.dtype != np.float64 or not rows.flags.carray:
                raise ValueError(f'record has an array of {rows.dtype} and shape {rows.shape}, '
                                 f'must be C-ordered writeable float64 of shape {(ticks, joints)}')
        return int(ticks), effort, None if record is None else tuple(record)

    def advance_to(self, time: float, effort=None) -> None:
        """
        Go on to exactly `time` s under `effort` as in advance; an adaptive method may stop between two ticks.

        ValueError: a time that lies back, for a method of fixed step one that is no whole number of steps; effort rows
        for a time between two ticks. SimulationError as in advance.
        """
        try:
            tick, between = whole_ticks(time, self.step, 'time'), False
        except ValueError:
            if not self._row.adaptive or not (isinstance(time, (int, float, np.floating)) and 0.0 <= time < np.inf):
                raise
            tick, between = int(time / self.step), True
        if time < self.time and (between or tick < self._tick + (self._between is not None)):
            raise ValueError(f'time is {time!r} s, must not lie before the present {self.time!r} s')
        if between:
            effort = joint_array('effort', np.zeros(self.chain.joint_count) if effort is None else effort,
                                 (self.chain.joint_count,))
        if tick > self._tick:
            self.advance(tick - self._tick, effort)
        if between:
            stopped = self._stepper.reach(self.time, self._tick, float(time), effort)
            if stopped:
                raise self._error(*stopped)
            self._between = float(time)

    def checkpoint(self) -> Checkpoint:
        """Everything, hidden round-off terms included: going on from it gives the same bits."""
        return Checkpoint(self._tick, self._stepper.save(), self._between, self.chain, self.wrenches)

    def restore(self, saved: Checkpoint) -> None:
        """Go back to a checkpoint of a simulation of the same chain; ValueError if it is of another size."""
        if saved.state[0].size != self.chain.joint_count:
            raise ValueError(f'checkpoint has {saved.state[0].size} joints, must have {self.chain.joint_count}')
        if saved.chain is not None and saved.chain != self.chain:
            self.replace_chain(saved.chain)
        self._put_wrenches(saved.wrenches)
        self._stepper.load(*saved.state)
        self._tick, self._between = saved.tick, saved.between


@dataclass(frozen=True)
class Run:
    """A rollout: `time` (ticks+1,) s; `position`, `velocity` (ticks+1, joints); `effort` (ticks, joints) that acted."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


def rollout(chain: Chain, duration: float, step: float = 1e-3, method: str = 'auto', effort=None,
            tolerance: Optional[float] = None, form: str = 'auto') -> Run:
    """
    Simulate `duration` s from the chain's initial state.

    `effort`: None, (joints,) held, (ticks, joints) a row per tick, or a callable once per tick, (time, position,
    velocity) -> (joints,). ValueError: bad arguments, a duration that is no whole number of steps. SimulationError
    as in Simulation.advance.
    """
    simulation = Simulation(chain, method, step, tolerance, form)
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


def _is_flat(values) -> bool:
    """Whether values are one row of numbers and not rows of rows."""
    if isinstance(values, (list, tuple)) and values and isinstance(values[0], (float, int)):
        return True
    try:
        return np.ndim(values) == 1
    except ValueError:   # rows of different lengths
        return False


def whole_ticks(duration: float, step: float, name: str = 'duration') -> int:
    """`duration` / `step` where that is a whole number >= 0 up to rounding, else ValueError that calls it `name`."""
    if type(duration) is float and isfinite(duration):
        ticks, spacing = round(duration / step), ulp(duration)
    else:   # another kind of number, perhaps of fewer digits, or none
        number = isinstance(duration, (int, float, np.integer, np.floating)) and np.isfinite(duration)
        ticks, spacing = (round(duration / step), np.spacing(abs(duration))) if number else (-1, 0.0)
    if ticks < 0 or abs(ticks * step - duration) > 1e-9 * step + 4.0 * spacing:
        raise ValueError(f'{name} is {duration!r} s, must be a whole number >= 0 of steps of {step!r} s')
    return ticks
