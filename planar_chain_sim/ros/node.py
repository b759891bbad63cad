"""The executable `simulator`: a process and a ROS node around the Simulator that does the work."""
from __future__ import annotations

from contextlib import ExitStack
import gc
import sys
import warnings

from .process import run_until_stopped, start_node, wait_for

DESCRIPTION = """\
A planar chain of rigid bodies, simulated in real time as a ROS 2 node.

It publishes joint_states, takes efforts on ~/commands (joint order) and ~/joint_commands (by name), and answers
~/reset, ~/pause and ~/step. `ros2 param describe /simulator NAME` explains a parameter.
SIGINT and SIGTERM end it with exit code 0; a mistake is told in one sentence, exit code 2."""
EXAMPLE = 'simulator --ros-args -p chain_file:=seven_link_arm.yaml -p record:=run.mcap -r __ns:=/arm'

SWITCH_INTERVAL = 1e-4  # s; at Python's usual 5 ms the log's thread or a service could hold a tick up for that long
ON_TOPIC = 'robot_description'  # a chain file of this name is the text that comes on the topic


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
        # Of a step that is too long, at the start or while it runs.
        warnings.showwarning = lambda message, *_: node.get_logger().warning(str(message))
        started = start_simulator(node, ending, stop)
        if not started:
            return
        simulator, simulation, urdf, values, log = started
        serve(node, ending, stop, simulator, simulation.chain, urdf, values, log)
        gc.freeze()  # what is here now stays: a collection that went through all of it would hold up a tick
        gc.enable()
        reason = wait_for(stop)
    if log and log.error:
        raise Mistake(str(log.error))
    if reason is not None:
        raise reason


def start_simulator(node, ending, stop):
    """Return a running Simulator, its simulation, its URDF or None, parameters, log or None; None after a stop."""
    from .messages import create_polled_subscription, create_publisher, INPUTS, OUTPUTS
    from .parameters import declare_chain_parameters, declare_parameters

    values = declare_parameters(node)
    tell_of_clocks(node, values)
    # Topics first: while the chain is read, the others on the network find them.
    publishers = {key: create_publisher(node, topic) for key, topic in OUTPUTS.items()
                  if not topic.option or values[topic.option]}
    inputs = {key: create_polled_subscription(node, topic) for key, topic in INPUTS.items()}

    chain, urdf = load(node, values, stop)
    if chain is None:
        return None
    values.update(declare_chain_parameters(node, chain))
    simulation = create_simulation(chain, values)
    log = None
    if values['record']:
        from .recorder import open_log
        log = open_log(simulation, values, publishers, inputs)
        ending.callback(log.close)
    simulator = simulator_class(values)(simulation, values, publishers, inputs, node.context, log, node.get_logger(),
                                        stop.put)
    sys.setswitchinterval(SWITCH_INTERVAL)
    simulator.start()
    ending.callback(simulator.stop)
    node.get_logger().info(f'running {chain.name} at {values["rate"]:g} Hz, joints {", ".join(chain.joint_names)}; '
                           f'{simulation.plan}')
    return simulator, simulation, urdf, values, log


def serve(node, ending, stop, simulator, chain, urdf, values, log) -> None:
    """Start answering and publishing what no tick waits for: services, parameters, diagnostics, URDF, markers."""
    from .diagnostics import Diagnostics, PERIOD
    from .messages import create_publisher, SIDE_OUTPUTS
    from .parameters import let_set
    from .services import ServiceThread

    services = ServiceThread(node, simulator, stop.put)
    publishers = {key: create_publisher(node, topic) for key, topic in SIDE_OUTPUTS.items()
                  if (not topic.option or values[topic.option])
                  and not (key == 'description' and values['chain_file'] == ON_TOPIC)}
    if 'description' in publishers:
        from std_msgs.msg import String
        from ..urdf_writer import urdf_of
        publishers['description'].publish(String(data=urdf or urdf_of(chain)))
    let_set(node, chain, lambda name, value: simulator.ask('set_parameter', name, value))
    services.every(PERIOD, Diagnostics(node.get_name(), simulator, publishers['diagnostics'], values, log,
                                       chain.name).report)
    if 'markers' in publishers:
        from .markers import marker_array, PERIOD as MARKER_PERIOD
        frame_id = values['frame_id'] or 'world'
        services.every(MARKER_PERIOD, lambda: publishers['markers'].publish(
            marker_array(chain, *simulator.seen, frame_id)))
    services.start()
    ending.callback(services.stop)
    ending.callback(simulator.halt)   # first of all: a service must not wait for a tick that takes long


def tell_of_clocks(node, values) -> None:
    """
    Say what use_sim_time means here, once.

    Ticks are counted on the steady clock and nothing here waits for /clock. A subscription to it would only cost, of
    our own time a thousand messages a second.
    """
    if not node.get_parameter('use_sim_time').value:
        return
    node._time_source.detach_node()
    if values['publish_clock']:
        node.get_logger().info('use_sim_time is set and this node is the clock')
    else:
        node.get_logger().warning('use_sim_time is set, but this node keeps wall time and stamps with it; '
                                  'publish_clock:=true makes it the clock')


def simulator_class(values):
    """Return the kind of Simulator that the parameter `lockstep` wants."""
    if values['lockstep']:
        from .lockstep import LockstepSimulator
        return LockstepSimulator
    from .simulator import Simulator
    return Simulator


def load(node, values, stop):
    """Return the chain of `chain_file` and its URDF if it is one, both None after a stop; Mistake: no such chain."""
    from ..chain import ChainError
    from ..chain_yaml import chain_from_text, find_chain_file, load_chain
    from ..command_line import Mistake
    try:
        if values['chain_file'] == ON_TOPIC:
            from .description import await_description
            text = await_description(node, stop)
            return (None, None) if text is None else (chain_from_text(text, ON_TOPIC), text)
        chain = load_chain(values['chain_file'])
        text = find_chain_file(values['chain_file']).read_text('utf-8-sig')
        return chain, text if text.lstrip().startswith('<') else None
    except ChainError as error:
        raise Mistake(str(error)) from None


def create_simulation(chain, values):
    """Return the Simulation of the chain and the parameters; Mistake where there can't be one."""
    from .simulator import payload_of
    from ..changes import apply_change
    from ..command_line import Mistake
    from ..quantities import changed_chain, QUANTITIES
    from ..simulation import Simulation
    try:
        for name in QUANTITIES:
            if name in values:
                chain = changed_chain(chain, name, values[name])
        simulation = Simulation(chain, method=values['method'], step=1.0 / values['rate'],
                                tolerance=values['tolerance'] or None)
        apply_change(simulation, 'payload', payload_of(values))
        return simulation
    except ValueError as error:
        raise Mistake(str(error)) from None


if __name__ == '__main__':
    sys.exit(main())
