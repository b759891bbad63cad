"""MJCF files: the motion is MuJoCo's; what would change it is refused by name; any text gives a chain or a sentence."""
import re
import subprocess
import sys
import warnings

import mujoco
import numpy as np
from oracles.random_mjcf import RandomMjcf
from oracles.work import lines_run
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.errors import RobotFileNote

PENDULUM = """<mujoco model="pendulum"><compiler angle="radian"/>
  {head}
  <worldbody>
    {world}
    <body name="rod" pos="0 0 2" {body}>
      <joint name="hinge" axis="0 1 0" {joint}/>
      <geom name="bar" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1" {geom}/>
      {inner}
    </body>
  </worldbody>
  {tail}
</mujoco>"""


def pendulum(**parts):
    nothing = dict.fromkeys(('head', 'world', 'body', 'joint', 'geom', 'inner', 'tail'), '')
    return PENDULUM.format(**{**nothing, **parts})


def read(text, hold=None):
    """Return the chain and the line about the file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        chain = chain_from_text(text, 'm.xml', hold)
    notes = [str(warning.message) for warning in caught if issubclass(warning.category, RobotFileNote)]
    assert len(notes) == 1 and notes[0].startswith('m.xml: joints ')
    return chain, notes[0]


def refusal(text, hold=None):
    with pytest.raises(pcs.ChainError) as refused:
        read(text, hold)
    sentence = str(refused.value)
    assert sentence.startswith('m.xml') and ', must' in sentence and sentence.isprintable() and len(sentence) < 700
    return sentence


def model_of(text):
    """Return MuJoCo's model with contacts, limits and dry friction off, which are soft there."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return model


def differs(model, chain, seed):
    """Return the error of accelerations against MuJoCo at a random state, and what is allowed, 1 for 1 rad/s^2."""
    data = mujoco.MjData(model)
    position, velocity, effort = np.random.default_rng(seed).normal(0.0, 1.0, (3, model.nv))
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = position, velocity, effort
    mujoco.mj_forward(model, data)
    assert [model.joint(k).name for k in range(model.njnt)] == list(chain.joint_names)
    for joint in chain.joints:      # as in MuJoCo with constraints off
        object.__setattr__(joint, 'friction', 0.0)
    got = pcs.forward_dynamics(chain, position, velocity, effort)
    condition = np.linalg.cond(pcs.mass_matrix(chain, position))
    scale = max(1.0, abs(data.qacc).max())
    return abs(got - data.qacc).max() / scale, max(1e-12, 100 * condition * np.finfo(float).eps)


@pytest.mark.slow
@pytest.mark.parametrize('hundred', range(6))
def test_random_mechanisms_move_as_in_mujoco(hundred):
    """Oracle: 600 texts of every geom, pose, class, frame and compiler option that is read; 1e-12, or round-off."""
    compared = close = 0
    for seed in range(100 * hundred, 100 * hundred + 100):
        text = RandomMjcf(seed).text
        try:
            model = model_of(text)
        except ValueError as error:
            assert 'mjMINVAL' in str(error)   # no mass in the groups that count: no mechanism for MuJoCo either
            continue
        chain, _ = read(text)
        for state in range(2):
            error, allowed = differs(model, chain, state)
            assert error <= allowed, seed
            close += error <= 1e-12
        compared += 1
    assert compared >= 90 and close >= 1.7 * compared


