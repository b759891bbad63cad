"""Serves the page and its WebSocket to browsers. Other hosts, other web pages and a wrong token are refused."""
from __future__ import annotations

import asyncio
from hmac import compare_digest
import json
import logging
from math import isfinite
from pathlib import Path
import re
from secrets import token_urlsafe
import socket
from time import monotonic
from typing import Any, Mapping, Optional

from aiohttp import web, WSMsgType
from aiohttp.http_exceptions import HttpProcessingError

from .source import KEPT, SHARE, SHORTEST, Source
from ..errors import Mistake

PAGE = Path(__file__).with_name('page')
TYPES = {'.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml'}
LOOPBACK = ('127.0.0.1', 'localhost', '::1')
MOST_PAGES = 64
LONGEST = 4096          # bytes that a page may send at once
QUIET = 30.0            # s between two signs of life
CLOSING_TIME = 1.0      # s that a page has to close its connection
PAIR = 'list of two numbers'
ACTIONS: Mapping[str, Mapping[str, str]] = {
    'frame': {}, 'pause': {'value': 'boolean'}, 'step': {}, 'reset': {}, 'release': {},
    'effort': {'joint': 'string', 'value': 'number or null'},
    'pull': {'body': 'string', 'point': PAIR, 'to': PAIR},
    'set': {'name': 'string', 'value': 'number or list of numbers'},
    'series': {'begin': 'number', 'end': 'number', 'count': 'number'},
    'event': {'time': 'number', 'forward': 'boolean'},
    'trail': {'body': 'string', 'point': PAIR, 'begin': 'number', 'end': 'number'}}
ANSWERED = ('series', 'event', 'trail')   # at once, beside the frames
LOGGER = logging.getLogger(__name__)   # of bugs; not of requests that are no HTTP, which get their answer
LOGGER.addFilter(lambda record: not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError)))
HOST = re.compile(r'(\[[0-9a-fA-F:.]+\]|[^:\[\]]+)(:\d{1,5})?')


