"""The executable `simulator`: a process and a ROS node around the Simulator that does the work."""
from __future__ import annotations

from contextlib import ExitStack
import gc
import sys

from .process import run_until_stopped, start_node

DESCRIPTION = """\
A planar chain of rigid bodies, simulated in real time as a ROS 2 node.

It publishes joint_states, takes efforts on ~/commands (joint order) and ~/joint_commands (by name), and answers
~/reset, ~/pause and ~/step. `ros2 param describe /simulator NAME` explains a parameter.
SIGINT and SIGTERM end it with exit code 0; a mistake is told in one sentence, exit code 2."""
EXAMPLE = 'simulator --ros-args -p chain_file:=seven_link_arm.yaml -p record:=run.mcap -r __ns:=/arm'

SWITCH_INTERVAL = 1e-4  # s; at Python's usual 5 ms the log's thread or a service could hold a tick up for that long


def main(arguments=None) -> int:
    """Run the executable: the handlers of SIGINT and SIGTERM first, nothing heavy is imported before."""
    return run_until_stopped('simulator', simulate, arguments)


def simulate(own_arguments, ros_arguments, stop) -> None:
    """Simulate until something is put into `stop`. Mistake: arguments, parameters, chain, method or log are no good."""
    from ..command_line import Mistake, Parser
    Parser('simulator', DESCRIPTION, EXAMPLE).parse_args(own_arguments)
    gc.disable()  # until all is loaded: nothing of it is garbage
    with ExitStack() as ending:  # ends in reverse order, so that nobody is asked who has gone already
        node = start_node('simulator', ros_arguments, ending)
        from .services import ServiceThread

        sys.setswitchinterval(SWITCH_INTERVAL)
        simulator, log = start_simulator(node, ending, stop.put)
        services = ServiceThread(node, simulator, stop.put)
        services.start()
        ending.callback(services.stop)
        gc.freeze()  # what is here now stays: a collection that went through all of it would hold up a tick
        gc.enable()
        reason = stop.get()
    if log and log.error:
        raise Mistake(str(log.error))
    if reason is not None:
        raise reason


def start_simulator(node, ending, done):
    """Return a running Simulator and its log (or None), as the node's parameters want them."""
    from .messages import create_polled_subscription, create_publisher, INPUTS, OUTPUTS
    from .parameters import declare_chain_parameters, declare_parameters, let_set

    values = declare_parameters(node)
    # Topics first: while the chain is read, the others on the network find them.
    publishers = {key: create_publisher(node, topic) for key, topic in OUTPUTS.items()
                  if not topic.option or values[topic.option]}
    inputs = {key: create_polled_subscription(node, topic) for key, topic in INPUTS.items()}

    chain = load(values)
    values.update(declare_chain_parameters(node, chain))
    simulation = create_simulation(chain, values)
    log = None
    if values['record']:
        from .recorder import open_log
        log = open_log(simulation, values, publishers, inputs)
        ending.callback(log.close)
    simulator = simulator_class(values)(simulation, values, publishers, inputs, node.context, log, node.get_logger(),
                                        done)
    simulator.start()
    ending.callback(simulator.stop)
    let_set(node, chain, lambda name, value: simulator.ask('set_parameter', name, value))
    node.get_logger().info(f'running {chain.name} at {values["rate"]:g} Hz, joints {", ".join(chain.joint_names)}; '
                           f'{simulation.plan}')
    return simulator, log


def simulator_class(values):
    """Return the kind of Simulator that the parameter `lockstep` wants."""
    if values['lockstep']:
        from .lockstep import LockstepSimulator
        return LockstepSimulator
    from .simulator import Simulator
    return Simulator


def load(values):
    """Return the chain of the parameter `chain_file`; Mistake where there can't be one."""
    from ..chain import ChainError
    from ..chain_yaml import load_chain
    from ..command_line import Mistake
    try:
        return load_chain(values['chain_file'])
    except ChainError as error:
        raise Mistake(str(error)) from None


def create_simulation(chain, values):
    """Return the Simulation of the chain and the parameters; Mistake where there can't be one."""
    from ..changes import changed_chain, QUANTITIES
    from ..command_line import Mistake
    from ..simulation import Simulation
    try:
        for name in QUANTITIES:
            if name in values:
                chain = changed_chain(chain, name, values[name])
        return Simulation(chain, method=values['method'], step=1.0 / values['rate'],
                          tolerance=values['tolerance'] or None)
    except ValueError as error:
        raise Mistake(str(error)) from None


if __name__ == '__main__':
    sys.exit(main())
