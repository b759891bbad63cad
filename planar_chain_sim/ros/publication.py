"""What the tick thread publishes and records: states, clock and events, the same bytes for both."""
from __future__ import annotations

from threading import get_ident
from time import monotonic_ns

from ..recording.cdr import ClockLayout, JointStateLayout
from ..recording.events import encode_event

SHORTEST_HOLD_UP = 20_000_000  # ns; a call of the middleware that takes longer counts as a hold-up


class HoldUps:
    """
    How long the middleware has blocked its callers: `total`, ns, over all calls longer than SHORTEST_HOLD_UP.

    When a subscriber joins, Fast DDS checks its shared memory and may sleep for a third of a second while publishers
    wait (its issue 6535). rclpy holds the interpreter lock meanwhile, so all threads wait.
    """

    def __init__(self):
        self._ended, self._under_way = 0, {}  # ns; identity of a thread -> when its call began

    @property
    def total(self) -> int:
        """Return the time, ns, of all such calls, with those that may have ended without their thread knowing yet."""
        now = monotonic_ns()
        waiting = (now - begun for begun in tuple(self._under_way.values()))
        return self._ended + sum(time for time in waiting if time > SHORTEST_HOLD_UP)

    def any_since(self, total: int) -> bool:
        """Tell whether a call has ended since `total` was that."""
        return self._ended != total

    def during(self, function, *arguments):
        """Return what a function of the middleware returns, called here; from any thread."""
        thread, begun = get_ident(), monotonic_ns()
        self._under_way[thread] = begun
        try:
            return function(*arguments)
        finally:
            self.ended(begun)
            del self._under_way[thread]

    def ended(self, begun: int) -> None:
        """Take a call that began at this time, ns, and has just ended."""
        held = monotonic_ns() - begun
        if held > SHORTEST_HOLD_UP:
            self._ended += held


class Publication:
    """
    Publishes for `simulation`, stamped by `pacing`.

    `values`: the node's parameters. `publishers`: key of OUTPUTS -> publisher. `log`: BackgroundLogWriter or None.
    `outcome`: rows for Simulation.advance, so that the kernel writes a tick's outcome straight into the message.
    `stamp`: ns, and `message`: bytes, of the state last published or recorded. hold_ups: HoldUps, for all who publish
    here.
    """

    def __init__(self, simulation, values, publishers, log, pacing):
        self._simulation, self._log, self._pacing = simulation, log, pacing
        self._wall_minus_steady = pacing.wall_minus_steady
        self._state_topic, self._events_topic = publishers['state'].topic_name, publishers['events'].topic_name
        # Publishers outlive the thread that publishes; the handles spare it half of what a message takes.
        self._state, self._events = publishers['state'].handle, publishers['events'].handle
        self._clock = publishers.get('clock')
        self.layout = layout = JointStateLayout(simulation.chain.joint_names, values['frame_id'])
        self._clock_layout, self.hold_ups = ClockLayout(), HoldUps()
        self.outcome = layout.position[None], layout.velocity[None], layout.effort[None]
        self.stamp, self.message, self._waiting = 0, b'', []
        self.ticks_per_state = round(values['rate'] / values['publish_rate'])

    def copy_state_into_message(self) -> None:
        """Copy the simulation's state into the message, where no tick has just done so."""
        layout, simulation = self.layout, self._simulation
        layout.position[:], layout.velocity[:] = simulation.position, simulation.velocity
        layout.effort[:] = simulation.effort

    def publish_state(self, record: bool, publish: bool) -> None:
        """Record and publish the state in the message, or one of both."""
        tick = self._simulation.tick
        stamp = self._pacing.stamp(tick)
        self.message = data = self.layout.stamped(stamp)
        now = monotonic_ns()
        if publish:
            if self._clock:
                self._publish_clock(stamp, record)
            self._state.publish_raw(data)
            self.hold_ups.ended(now)
        if record and self._log:   # the others wait, the log does not
            self._log.write(self._state_topic, data, now + self._wall_minus_steady, stamp, tick)
        self.stamp = stamp
        if self._waiting:
            self.publish_events()

    def publish_events(self) -> None:
        """Publish the events that wait: up to one a tick, so where nobody listens nothing is done."""
        if self._events.get_subscription_count():
            for message in self._waiting:
                self.hold_ups.during(self._events.publish_raw, message)
        self._waiting.clear()

    def _publish_clock(self, stamp: int, record: bool) -> None:
        """Publish the time before the state that bears it, so that no listener sees a state from the future."""
        data = self._clock_layout.stamped(stamp)
        self._clock.publish(data)
        if record and self._log:
            self._log.write(self._clock.topic_name, data, monotonic_ns() + self._wall_minus_steady, stamp)

    def publish_event(self, kind: str, **data) -> None:
        """Record an event of the present tick, a row of EVENTS, and publish it."""
        self.record_event(encode_event(self._simulation.tick, kind, data))
        self.publish_events()

    def record_event(self, message: bytes) -> None:
        """Record an encoded event, and publish it when the next state is out, which must not wait."""
        self._waiting.append(message)
        if self._log:
            now = monotonic_ns() + self._wall_minus_steady
            self._log.write(self._events_topic, message, now, now)

    def record_command(self, topic: str, data: bytes, source_time: int) -> None:
        """Record a command as it came; a sender whose clock is before 1970 or, as DDS counts, past 2038 has no time."""
        if self._log:
            now = monotonic_ns() + self._wall_minus_steady
            self._log.write(topic, data, now, source_time if source_time >= 0 else now)

    def has_listeners(self) -> bool:
        """Tell whether anybody listens to the states."""
        return self._state.get_subscription_count() > 0
