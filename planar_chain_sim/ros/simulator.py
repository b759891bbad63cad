"""
The simulation in real time: one thread owns ticks, state and efforts; everybody else asks it.

At the wake-up for tick k+1 the newest commands are latched, the motion from k to k+1 is integrated with them, the state
at k+1 is published and recorded. What decides the motion besides (reset, pause, lost time) is an event with its tick.
"""
from __future__ import annotations

from collections import deque
import json
from operator import itemgetter
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic_ns, sleep, time_ns

from .commands import CommandError, HeldEffort
from .messages import INPUTS
from .pacing import LONGEST_LATENESS, Pacing
from ..dynamics import SimulationError
from ..recording.cdr import encode_string, JointStateLayout
from ..simulation import initial_state

LOOK_PERIOD = 20_000_000  # ns between two looks at who publishes commands and at the log
LONGEST_SLEEP = 50_000_000  # ns; a request or a stop is seen after at most this, whatever the rate
ANSWER_TIMEOUT = 2.0  # s


class Simulator:
    """
    Runs `simulation` (fresh, at its initial state) in a thread of its own between start() and stop().

    `values`: the node's parameters. `publishers`: key of OUTPUTS -> publisher. `inputs`: key of INPUTS -> polled
    subscription. `log`: BackgroundLogWriter or None. `done(error)` is called when the thread cannot go on.
    """

    def __init__(self, simulation, values, publishers, inputs, log, logger, done):
        self._simulation, self._values, self._inputs, self._log = simulation, values, inputs, log
        self._state, self._events = publishers['state'], publishers['events']
        self._state_topic, self._events_topic = self._state.topic_name, self._events.topic_name
        self._input_topics = {key: subscription.topic_name for key, subscription in inputs.items()}
        self._logger, self._done = logger, done
        names = simulation.chain.joint_names
        self._layout = layout = JointStateLayout(names, values['frame_id'])
        # The kernel writes a tick's outcome straight into the message.
        self._outcome = layout.position[None], layout.velocity[None], layout.effort[None]
        self._held = HeldEffort(names)
        self._commanded = False  # whether the held effort is somebody's command
        self._heard = ()  # keys of the inputs that have a publisher
        self._next = ()  # keys of those to be polled next time
        rate = values['rate']
        self._ticks_per_state = round(rate / (values['publish_rate'] or rate))
        self._pacing = Pacing(1.0 / (rate * values['real_time_factor']), time_ns() - monotonic_ns())
        self._paused, self._divergence = values['start_paused'], None
        self._look_due = self._repeat_due = 0
        self._warned = {}
        self._requests, self._stopping = deque(), False
        self._thread = Thread(target=self._run_guarded, name='tick', daemon=True)

    def start(self) -> None:
        """Publish and record the initial state and start ticking."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread after the tick it is at, and wait for it."""
        self._stopping = True
        if self._thread.ident:
            self._thread.join()

    def ask(self, what: str, *arguments) -> tuple[bool, str]:
        """Have 'reset', 'step' or 'pause' (bool) done between two ticks; return success and one sentence."""
        reply = SimpleQueue()
        self._requests.append((getattr(self, f'_{what}'), arguments, reply))
        try:
            return reply.get(timeout=ANSWER_TIMEOUT)
        except Empty:
            return False, f'the simulation has not answered within {ANSWER_TIMEOUT:g} s'

    def _run_guarded(self) -> None:
        try:
            self._run()
        except BaseException as error:
            self._done(error)

    def _run(self) -> None:
        self._pacing.anchor(0, monotonic_ns())
        if self._paused:
            self._event('pause')
        self._lay_out()
        self._show(record=True)
        while not self._stopping:
            while self._requests:
                action, arguments, reply = self._requests.popleft()
                reply.put(action(*arguments))
            now = monotonic_ns()
            if now >= self._look_due:
                self._look_due = now + LOOK_PERIOD
                self._look()
            standing = self._paused or self._divergence
            due = self._repeat_due if standing else self._pacing.due(self._simulation.tick + 1)
            if now < due:
                sleep(min(due - now, LONGEST_SLEEP) * 1e-9)
            elif standing:
                self._repeat_due = now + round(self._pacing.period * self._ticks_per_state)
                self._latch()
                self._show(record=False)
            else:
                if now - due > LONGEST_LATENESS:
                    self._drop_time(now)
                self._latch()
                self._tick()

    def _drop_time(self, now: int) -> None:
        """Give up what is too late to be caught up; the tick that is due is due now."""
        late = self._pacing.drop(self._simulation.tick + 1, now) * 1e-9
        self._event('dropped_time', seconds=late)
        self._warn('late', f'{late:.3f} s late and dropped, the machine cannot keep up')

    def _tick(self) -> bool:
        """Advance one tick and show its state; on a divergence stand at the last good state and return False."""
        try:
            self._simulation.advance(1, self._held.effort, self._outcome)
        except SimulationError as error:
            self._divergence = str(error)
            self._event('divergence', message=str(error), joint=error.joint, time=error.time,
                        position=error.position.tolist(), velocity=error.velocity.tolist())
            self._logger.error(f'{error}; ~/reset goes on from the initial state')
            return False
        self._show(record=True)
        return True

    def _lay_out(self) -> None:
        """Put the simulation's state into the message, where no tick has just done so."""
        layout, simulation = self._layout, self._simulation
        layout.position[:], layout.velocity[:] = simulation.position, simulation.velocity
        layout.effort[:] = simulation.effort

    def _show(self, record: bool) -> None:
        """Publish the laid out state and record it, the same bytes for both."""
        tick = self._simulation.tick
        stamp = self._pacing.stamp(tick)
        self._layout.set_stamp(stamp)
        data = self._layout.to_bytes()
        if record and self._log:
            self._log.write(self._state_topic, data, self._pacing.wall(monotonic_ns()), stamp, tick)
        if not (record and tick % self._ticks_per_state):
            self._state.publish(data)

    def _event(self, kind: str, **data) -> None:
        self._tell(kind, json.dumps(data))

    def _tell(self, kind: str, data: str) -> None:
        """Publish an event, its data in JSON, and record it."""
        message = encode_string(f'{{"tick": {self._simulation.tick}, "kind": "{kind}", "data": {data}}}')
        self._events.publish(message)
        if self._log:
            now = self._pacing.wall(monotonic_ns())
            self._log.write(self._events_topic, message, now, now)

    def _latch(self) -> None:
        """Take the commands that have come, oldest first, so that the newest acts on each joint."""
        keys = self._next
        if not keys:  # and nothing more: Python that runs after a sleep takes three times as long as in a loop
            return
        self._next = self._heard
        arrived = []
        for key in keys:
            subscription = self._inputs[key]
            with (handle := subscription.handle):
                for _ in range(INPUTS[key].depth):  # not until it is empty: a flood could keep us here
                    taken = handle.take_message(subscription.msg_type, True)
                    if taken is None:
                        break
                    arrived.append((taken[1]['received_timestamp'], key, taken[0], taken[1]['source_timestamp']))
        if not arrived:
            return
        # Each topic keeps its own order; between the two, the time at which the middleware received a message decides.
        if len(keys) > 1:
            arrived.sort(key=itemgetter(0))
        acting, rejected = None, {}
        for _, key, data, source_time in arrived:
            topic = self._input_topics[key]
            if self._log:
                self._log.write(topic, data, self._pacing.wall(monotonic_ns()), source_time)
            try:
                acting = topic if self._held.take(INPUTS[key].type_name, data) else acting
            except CommandError as error:
                rejected.setdefault(topic, []).append(str(error))
            if self._held.unknown:
                self._warn('unknown', f'command on {topic} names {", ".join(map(repr, self._held.unknown[:3]))}, '
                           f'not among the joints {", ".join(self._simulation.chain.joint_names[:32])}')
        for topic, reasons in rejected.items():
            self._event('rejected', topic=topic, reason=reasons[-1], count=len(reasons))
            self._warn(topic, f'command on {topic} rejected: {reasons[-1]}')
        if acting:
            self._commanded = True
            # Up to once a tick, so written by hand: json.dumps takes as long as the whole motion. Floats are the same.
            self._tell('command', f'{{"topic": "{acting}", "effort": {self._held.effort.tolist()}}}')

    def _look(self) -> None:
        """Look at what needs no look at every tick: is there still a controller, is there still a log."""
        if self._log and self._log.error:
            raise self._log.error
        self._heard = tuple(key for key, subscription in self._inputs.items() if subscription.get_publisher_count())
        self._next = tuple(INPUTS)  # also hear who came and went between two looks
        if self._commanded and not self._heard and self._values['on_controller_loss'] == 'zero':
            self._latch()  # its last words
            self._held.clear()
            self._commanded = False
            self._event('controller_loss', effort=self._held.effort.tolist())
            self._logger.warning('the last publisher of commands has gone, efforts are zero now')

    def _warn(self, key: str, sentence: str) -> None:
        """Log a warning, at most once a second for each key."""
        now = monotonic_ns()
        if now >= self._warned.get(key, 0):
            self._warned[key] = now + 1_000_000_000
            self._logger.warning(sentence)

    def _reset(self) -> tuple[bool, str]:
        self._simulation.set_state(*initial_state(self._simulation.chain))
        self._held.clear()
        self._commanded = False
        if self._divergence and not self._paused:
            self._pacing.anchor(self._simulation.tick, monotonic_ns())
        self._divergence = None
        self._event('reset')
        self._lay_out()
        self._show(record=True)
        return True, f'initial state and zero efforts from tick {self._simulation.tick} on'

    def _step(self) -> tuple[bool, str]:
        if self._divergence:
            return False, f'not stepped: {self._divergence}'
        if not self._paused:
            return False, 'not stepped: the simulation is running, pause it first'
        self._look()
        self._latch()
        self._event('step')
        if not self._tick():
            return False, self._divergence
        return True, f'stepped to tick {self._simulation.tick}'

    def _pause(self, wanted: bool) -> tuple[bool, str]:
        if wanted == self._paused:
            return True, f'already {"paused" if wanted else "running"} at tick {self._simulation.tick}'
        self._paused = wanted
        if not wanted:
            self._pacing.anchor(self._simulation.tick, monotonic_ns())
        self._event('pause' if wanted else 'resume')
        return True, f'{"paused" if wanted else "running"} from tick {self._simulation.tick} on'
