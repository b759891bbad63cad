"""The table of parameters, compared with what ROS makes of a command line; each node here is a real one."""
import gc
import json
from math import inf, nan
from queue import SimpleQueue
import random
import re
import sys
from threading import Timer
from time import monotonic, process_time
import warnings

from diagnostic_msgs.msg import DiagnosticArray
from live import CONFIG, PATIENCE, Peer, Process, run, simulator
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from planar_chain_sim import load_chain, rollout, Simulation
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.command_line import sentence_of
from planar_chain_sim.errors import Mistake
from planar_chain_sim.recording.cdr import decode_joint_state, decode_string
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.ros.arguments import unheard
from planar_chain_sim.ros.declaration import accept_changes, declare_chain_parameters, declare_parameters
from planar_chain_sim.ros.node import simulate
from planar_chain_sim.ros.parameters import PARAMETERS

CHAIN = load_chain('double_pendulum.yaml')
JOINTS = list(CHAIN.joint_names)


@pytest.fixture(scope='module')
def context():
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    yield context
    context.try_shutdown()


@pytest.fixture
def declared(context):
    """Return a function that declares the table under parameters of a command line; it gives (values, node)."""
    nodes = []

    def declare(*parameters):
        arguments = ['--ros-args', *(part for parameter in parameters for part in ('-p', parameter))]
        nodes.append(Node('simulator', context=context, cli_args=arguments, start_parameter_services=False))
        return declare_parameters(nodes[-1]), nodes[-1]
    yield declare
    for node in nodes:
        node.destroy_node()


def test_defaults(declared):
    values, node = declared()
    assert values == {**{row.name: row.default for row in PARAMETERS if not row.of_chain}, 'publish_rate': 1000.0}
    assert values['rate'] == 1000.0 and values['chain_file'] == 'four_link_robot.yaml'
    assert values['on_controller_loss'] == 'zero' and values['record'] == ''


def test_every_parameter_is_described_and_read_only_where_no_change_acts(declared):
    _, node = declared('rate:=500.0')
    declare_chain_parameters(node, CHAIN)
    for row in PARAMETERS:
        descriptor = node.describe_parameter(row.name)
        assert descriptor.description.startswith(row.description) and row.unit in descriptor.description
        assert descriptor.read_only != row.live
        assert descriptor.type == node.get_parameter(row.name).type_.value == Parameter.Type[row.type].value
        if row.limits and row.type == 'DOUBLE':
            limits, = descriptor.floating_point_range
            assert (limits.from_value, limits.to_value) == row.limits
    outcome, = node.set_parameters([Parameter('rate', value=100.0)])
    assert not outcome.successful
    assert node.get_parameter('rate').value == 500.0


def test_whole_numbers_are_taken_where_numbers_are_meant(declared):
    values, node = declared('rate:=500', 'publish_rate:=100', 'real_time_factor:=2')
    assert (values['rate'], values['publish_rate'], values['real_time_factor']) == (500.0, 100.0, 2.0)
    assert type(values['rate']) is float
    assert node.get_parameter('rate').type_ == Parameter.Type.DOUBLE


