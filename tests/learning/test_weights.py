"""Weights and checkpoints on disk: whole, ours, and a clear word about every other file."""

import json
import math
import os
import pickle
from pathlib import Path

import pytest
import safetensors
import torch
from safetensors.torch import load_file, save_file

from fpputil.learning.checkpoint import read_state, restore, save_checkpoint
from fpputil.learning.weights import (
    Trained,
    load_weights,
    read_metrics,
    save_weights,
    write_metrics,
    write_tensors,
)
from fpputil.networks.losses import Weights
from fpputil.networks.methods import SFNetMethod

METHOD = SFNetMethod(base=2, levels=3, mixing="every level", weights=Weights(order=False))
PITCHES = {"high": 24, "mid": 114, "zmin": 304, "unit": 912}
ABOUT = {"pitches": PITCHES, "camera": [120, 160], "extremes": [0.0, 244.0]}


@pytest.fixture
def trained():
    with torch.random.fork_rng():
        torch.manual_seed(3)
        return Trained(METHOD, METHOD.network().eval(), ABOUT)


@pytest.fixture
def saved(tmp_path, trained):
    save_weights(tmp_path / "net.safetensors", trained)
    return tmp_path / "net.safetensors"


def about_in(path):
    with safetensors.safe_open(path, "pt") as file:
        about = json.loads(file.metadata()["metadata"])
    return {k: v for k, v in about.items() if k != "sha256"}


def rewrite(path, tensors=None, **about):
    """The file again with other tensors, or other entries beside them."""
    tensors = load_file(path) if tensors is None else tensors
    write_tensors(path, tensors, {**about_in(path), **about})  # with the SHA-256 of these


@pytest.mark.parametrize("dtype", [torch.float16, torch.float32, torch.bfloat16])
def test_round_trip(tmp_path, trained, dtype):
    path = tmp_path / "net.safetensors"
    save_weights(path, trained, dtype)
    state = torch.get_rng_state()
    back = load_weights(str(path))
    assert torch.equal(state, torch.get_rng_state())  # loading draws nothing
    assert back.method == METHOD and back.metadata == ABOUT and not back.network.training
    own = trained.network.state_dict()
    assert back.network.state_dict().keys() == own.keys()
    for name, tensor in back.network.state_dict().items():
        assert tensor.dtype == torch.float32
        assert torch.equal(tensor, own[name].to(dtype).float()), name
    frames = torch.rand(1, 2, 9, 10)
    near = {torch.float16: 5e-3, torch.float32: 0, torch.bfloat16: 5e-2}[dtype]
    difference = (back.network(frames) - trained.network(frames)).abs().max()
    assert difference <= near * trained.network(frames).abs().max()


def test_sixteen_bit_is_what_goes_to_disk(saved, trained):
    number = sum(p.numel() for p in trained.network.parameters())
    assert {t.dtype for t in load_file(saved).values()} == {torch.float16}
    assert 2 * number < saved.stat().st_size < 2 * number + 6000


def test_a_network_in_channels_last_goes_to_disk_as_any(tmp_path, trained, saved):
    trained.network.to(memory_format=torch.channels_last)
    save_weights(tmp_path / "last.safetensors", trained)
    first, last = (load_file(f) for f in (saved, tmp_path / "last.safetensors"))
    assert all(torch.equal(first[k], last[k]) for k in first)


def test_numbers_are_kept_with_the_network_measured_alone(saved):
    measured = load_weights(saved)
    write_metrics(saved, measured, "test", {"mae_rad": (0.1, 0.0, math.nan), "views": 3})
    assert read_metrics(saved) == {"test": {"mae_rad": [0.1, 0.0, None], "views": 3}}
    other = {k: v + 1 for k, v in load_file(saved).items()}
    rewrite(saved, other)
    before = saved.with_suffix(".json").read_bytes()
    with pytest.raises(ValueError, match="no longer the network that was measured"):
        write_metrics(saved, measured, "test", {})
    assert saved.with_suffix(".json").read_bytes() == before


