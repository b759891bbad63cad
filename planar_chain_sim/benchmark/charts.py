"""The style of the benchmarks' pictures: log-log, a marker and a colour for each library that all readers can see."""
from __future__ import annotations

INK = '#1f2933'
# Okabe and Ito's palette (2008), each colour with a marker of its own.
LOOKS = {'planar_chain_sim': ('#0072B2', 'o'), 'heyoka': ('#D55E00', 's'), 'Pinocchio': ('#009E73', '^'),
         'MuJoCo': ('#CC79A7', 'D'), 'SciPy': ('#E69F00', 'v'), 'Drake': ('#56B4E9', 'X')}
OTHER = ('#000000', '.')


class Chart:
    """Panels side by side with one legend below."""

    def __init__(self, panels: int, title: str):
        """Open `panels` panels; ImportError where there is no matplotlib."""
        import matplotlib
        matplotlib.use('Agg')
        from matplotlib import pyplot
        self._pyplot = pyplot
        width = 4.3 * panels if panels > 1 else 7.2
        self.figure, panels = pyplot.subplots(1, panels, figsize=(width, 4.9), squeeze=False, facecolor='white')
        self.panels = panels[0]
        self.figure.suptitle(title, color=INK, fontsize=12)
        self._labels = {}

    def line(self, panel: int, points, library: str, label: str, bold: bool = True) -> None:
        """Draw points (x, y); of a library's lines the bold one is its best and has the legend's entry."""
        color, marker = LOOKS.get(library, OTHER)
        style = {'linewidth': 2.0, 'markersize': 5.0, 'zorder': 3} if bold else {
            'linewidth': 0.8, 'markersize': 2.5, 'alpha': 0.35, 'zorder': 2}
        x, y = zip(*sorted(points))
        handle, = self.panels[panel].plot(x, y, marker=marker, color=color, **style)
        if bold:
            self._labels.setdefault(label, handle)

    def axes(self, panel: int, title: str, x: str, y: str, error: bool = False) -> None:
        """Name a panel and its axes; `error`: x runs from coarse to fine."""
        axes = self.panels[panel]
        axes.set(xscale='log', yscale='log', title=title, xlabel=x, ylabel=y)
        axes.title.set_fontsize(10)
        if error:
            axes.invert_xaxis()
        axes.grid(alpha=0.25, which='major')
        axes.spines[['top', 'right']].set_visible(False)

    def save(self, path) -> None:
        """Write PNG or SVG by the ending of `path`; OSError, ValueError."""
        self.figure.legend(self._labels.values(), self._labels.keys(), loc='lower center', frameon=False,
                           ncols=min(4, len(self._labels)), fontsize=9)
        self.figure.tight_layout(rect=(0.0, 0.07, 1.0, 1.0))
        self.figure.savefig(path, dpi=130, metadata={'Date': None} if str(path).endswith('.svg') else None)
        self._pyplot.close(self.figure)