@pytest.mark.parametrize('parameter, sentence', [
    ('rate:=-5', "parameter 'rate' is -5.0, must be from 1 to 100000"),
    ('rate:=0.5', "parameter 'rate' is 0.5, must be from 1 to 100000"),
    ('rate:=.nan', "parameter 'rate' is nan, must be from 1 to 100000"),
    ('rate:=fast', "parameter 'rate' is 'fast', must be a number"),
    ('rate:=true', "parameter 'rate' is True, must be a number"),
    ('publish_rate:=300', "parameter 'publish_rate' is 300.0, must be 0 or `rate` (1000.0) divided by a whole number"),
    ('publish_rate:=2e3', "parameter 'publish_rate' is 2000.0, must be 0 or `rate` (1000.0) divided by a whole number"),
    ('real_time_factor:=-1', "parameter 'real_time_factor' is -1.0, must be from 0 to 1000"),
    ('tolerance:=2', "parameter 'tolerance' is 2.0, must be from 0 to 1"),
    ('tolerance:=1e-300', "parameter 'tolerance' is 1e-300, must be 0 or at least 1e-20"),
    ('command_timeout:=-0.1', "parameter 'command_timeout' is -0.1, must be from 0 to 1e+06"),
    ('lockstep:=1', "parameter 'lockstep' is 1, must be true or false"),
    ('start_paused:=1', "parameter 'start_paused' is 1, must be true or false"),
    ('chain_file:=7', "parameter 'chain_file' is 7, must be a string"),
    ('frame_id:=[a,b]', "parameter 'frame_id' is ['a', 'b'], must be a string"),
    ('on_controller_loss:=stop', "parameter 'on_controller_loss' is 'stop', must be one of 'zero', 'hold'"),
    ('record_flush_period:=0.0', "parameter 'record_flush_period' is 0.0, must be from 0.01 to 3600"),
    ('record_compression:=zip', "parameter 'record_compression' is 'zip', must be one of 'none', 'lz4', 'zstd'")])
def test_a_bad_value_is_one_sentence(declared, parameter, sentence):
    with pytest.raises(Mistake) as mistake:
        declared(parameter)
    assert str(mistake.value) == sentence


def test_a_slip_in_a_name_is_told(declared, capfd):
    declared('rat:=5.0', 'something_else_of_a_shared_file:=3', 'use_sim_time:=false')
    told = capfd.readouterr().err
    assert "parameter 'rat' is not known and has no effect, did you mean 'rate'?" in told
    assert 'parameters that are not known and have no effect: something_else_of_a_shared_file\n' in told


@pytest.mark.parametrize('parameter, needed, value', [
    ('lockstep_joints:=[a]', 'lockstep', 'true'), ('record_compression:=lz4', 'record', 'run.mcap'),
    ('record_flush_period:=1.0', 'record', 'run.mcap'), ('on_log_failure:=stop', 'record', 'run.mcap')])
def test_a_parameter_without_effect_is_told(declared, parameter, needed, value, capfd):
    declared(parameter)
    name = parameter.partition(':=')[0]
    assert capfd.readouterr().err.count(f"parameter '{name}' has no effect without '{needed}'") == 1
    declared(parameter, f'{needed}:={value}')
    assert 'has no effect' not in capfd.readouterr().err


def test_a_frame_that_is_no_link_is_told_without_markers_too():
    with simulator(frame_id='nobody') as process:
        process.wait_for("parameter 'frame_id' is 'nobody', not a link of the robot")
        assert process.stop() == 0, process.output


def test_commanded_joints_that_the_chain_has_not_are_told(declared, capfd):
    """Not refused: the hardware of ros2_control may also have a gripper."""
    _, node = declared(f'commanded_joints:=[{JOINTS[0]}, gripper]')
    assert declare_chain_parameters(node, CHAIN)['commanded_joints'] == [JOINTS[0], 'gripper']
    assert "'commanded_joints' names 'gripper', not among the joints" in capfd.readouterr().err


def test_the_chain_gives_defaults_and_only_what_was_given_is_returned(declared):
    _, node = declared('gravity:=[0,-5]', 'effort_limit:=[.inf, 3.0]')
    assert declare_chain_parameters(node, CHAIN) == {
        'gravity': [0.0, -5.0], 'effort_limit': [float('inf'), 3.0], 'lockstep_joints': JOINTS,
        'commanded_joints': [], 'payload_body': CHAIN.bodies[-1].name, 'payload_position': [0.0, 0.0]}
    assert list(node.get_parameter('damping').value) == [joint.damping for joint in CHAIN.joints]
    assert list(node.get_parameter('gravity').value) == [0.0, -5.0]


