"""A picture shows the chain's own points."""
import numpy as np
from oracles.random_trees import random_tree

import planar_chain_sim as pcs
from planar_chain_sim.mechanics.body_lines import body_lines


def test_lines_of_a_tree_keep_the_lengths_of_its_bodies():
    """A body without a slide stands where its carrier has its origin, a leaf ends behind its mass centre."""
    for seed in range(10):
        chain = random_tree(seed, bodies=9)
        lines = body_lines(chain, np.random.default_rng(seed).normal(size=chain.joint_count))
        carriers = {body.carrier for body in chain.bodies}
        for i, body in enumerate(chain.bodies):
            start = lines[i][0][0]
            joint_point = lines[body.carrier][0][0] if body.carrier >= 0 else 0j
            if body.slide is None:
                assert np.isclose(abs(start - joint_point), abs(body.origin), rtol=1e-12)
            if i not in carriers:
                assert np.isclose(abs(lines[i][0][1] - start), 2 * abs(body.center_of_mass), rtol=1e-12)


def test_points_of_the_double_pendulum():
    chain = pcs.load_chain('double_pendulum.yaml')
    position = np.array([joint.position for joint in chain.joints])
    first, second = body_lines(chain, position)
    # absolute angles 2.0 and 2.5 rad from straight down, 1 m rods
    elbow, tip = (np.exp(1j * (angle - np.pi / 2)) for angle in (2.0, 2.5))
    assert np.allclose([first[0][1], second[0][0], second[0][1]], [elbow, elbow, elbow + tip], rtol=0, atol=1e-14)
