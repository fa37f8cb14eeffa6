"""Training: equal runs end alike, stopped ones go on as if they had not been, none is lost."""

import contextlib
import functools
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from multiprocessing import active_children
from types import SimpleNamespace

import pytest
import torch
from matplotlib.figure import Figure
from safetensors.torch import load_file
from torch import nn

from fpputil.cli import main
from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.checkpoint import read_state
from fpputil.learning.config import TrainingConfig
from fpputil.learning.devices import processes
from fpputil.learning.log import read_log
from fpputil.learning.training import CHECKPOINT, CONFIG, WEIGHTS, fit, validate
from fpputil.learning.weights import load_weights
from fpputil.networks.geometry import Geometry
from fpputil.networks.losses import Weights
from fpputil.networks.methods import SFNetMethod

pytestmark = pytest.mark.usefixtures("small_and_quick")
METHOD = SFNetMethod(base=2, levels=2)
CAMERA = Augmentation(gain=(0.8, 1.2), noise=(0.0, 1.0))
SHORT = TrainingConfig(
    epochs=2,
    batch=5,
    learning_rate=3e-3,
    validation_views=2,
    precision="float32",
    augmentation=CAMERA,
)  # three batches an epoch, of 16 images one waits
FILES = (CONFIG, CHECKPOINT, WEIGHTS, "log.csv", "curve.png")


def same(a, b):
    """Whether two networks, or two files of tensors, are equal bit by bit."""
    a, b = (load_file(x) if isinstance(x, os.PathLike) else x.state_dict() for x in (a, b))
    return a.keys() == b.keys() and all(torch.equal(a[k], b[k]) for k in a)


def without_times(history):
    return [{k: v for k, v in row.items() if "second" not in k} for row in history]


@pytest.fixture(scope="module")
def runs(small_set, tmp_path_factory):
    """Runs that nothing disturbed: of a schedule its settings, folder, network and history."""

    @functools.cache
    def run(schedule):
        torch.set_num_threads(1)
        settings = replace(SHORT, schedule=schedule)
        out = tmp_path_factory.mktemp(schedule) / "run"
        return settings, out, *fit(METHOD, small_set, settings, out)

    return run


@pytest.fixture(scope="module")
def whole(runs):
    return runs("plateau")


def test_a_network_learns(small_set):
    method = SFNetMethod(base=4, levels=3, dropout=0.0, weights=Weights(order=False, mean=True))
    trained, history = fit(method, small_set, replace(SHORT, epochs=5, batch=4, seed=2))
    assert [row["epoch"] for row in history] == [1, 2, 3, 4, 5]
    assert history[-1]["total"] < 0.65 * history[0]["total"]
    assert history[-1]["validation_mae"] < 0.85 * history[0]["validation_mae"]
    assert not trained.network.training


@pytest.mark.parametrize("schedule", ["plateau", "one-cycle"])
def test_equal_runs_are_equal_and_leave_the_generator_alone(runs, small_set, schedule):
    settings, _, trained, history = runs(schedule)
    torch.manual_seed(99)
    before = torch.get_rng_state()
    again, repeated = fit(METHOD, small_set, settings, workers=int(schedule == "plateau"))
    assert torch.equal(torch.get_rng_state(), before)
    assert same(trained.network, again.network)
    assert without_times(history) == without_times(repeated)
    other, _ = fit(METHOD, small_set, replace(settings, seed=1, training_views=5))
    assert not same(trained.network, other.network)


def test_another_epoch_is_another_order_and_another_camera(small_set, monkeypatch):
    losses, seen = SFNetMethod.losses, []

    def watched(self, outputs, batch, geometry):
        seen.append(dict(zip(batch["index"].tolist(), batch["frames"], strict=True)))
        return losses(self, outputs, batch, geometry)

    monkeypatch.setattr(SFNetMethod, "losses", watched)
    for workers in (0, 1):
        seen.clear()
        fit(
            METHOD,
            small_set,
            replace(SHORT, training_views=6, batch=3, validation_views=1),
            workers=workers,
        )
        orders = [list(a) + list(b) for a, b in (seen[:2], seen[2:])]
        assert sorted(orders[0]) == sorted(orders[1]) and orders[0] != orders[1]
        first, second = seen[0] | seen[1], seen[2] | seen[3]
        assert not any(torch.equal(first[k], second[k]) for k in first)