@pytest.mark.parametrize('parameter, sentence', [
    ('gravity:=[1.0]', "parameter 'gravity' has 1 values, must have 2 (m/s^2, [x, y])"),
    ('gravity:=9.81', "parameter 'gravity' is 9.81, must be a list of numbers"),
    ('gravity:=[.nan, 1.0]', "parameter 'gravity' is nan in one place, must be finite numbers (m/s^2, [x, y])"),
    ('damping:=[-1.0, 1.0]', "parameter 'damping' is -1.0 in one place, must be finite numbers >= 0 "
     '(N m s/rad or N s/m, in joint order)'),
    ('effort_limit:=[a, b]', "parameter 'effort_limit' is ['a', 'b'], must be a list of numbers"),
    ('payload_position:=[1.0]', "parameter 'payload_position' is [1.0], must be two numbers, [x, y]"),
    ('payload_position:=[.inf, 0.0]',
     "parameter 'payload_position' is [inf, 0.0], must be numbers from -1e+06 to 1e+06"),
    ('payload_body:=hand', "parameter 'payload_body' is 'hand', must be a body of the chain: "
     f'{", ".join(body.name for body in CHAIN.bodies)}'),
    ('lockstep_joints:=[elbow]', "parameter 'lockstep_joints' names 'elbow', must name joints of the chain: "
     + ', '.join(JOINTS))])
def test_a_bad_value_for_the_chain_is_one_sentence(declared, parameter, sentence):
    _, node = declared(parameter)
    with pytest.raises(Mistake) as mistake:
        declare_chain_parameters(node, CHAIN)
    assert str(mistake.value) == sentence


def test_live_parameters_are_converted_checked_and_applied_all_or_none(declared):
    _, node = declared()
    declare_chain_parameters(node, CHAIN)
    applied = []
    accept_changes(node, CHAIN, lambda values: (applied.append(values) or True, ''))
    results = node.set_parameters([Parameter('gravity', value=[0, -2]), Parameter('real_time_factor', value=2)])
    assert all(result.successful for result in results), results
    assert applied == [{'gravity': [0.0, -2.0]}, {'real_time_factor': 2.0}]
    assert node.get_parameter('gravity').type_ == Parameter.Type.DOUBLE_ARRAY
    outcome = node.set_parameters_atomically([Parameter('gravity', value=[1.0, 1.0]),
                                              Parameter('damping', value=[1.0, -1.0])])
    assert not outcome.successful and 'must be finite numbers >= 0' in outcome.reason
    assert len(applied) == 2 and list(node.get_parameter('gravity').value) == [0.0, -2.0]
    mixed, = node.set_parameters([Parameter('gravity', value='[0, -1.62]')])   # as `ros2 param set` sends such a list
    assert mixed.successful and applied[-1] == {'gravity': [0.0, -1.62]}
    assert list(node.get_parameter('gravity').value) == [0.0, -1.62]
    assert not node.set_parameters([Parameter('gravity', value='[0, down]')])[0].successful
    applied.pop()
    for name, value in (('on_controller_loss', 'stop'), ('gravity', [1.0]), ('gravity', 'down'), ('rate', 5.0)):
        assert not node.set_parameters([Parameter(name, value=value)])[0].successful
    assert len(applied) == 2


def test_what_the_simulator_refuses_is_not_set(declared):
    _, node = declared()
    declare_chain_parameters(node, CHAIN)
    accept_changes(node, CHAIN, lambda values: (False, 'no'))
    outcome, = node.set_parameters([Parameter('command_timeout', value=1.0)])
    assert not outcome.successful and outcome.reason == 'no'
    assert node.get_parameter('command_timeout').value == 0.0


# What each parameter is at its extremes; a family takes some of them at a time.
NUMBERS_OF_A_LIST = ['0.0', '-0.0', '5e-300', '1e-12', '1e-3', '1.0', '1e6', '1e9', '1e200', '1e308', '-1e308', '.nan',
                     '.inf', '-.inf', '-1.0']
EXTREMES = {
    'DOUBLE': [*NUMBERS_OF_A_LIST, '1e-310', '5e-324', '1e400', '1e-6', '999.99', '1e5', '0', '7',
               '9223372036854775807'],
    'BOOL': ['true', 'false'],
    'STRING': ["''", 'x' * 300, 'é', 'a b', '/', '..', '"\\0"', '"a\\nb"', 'rk4', 'gauss6', 'double_pendulum.yaml'],
    'STRING_ARRAY': ['[]', '[column_slide]', '[column_slide, column_slide]', "['']", '[x]']}


