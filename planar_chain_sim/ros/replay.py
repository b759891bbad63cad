"""The executable `replay`: publishes what a log holds, recorded commands or recorded states, at the recorded pace."""
from __future__ import annotations

from contextlib import ExitStack
from queue import Empty
import sys
from time import monotonic
from typing import Any

from .keyboard import ARROW_RIGHT, Keyboard
from .process import run_until_stopped, start_node

DESCRIPTION = """\
Publish a log's recorded commands, or its states, at the pace at which they were recorded.

Messages go out as the recorded bytes, stamps included, on the recorded topics, which can be remapped. In a terminal \
the space bar pauses and goes on; s or the right arrow publishes the next message while paused.

SIGINT and SIGTERM end it with exit code 0. A mistake ends it with one sentence and exit code 2."""
EXAMPLE = 'replay run.mcap --what states --speed 0.5 --loop --ros-args -r joint_states:=ghost/joint_states'

KEYS = 'keys: space pauses and goes on; s or the right arrow publishes the next message while paused'
HINT_PERIOD = 5.0   # s between two hints which keys there are
LOOK_PERIOD = 0.02  # s between two looks for listeners, at the keys and for a stop; the shortest loop
CLOCK_PERIOD = 0.025   # s, wall time between two messages on /clock, at most
LONGEST = 1e9       # s that a pass may take
BEYOND = 2.0**34    # s, more than a log time can be
LATEST = 0.5        # s; what is later, as after Ctrl-Z, is not caught up with


def main(arguments=None) -> int:
    """Run the executable. Its stop signals are handled before anything heavy is imported."""
    return run_until_stopped('replay', replay, arguments)


def replay(own_arguments, ros_arguments, stop) -> None:
    """Publish the log until its end or a stop. Mistake: bad options; LogError: no such log."""
    options = parse(own_arguments)
    from ..recording.log_reader import read_log
    log = read_log(options.log)
    with ExitStack() as ending:
        node = start_node('replay', ros_arguments, ending)
        topics = find_topics(log, options)
        publishers = {name: create_publisher(node, name, type_name) for name, type_name in topics.items()}
        clock = Clock(node) if options.clock else None
        awaited = [*publishers.values(), *([clock.publisher] if clock else [])]
        keyboard = ending.enter_context(Keyboard())
        node.get_logger().info(f'replaying {options.what} of {printable(options.log)} on '
                               f'{", ".join(publisher.topic_name for publisher in publishers.values())}')
        if wait_for_listeners(node, awaited, options.wait, stop):
            return
        if clock:
            clock.warn_of_others()
        if keyboard.attached:
            node.get_logger().info(KEYS)
        playback = Playback(log, publishers, clock, options, keyboard, stop, node.get_logger())
        while not playback.play():
            if not options.loop:
                wait_until_delivered(awaited)
                return


def printable(name: str) -> str:
    """Return a file's name as ROS can print it: in valid UTF-8."""
    return name.encode(errors='backslashreplace').decode()


def parse(arguments):
    """Return the options of the command line; Mistake on a bad one."""
    from ..command_line import Parser
    from ..errors import Mistake
    parser = Parser('replay', DESCRIPTION, EXAMPLE)
    parser.add_argument('log', help='MCAP log of the simulator or of rollout')
    parser.add_argument('--what', choices=('commands', 'states'), default='commands',
                        help='what to publish (default: commands)')
    parser.add_argument('--speed', type=float, default=1.0, metavar='F',
                        help='multiple of the recorded pace (default: 1)')
    parser.add_argument('--loop', action='store_true', help='begin again at the end')
    parser.add_argument('--start', type=float, default=0.0, metavar='S', help='skip this much of the log, s')
    parser.add_argument('--duration', type=float, metavar='S', help='publish this much of the log, s (default: all)')
    parser.add_argument('--clock', action='store_true', help="also publish the log's time on /clock, before each "
                        'message and 40 times a second')
    parser.add_argument('--wait', type=float, default=3.0, metavar='S',
                        help='longest time to wait for listeners on every topic, s (default: 3)')
    options = parser.parse_args(arguments)
    if not 0.0 < options.speed < float('inf'):
        raise Mistake(f'--speed is {options.speed}, must be a finite number > 0')
    for name in ('start', 'wait'):
        if not 0.0 <= getattr(options, name) < float('inf'):
            raise Mistake(f'--{name} is {getattr(options, name)}, must be a finite number of seconds >= 0')
    if options.duration is not None and not 0.0 < options.duration < float('inf'):
        raise Mistake(f'--duration is {options.duration}, must be a finite number of seconds > 0')
    return options


