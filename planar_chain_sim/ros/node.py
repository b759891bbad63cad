"""The executable `simulator`: a process and a ROS node around the Simulator that does the work."""
from __future__ import annotations

from contextlib import ExitStack
import gc
from shutil import get_terminal_size
import sys
import warnings

from .process import refuse_clock, run_until_stopped, start_node, wait_for

DESCRIPTION = """\
A planar chain of rigid bodies, simulated in real time as a ROS 2 node.

It publishes joint_states, takes efforts on ~/commands (joint order) and ~/joint_commands (by name), and answers
~/reset, ~/pause and ~/step. `ros2 param describe /simulator NAME` explains a parameter.
SIGINT, SIGTERM and SIGHUP end it with exit code 0. A mistake ends it with one sentence and exit code 2."""
EXAMPLE = 'simulator seven_link_arm.yaml --ros-args -p record:=run.mcap -r __ns:=/arm'

SWITCH_INTERVAL = 1e-4  # s; at Python's usual 5 ms the log's thread or a service could hold a tick up for that long
SHOWN = 12   # joints that the first line names
ON_TOPIC = 'robot_description'  # a chain file of this name is the text that comes on the topic


def main(arguments=None) -> int:
    """Run the executable. Its stop signals are handled before anything heavy is imported."""
    return run_until_stopped('simulator', simulate, arguments)


def simulate(own_arguments, ros_arguments, stop) -> None:
    """Simulate until something is put into `stop`. Mistake: bad arguments, parameters, chain, method or log."""
    from ..command_line import report
    from ..errors import Mistake
    told = parse(own_arguments)
    gc.disable()  # until all is loaded: nothing of it is garbage
    with ExitStack() as ending:  # ends in reverse order, so that nothing is used after its end
        node = start_node('simulator', ros_arguments, ending)
        warnings.showwarning = lambda message, category, *_: log_warning(node, message, category)
        started = start_simulator(node, ending, stop, told)
        if not started:
            return
        simulator, simulation, urdf, values, log, ends = started
        serve(node, ending, stop, simulator, simulation.chain, urdf, values, log, ends)
        gc.freeze()  # what is here now stays: a collection that went through all of it would hold up a tick
        gc.enable()
        reason = wait_for(stop)
    if log and log.error and values['on_log_failure'] == 'stop':
        raise Mistake(str(log.error))
    if log and log.error:   # told when it happened, but for what happened at the end
        report('simulator', str(log.error))
    if reason is not None:
        if type(reason).__name__ == 'RCLError':
            refuse_clock()   # which may have been set to where nothing can be sent
        raise reason


def parse(arguments) -> dict:
    """Return the parameters that the command line's own options give; Mistake: an unknown argument."""
    from ..command_line import add_hold, Parser
    parser = Parser('simulator', DESCRIPTION, EXAMPLE)
    parser.add_argument('chain', nargs='?', help='chain file (YAML, URDF or MJCF); sets the parameter chain_file')
    add_hold(parser)
    if not {'-h', '--help'}.isdisjoint(arguments):
        from .parameters import parameter_table
        parser.print_help()
        print('\nparameters, as in `--ros-args -p rate:=500.0`; live: can be set at run time\n')
        print(parameter_table(width=min(get_terminal_size().columns, 120)))
        raise SystemExit(0)
    options = parser.parse_args(arguments)
    told = {'chain_file': options.chain, 'hold': options.hold}
    return {name: value for name, value in told.items() if value is not None}


def log_warning(node, message, category) -> None:
    """Log a Python warning, such as a step that is too long, or the line about a robot file."""
    from ..errors import RobotFileNote
    if issubclass(category, RobotFileNote):
        node.get_logger().info(str(message))
    else:
        node.get_logger().warning(str(message))


