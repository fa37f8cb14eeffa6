"""Training a method on a dataset: one loop over epochs, on one device or several (chapter 8)."""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim.lr_scheduler import OneCycleLR, ReduceLROnPlateau
from torch.utils.data import DataLoader, Subset
from tqdm.std import tqdm

from fpputil.checks import anything, read_json
from fpputil.dataset.synthesis import ViewMaps, synthesise
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.files import write_whole
from fpputil.learning.checkpoint import restore, save_checkpoint
from fpputil.learning.config import TrainingConfig
from fpputil.learning.devices import Processes, forward, hardware, precision_of, processes
from fpputil.learning.loaders import Batches, closing, loader_options, spread
from fpputil.learning.log import write_log
from fpputil.learning.weights import Trained, checksum, plain, save_weights
from fpputil.networks.geometry import Geometry
from fpputil.networks.methods import Method, settings_of

CONFIG, CHECKPOINT, WEIGHTS = "config.json", "checkpoint.safetensors", "weights.safetensors"


def fit(
    method: Method,
    path: str | Path,
    settings: TrainingConfig,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    start: Trained | None = None,
    workers: int = 0,
    device: str | None = None,
    on_device: bool = False,
    progress: bool = False,
) -> tuple[Trained, list[dict]]:
    """Train a network. Chapter 8.

    Parameters
    ----------
    method : Method
    path : path
        A finished dataset.
    settings : TrainingConfig
    out : path, optional
        Folder for config.json, checkpoint.safetensors (of the last epoch), weights.safetensors
        (16 bit, of the epoch with the least validation MAE), log.csv and curve.png.
    resume : bool
        Go on with the run in `out` after its last epoch: Ctrl-C, SIGTERM and power cuts lose the
        epoch under way. Float32 weights end as if it had never stopped, on the same kind of
        device with as many threads.
    start : Trained, optional
        A network of the same method to begin with, instead of random weights; losses, dropout
        and reference may differ.
    workers : int
        Processes that load data beside this one.
    device : str, optional
        As torch names it; by default CUDA where there is one, else the CPU. Started by
        ``torchrun``, the processes share each batch.
    on_device : bool
        Make photographs and targets where the network runs, not in the loader: faster where a GPU
        waits for a few processor cores. Another noise is drawn then.
    progress : bool
        Show a bar.

    Returns
    -------
    Trained, list of dict
        The network with the weights of the last epoch; one row an epoch.

    Raises
    ------
    ValueError
        If `out` holds a run and `resume` is not given, or the run there is another one.
    FloatingPointError
        If the loss is not finite.
    """
    out = None if out is None else Path(out)
    if resume and out is None:
        raise ValueError("resume without a folder given; a run is resumed from its folder")
    with processes(device) as group, torch.random.fork_rng():
        # What to learn from, and the views on which each epoch is measured.
        shots = method.photographs
        data = SynthFringe(path, "training", shots, settings.augmentation, settings.seed)
        if settings.training_views:
            data.indices = data.indices[spread(data, settings.training_views)]
        unseen = SynthFringe(path, "validation", shots, extremes=data.extremes)
        views = spread(unseen, settings.validation_views)
        batches = Batches(len(data), settings.batch, settings.seed, group.rank, group.size)
        read = ViewMaps if on_device else lambda data: data
        loader = DataLoader(read(data), batch_sampler=batches, **loader_options(workers))
        share = Subset(read(unseen), views[group.rank :: group.size])
        validation = DataLoader(share, settings.batch, **loader_options(min(workers, 1)))
        geometry = Geometry.of(data.store.system, data.pitches, data.extremes).to(group.device)
        precision = precision_of(settings.precision, group.device)

        # First weights, optimiser, schedule; then what a run that was stopped had come to.
        torch.manual_seed(settings.seed)
        network = method.network()
        if start is not None:
            check_start(start, method)
            network.load_state_dict(start.network.state_dict())
        network.to(group.device, memory_format=torch.channels_last)
        optimiser, schedule = optimiser_of(network, settings, len(batches))
        config = {
            "method": settings_of(method),
            "config": asdict(settings),
            "data": data.store.name,
            "precision": precision,
            "start": None if start is None else checksum(start.network),
            "processes": group.size,
        }
        if on_device:
            config["on_device"] = True

        def items(batch: dict) -> dict:
            batch = {k: v.to(group.device, non_blocking=True) for k, v in batch.items()}
            return synthesise(batch, data) if on_device else batch

        history, writes = [], out is not None and group.rank == 0

        def as_trained() -> Trained:
            return trained_of(method, network, geometry, config, history, group)

        if writes:
            claim_folder(out, config, resume)
        if resume and (out / CHECKPOINT).is_file():
            state = restore(out / CHECKPOINT, network, optimiser)
            schedule.load_state_dict(state["schedule"])
            history = state["history"]
            if writes:  # the process may have ended before it could
                write_derived(out, as_trained(), history)
        model = DistributedDataParallel(network) if group.size > 1 else network

        images = len(batches) * min(settings.batch, len(data))  # of an epoch
        options = {"disable": not (progress and group.rank == 0), "smoothing": 0.05}
        options |= {"initial": len(history) * images, "unit": "image"}
        bar = tqdm(total=settings.epochs * images, **options)
        with bar, closing(loader, validation):
            for epoch in range(len(history), settings.epochs):
                if 0 < settings.early_stopping <= epochs_since_best(history):
                    break
                # Train: every batch of an order that seed and epoch decide.
                data.set_epoch(epoch)
                batches.epoch = epoch
                network.train()
                sums, began = Counter(), time.perf_counter()
                for step, batch in enumerate(map(items, loader)):
                    # seed, epoch, batch and process alone decide what dropout drops
                    key = (settings.seed, epoch, step, group.rank)
                    torch.manual_seed(int(np.random.SeedSequence(key).generate_state(1)[0]))
                    outputs = forward(model, method.inputs(batch["frames"], geometry), precision)
                    losses = method.losses(outputs, batch, geometry)
                    losses = {k: v.mean() for k, v in losses.items()}
                    where = f"epoch {epoch + 1}, batch {step + 1}"
                    _require_finite("the loss is", losses["total"].item(), f"in {where}")
                    optimiser.zero_grad(set_to_none=True)
                    losses["total"].backward()
                    nn.utils.clip_grad_norm_(network.parameters(), settings.max_grad_norm)
                    optimiser.step()
                    if isinstance(schedule, OneCycleLR):
                        schedule.step()
                    sums.update({k: v.item() for k, v in losses.items()})
                    bar.update(len(batch["index"]) * group.size)
                seconds = time.perf_counter() - began

                # Validate.
                errors = validate(
                    method, network, map(items, validation), geometry, precision, group
                )
                mae = errors["validation_mae"]
                _require_finite("the network answers with", mae, f"after epoch {epoch + 1}")
                names = sorted(sums)
                totals = group.total(*(sums[k] for k in names))
                means = [total / group.size / len(batches) for total in totals]
                row = {
                    "epoch": epoch + 1,
                    "images": images * (epoch + 1),
                    "learning_rate": optimiser.param_groups[0]["lr"],
                    **dict(zip(names, means, strict=True)),
                    **errors,
                    "seconds": seconds,
                    "images_a_second": images / seconds,
                }
                history.append(row)
                if isinstance(schedule, ReduceLROnPlateau):
                    schedule.step(mae)
                bar.set_postfix({"loss": f"{row['total']:.3f}", "validation MAE": f"{mae:.3f}"})

                # Checkpoint, keep the best, log.
                if writes:
                    state = {"schedule": plain(schedule.state_dict()), "history": history}
                    save_checkpoint(out / CHECKPOINT, network, optimiser, state)
                    write_derived(out, as_trained(), history)
        return as_trained(), history


