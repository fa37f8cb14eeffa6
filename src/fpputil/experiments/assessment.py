"""Everything that is measured on the network of a run (chapter 10)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.synthfringe import SynthFringe
from fpputil.experiments.error_analysis import ErrorAnalysis
from fpputil.files import write_arrays
from fpputil.learning.evaluation import evaluate, open_split
from fpputil.learning.loaders import spread
from fpputil.learning.metrics import Score
from fpputil.learning.weights import Trained

TRUTH = ("mask", "Phi", "modulation", "depth")
VIEWS = "views.npz"
"""File of the truth of these views: NUMBER-mask, NUMBER-Phi and so on."""

PICTURES = 6  # test views whose errors are kept pixel by pixel
SPLITS = ("test", "held-out")
CONDITIONS = {
    "as trained": {},
    "noise 4": {"noise": 4.0},
    "noise 8": {"noise": 8.0},
    "gamma 0.8": {"gamma": 0.8},
    "gamma 1.25": {"gamma": 1.25},
    "half as bright": {"gain": 0.5},
    "a quarter as bright": {"gain": 0.25},
    "texture 0.5": {"texture": 0.5},
}
"""Cameras and surfaces, all but the first such that no network was trained for them. Brightness
changes the photographs alone: mask and truth stay those of the full exposure."""

CONDITION_VIEWS = 100
KINDS = ("rad", "mm", "order", "spike", "high", "low")
"""Kinds of errors of which number, sum of ``|e|`` and sum of squares are kept for each model."""


def assess(trained: Trained, data: str | Path, pictures: Path, **loading) -> dict:
    """Measure a network: test views once, unseen families, other cameras and surfaces.

    Parameters
    ----------
    trained : Trained
    data : path
        The dataset.
    pictures : Path
        File for the errors (P,) of some test views, by number, at the pixels of their masks. Their
        masks, phases, modulation and depths go to `VIEWS` beside it, if that is not there yet.
    **loading
        Options of `predictions`.

    Returns
    -------
    dict
        splits: of "test" and "held-out", and conditions: of each of `CONDITIONS` on some test
        views, a dict of views, measures (of `Score.summary`), models and, by kind and model, sums
        (`KINDS`). The splits also have alone, the measures without the second phase; the test
        split has inspection, the `Inspection.sums` of each model.
    """
    found = {"splits": {}, "conditions": {}}
    for split in SPLITS:
        opened = open_split(trained, data, split)
        seen = _Seen(opened)
        both, alone = evaluate(trained, opened, seen, **loading)
        found["splits"][split] = {**scored(both), "views": len(opened), "alone": alone.summary()}
        if split == "test":
            kept = [seen.inspections[model].sums() for model in both.models]
            found["splits"][split]["inspection"] = kept
            write_arrays(pictures, seen.kept)
            if not (views := pictures.with_name(VIEWS)).is_file():  # every run has the same
                write_arrays(views, seen.truth)
    for name, options in CONDITIONS.items():
        camera = Augmentation(**{k: (v, v) for k, v in options.items() if k != "texture"})
        texture = options.get("texture", 0.0)
        other = open_split(trained, data, "test", camera, texture=texture)
        truth = open_split(trained, data, "test", texture=texture)
        views = spread(other, CONDITION_VIEWS)
        both, _ = evaluate(trained, other, truth=truth, views=views, **loading)
        found["conditions"][name] = {**scored(both), "views": len(views)}
    return found


def scored(score: Score) -> dict:
    """Measures of a score, its models, and the sums behind them."""
    own = list(score.models.values())
    sums = {k: [m[k][1:4].tolist() for m in own] for k in KINDS if k in own[0]}
    return {"measures": score.summary(), "models": list(score.models), "sums": sums}


class _Seen:
    """What is kept of views beside their errors by model."""

    def __init__(self, data: SynthFringe):
        self.inspections, self.kept, self.truth = {}, {}, {}
        self.chosen = {int(data.indices[k]) for k in spread(data, PICTURES)}

    def __call__(self, item: dict, found) -> None:
        self.inspections.setdefault(int(item["model"]), ErrorAnalysis()).add(item, found)
        if int(item["index"]) in self.chosen:
            self.kept[f"{item['index']}"] = (found.Phi - item["Phi"])[item["mask"]]
            self.truth |= {f"{item['index']}-{k}": item[k] for k in TRUTH}


def analyse_errors(runs: Iterable[dict]) -> dict:
    """Measures of `Inspection` of the test views of one or more runs together."""
    sums = [own for run in runs for own in run["splits"]["test"]["inspection"]]
    return ErrorAnalysis.of(sums).summary()
