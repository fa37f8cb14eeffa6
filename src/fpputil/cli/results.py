"""`fpp results`: the runs behind the tables, made by name and printed (chapters 10 and 11)."""

from pathlib import Path
from statistics import median
from typing import Annotated

from cyclopts import App

from fpputil import experiments
from fpputil.cli.options import TRAINING, Data, Preset, TrainingOptions, option

app = App(
    "results",
    help_format="markdown",
    help="""Make and print the tables of the paper.

    Runs are made by name; what one found is a JSON file in RESULTS/PRESET. A finished run is not
    repeated, one that was stopped goes on, and several processes may make runs side by side.""",
)
RESULTS = Path("data/results")
Results = Annotated[Path, option("Folder of the results.")]


@app.command(name="list")
def list_(*, preset: Preset = "tiny", results: Results = RESULTS) -> None:
    """The runs: which are finished, and what the others cost."""
    names, runs = experiments.run_names(preset), experiments.finished(preset, results)
    lacking = [name for name in names if name not in runs]
    if lacking and runs:  # all networks of a preset are about as large
        cost = dict.fromkeys(lacking, median(run.seconds for run in runs.values()))
    elif lacking and experiments.finished("tiny", results):
        speed = experiments.training_speed(experiments.load("tiny", results).runs)
        work = experiments.training_cost(preset, lacking)
        cost = {name: work[name] / speed for name in lacking}
    else:
        cost = {}
    for name in names:
        if run := runs.get(name):
            print(f"{name:24} MAE {run.mae:.4f} rad, {run.seconds / 60:.1f} min")
        else:
            about = f", about {cost[name] / 60:.0f} min" if cost else ""
            print(f"{name:24} to be made{about}")
    if cost:
        hours = sum(cost.values()) / 3600
        source = "the runs that are finished on this preset or, if none is, on tiny"
        print(f"{hours:.1f} hours of training in all, at the speed of {source}")


@app.command
def rates(
    names: Annotated[list[str] | None, option("Of kinds of runs (default: all).")] = None,
    /,
    *,
    data: Data = Path("sets/tiny"),
    results: Results = RESULTS,
    how: TrainingOptions = TRAINING,
) -> None:
    """Search the learning rate of each method, at tiny."""
    path = results / "tiny" / "rates.json"
    chosen = experiments.search_learning_rate(data, path, names or (), **how.begin())
    for kind, rate in chosen.items():
        print(f"{kind:14} {rate:g}")


@app.command
def run(
    names: Annotated[list[str], option("Of runs, or all.")],
    /,
    *,
    preset: Preset = "tiny",
    data: Annotated[Path | None, option("The dataset (default sets/PRESET).")] = None,
    work: Annotated[Path, option("Folder for runs under way.")] = Path("runs"),
    results: Results = RESULTS,
    how: TrainingOptions = TRAINING,
) -> int:
    """Make runs."""
    known, data = list(experiments.experiments(preset)), data or Path("sets") / preset
    if wrong := [name for name in names if name not in (*known, "all")]:
        raise ValueError(f"run {wrong[0]!r} given; the runs are all, {', '.join(known)}")
    processes, failed = how.begin(), False
    waiting = [(name, False) for name in (known if "all" in names else names)]
    for name, wait in waiting:  # grows: what others make is waited for at the end
        try:
            made = experiments.make_run(name, preset, data, work, results, wait, **processes)
            print(f"{name:24} MAE {made.test.measures['mae_rad']:.4f} rad")
        except BlockingIOError as error:
            waiting.append((name, True))
            print(error)
        except FloatingPointError as error:
            failed = True
            print(f"{name}: {error}")
    return int(failed)


@app.command
def table(
    number: Annotated[str, option("3, 4, 5, 6 or ours.")],
    /,
    *,
    preset: Preset = "tiny",
    results: Results = RESULTS,
) -> None:
    """Print a table."""
    from fpputil.experiments.tables import agreement

    key = int(number) if number.isdecimal() else number
    loaded = experiments.load(preset, results)
    rows = loaded.rows(key)
    if not rows:
        make = f"make them: fpp results run all --preset {preset}"
        raise ValueError(f"no run of table {number} is finished in {results / preset}; {make}")
    if loaded.seeded is not loaded.runs:
        print("one seed each; how far another moves a measure is taken from tiny")
    print(loaded.table(key))
    nothing = "no MAE above or below SFNet's: SFNet is not made yet, or nothing beside it"
    print(loaded.differences(key) if any(row.difference for row in rows.values()) else nothing)
    if key == 6 and len(rows) > 2:
        print("Kendall's tau with the paper {:.2f}, p = {:.2f}".format(*agreement(rows.values())))
