"""What a figure to play with carries: arrays as text, read back as the page reads them."""

import base64
import zlib

import numpy as np
import pytest

from fpputil import interactive
from fpputil.interactive.live import pack, quantised


def read(entry):
    """An array out of `pack` or `quantised`, as runtime.js has it."""
    flat = np.frombuffer(zlib.decompress(base64.b64decode(entry["b64"])), "<" + entry["dtype"])
    if entry.get("delta"):
        flat = np.cumsum(flat, dtype=flat.dtype)
    array = flat.reshape(entry["shape"])
    if "scale" not in entry:
        return array
    return np.where(array == entry["none"], np.nan, entry["offset"] + entry["scale"] * array)


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i4", "f4"])
def test_arrays_come_back(dtype):
    values = np.random.default_rng(0).integers(0, 200, (3, 7, 5)).astype(dtype)
    for array in (values, np.sort(values, axis=None).reshape(values.shape)):
        entry = pack(array)
        assert np.array_equal(read(entry), array) and read(entry).dtype == array.dtype
    assert pack(np.arange(1000, dtype="u2")).get("delta")


def test_maps_come_back_to_half_a_step_with_what_has_no_value():
    values = np.random.default_rng(1).normal(5, 40, (20, 30))
    values[3, 4:9] = np.nan
    entry = quantised(values)
    again = read(entry)
    assert np.array_equal(np.isnan(again), np.isnan(values))
    assert np.nanmax(np.abs(again - values)) <= 0.501 * entry["scale"]
    assert entry["scale"] == pytest.approx(np.ptp(values[np.isfinite(values)]) / 65534)
    flat = quantised(np.full((2, 2), 7.0))
    assert np.array_equal(read(flat), np.full((2, 2), 7.0))


def test_what_python_finds_is_told_for_the_pages_tests():
    values = np.arange(12.0).reshape(3, 4)
    values[2, 3] = np.nan
    figure = interactive.maps([{"name": "z", "values": values, "unit": "mm"}])
    (first, numbers), (last, others) = figure.spec["checks"]
    assert numbers == {"z": values[first["v"], first["u"]]}
    assert others == {"z": values[last["v"], last["u"]]} and last == {"frame": 0, "v": 2, "u": 2}
