"""`fpp train`: train a network on a dataset, or go on with a run that was stopped (chapter 8)."""

import os
from dataclasses import fields, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from fpputil import dataset, experiments, learning, networks
from fpputil.cli.options import TRAINING, Data, Preset, TrainingOptions, given, option


def _options(group: str, **options: tuple[type, str]) -> type:
    """A dataclass of options by name: type and help; None where one is not given."""
    rows = [
        (name, Annotated[kind | None, option(text, negative=None if kind is bool else ())], None)
        for name, (kind, text) in options.items()
    ]
    made = make_dataclass("Options", rows, frozen=True, namespace={"__module__": __name__})
    return Parameter(name="*", group=group)(made)


Settings = _options(
    "Settings (default: as the preset has them)",  # those of `TrainingConfig`
    epochs=(int, "At most."),
    batch=(int, "Images a step, over all devices (paper: 8)."),
    learning_rate=(float, "Or the highest of one cycle."),
    schedule=(str, "plateau (as the paper) or one-cycle (ours)."),
    plateau_patience=(int, "Epochs without a better one before plateau halves."),
    weight_decay=(float, "Of AdamW."),
    max_grad_norm=(float, "Greatest norm of the gradient."),
    early_stopping=(int, "Epochs without a better one; 0 for never."),
    training_views=(int, "Training views to use; 0 for all."),
    validation_views=(int, "Validation views to measure on."),
    seed=(int, "Of weights, order, augmentation, dropout."),
    precision=(str, "float32, bfloat16 or auto."),
)
Camera = _options(
    "Camera: lowest and highest, drawn for every photograph",  # of `Augmentation`
    gain=(tuple[float, float], "Exposure."),
    noise=(tuple[float, float], "Read noise in grey levels."),
    gamma=(tuple[float, float], "Response."),
)
Network = _options(
    "Network",  # of all methods
    frames=(int, "Photographs of each pitch: 1, 2 or 3."),
    base=(int, "Channels of the finest level."),
    levels=(int, "Pairs of convolutions in an encoder."),
    dropout=(float, "Share dropped where features are joined."),
    mixing=(str, "none, deepest or 'every level'."),
    target=(str, "components (M and D) or phase."),
    reference=(str, "refined (reference), or zmin, mid or unit in its place."),
    plane=(bool, "Show SIDO the empty plane, too."),
    normalised=(bool, "Group normalisation after each convolution (ours)."),
    coordinates=(bool, "Show each encoder column and row, too (ours)."),
    errors=(str, "Of SIDO and PSNet: in grey levels (grey) or in fringes (fringe, ours)."),
    phase_weight=(float, "Weight of SIDO's coarse phase."),
    unit_step=(int, "Step of PSNet's unit pitch, with errors in fringes."),
)
Losses = _options(
    "Losses",  # of `Weights`
    phase=(float, "Weight of the phase loss."),
    consistency=(float, "Weight of the consistency loss."),
    geometric=(float, "Weight of the geometric loss."),
    modulo=(bool, "Compare absolute phases modulo 2 pi in Eq. 12 (ours)."),
    mean=(bool, "Average Eq. 14 over the pixels, not add up (ours)."),
    l1=(bool, "Absolute errors, not squares, in Eq. 12 (ours)."),
)
SETTINGS, CAMERA, NETWORK, LOSSES = Settings(), Camera(), Network(), Losses()


def train(
    method: Annotated[Literal["sfnet", "sido", "psnet", "dlalnet"], option("Which network.")],
    /,
    *,
    data: Data,
    out: Annotated[Path, option("Folder of the run.")],
    preset: Preset = "tiny",
    resume: Annotated[bool, option("Go on with the run in OUT.")] = False,
    start: Annotated[Path | None, option("Begin with this network, not a random one.")] = None,
    on_device: Annotated[bool, option("Make the photographs where the network runs.")] = False,
    how: TrainingOptions = TRAINING,
    settings: Settings = SETTINGS,
    camera: Camera = CAMERA,
    network: Network = NETWORK,
    losses: Losses = LOSSES,
) -> None:
    """Train a network.

    Leaves in OUT checkpoint.safetensors (every epoch and when stopped), weights.safetensors
    (16 bit, of the best epoch), log.csv and curve.png. What is not given is as the preset has it.
    Several devices: torchrun --nproc-per-node N -m fpputil.cli train ...
    """
    plain, config = experiments.recipe(preset, method)
    augmentation = replace(config.augmentation, **given(camera))
    config = replace(config, **given(settings), augmentation=augmentation)
    chosen = _changed(plain, method, given(network), given(losses))
    if (made := dataset.open_store(data).manifest["settings"]["preset"]) not in (
        preset,
        "imported",
    ):
        name = f"{preset} is given; name the preset of the dataset"
        raise ValueError(f"{data} was made with the preset {made}, and {name}")
    processes = how.begin() | {"start": start and learning.load_weights(start)}
    processes["on_device"] = on_device
    _, history = learning.fit(chosen, data, config, out, resume=resume, **processes)
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
    known = {f.name for f in fields(method)}
    of_losses = ["weights of losses"] if losses and "weights" not in known else []
    if wrong := [key for key in (*network, *of_losses) if key not in known]:
        settings = ", ".join(sorted(known))
        raise ValueError(f"{wrong[0]} given for {name}; its settings are {settings}")
    if "modulo" in losses:
        losses["order"] = not losses.pop("modulo")
    if losses:
        network["weights"] = replace(method.weights or networks.Weights(), **losses)
    return replace(method, **network)