def find_topics(log, options) -> dict[str, str]:
    """Return topic -> type of the messages to publish; Mistake: there are none, or their times cannot be published."""
    from .messages import INPUTS
    from .pacing import LAST_STAMP
    from ..errors import Mistake
    command_types = {row.type_name for row in INPUTS.values()}
    state_topic, topics = log.settings.get('state_topic'), {}
    begin: Any = None
    last = 0
    for message in log.messages:
        if begin is None:
            begin, end = span(message, options)
        if message.log_time > end:
            break
        wanted = (message.topic == state_topic) if options.what == 'states' else message.topic != state_topic
        if wanted and message.log_time >= begin and message.type_name in command_types:
            topics[message.topic] = message.type_name
        last = message.log_time
    if not topics:
        parts = [f'after {options.start:g} s'] if options.start else []
        parts += [f'within {options.duration:g} s'] if options.duration else []
        raise Mistake(' '.join([f'log {options.log!r}: it holds no {options.what}', *parts]))
    if not (last - begin) * 1e-9 / options.speed <= LONGEST:
        raise Mistake(f'--speed is {options.speed:g}, at which the log would take {(last - begin) * 1e-9:.3g} s / '
                      f'{options.speed:g}, must be one at which it takes at most {LONGEST:g} s')
    if options.clock and last > LAST_STAMP:
        raise Mistake(f'log {options.log!r}: its times are beyond January 2038, which no message on /clock can carry')
    return topics


def span(message, options) -> tuple[int, int]:
    """Return the first and the last log time, ns, that are published; `message` is the first of the log."""
    begin = message.log_time + round(min(options.start, BEYOND) * 1e9)
    return begin, begin + round(min(BEYOND if options.duration is None else options.duration, BEYOND) * 1e9)


def create_publisher(node, topic: str, type_name: str):
    """Create a publisher for recorded bytes of a type by its name; Mistake: ROS refuses the topic."""
    from rclpy.exceptions import InvalidTopicNameException

    from .messages import INPUTS
    from ..errors import Mistake
    message = next(row.message for row in INPUTS.values() if row.type_name == type_name)
    try:
        return node.create_publisher(message, topic, 1000)   # a listener that knows us late has the first ones too
    except InvalidTopicNameException as error:
        raise Mistake(f'topic {topic!r} of the log: {" ".join(str(error).split())}') from None


def wait_for_listeners(node, publishers, seconds: float, stop) -> bool:
    """Wait until somebody listens on every topic, `seconds` at most; return whether we are to stop."""
    end = monotonic() + seconds
    while unheard := [each.topic_name for each in publishers if not each.get_subscription_count()]:
        if monotonic() >= end:
            node.get_logger().warning(f'nobody listens on {", ".join(unheard)}')
            return False
        if stopped_within(LOOK_PERIOD, stop):
            return True
    return not stop.empty()


class Clock:
    """Publishes times of the log on /clock."""

    def __init__(self, node):
        from rosgraph_msgs.msg import Clock as Message

        from ..recording.cdr import ClockLayout
        self._node, self._layout = node, ClockLayout()
        self.publisher = node.create_publisher(Message, '/clock', 1)
        self._due = 0.0   # of the next message, s of the steady clock

    def publish(self, time: int, due: bool = True) -> None:
        """Publish a time, ns; without `due` only if the last one was published CLOCK_PERIOD ago."""
        now = monotonic()
        if due or now >= self._due:
            self._due = now + CLOCK_PERIOD
            self.publisher.publish(self._layout.stamped(time))

    def warn_of_others(self) -> None:
        """Warn of another publisher of /clock: nodes would see the time jump between the two."""
        if self._node.count_publishers(self.publisher.topic_name) > 1:
            self._node.get_logger().warning(f'another node publishes {self.publisher.topic_name} too')


