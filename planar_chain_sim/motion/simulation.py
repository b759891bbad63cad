"""A chain in time: state, ticks, efforts; no clock, no ROS. Same chain, method, step and efforts: same bits."""
from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite, ulp
from operator import add
from threading import RLock
from typing import Any, Mapping, NamedTuple, Optional, TYPE_CHECKING
from warnings import warn

import numpy as np

from .integrators import (
    choose_method,
    DEFAULT_TOLERANCE,
    LEAST_TOLERANCE,
    method_data,
    METHODS,
    STIFF,
    taylor_order,
    UNROLLED_SERIES,
)
from .stiffness import damping_rate, step_limit
from .. import _kernel
from ..chain.chain import altered, Chain
from ..chain.joint_arrays import beyond_stop, initial_state, joint_array
from ..chain.quantities import same_but_for_quantities
from ..chain.section import counted
from ..errors import SimulationError
from ..mechanics.dynamics import resolve_form
from ..mechanics.loads import with_payload, without_payload, Wrench
from ..mechanics.plan import plan_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Why the kernel stopped, by its name of the outcome.
_WHY = {'singular': 'the configuration is singular', 'not_finite': 'the state ran away and would not be finite',
        'stalled': 'the steps that the tolerance needs have become too short',
        'too_long': 'the step is too long, its iteration does not converge',
        'coarse': 'the step is too long, two half steps give another result',
        'endless_events': 'events of stops and friction follow one another without end at this time'}

EVENT_KINDS = _kernel.EVENT_KINDS

CHECKPOINT_FORMAT = _kernel.CHECKPOINT_FORMAT
MOST_TICKS = _kernel.MOST_TICKS   # a double counts no further


class Interrupted(RuntimeError):
    """Simulation.interrupt() ended a call; the simulation is at the last whole tick and can go on from there."""


class JointEvent(NamedTuple):
    """One of EVENT_KINDS at a joint, at `time`, s, behind tick `tick`; `speed`, rad/s or m/s, of meeting a stop."""

    tick: int
    time: float
    kind: str
    joint: str
    speed: float


@dataclass(frozen=True)
class Checkpoint:
    """
    What decides how a simulation goes on: its tick, the kernel's state, hidden round-off terms included, and settings.

    `state`: position, velocity, the remainders of both beyond double precision, effort, (joints,) each; then what the
    method keeps, which only the same method with the same step, tolerance and form can use.
    """

    tick: int
    state: tuple
    between: Optional[float] = None  # s, time between two ticks
    chain: Optional[Chain] = None    # as it was then
    wrenches: Mapping[str, Wrench] = field(default_factory=dict)
    method: Optional[str] = None
    step: Optional[float] = None     # s
    tolerance: Optional[float] = None
    form: Optional[str] = None       # of the equations, resolved
    own_bodies: Optional[int] = None  # bodies beyond are payloads
    format: Optional[int] = None

    def __repr__(self) -> str:
        name = getattr(self.chain, 'name', None)
        return f'Checkpoint of {name} at tick {self.tick}, method {self.method}, step {self.step} s'

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.tick * (self.step or 0.0) if self.between is None else self.between


def resolve_method(chain: Chain, method: str, tolerance: Optional[float]) -> Any:
    """Row of METHODS and tolerance for a name or 'auto'; ValueError: unknown name, a tolerance that cannot be used."""
    if not isinstance(method, str) or method != 'auto' and method not in METHODS:
        raise ValueError(f"method is {method!r}, must be 'auto' or one of {', '.join(map(repr, METHODS))}")
    adaptive = method == 'auto' or METHODS[method].adaptive
    if tolerance is None:
        tolerance = DEFAULT_TOLERANCE if adaptive else None
    elif not adaptive:
        raise ValueError(f'tolerance is {tolerance!r}, must be None: method {method!r} has a fixed step')
    elif isinstance(tolerance, bool) or not isinstance(tolerance, (int, float, np.floating)) or not (
            LEAST_TOLERANCE <= tolerance < 1):
        raise ValueError(f'tolerance is {tolerance!r}, must be a number between {LEAST_TOLERANCE:g} and 1')
    if method == 'auto':
        method = choose_method(tolerance or DEFAULT_TOLERANCE, damping_rate(chain), chain.joint_count)
    return METHODS[method], None if tolerance is None else float(tolerance)