def test_what_a_run_leaves_behind(small_set, tmp_path, monkeypatch):
    """Five files, and no process for which the command would wait for ever."""
    monkeypatch.undo()  # draw
    out = tmp_path / "run"
    trained, history = fit(
        METHOD,
        small_set,
        replace(SHORT, training_views=3, validation_views=1, batch=3),
        out,
        workers=1,
    )
    assert not active_children()
    assert {f.name for f in out.iterdir()} == {*FILES}
    assert (out / "curve.png").read_bytes().startswith(b"\x89PNG")
    assert read_log(out / "log.csv") == history
    lines = (out / "log.csv").read_text().splitlines()
    assert len(lines) == 3 and lines[0].split(",") == list(history[0])
    last = load_file(out / CHECKPOINT)
    for name, tensor in trained.network.state_dict().items():
        assert torch.equal(tensor, last[f"network.{name}"])


def test_rows_of_the_log(whole, small_set):
    settings, _, trained, history = whole
    weights = METHOD.weights
    for k, row in enumerate(history, 1):
        assert row["epoch"] == k and row["images"] == 15 * k
        total = sum(getattr(weights, n) * row[n] for n in ("phase", "consistency", "geometric"))
        assert row["total"] == pytest.approx(total, rel=1e-5)
        assert row["images_a_second"] == pytest.approx(15 / row["seconds"], rel=1e-6)
    data = SynthFringe(small_set, "validation", METHOD.photographs, extremes=(0, 244))
    geometry = Geometry.of(data.store.system, data.pitches)
    batch = {k: torch.stack([data[n][k] for n in range(len(data))]) for k in data[0]}
    with torch.no_grad():
        Phi = METHOD.absolute_phase(trained.network(batch["frames"]), geometry)
    e = (Phi - batch["Phi"])[batch["mask"]].double().abs()
    assert history[-1]["validation_mae"] == pytest.approx(e.mean().item(), rel=1e-4)
    assert history[-1]["validation_rmse"] == pytest.approx(
        e.square().mean().sqrt().item(), rel=1e-4
    )
    wrong = (e > math.pi).double().mean().item()
    assert history[-1]["validation_order_errors"] == pytest.approx(wrong, rel=1e-4)


class Echo(nn.Module):
    """A network that answers with its first photograph."""

    def __init__(self):
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(1))

    def forward(self, frames):
        return frames[:, 0]


@pytest.mark.parametrize("last, wrong", [(math.pi - 1e-3, 2), (math.pi + 1e-3, 3), (math.nan, 3)])
def test_wrong_orders_are_counted_over_all_views(last, wrong):
    """More than pi off, to either side, or no phase; pixels outside the mask do not count."""
    off = torch.tensor([[[0.5, -1.0, 4.0]], [[-7.0, last, 99.0]]])
    mask = torch.tensor([[[True] * 3], [[True, True, False]]])
    batch = {"frames": 10 + off[:, None], "Phi": torch.full_like(off, 10), "mask": mask}
    loader = [{k: v[n : n + 1] for k, v in batch.items()} for n in range(2)]
    method = SimpleNamespace(
        inputs=lambda frames, geometry: frames, absolute_phase=lambda outputs, geometry: outputs
    )
    with processes("cpu") as group:
        row = validate(method, Echo(), loader, None, "float32", group)
    assert row["validation_order_errors"] == wrong / 5
    expected = (12.5 + last) / 5, math.sqrt((66.25 + last**2) / 5)
    measured = row["validation_mae"], row["validation_rmse"]
    assert measured == pytest.approx(expected, rel=1e-6, nan_ok=True)


