"""The page of a robot in ROS: what it shows, and what it changes as read back over real DDS."""
import asyncio
from contextlib import suppress
import json
import os
import shlex
import signal
import subprocess
import sys
from time import monotonic

import numpy as np
from pages import Page, until, View
import pytest

rclpy = pytest.importorskip('rclpy')

from geometry_msgs.msg import WrenchStamped  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from ros.live import CONFIG, PATIENCE, Peer, simulator  # noqa: E402
from screen import across, Screen  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import String  # noqa: E402

import planar_chain_sim as pcs  # noqa: E402

pytestmark = pytest.mark.ros

CHAIN = pcs.load_chain(CONFIG / 'four_link_robot.yaml')
FOREARM = CHAIN.body_index['forearm']
TOWARDS_THE_MOUSE = """
const {fx, fy} = view.arms[0].bodies[arguments[0]], {from: [x, y], to: [tx, ty]} = view.drawing.pull;
return fx * (tx - x) + fy * (ty - y) > 0.9 * Math.hypot(fx, fy) * Math.hypot(tx - x, ty - y);
"""
READY = """
return view.status && view.status.can.length === 9 && !view.status.paused && view.scene[0].bodies.length === 4;
"""
HANG = 'setTimeout(() => { const end = performance.now() + 4000; while (performance.now() < end); }, 0);'


class Robot:
    """A simulator of the four-link robot, its peer, and the page that shows it."""

    def __init__(self, peer, view):
        self.peer, self.view = peer, view

    def event(self, kind, matches=lambda data: True, first=0):
        """Return the data of the first event of this kind after the first so many messages, once it has come."""
        def look():
            found = (json.loads(message.data) for message in self.peer.events[first:])
            return next(([each['data']] for each in found if each['kind'] == kind and matches(each['data'])), None)
        return self.peer.until(look, f'the event {kind}')[0]

    def now(self):
        """Return how many events have come so far, as a beginning for event()."""
        self.peer.poll()
        return len(self.peer.events)


@pytest.fixture(scope='module')
def robot():
    with simulator() as process, Peer() as peer, View('--port', '0') as view:
        peer.meet()
        yield Robot(peer, view)
        view.stop()
        assert process.stop() == 0, process.output


@pytest.fixture
def screen(browser, robot):
    """Return the robot's page in the browser, with all controls there and the simulation running."""
    shown = Screen(browser, robot.view.address)
    until(lambda: shown(READY))
    yield shown
    shown.browser.get('about:blank')
    robot.peer.call('pause', False)
    robot.peer.call('reset')


@pytest.mark.slow
def test_the_arm_is_drawn_to_a_pixel_where_the_state_says(screen, robot):
    screen.click('pause')
    until(lambda: screen('return view.status.paused'))
    robot.peer.call('reset')   # to where no body hides another one
    state = robot.peer.new_state(lambda new: list(new.position) == [joint.position for joint in CHAIN.joints])
    until(lambda: screen.arm()['position'] == list(state.position))
    poses = pcs.body_poses(CHAIN, state.position)
    drawn, scene = screen.arm(), screen('return view.scene[0]')
    screen('[view.camera.x, view.camera.y, view.camera.scale, view.camera.touched] = [...arguments, true]',
           *poses.center_of_mass.mean(axis=0), 240.0)   # px per m
    frames = screen('return view.frames')
    until(lambda: screen('return view.frames') > frames + 1)
    picture = screen.picture()
    marks = np.array([screen.pixel(point) for point in (*poses.point, *poses.center_of_mass)])
    looked = 0
    for index, (body, shown) in enumerate(zip(scene['bodies'], drawn['bodies'])):
        assert screen('return view.camera.toPixel(arguments[0], arguments[1])', *poses.point[index]) == pytest.approx(
            screen.pixel(poses.point[index]), abs=1e-6)
        assert [shown['x'], shown['y'], shown['cx'], shown['cy']] == [*poses.point[index], *poses.center_of_mass[index]]
        ends = [poses.point[k] for k, each in enumerate(CHAIN.bodies) if each.carrier == index]
        ends = ends or [2.0 * poses.center_of_mass[index] - poses.point[index]]
        farthest = max(ends, key=lambda end: np.hypot(*(end - poses.point[index])))
        start, end = np.array(screen.pixel(poses.point[index])), np.array(screen.pixel(farthest))
        for share in np.linspace(0.1, 0.9, 17):
            if min(np.hypot(*(marks - start - share * (end - start)).T)) > 16.0:   # px: no joint or centre is there
                assert abs(across(picture, start, end, share, body['color'])) <= 1.0, (body['name'], share)
                looked += 1
    assert looked >= 8
    assert screen.errors() == []


@pytest.mark.slow
def test_pause_step_and_reset(screen, robot):
    first = robot.now()
    screen.click('pause')
    robot.event('pause', first=first)
    state = robot.peer.standing_state()
    screen.click('step')
    after = robot.peer.new_state(lambda new: new.header.stamp != state.header.stamp)
    robot.event('step', first=first)
    simulation = pcs.Simulation(CHAIN)
    simulation.set_state(state.position, state.velocity)
    simulation.advance(1)
    np.testing.assert_allclose(after.position, simulation.position, rtol=0, atol=1e-12)   # one tick on
    screen.click('reset')
    robot.event('reset', first=first)
    robot.peer.new_state(lambda new: list(new.position) == [joint.position for joint in CHAIN.joints])
    screen.click('pause')
    robot.event('resume', first=first)


