"""animate: moving pictures of chains and logs, to scale, and what it refuses."""
import sys

import numpy as np
from PIL import Image
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.visual import body_color
from planar_chain_sim.pictures import animation
from planar_chain_sim.pictures.animation import draw_animation, FRAME, PART
from planar_chain_sim.recording import rollout


def frames_of(path):
    with Image.open(path) as image:
        for k in range(image.n_frames):
            image.seek(k)
            yield np.array(image.convert('RGB')).astype(float), image.info['duration']


def colored(frame, color):
    """Return where pixels have nearly this colour, (pixels, 2): column from the left, row from the bottom."""
    rows, columns = np.nonzero(np.abs(frame - 255.0 * np.array(color[:3])).max(axis=2) < 24.0)
    return np.stack([columns, len(frame) - 1 - rows], axis=1)


def test_bodies_move_to_scale(tmp_path, monkeypatch):
    """Two rods of 1 m that turn about a point 1 m from the base: the second one's pixels follow it, at one scale."""
    monkeypatch.chdir(tmp_path)
    chain = pcs.load_chain('double_pendulum.yaml')
    angles = np.linspace(0.0, 2.0, 10 * PART + 1)
    (tmp_path / 'turn.gif').write_bytes(draw_animation(chain, np.stack([angles, 0.0 * angles], axis=1), 1.0, 400))
    frames = list(frames_of('turn.gif'))
    assert len(frames) == 11 and {duration for _, duration in frames} == {1000 * FRAME}
    assert max(frames[0][0].shape[:2]) == 400
    lengths = []
    for k, (frame, _) in enumerate(frames):
        places = colored(frame, body_color(chain, 1))
        middle = places.mean(axis=0)
        direction = np.linalg.svd(places - middle, full_matrices=False)[2][0]
        lengths.append(np.ptp((places - middle) @ direction))
        wanted = angles[k * PART] - np.pi / 2
        assert abs(direction @ [-np.sin(wanted), np.cos(wanted)]) < 0.05   # parallel to the rod
    assert np.ptp(lengths) < 0.05 * np.mean(lengths)


def test_a_log_and_its_chain_give_one_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert rollout.main(['seven_link_arm.yaml', '--duration', '0.5', '--output', 'run.mcap']) == 0
    assert animation.main(['run.mcap', '--size', '200']) == 0
    assert animation.main(['seven_link_arm.yaml', '--duration', '0.5', '--size', '200', '--output', 'chain.gif']) == 0
    logged, computed = list(frames_of('run.gif')), list(frames_of('chain.gif'))
    assert len(logged) == len(computed) == 1 + round(0.5 / FRAME)
    for (one, _), (other, _) in zip(logged, computed):
        assert np.array_equal(one, other)
    assert 'run.gif' in capsys.readouterr().out


@pytest.mark.parametrize('arguments, sentence', [
    (['--output', 'there.gif'], "'there.gif': the file exists and is not overwritten, give a new name"),
    (['--output', 'no_folder/arm.gif', '--duration', '0.1'], "'no_folder/arm.gif': No such file or directory"),
    (['--output', 'arm.mp4'], "--output is 'arm.mp4', must end in '.gif'"),
    (['--duration', '1000'], '1000 s at the speed 1 are 2.5e+04 frames, must be from 1 to 1302 of this size'),
    (['--speed', '1000'], '8 s at the speed 1000 are 0.2 frames'),
    (['--size', '2000'], '8 s at the speed 1 are 200 frames, must be from 1 to 75 of this size'),
    (['--size', '5'], '--size is 5 px, must be from 120 to 2000')])
def test_refusals(arguments, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'there.gif').write_bytes(b'old')
    assert animation.main(['four_link_robot.yaml', *arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'animate: {sentence}') and said.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['there.gif']
    assert (tmp_path / 'there.gif').read_bytes() == b'old'


def test_what_to_install_is_said(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, 'PIL', None)
    assert animation.main(['four_link_robot.yaml']) == 2
    assert '`pip install matplotlib pillow`' in capsys.readouterr().err
