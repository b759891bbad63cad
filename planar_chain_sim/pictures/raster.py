"""A scene as pixels: GIF by pillow, MP4 by ffmpeg."""
from __future__ import annotations

import shutil
import subprocess
from tempfile import TemporaryFile
from typing import Callable, Iterator

import numpy as np

from .figure import FAINT, INK, PAPER, pyplot_in_style
from .scene import SAMPLE, Scene
from ..errors import Mistake

DPI = 72                        # a point is a pixel
GIF_EVERY, MP4_EVERY = 4, 2     # rows from frame to frame: 25 and 50 frames a second; GIF counts in 10 ms
SHADES = 8                      # of each colour in a GIF, between it and the paper
NAMED: dict = {'ink': INK, 'faint': FAINT, 'paper': PAPER, 'grid': f'{FAINT}4c'}    # of an opacity of 0.3
ENCODE = ('-c:v libx264 -preset medium -crf 18 -vf scale=out_color_matrix=bt709:out_range=tv,format=yuv420p '
          '-colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range tv -movflags +faststart '
          '-f mp4').split()


class Raster:
    """Draws a scene row by row; a context, at whose end the figure is closed."""

    def __init__(self, scene: Scene):
        self._scene, self._pyplot = scene, pyplot_in_style()
        from matplotlib.collections import LineCollection
        from matplotlib.transforms import Bbox, TransformedBbox
        self._figure = self._pyplot.figure(figsize=((scene.width + 0.01) / DPI, (scene.height + 0.01) / DPI), dpi=DPI)
        self._axes = self._figure.add_axes((0.0, 0.0, scene.width / (scene.width + 0.01),
                                            scene.height / (scene.height + 0.01)))
        self._axes.set(xlim=(0, scene.width), ylim=(scene.height, 0))
        self._axes.axis('off')
        self._behind, self._strokes = (self._axes.add_collection(LineCollection(
            [], colors=[NAMED.get(each.color, each.color) for each in strokes],
            linewidths=[each.width for each in strokes], capstyle='round', joinstyle='round', snap=False,
            animated=True), autolim=False) for strokes in (scene.behind, scene.strokes))
        self._tails = self._axes.add_collection(LineCollection(
            [], colors=[(*each.color[:3], 0.5 * each.color[3]) for each in scene.trails],
            linewidths=1.4 * scene.unit, capstyle='round', snap=False, animated=True), autolim=False)
        plane = TransformedBbox(Bbox([[0, scene.head], [scene.width, scene.height]]), self._axes.transData)
        for drawn in (self._behind, self._tails, self._strokes):
            drawn.set_clip_box(plane)
        size = scene.font
        for x, y, anchor, text in scene.labels:
            self._axes.text(x, y, text, ha={'end': 'right', 'start': 'left'}[anchor], fontsize=size)
        self._time = self._axes.text(0.7 * size, 1.35 * size, '', fontsize=size, animated=True)
        self._figure.canvas.draw()
        self._still = self._figure.canvas.copy_from_bbox(self._figure.bbox)

    def __enter__(self):
        return self

    def __exit__(self, *problem) -> None:
        self._pyplot.close(self._figure)

    def pixels(self, row: int) -> np.ndarray:
        """Return the picture at a row, (height, width, 4) bytes, which the next call overwrites."""
        scene, canvas, shift = self._scene, self._figure.canvas, self._scene.shift[row]
        canvas.restore_region(self._still)
        for drawn, strokes in ((self._behind, scene.behind), (self._strokes, scene.strokes)):
            drawn.set_segments([_polyline(each.points[row] if len(each.points) > 1 else each.points[0] + shift)
                                for each in strokes])
        first = max(0, row - round(scene.look.trail / SAMPLE))
        self._tails.set_segments([_polyline(each.points[first:row + 1] + shift) for each in scene.trails])
        self._time.set_text(scene.time(row))
        for drawn in (self._behind, self._tails, self._strokes, self._time):
            self._axes.draw_artist(drawn)
        return np.asarray(canvas.buffer_rgba())


def _polyline(points: np.ndarray) -> np.ndarray:
    """Return complex points as (points, 2); one point becomes a line that is long enough to be drawn as a dot."""
    if len(points) == 1:
        points = np.append(points, points + 0.01)
    return np.stack([points.real, points.imag], axis=1)


def _palette(scene: Scene) -> list:
    """Return the colours of a scene, with their shades at the edges of lines, for all frames of a GIF."""
    from matplotlib.colors import to_rgb
    colors = dict.fromkeys([to_rgb(INK), to_rgb(FAINT), *(each.color[:3] for each in scene.strokes
                                                          if isinstance(each.color, tuple))])
    inks = np.array(list(colors))[:127]
    shades = np.linspace(1.0, 0.0, min(SHADES, 254 // len(inks)), endpoint=False)
    mixed = [1.0 - shade * (1.0 - ink) for shade in shades for ink in inks]
    return (255.0 * np.array([(1.0, 1.0, 1.0), *mixed])).round().astype(int).ravel().tolist()


def write_gif(scene: Scene, stream, done: Callable[[int], object]) -> None:
    """Write a GIF of a scene that goes round for ever; done(1) is called after each frame."""
    from PIL import Image

    def frames() -> Iterator:
        for row in range(0, scene.rows, GIF_EVERY):
            yield Image.fromarray(raster.pixels(row)[..., :3]).quantize(palette=palette, dither=Image.Dither.NONE)
            done(1)

    with Raster(scene) as raster:
        palette = Image.new('P', (1, 1))
        palette.putpalette(_palette(scene))
        images = frames()
        next(images).save(stream, 'GIF', save_all=True, append_images=images, loop=0,
                          duration=round(1000 * GIF_EVERY * SAMPLE))


def write_mp4(scene: Scene, path: str, done: Callable[[int], object]) -> None:
    """Write a scene over the file `path` as H.264 that plays everywhere; done(1) is called after each frame."""
    command = [_ffmpeg(), '-loglevel', 'error', '-nostdin', '-y', '-f', 'rawvideo', '-pix_fmt', 'rgba',
               '-video_size', f'{scene.width}x{scene.height}', '-framerate', f'{1 / (MP4_EVERY * SAMPLE):g}',
               '-i', 'pipe:0', *ENCODE, f'file:{path}']
    # A session of its own: Ctrl-C ends this process, which then ends that one.
    with Raster(scene) as raster, TemporaryFile() as said, subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=said, stderr=said, start_new_session=True) as encoder:
        assert encoder.stdin is not None
        try:
            for row in range(0, scene.rows, MP4_EVERY):
                encoder.stdin.write(raster.pixels(row))
                done(1)
            encoder.stdin.close()
        except OSError:       # it has ended; why, it says itself
            pass
        except BaseException:
            encoder.kill()
            raise
        if encoder.wait():
            said.seek(0)
            lines = said.read().decode(errors='replace').strip().splitlines() or [f'exit code {encoder.returncode}']
            raise Mistake(f'{path!r}: ffmpeg could not write it ({lines[-1]})')


def _ffmpeg() -> str:
    """Return the program that comes with imageio-ffmpeg, or one on the PATH; ImportError where there is none."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
        return get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        found = shutil.which('ffmpeg')
        if found is None:
            raise ImportError('no ffmpeg was found', name='imageio_ffmpeg') from None
        return found