@pytest.mark.slow
def test_a_slider_is_an_effort_while_it_is_held(screen, robot):
    slider = screen.browser.find_element('css selector', '[aria-label="effort of forearm_joint"]')
    first, span = robot.now(), screen('return view.scene[0].joints[3].span')
    screen.slide(slider, 0.25)
    wanted = robot.event('command', lambda data: data['effort'][3] > 0.2 * span, first)['effort']
    assert wanted[:3] == [0.0, 0.0, 0.0] and wanted[3] <= span and wanted[4] == 0.0
    robot.peer.new_state(lambda state: state.effort[3] > 0.2 * span)
    screen.let_go()
    robot.peer.new_state(lambda state: not any(state.effort))
    assert float(slider.get_attribute('value')) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize('end', ['release', 'close', 'reload', 'hang'])
def test_a_body_is_pulled_until_the_mouse_lets_go_or_the_page_goes(screen, robot, end):
    """The force points from the body to the mouse, and the arm gives way."""
    browser, home = screen.browser, screen.browser.current_window_handle
    browser.switch_to.new_window('tab')
    page = Screen(browser, robot.view.address)
    robot.peer.call('pause', True)   # so that the mouse meets the body
    state_before = robot.peer.standing_state()
    until(lambda: page('return view.status && view.status.can.includes("pull")')
          and page.arm()['position'] == list(state_before.position))
    body = page.arm()['bodies'][FOREARM]
    tip = body['segments'][0]
    first = robot.now()
    page.press(page.pixel((0.2 * body['x'] + 0.8 * tip['x2'], 0.2 * body['y'] + 0.8 * tip['y2'])), (60, 60))
    robot.peer.call('pause', False)
    data = robot.event('wrench', lambda data: abs(complex(*data['force'])) > 1.0, first)
    assert data['body'] == 'forearm' and data['axes'] == 'body'
    until(lambda: page(TOWARDS_THE_MOUSE, FOREARM))
    robot.peer.new_state(lambda state: abs(state.position[3] - state_before.position[3]) > 0.01)
    first = robot.now()
    if end == 'release':
        page.let_go()
    elif end == 'close':
        browser.close()
    elif end == 'reload':
        browser.refresh()
    else:
        page(HANG)
    robot.event('wrench', lambda data: data['body'] == 'forearm' and not any((*data['force'], data['moment'])), first)
    if end != 'close':
        browser.close()
    browser.switch_to.window(home)


@pytest.mark.slow
def test_settings_reach_the_node(screen, robot):
    first = robot.now()
    slider = screen.browser.find_element('css selector', '#settings [data-needs="gravity"]')
    screen.slide(slider, 0.1)
    screen.let_go()
    value = robot.event('parameter', lambda data: data['name'] == 'gravity', first)['value']
    assert value[0] == 0.0 and value != [0.0, -9.81]
    until(lambda: screen('return view.status.values.gravity[1]') == float(slider.get_attribute('value')))
    robot.peer.set(gravity=[0.0, -9.81])
    until(lambda: screen('return view.status.values.gravity[1]') == -9.81)


def test_a_view_that_is_ended_lets_go_of_what_its_pages_hold(robot):
    """SIGTERM in the midst of a pull and of an effort."""
    async def hold(address):
        async with Page(address) as page:
            def acts(arm):
                return arm['bodies'][FOREARM, 5:].any() and arm['effort'][2] == 1.5
            place = {'body': 'forearm', 'point': [0.3, 0.0], 'to': [1.0, 1.0]}
            await page.until(lambda arm: len(page.status['can']) == 9 and len(arm['bodies']) == 4)
            end = monotonic() + PATIENCE
            while not acts((await page.frame())[0]):
                assert monotonic() < end, page.refused
                await page.say('pull', **place)
                await page.say('effort', joint='upper_arm_joint', value=1.5)
            first = robot.now()
            view.popen.send_signal(signal.SIGTERM)
            return first
    with View('--port', '0') as view:
        first = asyncio.run(hold(view.address))
        assert view.end() == 0, view.lines
    robot.event('wrench', lambda data: data['body'] == 'forearm' and not any(data['force']), first)
    robot.peer.new_state(lambda state: not any(state.effort))


URDF = """<robot name="other"><link name="base_link"/><link name="rod"><inertial><origin xyz="0 0 -.5"/>
  <mass value="2"/><inertia ixx=".2" iyy=".2" izz=".2" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="continuous"><parent link="base_link"/><child link="rod"/><origin xyz="{place} 0 .3"/>
  <axis xyz="0 1 0"/></joint>{more}</robot>"""
MORE = """<link name="disc"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link><joint name="other" type="continuous"><parent link="rod"/><child link="disc"/><axis xyz="1 0 0"/>
  </joint>"""