@pytest.mark.parametrize("value", [float("nan"), 1e5])
def test_weights_beyond_sixteen_bits_are_not_saved(tmp_path, trained, saved, value):
    before = saved.read_bytes()
    with torch.no_grad():
        trained.network.encoders[1].levels[0][0].bias[0] = value
    with pytest.raises(ValueError, match=r"encoders\.1\.levels\.0\.0\.bias .*float16"):
        save_weights(saved, trained)
    assert saved.read_bytes() == before


def steps(network, optimiser, number, seed):
    for k in range(number):
        frames = torch.rand(2, 2, 8, 8, generator=torch.Generator().manual_seed(seed + k))
        optimiser.zero_grad()
        network(frames).square().mean().backward()
        optimiser.step()


@pytest.fixture
def checkpoint(tmp_path, trained):
    """A network after three steps and its checkpoint."""
    optimiser = torch.optim.AdamW(trained.network.parameters(), 0.01)
    steps(trained.network, optimiser, 3, 0)
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(path, trained.network, optimiser, {"step": 3, "history": [{"a": 0.1}]})
    return path, trained.network, optimiser


def another():
    network = METHOD.network().eval()  # no dropout
    return network, torch.optim.AdamW(network.parameters(), 0.5)


@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
def test_a_checkpoint_goes_on_to_the_same_weights(checkpoint, layout):
    path, network, optimiser = checkpoint
    other, own = another()
    other.to(memory_format=layout)
    about = restore(path, other, own)
    assert about["step"] == 3 and about["history"] == [{"a": 0.1}]
    assert own.param_groups[0]["lr"] == 0.01
    exact = layout == torch.contiguous_format
    for way in (network, optimiser), (other, own):
        steps(*way, 2, 9)
    for p, q in zip(network.parameters(), other.parameters(), strict=True):
        torch.testing.assert_close(p, q, rtol=0 if exact else 1e-4, atol=0 if exact else 1e-5)


def test_a_checkpoint_stays_until_the_next_is_whole(checkpoint, monkeypatch):
    """Killed when all of the new one is written, but for its name."""
    path, network, optimiser = checkpoint
    before = path.read_bytes()

    def killed(part, target):
        assert target == path and read_state(Path(part))["step"] == 4
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        save_checkpoint(path, network, optimiser, {"step": 4})
    assert path.read_bytes() == before and list(path.parent.iterdir()) == [path]


def another_kind(path):
    """A checkpoint where weights belong, and the other way round."""
    network = METHOD.network()
    save_checkpoint(path, network, torch.optim.AdamW(network.parameters()), {})


def foreign(path):
    save_file({"w": torch.zeros(3)}, path, {"format": "pt"})


def pickled(path):
    """Which would make a folder when it is opened."""

    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(path.with_name("sprung")),)

    path.write_bytes(pickle.dumps(Trap()))


def with_tensors(change):
    def damage(path):
        tensors = load_file(path)
        change(tensors)
        rewrite(path, tensors)

    return damage


def with_method(**changes):
    return lambda path: rewrite(path, method={**about_in(path)["method"], **changes})


def flipped(path):
    """A bit of the last weight, which stays finite."""
    data = bytearray(path.read_bytes())
    data[-2] ^= 1
    path.write_bytes(data)


def altered(path):
    """A pitch of the metadata."""
    path.write_bytes(path.read_bytes().replace(b'zmin\\": 304', b'zmin\\": 305'))


