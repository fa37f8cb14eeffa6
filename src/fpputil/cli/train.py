"""`fpp train`: train a network on a dataset, or go on with a run that was stopped (chapter 8)."""

from __future__ import annotations

import argparse
import os
from dataclasses import fields, replace
from pathlib import Path

METHODS = ("sfnet", "sido", "psnet", "dlalnet")
OF_METHOD = ("frames", "base", "levels", "dropout", "mixing", "target", "reference", "plane")
OF_SETTINGS = (
    *("epochs", "batch", "learning_rate", "schedule", "plateau_patience", "weight_decay"),
    *("max_grad_norm", "early_stopping", "training_views", "validation_views", "seed", "precision"),
)
OF_CAMERA = {"gain": "exposure", "noise": "read noise in grey levels", "gamma": "response"}


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    train = commands.add_parser(
        "train",
        help="train a network",
        description="Leaves in OUT checkpoint.safetensors (every epoch and when stopped), "
        "weights.safetensors (16 bit, of the best epoch), log.csv and curve.png. What is not "
        "given is as the preset has it. Several devices: "
        "torchrun --nproc-per-node N -m fpputil.cli train ...",
    )
    train.add_argument("method", choices=METHODS, help="which network")
    train.add_argument("--data", type=Path, required=True, metavar="PATH", help="the dataset")
    train.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the run")
    train.add_argument("--preset", default="tiny", help="tiny, small or paper (default tiny)")
    train.add_argument("--resume", action="store_true", help="go on with the run in OUT")
    train.add_argument("--start", type=Path, metavar="WEIGHTS",
                       help="begin with this network, not with random weights")  # fmt: skip
    train.add_argument("--workers", type=int, default=1, help="processes that load (default 1)")
    train.add_argument("--device", help="cpu, cuda, cuda:1 ... (default: a GPU if there is one)")
    train.add_argument("--threads", type=int, help="of the processor (default: all)")
    _settings(train.add_argument_group("training"))
    _network(train.add_argument_group("network and losses"))
    train.set_defaults(run=_train, go_on="the same command with --resume goes on from here")


def _settings(group) -> None:
    group.add_argument("--epochs", type=int, help="at most")
    group.add_argument("--batch", type=int, help="images a step, over all devices (paper: 8)")
    group.add_argument(
        "--learning-rate", type=float, help="learning rate, or the highest of one cycle"
    )
    group.add_argument("--schedule", help="plateau (as the paper) or one-cycle (ours)")
    group.add_argument(
        "--plateau-patience", type=int, help="epochs without a better one before plateau halves"
    )
    group.add_argument("--weight-decay", type=float, help="weight decay of AdamW")
    group.add_argument("--max-grad-norm", type=float, help="greatest norm of the gradient")
    group.add_argument(
        "--early-stopping", type=int, help="epochs without a better one; 0 for never"
    )
    group.add_argument("--training-views", type=int, help="training views to use; 0 for all")
    group.add_argument("--validation-views", type=int, help="validation views to measure on")
    group.add_argument("--seed", type=int, help="of weights, order, augmentation, dropout")
    group.add_argument("--precision", help="float32, bfloat16 or auto")
    for name, what in OF_CAMERA.items():
        group.add_argument(f"--{name}", type=float, nargs=2, metavar=("LOW", "HIGH"),
                           help=f"{what}, drawn for every photograph")  # fmt: skip


def _network(group) -> None:
    group.add_argument("--frames", type=int, help="photographs of each pitch: 1, 2 or 3")
    group.add_argument("--base", type=int, help="channels of the finest level")
    group.add_argument("--levels", type=int, help="pairs of convolutions in an encoder")
    group.add_argument("--dropout", type=float, help="share dropped where features are joined")
    group.add_argument("--mixing", help="none, deepest or 'every level'")
    group.add_argument("--target", help="components (M and D) or phase")
    group.add_argument("--reference", help="refined (reference), or zmin, mid or unit in its place")
    for name in ("phase", "consistency", "geometric"):
        group.add_argument(f"--{name}", type=float, metavar="W", help=f"weight of the {name} loss")
    yes_or_no = argparse.BooleanOptionalAction
    group.add_argument("--plane", action=yes_or_no, help="show SIDO the empty plane, too")
    group.add_argument("--modulo", action=yes_or_no,
                       help="compare absolute phases modulo 2 pi in Eq. 12 (ours)")  # fmt: skip
    group.add_argument("--mean", action=yes_or_no,
                       help="average Eq. 14 over the pixels, not add up (ours)")  # fmt: skip
    group.add_argument("--l1", action=yes_or_no,
                       help="absolute errors, not squares, in Eq. 12 (ours)")  # fmt: skip


def _train(options) -> None:
    from fpputil.dataset.store import open_store
    from fpputil.experiments.registry import recipe
    from fpputil.learning.devices import use_threads
    from fpputil.learning.training import fit
    from fpputil.learning.weights import load_weights

    method, settings = recipe(options.preset, options.method)
    settings = replace(settings, **_given(options, OF_SETTINGS))
    camera = {k: tuple(v) for k, v in _given(options, OF_CAMERA).items()}
    settings = replace(settings, augmentation=replace(settings.augmentation, **camera))
    method = _changed(method, options)
    manifest = open_store(options.data).manifest
    made = manifest["settings"]["preset"]
    if made not in (options.preset, "imported"):
        raise ValueError(
            f"{options.data} was made with the preset {made}, and {options.preset} is given; name "
            "the preset of the dataset"
        )
    use_threads(options.threads)
    start = None if options.start is None else load_weights(options.start)
    _, history = fit(
        method, options.data, settings, options.out, resume=options.resume, start=start,
        workers=options.workers, device=options.device, progress=True,
    )  # fmt: skip
    if int(os.environ.get("RANK", 0)):  # the first of several processes speaks for all
        return
    best = min(history, key=lambda row: row["validation_mae"])
    print(
        f"{len(history)} epochs, {sum(row['seconds'] for row in history):.0f} s; best validation "
        f"MAE {best['validation_mae']:.4f} rad, wrong orders {best['validation_order_errors']:.2%} "
        f"after epoch {best['epoch']}, in {options.out / 'weights.safetensors'}"
    )


def _changed(method, options):
    """The method with the options that were given for it."""
    from fpputil.networks.losses import Weights

    given = _given(options, OF_METHOD)
    weights = _given(options, ("phase", "consistency", "geometric", "mean", "l1"))
    weights |= {} if options.modulo is None else {"order": not options.modulo}
    known = {f.name for f in fields(method)}
    for name in (*given, *(["weights of losses"] if weights and "weights" not in known else [])):
        if name not in known:
            raise ValueError(
                f"{name} given for {options.method}; its settings are {', '.join(sorted(known))}"
            )
    if weights:
        given["weights"] = replace(method.weights or Weights(), **weights)
    return replace(method, **given)


def _given(options, names) -> dict:
    """The options that were given."""
    return {k: v for k in names if (v := getattr(options, k)) is not None}