def test_weights_say_what_they_were_trained_with(whole, small_set):
    settings, out, _, history = whole
    saved = load_weights(out / WEIGHTS)
    best = min(history, key=lambda row: row["validation_mae"])["epoch"]
    data = SynthFringe(small_set, "training")
    assert saved.method == METHOD
    assert saved.metadata["pitches"] == data.pitches._asdict() and saved.metadata["camera"] == [
        120,
        160,
    ]
    assert saved.metadata["extremes"] == list(data.extremes)
    assert saved.metadata["data"] == data.store.name
    training = saved.metadata["training"]
    assert (
        training["settings"]["learning_rate"] == settings.learning_rate
        and training["precision"] == "float32"
    )
    assert training["epochs"] == best and training["images"] == 15 * best
    assert training["validation_mae"] == history[best - 1]["validation_mae"]
    assert training["hardware"]["threads"] == 1 and training["hardware"]["processes"] == 1


@pytest.mark.parametrize(
    "schedule, stops, workers",
    [
        ("plateau", [1], 0),
        ("one-cycle", [6], 0),
        pytest.param("plateau", [5], 1, marks=pytest.mark.slow),
        ("plateau", [4, 2], 0),
    ],
)
def test_a_stopped_run_goes_on_as_if_it_had_not(
    runs, interrupt, small_set, tmp_path, monkeypatch, schedule, stops, workers
):
    """Stopped once or more often, in the first epoch or in the second: the same bytes."""
    settings, out, trained, history = runs(schedule)
    for k, at in enumerate(stops):
        with monkeypatch.context() as patched:
            interrupt(patched, at)
            with pytest.raises(KeyboardInterrupt):
                fit(METHOD, small_set, settings, tmp_path, resume=k > 0, workers=workers)
        assert not active_children()
    assert (tmp_path / CHECKPOINT).exists() == (stops[0] > 3)  # of finished epochs alone
    torch.manual_seed(99)
    again, repeated = fit(METHOD, small_set, settings, tmp_path, resume=True)
    assert same(again.network, trained.network)
    assert same(tmp_path / CHECKPOINT, out / CHECKPOINT)
    assert (tmp_path / WEIGHTS).read_bytes() == (out / WEIGHTS).read_bytes()
    assert without_times(repeated) == without_times(history)
    assert without_times(read_log(tmp_path / "log.csv")) == without_times(history)


def test_a_finished_run_is_resumed_to_what_it_was(whole, small_set):
    """What is derived from the checkpoint is made anew where it is missing."""
    settings, out, trained, history = whole
    before = {name: (out / name).read_bytes() for name in FILES if name != "curve.png"}
    best = min(history, key=lambda row: row["validation_mae"])["epoch"]
    for name in ("log.csv", "curve.png", *([WEIGHTS] if best == len(history) else [])):
        (out / name).unlink()
    again, repeated = fit(METHOD, small_set, settings, out, resume=True)
    assert repeated == history and same(again.network, trained.network)
    assert {name: (out / name).read_bytes() for name in before} == before
    assert (out / "curve.png").exists()


OPTIONS = (
    *("--epochs", "3", "--batch", "4", "--base", "2", "--levels", "2", "--validation-views", "2"),
    *("--precision", "float32", "--threads", "1", "--workers", "0"),
)


@pytest.fixture(scope="module")
def commanded(small_set, tmp_path_factory):
    """Three epochs by the command, undisturbed."""
    out = tmp_path_factory.mktemp("commanded") / "run"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Figure, "savefig", lambda self, file, **_: file.write(b"no picture"))
        assert main(["train", "sfnet", "--data", str(small_set), "--out", str(out), *OPTIONS]) == 0
    return out


