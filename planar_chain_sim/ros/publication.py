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
        """Time, ns, of all such calls, including those still under way."""
        now = monotonic_ns()
        waiting = (now - begun for begun in tuple(self._under_way.values()))
        return self._ended + sum(time for time in waiting if time > SHORTEST_HOLD_UP)

    def any_since(self, total: int) -> bool:
        """Whether a hold-up has ended since `total` had this value."""
        return self._ended != total

    def during(self, function, *arguments):
        """Call a function of the middleware, from any thread, and return its result."""
        thread, begun = get_ident(), monotonic_ns()
        self._under_way[thread] = begun
        try:
            return function(*arguments)
        finally:
            self.ended(begun)
            del self._under_way[thread]

    def ended(self, begun: int) -> None:
        """Count a call that began at this time, ns, and has just ended."""
        blocked = monotonic_ns() - begun
        if blocked > SHORTEST_HOLD_UP:
            self._ended += blocked


class Publication:
    """
    Publishes for `simulation`, stamped by `pacing`.

    `values`: the node's parameters. `publishers`: key of OUTPUTS -> publisher. `log`: BackgroundLogWriter or None;
    `frames`: RecordedFrames for it or None.
    `outcome`: rows for Simulation.advance, so that the kernel writes a tick's outcome straight into the message.
    `stamp`: ns, and `message`: bytes, of the state last published or recorded. hold_ups: the HoldUps of this process.
    """

    def __init__(self, simulation, values, publishers, log, frames, pacing):
        self._simulation, self._log, self._frames, self._pacing = simulation, log, frames, pacing
        self._wall_minus_steady = pacing.wall_minus_steady
        self._state_topic, self._events_topic = publishers['state'].topic_name, publishers['events'].topic_name
        # Publishers outlive the thread that publishes. Through their handles a message takes half of the time.
        self._state, self._events = publishers['state'].handle, publishers['events'].handle
        self._clock = publishers.get('clock')
        self.layout = layout = JointStateLayout(simulation.chain.joint_names, values['frame_id'])
        self._clock_layout, self.hold_ups = ClockLayout(), HoldUps()
        self.outcome = layout.position[None], layout.velocity[None], layout.effort[None]
        self.stamp, self.message, self._waiting = 0, b'', []
        self.ticks_per_state = round(values['rate'] / values['publish_rate'])

    def copy_state_into_message(self) -> None:
        """Copy the simulation's state into the message, as a tick does by itself."""
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
        if record and self._log:   # after publishing: subscribers wait for the message, the log does not
            now += self._wall_minus_steady
            self._log.write(self._state_topic, data, now, stamp, tick)
            if self._frames and not tick % self._frames.ticks:
                self._frames.write_state(self._log.write, self.layout.position, now, stamp)
        self.stamp = stamp
        if self._waiting:
            self.publish_events()

    def publish_events(self) -> None:
        """Publish the waiting events, if anybody listens to them."""
        if self._events.get_subscription_count():
            for message in self._waiting:
                self.hold_ups.during(self._events.publish_raw, message)
        self._waiting.clear()

    def _publish_clock(self, stamp: int, record: bool) -> None:
        """Publish the time before the state of that time, so that no state is ahead of the clock."""
        data = self._clock_layout.stamped(stamp)
        self._clock.publish(data)
        if record and self._log:
            self._log.write(self._clock.topic_name, data, monotonic_ns() + self._wall_minus_steady, stamp)

    def publish_event(self, kind: str, **data) -> None:
        """Record an event of the present tick, a row of EVENTS, and publish it."""
        self.record_event(encode_event(self._simulation.tick, kind, data))
        self.publish_events()

    def record_event(self, message: bytes) -> None:
        """Record an encoded event, and publish it after the next state, which must not wait for it."""
        self._waiting.append(message)
        if self._log:
            now = monotonic_ns() + self._wall_minus_steady
            self._log.write(self._events_topic, message, now, now)

    def record_command(self, topic: str, data: bytes, source_time: int) -> None:
        """Record a command as it came; a sender whose clock is outside 1970 to 2038 has no valid `source_time`."""
        if self._log:
            now = monotonic_ns() + self._wall_minus_steady
            self._log.write(topic, data, now, source_time if source_time >= 0 else now)

    def has_listeners(self) -> bool:
        """Whether anybody listens to the states."""
        return self._state.get_subscription_count() > 0
