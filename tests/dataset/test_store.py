"""Reading a dataset: damage is found, and nothing half-written is read as data."""

import json
import shutil
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
import zarr
from numcodecs.checksum32 import CRC32C

from fpputil.dataset import layout
from fpputil.dataset.store import Store, check_files, open_store
from fpputil.optics.fringes import Fringe
from fpputil.optics.shapes import rotation
from fpputil.optics.system import system_to_dict


@pytest.fixture
def copy(small_set, tmp_path):
    return shutil.copytree(small_set, tmp_path / "copy")


def test_a_whole_dataset_passes(small_set):
    assert check_files(small_set) == []


@pytest.mark.parametrize(
    "place", ["column/c/0/0/0", "shade/c/4/0/0", "depth/zarr.json", "zarr.json"]
)
def test_one_flipped_bit_is_found(place, copy):
    file = copy / place
    data = bytearray(file.read_bytes())
    for position in (0, len(data) // 2, len(data) - 1):
        data[position] ^= 1
        file.write_bytes(data)
        assert check_files(copy) == [f"{place}: not as it was written"]
        data[position] ^= 1
    file.write_bytes(data)
    assert check_files(copy) == []


def test_missing_and_foreign_files_are_found(copy):
    (copy / "mask/c/2/0/0").unlink()
    (copy / "notes.txt").write_text("mine")
    assert check_files(copy) == ["mask/c/2/0/0: missing", "notes.txt: not part of the dataset"]


@pytest.mark.parametrize("name", ["sha256", "bytes", "lit", "white", "pose", "noise_seed"])
def test_a_flipped_record_is_found(name, copy):
    """Each entry that says something of a view, in the first record that has it."""
    file = copy / layout.MANIFEST
    manifest = json.loads(file.read_bytes())
    record = manifest["records"][4]
    holder = record if name in record else record["shards"]["depth/c/4/0/0"]
    old = layout.dumps(holder[name]).decode().strip()
    digit = next(c for c in reversed(old) if c.isdigit())
    at = old.rindex(digit)
    holder[name] = json.loads(old[:at] + str((int(digit) + 1) % 10) + old[at + 1 :])
    file.write_bytes(layout.dumps(manifest))
    assert "not as" in " ".join(check_files(copy))
    file.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(ValueError, match="is damaged"):
        open_store(copy)


def test_a_missing_shard_is_never_read_as_data(copy):
    index = int(open_store(copy).indices("test")[0])
    for name in layout.KINDS:
        (copy / f"{name}/c/{index // 2}/0/0").unlink()
        with pytest.raises(ValueError, match="fpp dataset check|inside the mask"):
            open_store(copy).view(index)


def test_photographs_of_any_pitch_steps_and_noise(small_set):
    store = open_store(small_set)
    index = int(store.indices("training")[0])
    fringes = [Fringe(33, 4), Fringe(500, 7)]
    clean = store.photographs(index, fringes)
    noisy = store.photographs(index, fringes, noise=3.0)
    assert clean.shape == (11, 120, 160) and clean.dtype == np.uint8
    lit = clean.max(0) > 20
    assert 2.5 < (noisy.astype(float) - clean)[:, lit].std() < 3.5
    np.testing.assert_array_equal(noisy, store.photographs(index, fringes, noise=3.0))


@pytest.mark.parametrize("word", ["content", "extremes", "records", "settings", "models"])
def test_a_manifest_that_lacks_an_entry_is_damaged(word, copy):
    file = copy / layout.MANIFEST
    file.write_text(file.read_text().replace(f'"{word}": ', f'"{word[1:]}": '))
    with pytest.raises(ValueError, match=f"manifest.json is damaged .no {word}.; generate anew"):
        open_store(copy)


@pytest.mark.parametrize(
    "old, new",
    [('"shards"', '"shirds"'), ('"zarr"', '"zirr"'), ('"extremes": [\n  0', '"extremes": [\n  1')],
)
def test_a_flipped_word_of_a_manifest_is_found(old, new, copy):
    """The name of an entry, or an extreme that the views do not have."""
    file = copy / layout.MANIFEST
    file.write_text(file.read_text().replace(old, new, 1))
    (line,) = check_files(copy)
    assert line.startswith("manifest.json: not as it was written")


@pytest.mark.parametrize("name", ["mask", "column", "shade", "depth"])
def test_every_flipped_byte_of_a_chunk_or_the_index_is_noticed(name, copy):
    """Blosc does not notice each of them; the CRC of the chunk and of the index do."""
    store = open_store(copy)
    index = int(store.indices("training")[0])
    file = copy / f"{name}/c/{index // 2}/0/0"
    whole = file.read_bytes()
    expected = store.array(name, index)
    for position in (*range(0, len(whole), max(1, len(whole) // 60)), *range(-36, 0)):
        data = bytearray(whole)
        data[position] ^= 64
        file.write_bytes(data)
        try:
            read = store.array(name, index)
        except ValueError as error:
            assert "cannot be read" in str(error) and "fpp dataset check" in str(error)
            continue
        np.testing.assert_array_equal(read, expected)  # the byte belongs to the other view


def test_a_view_of_few_pixels_is_left_out(copy):
    manifest = json.loads((copy / layout.MANIFEST).read_bytes())
    index = int(open_store(copy).indices("training")[0])
    least = manifest["settings"]["least"]
    for lit, listed in ((least - 1, False), (least, True)):
        manifest["records"][index // 2]["lit"][index % 2] = lit
        (copy / layout.MANIFEST).write_bytes(layout.dumps(manifest))
        assert (index in open_store(copy).indices("training")) is listed


def test_a_file_that_cannot_be_read_is_a_line_of_the_list(copy):
    (copy / "mask/c/2/0/0").unlink()
    (copy / "mask/c/2/0/0").mkdir()
    assert check_files(copy) == ["mask/c/2/0/0: cannot be read (Is a directory)"]


def test_content_speaks_for_every_shard(small_set):
    records = json.loads((small_set / layout.MANIFEST).read_bytes())["records"]
    before = layout.content(records)
    records[3]["shards"]["column/c/3/0/0"]["sha256"] = "0" * 64
    assert layout.content(records) != before


def test_reading_is_what_zarr_reads(small_set):
    """As any other reader of Zarr finds it."""
    group, store = zarr.open_group(small_set, mode="r"), open_store(small_set)
    for name in layout.KINDS:
        assert group[name].shape == (22, 120, 160)
        assert group[name].metadata.dimension_names == ("view", "v", "u")
        for index in range(22):
            np.testing.assert_array_equal(group[name][index], store.array(name, index))


def test_a_view_does_not_depend_on_where_the_world_lies(small_set):
    store = open_store(small_set)
    index = store.indices("training")[0]
    turn, shift = rotation(60, 120), np.array([30.0, -20.0, 10.0])  # x' = turn x + shift

    def moved(pinhole):
        R = pinhole.R @ turn.T
        return replace(pinhole, R=R, t=pinhole.t - R @ shift)

    system = store.system
    system = replace(system, camera=moved(system.camera), projector=moved(system.projector))
    other = Store(store.path, {**store.manifest, "system": system_to_dict(system)})
    one, two = (s.view(index) for s in (store, other))
    np.testing.assert_allclose(two.row[two.mask], one.row[one.mask], atol=1e-3)


def sealed(data):
    """Bytes with the CRC that belongs to them."""
    return CRC32C(location="end").encode(np.frombuffer(data, np.uint8)).tobytes()


@pytest.mark.parametrize("entry, value", [(0, 2**63), (0, 10**6), (1, 2**63), (1, 2**40), (1, 3)])
def test_an_index_that_points_elsewhere_is_noticed(entry, value, copy):
    """Its CRC is right: whoever wrote it meant harm, or wrote past 16 GB."""
    store = open_store(copy)
    index = int(store.indices("training")[0])
    file = copy / f"mask/c/{index // 2}/0/0"
    data = file.read_bytes()
    places = np.frombuffer(data[-36:-4], "<u8").copy()
    places[2 * (index % 2) + entry] = value
    file.write_bytes(data[:-36] + sealed(places.tobytes()))
    with pytest.raises(ValueError, match="mask of view .* cannot be read .*; run: fpp dataset"):
        store.array("mask", index)


@pytest.mark.parametrize("at", [4, 12])
@pytest.mark.parametrize("value", [0, 100, 2**31 - 1])
def test_a_chunk_of_another_size_is_noticed(at, value, copy):
    """What Blosc's head says it holds, and how long it says it is, with a CRC that is right."""
    store = open_store(copy)
    index = int(store.indices("training")[0])
    file = copy / f"mask/c/{index // 2}/0/0"
    data = bytearray(file.read_bytes())
    start, size = np.frombuffer(data[-36:-4], "<u8").reshape(2, 2)[index % 2].tolist()
    data[start + at : start + at + 4] = value.to_bytes(4, "little")
    data[start : start + size] = sealed(bytes(data[start : start + size - 4]))
    file.write_bytes(data)
    with pytest.raises(ValueError, match="cannot be read .ValueError: a chunk of"):
        store.array("mask", index)


@pytest.mark.parametrize(
    "place, value, said",
    [
        (("settings", "views"), "2", "settings.views '2' given"),
        (("settings", "views"), 10**9, "2 entries in records.0"),
        (("settings", "models"), 12, "settings.models 12, 11 models, 11 records"),
        (("system", "camera", "width"), 10**9, "1000000000 x 120 pixels"),
        (("system", "z_min"), 900.0, "measuring range 900.0 to 820.0 mm"),
        (("pitches", "high"), None, "pitches.high None given"),
        (("pitches", "low"), 3, "pitches.low is not known"),
        (("frames",), [{"pitch": 24, "steps": 15}], "1 entries in frames"),
        (("frames",), [{"pitch": 24, "steps": 10**9}] * 4, "steps 1000000000 given"),
        (("models", 0, "split"), ["test"], "models.0.split .'test'. given; the splits are"),
        (("records", 0, "lit"), [1.5, 2], "records.0.lit.0 1.5 given"),
        (("records", 0, "shards"), [], "records.0.shards .. given; a table is needed"),
        (("extremes",), 3, "extremes 3 given; a list of 2"),
    ],
)
def test_a_manifest_of_another_structure_is_damaged(place, value, said, copy):
    file = copy / layout.MANIFEST
    manifest = json.loads(file.read_bytes())
    *way, last = place
    reduce(lambda at, key: at[key], way, manifest)[last] = value
    file.write_bytes(layout.dumps(manifest))
    with pytest.raises(ValueError, match=f"manifest.json is damaged .*{said}.*; generate anew"):
        open_store(copy)
    (line,) = check_files(copy)
    assert line.startswith("manifest.json: not as it was written")


def test_a_record_reads_no_file_elsewhere(copy):
    """Its shards are files of the dataset, or the check would read whatever they name."""
    file = copy / layout.MANIFEST
    manifest = json.loads(file.read_bytes())
    shards = manifest["records"][0]["shards"]
    shards["../notes"] = shards.pop("mask/c/0/0/0")
    file.write_bytes(layout.dumps(manifest))
    assert "../notes: not part of the dataset" in check_files(copy)
