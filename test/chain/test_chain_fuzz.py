"""Chain files: any bytes give a Chain or one ChainError sentence, without much work."""
from hypothesis import given, settings, strategies as st
from oracles.two_rods import rod, TWO_RODS
from oracles.work import lines_run
import pytest

from planar_chain_sim import Chain, chain_from_dict, ChainError, load_chain
from planar_chain_sim.chain_file import chain_from_text

MEGABYTES_10 = 10 * 2**20
BITS_OF_YAML = st.sampled_from(TWO_RODS.split() + list('-:,[]{}#&*!|>%@?~ \n\t"\'\\\0\x85\ufeff\ud800') + [
    '\n  - ', '\n    ', ': ', '.nan', '-.inf', '1e400', '-1', '0', '<<', '---\n', '...\n'])
ANY_DATA = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary() | st.just(10**400),
    lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.integers(), inner), max_leaves=10)


def one_sentence_or_chain(load, what):
    """Load; a refusal must be a ChainError whose text is one printable line."""
    try:
        assert isinstance(load(what), Chain)
    except ChainError as error:
        assert str(error).isprintable() and ', must ' in str(error), str(error)
        return str(error)


@settings(max_examples=300, deadline=None)
@given(st.lists(BITS_OF_YAML | st.text(max_size=3), max_size=40).map(''.join))
def test_any_text(text):
    one_sentence_or_chain(chain_from_text, text)


@settings(max_examples=100, deadline=None)
@given(st.binary())
def test_any_bytes(data):
    one_sentence_or_chain(chain_from_text, data)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, len(TWO_RODS)), st.integers(0, 12), st.lists(BITS_OF_YAML, max_size=4).map(''.join))
def test_good_file_with_a_damaged_part(start, length, patch):
    one_sentence_or_chain(chain_from_text, TWO_RODS[:start] + patch + TWO_RODS[start + length:])


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(['name', 'carrier', 'origin', 'mass', 'inertia', 'inertia_com', 'rotation', 'slide', 'visual']),
       ANY_DATA)
def test_good_data_with_a_wrong_value(key, value):
    one_sentence_or_chain(chain_from_dict, {'bodies': [rod(**{key: value})]})


@settings(max_examples=100, deadline=None)
@given(ANY_DATA)
def test_any_data(data):
    one_sentence_or_chain(chain_from_dict, data)


@pytest.mark.parametrize('garbage', [
    '[', '{', '- ', 'a: ', '&a [*a ', '{? ', '"', 'garbage\n', '0', '!a ', '#', '\n', '- - ', 'bodies: ', '- a\n', 'é',
    '%a\n', b'\xff', b'\0', 'random'])
def test_ten_megabytes_of_garbage_are_one_sentence_soon(tmp_path, random_bytes, garbage):
    data = garbage.encode() if isinstance(garbage, str) else garbage
    data = random_bytes if garbage == 'random' else data * (MEGABYTES_10 // len(data))
    (tmp_path / 'garbage.yaml').write_bytes(data)
    refusal, lines = lines_run(lambda: one_sentence_or_chain(load_chain, tmp_path / 'garbage.yaml'))
    assert refusal and lines < 2000   # 800 at most: nothing is done for each byte or node


@pytest.fixture(scope='module')
def random_bytes():
    """Return ten megabytes that are the same in every run."""
    from random import Random
    return Random(2).randbytes(MEGABYTES_10)


def test_load_time_grows_with_the_number_of_bodies_not_its_square():
    """Twice the bodies, twice the work; a look-up through all bodies for each body would be four times the work."""
    bodies = [f"""
  - name: link_{i}
    carrier: {f'link_{i - 1}' if i else 'base'}
    origin: [0.1, 0.0]
    mass: 0.01
    center_of_mass: [0.05, 0.0]
    inertia_com: 8.3e-6
    rotation: {{joint: joint_{i}, damping: 0.001}}""" for i in range(4096)]
    assert chain_from_text('bodies:' + ''.join(bodies)).joint_count == 4096
    few, many = (lines_run(lambda: chain_from_text('bodies:' + ''.join(bodies[:count])))[1] for count in (250, 500))
    assert many < 2.1 * few
