"""The executable `view`: a page in the browser that shows a robot or a chain, and lets you push it."""
from __future__ import annotations

import asyncio
from contextlib import ExitStack
import errno
import os
import signal
import sys
from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence

from .source import Source
from ..command_line import add_hold, Parser, print_line, report, run_command, STOP_SIGNALS
from ..errors import Mistake

HOST, PORT = '127.0.0.1', 8080
NEEDS = 'view needs aiohttp, which `pip install aiohttp` installs'
MAGIC = b'\x89MCAP'     # at the beginning of a log
BESIDE = '--beside'
NICE = 5
PARENT_PERIOD = 0.2   # s between two checks that the simulator still runs
PARENT_GRACE = 10.0  # s after Ctrl-C that the simulator beside has to end
DESCRIPTION = """\
Show an arm in the browser, move it with the mouse, and see its motion, energy and events.

A chain file is simulated here, without ROS, and read again when it changes. A log is played; two logs are laid over one
another. Without a file the page shows the robot that publishes robot_description and joint_states in ROS; host and port
are then parameters too. Ctrl-C ends it with exit code 0."""


class Place(NamedTuple):
    """Where the page is. `chosen`: whether the user has chosen the port."""

    host: str = HOST
    port: int = PORT
    chosen: bool = False


def main(arguments=None) -> int:
    """Exit 0: stopped; 2: a mistake."""
    return run_command('view', _view, arguments)


def _parser() -> Parser:
    parser = Parser('view', DESCRIPTION, 'view four_link_robot.yaml')
    parser.add_argument('sources', metavar='CHAIN|LOG', nargs='*', help='chain file (YAML, URDF or MJCF) to simulate; '
                        'or one or two logs')
    parser.add_argument('--port', type=int, metavar='N', help='port of the page; 0: any that is free (default: '
                        f'{PORT}, or any if that is in use)')
    parser.add_argument('--host', metavar='H', help='address to listen on; if other machines can reach it, the page '
                        f'needs the token that is in its address (default: {HOST})')
    parser.add_argument(BESIDE, nargs='...', metavar='ARGUMENT', help='must come first: show the simulator that was '
                        'started with these arguments, and end when the process that started this one ends; `make run` '
                        'uses it')
    add_hold(parser)
    return parser


def _view(arguments) -> int:
    from ..ros.arguments import refuse_misplaced
    from ..ros.process import split_arguments
    given = list(sys.argv[1:] if arguments is None else arguments)
    parent = os.getppid() if given[:1] == [BESIDE] else None
    if parent:
        own, ros = [], remappings(given[1:])
    else:
        own, ros = split_arguments(given)
        refuse_misplaced('view', own, ros)
    options = _parser().parse_args(own)
    if options.beside is not None:
        raise Mistake(f'{BESIDE} must be the first argument')
    if options.port is not None and not 0 <= options.port <= 65535:
        raise Mistake(f'--port is {options.port}, must be from 0 to 65535')
    told = {name: value for name, value in (('host', options.host), ('port', options.port)) if value is not None}
    if options.sources:
        if ros:
            raise Mistake(f'{ros[0]} is for a robot in ROS, but a file is given: leave one of them out')
        source = _source(options)
        return serve(lambda ending: (source, Place(**told, chosen='port' in told)))
    if options.hold:
        raise Mistake('--hold is for chain files, and none is given')
    return serve(lambda ending: _live(ros, ending, told), parent)


def _source(options: Any) -> Source:
    """Return the source of the files that are given: chain or logs; Mistake."""
    paths = options.sources
    logs = [path for path in paths if _is_log(path)]
    if not logs and len(paths) == 1:
        from .chain_source import ChainSource
        return ChainSource(paths[0], options.hold)
    if len(paths) > 2 or len(logs) < len(paths):
        raise Mistake(f'{len(paths)} files are given, must be one chain file, one log or two logs')
    if options.hold:
        raise Mistake('--hold is for chain files, and a log is given')
    from .log_source import LogSource
    return LogSource(paths)


def _is_log(path: str) -> bool:
    try:
        with open(path, 'rb') as stream:
            return path.endswith('.mcap') or stream.read(len(MAGIC)) == MAGIC   # reading it will say what is wrong
    except OSError:
        return path.endswith('.mcap')


