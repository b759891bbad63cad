"""CPU time of one evaluation and of one RK4 step by number of links: compiled loops, peers in the same run."""
from __future__ import annotations

from typing import Callable, Iterator

import numpy as np

from .cpu_time import interleaved
from .peers.mujoco_peer import METHODS as MUJOCO_METHODS
from .problems import Problem, uniform_rods
from .work_precision import OWN, own_integration
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..mechanics.dynamics import FORMS
from ..mechanics.plan import plan_of

LINKS = (1, 2, 4, 8, 16, 32, 64, 128, 512)
COLUMNS = ('links', 'what', 'library', 'how', 'median, ns', 'min, ns', 'times ours: median', 'times ours: min')
ROUNDS = 21
STEP, STEPS = 1e-4, 64   # s; steps of one timed run


def own_evaluations(chain: Chain) -> dict[str, Callable[[int], None]]:
    """Return for `auto` and every compiled form a loop of evaluations, called with a count."""
    plan, (position, velocity) = plan_of(chain), initial_state(chain)
    zero = np.zeros(chain.joint_count)
    loops = {}
    for form in ('auto', *(form for form in FORMS if form not in ('auto', 'reference'))):
        resolved = getattr(plan, 'form', 'recursive') if form == 'auto' else form
        which = (resolved == 'dense',) if 'dense' in FORMS else ()
        loops[form] = lambda count, which=which: (
            plan.model.evaluate_repeatedly(position, velocity, zero, count, *which))
    return loops


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield rows of COLUMNS for each number of links: serial rods, bent, at rest, under gravity."""
    rounds = 2 if quick else ROUNDS
    for links in LINKS[:3] if quick else LINKS:
        chain = uniform_rods(links, bend=0.2)
        loops = {(OWN, how): loop for how, loop in own_evaluations(chain).items()}
        arrays = (*initial_state(chain), np.zeros(links))
        loops |= {(name, 'one evaluation'): peer.evaluation(chain, *arrays) for name, peer in peers.items()
                  if hasattr(peer, 'evaluation')}
        yield from _compared(links, 'evaluation', loops, (OWN, 'auto'), rounds, 1)

        duration = STEPS * STEP
        steps = {(OWN, 'rk4'): own_integration(Problem('', lambda: chain, duration, ((), ())), 'rk4', STEP, None)}
        if 'Pinocchio' in peers:
            steps['Pinocchio', 'odeint runge_kutta4'] = peers['Pinocchio'].integration(chain, 0, STEP, duration)
        if 'MuJoCo' in peers:
            steps |= {('MuJoCo', method): peers['MuJoCo'].integration(chain, method, STEP, duration)
                      for method in MUJOCO_METHODS}
        yield from _compared(links, 'step', {key: _repeat(run.go) for key, run in steps.items()}, (OWN, 'rk4'), rounds,
                             STEPS)


def _repeat(go: Callable[[], None]) -> Callable[[int], None]:
    def repeat(count):
        for _ in range(count):
            go()
    return repeat


def _compared(links: int, what: str, loops: dict, ours: tuple, rounds: int, per_run: int) -> Iterator[tuple]:
    """Time the loops in turns; rows in ns, with the ratio to ours."""
    times = interleaved(list(loops.values()), rounds, f'{links} links, {what}', budget=2.0)
    spread = {key: (np.median(seconds) / per_run * 1e9, seconds.min() / per_run * 1e9)
              for key, seconds in zip(loops, times)}
    middle, low = spread[ours]
    for (library, how), (median, least) in spread.items():
        yield links, what, library, how, median, least, median / middle, least / low


def draw(table: list[tuple], path) -> None:
    """Draw ns per evaluation against links."""
    from .charts import Chart
    chart = Chart(1, 'one evaluation of forward dynamics, compiled loop, one core')
    lines = dict.fromkeys((row[2], row[3]) for row in table if row[1] == 'evaluation')
    for library, how in lines:
        points = [(row[0], row[4]) for row in table if row[1] == 'evaluation' and row[2:4] == (library, how)]
        label = f'{library}, {how}' if library == OWN else library
        chart.line(0, points, library, label, bold=how in ('auto', 'one evaluation'))
    chart.axes(0, '', 'links', 'CPU time per evaluation, ns (median)')
    chart.save(path)
