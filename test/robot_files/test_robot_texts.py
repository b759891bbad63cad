"""Texts of robot files: xacro is expanded or named; a damaged or long text gives a chain or one sentence."""
from pathlib import Path
import re
import sys

import numpy as np
from oracles.random_robots import random_robot
from oracles.robot_arm import load, POINT, refusal
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain_file import chain_from_text

MACROS = """<robot name="boom" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="weight.xacro"/>
<link name="mast"/><link name="beam"><inertial><origin xyz="0 0 ${-1.0/2}"/>
<mass value="1"/>""" + POINT.format(0.1) + """</link>
<joint name="luff" type="continuous"><parent link="mast"/><child link="beam"/><axis xyz="0 1 0"/></joint>
<xacro:weight on="beam"/></robot>"""
WEIGHT = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="weight" params="on">
<link name="lump">
<inertial><mass value="50"/>""" + POINT.format(1.0) + """</link><joint name="weld" type="fixed"><parent link="${on}"/>
<child link="lump"/><origin xyz="0 0 -2"/></joint></xacro:macro></robot>"""


def test_xacro_is_expanded_where_it_is_installed(tmp_path):
    (tmp_path / 'boom.urdf.xacro').write_text(MACROS)
    (tmp_path / 'weight.xacro').write_text(WEIGHT)
    pytest.importorskip('xacro')
    chain = pcs.load_chain(tmp_path / 'boom.urdf.xacro')
    assert pcs.mass_matrix(chain, [0.2])[0, 0] == pytest.approx(0.25 + 0.1 + 200.0 + 1.0, rel=1e-14)
    assert 'must be expanded first' in refusal(MACROS)   # a text from elsewhere is not


@pytest.mark.parametrize('text, reason', [
    ('<xacro:nope/>', 'unknown macro name: xacro:nope'),
    ('<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>', 'recursion'),
    ('<xacro:property name="a" value="${10**10 * \'x\'}"/><link name="${a}"/>', 'cannot be expanded by xacro'),
])
def test_xacro_that_fails_or_never_ends(text, reason, tmp_path):
    pytest.importorskip('xacro')
    path = tmp_path / 'r.xacro'
    path.write_text(f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}</robot>')
    with pytest.raises(pcs.ChainError, match='must be one that `xacro FILE` expands') as caught:
        pcs.load_chain(path)
    assert reason in str(caught.value) and str(caught.value).isprintable()


def test_a_folder_called_xacro_is_not_the_package(tmp_path, monkeypatch):
    (tmp_path / 'xacro').mkdir()
    (tmp_path / 'boom.urdf.xacro').write_text(MACROS)
    others = [entry for entry in sys.path if not Path(entry, 'xacro').exists()]
    monkeypatch.setattr('sys.path', [str(tmp_path), *others])
    monkeypatch.delitem(sys.modules, 'xacro', raising=False)
    with pytest.raises(pcs.ChainError, match='must be expanded first'):
        pcs.load_chain(tmp_path / 'boom.urdf.xacro')


VALUES = ('', 'x', '1 2', 'nan', '-1', '1e999', 'inf', '0', '1e308', '-1e308 0 1e308', '0 0 0', '5e-324 0 0', '1_0',
          '\uff11', '&lt;', 'world', 'l0', 'l1', 'j1', 'fixed', 'floating', 'prismatic', 'revolute', '300' * 99)
PIECES = (
    '<mimic joint="j1"/>', '<limit lower="5" upper="1e308" effort="-3"/>', '<axis xyz="0 0 0"/>', '<!--', '>', '<?',
    '<origin rpy="1e300 0 0" xyz="1e300 1e300 1e300"/>', '<dynamics damping="1e300" friction="1e308"/>', '&amp', '"',
    '<inertial><mass value="1e308"/></inertial>', '<![CDATA[', '<!DOCTYPE a>', '<robot>', '\0', '<link name="z"/>',
    '<joint name="zz" type="fixed"><parent link="l1"/><child link="z"/></joint>',
    '<gazebo><plugin><joint>j2</joint><mimicJoint>j1</mimicJoint></plugin></gazebo>')
HOLDS = (None, None, None, ['j1'], {'j2': 0.5}, 'j1=1e300')


def changed(random, text: str) -> str:
    """Return the text with values replaced, pieces put in, taken out and moved."""
    for _ in range(random.integers(1, 4)):
        values = [match.span() for match in re.finditer('"[^"]*"', text)]
        tags = [match.end() for match in re.finditer('>', text)]
        way = random.random()
        if way < 0.5 and values:
            begin, end = values[random.integers(len(values))]
            text = f'{text[:begin]}"{random.choice(VALUES)}"{text[end:]}'
        elif way < 0.8 and tags:
            place = tags[random.integers(len(tags))]
            text = text[:place] + str(random.choice(PIECES)) + text[place:]
        else:
            begin, end, place = sorted(random.integers(len(text) + 1, size=3))
            text = text[:begin] + text[end:place] + text[begin:end][:200] + text[place:]
    return text


@pytest.mark.filterwarnings('ignore:.*effort limit')
def test_a_damaged_text_is_a_chain_or_one_sentence():
    loaded = 0
    for seed in range(600):
        random = np.random.default_rng(seed)
        text = changed(random, random_robot(seed % 50, lengthwise=0.3))
        try:
            chain_from_text(text, 'r.urdf', HOLDS[seed % len(HOLDS)])
            loaded += 1
        except pcs.ChainError as error:
            sentence = str(error)
            assert sentence.startswith('r.urdf') and sentence.isprintable() and len(sentence) < 900, sentence
    assert 30 < loaded < 500


@pytest.mark.slow
@pytest.mark.parametrize('text', [
    '<robot name="r">' + '<link name="a"/>' * 30_000, '<robot>' + 'x<a/>' * 100_000, '<robot>' + '<!---->' * 300_000,
    '<' * 300_000, '<!--' * 300_000, '<robot ' + ' '.join(f'a{k}=""' for k in range(100_000)) + '/>',
    '<robot>' * 30_000, '<robot>' + '<a/>' * 100_000], ids=lambda text: text[:16])
def test_long_texts_end_in_a_sentence(text):
    refusal(text)


def test_a_long_chain_of_links_loads():
    links = ''.join(f'<link name="l{k}"><inertial><mass value="1"/>{POINT.format(0.1)}</link><joint name="j{k}" '
                    f'type="continuous"><parent link="l{k - 1}"/><child link="l{k}"/><origin xyz="0.1 0 0"/>'
                    '<axis xyz="0 1 0"/></joint>' for k in range(1, 1001))
    assert load(f'<robot name="r">{links}<link name="l0"/></robot>')[0].joint_count == 1000
