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


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    evaluate = commands.add_parser(
        "evaluate",
        help="measure a trained network",
        description="Errors over a split with 95 % intervals (bootstrap over models), beside the "
        "control of one photograph: the same phi_h, without phi_r, with the minimum phase at the "
        "high pitch. Millimetres count only where a projector column moves by more than 0.1 "
        "pixel a mm.",
    )
    evaluate.add_argument("weights", metavar="WEIGHTS", type=Path, help="a .safetensors file")
    evaluate.add_argument("--data", type=Path, required=True, metavar="PATH", help="the dataset")
    evaluate.add_argument("--split", default="test",
                          help="training, validation, test (default) or held-out")  # fmt: skip
    evaluate.add_argument("--views", type=int, metavar="N", help="N views, evenly spread")
    evaluate.add_argument("--noise", type=float, default=0.0, help="read noise, grey levels")
    evaluate.add_argument("--gain", type=float, default=1.0, help="exposure")
    evaluate.add_argument("--gamma", type=float, default=1.0, help="camera response")
    evaluate.add_argument("--texture", type=float, default=0.0, help="contrast of dark blotches")
    evaluate.add_argument("--seed", type=int, default=0, help="of noise and intervals")
    evaluate.add_argument("--workers", type=int, default=1, help="processes that load (default 1)")
    evaluate.add_argument("--device", default="cpu", help="cpu, cuda ... (default cpu)")
    evaluate.add_argument("--precision", default="float32", help="float32, bfloat16 or auto")
    evaluate.add_argument("--save", type=Path, metavar="FILE.ply", help="write one view as points")
    evaluate.add_argument("--view", type=int, default=0, help="which, counted in the split")
    evaluate.add_argument("--json", action="store_true",
                          help="keep the numbers in a .json file beside WEIGHTS")  # fmt: skip
    evaluate.set_defaults(run=_evaluate, go_on="no numbers were kept")


def _evaluate(options) -> None:
    from fpputil.dataset.augmentation import Augmentation
    from fpputil.learning.devices import device_of, hardware, precision_of
    from fpputil.learning.evaluation import evaluate, open_split
    from fpputil.learning.loaders import spread
    from fpputil.learning.weights import load_weights, write_metrics

    other = (options.noise, options.gain, options.gamma, options.texture)
    if options.json and other != (0, 1, 1, 0):
        raise ValueError("--json with another camera given; it keeps the dataset's own alone")
    trained = load_weights(options.weights)
    camera = {k: (getattr(options, k),) * 2 for k in ("gain", "noise", "gamma")}
    data = open_split(
        trained, options.data, options.split, Augmentation(**camera), options.seed, options.texture
    )
    if options.save is not None:
        _save(options, trained, data)
    views = spread(data, len(data) if options.views is None else options.views)
    scores = evaluate(
        trained, data, views=views, workers=options.workers, device=options.device,
        precision=options.precision, progress=True,
    )  # fmt: skip
    both, alone = (score.summary(options.seed) for score in scores)
    print(f"{options.split}: {len(views)} views of {len(scores[0].models)} models")
    print(f"{'':32}{'with phi_r':>34}{'phi_h alone':>34}")
    for name, key, unit, scale in ROWS:
        cells = [_cell(found.get(key), scale) for found in (both, alone)]
        print(f"{name + ', ' + unit:32}{cells[0]:>34}{cells[1]:>34}")
    if options.json:
        where = device_of(options.device)
        found = {
            "data": data.store.name,
            "views": len(views),
            "camera": {k: v[0] for k, v in camera.items()},
            "seed": options.seed,
            "precision": precision_of(options.precision, where),
            "hardware": hardware(where),
            "two photographs": both,
            "one photograph": alone,
        }
        print(f"kept in {write_metrics(options.weights, trained, options.split, found)}")


def _cell(measure, scale) -> str:
    if measure is None:
        return ""
    value, low, high = (scale * x for x in measure)
    return f"{value:9.4f}  [{low:.4f}, {high:.4f}]"


def _save(options, trained, data) -> None:
    from fpputil.learning.evaluation import predictions, save_points

    if not 0 <= options.view < len(data):
        raise ValueError(f"view {options.view} given; the split has views 0 to {len(data) - 1}")
    how = {"device": options.device, "precision": options.precision}
    item, found = next(predictions(trained, data, views=[options.view], **how))
    number = save_points(options.save, item, found, data)
    print(f"{number} points of view {int(item['index'])} in {options.save}")
