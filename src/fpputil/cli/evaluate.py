"""`fpp evaluate`: how far off a trained network is on a split of a dataset (chapter 8)."""

from pathlib import Path
from typing import Annotated

from fpputil import dataset, learning
from fpputil.cli.options import Data, Device, Precision, Weights, Workers, option

ROWS = (
    ("MAE", "mae_rad", "rad", 1),
    ("RMSE", "rmse_rad", "rad", 1),
    ("median", "median_rad", "rad", 1),
    ("MAE of wrapped phi_h", "mae_high", "rad", 1),
    ("MAE of wrapped phi_r", "mae_low", "rad", 1),
    ("wrong fringe orders", "order_errors", "%", 100),
    ("spikes", "spikes", "%", 100),
    ("spikes of the truth", "spikes_of_truth", "%", 100),
    ("MAE", "mae_mm", "mm", 1),
    ("RMSE", "rmse_mm", "mm", 1),
    ("median", "median_mm", "mm", 1),
    ("left out of the mm", "insensitive", "%", 100),
    ("of the rest without a depth", "no_depth", "%", 100),
)


def evaluate(
    weights: Weights,
    /,
    *,
    data: Data,
    split: Annotated[str, option("training, validation, test or held-out.")] = "test",
    views: Annotated[int | None, option("So many, evenly spread (default: all).")] = None,
    noise: Annotated[float, option("Read noise, grey levels.")] = 0.0,
    gain: Annotated[float, option("Exposure.")] = 1.0,
    gamma: Annotated[float, option("Camera response.")] = 1.0,
    texture: Annotated[float, option("Contrast of dark blotches.")] = 0.0,
    seed: Annotated[int, option("Of noise and intervals.")] = 0,
    workers: Workers = 1,
    device: Device = "cpu",
    precision: Precision = "float32",
    save: Annotated[Path | None, option("Write one view as points into this .ply file.")] = None,
    view: Annotated[int, option("Which, counted in the split.")] = 0,
    json: Annotated[bool, option("Keep the numbers in a .json file beside WEIGHTS.")] = False,
    uncertainty: Annotated[
        bool, option("Keep there, too, how large errors are where phases disagree.")
    ] = False,
) -> None:
    """Measure a trained network.

    Errors over a split with 95 % intervals (bootstrap over models): as the paper of the method
    decodes it; told the measuring range; and the control of one photograph, the same phi_h,
    without phi_r, with the minimum phase at the high pitch.
    Millimetres count only where a projector column moves by more than 0.1 pixel a mm.

    With --uncertainty the validation split tells how large errors are where the two phases
    disagree; it is kept for `fpp predict` and judged on this split: how many errors are as small
    as told, and how small those are that stay when the most doubtful are left out.
    """
    from fpputil.learning.devices import device_of, hardware, precision_of
    from fpputil.learning.evaluation import save_points
    from fpputil.learning.loaders import spread
    from fpputil.learning.uncertainty import Disagreements, calibrate_uncertainty, keep
    from fpputil.learning.weights import write_metrics

    if uncertainty and not json:
        raise ValueError("--uncertainty without --json given; it is kept in the file of --json")
    if json and (noise, gain, gamma, texture) != (0, 1, 1, 0):
        raise ValueError("--json with another camera given; it keeps the dataset's own alone")
    trained = learning.load_weights(weights)
    camera = {"gain": gain, "noise": noise, "gamma": gamma}
    augmentation = dataset.Augmentation(**{name: (value, value) for name, value in camera.items()})
    opened = learning.open_split(trained, data, split, augmentation, seed, texture)
    how = {"device": device, "precision": precision}
    if save:
        if not 0 <= view < len(opened):
            raise ValueError(f"view {view} given; the split has views 0 to {len(opened) - 1}")
        item, prediction = next(learning.predictions(trained, opened, views=[view], **how))
        number = save_points(save, item, prediction, opened)
        print(f"{number} points of view {int(item['index'])} in {save}")
    which = spread(opened, len(opened) if views is None else views)
    how |= {"workers": workers, "progress": True}
    pixels = Disagreements(trained)
    each = pixels.add if uncertainty else None
    scores = learning.evaluate(trained, opened, each, views=which, **how)
    summaries = [score.summary(seed) for score in scores]
    print(f"{split}: {len(which)} views of {len(scores[0].models)} models")
    print(f"{'':32}{'as its paper decodes':>34}{'range given':>34}{'phi_h alone':>34}")
    for name, key, unit, scale in ROWS:
        cells = (_cell(measures.get(key), scale) for measures in summaries)
        print(f"{name + ', ' + unit:32}{''.join(f'{cell:>34}' for cell in cells)}")
    if json:
        where = device_of(device)
        numbers = {"data": opened.store.name, "views": len(which), "camera": camera, "seed": seed}
        numbers |= {"precision": precision_of(precision, where), "hardware": hardware(where)}
        names = ("two photographs", "range given", "one photograph")
        numbers |= dict(zip(names, summaries, strict=True))
        if uncertainty:
            told = calibrate_uncertainty(
                trained, learning.open_split(trained, data, "validation"), **how
            )
            keep(weights, trained, told)
            numbers["uncertainty"] = _judged(told, pixels)
        print(f"kept in {write_metrics(weights, trained, split, numbers)}")


def _judged(told, pixels) -> dict:
    """Print and return how true an `Uncertainty` is."""
    from fpputil.learning.uncertainty import assess_uncertainty

    found = assess_uncertainty(told, *pixels.together)
    for share in (68, 95):
        covered = found[f"coverage_{share}"]
        print(f"as small as told should be {share} % of the errors, and are {covered:.1%}")
    print("kept        " + "".join(f"{share:>9.0%}" for share in found["kept"]))
    for name in ("mae", "mae_best", "order_errors"):
        print(f"{name:12}" + "".join(f"{value:9.4f}" for value in found[name]))
    return found


def _cell(measure, scale) -> str:
    if measure is None:
        return ""
    value, low, high = (scale * x for x in measure)
    return f"{value:9.4f}  [{low:.4f}, {high:.4f}]"
