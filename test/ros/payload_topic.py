"""
The simulator with one more topic that changes the run: a row of INPUTS with its reader, and nothing else.

    python payload_topic.py --ros-args ...

A Float64MultiArray [mass, x, y] on ~/payload attaches a payload to the last body.
"""
import sys

from planar_chain_sim.ros.commands import Change
from planar_chain_sim.ros.messages import INPUTS, Topic


class PayloadReader:
    """Reads payloads for the last body of a chain."""

    def __init__(self, chain):
        self._body = chain.bodies[-1].name

    def read(self, message):
        """Return the event for a decoded message."""
        mass, x, y = message['effort']
        return Change('payload', 'load', {'name': 'load', 'body': self._body, 'mass': mass, 'position': [x, y],
                                          'inertia_com': 0.0})


if __name__ == '__main__':
    INPUTS['payload'] = Topic('~/payload', 'std_msgs/msg/Float64MultiArray', 64, reader=PayloadReader)
    from planar_chain_sim.ros.node import main
    sys.exit(main())