# Small texts of the kinds that people have, one of each.
CARTPOLE = """<mujoco model="cart-pole">
  <include file="./common/skybox.xml"/><include file="./common/materials.xml"/>
  <option timestep="0.01" integrator="RK4"><flag contact="disable" energy="enable"/></option>
  <default><default class="pole"><joint type="hinge" axis="0 1 0" damping="2e-6"/>
    <geom type="capsule" fromto="0 0 0 0 0 1" size="0.045" mass=".1" material="self"/></default></default>
  <worldbody><light pos="0 0 6"/><camera name="fixed" pos="0 -4 1" zaxis="0 -1 0"/>
    <geom name="floor" pos="0 0 -.05" size="4 4 .2" type="plane"/>
    <geom name="rail" type="capsule" pos="0 .07 1" zaxis="1 0 0" size="0.02 2"/>
    <body name="cart" pos="0 0 1">
      <joint name="slider" type="slide" limited="true" axis="1 0 0" range="-1.8 1.8" solreflimit=".08 1"
        damping="5e-4"/>
      <geom name="cart" type="box" size="0.2 0.15 0.1" mass="1"/>
      <body name="pole_1" childclass="pole"><joint name="hinge_1"/><geom name="pole_1"/>
        <body name="pole_2" pos="0 0 1" childclass="pole"><joint name="hinge_2"/><geom name="pole_2"/></body></body>
    </body></worldbody>
  <actuator><motor name="slide" joint="slider" gear="10" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>"""
REACHER = """<mujoco model="reacher"><compiler angle="radian" inertiafromgeom="true"/>
  <default><joint armature="1" damping="1" limited="true"/><geom contype="0" friction="1 0.1 0.1"/></default>
  <option gravity="0 0 -9.81" integrator="RK4" timestep="0.01"/>
  <worldbody><geom conaffinity="0" contype="0" name="ground" size="1 1 10" type="plane"/>
    <geom conaffinity="0" fromto="-.3 -.3 .01 .3 -.3 .01" name="side" size=".02" type="capsule"/>
    <body name="body0" pos="0 0 .01"><geom fromto="0 0 0 0.1 0 0" size=".01" type="capsule"/>
      <joint axis="0 0 1" limited="false" name="joint0" type="hinge"/>
      <body name="body1" pos="0.1 0 0"><joint axis="0 0 1" name="joint1" range="-3.0 3.0" type="hinge"/>
        <geom fromto="0 0 0 0.1 0 0" size=".01" type="capsule"/>
        <body name="tip" pos="0.11 0 0"><geom contype="0" size=".01" type="sphere"/></body></body></body>
    <body name="target" pos=".1 -.1 .01">
      <joint armature="0" axis="1 0 0" damping="0" name="target_x" range="-.27 .27" ref=".1" type="slide"/>
      <joint armature="0" axis="0 1 0" damping="0" name="target_y" range="-.27 .27" ref="-.1" type="slide"/>
      <geom conaffinity="0" contype="0" size=".009" type="sphere"/></body></worldbody>
  <actuator><motor ctrllimited="true" ctrlrange="-1.0 1.0" gear="200.0" joint="joint0"/>
    <motor ctrllimited="true" ctrlrange="-0.5 1.0" gear="-200.0" joint="joint1"/></actuator>
</mujoco>"""
HOPPER = """<mujoco model="hopper"><compiler angle="degree"/>
  <option integrator="RK4">{flag}</option>
  <default><joint limited="true" armature="1" damping="1"/><general ctrllimited="true" ctrlrange="-0.4 0.4"/></default>
  <worldbody><geom name="floor" size="20 20 .125" type="plane" condim="3"/>
    <body name="torso" pos="0 0 1.25">
      <joint name="rootx" pos="0 0 -1.25" axis="1 0 0" limited="false" type="slide" armature="0" damping="0"/>
      <joint name="rootz" pos="0 0 -1.25" axis="0 0 1" limited="false" type="slide" ref="1.25" armature="0"
        damping="0"/>
      <joint name="rooty" axis="0 1 0" limited="false" armature="0" damping="0"/>
      <geom name="torso" size="0.05 0.2" type="capsule"/>
      <body name="thigh" pos="0 0 -0.2"><joint name="hip" axis="0 -1 0" range="-150 0"/>
        <geom size="0.05 0.225" pos="0 0 -0.225" type="capsule"/>
        <body name="leg" pos="0 0 -0.7"><joint name="knee" pos="0 0 0.25" axis="0 -1 0" range="5 150"/>
          <geom size="0.04 0.25" type="capsule"/>
          <body name="foot" pos="0.13 0 -0.35"><joint name="ankle" pos="-0.13 0 0.1" axis="0 -1 0" range="-45 45"/>
            <geom name="foot" size="0.06 0.195" pos="-0.065 0 0.1" quat="0.7 0 -0.7 0" type="capsule"/>
          </body></body></body>
    </body></worldbody>
  <actuator><general joint="hip" ctrlrange="-1 1" gear="200 0 0 0 0 0"/><general joint="knee" gear="100"/></actuator>
</mujoco>"""
ACROBOT = """<mujoco model="acrobot"><default><joint damping=".05"/><geom type="capsule" mass="1"/></default>
  <option timestep="0.01"><flag constraint="disable" energy="enable"/></option>
  <worldbody><geom name="floor" size="3 3 .2" type="plane"/>
    <body name="upper_arm" pos="0 0 2"><joint name="shoulder" type="hinge" axis="0 1 0"/>
      <geom type="cylinder" fromto="0 -.06 0 0 .06 0" size="0.051" mass="0"/>
      <geom fromto="0 0 0 0 0 1" size="0.05"/>
      <body name="lower_arm" pos="0 0 1"><joint name="elbow" type="hinge" axis="0 1 0"/>
        <geom fromto="0 0 0 0 0 1" size="0.049"/><site name="tip" pos="0 0 1"/></body></body></worldbody>
  <sensor><framepos objtype="site" objname="tip"/></sensor>
  <actuator><motor name="elbow" joint="elbow" gear="2" ctrllimited="true" ctrlrange="-1 1"/></actuator></mujoco>"""
