"""Training a method on a dataset, from first weights or from where it was stopped (chapter 8)."""

from __future__ import annotations

from pathlib import Path

import torch

from fpputil.checks import whole
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.config import TrainingConfig
from fpputil.learning.devices import precision_of, processes
from fpputil.learning.loaders import (
    Batches,
    closing,
    spread,
    training_loader,
    validation_loader,
)
from fpputil.learning.run import begin, claim, describe
from fpputil.learning.trainer import Trainer
from fpputil.learning.weights import Trained
from fpputil.networks.geometry import Geometry
from fpputil.networks.methods import Method


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
    progress: bool = False,
) -> tuple[Trained, list[dict]]:
    """Train a network. Chapter 8.

    Parameters
    ----------
    method : Method
    path : path
        A finished dataset.
    settings : Settings
    out : path, optional
        Folder for checkpoint.safetensors (after every epoch and when stopped), weights.safetensors
        (16 bit, of the epoch with the least validation MAE), log.csv and curve.png.
    resume : bool
        Go on with the run in `out`; float32 weights end as if it had never stopped, on the same
        kind of device with as many threads.
    start : Trained, optional
        A network of the same method to begin with, instead of random weights.
    workers : int
        Processes that load data beside this one.
    device : str, optional
        As torch names it; by default CUDA where there is one, else the CPU. Started by
        ``torchrun``, the processes share each batch.
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
    KeyboardInterrupt
        After Ctrl-C or SIGTERM, when the checkpoint is written.
    """
    out, workers = None if out is None else Path(out), whole("workers", workers, 0)
    if resume and out is None:
        raise ValueError("resume without a folder given; a run is resumed from its folder")
    with processes(device) as where, torch.random.fork_rng():
        shots = method.photographs
        data = SynthFringe(path, "training", shots, settings.augmentation, settings.seed)
        if settings.training_views:
            data.indices = data.indices[spread(data, settings.training_views)]
        checked = SynthFringe(path, "validation", shots, extremes=data.extremes)
        precision = precision_of(settings.precision, where.device)
        about = describe(method, settings, data, precision, start, where.size)
        batches = Batches(len(data), settings.batch, settings.seed, where.rank, where.size)
        if out is not None and where.rank == 0:
            claim(out, about, resume)
        run = begin(method, settings, len(batches), where, start)
        if resume:
            run.go_on(out)
        geometry = Geometry.of(data.store.system, data.pitches, data.extremes).to(where.device)
        trainer = Trainer(
            method, settings, geometry, where, precision, run, out, about, data, batches, progress
        )
        share = (min(workers, 1), where.rank, where.size)
        loaders = (
            training_loader(data, batches, workers),
            validation_loader(
                checked, spread(checked, settings.validation_views), settings.batch, *share
            ),
        )
        with closing(*loaders):
            trainer.train(*loaders)
        return trainer.trained(), run.history
