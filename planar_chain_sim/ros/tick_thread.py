"""
The simulation in real time: one thread owns ticks, state and efforts.

When tick k+1 is due, this thread takes the newest commands, integrates the motion from k to k+1 with them, and
publishes and records the state at k+1. Everything else that changes the motion (a reset, a changed parameter) is an
event with its tick.
"""
from __future__ import annotations

from threading import Thread
from time import monotonic_ns, sleep, time_ns
from typing import Any

from .command_intake import CommandIntake
from .commands import CommandError
from .measurement import Meter
from .pacing import LONGEST_LATENESS, Pacing, wake_punctually
from .publication import Publication
from .requests import Requests
from ..chain.quantities import QUANTITIES, to_json
from ..errors import LogError, SimulationError
from ..motion.simulation import Interrupted
from ..recording.events import apply_event, encode_command, encode_joint_event, end_event, EVENTS

CHECK_PERIOD = 20_000_000  # ns between two checks of who publishes commands, and of the log
LONGEST_SLEEP = 10_000_000  # ns; a request or a stop is noticed after at most this, whatever the rate
LONGEST_BACKLOG = 20_000  # messages; with more, a run as fast as possible waits for the disk
LONGEST_SILENCE = 1_000_000_000   # ns between two states while time stands still, for new subscribers


def payload_of(values, simulation) -> dict:
    """Return the data of the event 'payload' for the node's parameters, under a name that no body of the chain has."""
    bodies, name = {body.name for body in simulation.chain.bodies}.difference(simulation.payloads), 'payload'
    while name in bodies:
        name += '_'
    return {'name': name, 'body': values['payload_body'], 'mass': values['payload_mass'],
            'position': values['payload_position'], 'inertia_com': 0.0}


