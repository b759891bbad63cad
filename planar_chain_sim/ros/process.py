"""A ROS executable as a process: catches stop signals first, starts and ends ROS, and returns exit code 0 or 2."""
from __future__ import annotations

from contextlib import ExitStack
import os
from pathlib import Path
from queue import Empty, SimpleQueue
import re
import signal
import sys
from time import time_ns
from typing import Callable, Optional, Sequence

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PLACE_IN_SOURCE = re.compile(r', at \S+\.c(pp)?:\d+')   # which ROS adds to its sentences
DDS_PROFILE = Path(__file__).with_name('fast_dds.xml')


def catch_stop_signals() -> SimpleQueue:
    """
    From now on SIGINT, SIGTERM and SIGHUP put None into the returned queue and do nothing else.

    A SIGHUP that is ignored, as under nohup, stays ignored.
    A queue and no Event: if the signal comes during Event.wait(), Event.set() may wait for a lock for ever.
    SimpleQueue.put() can be called during a get().
    """
    stop = SimpleQueue()
    for number in STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda number, frame: stop.put(None))
    return stop


def run_until_stopped(program: str, body: Callable[[list, list, SimpleQueue], None],
                      arguments: Optional[Sequence[str]]) -> int:
    """
    Run `body(own arguments, ROS arguments, stop)`; return 0, or 2 after one sentence on stderr for a user's mistake.

    `stop` gets a None for every stop signal; `body` must return soon after the first one.
    """
    stop = catch_stop_signals()
    from ..command_line import exit_code
    try:
        given = sys.argv[1:] if arguments is None else arguments
        return exit_code(program, lambda: run_body(program, body, given, stop))
    finally:
        # Python restores the default handlers before it has ended. A second Ctrl-C must not end it in between.
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)


def run_body(program: str, body, arguments: Sequence[str], stop: SimpleQueue) -> int:
    """Check that no argument is misplaced, run `body` and return 0."""
    from .arguments import refuse_misplaced
    own, ros = split_arguments(arguments)
    refuse_misplaced(program, own, ros)
    body(own, ros, stop)
    return 0


def wait_for(stop: SimpleQueue):
    """Return what is put into `stop`, once it is."""
    while True:
        try:
            return stop.get(timeout=0.2)  # a signal that the system gives to another thread does not end the wait
        except Empty:
            pass


def split_arguments(arguments: Sequence[str]) -> tuple[list, list]:
    """Split a command line into own arguments and those of ROS, which go from each --ros-args to the next --."""
    own, ros = [], []
    part = own
    for argument in arguments:
        if argument == '--ros-args':
            part = ros
        part.append(argument)
        if argument == '--':
            part = own
    return own, ros


def refuse_clock() -> None:
    """Raise Mistake if the system clock is outside the years that ROS messages and the middleware can represent."""
    from .pacing import LAST_STAMP
    from ..errors import Mistake
    now = time_ns()
    if not 0 <= now <= LAST_STAMP:
        raise Mistake(f'the system clock is in the year {int(1970 + now / 31_556_952e9)}, and ROS messages can be sent '
                      'from 1970 to January 2038 only: set the clock')


def start_node(name: str, arguments: Sequence[str], ending: ExitStack):
    """
    Start ROS with these arguments and return a new rclpy node; `ending` will take both down.

    Mistake: ROS 2 cannot be loaded, or does not accept the arguments.
    """
    from ..errors import Mistake
    if not Path('DEFAULT_FASTRTPS_PROFILES.xml').exists():  # which Fast DDS uses by itself
        os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(DDS_PROFILE))
    refuse_clock()
    from .arguments import refuse_mixed_lists, unheard
    refuse_mixed_lists(arguments)
    try:
        import rclpy
        from rclpy.exceptions import NameValidationException
        from rclpy.impl.implementation_singleton import rclpy_implementation
        from rclpy.node import Node
        from rclpy.signals import SignalHandlerOptions
    except ImportError as error:
        raise Mistake(f'ROS 2 cannot be loaded ({error}): source an installation of it, or install this package with '
                      'its extra [ros]') from None
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        ending.callback(rclpy.try_shutdown)
        node = Node(name)
    except rclpy_implementation.UnknownROSArgsError as error:
        raise Mistake(f'arguments after --ros-args that ROS does not know: {error}') from None
    except UnicodeError:
        raise Mistake('an argument is not UTF-8 text') from None
    except (rclpy_implementation.RCLError, rclpy_implementation.RMWError, NameValidationException) as error:
        raise Mistake(PLACE_IN_SOURCE.sub('', str(error).splitlines()[0])) from None
    ending.callback(node.destroy_node)
    for sentence in unheard(arguments, node.get_fully_qualified_name()):
        node.get_logger().warning(sentence)
    return node
