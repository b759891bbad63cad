"""
Read a log and say how each joint moved and how much energy the motion lost.

    rollout four_link_robot.yaml --duration 5 --output robot.mcap
    python examples/read_log.py robot.mcap
"""
from argparse import ArgumentParser

import planar_chain_sim as pcs


def main(path):
    log = pcs.load_log(path)
    if not len(log.time):
        raise pcs.LogError(f'log {path!r}: it holds no states')
    print(f'{log.chain.name}: {len(log.time)} states until {log.time[-1]:g} s, {len(log.events)} events')
    for k, name in enumerate(log.chain.joint_names):
        print(f'{name}: from {log.position[:, k].min():.3f} to {log.position[:, k].max():.3f}, '
              f'fastest {abs(log.velocity[:, k]).max():.2f}, '
              f'largest effort {abs(log.effort[:, k]).max(initial=0.0):.2f}')
    energy = sum(pcs.energy(log.chain, log.position, log.velocity))
    print(f'energy: {energy[0]:.3f} J at the start, {energy[-1]:.3f} J at the end')
    return energy


if __name__ == '__main__':
    parser = ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('log', help='an MCAP file of simulator, rollout or OfflineLog')
    try:
        main(parser.parse_args().log)
    except pcs.LogError as mistake:
        parser.error(str(mistake))
