"""`fpp results`: the runs behind the tables, made by name and printed (chapters 10 and 11)."""

from __future__ import annotations

from pathlib import Path

from cyclopts import App

from fpputil.cli.options import TRAINING, Training

app = App(
    "results",
    help_format="markdown",
    help="""Make and print the tables of the paper.

    Runs are made by name; what one found is a JSON file in RESULTS/PRESET. A finished run is not
    repeated, one that was stopped goes on, and several processes may make runs side by side.""",
)
RESULTS = Path("data/results")


@app.command(name="list")
def list_(*, preset: str = "tiny", results: Path = RESULTS) -> None:
    """The runs: which are finished, and what the others cost.

    Parameters
    ----------
    preset
        tiny, small or paper.
    results
        Folder of the results.
    """
    from fpputil.experiments.registry import experiments
    from fpputil.experiments.runs import load, training_cost, training_speed

    names, runs = experiments(preset), load(preset, results).runs
    measured = training_speed(runs) or training_speed(load("tiny", results).runs)
    work = training_cost(preset, [name for name in names if name not in runs])
    for name in names:
        if run := runs.get(name):
            print(f"{name:24} MAE {run.test.mae:.4f} rad, {run.seconds / 60:.1f} min")
        elif measured:
            print(f"{name:24} to be made, about {work[name] / measured / 60:.0f} min")
        else:
            print(f"{name:24} to be made")
    if work and measured:
        hours = sum(work.values()) / measured / 3600
        print(
            f"{hours:.1f} hours of training in all, at the speed of the runs that are finished on "
            "this preset or, if none is, on tiny"
        )


@app.command
def rates(
    names: list[str] | None = None,
    /,
    *,
    data: Path = Path("sets/tiny"),
    results: Path = RESULTS,
    how: Training = TRAINING,
) -> None:
    """Search the learning rate of each method, at tiny.

    Parameters
    ----------
    names
        Of kinds of runs (default: all).
    data
        The dataset.
    results
        Folder of the results.
    """
    from fpputil.experiments.learning_rate import search_learning_rate

    path = results / "tiny" / "rates.json"
    for kind, rate in search_learning_rate(data, path, names or (), **how.begin()).items():
        print(f"{kind:14} {rate:g}")


@app.command
def run(
    names: list[str],
    /,
    *,
    preset: str = "tiny",
    data: Path | None = None,
    work: Path = Path("runs"),
    results: Path = RESULTS,
    how: Training = TRAINING,
) -> int:
    """Make runs.

    Parameters
    ----------
    names
        Of runs, or all.
    preset
        tiny, small or paper.
    data
        The dataset (default sets/PRESET).
    work
        Folder for runs under way.
    results
        Folder of the results.
    """
    from fpputil.experiments import runs
    from fpputil.experiments.registry import experiments

    known, data = list(experiments(preset)), data or Path("sets") / preset
    if wrong := [name for name in names if name not in (*known, "all")]:
        raise ValueError(f"run {wrong[0]!r} given; the runs are all, {', '.join(known)}")
    processes = how.begin()
    elsewhere, failed = [], []

    def make(name: str, wait: bool) -> None:
        try:
            made = runs.make_run(name, preset, data, work, results, wait, **processes)
        except BlockingIOError as error:
            elsewhere.append(name)
            print(error)
        except FloatingPointError as error:
            failed.append(name)
            print(f"{name}: {error}")
        else:
            print(f"{name:24} MAE {made.test.measures['mae_rad']:.4f} rad")

    for name in known if "all" in names else names:
        make(name, wait=False)
    for name in list(elsewhere):  # by now others have made them, or have been stopped
        make(name, wait=True)
    return 1 if failed else 0


@app.command
def table(number: str, /, *, preset: str = "tiny", results: Path = RESULTS) -> None:
    """Print a table.

    Parameters
    ----------
    number
        3, 4, 5, 6 or ours.
    preset
        tiny, small or paper.
    results
        Folder of the results.
    """
    from fpputil.experiments.runs import load
    from fpputil.experiments.tables import agreement

    key = int(number) if number.isdecimal() else number
    loaded = load(preset, results)
    rows = loaded.rows(key)
    if not rows:
        raise ValueError(
            f"no run of table {number} is finished in {results / preset}; make them: "
            f"fpp results run all --preset {preset}"
        )
    if loaded.seeded is not loaded.runs:
        print("one seed each; how far another moves a measure is taken from tiny")
    print(loaded.table(key))
    if any(row.difference for row in rows.values()):
        print(loaded.differences(key))
    else:
        print("no MAE above or below SFNet's: SFNet is not made yet, or nothing beside it")
    if key == 6 and len(rows) > 2:
        print("Kendall's tau with the paper {:.2f}, p = {:.2f}".format(*agreement(rows.values())))