@contextlib.contextmanager
def started(call, **options):
    """A process of its own group, of which nothing is left behind."""
    process = subprocess.Popen(
        [sys.executable, "-m", *call],
        stderr=subprocess.PIPE, text=True, start_new_session=True, **options,
    )  # fmt: skip
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("number, to_all", [(signal.SIGKILL, False), (signal.SIGTERM, True)])
def test_a_command_that_was_killed_goes_on(commanded, small_set, tmp_path, number, to_all):
    """kill -9 of the command, and SIGTERM to all its processes, as clusters and systemd send it."""
    out = tmp_path / "run"
    call = ["train", "sfnet", "--data", str(small_set), "--out", str(out), *OPTIONS]
    with started(["fpputil.cli", *call, "--workers", "1"]) as process:
        end = time.monotonic() + 100
        while not (out / "log.csv").is_file():  # the last thing of an epoch
            assert process.poll() is None and time.monotonic() < end, process.stderr.read()
            time.sleep(0.01)
        (os.killpg if to_all else os.kill)(process.pid, number)
        said = process.communicate(timeout=90)[1]
    assert process.returncode == (130 if number == signal.SIGTERM else -9), said
    if number == signal.SIGTERM:
        assert "stopped; the same command with --resume goes on from here" in said
        assert "Traceback" not in said
    assert len(read_state(out / CHECKPOINT)["history"]) in (1, 2)
    assert main([*call, "--resume"]) == 0
    assert same(out / CHECKPOINT, commanded / CHECKPOINT)
    assert (out / WEIGHTS).read_bytes() == (commanded / WEIGHTS).read_bytes()


@pytest.mark.parametrize("at, epoch, batch", [(1, 1, 1), (5, 2, 2)])
def test_a_loss_that_is_not_finite_ends_the_run(small_set, tmp_path, monkeypatch, at, epoch, batch):
    losses, count = SFNetMethod.losses, iter(range(1, 99))

    def spoilt(self, *given):
        values = losses(self, *given)
        return values | {"total": values["total"] * (math.nan if next(count) == at else 1)}

    monkeypatch.setattr(SFNetMethod, "losses", spoilt)
    with pytest.raises(FloatingPointError, match=f"nan in epoch {epoch}, batch {batch}; a lower"):
        fit(METHOD, small_set, SHORT, tmp_path)
    assert (tmp_path / CHECKPOINT).exists() == (epoch > 1)


def test_bfloat16_trains_as_well(small_set):
    settings = replace(SHORT, epochs=1, training_views=8, batch=4, precision="bfloat16")
    trained, (row,) = fit(METHOD, small_set, settings)
    _, (exact,) = fit(METHOD, small_set, replace(settings, precision="float32"))
    assert row["total"] == pytest.approx(exact["total"], rel=0.1) and row["total"] != exact["total"]
    assert {p.dtype for p in trained.network.parameters()} == {torch.float32}


def test_a_run_begins_with_a_network_that_is_given(whole, small_set, tmp_path):
    settings, out, trained, _ = whole
    first = replace(settings, epochs=1, learning_rate=1e-12, weight_decay=0.0)
    begun, _ = fit(METHOD, small_set, first, tmp_path, start=trained)
    for name, tensor in begun.network.state_dict().items():
        torch.testing.assert_close(tensor, trained.network.state_dict()[name], rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="has start .* None is asked for"):
        fit(METHOD, small_set, first, tmp_path, resume=True)
    with pytest.raises(ValueError, match="to begin with given"):
        fit(replace(METHOD, base=3), small_set, first, start=trained)
    other = replace(METHOD, weights=Weights(order=False), reference="mid")
    fit(other, small_set, replace(first, training_views=5), start=trained)


def test_a_part_of_the_views(small_set):
    data = SynthFringe(small_set, "training")
    for views, images in ((7, 6), (99, len(data) // 3 * 3)):
        settings = replace(SHORT, epochs=1, training_views=views, batch=3)
        _, (row,) = fit(METHOD, small_set, settings)
        assert row["images"] == images
