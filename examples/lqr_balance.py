"""
Balance a double pendulum upright on a cart that is pushed: LQR from the exact derivatives of `linearize`.

    python examples/lqr_balance.py
"""
import numpy as np

import planar_chain_sim as pcs

CHAIN = """
name: double_pendulum_on_a_cart
bodies:
  - {name: cart, carrier: base, mass: 1.0, inertia_com: 0.1, slide: {joint: cart_slide, axis: 0.0, effort_limit: 60.0}}
  - {name: lower_rod, carrier: cart, angle: pi/2, mass: 0.3, center_of_mass: [0.25, 0.0], inertia: 0.025,
     rotation: {joint: lower_joint}}
  - {name: upper_rod, carrier: lower_rod, origin: [0.5, 0.0], mass: 0.2, center_of_mass: [0.2, 0.0], inertia: 0.0107,
     rotation: {joint: upper_joint}}
"""


def lqr(A, B, Q, R):
    """Return the gain K of u = -K x that minimises the integral of x'Qx + u'Ru, and S of the cost x'Sx to go."""
    n = len(A)
    values, vectors = np.linalg.eig(np.block([[A, -B @ np.linalg.inv(R) @ B.T], [-Q, -A.T]]))
    stable = vectors[:, values.real < 0]
    S = np.real(stable[n:] @ np.linalg.inv(stable[:n]))
    return np.linalg.solve(R, B.T @ S), S


def main():
    chain = pcs.chain_from_text(CHAIN)
    upright = np.zeros(3)
    A, B = pcs.linearize(chain, upright, upright, upright)
    K, _ = lqr(A, B[:, :1], np.diag([10.0, 10.0, 10.0, 1.0, 1.0, 1.0]), np.array([[0.1]]))
    poles = np.linalg.eigvals(A - B[:, :1] @ K)
    print(f'slowest pole without control {max(np.linalg.eigvals(A).real):+.2f} 1/s, with it {max(poles.real):+.2f} 1/s')

    def effort(time, position, velocity):
        return [(-K @ np.concatenate([position, velocity]))[0], 0.0, 0.0]     # the cart alone is pushed

    run = pcs.rollout(chain, duration=10.0, position=[0.0, 0.10, -0.05], effort=effort)
    error = np.abs(run.position).max(axis=1)
    print(f'started {error[0]:.2f} rad off, pushed with at most {np.abs(run.effort).max():.1f} N')
    print(f'largest error after 10 s: {error[-1]:.1e} rad or m')
    return error[-1]


if __name__ == '__main__':
    main()