KINDS = {'cartpole': CARTPOLE, 'reacher': REACHER, 'acrobot': ACROBOT, 'pendulum': pendulum(),
         'hopper': HOPPER.format(flag='<flag contact="disable"/>')}


@pytest.mark.parametrize('kind', KINDS)
def test_common_models_move_as_in_mujoco(kind):
    text = KINDS[kind]
    chain, _ = read(text)
    model = model_of(re.sub('<include[^>]*>|material="self"', '', text))
    for seed in range(20):
        error, allowed = differs(model, chain, seed)
        assert error <= 1e-12 <= allowed


def test_a_scara_moves_as_in_mujoco():
    """Its slide along the normal, with weight, gravcomp of half, a spring and a rotor, is a joint like others."""
    text = """<mujoco><option gravity="0 1 -9.81"><flag contact="disable"/></option><worldbody>
      <body gravcomp="0.5"><joint name="a" axis="0 0 1" damping="0.2"/><geom type="box" size=".3 .1 .1" pos=".2 0 0"/>
        <body gravcomp="0.5" pos=".5 0 0"><joint name="b" axis="0 0 -1"/><geom type="box" size=".2 .1 .1" pos=".2 0 0"/>
          <body gravcomp="0.5" pos=".4 0 0"><joint name="z" type="slide" axis="0 0 -1" ref="0.1" stiffness="30"
            springref="0.2" armature="0.5" damping="2"/><geom size=".05"/>
            <body gravcomp="0.5" pos="0 0 -.2"><joint name="zz" type="slide" axis="0 0 1"/><geom size=".04"/></body>
          </body></body></body></worldbody></mujoco>"""
    chain, note = read(text)
    assert "along its normal, on their own, slide 'z', 'zz'" in note
    model = model_of(text)
    for seed in range(20):
        error, _ = differs(model, chain, seed)
        assert error <= 1e-12


def test_laws_limits_and_motors_are_taken():
    chain, note = read(REACHER)
    assert [(joint.lower, joint.upper, joint.position, joint.effort_limit) for joint in chain.joints] == [
        (-np.inf, np.inf, 0.0, 200.0), (-3.0, 3.0, 0.0, 200.0), (-.27, .27, .1, np.inf), (-.27, .27, -.1, np.inf)]
    assert chain.gravity == 0j
    assert "effort limits taken as symmetric, by their larger side, at 'joint1';" in note
    assert 'without a motor, but can be commanded here: target_x' in note
    chain, note = read(KINDS['hopper'])
    assert [joint.effort_limit for joint in chain.joints[3:]] == [200.0, 40.0, np.inf]
    assert chain.joints[1].position == 1.25 and chain.joints[4].position == np.radians(5.0)
    assert "initial position moved to the stop at 'knee'" in note and 'hard here, soft in MuJoCo' in note
    chain, note = read(CARTPOLE)
    assert chain.joints[0].effort_limit == 10.0 and './common/skybox.xml' in note
    chain, note = read(ACROBOT)
    assert note.startswith("m.xml: joints 'shoulder', 'elbow'; plane with x along x and y along z of link 'world'; "
                           'gravity [0, -9.81] m/s^2; ') and 'sensors' in note and 'option timestep' in note


