"""
The services of simulation_interfaces against the package's own message definitions, over DDS where it is installed.

The definitions, fields and constants alone, lie in interface_definitions/. Objects made from them have no attribute but
those fields, so that an answer that says more, or other, fails.
"""
from contextlib import ExitStack
from inspect import iscoroutine
from pathlib import Path
from queue import SimpleQueue

from live import Peer, run, simulator, stamp_ns
import pytest
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from planar_chain_sim.ros import standard_services
from planar_chain_sim.ros.standard_services import StandardServices

DEFINITIONS = Path(__file__).parent / 'interface_definitions'
SERVICES = {'get_simulator_features': 'GetSimulatorFeatures', 'reset_simulation': 'ResetSimulation',
            'step_simulation': 'StepSimulation', 'get_simulation_state': 'GetSimulationState',
            'set_simulation_state': 'SetSimulationState'}


def message(text):
    """Return an object with the fields of a definition, and its constants."""
    fields, constants = {}, {}
    for line in filter(None, map(str.strip, text.splitlines())):
        kind, name, *default = line.split(None, 2)
        if default and default[0].startswith('='):
            constants[name] = int(default[0][1:])
        elif (DEFINITIONS / 'msg' / f'{kind}.msg').exists():
            fields[name] = message((DEFINITIONS / 'msg' / f'{kind}.msg').read_text())
        else:
            fields[name] = [] if kind.endswith('[]') else '' if kind == 'string' else int((default or ['0'])[0])
    made = type('Message', (), {'__slots__': tuple(fields), **constants})()
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def parts(kind, name):
    """Return fresh objects for the parts of a service or action."""
    return [message(part) for part in (DEFINITIONS / kind / f'{name}.{kind}').read_text().split('---')]


@pytest.fixture
def running():
    """Yield the services around a real Simulator of a node in this process, and what it was told when asked to quit."""
    from planar_chain_sim.ros.node import start_simulator
    context, stop, quits = rclpy.Context(), SimpleQueue(), []
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    with ExitStack() as ending:
        ending.callback(context.try_shutdown)
        node = Node('simulator', context=context,
                    cli_args=['--ros-args', '-p', 'start_paused:=true', '-r', '__ns:=/inner'])
        ending.callback(node.destroy_node)
        started, *_ = start_simulator(node, ending, stop)
        services = StandardServices(started, lambda: quits.append(True), node.get_fully_qualified_name(), ask)
        yield services, started, quits


class Turn:
    """What a coroutine awaits to let others have a turn."""

    def __await__(self):
        yield


async def ask(function, *arguments):
    answer = function(*arguments)
    await Turn()
    return answer


def begun(services, name, **values):
    request, response = parts('srv', SERVICES[name])
    for key, value in values.items():
        assert key in request.__slots__
        setattr(request, key, value)
    return services.rows[name][1](request, response)


def ended(coroutine):
    """Give a coroutine all its turns and return its answer."""
    while True:
        try:
            coroutine.send(None)
        except StopIteration as end:
            return end.value


def call(services, name, **values):
    answer = begun(services, name, **values)
    return ended(answer) if iscoroutine(answer) else answer


def state_of(value):
    state = message((DEFINITIONS / 'msg/SimulationState.msg').read_text())
    state.state = value
    return state


def test_numbers_are_those_of_the_definitions():
    result, state, features = (message((DEFINITIONS / f'msg/{name}.msg').read_text()) for name in (
        'Result', 'SimulationState', 'SimulatorFeatures'))
    assert standard_services.OK == result.RESULT_OK
    assert standard_services.FEATURE_UNSUPPORTED == result.RESULT_FEATURE_UNSUPPORTED
    assert standard_services.OPERATION_FAILED == result.RESULT_OPERATION_FAILED
    assert (standard_services.STOPPED, standard_services.PLAYING, standard_services.PAUSED,
            standard_services.QUITTING) == (state.STATE_STOPPED, state.STATE_PLAYING, state.STATE_PAUSED,
                                            state.STATE_QUITTING)
    assert standard_services.FEATURES == (
        features.SIMULATION_RESET, features.SIMULATION_RESET_STATE, features.SIMULATION_STATE_GETTING,
        features.SIMULATION_STATE_SETTING, features.SIMULATION_STATE_PAUSE, features.STEP_SIMULATION_SINGLE,
        features.STEP_SIMULATION_MULTIPLE, features.STEP_SIMULATION_ACTION)
    request, response = parts('srv', 'ResetSimulation')
    assert (standard_services.SCOPE_DEFAULT, standard_services.SCOPE_STATE, standard_services.SCOPE_ALL) == (
        request.SCOPE_DEFAULT, request.SCOPE_STATE, request.SCOPE_ALL)
    assert standard_services.ALREADY_IN_TARGET_STATE == parts('srv', 'SetSimulationState')[1].ALREADY_IN_TARGET_STATE


