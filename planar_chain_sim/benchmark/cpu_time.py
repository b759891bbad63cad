"""CPU times of runs to compare, measured in turns, so that all runs have the same noise of the machine."""
from __future__ import annotations

from math import ceil
import sys
from time import process_time
from typing import Callable, Sequence

import numpy as np

LEAST = 2e-3    # s: a run that is shorter is repeated within one reading
FEWEST = 3      # readings of even the dearest run


def interleaved(runs: Sequence[Callable[[int], None]], rounds: int, what: str = 'timing',
                budget: float = 2.0) -> list[np.ndarray]:
    """
    Return CPU seconds of one repetition of each run, an array of readings per run.

    Each run is called with the number of repetitions, once per round. A run for which `rounds` readings would take more
    than `budget` s is left out of some rounds.
    """
    from tqdm import tqdm
    counts, turns = [], []
    for run in runs:
        count, once = _calibrated(run)
        counts.append(count)
        readings = max(min(rounds, FEWEST), min(rounds, int(budget / (once * count))))
        turns.append(set(np.linspace(0, rounds - 1, readings).round().astype(int)))
    times = [[] for _ in runs]
    for number in tqdm(range(rounds), desc=what, file=sys.stderr, leave=False, disable=None):
        for run, count, turn, readings in zip(runs, counts, turns, times):
            if number in turn:
                readings.append(_reading(run, count))
    return [np.array(readings) for readings in times]


def _calibrated(run: Callable[[int], None]) -> tuple[int, float]:
    """Return how many repetitions take LEAST s, and the CPU seconds of one; grown from 1, as first runs are cold."""
    run(1)
    count = 1
    while True:
        once = max(_reading(run, count), 1e-9)
        enough = ceil(LEAST / once)
        if enough <= 1.2 * count:
            return max(1, enough), once
        count = min(enough, 16 * count)


def _reading(run: Callable[[int], None], count: int) -> float:
    began = process_time()
    run(count)
    return (process_time() - began) / count
