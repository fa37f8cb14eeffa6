"""`fpp train`: train a network on a dataset, or go on with a run that was stopped (chapter 8)."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil.cli.options import TRAINING, Training, given

YesNo = Annotated[bool | None, Parameter(negative=None)]
Range = tuple[float, float] | None


@Parameter(name="*", group="Settings (default: as the preset has them)")
@dataclass(frozen=True)
class Settings:
    """Options of `TrainingConfig`.

    Parameters
    ----------
    epochs
        At most.
    batch
        Images a step, over all devices (paper: 8).
    learning_rate
        Or the highest of one cycle.
    schedule
        plateau (as the paper) or one-cycle (ours).
    plateau_patience
        Epochs without a better one before plateau halves.
    weight_decay
        Of AdamW.
    max_grad_norm
        Greatest norm of the gradient.
    early_stopping
        Epochs without a better one; 0 for never.
    training_views
        Training views to use; 0 for all.
    validation_views
        Validation views to measure on.
    seed
        Of weights, order, augmentation, dropout.
    precision
        float32, bfloat16 or auto.
    """

    epochs: int | None = None
    batch: int | None = None
    learning_rate: float | None = None
    schedule: str | None = None
    plateau_patience: int | None = None
    weight_decay: float | None = None
    max_grad_norm: float | None = None
    early_stopping: int | None = None
    training_views: int | None = None
    validation_views: int | None = None
    seed: int | None = None
    precision: str | None = None


@Parameter(name="*", group="Camera: lowest and highest, drawn for every photograph")
@dataclass(frozen=True)
class Camera:
    """Options of `Augmentation`.

    Parameters
    ----------
    gain
        Exposure.
    noise
        Read noise in grey levels.
    gamma
        Response.
    """

    gain: Range = None
    noise: Range = None
    gamma: Range = None


@Parameter(name="*", group="Network")
@dataclass(frozen=True)
class Network:
    """Options of the methods.

    Parameters
    ----------
    frames
        Photographs of each pitch: 1, 2 or 3.
    base
        Channels of the finest level.
    levels
        Pairs of convolutions in an encoder.
    dropout
        Share dropped where features are joined.
    mixing
        none, deepest or 'every level'.
    target
        components (M and D) or phase.
    reference
        refined (reference), or zmin, mid or unit in its place.
    plane
        Show SIDO the empty plane, too.
    """

    frames: int | None = None
    base: int | None = None
    levels: int | None = None
    dropout: float | None = None
    mixing: str | None = None
    target: str | None = None
    reference: str | None = None
    plane: YesNo = None


@Parameter(name="*", group="Losses")
@dataclass(frozen=True)
class Losses:
    """Options of `Weights`.

    Parameters
    ----------
    phase
        Weight of the phase loss.
    consistency
        Weight of the consistency loss.
    geometric
        Weight of the geometric loss.
    modulo
        Compare absolute phases modulo 2 pi in Eq. 12 (ours).
    mean
        Average Eq. 14 over the pixels, not add up (ours).
    l1
        Absolute errors, not squares, in Eq. 12 (ours).
    """

    phase: float | None = None
    consistency: float | None = None
    geometric: float | None = None
    modulo: YesNo = None
    mean: YesNo = None
    l1: YesNo = None


SETTINGS, CAMERA, NETWORK, LOSSES = Settings(), Camera(), Network(), Losses()


def train(
    method: Literal["sfnet", "sido", "psnet", "dlalnet"],
    /,
    *,
    data: Path,
    out: Path,
    preset: str = "tiny",
    resume: bool = False,
    start: Path | None = None,
    how: Training = TRAINING,
    settings: Settings = SETTINGS,
    camera: Camera = CAMERA,
    network: Network = NETWORK,
    losses: Losses = LOSSES,
) -> None:
    """Train a network.

    Leaves in OUT checkpoint.safetensors (every epoch and when stopped), weights.safetensors
    (16 bit, of the best epoch), log.csv and curve.png. What is not given is as the preset has it.
    Several devices: torchrun --nproc-per-node N -m fpputil.cli train ...

    Parameters
    ----------
    method
        Which network.
    data
        The dataset.
    out
        Folder of the run.
    preset
        tiny, small or paper.
    resume
        Go on with the run in OUT.
    start
        Begin with this network, not with random weights.
    """
    from fpputil.dataset.store import open_store
    from fpputil.experiments.registry import recipe
    from fpputil.learning.training import fit
    from fpputil.learning.weights import load_weights

    plain, config = recipe(preset, method)
    augmentation = replace(config.augmentation, **given(camera))
    config = replace(config, **given(settings), augmentation=augmentation)
    chosen = _changed(plain, method, given(network), given(losses))
    made = open_store(data).manifest["settings"]["preset"]
    if made not in (preset, "imported"):
        raise ValueError(
            f"{data} was made with the preset {made}, and {preset} is given; name the preset of "
            "the dataset"
        )
    processes = how.begin()
    first = None if start is None else load_weights(start)
    _, history = fit(chosen, data, config, out, resume=resume, start=first, **processes)
    if int(os.environ.get("RANK", 0)):  # the first of several processes speaks for all
        return
    best = min(history, key=lambda row: row["validation_mae"])
    print(
        f"{len(history)} epochs, {sum(row['seconds'] for row in history):.0f} s; best validation "
        f"MAE {best['validation_mae']:.4f} rad, wrong orders {best['validation_order_errors']:.2%} "
        f"after epoch {best['epoch']}, in {out / 'weights.safetensors'}"
    )


def _changed(method, name: str, network: dict, losses: dict):
    """The method with the options that were given for it."""
    from fpputil.networks.losses import Weights

    known = {f.name for f in fields(method)}
    of_losses = ["weights of losses"] if losses and "weights" not in known else []
    for option in (*network, *of_losses):
        if option not in known:
            raise ValueError(
                f"{option} given for {name}; its settings are {', '.join(sorted(known))}"
            )
    if "modulo" in losses:
        losses["order"] = not losses.pop("modulo")
    if losses:
        network["weights"] = replace(method.weights or Weights(), **losses)
    return replace(method, **network)
