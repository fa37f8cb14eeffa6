"""Weights and checkpoints on disk: whole, ours, and a clear word about every other file."""

import json
import math
import os
import pickle

import pytest
import safetensors
import torch
from safetensors.torch import load_file, save_file

from fpputil.learning.checkpoint import read_about, restore, save_checkpoint
from fpputil.learning.weights import (
    Trained,
    load_weights,
    read_metrics,
    save_weights,
    write_metrics,
)
from fpputil.networks.losses import Weights
from fpputil.networks.methods import SFNetMethod

METHOD = SFNetMethod(base=2, levels=3, mixing="every level", weights=Weights(order=False))
ABOUT = {"pitches": {"high": 24, "zmin": 304}, "camera": [120, 160], "extremes": [0.0, 244.0]}


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
        return json.loads(file.metadata()["metadata"])


def rewrite(path, tensors=None, **about):
    """The file again with other tensors, or other entries beside them."""
    text = json.dumps({**about_in(path), **about})
    save_file(load_file(path) if tensors is None else tensors, path, {"metadata": text})


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


def test_equal_networks_are_equal_files(tmp_path, trained, saved):
    save_weights(tmp_path / "again.safetensors", trained)
    assert (tmp_path / "again.safetensors").read_bytes() == saved.read_bytes()


@pytest.mark.parametrize("share", [0, 4, 8, 100, 0.5, 0.9, -1])
@pytest.mark.parametrize("load", [load_weights, read_about])
def test_a_cut_file(saved, load, share):
    data = saved.read_bytes()
    saved.write_bytes(data[: int(share * len(data)) if isinstance(share, float) else share])
    with pytest.raises(ValueError, match=rf"{saved} is cut"):
        load(saved)


@pytest.mark.parametrize(
    "metadata",
    [None, {"format": "pt"}, *({"metadata": text} for text in ("null", "[]", "7", "{}")),
     {"metadata": "{"}, {"metadata": ""}, {"metadata": '{"format": "fpputil weights 99"}'}],
)  # fmt: skip
@pytest.mark.parametrize("load", [load_weights, read_about])
def test_a_file_of_another_program(tmp_path, load, metadata):
    path = tmp_path / "other.safetensors"
    save_file({"w": torch.zeros(3)}, path, metadata)
    with pytest.raises(ValueError, match=str(path)):
        load(path)


@pytest.mark.parametrize("load", [load_weights, read_about])
def test_a_pickle_is_not_opened(tmp_path, load):
    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "sprung"),)

    path = tmp_path / "evil.safetensors"
    path.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(ValueError, match=f"{path} is cut or not"):
        load(path)
    torch.save({"w": torch.zeros(3)}, path)
    with pytest.raises(ValueError, match=f"{path} is cut or not"):
        load(path)
    assert not (tmp_path / "sprung").exists()


def test_a_checkpoint_is_not_weights_nor_weights_a_checkpoint(tmp_path, saved, trained):
    path = tmp_path / "checkpoint.safetensors"
    save_checkpoint(path, trained.network, torch.optim.AdamW(trained.network.parameters()), {})
    with pytest.raises(ValueError, match=f"{path} is the checkpoint of a run"):
        load_weights(path)
    with pytest.raises(ValueError, match=f"{saved} is not a checkpoint"):
        read_about(saved)


def test_a_file_of_another_version(saved):
    rewrite(saved, format="fpputil weights 99")
    with pytest.raises(ValueError, match=f"{saved} was written by another version"):
        load_weights(saved)


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


def missing(tensors):
    del tensors["decoders.1.out.bias"]


def extra(tensors):
    tensors["more"] = torch.zeros(2)


def another_shape(tensors):
    tensors["encoders.0.levels.0.0.weight"] = torch.zeros(3, 1, 3, 3)


def flat(tensors):
    tensors["decoders.1.out.bias"] = torch.zeros(())


def not_finite(tensors):
    tensors["decoders.1.out.bias"][0] = torch.nan


def infinite(tensors):
    tensors["decoders.1.out.bias"][0] = torch.inf


@pytest.mark.parametrize("damage", [missing, extra, another_shape, flat, not_finite, infinite])
def test_weights_that_do_not_fit(saved, damage):
    tensors = load_file(saved)
    damage(tensors)
    rewrite(saved, tensors)
    with pytest.raises(ValueError, match=str(saved)):
        load_weights(saved)


