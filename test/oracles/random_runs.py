"""Random runs for tests: commands, resets, set states, wrenches, payloads and parameters at random ticks."""
import planar_chain_sim as pcs

from .random_trees import random_state

NOTHING = 'no change'   # of a plan


def random_plan(random, rng, chain, ticks=120):
    """Return [(tick, kind, data)] in order, where 'effort' sets efforts, and the first is at tick 0."""
    plan, names = [(0, 'effort', rng.normal(size=chain.joint_count))], [body.name for body in chain.bodies]
    for tick in sorted(random.sample(range(1, ticks), random.randrange(1, 7))):
        kind = random.choice(['effort', 'reset', 'state', 'wrench', 'payload', 'gravity', 'damping'])
        position, velocity, effort = random_state(chain, random.randrange(1000))
        plan.append((tick, *{
            'effort': ('effort', effort), 'reset': ('reset', {}),
            'state': ('state', {'position': position, 'velocity': velocity}),
            'wrench': ('wrench', {'body': random.choice(names), 'force': rng.normal(size=2), 'moment': 0.3}),
            'payload': ('payload', {'name': 'load', 'body': names[-1], 'mass': random.choice([0.0, 0.4]),
                                    'position': [0.1, 0.0]}),
            'gravity': ('parameter', {'name': 'gravity', 'value': rng.normal(size=2)}),
            'damping': ('parameter', {'name': 'damping', 'value': rng.uniform(size=chain.joint_count)})}[kind]))
    return [*plan, (ticks, NOTHING, {})]


def write_plan(path, simulation, plan):
    """Log a plan; return the path."""
    start, effort = simulation.tick, None
    with pcs.OfflineLog(path, simulation) as log:
        for tick, kind, data in plan:
            log.advance(start + tick - simulation.tick, effort)
            if kind == 'effort':
                effort = data
            elif kind != NOTHING:
                log.change(kind, **data)
                effort = None if kind == 'reset' else effort
    return path