@pytest.mark.parametrize('parts', [
    {'joint': 'stiffness="3" springref="0.4" ref="0.2" damping="0.3" armature="0.1"'},
    {'tail': '<actuator><motor joint="hinge" gear="3" armature="0.2" damping="0.1"/></actuator>'},
    {'body': 'gravcomp="0.4"'},
    {'head': '<option gravity="1 2 3"><flag gravity="disable"/></option>'},
    {'head': '<option><flag spring="disable" damper="disable"/></option>', 'joint': 'damping="1" stiffness="2"'},
    {'head': '<default><geom density="3"/></default>', 'geom': 'group="3"'},
    {'head': '<compiler inertiagrouprange="0 2"/>', 'geom': 'group="3"', 'inner': '<geom size="0.1" pos="0.3 0 0"/>'},
    {'head': '<compiler inertiafromgeom="false"/>',
     'inner': '<inertial pos="0.1 0 0.2" mass="2" fullinertia="1 2 2.5 .1 0 0"/>'},
    {'head': '<compiler balanceinertia="true"/>', 'inner': '<inertial pos="0 0 0.2" mass="2" diaginertia="1 1 5"/>'},
    {'joint': 'range="5 3"'},
], ids=str)
def test_one_thing_at_a_time_moves_as_in_mujoco(parts):
    text = pendulum(**parts)
    chain, _ = read(text)
    model = model_of(text)
    for seed in range(5):
        error, _ = differs(model, chain, seed)
        assert error <= 1e-12
    assert chain.joints[0].lower == -np.inf


def test_a_mass_made_by_boundmass_lies_at_pos_as_written():
    """Oracle: MuJoCo, which puts it there before it applies the frames around the body."""
    text = """<mujoco><compiler boundmass="2" boundinertia="0.1"/><option><flag contact="disable"/></option><worldbody>
      <body name="a" pos="0.3 0 0"><joint name="s" axis="0 1 0"/><geom size=".1" mass="1"/>
      <frame pos="0 0 -0.4" euler="0 40 0"><frame pos="0.1 0 0" euler="0 10 0"><body name="b" pos="0.5 0 -0.2"
      euler="0 {} 0"><joint name="e" axis="0 1 0"/>{}</body></frame></frame></body></worldbody></mujoco>"""
    for seed in range(20):
        for inner in ('', '<body pos="0.2 0 0.1"/>', '<frame euler="0 50 0"><body pos="0.2 0 0.1"/></frame>'):
            own = text.format(20 * seed, inner)
            error, _ = differs(model_of(own), read(own)[0], seed)
            assert error <= 1e-12


