"""animate: moving pictures of chains and logs, to scale, and what it refuses."""
from io import BytesIO
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from time import sleep
from xml.etree import ElementTree

from imageio_ffmpeg import get_ffmpeg_exe
import numpy as np
from PIL import Image
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.visual import body_color
from planar_chain_sim.pictures import animation
from planar_chain_sim.pictures.raster import GIF_EVERY, MP4_EVERY, Raster, write_gif, write_mp4
from planar_chain_sim.pictures.scene import AWAY, Force, Look, SAMPLE, Scene
from planar_chain_sim.pictures.vector import EVERY, write_html, write_svg
from planar_chain_sim.recording import rollout

SVG = '{http://www.w3.org/2000/svg}'


def ignore(count):
    """Show no progress."""


@pytest.fixture(scope='module')
def turning():
    """Return a double pendulum, a motion of it, and its scene: stretched out, it turns about the base by 2 rad."""
    chain = pcs.load_chain('double_pendulum.yaml')
    angles = np.linspace(0.0, 2.0, 41)
    position = np.stack([angles, 0.0 * angles], axis=1)
    return chain, position, Scene(chain, position, Look(size=400, traced=[(1, None)]))


def gif_frames(content):
    with Image.open(BytesIO(content)) as image:
        for k in range(image.n_frames):
            image.seek(k)
            yield np.array(image.convert('RGB')).astype(float), image.info['duration']


def mp4_frames(path, scene):
    command = [get_ffmpeg_exe(), '-loglevel', 'error', '-i', path, '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-']
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, scene.height, scene.width, 3).astype(float)


def is_drawn(frame, place, color, tolerance):
    """Whether a pixel at a place (complex, px) has a colour."""
    row, column = int(place.imag), int(place.real)
    return np.abs(frame[row, column] - 255.0 * np.array(color[:3])).max() < tolerance


@pytest.mark.parametrize('kind, tolerance', [('gif', 20), ('mp4', 90)])   # an MP4 has a colour for two by two pixels
def test_pixels_of_bodies_are_where_body_poses_says(kind, tolerance, turning, tmp_path):
    """In each frame, at three quarters of the second rod and, before the rod comes there, not."""
    chain, position, scene = turning
    poses = pcs.body_poses(chain, position)
    places = scene.px((poses.point[:, 1] + 0.75 * 2.0 * (poses.center_of_mass[:, 1] - poses.point[:, 1])) @ [1.0, 1.0j])
    if kind == 'gif':
        file = BytesIO()
        write_gif(scene, file, ignore)
        frames, every = [frame for frame, _ in gif_frames(file.getvalue())], GIF_EVERY
        assert {duration for _, duration in gif_frames(file.getvalue())} == {1000 * GIF_EVERY * SAMPLE}
    else:
        write_mp4(scene, str(tmp_path / 'arm.mp4'), ignore)
        frames, every = mp4_frames(tmp_path / 'arm.mp4', scene), MP4_EVERY
    assert len(frames) == 1 + 40 // every
    for k, frame in enumerate(frames):
        assert frame.shape == (scene.height, scene.width, 3)
        assert is_drawn(frame, places[k * every], body_color(chain, 1), tolerance)
        assert k == 0 or not is_drawn(frames[0], places[k * every], body_color(chain, 1), 100)
        assert is_drawn(frame, 3 + 3j + 0.5 * scene.height, (1.0, 1.0, 1.0), 4)    # the paper is white


def moved(animate):
    """Return the values of an animation as complex px, (frames, points)."""
    return np.array([[complex(*map(float, point.split())) for point in value.lstrip('M').split('L')]
                     for value in animate.get('values').split(';')])


