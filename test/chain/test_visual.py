"""`visual:` is checked like every key, and looks the same in URDF, markers and pictures."""
from xml.etree import ElementTree

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.visual import body_color, COLORS
from planar_chain_sim.mechanics.body_lines import body_lines
from planar_chain_sim.pictures import plot
from planar_chain_sim.robot_files.link_frames import LinkFrames
from planar_chain_sim.robot_files.urdf_writer import PLANE, urdf_of


def two_links(**visual):
    """Return a chain whose first link looks as said; the second begins 0.5 m along it."""
    link = {'mass': 1.0, 'center_of_mass': [0.2, 0.1], 'inertia_com': 0.1}
    return pcs.chain_from_dict({'bodies': [
        {'name': 'a', 'carrier': 'base', **link, 'rotation': {'joint': 'j'}, **({'visual': visual} if visual else {})},
        {'name': 'b', 'carrier': 'a', 'origin': [0.5, 0.0], **link, 'rotation': {'joint': 'k'}}]})


@pytest.mark.parametrize('visual, sentence', [
    ({'lenght': 1.0}, "key 'visual.lenght' is unknown (did you mean 'length'?), must be one of length, color"),
    ({'mass': 1.0}, "key 'visual.mass' is unknown, must be one of length, color"),
    ({'length': '1 m'}, "key 'visual.length' is '1 m', must be a number >= 0 (m)"),
    ({'length': -1.0}, "key 'visual.length' is -1.0, must be a number >= 0 (m)"),
    ({'length': float('inf')}, "key 'visual.length' is inf, must be a finite number >= 0 (m)"),
    ({'length': True}, "key 'visual.length' is true, must be a number"),
    ({'color': [0.1, 0.2]}, "key 'visual.color' is [0.1, 0.2], must be [red, green, blue]"),
    ({'color': [0, 0, 255]}, "key 'visual.color' is [0, 0, 255], must be [red, green, blue]"),
    ({'color': [0, 0, '1']}, "key 'visual.color' is [0, 0, '1'], must be"),
    ({'color': 'bleu'}, "key 'visual.color' is 'bleu' (did you mean 'blue'?), must be"),
    ({'color': '#12345'}, "key 'visual.color' is '#12345', must be"),
    ({'color': 3}, "key 'visual.color' is 3, must be"),
    ({'color': None}, "key 'visual.color' is empty, must be"),
])
def test_what_is_no_look_is_one_sentence(visual, sentence):
    with pytest.raises(pcs.ChainError) as refusal:
        two_links(**visual)
    assert f"body 'a' {sentence}" in str(refusal.value)


each_colour = pytest.mark.parametrize('color, wanted', [
    ([0.1, 0.2, 0.3], (0.1, 0.2, 0.3, 1.0)), ([1, 0, 0, 0.5], (1.0, 0.0, 0.0, 0.5)), ('red', (1.0, 0.0, 0.0, 1.0)),
    ('#336699', (0.2, 0.4, 0.6, 1.0)), (None, (*COLORS[0], 1.0))])


def of_colour(color):
    """Return a chain whose first link has this colour, or says none."""
    return two_links(**({} if color is None else {'color': color}))


@each_colour
def test_a_colour_is_the_same_in_urdf_and_pictures(color, wanted, tmp_path):
    chain = of_colour(color)
    assert body_color(chain, 0) == wanted
    robot = ElementTree.fromstring(urdf_of(chain))
    rgba = robot.find("link[@name='a']/visual/material/color").get('rgba')
    assert tuple(map(float, rgba.split())) == wanted
    picture = tmp_path / 'a.svg'
    (tmp_path / 'a.yaml').write_text(chain.source)
    assert plot.main([str(tmp_path / 'a.yaml'), '--to', '0.1', '--output', str(picture)]) == 0
    code = '#' + ''.join(f'{round(255 * part):02x}' for part in wanted[:3])
    assert code in picture.read_text()


@pytest.mark.ros
@each_colour
def test_a_colour_is_the_same_in_markers(color, wanted):
    from planar_chain_sim.ros.markers import marker_array
    chain = of_colour(color)
    told = marker_array(chain, LinkFrames(urdf_of(chain), plane=PLANE), 0, np.zeros(2), 'world').markers[0].color
    np.testing.assert_allclose([told.r, told.g, told.b, told.a], wanted, atol=1e-7)   # which are single precision


@pytest.mark.parametrize('visual, end', [({'length': 0.8}, 0.8), ({}, 0.5), ({'length': 0.0}, 0.0)])
def test_a_length_is_the_same_everywhere(visual, end):
    chain = two_links(**visual)
    turn = np.exp(0.3j)
    (line,), (last,) = body_lines(chain, np.array([0.3, 0.2]))
    assert abs(line[0]) == 0.0 and abs(line[1] - end * turn) < 1e-15
    assert abs(last[1] - 0.5 * turn - 2.0 * (0.2 + 0.1j) * np.exp(0.5j)) < 1e-15   # carries nothing, says nothing
    visual = ElementTree.fromstring(urdf_of(chain)).find("link[@name='a']/visual")
    middle = np.array(list(map(float, visual.find('origin').get('xyz').split())))
    size = float(visual.find('geometry/box').get('size').split()[0])
    np.testing.assert_allclose(middle, [0.5 * end, 0.0, 0.0])
    assert size == (end or 0.01)


def test_a_look_changes_no_bit_of_the_motion():
    plain, drawn = two_links(), two_links(length=3.0, color='teal')
    first, second = (pcs.rollout(chain, 0.2) for chain in (plain, drawn))
    assert np.array_equal(first.position, second.position)


# Machado, Oliveira, Fernandes 2009: what readers without red, green or blue cones see, in linear RGB.
VISION = {'all cones': np.eye(3),
          'no red': [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
          'no green': [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                       [-0.011820, 0.042940, 0.968881]],
          'no blue': [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                      [0.004733, 0.691367, 0.303900]]}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])   # of linear sRGB


def linear(colors):
    colors = np.array(colors)
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055)**2.4)


@pytest.mark.parametrize('vision', VISION)
def test_every_reader_can_tell_the_colours_apart(vision):
    """The distances in CIELAB; about 2 is the least that is seen at all."""
    seen = np.clip(linear(COLORS) @ np.transpose(VISION[vision]), 0.0, 1.0) @ XYZ.T / XYZ.sum(axis=1)
    x, y, z = np.where(seen > (6 / 29)**3, np.cbrt(seen), seen * 841 / 108 + 4 / 29).T
    lab = np.stack([116 * y, 500 * (x - y), 200 * (y - z)], axis=1)
    apart = np.linalg.norm(lab[:, None] - lab, axis=2)[np.triu_indices(len(COLORS), 1)]
    assert apart.min() > 19.0


@pytest.mark.parametrize('paper, least', [('#ffffff', 2.5), ('#14181d', 3.0)])
def test_the_colours_stand_out_from_light_and_dark_paper(paper, least):
    """By the contrast ratio of WCAG 2."""
    ink, ground = (linear(colors) @ XYZ[1] + 0.05 for colors in (
        COLORS, [int(paper[k:k + 2], 16) / 255 for k in (1, 3, 5)]))
    assert (np.maximum(ink, ground) / np.minimum(ink, ground)).min() > least
