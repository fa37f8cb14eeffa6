"""Everything that is measured on the network of a run (chapter 10)."""

from __future__ import annotations

from collections import defaultdict
from copy import copy
from pathlib import Path

from fpputil.dataset.augmentation import Augmentation
from fpputil.experiments.error_analysis import ErrorAnalysis
from fpputil.experiments.statistics import IN_RANGE
from fpputil.files import write_arrays
from fpputil.learning.evaluation import Scores, evaluate, open_split
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
    "noise 2": {"noise": 2.0},
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
FEW_KINDS = ("rad", "mm", "order")
PHASE_KINDS = ("rad", "order")
"""Kinds of errors of which number, sum of ``|e|`` and sum of squares are kept for each model."""


def assess(trained: Trained, data: str | Path, pictures: Path | None, **loading) -> dict:
    """Measure a network: test views once, unseen families, other cameras and surfaces.

    Parameters
    ----------
    trained : Trained
    data : path
        The dataset.
    pictures : path or None
        File for the errors (P,) of some test views, by number, in their masks. Masks, phases,
        modulation and depths go to `VIEWS` beside it, if that is not there yet.
    **loading
        Options of `predictions`.

    Returns
    -------
    dict
        splits ("test", "held-out") and conditions (`CONDITIONS`, on some test views), each as
        `scored`, and once more with `IN_RANGE` after its name. The splits also have alone, the
        measures without the second phase; the test split has inspection, the
        `ErrorAnalysis.sums` of each model.
    """
    splits = {split: open_split(trained, data, split) for split in SPLITS}
    test, analyses, errors, truth = splits["test"], defaultdict(ErrorAnalysis), {}, {}
    chosen = {int(test.indices[k]) for k in spread(test, PICTURES)}

    def keep(item: dict, prediction) -> None:
        analyses[int(item["model"])].add(item, prediction)
        if (index := int(item["index"])) in chosen:
            errors[str(index)] = (prediction.Phi - item["Phi"])[item["mask"]]
            truth.update({f"{index}-{name}": item[name] for name in TRUTH})

    result = {"splits": {}, "conditions": {}}
    for split, views in splits.items():
        scores = evaluate(trained, views, keep if split == "test" else None, **loading)
        result["splits"] |= both(split, scores, len(views))
        result["splits"][split]["alone"] = scores.alone.summary()
    result["splits"]["test"]["inspection"] = [a.sums() for a in analyses.values()]
    if pictures is not None:
        write_arrays(pictures, errors)
        if not (beside := pictures.with_name(VIEWS)).is_file():  # every run has the same
            write_arrays(beside, truth)
    few = spread(test, CONDITION_VIEWS)
    for name, options in CONDITIONS.items():
        camera = {k: (v, v) for k, v in options.items() if k != "texture"}
        surface, seen = copy(test), copy(test)  # the same views, photographed otherwise
        surface.texture = seen.texture = options.get("texture", 0.0)
        seen.augmentation = Augmentation(**camera)
        scores = evaluate(trained, seen, None, surface, few, control=False, **loading)
        result["conditions"] |= both(name, scores, len(few), PHASE_KINDS, PHASE_KINDS)
    return result


def both(name: str, scores: Scores, views: int, kinds=KINDS, told=FEW_KINDS) -> dict[str, dict]:
    """A part as the paper of the method decodes it, and with the measuring range given."""
    parts = {name: (scores.decoded, kinds), name + IN_RANGE: (scores.in_range, told)}
    return {key: scored(*part, views) for key, part in parts.items()}


def scored(score: Score, kinds, views: int) -> dict:
    """Measures (of `Score.summary`), models, sums by kind and model, and views."""
    models = list(score.models.values())
    sums = {k: [m[k][1:4].tolist() for m in models] for k in kinds if k in models[0]}
    return {"measures": score.summary(), "models": list(score.models), "sums": sums, "views": views}
