"""Chains for tests: random trees of every body kind, and a single joint."""
import numpy as np

from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import BASE, Body, Joint

KINDS = ('turning', 'sliding and turning', 'sliding', 'welded')


def random_joint(random, name, kind, armature, axis=None):
    """Return a joint with damping and a spring now and then, and a rotor if asked for."""
    if axis is None:
        axis = random.choice([-1.0, 1.0]) if kind == 'rotation' else random.uniform(-3.0, 3.0)
    return Joint(name, kind, float(axis),
                 damping=float(random.choice([0.0, random.uniform(0.01, 1.0)])),
                 stiffness=float(random.choice([0.0, random.uniform(0.1, 5.0)])), rest=float(random.normal()),
                 armature=float(random.choice([0.0, random.uniform(0.01, 0.5)])) if armature else 0.0)


def random_tree(seed, bodies, kinds=KINDS, armature=True):
    """Return a tree with branches, several of them on the base, general offsets and angles; solvable everywhere."""
    random = np.random.default_rng(seed)
    made = []
    for i in range(bodies):
        kind = 'turning' if i == 0 else random.choice(kinds)
        mass, center = random.uniform(0.2, 2.0), complex(*random.normal(0.0, 0.3, 2))
        inertia_com = random.uniform(0.01, 0.3)
        made.append(Body(
            f'body{i}', int(random.integers(max(BASE, i - 4), i)) if i else BASE, complex(*random.normal(0.0, 0.5, 2)),
            float(random.choice([0.0, random.uniform(-3.0, 3.0)])), float(mass), center,
            float(inertia_com + mass * abs(center)**2), float(inertia_com),
            random_joint(random, f'slide{i}', 'slide', armature) if 'sliding' in kind else None,
            random_joint(random, f'turn{i}', 'rotation', armature) if 'turning' in kind else None))
    return Chain(f'tree{seed}', complex(*random.normal(0.0, 9.0, 2)), tuple(made))


def random_state(chain, seed):
    """Position, velocity, effort, (joints,) each."""
    return np.random.default_rng(seed).normal(0.0, 1.5, (3, chain.joint_count))


def one_joint(kind='rotation', mass=2.0, inertia=0.5, gravity=0j, **laws):
    """Return a single body whose joint obeys inertia * q'' = effort - laws, in closed form."""
    joint = Joint('joint', kind, 1.0 if kind == 'rotation' else 0.0, **laws)
    sliding = kind == 'slide'
    return Chain('one', gravity, (Body('body', -1, 0j, 0.0, mass, 0j, inertia, inertia, joint if sliding else None,
                                       None if sliding else joint),))