@pytest.mark.parametrize('motors, limit', [
    ('<motor joint="hinge" ctrlrange="-1 10" forcerange="-10 1"/>', 1.0),
    ('<motor joint="hinge" ctrlrange="-1 10" forcerange="-10 4" gear="-2"/>', 8.0),
    ('<motor joint="hinge" ctrlrange="-1 10"/><motor joint="hinge" ctrlrange="-10 1"/>', 11.0),
    ('<motor joint="hinge" ctrlrange="-1 5"/><motor joint="hinge" ctrlrange="-1 5" gear="-1"/>', 6.0),
    ('<general joint="hinge" ctrlrange="-1 5" gainprm="-3" forcerange="-20 1"/>', 15.0),
    ('<motor joint="hinge" ctrlrange="0 5"/><motor joint="hinge" gear="0"/>', 5.0),
    ('<motor joint="hinge" gear="0"/>', 0.0), ('<general joint="hinge" gainprm="0"/>', 0.0),
    ('<general joint="hinge" gainprm="0" ctrlrange="-1 1" forcerange="-9 9" gear="5"/>', 0.0),
    ('<motor joint="hinge"/><motor joint="hinge" ctrlrange="-1 1"/>', np.inf),
])
def test_an_effort_limit_is_what_the_motors_can_give(motors, limit):
    """Twin: MuJoCo's largest force of actuators over commands at the corners of -100 and 100."""
    text = pendulum(tail=f'<actuator>{motors}</actuator>')
    chain, note = read(text)
    assert chain.joints[0].effort_limit == limit and f'hinge {limit:g}' in note
    assert ('gives no force' in note) == ('"0"' in motors)
    model = mujoco.MjModel.from_xml_string(text)
    data, most = mujoco.MjData(model), 0.0
    for corner in range(2 ** model.nu):
        data.ctrl[:] = [100.0 if corner >> k & 1 else -100.0 for k in range(model.nu)]
        mujoco.mj_forward(model, data)
        most = max(most, abs(data.qfrc_actuator[0]))
    assert most == min(limit, 101.0)


def test_an_effort_limit_is_within_the_range_of_the_joint():
    joint, motor = 'actuatorfrcrange="-2 7"', '<actuator><motor joint="hinge" ctrlrange="-{} {}"/></actuator>'
    for ends, limit in (((9, 1), 2.0), ((1, 9), 7.0), ((9, 9), 7.0), ((1, 1), 1.0)):
        assert read(pendulum(joint=joint, tail=motor.format(*ends)))[0].joints[0].effort_limit == limit


def test_a_keyframe_is_the_initial_state():
    chain, note = read(pendulum(tail='<keyframe><key name="up" qpos="3" qvel="0.5"/><key qpos="1"/></keyframe>'))
    assert (chain.joints[0].position, chain.joints[0].velocity) == (3.0, 0.5)
    assert "starts at keyframe 'up'" in note and 'other keyframes' in note


SPRING = '<tendon><fixed name="t" {}><joint joint="hinge" coef="1"/></fixed></tendon>'