def extreme(row, rng):
    """Return a value for a row as it stands in YAML: mostly of its type, at the ends of what can be written."""
    if rng.random() < 0.05:
        return rng.choice(['[]', '[true]', '[1, 2]', 'a', '1', 'true', '1.5', '[[1]]'])
    if row.type == 'DOUBLE_ARRAY':
        return '[' + ', '.join(rng.choice(NUMBERS_OF_A_LIST) for _ in range(rng.choice([0, 1, 2, 2, 2, 5, 5]))) + ']'
    if row.choices and rng.random() < 0.8:
        return rng.choice(row.choices)
    return rng.choice(EXTREMES[row.type])


@pytest.fixture
def started(monkeypatch):
    """Return a function that runs the executable's own body for a moment; what it changes in Python is put back."""
    monkeypatch.setattr(warnings, 'showwarning', warnings.showwarning)
    interval = sys.getswitchinterval()

    def start(*arguments):
        stop = SimpleQueue()
        timer = Timer(0.15, stop.put, (None,))
        timer.start()
        try:
            simulate([], ['--ros-args', *arguments], stop)
        finally:
            timer.cancel()
            gc.enable()
            gc.unfreeze()
    yield start
    sys.setswitchinterval(interval)


@pytest.mark.parametrize('by_file', [False, True])
@pytest.mark.parametrize('family', range(4))
def test_every_parameter_at_its_extremes_starts_or_is_one_sentence(started, family, by_file, tmp_path, capfd):
    rng, ran = random.Random(f'{family} {by_file}'), 0
    for case in range(50):
        rows = rng.sample([row for row in PARAMETERS if row.name != 'record'], rng.choice([1, 1, 2, 3]))
        given = {row.name: extreme(row, rng) for row in rows}
        if rng.random() < 0.3:
            given['record'] = str(tmp_path / f'{case}.mcap')
        arguments = [part for name, value in given.items() for part in ('-p', f'{name}:={value}')]
        if by_file:
            text = ''.join(f'    {name}: {value}\n' for name, value in given.items())
            (tmp_path / 'parameters.yaml').write_text(f'/**:\n  ros__parameters:\n{text}')
            arguments = ['--params-file', str(tmp_path / 'parameters.yaml')]
        try:
            started(*arguments)
            ran += 1
        except Exception as error:
            sentence = sentence_of(error)
            if sentence is None:
                raise   # a bug, which a user would see as a traceback
            assert '\n' not in sentence and '.c:' not in sentence, given
    assert ran > 3, 'a family that is always refused shows nothing'
    assert 'Traceback' not in capfd.readouterr().err


@pytest.mark.parametrize('family', range(2))
def test_every_parameter_at_its_extremes_while_it_runs(family, tmp_path):
    """Whatever is set, the answer is one sentence, what is read back is what acts, and the log runs again."""
    numbers = [0.0, -0.0, 5e-324, 1e-310, 1e-12, 1e-6, 0.5, 1e3, 1e9, 1e200, 1e308, -1.0, -1e308, nan, inf, -inf]
    others = [0, 7, 2**62, 'a', '', True]
    rng, path, taken = random.Random(family), tmp_path / 'run.mcap', 0
    with simulator(record=path) as process, Peer() as peer:
        peer.meet()
        for _ in range(150):
            values = {}
            rows = PARAMETERS if rng.random() < 0.2 else [row for row in PARAMETERS if row.live]
            for row in rng.sample(rows, rng.choice([1, 1, 2, 3])):
                if row.type == 'DOUBLE_ARRAY':
                    count = 2 if row.name == 'gravity' else rng.choice([1, 5, 5])
                    values[row.name] = [rng.choice(numbers) for _ in range(count)]
                else:
                    values[row.name] = rng.choice([*numbers, *others, *row.choices])
            peer.until(peer.parameters.services_are_ready)
            before = peer.ask(peer.parameters.get_parameters(list(values))).values
            answer = peer.ask(peer.parameters.set_parameters_atomically(
                [Parameter(name, value=value) for name, value in values.items()])).result
            after = peer.ask(peer.parameters.get_parameters(list(values))).values
            assert '\n' not in answer.reason and bool(answer.reason) != answer.successful
            if answer.successful:
                taken += 1
            else:
                assert repr(after) == repr(before), values
            if rng.random() < 0.2:
                peer.call('pause', True)
                peer.call('step')
                peer.call('pause', False)
        assert taken > 10
        assert peer.set(real_time_factor=1.0)[0][0] and peer.call('reset')[0]
        peer.new_state()
        assert process.stop() == 0, process.output
    assert 'Traceback' not in process.output
    code, words = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, words


