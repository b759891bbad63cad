"""
Push the tip of a damped pendulum sideways and let it come to rest: it then stands at tan(angle) = 2 F / (m g).

    python examples/wrench.py
"""
from math import atan2

import planar_chain_sim as pcs

CHAIN = """
name: pushed_pendulum
bodies:
  - {name: rod, carrier: base, angle: -pi/2, mass: 1.0, center_of_mass: [0.5, 0.0], inertia_com: 0.0833,
     rotation: {joint: rod_joint, damping: 1.0}}
  - {name: tip, carrier: rod, origin: [1.0, 0.0], mass: 0.0, inertia_com: 0.0}
"""
FORCE = 3.0     # N


def main():
    sim = pcs.Simulation(pcs.chain_from_text(CHAIN))
    sim.set_wrench('tip', force=[FORCE, 0.0], axes='world')      # at the tip's joint point, along x of the plane
    sim.advance(30_000)
    expected = atan2(2.0 * FORCE, 1.0 * 9.81)
    print(f'pushed with {FORCE} N: rests at {sim.position[0]:.9f} rad, expected {expected:.9f} rad')
    sim.clear_wrenches()
    sim.advance(30_000)
    print(f'let go: rests at {sim.position[0]:+.9f} rad')
    return sim.position[0], expected


if __name__ == '__main__':
    main()
