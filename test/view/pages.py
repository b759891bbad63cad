"""A running `view`, and pages of it without a browser: what a page says and hears, over real sockets."""
import json
import os
import signal
import subprocess
import sys
from threading import Thread
import time

import numpy as np
import pytest

aiohttp = pytest.importorskip('aiohttp')

PATIENCE = 300.0  # s; a loaded machine may be slow, only a broken one is this slow


class View:
    """The executable, as a user starts it, with its output read line by line."""

    def __init__(self, *arguments, **environment):
        self.lines = []
        self.popen = subprocess.Popen(
            [sys.executable, '-m', 'planar_chain_sim.view.command_line', *map(str, arguments)], text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, errors='replace',
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path), 'PYTHONUNBUFFERED': '1', **environment})
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        if self.popen.poll() is None:
            self.popen.kill()
        self.end()

    def _read(self):
        with self.popen.stdout as stream:
            for line in stream:
                self.lines.append(line.rstrip('\n'))

    @property
    def address(self):
        """Where the page is, as soon as it says so."""
        line = until(lambda: next((line for line in self.lines if 'the arm is at' in line), None)
                     or self.popen.poll() is not None)
        assert line is not True, '\n'.join(self.lines)
        return line.split()[-1]

    def end(self, number=None):
        """Wait for the end, after a signal if one is given, and return the exit code."""
        if number is not None:
            self.popen.send_signal(number)
        code = self.popen.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return code

    def stop(self):
        """End it as a user does."""
        code = self.end(signal.SIGINT)
        assert code == 0, '\n'.join(self.lines)


def until(condition):
    """Wait until a condition is true and return what it returns."""
    end = time.monotonic() + PATIENCE
    while not (result := condition()):
        assert time.monotonic() < end, f'it has not come in {PATIENCE} s'
        time.sleep(0.005)
    return result


class Page:
    """One connection: `async with Page(address) as page`. What it has heard is in scene, status, events and refused."""

    def __init__(self, address, **headers):
        self._address, self._headers = address, {'Origin': address[:address.index('/', 8)], **headers}
        self.scene, self.status, self.events, self.refused = None, {}, [], []
        self.revision, self.source = None, None

    async def __aenter__(self):
        self._session = aiohttp.ClientSession()
        try:
            self.socket = await self._session.ws_connect(f'{self._address}socket', headers=self._headers)
        except BaseException:
            await self._session.close()
            raise
        return self

    async def __aexit__(self, *exception):
        await self._session.close()

    async def say(self, what, **values):
        """Send an action."""
        await self.socket.send_str(json.dumps({'do': what, **values}))

    async def frame(self, **wanted):
        """Ask for a frame and return its arms, [] if there is nothing to be drawn yet."""
        await self.say('frame', **wanted)
        while True:
            message = await self.socket.receive(PATIENCE)
            if message.type == aiohttp.WSMsgType.BINARY:
                return self._arms(np.frombuffer(message.data, '<f8'))
            assert message.type == aiohttp.WSMsgType.TEXT, message
            self._hear(json.loads(message.data))

    def _hear(self, news):
        if 'scene' in news:
            self.scene, self.revision, self.source = news['scene'], news['revision'], news['source']
        self.status = news.get('status', self.status)
        self.events += news.get('events', [])
        self.refused += [news['refused']] if 'refused' in news else []

    def _arms(self, numbers):
        """Return the arms of a frame, read as scene.py describes it."""
        if not len(numbers) or numbers[0] != self.revision:   # of a scene that has been replaced since
            return []
        place, arms = 1, []
        for arm in self.scene:
            joints, bodies = len(arm['joints']), len(arm['bodies'])
            parts = {}
            for name, shape in {'head': (6,), 'position': (joints,), 'velocity': (joints,), 'effort': (joints,),
                                'zeros': (joints, 3), 'bodies': (bodies, 8),
                                'segments': (sum(body['segments'] for body in arm['bodies']), 4)}.items():
                parts[name] = numbers[place:place + int(np.prod(shape))].reshape(shape)
                place += int(np.prod(shape))
            arms.append(parts)
        assert place == len(numbers)
        return arms

    async def until(self, condition, what='', **repeated):
        """Ask for frames until `condition(first arm)` holds; return that arm. `repeated`: what is said each time."""
        end = time.monotonic() + PATIENCE
        while True:
            if what:
                await self.say(what, **repeated)
            arms = await self.frame()
            if arms and condition(arms[0]):
                return arms[0]
            assert time.monotonic() < end, (self.status, self.refused)