# A payload of 1e9 kg at its tip has no finite moment of inertia, of 1 kg it has.
FAR = """
name: far
bodies:
  - {name: arm, carrier: base, mass: 1.0, center_of_mass: [0.5, 0.0], inertia: 0.4, rotation: {joint: shoulder}}
  - {name: tip, carrier: arm, origin: [1.0e150, 0.0], mass: 0.0, inertia: 0.0}
"""


def set_together(peer, **values):
    peer.until(peer.parameters.services_are_ready)
    return peer.ask(peer.parameters.set_parameters_atomically(
        [Parameter(name, value=value) for name, value in values.items()])).result


def read_back(peer, name):
    return peer.ask(peer.parameters.get_parameters([name])).values[0]


def test_a_set_of_parameters_of_which_one_cannot_act_changes_nothing(tmp_path):
    (tmp_path / 'far.yaml').write_text(FAR)
    path = tmp_path / 'run.mcap'
    with simulator(chain_file=tmp_path / 'far.yaml', record=path) as process, Peer() as peer:
        peer.meet()
        peer.new_state()
        answer = set_together(peer, gravity=[0.0, -1.0], payload_mass=1e9, real_time_factor=0.5)
        assert not answer.successful and answer.reason.startswith("parameter 'payload_mass': body 'payload' of far")
        assert list(read_back(peer, 'gravity').double_array_value) == [0.0, -9.81]
        assert read_back(peer, 'payload_mass').double_value == 0.0
        assert read_back(peer, 'real_time_factor').double_value == 1.0
        peer.new_state()
        assert process.stop() == 0, process.output
    log = read_log(path)
    events = [json.loads(decode_string(message.data)) for message in log.messages if 'events' in message.topic]
    assert [event for event in events if event['kind'] in ('parameter', 'payload')] == []
    states = [decode_joint_state(message.data) for message in log.messages if message.topic == '/joint_states']
    ticks = len(states) - 1
    alone = rollout(load_chain(tmp_path / 'far.yaml'), ticks * 1e-3)   # with the gravity of the file, all along
    assert states[-1].position.tobytes() == alone.position[-1].tobytes()


def test_parameters_that_are_set_together_act_from_one_tick_on(tmp_path):
    """Many times, as two ticks would differ only now and then."""
    path = tmp_path / 'run.mcap'
    with simulator(chain_file='double_pendulum.yaml', rate=5000, publish_rate=500, record=path) as process, \
            Peer() as peer:
        peer.meet()
        for k in range(20):
            answer = set_together(peer, gravity=[0.0, -float(k)], damping=[0.1, 0.01 * k], effort_limit=[1.0 + k, inf],
                                  payload_mass=0.1 * k, command_timeout=0.5)
            assert answer.successful, answer.reason
        assert process.stop() == 0, process.output
    events = [json.loads(decode_string(message.data)) for message in read_log(path).messages
              if 'events' in message.topic]
    ticks = [event['tick'] for event in events if event['kind'] in ('parameter', 'payload')]
    assert len(ticks) == 100 and all(len(set(ticks[k:k + 5])) == 1 for k in range(0, 100, 5))
    assert len(set(ticks)) > 10
    code, words = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, words