def test_svg_is_the_motion_to_scale(turning):
    """One scale and one place map what body_poses says to the pixels of both rods; the grid is as wide as it says."""
    chain, position, scene = turning
    file = BytesIO()
    write_svg(scene, file, ignore)
    root = ElementTree.fromstring(file.getvalue())
    poses = pcs.body_poses(chain, position[::EVERY])
    for body in (0, 1):
        code = '#' + ''.join(f'{round(255 * part):02x}' for part in body_color(chain, body)[:3])
        path, = (each for each in root.iter(f'{SVG}path') if each.get('stroke') == code and each.get('opacity') is None)
        drawn = moved(path.find(f'{SVG}animate'))
        start = poses.point[:, body] @ [1.0, 1.0j]
        wanted = np.stack([start, 2.0 * (poses.center_of_mass[:, body] @ [1.0, 1.0j]) - start], axis=1)
        equations = np.stack([wanted.conj().ravel(), np.ones(wanted.size)], axis=1)
        (scale, _), *_ = np.linalg.lstsq(equations, drawn.ravel(), rcond=None)
        assert abs(scale.imag) < 1e-3 and 50.0 < scale.real < 400.0
        assert np.abs(equations @ np.linalg.lstsq(equations, drawn.ravel(), rcond=None)[0] - drawn.ravel()).max() < 0.01
    grid = [float(re.match(r'M([\d.]+)', each.get('d')).group(1)) for each in root.iter(f'{SVG}path')
            if each.get('class') == 'grid']
    width = float(re.search(r'grid ([\d.]+) m', file.getvalue().decode()).group(1))
    steps = np.diff([place for place in grid if place > 0.0])
    np.testing.assert_allclose(steps, width * scale.real, atol=0.02)


def test_the_trail_of_an_svg_is_as_long_as_the_way(turning):
    """Its dash ends where the point is: at 2 m * angle along the way, times the scale."""
    chain, position, _ = turning
    scene = Scene(chain, position, Look(size=400, trail=0.2, traced=[(1, None)]))
    file = BytesIO()
    write_svg(scene, file, ignore)
    animate, = (each for each in ElementTree.fromstring(file.getvalue()).iter(f'{SVG}animate')
                if each.get('attributeName') == 'stroke-dasharray')
    dashes = np.array([list(map(float, value.split())) for value in animate.get('values').split(';')])
    ends = 2.0 * scene.scale * position[::EVERY, 0]
    starts = 2.0 * scene.scale * np.maximum(0.0, position[::EVERY, 0] - 0.2 / 0.4 * 2.0)
    np.testing.assert_allclose(dashes[:, 1], starts, atol=0.2)
    np.testing.assert_allclose(dashes[:, 1] + dashes[:, 2], ends, atol=0.2)


def test_files_for_the_browser_ask_no_other_machine(turning):
    for write in (write_svg, write_html):
        file = BytesIO()
        write(turning[2], file, ignore)
        text = file.getvalue().decode().replace('xmlns="http://www.w3.org/2000/svg"', '')
        assert not re.search(r'https?:|//\w|\bsrc=|\bhref=|@import|url\((?!#)', text)
    assert "default-src 'none'" in text


def test_names_become_no_markup():
    chain = pcs.chain_from_dict({'name': '</title><script>alert(1)</script>', 'bodies': [
        {'name': 'a', 'carrier': 'base', 'mass': 1.0, 'inertia': 1.0, 'rotation': {'joint': 'j'}}]})
    for write in (write_svg, write_html):
        file = BytesIO()
        write(Scene(chain, np.zeros((9, 1)), Look()), file, ignore)
        assert b'<script>alert' not in file.getvalue()


def test_a_traced_point_and_the_time_begin_where_they_should():
    chain = pcs.load_chain('double_pendulum.yaml')
    scene = Scene(chain, np.zeros((9, 2)), Look(speed=0.5, start=3.0, traced=[(0, 0.25 + 0.5j)]))
    assert [trail.color for trail in scene.trails] == [body_color(chain, 0)]
    np.testing.assert_allclose(scene.trails[0].points, scene.px(np.array(0.5 - 0.25j)))     # the rod hangs down
    assert scene.time(0) == 't = 3.000 s' and scene.time(8) == 't = 3.040 s'
    assert not Scene(chain, np.zeros((9, 2)), Look(trail=0.0, traced=[(0, None)])).trails


def test_a_force_is_an_arrow_while_it_acts():
    """In the axes of the body, which hangs down, its x axis too; in those of the world as it is."""
    chain = pcs.load_chain('double_pendulum.yaml')
    for turns, direction in ((True, -1j), (False, 1.0)):
        scene = Scene(chain, np.zeros((9, 2)), Look(forces=[Force(1, 2, 5, 3.0 + 0j, turns)]))
        arrow = scene.strokes[-1].points
        assert (arrow[[0, 1, 6, 7, 8]] == AWAY).all()
        along = np.conj(arrow[2:6, 1] - arrow[2:6, 0])
        np.testing.assert_allclose(along / abs(along), direction, atol=1e-12)