def start_simulator(node, ending, stop, told=None):
    """
    Return a running Simulator, its simulation, its URDF or None, parameters, log or None, inputs and publishers.

    None after a stop. `told`: parameters from the command line's own options.
    """
    from .declaration import declare_chain_parameters, declare_parameters
    from .messages import create_polled_subscription, create_publisher, INPUTS, OUTPUTS

    values = declare_parameters(node, **(told or {}))
    if values['publish_tf']:
        from .transforms import check_installed
        check_installed()
    log_use_sim_time(node, values)
    # Topics first: while the chain is read, the others on the network find them.
    publishers = {key: create_publisher(node, topic) for key, topic in OUTPUTS.items()
                  if not topic.option or values[topic.option]}
    inputs = {key: create_polled_subscription(node, topic) for key, topic in INPUTS.items()}

    chain, urdf = load(node, values, stop)
    if chain is None:
        return None
    values.update(declare_chain_parameters(node, chain))
    simulation = create_simulation(chain, values)
    log = frames = None
    if values['record']:
        from .recorder import open_log, recorded_frames
        if values['record_tf']:
            frames = recorded_frames(node, simulation, description(chain, urdf, inputs, publishers),
                                     frames_of(chain, urdf, values))
        log = open_log(simulation, values, publishers, inputs, frames)
        ending.callback(log.close)
    simulator = simulator_class(values)(simulation, values, publishers, inputs, node.context, log, frames,
                                        node.get_logger(), stop.put)
    sys.setswitchinterval(SWITCH_INTERVAL)
    simulator.start()
    ending.callback(simulator.stop)
    log_start(node, simulation, values, publishers, inputs)
    return simulator, simulation, urdf, values, log, (inputs, publishers)


def log_start(node, simulation, values, publishers, inputs) -> None:
    """Log what runs, where to send efforts and how to see it; the plan at debug level."""
    names, logger = simulation.chain.joint_names, node.get_logger()
    shown = ', '.join(names[:SHOWN]) + (f' and {len(names) - SHOWN} more' if len(names) > SHOWN else '')
    state = publishers['state'].topic_name
    logger.info(f'running {simulation.chain.name}: joints {shown}; {values["rate"]:g} Hz, method {simulation.method}')
    logger.info(f'send efforts to {inputs["commands"].topic_name} (Float64MultiArray, {len(names)} in this order) or '
                f'{inputs["joint_commands"].topic_name} (JointState, by name)')
    logger.info(f'see it: in the browser with view (ros2 run planar_chain_sim view); ros2 topic echo {state}; in RViz '
                'or Foxglove with publish_markers:=true, or by ros2 launch planar_chain_sim view.launch.py')
    logger.debug(simulation.plan)


def serve(node, ending, stop, simulator, chain, urdf, values, log, ends) -> None:
    """
    Start what runs outside the tick thread: services, parameters, diagnostics, URDF, markers.

    `ends`: subscriptions of INPUTS and publishers of OUTPUTS, by key.
    """
    from .declaration import accept_changes
    from .diagnostics import Diagnostics, PERIOD
    from .messages import create_publisher, SIDE_OUTPUTS
    from .neighbours import Neighbours, PERIOD as NEIGHBOURS_PERIOD
    from .services import ServiceThread

    neighbours = Neighbours(node, simulator, *ends)
    services = ServiceThread(node, simulator, stop.put)
    publishers = {key: create_publisher(node, topic) for key, topic in SIDE_OUTPUTS.items()
                  if (not topic.option or values[topic.option])
                  and not (key == 'description' and values['chain_file'] == ON_TOPIC)}
    inputs, outputs = ends
    if 'description' in publishers:
        from std_msgs.msg import String
        publishers['description'].publish(String(data=description(chain, urdf, inputs, outputs)))
    if values['chain_file'] == ON_TOPIC:
        from .description import warn_of_another
        warn_of_another(node, urdf)
    accept_changes(node, chain, simulator.set_parameters)
    services.ask_every(NEIGHBOURS_PERIOD, neighbours.check)
    services.ask_every(PERIOD, Diagnostics(node.get_fully_qualified_name().lstrip('/'), simulator,
                                           publishers['diagnostics'], values, log, chain.name, neighbours).report)
    if values['publish_markers'] or values['publish_tf'] or values['frame_id']:
        frames = frames_of(chain, urdf, values)
        frame_id = values['frame_id'] or frames.root
        if frame_id not in frames.links:
            node.get_logger().warning(f"parameter 'frame_id' is {frame_id!r:.80}, not a link of the robot: "
                                      f'joint_states have it, and markers are drawn as in {frames.root!r:.80}')
    if values['publish_markers']:
        from .markers import marker_array, PERIOD as MARKER_PERIOD

        def publish_markers() -> None:
            stamp, position = simulator.published_state
            markers = marker_array(chain, frames, stamp, position, frame_id)
            simulator.hold_ups.during(publishers['markers'].publish, markers)

        services.every(MARKER_PERIOD, publish_markers)
    if values['publish_tf']:
        from .transforms import PERIOD as TF_PERIOD, TransformPublisher
        services.every(TF_PERIOD, TransformPublisher(simulator, frames, chain.joint_names, publishers).publish)
    services.start()
    ending.callback(services.stop)
    ending.callback(simulator.halt)   # first of all: a service must not wait for a tick that takes long


