"""A Gray code against its cells written out, and orders against known columns."""

import numpy as np
import pytest

from fpputil.decoding.gray import gray_index, gray_order, read_cells
from fpputil.decoding.unwrap import TWO_PI, wrap
from fpputil.optics.graycode import KINDS, GrayCode, gray_code

WIDTH = 912
COLUMN = np.linspace(-0.49, WIDTH - 0.51, 40_001)[None]


def lit(code, column, blur=0.0):
    """Pictures of a code at columns, each the mean over so many columns round about."""
    at = column[..., None] + np.linspace(-blur / 2, blur / 2, 9 if blur else 1)
    return np.stack([code.intensity(at, n).mean(axis=-1) for n in range(code.steps)])


def test_neighbouring_cells_differ_in_one_bit_and_none_is_like_another():
    code = GrayCode(1, 6)
    bits = np.stack([code.intensity(np.arange(64), n) for n in range(6)]) > 127
    assert (np.abs(np.diff(bits.astype(int), axis=1)).sum(axis=0) == 1).all()
    assert gray_index(bits).tolist() == list(range(64))


@pytest.mark.parametrize("cell, shift", [(7.125, 0), (9, 4.5), (1, 0), (14.25, 7.125)])
def test_an_edge_lies_between_the_pixels_of_two_cells(cell, shift):
    code, pixel = GrayCode(cell, 10, shift=shift), np.arange(WIDTH)
    index = gray_index(np.stack([code.intensity(pixel, n) for n in range(10)]) > 127)
    np.testing.assert_array_equal(index, np.floor((pixel + shift) / cell))
    first = np.flatnonzero(np.diff(index)) + 1
    np.testing.assert_array_equal(code.edge(index[first]), first - 0.5)


def test_negatives_follow_their_pictures():
    code, plain = GrayCode(3, 4, inverse=True), GrayCode(3, 4)
    pixel = np.arange(48)
    for n in range(4):
        np.testing.assert_array_equal(code.intensity(pixel, 2 * n), plain.intensity(pixel, n))
        np.testing.assert_array_equal(
            code.intensity(pixel, 2 * n + 1), 255 - plain.intensity(pixel, n)
        )


@pytest.mark.parametrize("pitch", [16, 14.25, 19])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("blur, noise", [(1.0, 2.0), (3.0, 4.0), (0.0, 2.0)])
def test_sure_orders_are_those_of_the_columns(kind, pitch, blur, noise):
    rng = np.random.default_rng(0)
    code, sigma = gray_code(pitch, WIDTH, kind), 0.03
    frames = lit(code, COLUMN, blur) * (2 / 3) + rng.normal(0, noise, (code.bits, *COLUMN.shape))
    cells = read_cells(frames - 85, np.full(COLUMN.shape, 85.0), noise)
    phi = wrap(TWO_PI * COLUMN / pitch + rng.normal(0, sigma, COLUMN.shape))
    K, sure, off = gray_order(phi, cells, code, pitch, sigma)
    column = (phi / TWO_PI + K) * pitch
    assert np.abs(column - COLUMN)[sure].max() < pitch / 4
    # Nothing tells on which side of a sharp edge a pixel lies, unless a cell is half a period.
    assert sure.mean() > (0.999 if kind == "complementary" else 0.96 if blur else 0.85)
    assert np.abs(off).max() <= 0.5


def test_bits_that_no_edge_explains_say_how_far_they_may_mislead():
    signed = 100.0 * np.array([[1, 0.1, 0.1], [-1, -1, -0.1], [1, -1, -1]])[:, None]
    cells = read_cells(signed, np.full((1, 3), 100.0))
    # 7 and 6 part at the last bit alone; 1 and 6 at the first, which no edge does.
    assert cells.index.tolist() == [[6, 7, 7]] and cells.edge.tolist() == [[-1, -1, -1]]
    assert cells.reach.tolist() == [[0, 7, 10]]


@pytest.mark.parametrize(
    "refused, said",
    [
        (lambda: GrayCode(0, 4), "cell 0 given"),
        (lambda: GrayCode(4, 16), "bits 16 given; a whole number from 1 to 15"),
        (lambda: GrayCode(4, 4, "diagonal"), "axis 'diagonal' given"),
        (lambda: GrayCode(4, 4, inverse=1), "inverse 1 given"),
        (lambda: gray_code(16, 912, "binary"), "code 'binary' given; one of complementary, plain"),
    ],
)
def test_codes_that_cannot_be_are_refused(refused, said):
    with pytest.raises(ValueError) as error:
        refused()
    assert said in str(error.value)