def test_everything_is_inside_the_picture():
    """Rails, stops and springs too, and a chain that does not move has a picture."""
    for path in (Path(__file__).parents[2] / 'config').glob('*.yaml'):
        chain = pcs.load_chain(path)
        position = pcs.rollout(chain, 2.0, 0.01).position
        for motion in (position, 0.0 * position):
            scene = Scene(chain, motion, Look(size=300))
            assert scene.shift.any() == (path.stem == 'arczewski_example' and motion is position)
            for stroke in scene.strokes if scene.shift.any() else (*scene.behind, *scene.strokes):
                points = stroke.points if len(stroke.points) > 1 else stroke.points + scene.shift[:, None]
                assert points.real.min() >= -0.01 and points.real.max() <= scene.width + 0.01, path.name
                assert points.imag.min() >= -0.01 and points.imag.max() <= scene.height + 0.01, path.name
            assert scene.width % 2 == scene.height % 2 == 0


def test_an_arm_that_goes_far_is_followed():
    """The picture moves with the mass centre: the arm is as large as one that stays, and the world passes by."""
    chain = pcs.load_chain('arczewski_example.yaml')
    position = pcs.rollout(chain, 4.0, 0.01).position
    scene = Scene(chain, position, Look())
    poses = pcs.body_poses(chain, position)
    masses = np.array([body.mass for body in chain.bodies])
    middle = np.einsum('rbx,b->rx', poses.center_of_mass, masses) @ [1.0, 1.0j] / masses.sum()
    drawn = scene.px(middle) + scene.shift
    np.testing.assert_allclose(drawn, drawn[0], atol=1e-6)
    column = next(each for each in scene.strokes if each.points.shape == (len(position), 2))
    np.testing.assert_allclose(abs(np.diff(column.points)[:, 0]), 0.9 * scene.scale, rtol=1e-9)    # the column's length
    assert scene.scale > 100.0 and np.ptp(scene.shift.imag) > 50.0 * 0.9 * scene.scale
    file = BytesIO()
    write_svg(scene, file, ignore)
    assert len(file.getvalue()) < 200_000


@pytest.mark.parametrize('far', [1e7, 1e300])
def test_an_arm_that_goes_too_far_has_no_grid(far):
    """Of which millions of lines would be needed, and none be seen."""
    chain = pcs.load_chain('arczewski_example.yaml')
    position = np.linspace(0.0, 1.0, 9)[:, None] * [far, 0.0, 0.0, 0.0, 0.0]
    strokes = Scene(chain, position, Look()).behind
    assert strokes and not [stroke for stroke in strokes if stroke.color == 'grid']


def test_a_log_and_its_chain_give_one_picture(tmp_path, monkeypatch, capsys):
    """And a part of the log is that part of the picture."""
    monkeypatch.chdir(tmp_path)
    assert rollout.main(['seven_link_arm.yaml', '--duration', '0.4', '--output', 'run.mcap']) == 0
    assert animation.main(['run.mcap', '--size', '200']) == 0
    assert animation.main(['seven_link_arm.yaml', '--duration', '0.4', '--size', '200', '--output', 'chain.gif']) == 0
    logged, computed = (list(gif_frames(Path(name).read_bytes())) for name in ('run.gif', 'chain.gif'))
    assert len(logged) == len(computed) == 1 + round(0.4 / SAMPLE / GIF_EVERY)
    for (one, _), (other, _) in zip(logged, computed):
        assert np.array_equal(one, other)
    assert 'run.gif' in capsys.readouterr().out
    source, position, look = animation._motion(animation._parser().parse_args(
        ['run.mcap', '--from', '0.1', '--duration', '0.2', '--speed', '0.5']), '.svg')
    assert look.start == 0.1 and len(position) == 41
    np.testing.assert_allclose(position, pcs.load_log('run.mcap').position[100:301:5], atol=1e-12)


