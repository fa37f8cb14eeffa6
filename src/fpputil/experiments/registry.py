"""The runs behind Tables 3 to 6 of the paper and behind our own, by name (chapters 10 and 11).

A run is a method, a seed and a preset; `results` trains it, measures it and keeps what it found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fpputil.experiments.recipes import CAMERA, recipe, sized
from fpputil.learning.config import TrainingConfig
from fpputil.networks.losses import Weights
from fpputil.networks.methods import DLALNetMethod, Method, PSNetMethod, SFNetMethod, SIDOMethod

PLAIN = Weights(consistency=0, geometric=0, order=False)
CONSISTENCY, GEOMETRIC = ("1e-1", "1e-2", "1e-3"), ("1e-5", "1e-6", "1e-7")


def _by_weights() -> dict[tuple[str, str], str]:
    names = {(c, g): f"sfnet-{c}-{g}" for c in CONSISTENCY for g in GEOMETRIC}
    return names | {("1e-2", "1e-6"): "sfnet"}


ROWS = {
    3: {"SFNet": "sfnet", "SIDO": "sido", "PSNet": "psnet", "DLALNet": "dlalnet"},
    4: {"A": "sfnet-a", "B": "sfnet-b", "C": "sfnet"},
    5: {"1 + 1": "sfnet", "2 + 2": "sfnet-2-frames", "3 + 3": "sfnet-3-frames"},
    6: {f"{c}, {g}": name for (c, g), name in _by_weights().items()},
    "ours": {
        "losses as printed": "sfnet-printed",
        "joined at every level": "sfnet-every-level",
        "reference unrefined": "sfnet-zmin",
        "reference at pitch 114": "sfnet-mid",
        "reference at pitch 912": "sfnet-unit",
        "SIDO without the plane": "sido-no-plane",
        "DLALNet, SFNet's losses": "dlalnet-losses",
    },
}
"""Name of the run of each row of each table; "ours" are rows that the paper does not have."""

SEEDS = {name: (0, 1, 2) for table in (3, 4) for name in ROWS[table].values()}
"""Seeds of the runs that have more than seed 0."""

SCENES = 14_400
"""Training views of a dataset of 1000 models, the paper's number of scenes times eight tenths."""

LEARNING_RATES = (1e-3, 2e-3, 4e-3)
"""Learning rates that are tried first; where the best lies at an end, the search goes on there."""

SEARCHED = (
    *("sfnet", "sido", "psnet", "dlalnet"),
    *("sfnet-a", "sfnet-b", "sfnet-printed", "dlalnet-losses"),
)
"""Runs that a learning rate is searched for; other runs of SFNet and SIDO take theirs."""


@dataclass(frozen=True)
class Experiment:
    """A run to be made.

    Parameters
    ----------
    method : Method
    kind : str
        Which of `SEARCHED` it takes the learning rate of.
    seed : int
    """

    method: Method
    kind: str
    seed: int = 0


def methods(preset: str) -> dict[str, Method]:
    """Methods of all rows by the name of their run.

    All have about as many parameters. SFNet is the paper's, joined deepest, with its three losses
    and their weights, but for the absolute phase, which counts modulo 2 pi: with whole orders in
    the loss a budget like ours is too short for it (chapter 8). DLALNet with these losses has
    Eq. 14 averaged: its orders are not held in the measuring range, and added up, their first
    guesses drown all else. The paper's preset has twice the channels and six levels.
    """
    large = preset == "paper"
    recipe(preset)  # which knows the presets
    size = {
        k: {"base": sized(k, 8 if large else 4), "levels": 6 if large else 5}
        for k in ("sfnet", "sido", "psnet", "dlalnet")
    }
    weights = Weights(order=False)
    sfnet = SFNetMethod(weights=weights, **size["sfnet"])
    sido = SIDOMethod(**size["sido"])
    dlalnet = DLALNetMethod(**size["dlalnet"])
    other = {
        name: replace(sfnet, weights=replace(weights, consistency=float(c), geometric=float(g)))
        for (c, g), name in _by_weights().items()
    }
    return {
        "sfnet": sfnet,
        "sido": sido,
        "psnet": PSNetMethod(**size["psnet"]),
        "dlalnet": dlalnet,
        "sfnet-a": replace(sfnet, mixing="none", weights=PLAIN),
        "sfnet-b": replace(sfnet, weights=PLAIN),
        "sfnet-2-frames": replace(sfnet, frames=2),
        "sfnet-3-frames": replace(sfnet, frames=3),
        **other,
        "sfnet-printed": replace(sfnet, weights=Weights()),
        "sfnet-every-level": replace(sfnet, mixing="every level"),
        "sfnet-zmin": replace(sfnet, reference="zmin"),
        "sfnet-mid": replace(sfnet, reference="mid"),
        "sfnet-unit": replace(sfnet, reference="unit"),
        "sido-no-plane": replace(sido, plane=False),
        "dlalnet-losses": replace(dlalnet, weights=replace(weights, mean=True)),
    }


def seeded_name(name: str, seed: int) -> str:
    """Name of the run of a row with a seed: "sfnet", "sfnet-seed-1"."""
    return f"{name}-seed-{seed}" if seed else name


def experiments(preset: str) -> dict[str, Experiment]:
    """All runs of a preset by name, in the order in which they are made.

    Seed 0 of every row comes first, so that a table is whole before its intervals are.
    """
    found = {}
    for name, method in methods(preset).items():
        kind = name if name in SEARCHED else name.partition("-")[0]
        found[name] = Experiment(method, kind)
    for seed in (1, 2):
        for name in (k for k, seeds in SEEDS.items() if seed in seeds):
            found[seeded_name(name, seed)] = replace(found[name], seed=seed)
    return found


def budget(preset: str) -> TrainingConfig:
    """Settings of every run of a preset but for rate and seed: the same for all methods."""
    short = TrainingConfig(schedule="one-cycle", early_stopping=0, augmentation=CAMERA)
    settings = {
        "tiny": replace(short, epochs=3, training_views=4800),
        "small": replace(short, epochs=3, training_views=2400),
        "paper": replace(
            recipe("paper")[1], early_stopping=0
        ),  # or some would see more than others
    }
    return settings[preset]


SEARCH_CONFIG = replace(budget("tiny"), epochs=1, training_views=2400)
"""Settings of the search for a learning rate, at `tiny`, for all presets."""
