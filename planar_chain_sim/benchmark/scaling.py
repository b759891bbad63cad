"""How a serial chain scales to thousands of links: evaluation, time to load its file, memory of a process with it."""
from __future__ import annotations

from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import Iterator

import numpy as np

from .cpu_time import interleaved
from .problems import uniform_rods
from .step_time import own_evaluations
from .work_precision import OWN
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..errors import Mistake

LINKS = (16, 32, 64, 128, 256, 512, 1024, 2048, 4096)
MOST_OF_PEERS = 512    # Pinocchio needs gigabytes beyond, MuJoCo refuses the model
COLUMNS = ('links', 'library', 'how', 'evaluation, ns: median', 'evaluation, ns: min', 'per link, ns: median',
           'per link, ns: min', 'load, s: median', 'load, s: min', 'memory, MiB')
ROUNDS, LOADS = 15, 5

# A fresh interpreter loads the file once: CPU time of it, and the memory that it and a simulation took. The peak is its
# own (getrusage would give the parent's where that is larger).
_LOAD = """
import sys, time
import numpy, yaml, planar_chain_sim as pcs
pcs.load_chain, pcs.Simulation
def peak():
    with open('/proc/self/status') as status:
        return next(int(line.split()[1]) for line in status if line.startswith('VmHWM')) / 1024.0
before, began = peak(), time.process_time()
simulation = pcs.Simulation(pcs.load_chain(sys.argv[1]))
loaded = time.process_time() - began
simulation.advance(1)
print(loaded, peak() - before)
"""


def chain_text(chain: Chain) -> str:
    """Return a chain of turning bodies as the text of a chain file."""
    lines = [f'name: {chain.name!r}', f'gravity: [{chain.gravity.real!r}, {chain.gravity.imag!r}]', 'bodies:']
    for body in chain.bodies:
        carrier = chain.bodies[body.carrier].name if body.carrier >= 0 else 'base'
        lines += [f'  - name: {body.name}', f'    carrier: {carrier}', f'    origin: [{body.origin.real!r}, 0.0]',
                  f'    mass: {body.mass!r}', f'    center_of_mass: [{body.center_of_mass.real!r}, 0.0]',
                  f'    inertia: {body.inertia!r}', '    rotation:', f'      joint: {body.rotation.name}',
                  f'      position: {body.rotation.position!r}']
    return '\n'.join(lines) + '\n'


def _loads(chain: Chain, count: int) -> tuple[float, float, float]:
    """Return median and minimum of the CPU time to load, s, and the largest memory, MiB, of `count` processes."""
    with TemporaryDirectory() as folder:
        file = Path(folder, 'chain.yaml')
        file.write_text(chain_text(chain))
        results = []
        for _ in range(count):
            run = subprocess.run([sys.executable, '-c', _LOAD, str(file)], capture_output=True, text=True)
            if run.returncode:
                raise Mistake(f'{len(chain.bodies)} links cannot be loaded: {run.stderr.strip().splitlines()[-1]}')
            results.append([float(word) for word in run.stdout.split()])
    seconds, memory = np.array(results).T
    return np.median(seconds), seconds.min(), memory.max()


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield rows of COLUMNS for each number of links."""
    for links in LINKS[:2] if quick else LINKS:
        chain = uniform_rods(links, bend=0.2)
        loops = {(OWN, how): loop for how, loop in own_evaluations(chain).items()}
        if links <= MOST_OF_PEERS:
            arrays = (*initial_state(chain), np.zeros(links))
            loops |= {(name, ''): peer.evaluation(chain, *arrays) for name, peer in peers.items()
                      if hasattr(peer, 'evaluation')}
        times = interleaved(list(loops.values()), 2 if quick else ROUNDS, f'{links} links', budget=2.0)
        for ((library, how), seconds) in zip(loops, times):
            middle, low = np.median(seconds) * 1e9, seconds.min() * 1e9
            load = _loads(chain, 1 if quick else LOADS) if (library, how) == (OWN, 'auto') else (None, None, None)
            yield links, library, how, middle, low, middle / links, low / links, *load


def draw(table: list[tuple], path) -> None:
    """Draw ns per link against links, and load time against links."""
    from .charts import Chart
    chart = Chart(2, 'serial chains of uniform rods, one core')
    for library, how in dict.fromkeys((row[1], row[2]) for row in table):
        points = [(row[0], row[5]) for row in table if row[1:3] == (library, how)]
        chart.line(0, points, library, library, bold=how in ('auto', ''))
    chart.axes(0, 'one evaluation', 'links', 'CPU time per link, ns (median)')
    loads = [(row[0], row[7]) for row in table if row[7] is not None]
    chart.line(1, loads, OWN, OWN)
    chart.axes(1, 'loading the chain file', 'links', 'CPU time, s (median)')
    chart.save(path)