def test_the_forces_of_a_log_are_drawn(tmp_path):
    path = tmp_path / 'pushed.mcap'
    simulation = pcs.Simulation(pcs.load_chain('four_link_robot.yaml'))
    with pcs.OfflineLog(str(path), simulation) as log:
        log.advance(100)
        log.change('wrench', body='forearm', force=[5.0, 0.0], axes='world')
        log.advance(100)
        log.change('reset')
        log.advance(100)
    _, _, look = animation._motion(animation._parser().parse_args([str(path)]), '.svg')
    assert look.forces == [Force(2, 10, 19, 5.0 + 0j, False)]


def test_a_picture_can_be_interrupted(tmp_path):
    """Ctrl-C in the middle of an MP4: one line, no file, and ffmpeg has gone."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'planar_chain_sim.pictures.animation', 'double_pendulum.yaml', '--duration', '600',
         '--output', 'long.mp4'], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    while not (tmp_path / 'long.mp4').exists() or not (tmp_path / 'long.mp4').stat().st_size:
        assert process.poll() is None, process.stderr.read()
        sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, out, err) == (130, '', 'animate: interrupted\n')
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('arguments, sentence', [
    (['--output', 'there.gif'], "'there.gif': the file exists and is not overwritten, give a new name"),
    (['--output', 'no_folder/arm.gif', '--duration', '0.1'], "'no_folder/arm.gif': No such file or directory"),
    (['--output', 'no_folder/arm.mp4', '--duration', '0.1'], "'no_folder/arm.mp4': No such file or directory"),
    (['--output', 'arm.avi'], "--output is 'arm.avi', must end in .gif, .mp4, .svg, .html"),
    (['--duration', '1000'], '1000 s at the speed 1 are 2.5e+04 frames, must be from 1 to 1302 of this kind and size'),
    (['--speed', '1000'], '8 s at the speed 1000 are 0.2 frames'),
    (['--size', '2000'], '8 s at the speed 1 are 200 frames, must be from 1 to 75 of this kind and size'),
    (['--size', '5'], '--size is 5 px, must be from 200 to 4000'),
    (['--trail', '-1'], '--trail is -1 s, must be from 0 to 1e+06'),
    (['--trail', '1e308', '--output', 'arm.svg'], '--trail is 1e+308 s, must be from 0 to 1e+06'),
    (['--from', '1e9'], '--from is 1e+09 s, must be at most 20000 s at this speed'),
    (['--trace', 'forarm'], "--trace 'forarm': four_link_robot has no body 'forarm' (did you mean 'forearm'?), its"),
    (['--trace', 'forearm=1'], "--trace 'forearm=1' must end in a point x,y in the frame of the body"),
    (['--trace', 'forearm=1,nan'], "--trace 'forearm=1,nan' must end in a point x,y")])
def test_refusals(arguments, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'there.gif').write_bytes(b'old')
    assert animation.main(['four_link_robot.yaml', *arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'animate: {sentence}') and said.count('\n') == 1
    assert [path.name for path in tmp_path.iterdir()] == ['there.gif']
    assert (tmp_path / 'there.gif').read_bytes() == b'old'


@pytest.mark.parametrize('missing, output', [
    ('PIL', 'arm.gif'), ('matplotlib', 'arm.mp4'), ('imageio_ffmpeg', 'arm.mp4')])
def test_what_to_install_is_said(missing, output, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('PATH', '')    # where an ffmpeg may be
    monkeypatch.setitem(sys.modules, missing, None)
    assert animation.main(['four_link_robot.yaml', '--duration', '0.1', '--output', output]) == 2
    assert '`pip install matplotlib pillow imageio-ffmpeg`' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_encoder_that_fails_says_why(turning, tmp_path, monkeypatch):
    from planar_chain_sim.pictures import raster
    monkeypatch.setattr(raster, 'ENCODE', ['-c:v', 'no_such_codec', '-f', 'mp4'])
    with pytest.raises(pcs.errors.Mistake, match='ffmpeg could not write it .*Encoder not found'):
        write_mp4(turning[2], str(tmp_path / 'arm.mp4'), ignore)


def test_a_frame_holds_no_memory_of_others(turning):
    """Drawn in any order, a frame is the same."""
    with Raster(turning[2]) as raster:
        first = raster.pixels(8).copy()
        raster.pixels(40)
        assert np.array_equal(raster.pixels(8), first)