class TickThread:
    """
    Runs `simulation` (fresh, at its initial state) in a thread of its own between start() and stop().

    `values`: the node's parameters; the chain has them already, and they are published as events of tick 0.
    `publishers`: key of OUTPUTS -> publisher. `inputs`: key of INPUTS -> polled subscription. `context`: of rclpy.
    `log`: BackgroundLogWriter or None; `frames`: RecordedFrames for it or None. `done(error)` is called when the thread
    cannot go on. hold_ups: the HoldUps through which everything in this process publishes. requests: Requests of other
    threads.
    """

    def __init__(self, simulation, values, publishers, inputs, context, log, frames, logger, done):
        self._simulation, self._values, self._log, self._logger = simulation, values, log, logger
        self._done, self._warned = done, {}
        step = simulation.step if values['publish_clock'] or values['lockstep'] else None
        self._pacing = Pacing(self._period(), time_ns() - monotonic_ns(), step)
        self._publication = Publication(simulation, values, publishers, log, frames, self._pacing)
        self.hold_ups = self._publication.hold_ups
        self._caught_up = self._reported = 0  # ns of hold-ups: those already caught up with; those reported since
        self._intake = CommandIntake(simulation.chain, values['commanded_joints'], inputs, context, self._publication,
                                     self._warn)
        self._held = self._intake.held
        self._acting = {}  # (kind, what) of a Change -> its data, the newest that acts
        self._meter = Meter(simulation, self._publication.layout)
        self._has_joint_events = simulation.has_events
        self._paused, self._end = values['start_paused'], None
        self._check_due = self._repeat_due = self._take_due = 0
        self._stopping, self._log_trouble = False, ''
        self.requests = Requests(self._intake.wake)
        self._thread = self.requests.thread = Thread(target=self._run_guarded, name='tick', daemon=True)

    def start(self) -> None:
        """Publish and record the initial state and start ticking."""
        self._thread.start()

    def halt(self) -> None:
        """Make the thread end at a whole tick, within some milliseconds; further requests are refused."""
        self._stopping = True
        self.requests.end()
        self._simulation.interrupt()
        self._intake.wake()

    def stop(self) -> None:
        """Call halt() and wait until the thread has ended."""
        self.halt()
        if self._thread.ident:
            self._intake.wake()
            self._thread.join()
        self._intake.close()

    @property
    def paused(self) -> bool:
        """Whether the simulation is paused."""
        return self._paused

    @property
    def tick(self) -> int:
        """Ticks done since the start."""
        return self._simulation.tick

    @property
    def published_state(self) -> tuple[int, Any]:
        """Stamp, ns, and joint positions (joints,), rad or m, of the state published or recorded last."""
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
            pass   # halt() was called
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
        self._publish_state(record=True)
        while not self._stopping:
            if self.requests:
                self.requests.answer(self._logger.info)
            now = monotonic_ns()
            if now >= self._check_due:
                self._check_due = now + CHECK_PERIOD
                self._check_log()
                self._check_publishers()
            if self._paused or self._end:
                self._repeat_state(now)
            else:
                self._wait_or_tick(now)

    def _repeat_state(self, now: int) -> None:
        """Publish the unchanged state when it is due again, and take commands that will act when time goes on."""
        if now < self._repeat_due:
            sleep(min(self._repeat_due - now, LONGEST_SLEEP) * 1e-9)
            return
        self._take_commands()
        for topic in self._intake.fresh if self._end else ():
            self._intake.ignore(topic, 'motion ended', f'a message on {topic} has no effect, as the motion has ended '
                                f'({self._end}); ~/reset goes on from the initial state')
        self._intake.fresh.clear()
        period = round(1e9 * self._simulation.step * self._publication.ticks_per_state)   # wall time, at any pace
        self._repeat_due = now + min(period, LONGEST_SILENCE)
        self._publish_state(record=False)

    def _wait_or_tick(self, now: int) -> None:
        """Wait for the next tick's due time, or make the tick."""
        pacing, tick = self._pacing, self._simulation.tick + 1
        if not pacing.period:
            if self._log and self._log.backlog > LONGEST_BACKLOG:
                sleep(1e-3)
                return
            pacing.anchor(tick, now)
        due = pacing.due(tick)
        if now < due:
            if due - now > LONGEST_SLEEP and now >= self._take_due:
                self._take_due = now + CHECK_PERIOD
                self._take_commands()  # reports a command before its tick, which may be hours away
                self._publication.publish_events()
            sleep(min(due - now, LONGEST_SLEEP) * 1e-9)
            now = monotonic_ns()
            if now < due or self.requests:
                return
        late = now - due
        self._meter.add_lateness(late, pacing.period)
        if late > LONGEST_LATENESS:
            self._judge_lateness(now, late)
        elif late < pacing.period and self.hold_ups.any_since(self._caught_up):
            self._caught_up, self._reported = self.hold_ups.total, 0
        self._take_commands()
        self._tick()

    def _judge_lateness(self, now: int, late: int) -> None:
        """Catch up with lateness that the middleware has caused, however long; drop any other."""
        held_up = self.hold_ups.total - self._caught_up
        if held_up > self._reported:
            self._publication.publish_event('held_up', seconds=(held_up - self._reported) * 1e-9)
            self._warn('held up', f'the middleware held up publishing for {held_up * 1e-9:.3f} s, as happens when '
                       'a subscriber joins; the node catches up with that, unless other delays are added')
        self._reported = held_up
        if late > LONGEST_LATENESS + held_up:
            self._drop_time(now)

    def _drop_time(self, now: int) -> None:
        """Drop the time by which the next tick is late: it becomes due now."""
        late = self._pacing.drop(self._simulation.tick + 1, now) * 1e-9
        self._meter.add_dropped(late)
        self._publication.publish_event('dropped_time', seconds=late)
        self._warn('late', f'{late:.3f} s late and dropped, the machine cannot keep up')

    def _tick(self, publish: bool = False) -> bool:
        """Advance one tick and publish its state; return False if the motion ends, at the last good state."""
        publication, simulation = self._publication, self._simulation
        self.requests.in_tick_since = monotonic_ns()
        try:
            simulation.advance(1, self._held.effort, publication.outcome)
        except SimulationError as error:
            self.requests.in_tick_since = None
            self._record_joint_events()
            self._end = error
            self._intake.fresh.clear()   # they came before the end
            kind, data = end_event(error)
            publication.publish_event(kind, **data)
            self._logger.error(f'{error}; ~/reset goes on from the initial state')
            return False
        self.requests.in_tick_since = None
        if self._has_joint_events:
            self._record_joint_events()
        self._publish_state(record=True, publish=publish or not simulation.tick % publication.ticks_per_state)
        self._meter.balance.add(publication.message)
        return True

    def _record_joint_events(self) -> None:
        """Record the events of stops and friction during the tick just made."""
        for event in self._simulation.take_events():
            self._publication.record_event(encode_joint_event(event))

    def _publish_state(self, record: bool, publish: bool = True) -> None:
        self._publication.publish_state(record, publish)

    def _take_commands(self) -> None:
        """Take the commands that have come, and set efforts that have timed out to zero; record both."""
        tick, timeout = self._simulation.tick, self._values['command_timeout']
        topic = self._intake.take_commands(tick)
        if topic:
            self._record_command(topic)
        if self._intake.changes:
            self._apply_changes()
        if timeout and self._held.commanded:
            silent = self._held.expire(tick, timeout / self._simulation.step * (1.0 - 1e-12))
            if silent:
                names = [self._simulation.chain.joint_names[joint] for joint in silent]
                self._publication.publish_event('command_timeout', joints=names, seconds=timeout,
                                                effort=self._held.effort.tolist())
                self._warn('timeout', f'no command for {", ".join(names[:32])} within {timeout:g} s, '
                           'effort is zero now')

    def _apply_changes(self) -> None:
        """Apply the changes that have come, and publish an event for each that does not act already."""
        changes, simulation = self._intake.changes, self._simulation
        while changes:
            place, (key, data) = changes.popitem()
            kind, row = place[0], EVENTS[place[0]]
            if row.idle is not None:
                acting = self._acting.get(place)
                if data == ({**data, **row.idle} if acting is None else acting):
                    continue
            try:
                apply_event(simulation, kind, data)
            except ValueError as error:
                self._intake.reject(key, [CommandError('impossible', str(error))])
                continue
            self._acting[place] = data
            self._meter.change(simulation, kind, data)
            if 'plan' in row.keys:
                data = {**data, 'plan': simulation.plan}
            self._publication.publish_event(kind, **data)

    def _record_command(self, topic: str) -> None:
        """Record the efforts that act from now on; a command on `topic` has changed them."""
        self._publication.record_event(encode_command(self._simulation.tick, topic, self._held.effort))

    def _check_publishers(self) -> None:
        """Check whether commands still have a publisher; this takes too long for every tick."""
        begun = monotonic_ns()
        self._intake.check_publishers()
        self.hold_ups.ended(begun)
        if self._held.commanded and not self._intake.commanded and self._values['on_controller_loss'] == 'zero':
            self._take_commands()  # those sent before the publisher left
            self._clear_commands()
            self._publication.publish_event('controller_loss', effort=self._held.effort.tolist())
            self._logger.warning('the last publisher of commands has gone, efforts are zero now')

    def _check_log(self) -> None:
        """Report a fault of the log, once; LogError if it must end the node."""
        if not self._log:
            return
        trouble = self._log.trouble
        if trouble != self._log_trouble:
            self._log_trouble = trouble
            if trouble:
                self._publication.publish_event('log_failure', message=trouble)
                self._logger.error(trouble)
        if self._log.lost and self._values['on_log_failure'] == 'stop':
            raise LogError(trouble)

    def _clear_commands(self) -> None:
        self._held.clear()

    def _warn(self, key, sentence: str) -> bool:
        """Log a warning, at most once a second for each key; return whether it was logged."""
        now = monotonic_ns()
        if now < self._warned.get(key, 0):
            return False
        self._warned[key] = now + 1_000_000_000
        self._logger.warning(sentence)
        return True