BIAS = "decoders.1.out.bias"
CANNOT_BE_LOADED = [
    (lambda path: path.write_bytes(path.read_bytes()[:-1]), "is cut or not a safetensors file"),
    (lambda path: path.write_bytes(b""), "is cut"),
    (pickled, "is cut or not a safetensors file"),
    (foreign, "is not a file of weights of this version"),
    (another_kind, "is the checkpoint of a run; weights.safetensors is beside it"),
    (lambda path: rewrite(path, format="fpputil weights 99"), "not a file of weights of this ver"),
    (lambda path: rewrite(path, method=None), "describes no method"),
    (with_method(method="unet"), "describes no method of this version: method 'unet'"),
    (with_method(depth=3), "settings .*depth.* found, .* needed"),
    (with_method(weights={"phase": -1.0}), "weight of the phase loss -1.0"),
    (with_method(base="8"), "base '8'"),
    (with_tensors(lambda tensors: tensors.pop(BIAS)), rf"does not fit .*: {BIAS} and 0 more"),
    (with_tensors(lambda tensors: tensors.update(more=torch.zeros(2))), "does not fit .*: more"),
    (with_tensors(lambda tensors: tensors.update({BIAS: torch.zeros(())})), "does not fit"),
    (with_tensors(lambda tensors: tensors[BIAS].fill_(math.nan)), "weights that are not finite"),
    (flipped, "is not as it was written: its SHA-256 is another"),
    (altered, "is not as it was written: its SHA-256 is another"),
    (with_method(base=2**40), "describes no method of this version: Storage size"),
    (with_method(levels=10**6), "levels 1000000 given; a whole number from 2 to 16 is needed"),
    (lambda path: rewrite(path, pitches={"high": 24}), "for no system that there is: no pitches.m"),
    (lambda path: rewrite(path, pitches=[24]), r"pitches \[24\] given; a table is needed"),
    (lambda path: rewrite(path, camera=[120, "160"]), "camera.1 '160' given; a whole number of 1"),
    (lambda path: rewrite(path, extremes=[1.0]), "a list of 2 is needed"),
    (lambda path: rewrite(path, extremes=[0, math.nan]), "extremes.1 nan given; a finite number"),
]


@pytest.mark.parametrize("damage, words", CANNOT_BE_LOADED)
def test_files_that_cannot_be_loaded(saved, damage, words):
    damage(saved)
    with pytest.raises(ValueError, match=rf"{saved} .*{words}"):
        load_weights(saved)
    assert not saved.with_name("sprung").exists()


def drop(tensors):
    del tensors["optimiser.0.exp_avg"]


def unsealed(path):
    save_file(load_file(path), path, {"metadata": json.dumps(about_in(path))})


CANNOT_BE_RESTORED = [
    (lambda path: path.write_bytes(path.read_bytes()[:-1]), "is cut or not a checkpoint"),
    (foreign, "is not a checkpoint of this version"),
    (flipped, "is not as it was written: its SHA-256 is another"),
    (unsealed, "is not a checkpoint of this version"),
    (with_tensors(drop), "does not fit this network: optimiser.0.exp_avg and 0 more"),
    (with_tensors(lambda t: t.update({f"network.{BIAS}": torch.zeros(3)})), "does not fit"),
]


@pytest.mark.parametrize("damage, words", CANNOT_BE_RESTORED)
def test_checkpoints_that_cannot_be_restored(checkpoint, damage, words):
    path, *_ = checkpoint
    damage(path)
    with pytest.raises(ValueError, match=f"{path} {words}"):
        restore(path, *another())


def test_weights_that_no_sha_was_written_for_are_read(saved):
    unsealed(saved)
    assert load_weights(saved).metadata == ABOUT


def test_a_name_that_is_not_utf8_is_read(tmp_path, trained):
    path = tmp_path / os.fsdecode(b"caf\xe9.safetensors")
    save_weights(path, trained)
    assert load_weights(path).metadata == ABOUT


def test_names_and_missing_files(tmp_path, trained):
    for call in (lambda path: save_weights(path, trained), load_weights):
        with pytest.raises(ValueError, match="net.pt given; a file of weights ends in .safetens"):
            call(tmp_path / "net.pt")
    with pytest.raises(FileNotFoundError, match="no such file of weights"):
        load_weights(tmp_path / "none.safetensors")