@pytest.mark.parametrize('parts, sentence', [
    ({'inner': '<freejoint/>'},
     'freely: the robot is not planar, must be a hinge or slide, or be removed, which fixes the body where it is'),
    ({'tail': '<actuator><motor name="m" joint="hinge" ctrlrange="1 3"/></actuator>'},
     "motor 'm' moves its joint without a command"),
    ({'inner': '<joint name="twin" axis="0 1 0"/>'}, "m.xml: joint 'hinge' makes the mass matrix singular"),
    ({'joint': 'type="ball"'}, "joint 'hinge' is of type ball"),
    ({'inner': '<joint name="odd" axis="1 0 0" armature="1"/>'}, "'odd'"),
    ({'joint': 'springdamper="1 1"'}, 'has springdamper, which is not read'),
    ({'joint': 'damping="1 2"'}, 'damping that is not linear'),
    ({'joint': 'damping="-1"'}, 'has damping -1, must be at least 0'),
    ({'joint': 'dampng="1"'}, "unknown (did you mean 'damping'?)"),
    ({'joint': 'limited="true"'}, "has the range ''"),
    ({'joint': 'range="0 nan"'}, "has range '0 nan', must be 2 finite numbers"),
    ({'joint': 'class="nobody"'}, "class 'nobody', which the file does not define"),
    ({'geom': 'shellinertia="true" density="3"'}, 'shellinertia'),
    ({'inner': '<geom type="mesh" mesh="m"/>'}, 'in another file'),
    ({'head': '<option density="1.2"/>'}, 'density or viscosity of the air'),
    ({'head': '<option viscosity="1"/>'}, 'density or viscosity of the air'),
    ({'head': '<include file="arm.xml"/>'}, "includes 'arm.xml', other files are not read"),
    ({'head': '<compiler coordinate="global"/>'}, "has coordinate 'global'"),
    ({'body': 'quat="1 0 0 0" euler="0 0 0"'}, 'has quat and euler, must have one of them'),
    ({'world': '<joint/>'}, 'is not read here'),
    ({'inner': '<replicate count="3"><geom size="1"/></replicate>'}, 'is not read here'),
    ({'tail': '<equality><weld name="w" body1="rod"/></equality>'}, "weld 'w' is a constraint"),
    ({'tail': SPRING.format('stiffness="3"')}, 'is a tendon with stiffness'),
    ({'tail': SPRING.format('range="-1 1"')}, 'is a tendon with range'),
    ({'tail': '<actuator><position name="p" joint="hinge" kp="3"/></actuator>'}, "position 'p' moves its joint"),
    ({'tail': '<actuator><velocity joint="hinge" kv="3"/></actuator>'}, 'moves its joint without a command'),
    ({'tail': '<actuator><general joint="hinge" biastype="affine" biasprm="0 -3 0"/></actuator>'}, 'without a command'),
    ({'tail': '<actuator><motor joint="hing"/></actuator>'}, "which is not there (did you mean 'hinge'?)"),
    ({'world': '<geom name="wall" type="box" size="1 1 1"/>'}, "could touch another: 'wall' and 'bar'"),
    ({'world': '<geom name="floor" type="plane" size="1 1 1" pos="0 0 1.9"/>'}, 'contact="disable"'),
    ({'world': '<body name="b" gravcomp="1"><joint axis="0 1 0"/><geom contype="0" conaffinity="0" size=".1"/></body>'},
     "body 'rod' has gravcomp 0"),
], ids=str)
def test_what_would_change_the_motion_is_refused_by_name(parts, sentence):
    assert sentence in refusal(pendulum(**parts))


@pytest.mark.parametrize('parts, unused', [
    ({'world': '<geom name="floor" type="plane" size="1 1 1"/>'}, ''),     # too far below to be touched
    ({'tail': '<equality><weld name="w" active="false" body1="rod"/></equality>'}, 'equality w'),
    ({'head': '<option><flag equality="disable"/></option>', 'tail': '<equality><weld body1="rod"/></equality>'},
     'weld equality on line '),
    ({'tail': SPRING.format('')}, 'tendon t'),
    ({'tail': SPRING.format('').replace('name="t"', '')}, 'fixed tendon on line 1'),
    ({'tail': '<actuator><cylinder joint="hinge"/></actuator>'}, 'cylinder on line 1'),
    ({'inner': '<site name="s"/>', 'tail': '<actuator><motor site="s"/></actuator>'},
     'motor on line 11 (not at a joint)'),
    ({'tail': '<actuator><damper name="d" joint="hinge" kv="2" ctrlrange="0 1"/></actuator>'}, 'damper d'),
    ({'head': '<option><flag actuation="disable"/></option>',
      'tail': '<actuator><position name="p" joint="hinge"/></actuator>'}, 'actuator p'),
    ({'inner': '<geom type="mesh" mesh="m" mass="0" contype="0" conaffinity="0"/>'}, ''),
    ({'inner': '<site name="s"/><camera/><light/>', 'head': '<size memory="1M"/><visual/><statistic/><custom/>'}, ''),
], ids=str)
def test_unused_parts_are_listed(parts, unused):
    _, note = read(pendulum(**parts))
    assert unused in note.partition('not used: ')[2] if unused else 'not used' not in note


