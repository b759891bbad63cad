"""A ROS executable as a process: stop signals caught before all else, ROS started and ended, exit code 0 or 2."""
from __future__ import annotations

from contextlib import ExitStack
import os
from pathlib import Path
from queue import Empty, SimpleQueue
import signal
import sys
from typing import Callable, Optional, Sequence

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
DDS_PROFILE = Path(__file__).with_name('fast_dds.xml')


def catch_stop_signals() -> SimpleQueue:
    """
    From now on SIGINT and SIGTERM put None into the returned queue and do nothing else.

    SimpleQueue.put may interrupt a get; an Event's set could meet its own wait holding the lock, and never return.
    """
    stop = SimpleQueue()
    for number in STOP_SIGNALS:
        signal.signal(number, lambda number, frame: stop.put(None))
    return stop


def run_until_stopped(program: str, body: Callable[[list, list, SimpleQueue], None],
                      arguments: Optional[Sequence[str]]) -> int:
    """
    Run `body(own arguments, ROS arguments, stop)`; return 0, or 2 after one sentence on stderr for a user's mistake.

    `stop` gets a None for every stop signal: `body` has to return soon after the first.
    """
    stop = catch_stop_signals()
    from ..command_line import Mistake
    try:
        body(*split_arguments(sys.argv[1:] if arguments is None else arguments), stop)
        return 0
    except Mistake as mistake:
        print(f'{program}: {mistake}', file=sys.stderr, flush=True)
        return 2
    finally:
        # Python restores the deadly defaults before it is quite gone; a second Ctrl-C must not fall in between.
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_IGN)


def wait_for(stop: SimpleQueue):
    """Return what is put into `stop`, once it is."""
    while True:
        try:
            return stop.get(timeout=0.2)  # a signal that the system gives to another thread does not end the wait
        except Empty:
            pass


def split_arguments(arguments: Sequence[str]) -> tuple[list, list]:
    """Part a command line into an executable's own arguments and those of ROS: from each --ros-args to the next --."""
    own, ros = [], []
    part = own
    for argument in arguments:
        if argument == '--ros-args':
            part = ros
        part.append(argument)
        if argument == '--':
            part = own
    return own, ros


def start_node(name: str, arguments: Sequence[str], ending: ExitStack):
    """
    Start ROS with these arguments and return a new rclpy node; `ending` will take both down.

    Mistake where there is no ROS 2 or it does not take the arguments.
    """
    from ..command_line import Mistake
    if not Path('DEFAULT_FASTRTPS_PROFILES.xml').exists():  # which Fast DDS takes of itself
        os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(DDS_PROFILE))
    try:
        import rclpy
        from rclpy.node import Node
        from rclpy.signals import SignalHandlerOptions
    except ImportError as error:
        raise Mistake(f'ROS 2 cannot be loaded ({error}): source an installation of it, or install this package with '
                      'its extra [ros]') from None
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        ending.callback(rclpy.try_shutdown)
        node = Node(name, automatically_declare_parameters_from_overrides=True)
    except Exception as error:  # of no common class; each says what is wrong with the arguments or the surroundings
        raise Mistake(str(error).splitlines()[0]) from None
    ending.callback(node.destroy_node)
    return node
