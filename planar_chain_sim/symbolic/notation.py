"""The notation of symbols, vectors and rates: in Unicode text for a terminal, in LaTeX for a paper."""
from __future__ import annotations

from functools import lru_cache
import re
from unicodedata import combining, east_asian_width, normalize

from .factors import Coordinate, Effort, Symbol, Vector

SOFT_BREAK = '\x1f'     # a space at which a line may be broken

SUBSCRIPTS = str.maketrans('0123456789', ''.join(map(chr, range(0x2080, 0x208a))))
GREEK = {'beta': '\u03b2', 'gamma': '\u03b3', 'delta': '\u03b4', 'epsilon': '\u03b5', 'eta': '\u03b7',
         'theta': '\u03b8', 'tau': '\u03c4', 'phi': '\u03c6', 'chi': '\u03c7'}
DOT, DOTS, HAT = '\u0307', '\u0308', '\u0302'     # combining marks
MINUS, TIMES, SQUARED = '\u2212', '\u00b7', '\u00b2'

# the subscripts x and a and the superscript 0 exist as characters, a subscript c doesn't; p goes with c
TEXT_LETTERS = {'Ia': 'I\u2090', 'ma': 'm\u2090', 'd_x': 'd\u2093', 'k_x': 'k\u2093', 'tau_c': '\u03c4c', 'f_c': 'fc',
                'tau_p': '\u03c4p', 'f_p': 'fp', 'theta_rest': '\u03b8\u2070', 'x_rest': 'x\u2070',
                'q_rest': 'q\u2070', 'delta_g': '\u03b4g', **GREEK}
LATEX_MARKS = {   # letter, subscript before the number, superscript
    'Ia': ('I', 'a', ''), 'ma': ('m', 'a', ''), 'd_x': ('d', 'x', ''), 'k_x': ('k', 'x', ''), 'f_c': ('f', 'c', ''),
    'tau_c': (r'\tau', 'c', ''), 'tau_p': (r'\tau', 'p', ''), 'f_p': ('f', 'p', ''),
    'theta_rest': (r'\theta', '', '0'), 'x_rest': ('x', '', '0'), 'q_rest': ('q', '', '0'),
    'delta_g': (r'\delta', 'g', ''), **{name: (f'\\{name}', '', '') for name in GREEK},
    'phi': (r'\varphi', '', ''), 'epsilon': (r'\varepsilon', '', '')}


@lru_cache(maxsize=4096)
def display_width(text: str) -> int:
    """Columns that a text takes on a terminal: a combining mark takes none, an East Asian wide character two."""
    return sum(0 if combining(c) else 2 if east_asian_width(c) in 'WF' else 1 for c in text)


class Text:
    """Unicode: combining marks for hats and dots, subscripts as characters."""

    minus, times, dot, opening, closing = MINUS, ' ', TIMES, '(', ')'
    functions = {'cos': 'cos', 'sin': 'sin', 'sign': 'sgn'}

    @lru_cache(maxsize=4096)
    def _marked(self, letter: str, mark: str, index: int) -> str:
        number = str(index).translate(SUBSCRIPTS) if index else ''
        return normalize('NFC', TEXT_LETTERS.get(letter, letter) + mark) + number

    def symbol(self, symbol: Symbol) -> str:
        """Return a constant, or a number."""
        return self._marked(symbol.letter, '', symbol.index) if symbol.letter else self.number(symbol.value)

    def effort(self, effort: Effort) -> str:
        """Return an actuator's effort."""
        return self._marked(effort.letter, '', effort.index)

    def coordinate(self, coordinate: Coordinate, order: int = 0) -> str:
        """Return a coordinate or its derivative."""
        return self._marked(coordinate.letter, ('', DOT, DOTS)[order], coordinate.index)

    def vector(self, vector: Vector) -> str:
        """Return a unit vector; chi and gravity have no hat."""
        return self._marked(vector.shown_letter, '' if vector.letter in ('chi', 'g') and not vector.turned else HAT,
                            vector.index)

    def squared(self, text: str) -> str:
        """Return a square."""
        return text + SQUARED

    def number(self, value: float) -> str:
        """Six digits; JSON has them all."""
        return f'{value:.6g}'.replace('-', MINUS, 1) if value < 0 else f'{value:.6g}'

    def name(self, text: str) -> str:
        """Return a name from the chain file."""
        return text

    def width(self, text: str) -> int:
        """Columns on a terminal."""
        return display_width(text)


class Latex(Text):
    """LaTeX in math mode with amsmath; all that appears is in matplotlib's mathtext too."""

    minus, times, dot = '-', r'\,', r'\cdot '
    functions = {'cos': r'\cos', 'sin': r'\sin', 'sign': r'\mathrm{sgn}'}

    @lru_cache(maxsize=4096)
    def _marked(self, letter: str, mark: str, index: int) -> str:
        letter, lower, upper = LATEX_MARKS.get(letter, (letter, '', ''))
        command = {'': '', DOT: r'\dot', DOTS: r'\ddot', HAT: r'\hat'}[mark]
        base = f'{command}{{{letter}}}' if command else letter
        lower += str(index or '')
        return base + (f'_{{{lower}}}' if lower else '') + (f'^{{{upper}}}' if upper else '')

    def vector(self, vector: Vector) -> str:
        """Return a unit vector; gravity is bold."""
        return r'\mathbf{g}' if vector.letter == 'g' else super().vector(vector)

    def squared(self, text: str) -> str:
        """Return a square."""
        return text + '^{2}'

    def number(self, value: float) -> str:
        """Six digits, powers of ten as such."""
        digits, _, exponent = f'{value:.6g}'.partition('e')
        return digits + (rf' \times 10^{{{int(exponent)}}}' if exponent else '')

    def name(self, text: str) -> str:
        """Return a name from the chain file, in text mode."""
        special = {'\\': r'\textbackslash{}', '~': r'\textasciitilde{}', '^': r'\textasciicircum{}'}
        return ''.join(special.get(c, f'\\{c}' if c in '#$%&_{}' else c) for c in text)

    def width(self, text: str) -> int:
        """Approximate number of printed characters."""
        return len(re.sub(r'\\(ddot|dot|hat|mathbf|mathrm|,)|[{}_^]', '', re.sub(r'\\(var)?[a-z]{2,}', 'x', re.sub(
            r'\\(ddot|dot|hat|mathbf|mathrm)\b', '', text))))


TEXT, LATEX = Text(), Latex()