def test_a_robot_that_only_says_what_it_is_and_where(robot):
    """No node of this package: states of two publishers, one without efforts; nothing can be changed."""
    node, told = robot.peer.node, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    descriptions = node.create_publisher(String, '/other/robot_description', told)
    states = [node.create_publisher(JointState, '/other/joint_states', 10) for _ in range(2)]
    wrenches = node.create_publisher(WrenchStamped, '/other/peer/wrench', 1)   # nobody takes them
    descriptions.publish(String(data=URDF.format(place='0', more='')))

    def publish():
        states[0].publish(JointState(name=['hinge'], position=[0.25]))
        states[1].publish(JointState(name=['gripper'], position=[1.0], velocity=[0.0], effort=[0.0]))

    async def look(address):
        async with Page(address) as page:
            async def shown(condition):
                end = monotonic() + PATIENCE
                while True:
                    publish()
                    arms = await page.frame()
                    if condition(arms):
                        return arms
                    assert monotonic() < end, page.status
                    await asyncio.sleep(0.02)
            arm, = await shown(lambda arms: arms)
            assert page.source == 'live' and page.scene[0]['name'] == 'other'
            assert arm['position'][0] == 0.25 and np.isnan(arm['velocity'][0]) and np.isnan(arm['head'][2])
            rod = [body['name'] for body in page.scene[0]['bodies']].index('rod')
            np.testing.assert_allclose(arm['bodies'][rod, 3:5] - arm['bodies'][rod, :2],
                                       [-0.5 * np.sin(0.25), -0.5 * np.cos(0.25)], atol=1e-12)
            await page.say('effort', joint='hinge', value=1.0)
            await page.say('pause', value=True)
            await shown(lambda arms: len(page.refused) > 0)
            assert page.status['can'] == [] and page.refused[-1] == "this robot does not offer 'pause'"
            descriptions.publish(String(data=URDF.format(place='1', more='')))   # another robot
            await shown(lambda arms: arms and abs(arms[0]['bodies'][rod, 0] - 1.0) < 1e-9)
            descriptions.publish(String(data=URDF.format(place='1', more=MORE)))   # which is not planar
            await shown(lambda arms: page.status['fault'])
            assert 'robot_description' in page.status['sentence'] and page.scene == []
    with View('--port', '0', '--ros-args', '-r', '__ns:=/other') as view:
        asyncio.run(look(view.address))
        view.stop()
    for publisher in (descriptions, *states, wrenches):
        node.destroy_publisher(publisher)


def test_in_lockstep_efforts_are_those_of_the_controller_alone():
    async def look(address):
        async with Page(address) as page:
            await page.until(lambda arm: {'pull', 'gravity'} <= {*page.status['can']})
            assert 'effort' not in page.status['can']
            await page.until(lambda arm: page.refused, 'effort', joint='column_joint', value=1.0)
            assert page.refused[0] == "this robot does not offer 'effort'"
    with simulator('__ns:=/answers', lockstep=True) as process, View('--port', '0', '--ros-args', '-r',
                                                                     '__ns:=/answers') as view:
        asyncio.run(look(view.address))
        view.stop()
        assert process.stop() == 0, process.output


ROOT = CONFIG.parent


def test_make_run_starts_simulator_and_page_and_ctrl_c_ends_both(tmp_path):
    """The Makefile's own line, with executables of these sources; the page finds the arm in its namespace."""
    folder = subprocess.run('pwd | cksum', shell=True, cwd=ROOT, capture_output=True, text=True).stdout.split()[0]
    (tmp_path / f'run-ready-{folder}').touch()
    (tmp_path / 'bin').mkdir()
    for name, module in (('simulator', 'ros.node'), ('view', 'view.command_line')):
        (tmp_path / 'bin' / name).write_text(
            f'#!/bin/sh\nexport PYTHONPATH={shlex.quote(os.pathsep.join(sys.path))} PYTHONUNBUFFERED=1\n'
            f'exec {shlex.quote(sys.executable)} -m planar_chain_sim.{module} "$@"\n')
        (tmp_path / 'bin' / name).chmod(0o755)
    run = ['make', 'run', f'VENV={tmp_path}', 'ARGS=double_pendulum.yaml --ros-args -r __ns:=/made -p rate:=500.0']
    assert '--beside' not in subprocess.run([*run, 'VIEW=0', '-n'], cwd=ROOT, capture_output=True, text=True).stdout
    made = subprocess.Popen(run, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            start_new_session=True)
    try:
        address = next(line for line in made.stdout if 'the arm is at' in line).split()[-1]

        async def look():
            async with Page(address) as page:
                first = await page.until(lambda arm: page.status['name'] == '/made/simulator')
                await page.until(lambda arm: arm['head'][0] > first['head'][0])
                return page.scene[0]['name']
        assert asyncio.run(look()) == 'double_pendulum'
        os.killpg(made.pid, signal.SIGINT)
        rest = made.stdout.read()   # up to the end of both
        assert 'Traceback' not in rest, rest
    finally:
        with suppress(ProcessLookupError):
            os.killpg(made.pid, signal.SIGKILL)
        made.wait()
