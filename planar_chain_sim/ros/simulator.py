"""
The simulation in real time: one thread owns ticks, state and efforts; everybody else asks it.

At the wake-up for tick k+1 the newest commands are latched, the motion from k to k+1 is integrated with them, the state
at k+1 is published and recorded. What decides the motion besides (reset, a changed parameter, lost time) is an event
with its tick.
"""
from __future__ import annotations

from collections import deque
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic_ns, sleep, time_ns
from typing import Any

from .command_intake import CommandIntake
from .measurement import Meter
from .pacing import LONGEST_LATENESS, Pacing, wake_punctually
from .publication import Publication
from ..chain.quantities import QUANTITIES, to_json
from ..errors import ChainError, SimulationError
from ..motion.simulation import Interrupted
from ..recording.events import apply_event, encode_command, encode_joint_event, end_event

LOOK_PERIOD = 20_000_000  # ns between two looks at who publishes commands and at the log
LONGEST_SLEEP = 10_000_000  # ns; a request or a stop is seen after at most this, whatever the rate
LONGEST_BACKLOG = 20_000  # messages; as fast as possible is no faster than the disk
ANSWER_TIMEOUT = 2.0  # s
MEASURE_TIMEOUT = 0.5  # s: services must not wait behind diagnostics
WITHDRAWN = ('set_parameters', 'measure', 'ignore')   # of no use to who has given up: a parameter reads as it was
LONGEST_SILENCE = 1_000_000_000   # ns between two states while time stands, for those who come late
STEP_SLICE = 20_000_000  # ns of steps between two looks at what else is asked
ENDING = 'the simulation is ending'


def payload_of(values, simulation) -> dict:
    """Return the change 'payload' that the node's parameters ask for; its name is none of a body of the chain."""
    bodies, name = {body.name for body in simulation.chain.bodies}.difference(simulation.payloads), 'payload'
    while name in bodies:
        name += '_'
    return {'name': name, 'body': values['payload_body'], 'mass': values['payload_mass'],
            'position': values['payload_position'], 'inertia_com': 0.0}


class Request:
    """A request to the tick thread and the queue for its answer; `late`: the caller no longer waits."""

    def __init__(self, what: str, arguments: tuple):
        self.what, self.arguments, self.reply, self.late = what, arguments, SimpleQueue(), False