def test_a_body_may_be_called_payload(tmp_path):
    text = (CONFIG / 'double_pendulum.yaml').read_text()
    last = CHAIN.bodies[-1].name
    assert text.count(last)
    chain, path = tmp_path / 'named.yaml', tmp_path / 'run.mcap'
    chain.write_text(re.sub(rf'\b{last}\b', 'payload', text))
    with simulator(chain_file=chain, payload_mass=0.5, record=path) as process, Peer() as peer:
        peer.meet()
        assert peer.set(payload_mass=0.7) == [(True, '')]
        assert peer.set(payload_mass=0.0) == [(True, '')]
        assert process.stop() == 0, process.output
    code, words = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, words


@pytest.mark.parametrize('factor', [1e-6, 1e-3])
def test_paused_the_state_comes_at_wall_pace_whatever_the_factor(factor):
    with simulator(start_paused=True, real_time_factor=factor) as process, Peer() as peer:
        peer.until(lambda: len(peer.states) > 100)   # at the pace of the factor this took minutes or days
        assert process.stop() == 0


def test_a_step_of_days_brings_stamps_to_the_end_of_ros_time_and_no_further():
    """At 1 Hz and 1e-6 a tick takes 11.6 days; after 9 years and more of them ROS time ends, in 2038."""
    with simulator(rate=1, real_time_factor=1e-6, start_paused=True) as process, Peer() as peer:
        peer.meet()
        for _ in range(400):
            assert peer.call('step')[0]
        last = peer.standing_state()
        assert (last.header.stamp.sec, last.header.stamp.nanosec) == (2**31 - 1, 999_999_999)
        assert process.stop() == 0
    assert 'Traceback' not in process.output


def slow(joints):
    """Return a chain whose stiff method has much to do."""
    return 'name: slow\nbodies:\n' + ''.join(
        f'  - {{name: l{k}, carrier: {f"l{k - 1}" if k else "base"}, origin: [{0.1 if k else 0.0}, 0.0], mass: 1.0, '
        f'center_of_mass: [0.05, 0.0], inertia_com: 0.001, rotation: {{joint: j{k}, position: '
        f'{0.3 if k % 2 else -0.2}, damping: 0.001}}}}\n' for k in range(joints))


def slow_here():
    """Return such a chain with as many joints as make the first tick, of a second, take some five on this machine."""
    simulation = Simulation(chain_from_text(slow(72)), 'rodas5p', step=0.1, tolerance=1e-11)
    begun = process_time()
    simulation.advance(3)
    return slow(min(max(40, round(72 * (5.0 / (5.0 * (process_time() - begun))) ** (1 / 3))), 250))


def until_refused(ask):
    """Ask again and again, until that falls into a tick, and return what is said then."""
    end = monotonic() + PATIENCE
    while (answer := ask())[0]:
        assert monotonic() < end, 'ticks are too short here'
    return answer[1]


def parameters_are_read_while_services_wait(peer):
    """Ask during a long tick: reading a parameter does not wait for the tick thread."""
    peer.until(peer.parameters.services_are_ready)
    end, waited = monotonic() + PATIENCE, False
    while not waited:   # a tick may end just then
        assert monotonic() < end, 'the parameters were never read before a service had its answer'
        pending = [peer.services[name].call_async(peer.services[name].srv_type.Request()) for name in ('reset', 'step')]
        pending.append(peer.parameters.set_parameters([Parameter('gravity', value=[0.0, -2.0])]))
        assert peer.ask(peer.parameters.get_parameters(['rate'])).values[0].double_value == 1.0
        waited = not any(future.done() for future in pending)
        for future in pending:
            peer.ask(future)