def test_the_weight_that_does_not_fit_is_named(saved):
    tensors = load_file(saved)
    missing(tensors)
    rewrite(saved, tensors)
    with pytest.raises(ValueError, match=r"decoders\.1\.out\.bias"):
        load_weights(saved)


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"method": "unet"}, "method 'unet' is not known"),
        ({"method": "psnet"}, r"\['base', 'dropout', 'levels'\] needed"),
        ({"reference": "first"}, "reference 'first'"),
        ({"method": None}, "method None is not known"),
        ({"depth": 3}, "depth"),
        ({"weights": {"phase": 1.0, "focal": 2.0}}, "focal"),
        ({"weights": {"phase": -1.0}}, "-1.0"),
        ({"weights": None}, "weights None"),
        ({"base": None}, "base"),
        ({"base": "8"}, "base '8'"),
        ({"levels": 1}, "levels 1"),
        ({"dropout": 2.0}, "dropout 2.0"),
        ({"dropout": "much"}, "dropout"),
        ({"mixing": "some"}, "mixing 'some'"),
        ({"frames": 9}, "9 frames"),
        ({"frames": [1, 1]}, ""),
        ({"target": "depth"}, "target 'depth'"),
    ],
)
def test_settings_of_another_version(saved, changes, said):
    rewrite(saved, method={**about_in(saved)["method"], **changes})
    with pytest.raises(ValueError, match=rf"(?s){saved}.*{said}"):
        load_weights(saved)


@pytest.mark.parametrize("name", ["method", "base", "weights"])
def test_settings_that_lack_something(saved, name):
    rewrite(saved, method={k: v for k, v in about_in(saved)["method"].items() if k != name})
    with pytest.raises(ValueError, match=rf"{saved}.*{name}"):
        load_weights(saved)


@pytest.mark.parametrize("method", [None, [], "sfnet", 3])
def test_a_file_that_names_no_method(saved, method):
    rewrite(saved, method=method)
    with pytest.raises(ValueError, match=f"{saved} describes no method"):
        load_weights(saved)


def test_names_and_missing_files(tmp_path, trained):
    for call in (lambda p: save_weights(p, trained), load_weights):
        with pytest.raises(
            ValueError, match="net.pt given; a file of weights ends in .safetensors"
        ):
            call(tmp_path / "net.pt")
    with pytest.raises(FileNotFoundError, match="no such file of weights"):
        load_weights(tmp_path / "none.safetensors")
    with pytest.raises(FileNotFoundError, match="nowhere"):
        save_weights(tmp_path / "nowhere" / "net.safetensors", trained)
    with pytest.raises(FileNotFoundError, match="no run to resume"):
        read_about(tmp_path / "checkpoint.safetensors")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e5])
def test_weights_beyond_sixteen_bits_are_not_saved(tmp_path, trained, saved, value):
    before = saved.read_bytes()
    with torch.no_grad():
        trained.network.encoders[1].levels[0][0].bias[0] = value
    with pytest.raises(ValueError, match=r"encoders\.1\.levels\.0\.0\.bias .*float16"):
        save_weights(saved, trained)
    assert saved.read_bytes() == before


@pytest.mark.parametrize("fails", ["replace", "fsync"])
def test_nothing_half_written_stays(saved, trained, monkeypatch, fails):
    before = saved.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, fails, full)
    with pytest.raises(OSError, match="No space left on device, writing"):
        save_weights(saved, trained, torch.float32)
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]


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


def test_a_checkpoint_before_the_first_step(tmp_path):
    network, optimiser = another()
    save_checkpoint(tmp_path / "c.safetensors", network, optimiser, {})
    other, own = another()
    restore(tmp_path / "c.safetensors", other, own)
    for way in (network, optimiser), (other, own):
        steps(*way, 2, 0)
    assert all(map(torch.equal, network.parameters(), other.parameters()))


@pytest.mark.parametrize("part", ["network.decoders.1.out.bias", "optimiser.0.exp_avg"])
@pytest.mark.parametrize("damage", ["missing", "shape"])
def test_a_damaged_checkpoint(checkpoint, part, damage):
    path, *_ = checkpoint
    tensors = load_file(path)
    kept = tensors.pop(part)
    if damage == "shape":
        tensors[part] = torch.zeros(kept.shape[0] + 1, *kept.shape[1:])
    rewrite(path, tensors)
    with pytest.raises(ValueError, match=str(path)):
        restore(path, *another())


def test_a_checkpoint_of_another_network(checkpoint):
    path, *_ = checkpoint
    network = SFNetMethod(base=3, levels=2).network()
    with pytest.raises(ValueError, match=str(path)):
        restore(path, network, torch.optim.AdamW(network.parameters()))