class Simulator:
    """
    Runs `simulation` (fresh, at its initial state) in a thread of its own between start() and stop().

    `values`: the node's parameters; those that differ from the chain's own were put into it already and are told at
    tick 0. `publishers`: key of OUTPUTS -> publisher. `inputs`: key of INPUTS -> polled subscription. `context`: of
    rclpy. `log`: BackgroundLogWriter or None. `done(error)` is called when the thread cannot go on. hold_ups: HoldUps,
    by which all who publish in this process do so.
    """

    def __init__(self, simulation, values, publishers, inputs, context, log, logger, done):
        self._simulation, self._values, self._log, self._logger = simulation, values, log, logger
        self._done, self._warned = done, {}
        step = simulation.step if values['publish_clock'] or values['lockstep'] else None
        self._pacing = Pacing(self._period(), time_ns() - monotonic_ns(), step)
        self._publication = Publication(simulation, values, publishers, log, self._pacing)
        self.hold_ups = self._publication.hold_ups
        self._made_up = self._told_of = 0  # ns of the hold-ups: of those caught up with; of the others, told of
        self._intake = CommandIntake(simulation.chain, values['commanded_joints'], inputs, context, self._publication,
                                     self._warn)
        self._held = self._intake.held
        self._wrenches = {}  # body -> the change 'wrench' that made what acts on it
        self._meter = Meter(simulation, self._publication.layout)
        self._has_joint_events = simulation.has_events
        self._paused, self._end = values['start_paused'], None
        self._look_due = self._repeat_due = self._latch_due = 0
        self._requests, self._stopping, self._log_trouble = deque(), False, ''
        self._begun = monotonic_ns()  # when the newest tick began
        self.overruled = 0   # how often somebody has paused, resumed or reset: who steps on gives way
        self._thread = Thread(target=self._run_guarded, name='tick', daemon=True)

    def start(self) -> None:
        """Publish and record the initial state and start ticking."""
        self._thread.start()

    def halt(self) -> None:
        """Let the thread end, within some milliseconds and at a whole tick, and answer no more."""
        self._stopping = True
        self._simulation.interrupt()
        self._intake.wake()

    def stop(self) -> None:
        """End the thread as halt() does, and wait for it."""
        self.halt()
        if self._thread.ident:
            self._intake.wake()
            self._thread.join()
        self._intake.close()

    def ask(self, what: str, *arguments):
        """
        Have something done between two ticks and return its answer, (success, sentence).

        'ignore' (topic, reason, sentence), of what has no effect; 'reset'; 'step'; 'step_on' (at most so many ticks,
        `overruled` when that was asked for first), whose sentence is the number of ticks done; 'pause' (bool, and
        whether to reset too); 'set_parameters' ({name: value}), all or none; 'measure', whose sentence is a
        Measurement. Where a tick takes longer than ANSWER_TIMEOUT (MEASURE_TIMEOUT for 'measure') the answer is
        (False, so), and what was asked for is done after it and told in the log; of WITHDRAWN nothing is done then.
        """
        request = Request(what, arguments)
        self._requests.append(request)
        self._intake.wake()
        until = monotonic_ns() + round((MEASURE_TIMEOUT if what == 'measure' else ANSWER_TIMEOUT) * 1e9)
        while not self._stopping:
            try:
                return request.reply.get(timeout=0.05)
            except Empty:
                if monotonic_ns() < until or request.late:
                    continue
            if what not in WITHDRAWN:
                return self._leave(request)
            try:
                self._requests.remove(request)
                if what == 'measure':
                    return False, f'a tick is under way for {(monotonic_ns() - self._begun) * 1e-9:.1f} s'
                return False, f'not done: the simulation is in a tick that takes longer than {ANSWER_TIMEOUT:g} s'
            except ValueError:
                request.late = True   # it is being done, and that takes no tick
        return False, ENDING

    @staticmethod
    def _leave(request: Request):
        """Stop waiting for an answer; the log will have it."""
        request.late = True
        try:
            return request.reply.get_nowait()
        except Empty:
            return False, (f'still under way after {ANSWER_TIMEOUT:g} s, as a tick takes long; the result follows '
                           'in the log and on ~/events')

    @property
    def paused(self) -> bool:
        """Whether time stands because somebody wants it to."""
        return self._paused

    @property
    def tick(self) -> int:
        """Ticks done since the start."""
        return self._simulation.tick

    @property
    def seen(self) -> tuple[int, Any]:
        """Stamp, ns, and joint positions (joints,), rad or m, of the state last shown, for those who only look."""
        return self._publication.stamp, self._publication.layout.position.copy()

    def _period(self) -> float:
        """Seconds of wall time per tick, 0 for as fast as possible."""
        factor = self._values['real_time_factor']
        return 1.0 / (self._values['rate'] * factor) if factor else 0.0

    def _run_guarded(self) -> None:
        try:
            wake_punctually()
            self._run()
        except Interrupted:
            pass   # by halt()
        except BaseException as error:
            self._done(error)

    def _run(self) -> None:
        self._pacing.anchor(0, monotonic_ns())
        for name in QUANTITIES:
            if name in self._values:
                self._publication.publish_event('parameter', name=name, value=to_json(self._values[name]))
        if self._values['payload_mass']:
            self._publication.publish_event('payload', **payload_of(self._values, self._simulation),
                                            plan=self._simulation.plan)
        if self._paused:
            self._publication.publish_event('pause')
        self._publication.copy_state_into_message()
        self._show(record=True)
        while not self._stopping:
            self._answer_requests()
            now = monotonic_ns()
            if now >= self._look_due:
                self._look_due = now + LOOK_PERIOD
                self._look()
            if self._paused or self._end:
                self._stand(now)
            else:
                self._go_on(now)

    def _answer_requests(self) -> None:
        while self._requests:
            try:
                request = self._requests.popleft()
            except IndexError:   # withdrawn
                return
            answer = getattr(self, f'_{request.what}')(*request.arguments)
            request.reply.put(answer)
            if request.late and request.what not in WITHDRAWN:
                done = f'{answer[1]} ticks' if request.what == 'step_on' and answer[0] else answer[1]
                self._logger.info(f'late answer to {request.what}: {done}')

    def _stand(self, now: int) -> None:
        """Show the state that stands, again and again, and take commands for when it goes on."""
        if now < self._repeat_due:
            sleep(min(self._repeat_due - now, LONGEST_SLEEP) * 1e-9)
            return
        self._latch()
        for topic in self._intake.fresh if self._end else ():
            self._intake.ignore(topic, 'motion ended', f'a message on {topic} has no effect, as the motion has ended '
                                f'({self._end}); ~/reset goes on from the initial state')
        self._intake.fresh.clear()
        period = round(1e9 * self._simulation.step * self._publication.ticks_per_state)   # of the wall, at any pace
        self._repeat_due = now + min(period, LONGEST_SILENCE)
        self._show(record=False)

    def _go_on(self, now: int) -> None:
        """Wait for the next tick's due time, or make the tick."""
        pacing, tick = self._pacing, self._simulation.tick + 1
        if not pacing.period:
            if self._log and self._log.backlog > LONGEST_BACKLOG:
                sleep(1e-3)
                return
            pacing.anchor(tick, now)
        due = pacing.due(tick)
        if now < due:
            if due - now > LONGEST_SLEEP and now >= self._latch_due:
                self._latch_due = now + LOOK_PERIOD
                self._latch()  # so that a command is told of before its tick comes, which may be in hours
                self._publication.publish_events()
            sleep(min(due - now, LONGEST_SLEEP) * 1e-9)
            now = monotonic_ns()
            if now < due or self._requests:
                return
        late = now - due
        self._meter.late(late, pacing.period)
        if late > LONGEST_LATENESS:
            self._judge_lateness(now, late)
        elif late < pacing.period and self.hold_ups.any_since(self._made_up):
            self._made_up, self._told_of = self.hold_ups.total, 0
        self._latch()
        self._tick()

    def _judge_lateness(self, now: int, late: int) -> None:
        """Catch up with lateness that the middleware has caused, however long; drop any other."""
        held_up = self.hold_ups.total - self._made_up
        if held_up > self._told_of:
            self._publication.publish_event('held_up', seconds=(held_up - self._told_of) * 1e-9)
            self._warn('held up', f'the middleware held up publishing for {held_up * 1e-9:.3f} s, as happens when '
                       'others join; the node catches up with that, unless more lateness comes on top')
        self._told_of = held_up
        if late > LONGEST_LATENESS + held_up:
            self._drop_time(now)

    def _drop_time(self, now: int) -> None:
        """Give up what is too late to be caught up; the tick that is due is due now."""
        late = self._pacing.drop(self._simulation.tick + 1, now) * 1e-9
        self._meter.dropped(late)
        self._publication.publish_event('dropped_time', seconds=late)
        self._warn('late', f'{late:.3f} s late and dropped, the machine cannot keep up')

    def _tick(self, publish: bool = False) -> bool:
        """Advance one tick and show its state; where the motion ends stand at the last good state and return False."""
        publication, simulation = self._publication, self._simulation
        self._begun = monotonic_ns()
        try:
            simulation.advance(1, self._held.effort, publication.outcome)
        except SimulationError as error:
            self._tell_joint_events()
            self._end = error
            self._intake.fresh.clear()   # that came before
            kind, data = end_event(error)
            publication.publish_event(kind, **data)
            self._logger.error(f'{error}; ~/reset goes on from the initial state')
            return False
        if self._has_joint_events:
            self._tell_joint_events()
        self._show(record=True, publish=publish or not simulation.tick % publication.ticks_per_state)
        self._meter.balance.add(publication.message)
        return True

    def _tell_joint_events(self) -> None:
        """Tell of stops and of sticking, each at its time behind the tick before this one."""
        for event in self._simulation.take_events():
            self._publication.record_event(encode_joint_event(event))

    def _show(self, record: bool, publish: bool = True) -> None:
        self._publication.publish_state(record, publish)

    def _latch(self) -> None:
        """Take the commands that have come, let joints that were commanded too long ago go, and tell of both."""
        tick, timeout = self._simulation.tick, self._values['command_timeout']
        topic = self._intake.latch(tick)
        if topic:
            self._tell_command(topic)
        if self._intake.wrenches:
            self._push()
        if timeout and self._held.commanded:
            silent = self._held.expire(tick, timeout / self._simulation.step * (1.0 - 1e-12))
            if silent:
                names = [self._simulation.chain.joint_names[joint] for joint in silent]
                self._publication.publish_event('command_timeout', joints=names, seconds=timeout,
                                                effort=self._held.effort.tolist())
                self._warn('timeout', f'no command for {", ".join(names[:32])} within {timeout:g} s, '
                           'effort is zero now')

    def _push(self) -> None:
        """Let the wrenches that have come act from now on, and tell of each that differs from the one before."""
        wrenches = self._intake.wrenches
        while wrenches:
            body, wrench = wrenches.popitem()
            if wrench != self._wrenches.get(body, dict(wrench, force=[0.0, 0.0], moment=0.0)):
                self._wrenches[body] = wrench
                apply_event(self._simulation, 'wrench', wrench)
                self._meter.balance.push(body, wrench['force'], wrench['moment'])
                self._publication.publish_event('wrench', **wrench)

    def _tell_command(self, topic: str) -> None:
        """Tell the efforts that act from now on, which a command on `topic` has changed."""
        self._publication.record_event(encode_command(self._simulation.tick, topic, self._held.effort))

    def _look(self) -> None:
        """Look at what needs no look at every tick: is there still a controller, is there still a log."""
        if self._log:
            self._look_at_log()
        begun = monotonic_ns()
        self._intake.look()
        self.hold_ups.ended(begun)
        if self._held.commanded and not self._intake.commanded and self._values['on_controller_loss'] == 'zero':
            self._latch()  # its last words
            self._clear_commands()
            self._publication.publish_event('controller_loss', effort=self._held.effort.tolist())
            self._logger.warning('the last publisher of commands has gone, efforts are zero now')

    def _look_at_log(self) -> None:
        """Report a fault of the log, once; LogError if it must end the node."""
        trouble = self._log.trouble
        if trouble != self._log_trouble:
            self._log_trouble = trouble
            if trouble:
                self._publication.publish_event('log_failure', message=trouble)
                self._logger.error(trouble)
        if self._log.error and self._values['on_log_failure'] == 'stop':
            raise self._log.error

    def _clear_commands(self) -> None:
        self._held.clear()

    def _warn(self, key, sentence: str) -> bool:
        """Log a warning, at most once a second for each key; return whether it was."""
        now = monotonic_ns()
        if now < self._warned.get(key, 0):
            return False
        self._warned[key] = now + 1_000_000_000
        self._logger.warning(sentence)
        return True

    def _ignore(self, topic: str, reason: str, sentence: str) -> tuple[bool, str]:
        self._intake.ignore(topic, reason, sentence)
        return True, sentence

    def _reset(self) -> tuple[bool, str]:
        self.overruled += 1
        apply_event(self._simulation, 'reset', {})
        self._clear_commands()
        self._wrenches.clear()
        self._meter.balance.release()
        if self._end and not self._paused:
            self._pacing.anchor(self._simulation.tick, monotonic_ns())
        self._end = None
        self._publication.publish_event('reset')
        self._publication.copy_state_into_message()
        self._meter.begin(self._simulation)
        self._show(record=True)
        return True, f'initial state and zero efforts from tick {self._simulation.tick} on'

    def _step(self) -> tuple[bool, str]:
        done, sentence = self._step_on(1, self.overruled)
        return done, f'stepped to tick {self._simulation.tick}' if done else str(sentence)

    def _step_on(self, ticks: int, overruled: int) -> tuple[bool, object]:
        if self._end:
            return False, f'not stepped: {self._end}'
        if not self._paused:
            return False, 'not stepped: the simulation is running, pause it first'
        if overruled != self.overruled:
            return False, 'stepped no further: ~/pause or ~/reset came between'
        self._look()
        done, until = 0, monotonic_ns() + STEP_SLICE
        while done < ticks and (not done or monotonic_ns() < until) and not self._stopping:
            self._latch()
            self._publication.publish_event('step')
            if not self._tick(publish=True):
                return False, str(self._end)
            done += 1
        return True, done

    def _pause(self, wanted: bool, reset: bool = False) -> tuple[bool, str]:
        self.overruled += 1
        state, tick = 'paused' if wanted else 'running', self._simulation.tick
        sentence = f'already {state} at tick {tick}'
        if wanted != self._paused:
            self._paused, sentence = wanted, f'{state} from tick {tick} on'
            if not wanted:
                self._pacing.anchor(tick, monotonic_ns())
            self._publication.publish_event('pause' if wanted else 'resume')
        if reset:
            self._reset()
        return True, sentence

    def _set_parameters(self, values: dict) -> tuple[bool, str]:
        """Let all values act from this tick on, or none of them where one cannot be."""
        simulation, changes = self._simulation, []
        moving = [name for name in values if name in QUANTITIES or name == 'payload_mass']
        before = simulation.checkpoint() if moving else None
        for name, value in values.items():
            kind, data = 'parameter', {'name': name, 'value': to_json(value) if name in QUANTITIES else value}
            if name == 'payload_mass':
                kind, data = 'payload', payload_of({**self._values, name: value}, simulation)
            try:
                apply_event(simulation, kind, data)
            except ChainError as error:
                if moving:
                    simulation.restore(before)
                return False, f'parameter {name!r}: {error}'
            changes.append((kind, data))
        self._values.update(values)
        if moving:
            self._meter.begin(simulation)
        if 'real_time_factor' in values:
            self._pacing.set_period(self._period(), simulation.tick, monotonic_ns())
        for kind, data in changes:
            if kind == 'payload':
                data['plan'] = simulation.plan   # made anew
            self._publication.publish_event(kind, **data)
        return True, f'{", ".join(values)}: from tick {simulation.tick} on'

    def _measure(self) -> tuple:
        return True, self._meter.measure(self._simulation.tick, self._intake, self._end, self._paused,
                                         self.hold_ups.total, self._waiting_for())

    def _waiting_for(self) -> tuple:
        """Return the names of the joints whose commands the next tick waits for, and since when, s."""
        return (), 0.0