def test_steps_states_and_reset(running):
    services, simulation, quits = running
    assert {name: row[0] for name, row in services.rows.items()} == SERVICES
    assert call(services, 'get_simulator_features').features.features == list(standard_services.FEATURES)
    assert call(services, 'get_simulation_state').state.state == 2
    assert call(services, 'step_simulation', steps=250).result.result == 1 and simulation.tick == 250
    assert call(services, 'step_simulation').result.result == 1 and simulation.tick == 251, 'one by default'
    _, start = simulation.published_state
    assert call(services, 'reset_simulation', scope=4).result.result == 0
    assert simulation.published_state[1].tobytes() == start.tobytes()
    assert call(services, 'reset_simulation').result.result == 1 and simulation.tick == 251
    assert simulation.published_state[1].tobytes() != start.tobytes()
    assert call(services, 'set_simulation_state', state=state_of(0)).result.result == 1
    assert call(services, 'get_simulation_state').state.state == 0
    assert call(services, 'set_simulation_state', state=state_of(0)).result.result == 101
    assert call(services, 'set_simulation_state', state=state_of(2)).result.result == 1
    assert call(services, 'get_simulation_state').state.state == 2
    assert call(services, 'set_simulation_state', state=state_of(1)).result.result == 1
    assert not simulation.paused
    refused = call(services, 'step_simulation', steps=1).result
    assert refused.result == 4 and refused.error_message.startswith('not stepped: the simulation is running')
    assert call(services, 'set_simulation_state', state=state_of(7)).result.result == 4
    assert not quits and call(services, 'set_simulation_state', state=state_of(3)).result.result == 1 and quits


@pytest.mark.parametrize('name, values', [
    ('reset_simulation', {}), ('set_simulation_state', {'state': 1}), ('set_simulation_state', {'state': 0})])
def test_a_long_step_gives_way_to_who_resets_stops_or_plays(running, name, values):
    services, simulation, _ = running
    stepping = begun(services, 'step_simulation', steps=10**9)
    stepping.send(None)
    stepping.send(None)
    assert simulation.tick > 1
    assert call(services, 'get_simulation_state').state.state == 2
    values = {key: state_of(value) for key, value in values.items()}
    assert call(services, name, **values).result.result == 1
    answer = ended(stepping).result
    assert answer.result == 4
    assert 'came between' in answer.error_message or 'is running' in answer.error_message
    assert '1000000000 steps done' in answer.error_message


def test_a_long_step_gives_way_to_the_end_of_the_process(running):
    services, simulation, _ = running
    stepping = begun(services, 'step_simulation', steps=10**9)
    stepping.send(None)
    simulation.halt()
    answer = ended(stepping).result
    assert answer.result == 4 and answer.error_message.startswith('the simulation is ending (')


def test_over_dds_with_the_package_itself(tmp_path):
    """Every service and the action, with feedback and cancelled, by a client in this process."""
    srv = pytest.importorskip('simulation_interfaces.srv')
    from rclpy.action import ActionClient
    from simulation_interfaces.action import SimulateSteps
    path = tmp_path / 'run.mcap'
    with simulator(start_paused=True, record=path) as process, Peer() as peer:
        clients = {name: peer.node.create_client(getattr(srv, kind), f'/simulator/{name}')
                   for name, kind in SERVICES.items()}
        for client in clients.values():
            peer.until(client.service_is_ready)
        stepper = ActionClient(peer.node, SimulateSteps, '/simulator/simulate_steps')
        peer.until(stepper.server_is_ready)
        peer.meet()

        def ask(name, **values):
            return peer.ask(clients[name].call_async(clients[name].srv_type.Request(**values)))
        assert list(ask('get_simulator_features').features.features) == list(standard_services.FEATURES)
        assert ask('step_simulation').result.result == 1
        assert stamp_ns(peer.standing_state()) and ask('get_simulation_state').state.state == 2
        feedback = []
        goal = peer.ask(stepper.send_goal_async(SimulateSteps.Goal(steps=350),
                                                feedback_callback=lambda told: feedback.append(told.feedback)))
        assert peer.ask(goal.get_result_async()).result.result.result == 1
        assert [f.completed_steps + f.remaining_steps for f in feedback] == [350] * len(feedback) and feedback
        long_step = clients['step_simulation'].srv_type.Request()
        long_step.steps = 10**9
        before = stamp_ns(peer.standing_state())
        stepping = clients['step_simulation'].call_async(long_step)
        peer.new_state(lambda state: stamp_ns(state) > before)
        assert ask('get_simulation_state').state.state == 2 and peer.call('reset')[0]
        assert 'came between' in peer.ask(stepping).result.error_message
        goal = peer.ask(stepper.send_goal_async(SimulateSteps.Goal(steps=10**9)))
        before = stamp_ns(peer.new_state())
        peer.new_state(lambda state: stamp_ns(state) > before)
        peer.ask(goal.cancel_goal_async())
        assert 'cancelled after' in peer.ask(goal.get_result_async()).result.result.error_message
        quit_request = clients['set_simulation_state'].srv_type.Request()
        quit_request.state.state = 3
        assert peer.ask(clients['set_simulation_state'].call_async(quit_request)).result.result == 1
        assert process.finish() == 0, process.output
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output
