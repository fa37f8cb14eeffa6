"""Making the runs of `experiments`, one JSON file each, and reading them (chapters 10 and 11)."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from statistics import median

import numpy as np
from filelock import FileLock, Timeout

from fpputil.checks import anything, finite, natural, not_negative, one_line, or_null, text
from fpputil.dataset.augmentation import Augmentation
from fpputil.dataset.store import open_store
from fpputil.experiments import statistics, tables
from fpputil.experiments.assessment import SPLITS, TRUTH, VIEWS, assess
from fpputil.experiments.error_analysis import FORM as ANALYSIS
from fpputil.experiments.error_analysis import ErrorAnalysis
from fpputil.experiments.learning_rate import best_learning_rate, read_rates
from fpputil.experiments.registry import SCENES, budget, experiments
from fpputil.experiments.rows import DRAWN, read_stored
from fpputil.experiments.statistics import Interval, Spread, seeds_of
from fpputil.files import read_arrays, write_whole
from fpputil.learning.config import TrainingConfig
from fpputil.learning.training import CHECKPOINT, WEIGHTS, fit
from fpputil.learning.weights import load_weights, plain, short
from fpputil.networks.complexity import cost
from fpputil.networks.methods import Method, method_of, settings_of
from fpputil.notebook import Table
from fpputil.optics.system import preset as preset_of

RESULTS = Path("data/results")
IDENTITY = ("name", "preset", "seed", "data", "method", "settings")
COSTS = ("parameters", "multiply_adds", "images", "seconds", "hardware", "history")
INTERVAL = (or_null(finite),) * 3  # null where nothing was measured
MEASURES = {"mae_rad": (finite,) * 3, ...: INTERVAL}
SUMS = [(not_negative,) * 3]
PART = {
    "measures": MEASURES,
    "models": [natural],
    "sums": {"rad": SUMS, ...: SUMS},
    "views": natural,
    ...: anything,
}
TEST = {**PART, "alone": MEASURES, "inspection": [ANALYSIS]}
STORED = dict.fromkeys(IDENTITY, anything) | {...: anything}
FORM = {
    "name": text,
    "preset": text,
    "seed": natural,
    "data": text,
    "method": {...: anything},
    "settings": {"augmentation": {...: (finite, finite)}, ...: anything},
    "parameters": natural,
    "multiply_adds": natural,
    "images": natural,
    "seconds": not_negative,
    "hardware": {...: anything},
    "history": [{...: or_null(finite)}],
    "splits": {"test": TEST, "held-out": PART, ...: PART},
    "conditions": {...: PART},
    ...: anything,
}
"""Of the result of a run; `STORED` of what tells one from others."""

TILE = 32  # pixels that every network halves without a rest: its work grows with their number


@dataclass(frozen=True, eq=False)
class Part:
    """What a network was measured to do on some views: ``part.mae_mm``, ``part.mae`` in radians."""

    measures: dict[str, Interval]  # of `Score.summary`; None where nothing was measured
    models: list[int] = field(default_factory=list)
    sums: dict[str, list] = field(default_factory=dict)  # by kind of error, as `scored` has them
    views: int = 0

    def __getattr__(self, name: str) -> float:
        measures = vars(self).get("measures", {})
        for key in (name, f"{name}_rad"):
            if key in measures:
                return measures[key].value
        raise AttributeError(f"{name} asked for; the measures are {', '.join(measures)}")


@dataclass(frozen=True, eq=False)
class Run:
    """A finished run: ``run.test.mae``, ``run.parts["noise 4"].order_errors``."""

    name: str
    preset: str
    seed: int
    data: str  # name of the dataset
    method: Method
    settings: TrainingConfig
    parameters: int
    multiply_adds: int  # of the network, for one view
    images: int  # seen in training
    seconds: float
    hardware: dict
    history: list[dict]  # a row an epoch
    parts: dict[str, Part]  # "test", "held-out" and each of `CONDITIONS`
    alone: Part  # measures of phi_h of the test views, without the second phase
    analyses: list[dict]  # sums of `ErrorAnalysis` of each test model

    @property
    def kind(self) -> str:
        """Name of the method, "sfnet", "sido", "psnet" or "dlalnet"; with "normalised" if it is.

        Of runs of one kind a seed moves measures alike, and normalised ones train otherwise.
        """
        return settings_of(self.method)["method"] + ", normalised" * self.method.normalised

    @property
    def test(self) -> Part:
        return self.parts["test"]

    @property
    def held_out(self) -> Part:
        return self.parts["held-out"]

    @property
    def analysis(self) -> dict:
        """Measures of `ErrorAnalysis` over the test views."""
        return ErrorAnalysis.of(self.analyses).summary()


def read_result(path: Path) -> Run:
    """A finished run; ValueError with the path if the file is cut, foreign or outdated."""
    stored = read_stored(path, FORM)
    try:
        settings = dict(stored["settings"])
        camera = {k: tuple(v) for k, v in settings.pop("augmentation").items()}
        test, parts = stored["splits"]["test"], stored["splits"] | stored["conditions"]
        for name, part in parts.items():
            if {len(sums) for sums in part["sums"].values()} != {len(part["models"])}:
                raise ValueError(f"not as many sums of {name} as models")
        return Run(
            **{k: stored[k] for k in (*IDENTITY[:4], *COSTS)},
            method=method_of(stored["method"]),
            settings=TrainingConfig(augmentation=Augmentation(**camera), **settings),
            parts={
                name: Part(_intervals(p["measures"]), p["models"], p["sums"], p["views"])
                for name, p in parts.items()
            },
            alone=Part(_intervals(test["alone"]), views=test["views"]),
            analyses=test["inspection"],
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is of no method of this version ({one_line(error)})") from error


def _intervals(measures: dict) -> dict[str, Interval]:
    return {name: Interval(*values) for name, values in measures.items()}


def read_results(preset: str, path: str | Path = RESULTS) -> dict[str, Run]:
    """All finished runs of a preset, by name.

    ValueError if one was made with another method or budget than `experiments` has, or if they
    were made on different datasets.
    """
    folder, runs = Path(path) / preset, {}
    for name, experiment in experiments(preset).items():
        if not (file := folder / f"{name}.json").is_file():
            continue
        run = runs[name] = read_result(file)
        rate = run.settings.learning_rate
        settings = replace(budget(preset), seed=experiment.seed, learning_rate=rate)
        for what, needed in (("method", experiment.method), ("settings", settings)):
            if getattr(run, what) != needed:
                again = f"make it again: fpp results run {name} --preset {preset}"
                raise ValueError(f"{file} was made with other {what} than this version's; {again}")
    if (number := len({run.data for run in runs.values()})) > 1:
        raise ValueError(f"{folder} holds runs on {number} datasets; a table is about one")
    return runs


def make_run(
    name: str,
    preset: str,
    data: str | Path,
    work: str | Path,
    results: str | Path = RESULTS,
    wait: bool = False,
    **how,
) -> Run:
    """Make a run of `experiments`, or go on with it, unless it is finished.

    It leaves NAME.json in the folder of the preset, and of a run of `DRAWN` NAME.npz, the errors
    of some views.

    Parameters
    ----------
    name, preset : str
    data : path
        A dataset of the preset, with all splits.
    work : path
        Folder for the folders of runs under way, each named after all that decides on it.
    results : path
        Folder with tiny/rates.json, for the results of each preset in a folder of its own.
    wait : bool
        Wait while another process makes this run; otherwise BlockingIOError.
    **how
        Options of `fit`: workers, device, progress.
    """
    known, store, results = experiments(preset), open_store(data), Path(results)
    if name not in known:
        raise ValueError(f"run {name!r} given; the runs are {', '.join(known)}")
    if (made := store.manifest["settings"]["preset"]) != preset:
        raise ValueError(f"{data} was made with the preset {made}, and {preset} is asked for")
    for split in ("training", "validation", *SPLITS):
        store.indices(split)  # which raises if it lacks one
    method, kind, seed = known[name].method, known[name].kind, known[name].seed
    rate = best_learning_rate(results / "tiny" / "rates.json", kind)
    settings = replace(budget(preset), learning_rate=rate, seed=seed)
    values = (name, preset, seed, store.name, settings_of(method), plain(asdict(settings)))
    identity = dict(zip(IDENTITY, values, strict=True))
    mark = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:8]
    path = results / preset / f"{name}.json"
    folder = Path(work) / preset / f"{name}-{mark}"
    for needed in (folder, path.parent):
        needed.mkdir(parents=True, exist_ok=True)
    try:  # the lock dies with its process
        with FileLock(folder / ".lock", timeout=-1 if wait else 0):
            stored = read_stored(path, STORED) if path.is_file() else {}
            if {k: stored.get(k) for k in IDENTITY} != identity:
                resume = (folder / CHECKPOINT).is_file()
                _, history = fit(method, data, settings, folder, resume=resume, **how)
                trained = load_weights(folder / WEIGHTS)
                record = {**identity, "checksum": store.checksum, **_costs(trained, history)}
                # By default where `fit` trains; the precision is alike on every device.
                loading = {"device": None, **how, "precision": "float32"}
                drawn = name in DRAWN and preset != "near"
                record |= assess(
                    trained, data, path.with_suffix(".npz") if drawn else None, **loading
                )
                write_whole(path, f"{json.dumps(short(record), separators=(',', ':'))}\n".encode())
    except Timeout:
        raise BlockingIOError(f"another process is making the run {name}") from None
    return read_result(path)


def _costs(trained, history: list[dict]) -> dict:
    work = cost(trained.network, tuple(trained.metadata["camera"]))
    seen, seconds = history[-1]["images"], sum(row["seconds"] for row in history)
    hardware = trained.metadata["training"]["hardware"]
    values = (work.parameters, work.multiply_adds, seen, seconds, hardware, history)
    return {"version": version("fpputil"), **dict(zip(COSTS, values, strict=True))}


def training_cost(preset: str, names: Iterable[str]) -> dict[str, float]:
    """Multiply-adds of all forward passes in training, by name of the run. Chapter 10.

    The paper's dataset is taken to have `SCENES` views in training.
    """
    camera, settings, known = preset_of(preset).system.camera, budget(preset), experiments(preset)
    tiles = -(-camera.height // TILE) * -(-camera.width // TILE)
    images = settings.epochs * (settings.training_views or SCENES)
    method = {name: known[name].method for name in names}
    tile = {one: cost(one.network(), (TILE, TILE)).multiply_adds for one in set(method.values())}
    return {name: float(images * tiles * tile[one]) for name, one in method.items()}


def training_speed(runs: Mapping[str, Run]) -> float | None:
    """Multiply-adds of forward passes a second of training: the median of the runs, or None."""
    speeds = [run.images * run.multiply_adds / run.seconds for run in runs.values()]
    return median(speeds) if speeds else None


@dataclass(frozen=True, eq=False)
class ResultView:
    """A test view whose errors were kept; its arrays (H, W) are 0 outside the mask."""

    number: int  # in the dataset
    mask: np.ndarray
    Phi: np.ndarray  # true absolute phase, radians
    modulation: np.ndarray  # grey levels
    depth: np.ndarray  # mm
    folder: Path  # of the results of the preset

    def error(self, name: str) -> np.ndarray:
        """Error of Phi of a run, (H, W) radians, NaN outside the mask."""
        path, picture = self.folder / f"{name}.npz", np.full(self.mask.shape, np.nan)
        errors = read_arrays(path).get(str(self.number), np.zeros(0))
        if errors.shape != (number := np.count_nonzero(self.mask),):
            raise ValueError(f"{path} has not {number} errors of view {self.number}; make it again")
        picture[self.mask] = errors
        return picture

    def cropped(self, picture: np.ndarray) -> np.ndarray:
        """The part of a picture (H, W) around the object, 4 : 3."""
        v, u = np.nonzero(self.mask)
        half = max(np.ptp(v) * 2 / 3, np.ptp(u) / 2) + 3
        top = int(v.min() + v.max()) // 2 - round(0.75 * half)
        left = int(u.min() + u.max()) // 2 - round(half)
        rows = slice(max(top, 0), top + round(1.5 * half))
        return picture[rows, max(left, 0) : left + round(2 * half)]


@dataclass(frozen=True, eq=False)
class Results:
    """The finished runs of a preset, and what they say together. Chapters 10 and 11."""

    preset: str
    path: Path
    runs: dict[str, Run]  # by name
    seeded: dict[str, Run]  # from whose seeds to tell how far a seed moves a measure
    _rows: dict = field(default_factory=dict, repr=False)  # of tables that were asked for

    def seeds(self, name: str) -> list[Run]:
        """The runs of a row, one a seed."""
        return seeds_of(name, self.runs)

    def rows(self, number: int | str, *names: str) -> dict[str, tables.Row]:
        """Rows of a table by the name of their run: all, or some."""
        if number not in self._rows:
            table = tables.table(number, self.runs, self.seeded)
            self._rows[number] = {row.name: row for row in table}
        rows = self._rows[number]
        return {name: rows[name] for name in names or rows}

    def table(self, number: int | str, *names: str) -> Table:
        """A table of the paper, 3 to 6, or "ours", with the paper's values below ours."""
        control = self.runs["sfnet"].alone.measures if "sfnet" in self.runs else None
        return tables.as_table(self.rows(number, *names).values(), control)

    def differences(self, number: int | str, *names: str) -> Table:
        """By how much the MAE of each row of a table lies above SFNet's."""
        return tables.differences_table(self.rows(number, *names).values())

    def difference(self, a: str, b: str, measure="mae_rad") -> Interval:
        """A measure of one row above that of another."""
        spread = self.seed_variation(measure)
        return statistics.difference(self.seeds(a), self.seeds(b), spread, measure)

    def mean(self, name: str, measure="mae_rad", part="test") -> float:
        """A measure of a row, the mean over its seeds."""
        return float(statistics.bootstrap(self.seeds(name), measure, part, draws=1)[0])

    def seed_variation(self, measure="mae_rad") -> Spread:
        """How much a seed moves a measure, in parts of it, by method."""
        return statistics.seed_variation(self.seeded, measure)

    def analysis(self, name: str) -> dict:
        """Measures of `ErrorAnalysis` over the test views of all seeds of a row."""
        return ErrorAnalysis.of([s for run in self.seeds(name) for s in run.analyses]).summary()

    @property
    def rates(self) -> dict[str, dict[str, dict]]:
        """What the search for a learning rate found, by kind of run and rate."""
        return read_rates(self.path / "tiny" / "rates.json")["runs"]

    @cached_property
    def views(self) -> list[ResultView]:
        """The test views whose errors were kept."""
        folder, views = self.path / self.preset, []
        truth = read_arrays(folder / VIEWS)
        for number in sorted(int(key[:-5]) for key in truth if re.fullmatch("[0-9]+-mask", key)):
            maps = [truth.get(f"{number}-{name}", np.zeros(0)) for name in TRUTH]
            if len({m.shape for m in maps}) > 1 or maps[0].ndim != 2 or maps[0].dtype != bool:
                raise ValueError(f"{folder / VIEWS} has not all of view {number}; make it again")
            views.append(ResultView(number, *maps, folder))
        return views


def load(preset: str, path: str | Path = RESULTS) -> Results:
    """The finished runs of a preset, from a folder with one for each; errors as `read_results`.

    Where none has another seed than 0, how far a seed moves a measure is taken from "tiny".
    """
    path, runs = Path(path), read_results(preset, path)
    seeded = runs if any(run.seed for run in runs.values()) else read_results("tiny", path)
    return Results(preset, path, runs, seeded)
