"""The URDF text of an arm of two joints, with anything in it, and how it is taken or refused."""
import warnings

import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.errors import RobotFileNote

POINT = '<inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/></inertial>'
ARM = """<robot name="r"><link name="stand"/>
<link name="a">{in_a}<inertial><origin xyz="0 0 -0.5"/><mass value="2"/>""" + POINT.format(0.1) + """</link>
<link name="b"><inertial><origin xyz="0 0 -0.3"/><mass value="1"/>""" + POINT.format(0.02) + """</link>
<joint name="s" type="continuous"><parent link="stand"/><child link="a"/><origin {mount}/><axis xyz="{axis}"/>
{in_s}</joint>
<joint name="e" type="{kind}"><parent link="a"/><child link="b"/><origin xyz="0 0 -1" rpy="{rpy}"/>
<axis xyz="{second}"/>{in_e}</joint>{more}</robot>"""
USUAL = {'in_a': '', 'mount': '', 'axis': '0 1 0', 'in_s': '', 'kind': 'continuous', 'rpy': '0 0 0', 'second': '0 1 0',
         'in_e': '', 'more': ''}


def arm(**changes) -> str:
    """Return the text of the arm with these parts filled in."""
    return ARM.format(**{**USUAL, **changes})


YAWING = arm(axis='0 0 1', kind='revolute', in_e='<limit lower="-2" upper="2" effort="9" velocity="0"/>',
             more='<link name="c"><inertial><origin xyz="0.1 0 -0.2"/><mass value="0.5"/>' + POINT.format(0.01) +
                  '</link><joint name="w" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0 0 -0.6"/>'
                  '<axis xyz="0 1 0"/></joint>')


def load(text: str, hold=None):
    """Return the chain of a text, the note and the warnings that came with it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        chain = chain_from_text(text, 'r.urdf', hold)
    notes = [str(each.message) for each in caught if each.category is RobotFileNote]
    assert len(notes) == 1 and notes[0].startswith('r.urdf: joints ') and notes[0].isprintable()
    return chain, notes[0], [str(each.message) for each in caught if each.category is not RobotFileNote]


def refusal(text: str, hold=None) -> str:
    """Return the sentence that refuses a text."""
    with pytest.raises(pcs.ChainError) as caught:
        chain_from_text(text, 'r.urdf', hold)
    sentence = str(caught.value)
    assert sentence.isprintable() and ', must' in sentence and len(sentence) < 600
    return sentence