def remappings(arguments: Sequence[str]) -> list:
    """Return those of a simulator's arguments that remap its topics, for a node of another name."""
    from ..ros.process import split_arguments
    _, ros = split_arguments(arguments)
    found = []
    for flag, value in zip(ros, ros[1:]):
        rule = value.partition('simulator:')[2] if value.startswith('simulator:') else value
        if flag in ('-r', '--remap') and not rule.startswith(('__node:=', '__name:=')):
            found += ['-r', rule]
    return ['--ros-args', *found] if found else []


def _live(arguments: Sequence[str], ending: ExitStack, told: Mapping[str, Any]) -> tuple[Source, Place]:
    """Return the source of a new ROS node with these arguments, and where its page is to be; Mistake."""
    from ..ros.process import start_node
    try:
        node = start_node('view', arguments, ending)
    except Mistake as error:
        if 'cannot be loaded' not in str(error):
            raise
        raise Mistake(f'{error}; `view CHAIN` needs no ROS') from None
    os.nice(NICE)   # the robot's own program goes first
    from .live_source import LiveSource
    from ..ros.declaration import declare, given_values, overrides
    from ..ros.parameters import Row
    rows = {row.name: row for row in (
        Row('host', HOST, 'Address that the page listens on.'),
        Row('port', float(PORT), 'Port of the page; 0: any that is free.', (0.0, 65535.0)))}
    chosen = 'port' in {*told, *overrides(node)}
    values = given_values(node, rows.values(), **told)
    declare(node, values, rows)
    return LiveSource(node), Place(values['host'], int(values['port']), chosen)


def serve(make: Callable[[ExitStack], tuple[Source, Place]], parent: Optional[int] = None) -> int:
    """Serve the page of a source until a stop signal, or until `parent` has gone; Mistake: that is impossible."""
    try:
        from .server import Server
    except ImportError as error:
        if (error.name or '').partition('.')[0] != 'aiohttp':
            raise
        raise Mistake(f'{error}: {NEEDS}') from None
    with ExitStack() as ending:
        return asyncio.run(_serve(Server, *make(ending), parent))


async def _serve(server_class: Any, source: Source, place: Place, parent: Optional[int]) -> int:
    loop, stopped, errors = asyncio.get_running_loop(), asyncio.Event(), []
    for number in STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            loop.add_signal_handler(number, stopped.set)
    if parent is not None:   # Ctrl-C ends both: the robot leaves first, as Fast DDS may hang if two leave at once
        loop.add_signal_handler(signal.SIGINT, loop.call_later, PARENT_GRACE, stopped.set)

    def fail(error: BaseException) -> None:
        errors.append(error)
        loop.call_soon_threadsafe(stopped.set)

    server = await _started(server_class, source, place)
    source.start(fail)
    try:
        if parent in (None, os.getppid()):
            print_line(f'view: the arm is at {server.address}')
        while not stopped.is_set() and parent in (None, os.getppid()):
            try:
                await asyncio.wait_for(stopped.wait(), PARENT_PERIOD if parent else None)
            except asyncio.TimeoutError:
                pass
    finally:
        source.close()   # first, so that pulls and efforts of pages end
        await server.stop()
    if errors:
        raise errors[0]
    return 0


async def _started(server_class: Any, source: Source, place: Place) -> Any:
    """Return a server that listens; Mistake: it cannot."""
    if not place.host:
        raise Mistake("host is '', must be an address of this machine, 0.0.0.0 for all that it has")
    server = server_class(source, place.host, place.port)
    try:
        await server.start()
        return server
    except OSError as error:
        await server.stop()
        if error.errno != errno.EADDRINUSE:
            raise Mistake(f'the page cannot be at {place.host!r:.80}, port {place.port} ({error.strerror or error}), '
                          'choose others with --host and --port') from None
    if place.chosen:
        raise Mistake(f'port {place.port} is in use, give another one with --port, 0 for any')
    report('view', f'port {place.port} is in use, so the page has another one')
    return await _started(server_class, source, place._replace(port=0))


if __name__ == '__main__':
    sys.exit(main())