def test_what_takes_longer_than_its_time_out_is_still_under_way_and_told_afterwards(tmp_path):
    (tmp_path / 'slow.yaml').write_text(slow_here())
    with simulator(chain_file=tmp_path / 'slow.yaml', method='rodas5p', rate=1.0, tolerance=1e-11) as process, \
            Peer() as peer:
        peer.meet()
        reports = peer.listen(DiagnosticArray, '/diagnostics')
        peer.until(lambda: any('a tick is under way for' in r.status[0].message for r in reports))
        assert until_refused(lambda: peer.call('reset')).startswith('still under way after 2 s')
        process.wait_for('late answer to reset: initial state and zero efforts from tick')
        peer.until(lambda: any('"reset"' in event.data for event in peer.events))
        parameters_are_read_while_services_wait(peer)
        assert until_refused(lambda: peer.set(gravity=[0.0, -1.0])[0]) == (
            'not done: the simulation is in a tick that takes longer than 2 s')
        assert process.stop() == 0, process.output


def files(tmp_path, text):
    (tmp_path / 'parameters.yaml').write_text(text)
    return ['--params-file', str(tmp_path / 'parameters.yaml')]


def test_empty_lists_stand_for_the_default_wherever_they_are_given(tmp_path):
    text = '/**:\n  ros__parameters:\n    lockstep_joints: []\n    gravity: []\n    damping: []\n'
    path = tmp_path / 'run.mcap'
    with Process('planar_chain_sim.ros.node', '--ros-args', *files(tmp_path, text), '-p', 'effort_limit:=[]', '-p',
                 f'record:={path}') as process, Peer() as peer:
        process.wait_for('running')
        peer.meet()
        assert list(read_back(peer, 'gravity').double_array_value) == [0.0, -9.81]
        assert list(read_back(peer, 'lockstep_joints').string_array_value) == list(
            load_chain('four_link_robot.yaml').joint_names)
        assert peer.set(gravity=[1.0, -1.0])[0][0]
        empty = Parameter('gravity', Parameter.Type.DOUBLE_ARRAY, [])
        assert peer.ask(peer.parameters.set_parameters([empty])).results[0].successful
        assert list(read_back(peer, 'gravity').double_array_value) == [0.0, -9.81]
        assert process.stop() == 0, process.output


@pytest.mark.parametrize('heading, remapping, heard', [
    ('simulator', (), True), ('/simulator', (), True), ('/**', (), True), ('/*', (), True),
    ('sim', (), False), ('simulator', ('-r', '__ns:=/arm'), False), ('/arm/simulator', ('-r', '__ns:=/arm'), True),
    ('/*/simulator', ('-r', '__ns:=/arm'), True), ('/arm/*', ('-r', '__ns:=/arm'), True),
    ('/**/simulator', ('-r', '__ns:=/arm'), True), ('simulator', ('-r', '__node:=left'), False),
    ('left', ('-r', '__node:=left'), True)])
def test_a_parameter_file_for_another_node_is_told_and_no_other(context, heading, remapping, heard, tmp_path):
    arguments = ['--ros-args', *files(tmp_path, f'{heading}:\n  ros__parameters:\n    rate: 500.0\n'), *remapping]
    node = Node('simulator', context=context, cli_args=arguments, start_parameter_services=False)
    name = node.get_fully_qualified_name()
    try:
        told = list(unheard(arguments, name))
        assert declare_parameters(node)['rate'] == (500.0 if heard else 1000.0), 'as ROS itself takes it'
    finally:
        node.destroy_node()
    assert bool(told) != heard
    if told:
        assert f"use the heading '{name}:' or '/**:'" in told[0]


def test_the_node_warns_of_a_parameter_file_for_another_node(tmp_path):
    text = 'simulator:\n  ros__parameters:\n    rate: 500.0\n'
    with Process('planar_chain_sim.ros.node', '--ros-args', *files(tmp_path, text), '-r', '__ns:=/arm', '-p',
                 'sim:rate:=5.0') as process:
        assert "nothing for this node, /arm/simulator, only for /simulator: use the heading '/arm/simulator:'" in (
            process.wait_for('parameter file'))
        assert "for a node 'sim', this is /arm/simulator" in process.wait_for("'sim:rate:=5.0'")
        process.wait_for('running')
        assert process.stop() == 0


