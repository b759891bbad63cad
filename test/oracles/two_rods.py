"""A small chain file and a small body to make mistakes in."""

TWO_RODS = """\
name: two_rods
gravity: [0, -9.81]
bodies:
  - name: upper
    carrier: base
    mass: 1.0
    center_of_mass: [0.5, 0.0]
    inertia: 0.4
    rotation:
      joint: shoulder
      axis: 1
  - name: forearm
    carrier: upper
    mass: 2.0
    center_of_mass: [0.3, 0.4]
    inertia_com: 0.1
    slide:
      joint: boom
      axis: 0.5
    rotation:
      joint: elbow
"""


def rod(**changes):
    """One good body as data, with changes; a change to None takes the key away."""
    body = {'name': 'rod', 'carrier': 'base', 'mass': 1.0, 'inertia': 1.0, 'rotation': {'joint': 'pivot'}, **changes}
    return {key: value for key, value in body.items() if value is not None}
