"""
10,000 double pendulums at once, from starts that differ by up to a millionth of a radian: how chaos spreads them.

    python examples/ten_thousand_arms.py
"""
from time import perf_counter

import numpy as np

import planar_chain_sim as pcs


def main(arms=10_000):
    chain = pcs.load_chain('double_pendulum.yaml')
    start = pcs.Simulation(chain).position + np.linspace(-1e-6, 1e-6, arms)[:, None]
    begin = perf_counter()
    position, velocity = start, None
    for second in range(1, 11):
        batch = pcs.rollout_batch(chain, position, velocity, duration=1.0, step=0.01, every_tick=False)
        position, velocity = batch.position[:, -1], batch.velocity[:, -1]
        print(f'{second:2} s: the angles of the upper rod lie within {np.ptp(position[:, 0]):.1e} rad')
    print(f'{arms} arms, 10 s each, in {perf_counter() - begin:.1f} s; {len(batch.failures)} failed')
    return position


if __name__ == '__main__':
    main()