@torch.no_grad()
def validate(method, network, batches, geometry, precision: str, group: Processes) -> dict:
    """Errors of the absolute phase over all pixels of the validation views."""
    network.eval()
    number = total = square = wrong = 0.0
    for batch in batches:
        outputs = forward(network, method.inputs(batch["frames"], geometry), precision)
        Phi = method.absolute_phase(outputs, geometry)
        e = (Phi - batch["Phi"])[batch["mask"]].abs().double()
        number += len(e)
        total, square = total + e.sum().item(), square + (e**2).sum().item()
        wrong += (~(e <= math.pi)).sum().item()  # no phase is no right order
    number, total, square, wrong = group.total(number, total, square, wrong)
    if not number:
        raise ValueError("the validation views have empty masks; nothing to measure on")
    return {
        "validation_mae": total / number,
        "validation_rmse": math.sqrt(square / number),
        "validation_order_errors": wrong / number,
    }


def optimiser_of(network: nn.Module, settings: TrainingConfig, steps: int):
    """AdamW and its schedule, of so many steps an epoch."""
    rate = settings.learning_rate
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=settings.weight_decay)
    if settings.schedule == "one-cycle":
        total = settings.epochs * steps
        cycle = OneCycleLR(optimiser, rate, total, pct_start=0.15, cycle_momentum=False)
        return optimiser, cycle
    # torch counts the epochs it lets pass, not the one after which it acts
    patience = settings.plateau_patience - 1
    return optimiser, ReduceLROnPlateau(optimiser, factor=0.5, patience=patience, threshold=0.0)


