"""The runs behind Tables 3 to 6 of the paper and behind our own, by name (chapters 8, 10 and 11).

A run is a method, a seed and a preset; `make_run` trains it, measures it and keeps the result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fpputil.dataset.augmentation import Augmentation
from fpputil.experiments.rows import BY_WEIGHTS, run_names
from fpputil.learning.config import TrainingConfig
from fpputil.networks.losses import Weights
from fpputil.networks.methods import METHODS, Method, settings_of

CAMERA = Augmentation(gain=(0.8, 1.2), noise=(0.0, 1.0))
_SHORT = TrainingConfig(
    epochs=3, learning_rate=2e-3, schedule="one-cycle", early_stopping=0, augmentation=CAMERA
)
_PAPER = TrainingConfig(augmentation=CAMERA)


@dataclass(frozen=True)
class Training:
    """How the networks of a preset are trained."""

    levels: int  # pairs of convolutions in an encoder
    recipe: TrainingConfig  # of a network to be used; all have 8 channels by `sized`
    budget: TrainingConfig  # of all runs of tables alike, but for learning rate and seed
    size: int  # channels of these runs by `sized`


TRAINING = {
    "tiny": Training(5, _SHORT, replace(_SHORT, training_views=4800), 4),
    "small": Training(5, replace(_SHORT, epochs=4), replace(_SHORT, training_views=2400), 4),
    # With early stopping some runs would see more pictures than others.
    "paper": Training(6, _PAPER, replace(_PAPER, early_stopping=0), 8),
}
TRAINING["near"] = TRAINING["tiny"]
"""By preset. "paper" has the levels, batch, epochs, optimiser and schedule of the paper; width,
rate, dropout, patience and augmentation it does not give, they are ours. It needs a GPU. "tiny",
"near" and "small" are for two cores."""

WIDTHS = {"sfnet": 2, "sido": 2.5, "psnet": 2, "dlalnet": 3}
"""Channels of the finest level, in parts, that give all methods about as many parameters."""

UNIT_STEP = 4
"""Step of PSNet's unit pitch: a quarter period before the objects, which stand about the middle of
the projector, so that they lie on a flank of the fringe."""

PLAIN = Weights(consistency=0, geometric=0, order=False)

SCENES = 14_400
"""Training views of a dataset of 1000 models, the paper's number of scenes times eight tenths."""

LEARNING_RATES = (1e-3, 2e-3, 4e-3)  # where the best lies at an end, the search goes on there

SEARCHED = (*METHODS, "sfnet-printed", "dlalnet-losses")
"""Runs that a learning rate is searched for; other runs of a method take that of its own."""

SEARCH_CONFIG = replace(
    TRAINING["tiny"].budget, epochs=1, training_views=2400, learning_rate=LEARNING_RATES[0]
)
"""Settings of the search for a learning rate, at `tiny`, for all presets."""


@dataclass(frozen=True)
class Experiment:
    """A run to be made."""

    method: Method
    kind: str  # which of `SEARCHED` it takes the learning rate of
    seed: int = 0


def training(preset: str) -> Training:
    """How the networks of a preset are trained; ValueError if there is no such preset."""
    if preset not in TRAINING:
        raise ValueError(f"preset {preset!r} given; the presets are {', '.join(TRAINING)}")
    return TRAINING[preset]


def budget(preset: str) -> TrainingConfig:
    """Settings of every run of a preset but for learning rate and seed.

    >>> budget("tiny").epochs, budget("tiny").training_views
    (3, 4800)
    """
    return training(preset).budget


def recipe(preset: str, name: str = "sfnet") -> tuple[Method, TrainingConfig]:
    """Method and settings of a network to be used. Chapter 8.

    Below the preset "paper" SFNet has its features joined at every level and a loss that compares
    absolute phases modulo 2 pi and averages Eq. 14; ``data/results/sfnet-choices.json`` tells
    what these are worth.

    >>> method, config = recipe("tiny")
    >>> method.mixing, config.schedule
    ('every level', 'one-cycle')
    """
    how = training(preset)
    if name not in METHODS:
        raise ValueError(f"method {name!r} given; the methods are {', '.join(METHODS)}")
    method = METHODS[name](base=sized(name, 8), levels=how.levels)
    if name == "sfnet" and preset != "paper":
        weights = Weights(order=False, mean=True)
        method = replace(method, mixing="every level", weights=weights)
    return method, how.recipe


def sized(name: str, unit: int) -> int:
    """Channels of the finest level of a method; with the same `unit` all cost about the same."""
    return int(WIDTHS[name] * unit)


def methods(preset: str) -> dict[str, Method]:
    """Methods of all rows by the name of their run.

    All have about as many parameters. SFNet is the paper's, joined deepest, with its three losses
    and their weights, but for the absolute phase, which counts modulo 2 pi: with whole orders in
    the loss a budget like ours is too short for it (chapter 8). DLALNet with these losses has
    Eq. 14 averaged: its orders are not held in the measuring range, and added up, their first
    guesses drown all else. The paper's preset has twice the channels and six levels.
    """
    how = training(preset)
    plain = {k: kind(base=sized(k, how.size), levels=how.levels) for k, kind in METHODS.items()}
    weights = Weights(order=False)
    sfnet = replace(plain["sfnet"], weights=weights)
    best = replace(sfnet, mixing="every level", reference="mid")
    fringe = replace(plain["psnet"], errors="fringe")
    return {
        **plain,
        "sfnet": sfnet,
        "best": best,
        "best-normalised": replace(best, normalised=True),
        "sfnet-a": replace(sfnet, mixing="none", weights=PLAIN),
        "sfnet-b": replace(sfnet, weights=PLAIN),
        **{f"sfnet-{n}-frames": replace(sfnet, frames=n) for n in (2, 3)},
        **{
            name: replace(sfnet, weights=replace(weights, consistency=float(c), geometric=float(g)))
            for (c, g), name in BY_WEIGHTS.items()
        },
        "sfnet-printed": replace(sfnet, weights=Weights()),
        "sfnet-every-level": replace(sfnet, mixing="every level"),
        "sfnet-b-every-level": replace(sfnet, mixing="every level", weights=PLAIN),
        **{f"sfnet-{k}": replace(sfnet, reference=k) for k in ("zmin", "mid", "unit")},
        "psnet-fringe": fringe,
        "psnet-step-4": replace(fringe, unit_step=UNIT_STEP),
        "psnet-normalised": replace(fringe, normalised=True),
        "sido-fringe": replace(plain["sido"], errors="fringe"),
        "sido-no-plane": replace(plain["sido"], plane=False),
        "dlalnet-normalised": replace(plain["dlalnet"], normalised=True),
        "dlalnet-losses": replace(plain["dlalnet"], weights=replace(weights, mean=True)),
    }


def experiments(preset: str) -> dict[str, Experiment]:
    """All runs of a preset by name, in the order in which they are made.

    >>> len(experiments("tiny")), experiments("tiny")["sfnet-mid"].kind
    (51, 'sfnet')
    """
    known = methods(preset)
    kinds = {k: k if k in SEARCHED else settings_of(m)["method"] for k, m in known.items()}
    names = run_names(preset).items()
    return {name: Experiment(known[row], kinds[row], seed) for name, (row, seed) in names}
