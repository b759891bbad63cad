"""
Measure what pages cost the node: ticks dropped, lateness, from its own log, and CPU time, without a page and with many.

    python test/view/page_load.py --seconds 60 --pages 10

Each page asks for a frame as soon as it has one, at most 60 times a second; one more hangs in the midst of a pull.
"""
from argparse import ArgumentParser
import asyncio
from multiprocessing import Process
import os
from pathlib import Path
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
import time

import numpy as np
from pages import Page, View

from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.events import decode_event
from planar_chain_sim.recording.log_reader import read_log

BEGINNING = 3.0   # s that do not count: nodes find each other


def main():
    parser = ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--pages', type=int, default=10)
    options = parser.parse_args()
    print(' ' * 33 + 'ticks  dropped  lateness: median     p99  largest   CPU: node    view')
    print(' ' * 46 + 's                ms      ms       ms           %       %')
    for name, viewed, pages in (('no view', False, 0), ('view, no page', True, 0),
                                (f'{options.pages} pages and a hung one', True, options.pages)):
        with TemporaryDirectory() as folder:
            run(name, viewed, pages, options.seconds, Path(folder) / 'run.mcap')


def run(name, viewed, pages, seconds, path):
    """Run the node for so long and print a row."""
    begun = time.monotonic()
    node = subprocess.Popen([sys.executable, '-m', 'planar_chain_sim.ros.node', '--ros-args', '-p', f'record:={path}'],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    view = View('--port', '0') if viewed else None
    crowd = Process(target=look, args=(view.address, pages)) if pages else None
    if crowd:
        crowd.start()
    time.sleep(BEGINNING + seconds)
    if crowd:
        crowd.terminate()
    share = [ended(process) / (time.monotonic() - begun) for process in (node, *([view.popen] if view else []))]
    late, dropped = lateness(path)
    times = 1e3 * np.array([*np.quantile(late, (0.5, 0.99)), late.max()])
    print(f'{name:30}{len(late):8}{dropped:9g}{times[0]:18.2f}{times[1]:8.2f}{times[2]:9.2f}'
          f'{100 * share[0]:12.1f}' + ''.join(f'{100 * each:8.1f}' for each in share[1:]), flush=True)


def ended(process):
    """End a process as by Ctrl-C and return the CPU time that it has taken, s."""
    process.send_signal(signal.SIGINT)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_utime + usage.ru_stime


def look(address, count):
    """Be so many pages, until the end."""
    async def watch():
        async with Page(address) as page:
            while True:
                begun = time.monotonic()
                await page.frame()
                await asyncio.sleep(max(0.0, 1 / 60 - time.monotonic() + begun))

    async def hang():
        async with Page(address) as page:
            await page.until(lambda arm: True)
            await page.say('pull', body=page.scene[0]['bodies'][-1]['name'], point=[0.2, 0.0], to=[1.0, 1.0])
            await page.say('frame')
            await asyncio.sleep(1e6)

    async def everybody():
        await asyncio.gather(hang(), *(watch() for _ in range(count)))
    asyncio.run(everybody())


def lateness(path):
    """Return how late each tick was published, s, after the beginning, and the time that was dropped, s."""
    log = read_log(path)
    late, dropped, first = [], 0.0, None
    for message in log.messages:
        first = message.log_time if first is None else first
        if message.topic == log.settings['state_topic'] and message.log_time > first + BEGINNING * 1e9:
            late.append((message.log_time - decode_joint_state(message.data).stamp) * 1e-9)
        elif message.topic == log.settings['events_topic']:
            event = decode_event(message.data)
            dropped += event['data']['seconds'] if event['kind'] == 'dropped_time' else 0.0
    return np.array(late), dropped


if __name__ == '__main__':
    main()
