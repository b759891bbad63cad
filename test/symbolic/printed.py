"""Reads equations back from what is printed, text, LaTeX or JSON, as Python expressions to be evaluated."""
import json
import re
from unicodedata import normalize

SUBSCRIPTS = {0x2080 + digit: str(digit) for digit in range(10)}
GREEK = {'β': 'beta', 'γ': 'gamma', 'δ': 'delta_', 'ε': 'epsilon', 'η': 'eta', 'φ': 'phi', 'χ': 'chi', 'τ': 'tau',
         'θ': 'theta'}
HAT, DOT, DOTS = '\u0302', '\u0307', '\u0308'


def from_text(text):
    """Return {coordinate: (left, right)} of the equations in a text document."""
    found = {}
    for block in re.split(r'^\(5\.8[78]\)  ', text, flags=re.MULTILINE)[1:]:
        heading, *lines = block.split('\n')
        lines = [line for line in lines if line.startswith('   ') and not line.startswith('        ')
                 or line.startswith('         ')]
        body = expression_of_text(' '.join(lines))
        left, right = body.split('=')
        found[expression_of_text(heading.split(',')[0])] = left.strip(), right.strip()
    return found


def expression_of_text(text):
    """Return the ASCII expression of a line of the text document."""
    text = normalize('NFD', text).translate(SUBSCRIPTS)
    for letter, name in GREEK.items():
        text = text.replace(letter, name)
    text = text.replace('\u2212', '-')
    text = re.sub('(tau|f)([cp])', r'\1_\2', text)
    text = text.replace('I\u2090', 'Ia').replace('m\u2090', 'ma').replace('d\u2093', 'd_x').replace('k\u2093', 'k_x')
    text = re.sub('(x|q|theta)\u2070(\\d+)', r'\1_rest\2', text)
    text = re.sub(f'([a-z]+){HAT}(\\d+)', r'\1\2_hat', text)
    text = re.sub(r'chi(\d+)', r'chi\1_hat', text)
    text = re.sub(f'([a-z]+){DOTS}(\\d+)', r'\1\2_dd', text)
    text = re.sub(f'([a-z]+){DOT}(\\d+)', r'\1\2_d', text)
    text = re.sub('g\u00b7', 'g_vec\u00b7', text)
    text = text.replace('\u00b7', ' @ ').replace('\u00b2', '**2').replace('sgn', 'sign')
    return times(text)


def times(text):
    """Put * for the spaces that mean a product."""
    text = re.sub(r'\s+', ' ', text)
    return re.sub(r'(?<=[\w)]) (?=[\w(])', '*', text)


def from_latex(text):
    """Return {coordinate: (left, right)} of the equations in a LaTeX document."""
    found = {}
    equation = r'^% \(5\.8[78]\) for (\w+),[^\n]*\n\\begin\{align\*\}\n(.*?)\\end\{align\*\}'
    for coordinate, body in re.findall(equation, text, flags=re.MULTILINE | re.DOTALL):
        left, right = expression_of_latex(body).split('=')
        found[coordinate] = left.strip(), right.strip()
    return found


def expression_of_latex(text):
    """Return the ASCII expression of LaTeX."""
    text = re.sub(r'\\hspace\{\dem\}|&|\\\\', ' ', text)
    text = text.replace(r'\varphi', 'phi').replace(r'\varepsilon', 'epsilon').replace(r'\mathbf{g}', 'g_vec')
    text = text.replace(r'\mathrm{sgn}', 'sign').replace(r'\,', '*')
    text = re.sub(r'\\(beta|gamma|delta|eta|chi|tau|theta|cos|sin)', r'\1', text)
    text = re.sub(r' \\times 10\^\{(-?\d+)\}', r'e\1', text)
    text = re.sub(r'(x|q|theta)_\{(\d+)\}\^\{0\}', r'\1_rest\2', text)
    text = re.sub(r'\\hat\{(\w+)\}_\{(\d+)\}', r'\1\2_hat', text)
    text = re.sub(r'chi_\{(\d+)\}', r'chi\1_hat', text)
    text = re.sub(r'\\ddot\{(\w+)\}_\{(\d+)\}', r'\1\2_dd', text)
    text = re.sub(r'\\dot\{(\w+)\}_\{(\d+)\}', r'\1\2_d', text)
    text = re.sub(r'delta_\{g\}', 'delta_g', text)
    text = re.sub(r'(I|m)_\{a(\d+)\}', r'\1a\2', text)
    text = re.sub(r'(d|k)_\{x(\d+)\}', r'\1_x\2', text)
    text = re.sub(r'(tau|f)_\{c(\d+)\}', r'\1_c\2', text)
    text = re.sub(r'(\w)_\{(\d+)\}', r'\1\2', text)
    return re.sub(r'\s+', ' ', text.replace(r'\cdot', ' @').replace('^{2}', '**2'))


def from_json(text):
    """Return {coordinate: (left, right)} of the equations in a JSON document."""
    return {equation['coordinate']: tuple(' + '.join(f'({term["expression"]})' for term in equation[side]) or '0'
                                          for side in ('left', 'right')) for equation in json.loads(text)['equations']}


READERS = {'text': from_text, 'latex': from_latex, 'json': from_json}


class PlaneVector:
    """A vector of the plane whose products the printed equations take: numbers or SymPy expressions."""

    def __init__(self, x, y):
        self.x, self.y = x, y

    def __add__(self, other):
        return PlaneVector(self.x + other.x, self.y + other.y)

    def __sub__(self, other):
        return self + -other

    def __neg__(self):
        return self * -1

    def __mul__(self, factor):
        return PlaneVector(self.x * factor, self.y * factor)

    __rmul__ = __mul__

    def __matmul__(self, other):
        return self.x * other.x + self.y * other.y


def vectors_of(document, functions, names):
    """Return the vectors of a JSON document by name, their angles evaluated with `names`; functions: cos, sin, pi."""
    made = {}
    for name, data in document['vectors'].items():
        angle = eval(data['angle'], {'pi': functions.pi}, names)
        length = names['g'] if name == 'g_vec' and 'g' in names else data['length']
        made[name] = PlaneVector(length * functions.cos(angle), length * functions.sin(angle))
    return made
