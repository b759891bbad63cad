"""The executable `view`: a page in the browser that shows a robot, a chain or a log, and lets you push it."""
from __future__ import annotations

import asyncio
import errno
import signal
import sys
from typing import Any

from .source import Source
from ..command_line import add_hold, Parser, print_line, report, run_command, STOP_SIGNALS
from ..errors import Mistake

PORT = 8080
NEEDS = 'view needs aiohttp, which `pip install aiohttp` installs'


def main(arguments=None) -> int:
    """Exit 0: stopped; 2: a mistake."""
    return run_command('view', _view, arguments)


def _parser() -> Parser:
    parser = Parser('view', 'Show a chain, or the run in a log, in the browser, and let the mouse push it.',
                    'view four_link_robot.yaml')
    parser.add_argument('source', metavar='CHAIN', help='chain file (YAML, URDF or MJCF), whose changes are followed')
    parser.add_argument('--port', type=int, metavar='N', help=f'of the page; 0: any that is free (default: {PORT})')
    parser.add_argument('--host', default='127.0.0.1', metavar='H', help='address to listen on; on any but this '
                        "machine's own the page needs the token that is in its address (default: 127.0.0.1)")
    add_hold(parser)
    return parser


def _view(arguments) -> int:
    options = _parser().parse_args(arguments)
    if options.port is not None and not 0 <= options.port <= 65535:
        raise Mistake(f'--port is {options.port}, must be from 0 to 65535')
    return serve(_source(options), options.host, options.port)


def _source(options) -> Source:
    from .chain_source import ChainSource
    return ChainSource(options.source, options.hold)


def serve(source: Source, host: str, port: Any) -> int:
    """Serve the page of a source until a stop signal; Mistake: that is impossible."""
    try:
        from .server import Server
    except ImportError as error:
        if (error.name or '').partition('.')[0] != 'aiohttp':
            raise
        raise Mistake(f'{error}: {NEEDS}') from None
    return asyncio.run(_serve(Server, source, host, port))


async def _serve(server_class, source: Source, host: str, port: Any) -> int:
    stopped = asyncio.Event()
    for number in STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    server = server_class(source, host, PORT if port is None else port)
    try:
        await server.start()
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise Mistake(f'--host is {host!r:.80}: {error.strerror or error}') from None
        if port is not None:
            raise Mistake(f'port {port} is in use, give another one with --port, 0 for any') from None
        report('view', f'port {PORT} is in use, so the page has another one')
        server = server_class(source, host, 0)
        await server.start()
    source.start()
    try:
        print_line(f'view: {server.address}')
        await stopped.wait()
    finally:
        await server.stop()
        source.close()
    return 0


if __name__ == '__main__':
    sys.exit(main())
