"""`fpp evaluate`: how far off a trained network is on a split of a dataset (chapter 8)."""

from __future__ import annotations

from pathlib import Path

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
    weights: Path,
    /,
    *,
    data: Path,
    split: str = "test",
    views: int | None = None,
    noise: float = 0.0,
    gain: float = 1.0,
    gamma: float = 1.0,
    texture: float = 0.0,
    seed: int = 0,
    workers: int = 1,
    device: str = "cpu",
    precision: str = "float32",
    save: Path | None = None,
    view: int = 0,
    json: bool = False,
) -> None:
    """Measure a trained network.

    Errors over a split with 95 % intervals (bootstrap over models), beside the control of one
    photograph: the same phi_h, without phi_r, with the minimum phase at the high pitch.
    Millimetres count only where a projector column moves by more than 0.1 pixel a mm.

    Parameters
    ----------
    weights
        A .safetensors file.
    data
        The dataset.
    split
        training, validation, test or held-out.
    views
        So many, evenly spread (default: all).
    noise
        Read noise, grey levels.
    gain
        Exposure.
    gamma
        Camera response.
    texture
        Contrast of dark blotches.
    seed
        Of noise and intervals.
    workers
        Processes that load.
    device
        cpu, cuda ...
    precision
        float32, bfloat16 or auto.
    save
        Write one view as points into this .ply file.
    view
        Which, counted in the split.
    json
        Keep the numbers in a .json file beside WEIGHTS.
    """
    from fpputil.dataset.augmentation import Augmentation
    from fpputil.learning import evaluation
    from fpputil.learning.devices import device_of, hardware, precision_of
    from fpputil.learning.loaders import spread
    from fpputil.learning.weights import load_weights, write_metrics

    if json and (noise, gain, gamma, texture) != (0, 1, 1, 0):
        raise ValueError("--json with another camera given; it keeps the dataset's own alone")
    trained = load_weights(weights)
    camera = {"gain": gain, "noise": noise, "gamma": gamma}
    augmentation = Augmentation(**{name: (value, value) for name, value in camera.items()})
    opened = evaluation.open_split(trained, data, split, augmentation, seed, texture)
    how = {"device": device, "precision": precision}
    if save is not None:
        if not 0 <= view < len(opened):
            raise ValueError(f"view {view} given; the split has views 0 to {len(opened) - 1}")
        item, prediction = next(evaluation.predictions(trained, opened, views=[view], **how))
        number = evaluation.save_points(save, item, prediction, opened)
        print(f"{number} points of view {int(item['index'])} in {save}")
    which = spread(opened, len(opened) if views is None else views)
    how |= {"workers": workers, "progress": True}
    scores = evaluation.evaluate(trained, opened, views=which, **how)
    both, alone = (score.summary(seed) for score in scores)
    print(f"{split}: {len(which)} views of {len(scores[0].models)} models")
    print(f"{'':32}{'with phi_r':>34}{'phi_h alone':>34}")
    for name, key, unit, scale in ROWS:
        cells = [_cell(measures.get(key), scale) for measures in (both, alone)]
        print(f"{name + ', ' + unit:32}{cells[0]:>34}{cells[1]:>34}")
    if json:
        where = device_of(device)
        numbers = {
            "data": opened.store.name,
            "views": len(which),
            "camera": camera,
            "seed": seed,
            "precision": precision_of(precision, where),
            "hardware": hardware(where),
            "two photographs": both,
            "one photograph": alone,
        }
        print(f"kept in {write_metrics(weights, trained, split, numbers)}")


def _cell(measure, scale) -> str:
    if measure is None:
        return ""
    value, low, high = (scale * x for x in measure)
    return f"{value:9.4f}  [{low:.4f}, {high:.4f}]"