class Server:
    """
    The page at `host` and `port`, showing a source.

    Beyond this machine, everything needs the token that is in `address`.
    """

    def __init__(self, source: Source, host: str, port: int) -> None:
        self._source, self._host, self._port = source, host, port
        self._files = {path.name: path for path in PAGE.iterdir() if path.suffix in TYPES}
        self._token = '' if host in LOOPBACK else token_urlsafe(16)
        self._pages: set = set()
        self._runner: Optional[web.AppRunner] = None

    @property
    def address(self) -> str:
        """Where the page is."""
        host = self._host if self._host not in ('0.0.0.0', '::') else socket.gethostname()
        return f'http://{f"[{host}]" if ":" in host else host}:{self._port}/{f"{self._token}/" if self._token else ""}'

    async def start(self) -> None:
        """Listen; OSError: the port is in use, or no such host."""
        app = web.Application(middlewares=[self._guard], client_max_size=LONGEST)
        app.router.add_get('/{path:.*}', self._answer)
        self._runner = web.AppRunner(app, access_log=None, logger=LOGGER, handle_signals=False)
        await self._runner.setup()
        await web.TCPSite(self._runner, self._host, self._port, shutdown_timeout=CLOSING_TIME).start()
        self._port = self._runner.addresses[0][1]

    async def stop(self) -> None:
        """Close all pages' connections and the port."""
        await asyncio.gather(*(page.close(code=1001, message=b'view has ended') for page in self._pages),
                             return_exceptions=True)
        if self._runner:
            await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse other hosts, other origins and a wrong token; add the headers that lock the page in."""
        host = request.headers.get('Host', '')
        if not self._is_ours(host, request):
            raise web.HTTPForbidden(text='This page is not served under that host name.\n')
        origin = request.headers.get('Origin')
        if origin is not None and origin != f'http://{host}':
            raise web.HTTPForbidden(text='Other pages may not use this one.\n')
        if self._token:
            given, _, path = request.match_info['path'].partition('/')
            if not compare_digest(given.encode(), self._token.encode()):
                raise web.HTTPForbidden(text='The address lacks its token: use the one that view has printed.\n')
            request.match_info['path'] = path
        return await handler(request)

    def _is_ours(self, host: str, request: web.Request) -> bool:
        """Tell whether a Host header names this machine by a name that nobody else can let point here."""
        found = HOST.fullmatch(host)
        if not found:
            return False
        name = found.group(1).strip('[]').lower()
        if name in LOOPBACK or name == self._host.lower():
            return True
        own = request.transport.get_extra_info('sockname') if request.transport else None
        return bool(self._token) and name in (own[0] if own else '', socket.gethostname().lower())

    async def _answer(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info['path'] or 'index.html'
        if name == 'socket':
            return await self._talk(request)
        path = self._files.get(name)
        if path is None:
            raise web.HTTPNotFound(text='There is no such file.\n')
        host = request.headers['Host']
        return web.Response(body=path.read_bytes(), headers={
            'Content-Type': f'{TYPES[path.suffix]}; charset=utf-8',
            'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
                                       f"connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'; "
                                       "frame-ancestors 'none'",
            'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer', 'Cache-Control': 'no-cache',
            'Cross-Origin-Resource-Policy': 'same-origin', 'Cross-Origin-Opener-Policy': 'same-origin'})

    async def _talk(self, request: web.Request) -> web.StreamResponse:
        """Answer one page until it goes."""
        if 'Origin' not in request.headers:   # which every browser sends
            raise web.HTTPForbidden(text='A request without an Origin is not from the page.\n')
        if len(self._pages) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text=f'{MOST_PAGES} pages are open already.\n')
        page = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=QUIET, timeout=CLOSING_TIME, compress=False)
        await page.prepare(request)
        self._pages.add(page)
        told = _Told(self._source)
        try:
            async for message in page:
                if message.type != WSMsgType.TEXT:
                    break
                await self._serve(page, message.data, told)
        except (ConnectionError, asyncio.TimeoutError):
            pass
        finally:
            self._pages.discard(page)
            self._source.leave(page)
        return page

    async def _serve(self, page: web.WebSocketResponse, text: str, told: _Told) -> None:
        try:
            action = checked(text)
            if action['do'] in ANSWERED:
                await told.answering   # one at a time
                told.answering = asyncio.ensure_future(self._answer_question(page, action, told))
                return
            if action['do'] != 'frame':
                self._source.act(page, action)
                return
        except Mistake as error:
            told.refused = str(error)
            return
        await asyncio.sleep(max(0.0, told.next - monotonic()))
        try:
            begun = monotonic()
            frame = await self._source.frame(action)
        except Mistake as error:
            frame, told.refused = None, str(error)
        now = monotonic()
        # a log has no ticks that wait
        told.next = max(begun + SHORTEST, now + SHARE * (now - begun) * (self._source.kind != 'log'))
        for news in told.news(self._source):
            await page.send_str(as_json(news))
        await page.send_bytes(frame or b'')

    async def _answer_question(self, page: web.WebSocketResponse, question: dict, told: _Told) -> None:
        try:
            answer = await self._source.answer(question)
            if isinstance(answer, bytes):
                await page.send_bytes(answer)
            else:
                await page.send_str(as_json(answer))
        except Mistake as error:
            told.refused = str(error)   # comes with the next frame
        except ConnectionError:
            pass   # the page has gone


class _Told:
    """What one page has been told. `next`: when its next frame may be sent, s of monotonic()."""

    def __init__(self, source: Source) -> None:
        self.next, self.refused = 0.0, ''
        self._revision = -1
        told = 50 if source.kind != 'log' else KEPT
        self._events, self._complaints = max(0, source.events.count - told), source.complaints.count
        self.answering: asyncio.Future = asyncio.get_running_loop().create_future()
        self.answering.set_result(None)
        self._status: Optional[Mapping[str, Any]] = None

    def news(self, source: Source) -> list:
        """Return the messages that are new to the page."""
        news = []
        shown, status, events, complaints = source.shown, source.status, source.events.count, source.complaints.count
        if shown.revision != self._revision:
            self._revision = shown.revision
            news.append({'scene': shown.described, 'revision': shown.revision, 'source': source.kind})
        if status is not self._status:
            self._status = status
            news.append({'status': status})
        if events > self._events:
            news.append({'events': source.events.since(self._events)})
            self._events = events
        for sentence in [self.refused] if self.refused else source.complaints.since(self._complaints)[-1:]:
            news.append({'refused': sentence})
        self.refused, self._complaints = '', complaints
        return news


def as_json(message: Any) -> str:
    """Return a message as JSON; a number that is not finite becomes a string, because JSON has none."""
    try:
        return json.dumps(message, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(message))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return str(value) if isinstance(value, float) and not isfinite(value) else value


def checked(text: str) -> dict:
    """Return what a page asks for; Mistake: it is not of the form that scene.py describes."""
    try:
        action = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise Mistake('the page has sent a message that is not JSON') from None
    do = action.get('do') if isinstance(action, dict) else None
    if not isinstance(do, str) or do not in ACTIONS:
        raise Mistake(f'the page asks for {do!r:.80}, must be one of {", ".join(ACTIONS)}')
    told = {'do': do}
    if do == 'frame' and 'time' in action:
        told['time'] = _value('time', action['time'], 'number')
    for key, wanted in ACTIONS[do].items():
        told[key] = _value(key, action.get(key), wanted)
    return told


def _no_number(name: str) -> None:
    raise ValueError(name)


def _value(key: str, value: Any, wanted: str) -> Any:
    """Return a value of an action; Mistake: it is not of the type that is wanted."""
    if wanted == 'boolean' and isinstance(value, bool):
        return value
    if wanted == 'string' and isinstance(value, str):
        return value
    if wanted.startswith('number') and _is_number(value):
        return float(value)
    if wanted == 'number or null' and value is None:
        return None
    if wanted in (PAIR, 'number or list of numbers') and isinstance(value, list) and all(map(_is_number, value)) and (
            len(value) == 2 or wanted != PAIR):
        return [float(each) for each in value]
    raise Mistake(f'{key!r} is {value!r:.80}, must be a {wanted}')


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e100 and isfinite(value)
