"""Many states at once: evaluations and RK4 steps per core-second; heyoka's compiled function, MuJoCo's rollout."""
from __future__ import annotations

from typing import Callable, Iterator

import numpy as np

import planar_chain_sim as pcs

from .cpu_time import interleaved
from .problems import uniform_rods
from .work_precision import OWN
from .. import _kernel
from ..chain.chain import Chain
from ..mechanics.plan import plan_of

LINKS, STATES = (2, 4, 8, 16), 4096
COLUMNS = ('links', 'what', 'library', 'how', 'per state: median, ns', 'min, ns', 'per core-second: median',
           'times ours: median', 'times ours: min')
ROUNDS = 21
STEP, STEPS = 1e-3, 20


def own_evaluation(chain: Chain, position, velocity, effort) -> Callable[[int], None]:
    """Return a loop over all states (states, joints), put side by side before, as heyoka is given them."""
    plan = plan_of(chain)
    return _kernel.StateBatch(plan.model, position, velocity, effort, plan.form == 'dense').evaluate


def own_rollout(chain: Chain, position, velocity, threads: int) -> Callable[[int], None]:
    """Return a loop of RK4 roll-outs of all states on so many threads."""
    def roll(count):
        for _ in range(count):
            pcs.rollout_batch(chain, position, velocity, None, duration=STEPS * STEP, step=STEP, method='rk4',
                              threads=threads)
    return roll


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield rows of COLUMNS for each number of links: serial rods in random states."""
    rounds, states = (2, 64) if quick else (ROUNDS, STATES)
    for links in LINKS[:1] if quick else LINKS:
        chain = uniform_rods(links)
        position, velocity, effort = np.random.default_rng(1).normal(size=(3, states, links))
        loops = {(OWN, 'many states in lanes'): own_evaluation(chain, position, velocity, effort)}
        if 'heyoka' in peers:
            for formulation in peers['heyoka'].formulations(chain):
                for fast in (False, True):
                    how = f'compiled function, {formulation.partition(", ")[2]}{", fast-math" * fast}'
                    loops['heyoka', how], _ = peers['heyoka'].batch_evaluation(
                        chain, formulation, position, velocity, effort, fast)
        yield from _compared(links, 'evaluation', loops, rounds, states)
        loops = {(OWN, f'rollout_batch, {n} thread{"s" * (n > 1)}'): own_rollout(chain, position, velocity, n)
                 for n in (1, 2)}
        if 'MuJoCo' in peers:
            loops |= {('MuJoCo', f'rollout, {method}, {max(1, n)} thread{"s" * (n > 1)}'):
                      peers['MuJoCo'].rollout(chain, method, position, velocity, STEP, STEPS, n)[0]
                      for method, n in (('RK4', 0), ('RK4', 2), ('Euler', 0))}
        yield from _compared(links, 'step', loops, rounds, states * STEPS)


def _compared(links: int, what: str, loops: dict, rounds: int, per_run: int) -> Iterator[tuple]:
    """Time the loops in turns; rows with the ratio to ours, which is the first."""
    times = interleaved(list(loops.values()), rounds, f'{links} links, {what}', budget=2.0)
    spread = {key: (np.median(seconds) / per_run * 1e9, seconds.min() / per_run * 1e9)
              for key, seconds in zip(loops, times)}
    middle, low = next(iter(spread.values()))
    for (library, how), (median, least) in spread.items():
        yield links, what, library, how, median, least, 1e9 / median, median / middle, least / low


def draw(table: list[tuple], path) -> None:
    """Draw time per state against links, evaluations and steps."""
    from .charts import Chart
    chart = Chart(2, f'{STATES} states at once, CPU time per state')
    for panel, what in enumerate(('evaluation', 'step')):
        here = [row for row in table if row[1] == what]
        for library in dict.fromkeys(row[2] for row in here):
            hows = list(dict.fromkeys(row[3] for row in here if row[2] == library))
            for how in hows:
                points = [(row[0], row[4]) for row in here if row[2:4] == (library, how)]
                chart.line(panel, points, library, library, bold=how == hows[0])
        chart.axes(panel, {'evaluation': 'one evaluation', 'step': 'one step'}[what], 'links', 'ns (median)')
    chart.save(path)