class Playback:
    """
    Publishes a log at its pace; keys pause it, go on and step.

    `clock`: Clock or None. `keyboard`: Keyboard. `stop`: queue of stop signals.
    """

    def __init__(self, log, publishers, clock, options, keyboard, stop, logger):
        self._log, self._publishers, self._clock, self._options = log, publishers, clock, options
        self._keyboard, self._stop, self._logger = keyboard, stop, logger
        self._first = self._time = self._next = 0   # log times, ns: first message; at `since`; of what is due next
        self._since = 0.0   # s of the steady clock
        self._paused, self._steps = False, 0
        self._hinted = -HINT_PERIOD   # s of the steady clock

    def play(self) -> bool:
        """Publish once through, each message when it is due; return whether we are to stop."""
        begin: Any = None
        end, begun = 0, monotonic()
        for message in self._log.messages:
            if begin is None:
                begin, last = span(message, self._options)
                self._first, self._time, self._since = message.log_time, begin, monotonic()
            if message.log_time > last:
                break
            end = message.log_time
            if message.topic in self._publishers and end >= begin:
                if self._wait_until(end):
                    return True
                if self._clock:
                    self._clock.publish(end)
                self._publishers[message.topic].publish(message.data)
        return self._wait_until(end, False) or self._stops_within(begun + LOOK_PERIOD - monotonic())

    def _wait_until(self, time: int, message: bool = True) -> bool:
        """Wait until this time of the log, ns, is due, or a message stepped to; return whether we are to stop."""
        seconds, self._next = 0.0, time
        while not self._stops_within(seconds):
            if self._steps and not message:   # the step is to the first message of the next pass
                return False
            if self._steps:
                self._steps -= 1
                self._time = max(time, self._time)
                self._say('stepped to')
                return False
            seconds = LOOK_PERIOD
            if not self._paused:
                now = monotonic()
                seconds = min(seconds, self._since + (time - self._time) * 1e-9 / self._options.speed - now)
                if seconds < -LATEST:
                    self._time, self._since = time, now
                if seconds <= 0.0:
                    return False
            if self._clock:
                self._clock.publish(self._now(), due=False)
        return True

    def _now(self) -> int:
        """Return the log's time now, ns: not beyond what is due next."""
        gone = 0.0 if self._paused else (monotonic() - self._since) * 1e9 * self._options.speed
        return self._time + round(max(min(gone, self._next - self._time), 0))

    def _stops_within(self, seconds: float) -> bool:
        """Wait for keys, at most so long, and obey them; return whether there was a stop signal."""
        for key in self._keyboard.wait(seconds):
            if key == ' ':
                self._time, self._since = self._now(), monotonic()
                self._paused, self._steps = not self._paused, 0
                self._say('paused at' if self._paused else 'goes on from')
            elif self._paused and key in ('s', ARROW_RIGHT):
                self._steps += 1
            elif monotonic() - self._hinted > HINT_PERIOD:
                self._hinted = monotonic()
                self._logger.info(KEYS)
        return not self._stop.empty()

    def _say(self, what: str) -> None:
        self._logger.info(f'{what} {(self._time - self._first) * 1e-9:.6g} s')


def wait_until_delivered(publishers) -> None:
    """Wait until all listeners have the last message: a publisher that ends drops what it has not delivered."""
    from rclpy.duration import Duration
    for publisher in publishers:
        publisher.wait_for_all_acked(Duration(seconds=1.0))


def stopped_within(seconds: float, stop) -> bool:
    """Sleep, but not longer than until a stop signal; return whether there was one."""
    try:
        stop.get(timeout=max(seconds, 0.0))
        return True
    except Empty:
        return False


if __name__ == '__main__':
    sys.exit(main())
