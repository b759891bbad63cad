"""
Swing an acrobot up and balance it: a double pendulum with a motor in its elbow alone.

Far from the top the elbow pumps energy (M. W. Spong, The swing up control problem for the acrobot, 1995); near the top
an LQR catches the arm.

    python examples/acrobot_swing_up.py
"""
from lqr_balance import lqr
import numpy as np

import planar_chain_sim as pcs

UPRIGHT, REST = np.array([np.pi, 0.0]), np.zeros(2)
STIFFNESS, DAMPING, PUMPING = 8.0, 6.0, 3.0     # of the elbow while it pumps: 1/s^2, 1/s, 1/(J s)
CATCH, LOSE = 20.0, 1000.0                      # cost to go x'Sx: the LQR takes over below, gives up above


def from_upright(position):
    """Return the way from the upright position, rad, less whole turns."""
    way = position - UPRIGHT
    return way - 2.0 * np.pi * np.round(way / (2.0 * np.pi))


def main():
    chain = pcs.load_chain('double_pendulum.yaml').with_parameters({
        'upper_joint.position': 0.0, 'lower_joint.position': 0.01, 'lower_joint.effort_limit': 25.0})
    A, B = pcs.linearize(chain, UPRIGHT, REST, REST)
    K, S = lqr(A, B[:, 1:], np.diag([10.0, 10.0, 1.0, 1.0]), np.eye(1))
    top = sum(pcs.energy(chain, UPRIGHT, REST))
    caught = []     # time of the last catch, while the LQR acts

    def effort(time, position, velocity):
        x = np.concatenate([from_upright(position), velocity])
        if x @ S @ x < (LOSE if caught else CATCH):
            if not caught:
                caught.append(time)
            return [0.0, (-K @ x)[0]]
        caught.clear()
        missing = top - sum(pcs.energy(chain, position, velocity))
        elbow = -STIFFNESS * x[1] - DAMPING * velocity[1] - PUMPING * missing * velocity[0]    # wanted, rad/s^2
        H = pcs.mass_matrix(chain, position)
        rest = pcs.inverse_dynamics(chain, position, velocity, REST)     # gravity and velocity terms
        shoulder = -(H[0, 1] * elbow + rest[0]) / H[0, 0]                # nothing drives it, so this follows
        return [0.0, H[1] @ [shoulder, elbow] + rest[1]]

    run = pcs.rollout(chain, duration=20.0, effort=effort)
    error = np.abs(from_upright(run.position[-1])).max()
    print(f'hung 0.01 rad off at the start; caught near the top at {caught[0] if caught else float("nan"):.2f} s')
    print(f'largest effort of the elbow: {np.abs(run.effort).max():.1f} N m')
    print(f'largest error after 20 s: {error:.1e} rad')
    return error


if __name__ == '__main__':
    main()