def description(chain, urdf, inputs, outputs) -> str:
    """Return the URDF that was given, or the one written from the chain, with the node's topics."""
    from ..robot_files.urdf_writer import urdf_of
    from ..robot_files.xml_elements import root_tag
    if urdf and root_tag(urdf) == 'robot':   # an MJCF may have come on the topic
        return urdf
    return urdf_of(chain, inputs['joint_commands'].topic_name, outputs['state'].topic_name)


def frames_of(chain, urdf, values):
    """Return the LinkFrames of the URDF that was given, or of the URDF written from the chain."""
    from ..chain.hold import read_hold
    from ..robot_files.link_frames import LinkFrames
    from ..robot_files.urdf_writer import PLANE, urdf_of
    from ..robot_files.xml_elements import root_tag
    if urdf and root_tag(urdf) == 'robot':   # an MJCF may have come on the topic
        return LinkFrames(urdf, read_hold(values['hold']))
    return LinkFrames(urdf_of(chain), plane=PLANE)


def log_use_sim_time(node, values) -> None:
    """
    Log what use_sim_time means for this node, at the start and when it is set.

    Ticks are counted on the steady clock and nothing here waits for /clock. A subscription to it would only receive
    the node's own messages, a thousand a second. So the node gives up its source of time now, before any thread runs:
    that would subscribe later, and a subscription that ends while the executor is about to wait for it ends the node.
    """
    node._time_source.detach_node()

    def log_meaning(wanted: bool) -> None:
        if not wanted:
            node.get_logger().info('use_sim_time is off, which changes nothing: this node never waits for /clock')
            return
        if values['publish_clock']:
            node.get_logger().info('use_sim_time is set and this node is the clock')
        else:
            node.get_logger().warning('use_sim_time is set, but this node keeps wall time and stamps with it; '
                                      'publish_clock:=true, at the start, makes it the clock')

    def log_all(parameters) -> None:
        for parameter in parameters:
            if parameter.name == 'use_sim_time':
                log_meaning(parameter.value)

    if node.get_parameter('use_sim_time').value:
        log_meaning(True)
    node.add_post_set_parameters_callback(log_all)


def simulator_class(values):
    """Return the class of Simulator that the parameter `lockstep` chooses."""
    if values['lockstep']:
        from .lockstep import LockstepSimulator
        return LockstepSimulator
    from .simulator import Simulator
    return Simulator


def load(node, values, stop):
    """Return the chain of `chain_file` and its URDF if it is one, both None after a stop; ChainError."""
    from ..chain_file import chain_from_text, load_chain_and_text
    from ..robot_files.xacro_file import USED
    from ..robot_files.xml_elements import root_tag
    if values['chain_file'] == ON_TOPIC:
        from .description import await_description
        text = await_description(node, stop)
        return (None, None) if text is None else (chain_from_text(text, ON_TOPIC, values['hold']), text)
    chain, text = load_chain_and_text(values['chain_file'], values['hold'])
    return chain, text if root_tag(text) == 'robot' and not values['hold'] and not USED.search(text) else None


def create_simulation(chain, values):
    """Return the Simulation of the chain by the parameters; ChainError: they do not fit the chain."""
    from .tick_thread import payload_of
    from ..chain.quantities import changed_chain, QUANTITIES
    from ..motion.simulation import Simulation
    from ..recording.events import apply_event
    for name in QUANTITIES:
        if name in values:
            chain = changed_chain(chain, name, values[name])
    simulation = Simulation(chain, method=values['method'], step=1.0 / values['rate'],
                            tolerance=values['tolerance'] or None)
    apply_event(simulation, 'payload', payload_of(values, simulation))
    return simulation


if __name__ == '__main__':
    sys.exit(main())
