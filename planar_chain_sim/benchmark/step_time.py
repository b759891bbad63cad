"""What one evaluation and one tick cost, against the number of links: compiled loops, CPU time of this process."""
from __future__ import annotations

from time import process_time
from typing import Callable, Iterator

import numpy as np

from .problems import uniform_rods
from ..plan import plan_of
from ..simulation import Simulation

LINKS = (1, 4, 7, 32, 1024, 4096)
COLUMNS = ('links', 'evaluation, ns: min', 'median', 'per link: min', 'median', 'RK4 tick, ns: min', 'median')
REPEATS = 31


def _repeat(run: Callable[[int], None], count: int) -> np.ndarray:
    """CPU time of one of `count` runs in ns, (REPEATS,), after one repetition to warm up."""
    times = []
    for _ in range(REPEATS + 1):
        began = process_time()
        run(count)
        times.append((process_time() - began) / count * 1e9)
    return np.array(times[1:])


def step_times() -> Iterator[tuple]:
    """Yield a row of COLUMNS for each number of links: serial rods, bent, at rest, under gravity."""
    for links in LINKS:
        chain = uniform_rods(links)
        position, zero = 0.2 * np.sin(np.arange(links)), np.zeros(links)
        simulation = Simulation(chain, 'rk4', 1e-4)

        def tick(count, simulation=simulation, position=position, zero=zero):
            simulation.set_state(position, zero)
            simulation.advance(count)

        model, count = plan_of(chain).model, max(4, 200_000 // links)
        evaluation = _repeat(lambda count: model.evaluate_repeatedly(position, zero, zero, count), count)
        ticks = _repeat(tick, max(2, count // 4))
        low, middle = evaluation.min(), np.median(evaluation)
        yield links, low, middle, low / links, middle / links, ticks.min(), np.median(ticks)
