"""The executable `replay`: publishes what a log holds, recorded commands or recorded states, at the recorded pace."""
from __future__ import annotations

from contextlib import ExitStack
from queue import Empty
import sys
from time import monotonic
from typing import Any

from .process import run_until_stopped, start_node

DESCRIPTION = """\
Publish a log's recorded commands, or its states, at the pace at which they were recorded.

Messages go out as the recorded bytes, stamps included, on the recorded topics, which can be remapped.
SIGINT and SIGTERM end it with exit code 0. A mistake ends it with one sentence and exit code 2."""
EXAMPLE = 'replay run.mcap --what states --speed 0.5 --loop --ros-args -r joint_states:=ghost/joint_states'

LOOK_PERIOD = 0.02  # s between two looks for listeners, and the shortest loop
LONGEST = 1e9       # s that a pass may take


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
        node.get_logger().info(f'replaying {options.what} of {printable(options.log)} on '
                               f'{", ".join(publisher.topic_name for publisher in publishers.values())}')
        if wait_for_listeners(node, publishers, options.wait, stop):
            return
        while not play(log, publishers, options, stop):
            if not options.loop:
                wait_until_delivered(publishers)
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
    parser.add_argument('--wait', type=float, default=3.0, metavar='S',
                        help='longest time to wait for listeners on every topic, s (default: 3)')
    options = parser.parse_args(arguments)
    if not 0.0 < options.speed < float('inf'):
        raise Mistake(f'--speed is {options.speed}, must be a finite number > 0')
    for name in ('start', 'wait'):
        if not 0.0 <= getattr(options, name) < float('inf'):
            raise Mistake(f'--{name} is {getattr(options, name)}, must be a finite number of seconds >= 0')
    return options


def find_topics(log, options) -> dict[str, str]:
    """Return topic -> type of the messages to publish after --start; Mistake if there are none."""
    from .messages import INPUTS
    from ..errors import Mistake
    command_types = {row.type_name for row in INPUTS.values()}
    state_topic, topics = log.settings.get('state_topic'), {}
    origin: Any = None
    last = 0
    for message in log.messages:
        origin = begin_of(message, options) if origin is None else origin
        wanted = (message.topic == state_topic) if options.what == 'states' else message.topic != state_topic
        if wanted and message.log_time >= origin and message.type_name in command_types:
            topics[message.topic] = message.type_name
        last = message.log_time
    if not topics:
        after = f' after {options.start:g} s' if options.start else ''
        raise Mistake(f'log {options.log!r}: it holds no {options.what}{after}')
    if not (last - origin) * 1e-9 / options.speed <= LONGEST:
        raise Mistake(f'--speed is {options.speed:g}, at which the log would take {(last - origin) * 1e-9:.3g} s / '
                      f'{options.speed:g}, must be one at which it takes at most {LONGEST:g} s')
    return topics


def begin_of(message, options) -> int:
    """Return the log time, ns, from which messages are published; `message` is the first of the log."""
    return message.log_time + round(min(options.start, 2.0**34) * 1e9)   # beyond what a log time can be


def create_publisher(node, topic: str, type_name: str):
    """Create a publisher for recorded bytes of a type by its name; Mistake: ROS refuses the topic."""
    from rclpy.exceptions import InvalidTopicNameException

    from .messages import INPUTS
    from ..errors import Mistake
    message = next(row.message for row in INPUTS.values() if row.type_name == type_name)
    try:
        return node.create_publisher(message, topic, 10)
    except InvalidTopicNameException as error:
        raise Mistake(f'topic {topic!r} of the log: {" ".join(str(error).split())}') from None


def wait_for_listeners(node, publishers, seconds: float, stop) -> bool:
    """Wait until somebody listens on every topic, `seconds` at most; return whether we are to stop."""
    end = monotonic() + seconds
    while unheard := [each.topic_name for each in publishers.values() if not each.get_subscription_count()]:
        if monotonic() >= end:
            node.get_logger().warning(f'nobody listens on {", ".join(unheard)}')
            return False
        if stopped_within(LOOK_PERIOD, stop):
            return True
    return not stop.empty()


def play(log, publishers, options, stop) -> bool:
    """Publish once through, each message when it is due; return whether we are to stop."""
    begin, origin, due = monotonic(), None, 0.0
    for message in log.messages:
        origin = begin_of(message, options) if origin is None else origin
        due = begin + (message.log_time - origin) * 1e-9 / options.speed
        if message.topic in publishers and message.log_time >= origin:
            if stopped_within(due - monotonic(), stop):
                return True
            publishers[message.topic].publish(message.data)
    return stopped_within(max(due - monotonic(), LOOK_PERIOD), stop)


def wait_until_delivered(publishers) -> None:
    """Wait until all listeners have the last message: a publisher that ends drops what it has not delivered."""
    from rclpy.duration import Duration
    for publisher in publishers.values():
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
