"""
Lead a double pendulum along a swing, by PD control and by computed torque, and compare the errors.

    python examples/computed_torque.py
"""
import numpy as np

import planar_chain_sim as pcs

RATE, SWING = 2.0, 0.4                  # of the swing, rad/s, rad
STIFFNESS, DAMPING = 400.0, 40.0        # PD: N m/rad, N m s/rad; computed torque: 1/s^2, 1/s


def reference(start, time):
    """Return the wanted position, velocity and acceleration, (joints,)."""
    angle, ones = RATE * time, np.ones(len(start))
    return (start + SWING * (1.0 - np.cos(angle)), SWING * RATE * np.sin(angle) * ones,
            SWING * RATE**2 * np.cos(angle) * ones)


def main():
    chain = pcs.load_chain('double_pendulum.yaml')
    start = pcs.Simulation(chain).position

    def pd(time, position, velocity):
        wanted, rate, _ = reference(start, time)
        return STIFFNESS * (wanted - position) + DAMPING * (rate - velocity)

    def computed_torque(time, position, velocity):
        _, _, acceleration = reference(start, time)
        return pcs.inverse_dynamics(chain, position, velocity, acceleration + pd(time, position, velocity))

    errors = []
    for name, effort in (('PD', pd), ('computed torque', computed_torque)):
        run = pcs.rollout(chain, duration=5.0, effort=effort)
        wanted = np.array([reference(start, time)[0] for time in run.time])
        errors.append(np.abs(run.position - wanted).max())
        print(f'{name}: largest error {errors[-1]:.1e} rad, largest effort {np.abs(run.effort).max():.1f} N m')
    return errors


if __name__ == '__main__':
    main()