def test_hold_makes_a_robot_planar_that_has_one_joint_too_many():
    text = pendulum(inner='<joint name="odd" axis="1 0 0" armature="1"/>')
    chain, note = read(text, 'odd')
    assert chain.joint_names == ('hinge',) and "welded: 'odd' at 0" in note
    plain, _ = read(pendulum())
    assert chain.joints == plain.joints
    assert pcs.forward_dynamics(chain, [0.3], [0.5], [1.0]) == pytest.approx(
        pcs.forward_dynamics(plain, [0.3], [0.5], [1.0]), rel=1e-14)
    assert "hold names 'ood'" in refusal(text, 'ood')
    text = text.replace('</mujoco>', '<actuator><motor joint="hinge"/></actuator></mujoco>')
    assert 'without a motor' not in read(text, 'odd')[1]
    assert "welded: 'odd' at 0.523599" in read(text, 'odd=30deg')[1]
    slide = text.replace('name="odd" axis="1 0 0"', 'name="odd" type="slide"')
    assert "hold gives '30deg' to joint 'odd', must be a number (m), as it slides" in refusal(slide, 'odd=30deg')


@pytest.mark.slow
def test_geoms_accepted_as_apart_never_touch():
    """Property: if the reader accepts the geoms, MuJoCo finds no contact in any configuration; some are refused."""
    accepted = 0
    for seed in range(200):
        text = RandomMjcf(seed, contacts=True).text
        try:
            model = mujoco.MjModel.from_xml_string(text)
            chain, _ = read(text)
        except (ValueError, pcs.ChainError) as error:
            assert any(word in str(error) for word in ('mjMINVAL', 'could touch', 'singular'))
            continue
        accepted += 1
        data = mujoco.MjData(model)
        lower, upper = (np.array([getattr(joint, end) for joint in chain.joints]) for end in ('lower', 'upper'))
        for position in np.random.default_rng(seed).normal(0.0, 3.0, (200, model.nv)):
            data.qpos[:] = np.clip(position, lower, upper)
            mujoco.mj_fwdPosition(model, data)
            assert data.ncon == 0, seed
    assert accepted > 15


@pytest.mark.parametrize('text, what', [
    ('<sdf version="1.7"><model name="m"/></sdf>', 'is an SDF, must be a URDF, an MJCF or a chain file in YAML'),
    ('<?xml version="1.0"?>\n<!-- x -- y -->\n<sdf/>', 'is an SDF'),
    ('<COLLADA/>', 'is a COLLADA mesh'), ('<OpenSimDocument/>', 'is a model of OpenSim'),
    ('<mujocoinclude/>', 'is a part of an MJCF'), ('#usda 1.0\ndef Xform', 'is a USD scene'),
    ('#VRML_SIM R2023b utf8\nRobot {}', 'is a VRML scene'), ('<launch/>', 'is a launch file')])
def test_other_formats_are_refused_by_name(tmp_path, text, what):
    assert what in refusal(text)
    (tmp_path / 'm.xml').write_text(text)
    with pytest.raises(pcs.ChainError, match=re.escape(what)):
        pcs.load_chain(tmp_path / 'm.xml')


def test_a_log_is_named_as_a_log(tmp_path):
    (tmp_path / 'run.mcap').write_bytes(b'\x89MCAP0\r\n' + bytes(range(256)))
    with pytest.raises(pcs.ChainError, match='is an MCAP log'):
        pcs.load_chain(tmp_path / 'run.mcap')


def torn(random, text):
    """Return the text with damage: values put for others, elements moved, or characters taken away and put in."""
    raw = random.random() < 0.3
    for _ in range(int(random.integers(1, 4))):
        words = re.findall(r'<[^>]*>', text) if random.random() < 0.3 else re.findall('"[^"]*"', text)
        found = list(re.finditer(r'<[^>]*/>', text) if random.random() < 0.2 else re.finditer('"[^"]*"', text))
        if raw or not found or not words:
            place, length = int(random.integers(len(text))), int(random.integers(1, 40))
            patch = random.choice(['', '"', '<', '/>', '&lt;', 'name="a"', '<!--', ']]>', '\u20ac', *words[:3]])
            text = text[:place] + patch + text[place + length * int(random.integers(0, 2)):]
            continue
        damaged_part = found[random.integers(len(found))]
        word = words[random.integers(len(words))]
        if damaged_part.group().startswith('"'):
            word = random.choice(['""', '"nan"', '"1e999"', '"-1"', '"0 0 0"', '"x"', '"1"', '"true"', '"1e300"',
                                  '"1e-300"', '"1 2 3"', '"hinge"', '"main"', word.strip('<>').replace('<', '')
                                  if word.startswith('"') else '"0"'])
        text = text[:damaged_part.start()] + word * int(random.integers(0, 3) if raw else 1) + text[damaged_part.end():]
    return text


