"""What runs cost that are not made yet: their arithmetic is counted, the speed measured."""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median

from fpputil.experiments.registry import SCENES, budget, experiments
from fpputil.networks.complexity import cost
from fpputil.optics.system import preset as preset_of

TILE = 32  # pixels that every network halves without a rest: its work grows with their number


def training_cost(preset: str, names: Iterable[str]) -> dict[str, float]:
    """Multiply-adds of all forward passes in training, by name of the run. Chapter 10.

    The paper's dataset is taken to have `SCENES` views in training.
    """
    camera, settings, known = preset_of(preset).system.camera, budget(preset), experiments(preset)
    tiles = -(-camera.height // TILE) * -(-camera.width // TILE)
    images = settings.epochs * (settings.training_views or SCENES)
    tile = {n: cost(known[n].method.network(), (TILE, TILE)).multiply_adds for n in names}
    return {name: float(images * tiles * work) for name, work in tile.items()}


def training_speed(runs: dict[str, dict]) -> float | None:
    """Multiply-adds of forward passes that a second of training holds, or None without a run.

    Parameters
    ----------
    runs : dict
        From `fpputil.experiments.runs.read_results`; the median over them counts.
    """
    made = [r["images"] * r["multiply_adds"] / r["seconds"] for r in runs.values()]
    return median(made) if made else None