def write_derived(out: Path, trained: Trained, history: list[dict]) -> None:
    """Write what follows from a checkpoint: the weights if they are the best so far, the log."""
    if epochs_since_best(history) == 0:
        save_weights(out / WEIGHTS, trained)
    write_log(out, history)


def epochs_since_best(history: list[dict]) -> int:
    """Epochs since the one with the least validation MAE."""
    maes = [row["validation_mae"] for row in history]
    return len(maes) - 1 - int(np.argmin(maes)) if maes else 0


def trained_of(method, network, geometry, config: dict, history, group: Processes) -> Trained:
    """The network as it is now, with what one needs to use it."""
    camera, last = geometry.system.camera, history[-1]
    metadata = {
        "pitches": geometry.pitches._asdict(),
        "camera": [camera.height, camera.width],
        "extremes": list(geometry.extremes),
        "data": config["data"],
        "training": {
            "settings": config["config"],
            "precision": config["precision"],
            "start": config["start"],
            "epochs": len(history),
            "images": last["images"],
            "validation_mae": last["validation_mae"],
            "hardware": hardware(group.device) | {"processes": group.size},
        },
    }
    return Trained(method, network.eval(), metadata)


def claim_folder(out: Path, config: dict, resume: bool) -> None:
    """Make `out` the folder of the run that its config.json describes, unless it is another's."""
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out} is a file; a run needs a folder")
    if resume and not out.is_dir():
        raise FileNotFoundError(f"{out} is not there; no run to resume")
    left = [name for name in (CHECKPOINT, WEIGHTS, "log.csv") if (out / name).exists()]
    if left and not (out / CONFIG).is_file():
        raise ValueError(
            f"{out} holds {left[0]} of a run without its config.json; name another folder"
        )
    if left and not resume:
        raise ValueError(f"{out} holds a run already; resume it, or name another folder")
    if not (resume and (out / CONFIG).is_file()):
        out.mkdir(parents=True, exist_ok=True)
        write_whole(out / CONFIG, f"{json.dumps(config, indent=1)}\n".encode())
        return
    begun = read_json(out / CONFIG, {...: anything}, "config of a run")
    for name, before, now in _differences(begun, plain(config)):
        raise ValueError(
            f"the run in {out} has {name} {before}, and {now} is asked for; a run is resumed with "
            "the settings and data it began with"
        )


def check_start(start: Trained, method: Method) -> None:
    """ValueError if the network to begin with has another architecture."""
    aside = {"weights": None, "dropout": None, "reference": None}
    pair = (settings_of(m) | aside for m in (start.method, method))
    for name, before, now in _differences(*pair):
        raise ValueError(
            f"a network with {name} {before} to begin with given, and one with {now} is to be "
            "trained; only losses, dropout and reference may differ"
        )


def _differences(before: dict, now: dict, prefix: str = "") -> Iterator[tuple]:
    """Dotted name and both values of each entry in which two nested dicts differ."""
    for key in before | now:
        a, b = before.get(key), now.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differences(a, b, f"{prefix}{key}.")
        elif a != b:
            yield f"{prefix}{key}", a, b


def _require_finite(what: str, value: float, where: str) -> None:
    if not math.isfinite(value):
        raise FloatingPointError(
            f"{what} {value} {where}; a lower learning rate may help, in a run of its own"
        )
