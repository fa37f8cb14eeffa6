"""Validation error against images seen: what a longer training would and would not change.

A method of the tables is trained at "tiny" for several budgets, each a training of its own, and
measured on the validation views; budgets of the tables themselves come from their results.
``python -m benchmarks.learning_curves sets/tiny --images 900 3600`` adds what is missing to
data/results/learning-curves.json; `power_law` is fitted to it in chapter 10.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import torch

from fpputil.dataset.store import open_store
from fpputil.experiments.learning_rate import best_learning_rate
from fpputil.experiments.registry import budget, experiments
from fpputil.experiments.rows import seeded_name
from fpputil.files import write_whole
from fpputil.learning import TrainingConfig, fit
from fpputil.learning.training import CHECKPOINT

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "data/results"
METHODS = ("sfnet", "best", "dlalnet", "psnet")
MEASURES = ("images", "validation_mae", "validation_order_errors")


def budget_of(images: int, views: int) -> TrainingConfig:
    """Settings that see so many images: as many epochs as the tables, more if views lack."""
    tables = budget("tiny")
    epochs = max(tables.epochs, -(-images // views))
    if images % epochs:
        raise ValueError(f"{images} images given; they are not {epochs} epochs of equal length")
    return replace(tables, epochs=epochs, training_views=images // epochs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help='a dataset of the preset "tiny"')
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--images", nargs="+", type=int, default=[900, 3600, 14400])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--work", type=Path, default=Path("runs/curves"))
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--out", type=Path, default=RESULTS / "learning-curves.json")
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    store, known = open_store(given.data), experiments("tiny")
    views = len(store.indices("training"))
    tables = budget("tiny").epochs * budget("tiny").training_views
    rows = json.loads(given.out.read_text())["rows"] if given.out.is_file() else []
    for images, name, seed in product(given.images, given.methods, given.seeds):
        key = {"method": name, "budget": images, "seed": seed}
        if any(key.items() <= row.items() for row in rows):
            continue
        run = known[seeded_name(name, seed)]
        result = RESULTS / "tiny" / f"{seeded_name(name, seed)}.json"
        if images == tables and result.is_file():
            history = json.loads(result.read_text())["history"]
        else:
            rate = best_learning_rate(RESULTS / "tiny" / "rates.json", run.kind)
            config = replace(budget_of(images, views), learning_rate=rate, seed=seed)
            folder = given.work / f"{name}-{images}-{seed}"
            resume = (folder / CHECKPOINT).is_file()
            _, history = fit(run.method, given.data, config, folder, resume=resume)
        rows.append({**key, **{k: history[-1][k] for k in MEASURES}})
        print(rows[-1])
        rows.sort(key=lambda row: (row["method"], row["budget"], row["seed"]))
        record = {"command": "python -m benchmarks.learning_curves sets/tiny", "rows": rows}
        write_whole(given.out, f"{json.dumps(record, indent=1)}\n".encode())


if __name__ == "__main__":
    main()