@pytest.mark.slow
def test_a_torn_text_is_a_chain_or_a_sentence():
    refused = 0
    for seed in range(400):
        random = np.random.default_rng(seed)
        text = torn(random, list(KINDS.values())[seed % 5] if seed % 2 else RandomMjcf(seed).text)
        try:
            read(text)
        except pcs.ChainError as error:
            refused += 1
            assert ', must' in str(error) and str(error).isprintable() and len(str(error)) < 700, error
    assert 100 < refused < 400


@pytest.mark.slow
@pytest.mark.parametrize('text', [
    lambda size: '<mujoco>' + 100 * size * '<body>',
    lambda size: '<mujoco><worldbody>' + 90 * size * '<geom size="1"/>' + '</worldbody></mujoco>',
    lambda size: '<mujoco>' + 50 * size * '<default>' + '</mujoco>',
    lambda size: '<mujoco>' + 1000 * size * '<!--',
    lambda size: '<!DOCTYPE m [<!ENTITY a "b">]><mujoco model="&a;"/>',
    lambda size: '<mujoco model="' + 1000 * size * 'x' + '"/>',
    lambda size: '<mujoco><worldbody>' + 3 * size * '<body><joint armature="1"/><geom size="1"/>' + 3 * size * '</body>'
    + '</worldbody></mujoco>'])
def test_large_and_deep_texts_are_one_sentence_soon(text):
    """The work is at most in proportion to the length: 17 lines of Python for a character, where there is an arm."""
    small = text(100)
    _, lines = lines_run(lambda: refusal(small))
    assert lines < 25 * len(small) + 20_000
    refusal(text(400))


def test_a_long_chain_is_read():
    """600 bodies, one within the other, as MJCF nests them."""
    bodies = ''.join(f'<body pos="0 0 -0.1"><joint name="j{k}" axis="0 1 0"/><geom size="0.02"/>' for k in range(600))
    chain, _ = read('<mujoco><option><flag contact="disable"/></option><worldbody>' + bodies + 600 * '</body>'
                    + '</worldbody></mujoco>')
    assert chain.joint_count == 600


def test_every_executable_takes_an_mjcf_file(tmp_path, capsys):
    from planar_chain_sim.resimulation import command_line as resimulation
    (tmp_path / 'robot.xml').write_text(CARTPOLE)
    log = tmp_path / 'run.mcap'
    command = [sys.executable, '-m', 'planar_chain_sim.recording.rollout', tmp_path / 'robot.xml', '--output', log]
    done = subprocess.run([*command, '--duration', '0.1'], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and 'robot.xml: joints ' in done.stderr
    assert resimulation.main([str(log)]) == 0, capsys.readouterr()


@pytest.mark.parametrize('distance, touches', [(0.9, True), (1.5, True), (2.05, True), (2.2, False), (9.0, False)])
def test_the_reach_of_an_arm_decides(distance, touches):
    """A ball of 0.1 m beside an arm of three links, 1, 0.6 and 0.4 m long and 0.02 m thick, which stretches."""
    def link(number, length, inner):
        return (f'<body name="l{number}" pos="0 0 {-[0.0, 1.0, 0.6][number]}"><joint axis="0 1 0"/>'
                f'<geom type="capsule" fromto="0 0 0 0 0 {-length}" size="0.02" contype="2"/>{inner}</body>')
    arm = link(0, 1.0, link(1, 0.6, link(2, 0.4, '')))
    ball = f'<geom name="ball" size="0.1" pos="{distance} 0 0" conaffinity="0"/>'
    text = f'<mujoco><worldbody>{ball}{arm}</worldbody></mujoco>'
    if touches:
        assert "'ball'" in refusal(text)
    else:
        assert read(text)[0].joint_count == 3