def stop_error(chain: Chain, tick: int, time: float, outcome: int, joint: int, position: ArrayLike, velocity: ArrayLike,
               where: str = '') -> SimulationError:
    """Return the error that says why the kernel stopped at this last good state."""
    name = chain.joint_names[joint]
    body = chain.body_of(name)
    why = _WHY[_kernel.OUTCOMES[outcome]]
    return SimulationError(f"{where}joint '{name}' of body '{body}' of {chain.name} at tick {tick}, t = {time:.12g} s: "
                           f'{why}; the last good state is kept', joint=name, body=body, time=time, tick=tick,
                           position=position, velocity=velocity, reason=_kernel.OUTCOMES[outcome])


class Simulation:
    """
    A chain that moves tick by tick: tick k is at k * step, the effort is constant within a tick.

    A fixed step that is too long gives a RuntimeWarning: at once, with the estimated limit, if a joint is stiff; in the
    first 10 s when the errors of all steps add up to 0.03 rad or m; later when a step is far from the result of two
    half steps. set_state, restore, another chain, and events of stops and friction restart the estimate.

    `step` s; `tolerance` belongs to adaptive methods; `form` as in forward_dynamics, but not 'reference'.
    ValueError: bad method, step, tolerance or form. ChainError: an impossible chain that was made by hand.

    Any thread may use a simulation: a call waits until another thread's call has returned, except interrupt(). A signal
    handler that calls it during a call of its own thread gets a RuntimeError.

    copy.copy, copy.deepcopy and pickle give an independent simulation that goes on with the same bits.
    """

    def __init__(self, chain: Chain, method: str = 'auto', step: float = 1e-3, tolerance: Optional[float] = None,
                 form: str = 'auto') -> None:
        if not (isinstance(step, (int, float, np.floating)) and 0.0 < step < 1e308):
            raise ValueError(f'step is {step!r}, must be a positive finite number of seconds')
        if form == 'reference':
            raise ValueError("form is 'reference', must be 'auto', 'dense' or 'recursive': "
                             'only compiled forms are integrated')
        plan_of(chain)   # which refuses one that cannot be
        self.chain, self.step = chain, float(step)
        self._row, self.tolerance = resolve_method(chain, method, tolerance)
        self.method, self._asked = self._row.name, method
        limit = None if self._row.adaptive else step_limit(chain, self._row)
        if limit and self.step > limit[0]:
            warn(f'step is {self.step!r} s, should be below about {limit[0]:.2g} s: method {self.method!r} is unstable '
                 f"beyond, for joint '{limit[1]}' of {chain.name} is stiff", RuntimeWarning, stacklevel=2)
        self.form_asked = form
        self.form, self._why_form = self._resolve_form(chain)
        self._stepper = self._make_stepper(chain, self.form)
        self._counted, self._untaken = (0, 0, 0, 0), []   # of chains that others have replaced
        self._own_bodies = len(chain.bodies)   # bodies beyond are payloads
        self._bare_chains: tuple[Chain, ...] = (chain,)   # that it has had, without payloads
        self._changing = RLock()       # of what is kept here and not in the kernel
        self.set_state(*initial_state(chain))

    def __repr__(self) -> str:
        return (f'Simulation of {self.chain.name} at tick {self.tick}, t = {self.time:g} s: '
                f'{counted(self.chain.joint_count, "joint")}, method {self.method}, '
                f'tick {self.step:g} s; see plan')

    def _make_stepper(self, chain: Chain, form: str) -> Any:
        return _kernel.Stepper(plan_of(chain).model, method_data(self._row, self.tolerance), self.step, form == 'dense')

    def __getstate__(self) -> dict:
        self._stepper.wait()
        with self._changing:
            self._untaken = self.take_events()
            state = {name: value for name, value in vars(self).items() if name not in ('_row', '_stepper', '_changing')}
            saved = self._stepper.save()
            state.update(_untaken=list(self._untaken), _counted=self._counts(),
                         _stepper=(*saved, self._stepper.told, self.wrenches))
        return state

    def __setstate__(self, state: Any) -> None:
        *saved, told, wrenches = state['_stepper']
        vars(self).update(state, _row=METHODS[state['method']], _changing=RLock())
        self._stepper = self._make_stepper(self.chain, self.form)
        _put_wrenches(self._stepper, wrenches)
        self._stepper.load(*saved, False)
        self._stepper.told = told

    def _resolve_form(self, chain: Chain) -> tuple[str, str]:
        """Form of the equations that is integrated, and why where 'auto' was asked for or there is no other."""
        form = self.form_asked
        resolved = resolve_form(chain, form)
        if self._row.family != 'taylor':
            return resolved, plan_of(chain).why_form if form == 'auto' else ''
        if chain.joint_count > UNROLLED_SERIES:
            return 'recursive', f' (the series of more than {UNROLLED_SERIES} joints is not unrolled)'
        if form == 'auto' and plan_of(chain).model.refined:
            return 'recursive', ' (auto: light links carry a heavy one)'
        if form == 'auto':
            return 'dense', f' (auto: the series of at most {UNROLLED_SERIES} joints is unrolled)'
        return resolved, ''

    @property
    def tick(self) -> int:
        """Ticks done since the start; the last whole one where advance_to has gone on between two ticks."""
        return self._stepper.tick

    @property
    def time(self) -> float:
        """Simulated time, s: tick * step, or where between two ticks advance_to has led."""
        return self._stepper.time

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
            raise self._error(_kernel.OUTCOMES.index('singular'), joint)
        return acceleration

    @property
    def statistics(self) -> dict:
        """Counts since the start: evaluations, steps, rejected steps, events."""
        return dict(zip(('evaluations', 'steps', 'rejected_steps', 'events'), self._counts()))

    @property
    def has_events(self) -> bool:
        """Whether the scene has stops or friction; else take_events() always returns an empty list."""
        return not {'stops', 'friction'}.isdisjoint(plan_of(self.chain).used)

    def take_events(self) -> list[JointEvent]:
        """Return stops touched and left, joints stuck and slipped since the last call; at most 4096 are kept."""
        fresh = self._stepper.take_events()
        if not fresh and not self._untaken:
            return []
        with self._changing:
            untaken, self._untaken = self._untaken, []
        return untaken + [self._joint_event(*event) for event in fresh]

    def _joint_event(self, tick: Any, offset: Any, kind: Any, joint: Any, speed: Any) -> JointEvent:
        return JointEvent(tick, tick * self.step + offset, EVENT_KINDS[kind], self.chain.joint_names[joint], speed)

    @property
    def plan(self) -> str:
        """What this scene needs and what is skipped, the method and form chosen and why, on one line."""
        stiff = f'damping decays at {damping_rate(self.chain):.0f} 1/s'
        why = f' (auto: {stiff if self.method == STIFF else "not stiff"})' if self._asked == 'auto' else ''
        order = self._row.order or f'{taylor_order(self.tolerance)} for tolerance {self.tolerance:g}'
        return (f'{plan_of(self.chain)}; method {self.method}{why}, order {order}, tick {self.step:g} s; '
                f'form {self.form}{self._why_form}')

    def set_state(self, position: ArrayLike, velocity: ArrayLike) -> None:
        """
        Set joint positions and velocities (joints,); time is unchanged, hidden round-off terms are cleared.

        ValueError: bad arrays, a position beyond a stop.
        """
        joint = self._stepper.put_state(position, velocity)
        if joint >= 0:
            raise beyond_stop(self.chain, joint, joint_array('position', position, (self.chain.joint_count,))[joint])

    def replace_chain(self, chain: Chain) -> None:
        """
        Continue with another chain that has the same joints, by a new plan.

        Time, state, hidden round-off terms, the method and the standing joints stay; an adaptive method starts new
        steps. ValueError, and nothing is changed: other joints.
        """
        plan_of(chain)   # which refuses one that cannot be
        if chain.joint_names != self.chain.joint_names:
            raise ValueError(f'chain {chain.name!r} has other joints than {self.chain.name!r}, must have the same')
        fresh = Simulation(chain, self.method, self.step, self.tolerance, self.form_asked)
        self._stepper.wait()
        with self._changing:
            bodies = {body.name for body in chain.bodies}
            _put_wrenches(fresh._stepper, {body: wrench for body, wrench in self.wrenches.items() if body in bodies})
            self._replace_stepper(chain, fresh._stepper, False)
            bare = self._bare_chain(chain, self._own_bodies)
            if bare not in self._bare_chains:
                self._bare_chains += (bare,)

    def _replace_stepper(self, chain: Chain, fresh: Any, with_state: bool) -> None:
        """Replace the present stepper by `fresh`, that of the chain, with its own state or the present one."""
        counts, events = self._stepper.adopt(fresh, with_state)
        self._counted = tuple(map(add, self._counted, counts))
        self._untaken = self._untaken + [self._joint_event(*event) for event in events]
        self.chain = chain
        self.form, self._why_form = self._resolve_form(chain)

    @staticmethod
    def _bare_chain(chain: Chain, own_bodies: int) -> Chain:
        return chain if len(chain.bodies) == own_bodies else altered(chain, bodies=chain.bodies[:own_bodies])

    @property
    def wrenches(self) -> dict[str, Wrench]:
        """The wrenches that act, by body."""
        return {body: Wrench._make(wrench) for body, wrench in self._stepper.wrenches()}

    def set_wrench(self, body: str, force: ArrayLike = (0.0, 0.0), moment: float = 0.0, axes: str = 'body') -> None:
        """
        Apply a force and a moment to a body from now on, in place of the last ones; zero removes them.

        `force` [x, y], N, acts at the body's joint point, in the axes of the 'body', with which it turns, or of the
        'world'; `moment` N m, counter-clockwise (equations.md 6.5). ValueError: no such body, a number that is not
        finite, other axes.
        """
        self._stepper.wait()
        with self._changing:
            self._stepper.set_wrench(body, force, moment, axes)

    @property
    def wrench_effort(self) -> np.ndarray:
        """Joint efforts (joints,), N m or N, that do the same work as the wrenches in this state (equations.md 6.5)."""
        return self._stepper.wrench_effort()

    def clear_wrenches(self) -> None:
        """Remove all wrenches."""
        self._stepper.wait()
        with self._changing:
            self._stepper.clear_wrenches()

    def attach(self, body: str, mass: float, position: ArrayLike = (0.0, 0.0), inertia_com: float = 0.0,
               name: str = 'payload') -> None:
        """
        Weld a payload to a body: from now on it is part of the chain, and a new plan is made.

        `mass` kg, its mass centre at `position` [x, y], m, in the body's frame, `inertia_com` kg m^2 about that. Joint
        velocities stay: the payload starts with its body's velocity. ValueError: no such body, a name that a body has,
        a number that is not finite or too small.
        """
        self.replace_chain(with_payload(self.chain, body, mass, position, inertia_com, name))

    def drop(self, name: str = 'payload') -> None:
        """Remove a payload; joint velocities stay. ValueError: no such payload, or one that carries another."""
        self.replace_chain(without_payload(self.chain, self._own_bodies, name))

    @property
    def payloads(self) -> tuple[str, ...]:
        """Names of the payloads that are attached."""
        return tuple(body.name for body in self.chain.bodies[self._own_bodies:])

    @property
    def own_chain(self) -> Chain:
        """The chain without payloads."""
        return self._bare_chain(self.chain, self._own_bodies)

    def _counts(self) -> tuple:
        with self._changing:
            return tuple(map(add, self._counted, self._stepper.counts))

    def advance(self, ticks: int, effort: Optional[ArrayLike] = None, record: Optional[tuple] = None) -> None:
        """
        Advance `ticks` ticks under `effort`, N m or N: (joints,) is held, (ticks, joints) a row per tick, None is zero.

        `record`: three C-ordered float64 arrays (ticks, joints) that take position, velocity and acted effort of each
        tick. ValueError: bad count, shape or value, before anything moves. SimulationError: singular or not finite; the
        last good state stays.

        Signals, in the main thread, and interrupt() act within some milliseconds. The exception of a signal's handler,
        such as KeyboardInterrupt after Ctrl-C, or Interrupted is raised with the simulation at the last whole tick;
        continuing from there gives the bits of a run that was not interrupted.
        """
        stopped = self._stepper.advance(ticks, effort, record)
        if stopped is not None:
            self._raise_or_warn(*stopped)

    def interrupt(self) -> None:
        """
        End the advance or advance_to under way in another thread, or else the next one, with Interrupted.

        Any thread and any signal handler may call this. The call ends within some milliseconds, at the last whole tick.
        """
        self._stepper.interrupt()

    def _raise_or_warn(self, outcome: int, joint: int) -> None:
        """Raise the error, or give the warning, for which the kernel stopped."""
        self._warn_of_coarse_step()
        why = _kernel.OUTCOMES[outcome]
        if why == 'interrupted':
            raise Interrupted(f'{self.chain.name} was interrupted at tick {self.tick}, t = {self.time:.12g} s')
        if why != 'good':
            raise self._error(outcome, joint)

    def _warn_of_coarse_step(self) -> None:
        """Warn once of a fixed step that is too long."""
        coarse = self._stepper.take_coarse_step()
        if coarse:
            tick, error, joint, summed = coarse
            what = 'the errors of all steps have added up, and the state' if summed else 'it'
            warn(f"step is {self.step!r} s, too long for method '{self.method}': at tick {tick} {what} is off by about "
                 f"{error:.2g} rad or m at joint '{self.chain.joint_names[joint]}' of {self.chain.name}; "
                 'take a shorter step or an adaptive method', RuntimeWarning, stacklevel=4)

    def _error(self, outcome: int, joint: int) -> SimulationError:
        return stop_error(self.chain, self.tick, self.time, outcome, joint, self.position, self.velocity)

    def advance_to(self, time: float, effort: Optional[ArrayLike] = None) -> None:
        """
        Advance to exactly `time` s under `effort` as in advance; an adaptive method may stop between two ticks.

        ValueError: a time that lies back, for a method of fixed step one that is no whole number of steps; effort rows
        for a time between two ticks. SimulationError, and signals and interrupt(), as in advance.
        """
        stopped = self._stepper.advance_to(*self._place_of(time, 'time'), effort)
        if stopped is not None:
            self._raise_or_warn(*stopped)

    def _place_of(self, time: float, name: str) -> tuple[int, Optional[float]]:
        """Tick of a time, and the time itself if it is between that tick and the next; ValueError calls it `name`."""
        try:
            tick, between = whole_ticks(time, self.step, name), None
        except ValueError:
            if not self._row.adaptive or not _is_number(time) or not 0.0 <= time < MOST_TICKS * self.step:
                raise
            tick, between = int(time / self.step), float(time)
        return tick, between

    def checkpoint(self) -> Checkpoint:
        """Return the whole state, hidden round-off terms included: continuing from it gives the same bits."""
        self._stepper.wait()
        with self._changing:
            tick, between, state = self._stepper.save()
            saved = object.__new__(Checkpoint)   # __init__ of a frozen class takes longer than all the rest
            vars(saved).update(tick=tick, state=state, between=between, chain=self.chain, wrenches=self.wrenches,
                               method=self.method, step=self.step, tolerance=self.tolerance, form=self.form,
                               own_bodies=self._own_bodies, format=CHECKPOINT_FORMAT)
            return saved

    def restore(self, saved: Checkpoint) -> None:
        """
        Restore a checkpoint: time, state, effort, wrenches, payloads and parameters are what they were then.

        A simulation with the same method, step, tolerance and form continues with the same bits. With others its method
        starts afresh from that time and state, hidden round-off terms included. ValueError, and nothing is changed: a
        checkpoint of another chain, a damaged one, a time that is no whole number of steps of a fixed-step method.
        """
        chain, own_bodies = self._checked_settings(saved)
        bare = self._bare_chain(chain, own_bodies)
        self._stepper.wait()
        with self._changing:
            if not any(same_but_for_quantities(bare, known) for known in self._bare_chains):
                raise ValueError(f'checkpoint is of the chain {chain.name!r}, must be of {self.chain.name!r}: '
                                 'they differ in more than payloads, gravity, damping and effort limits')
            form, _ = self._resolve_form(chain)
            anew = (saved.method, saved.step, saved.tolerance, saved.form) != (
                self.method, self.step, self.tolerance, form)
            tick, between = saved.tick, saved.between
            if saved.step != self.step or (between is not None and not self._row.adaptive):
                tick, between = self._place_of(saved.time, 'time of the checkpoint')
            if chain == self.chain and saved.wrenches == self.wrenches:
                return self._stepper.load(tick, between, saved.state, anew)
            try:
                fresh = self._make_stepper(chain, form)
                _put_wrenches(fresh, saved.wrenches)
            except (TypeError, ValueError, AttributeError) as error:
                raise ValueError(f'checkpoint is damaged: its wrenches cannot be ({error})') from None
            fresh.load(tick, between, saved.state, anew)
            self._replace_stepper(chain, fresh, True)

    def _checked_settings(self, saved: Checkpoint) -> tuple[Chain, int]:
        """Return chain and `own_bodies`; ValueError: no checkpoint of this version, or a damaged one."""
        if not isinstance(saved, Checkpoint):
            raise ValueError(f'checkpoint is {saved!r:.80}, must be what Simulation.checkpoint returned')
        if saved.format != CHECKPOINT_FORMAT:
            raise ValueError(f'checkpoint has the format {saved.format!r}, must have {CHECKPOINT_FORMAT}')
        if not isinstance(saved.chain, Chain) or not isinstance(saved.wrenches, Mapping):
            raise ValueError('checkpoint is damaged: it lacks its chain or its wrenches')
        if saved.chain.joint_count != self.chain.joint_count:
            raise ValueError(f'checkpoint has {saved.chain.joint_count} joints, must have {self.chain.joint_count}')
        if type(saved.tick) is not int or not 0 <= saved.tick <= MOST_TICKS:
            raise ValueError(f'checkpoint is damaged: its tick is {saved.tick!r}')
        if type(saved.step) is not float or not 0.0 < saved.step < np.inf:
            raise ValueError(f'checkpoint is damaged: its step is {saved.step!r}')
        if saved.between is not None and not (
                type(saved.between) is float
                and saved.tick * saved.step <= saved.between <= (saved.tick + 1) * saved.step):
            raise ValueError(f'checkpoint is damaged: its time between two ticks is {saved.between!r}')
        if type(saved.own_bodies) is not int or not 0 < saved.own_bodies <= len(saved.chain.bodies):
            raise ValueError(f'checkpoint is damaged: its chain has {saved.own_bodies!r} bodies that are no payloads')
        return saved.chain, saved.own_bodies