@pytest.mark.parametrize('text', ['', '# only this\n', 'simulator:\n', '/**:\n  rate: 5.0\n'])
def test_a_parameter_file_without_parameters_is_told(text, tmp_path):
    sentence, = unheard(['--ros-args', *files(tmp_path, text)], '/simulator')
    assert "has no parameters: they stand under '/simulator:' or '/**:' and under 'ros__parameters:'" in sentence


@pytest.mark.parametrize('text, correct', [
    ('[0, -1.62]', '[0.0, -1.62]'), ('[-1.62, 0]', '[-1.62, 0.0]'), ('[1, .inf]', '[1.0, .inf]')])
def test_whole_numbers_beside_decimals_are_explained(text, correct, tmp_path):
    code, words = run('planar_chain_sim.ros.node', '--ros-args', '-p', f'gravity:={text}')
    assert (code, words) == (2, "simulator: parameter 'gravity' mixes whole numbers and decimals in a list, which ROS "
                             f"refuses: write -p gravity:='{correct}'")
    path = files(tmp_path, f'/**:\n  ros__parameters:\n    gravity: {text}\n')
    code, words = run('planar_chain_sim.ros.node', '--ros-args', *path)
    assert (code, words) == (2, f"simulator: parameter file '{path[1]}' line 3: 'gravity' mixes whole numbers and "
                             f'decimals in a list, which ROS refuses: write {correct}')


@pytest.mark.parametrize('service', [SetParameters, SetParametersAtomically])
def test_a_parameter_of_a_type_that_there_is_not_is_refused(service):
    with simulator() as process, Peer() as peer:
        name = 'set_parameters' + ('_atomically' if service is SetParametersAtomically else '')
        client = peer.node.create_client(service, f'/simulator/{name}')
        peer.until(client.service_is_ready)
        peer.meet()
        strange = ParameterMessage(name='command_timeout', value=ParameterValue(type=77))
        answer = peer.ask(client.call_async(service.Request(parameters=[strange, strange])))
        results = [answer.result] if service is SetParametersAtomically else answer.results
        assert {(result.successful, result.reason) for result in results} == {
            (False, "parameter 'command_timeout' is of a type 77, which ROS does not have")}
        assert peer.set(rat=1.0, xyz=1.0) == [(False, "parameter 'rat' is not known, did you mean 'rate'?"),
                                              (False, "parameter 'xyz' is not known")]
        assert peer.set(command_timeout=1.0) == [(True, '')]
        assert process.stop() == 0, process.output


@pytest.mark.parametrize('parameters, sentence', [
    (('chain_file:=""',), "parameter 'chain_file' is '', must be a chain file"),
    (('tolerance:=1.0',), "parameter 'tolerance' is 1.0, must be below 1"),
    (('tolerance:=1e-9', 'method:=rk4'), "parameter 'tolerance' is 1e-09, must be 0: method 'rk4' has a fixed step")])
def test_values_that_do_not_go_together_are_one_sentence(declared, parameters, sentence):
    with pytest.raises(Mistake) as mistake:
        declared(*parameters)
    assert str(mistake.value) == sentence


@pytest.mark.parametrize('namespace, publish_rate, gravity', [('/left', 100.0, -9.81), ('/right', 50.0, -1.62)])
def test_the_parameter_file_of_two_arms_gives_each_its_own(namespace, publish_rate, gravity):
    arguments = ['--ros-args', '--params-file', CONFIG.parent / 'launch/two_arms.yaml', '-r', f'__ns:={namespace}']
    with Process('planar_chain_sim.ros.node', *arguments) as process, Peer(namespace=namespace) as peer:
        process.wait_for('running')
        peer.meet()
        assert read_back(peer, 'rate').double_value == 1000.0
        assert read_back(peer, 'on_controller_loss').string_value == 'hold'
        assert read_back(peer, 'publish_rate').double_value == publish_rate
        assert list(read_back(peer, 'gravity').double_array_value) == [0.0, gravity]
        assert process.stop() == 0, process.output
        assert 'nothing for this node' not in process.output