def _put_wrenches(stepper: Any, wrenches: Mapping[str, Wrench]) -> None:
    for body, (force, moment, axes) in wrenches.items():
        stepper.set_wrench(body, (force.real, force.imag), moment, axes)


def _is_number(given: Any) -> bool:
    """Whether it is one real number; time spans, which NumPy takes for integers, are not."""
    return isinstance(given, (int, float, np.integer, np.floating)) and not isinstance(given, np.timedelta64)


def whole_ticks(duration: float, step: float, name: str = 'duration') -> int:
    """`duration` / `step` where that is a whole number >= 0 up to rounding, else ValueError that calls it `name`."""
    if type(duration) is float and isfinite(duration):
        ratio, spacing = duration / step, ulp(duration)
    else:   # another kind of number, perhaps of fewer digits, or none
        number = _is_number(duration) and abs(duration) < 1e308
        ratio, spacing = (float(duration) / step, np.spacing(abs(duration))) if number else (-1.0, 0.0)
    # What overflows in steps is no whole number of them either.
    ticks = round(ratio) if isfinite(ratio) else -1
    if ticks < 0 or abs(ticks * step - duration) > 1e-9 * step + 4.0 * spacing:
        raise ValueError(f'{name} is {duration!r} s, must be a whole number >= 0 of steps of {step!r} s')
    if ticks > MOST_TICKS:
        raise ValueError(f'{name} is {duration!r} s, must be at most {MOST_TICKS * step!r} s: '
                         f'no more ticks of {step!r} s can be counted')
    return ticks
