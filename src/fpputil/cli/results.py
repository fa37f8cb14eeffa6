"""`fpp results`: the runs behind the tables, made by name and printed (chapters 10 and 11)."""

from __future__ import annotations

from pathlib import Path


def add_to(commands) -> None:
    """Add the command to those of `fpp`."""
    results = commands.add_parser(
        "results",
        help="make and print the tables of the paper",
        description="Runs are made by name; what one found is a JSON file in RESULTS/PRESET. A "
        "finished run is not repeated, one that was stopped goes on, and several processes may "
        "make runs side by side.",
    )
    parts = results.add_subparsers(title="parts", required=True, metavar="PART")
    _list(parts.add_parser("list", help="the runs: which are finished, and what the others cost"))
    _rates(parts.add_parser("rates", help="search the learning rate of each method, at tiny"))
    _run(parts.add_parser("run", help="make runs"))
    _table(parts.add_parser("table", help="print a table"))


def _common(part, run) -> None:
    part.add_argument("--preset", default="tiny", help="tiny (default), small or paper")
    part.add_argument("--results", type=Path, default=Path("data/results"), metavar="DIR",
                      help="folder of the results (default data/results)")  # fmt: skip
    part.set_defaults(run=run, go_on="the same command goes on from here")


def _training(part) -> None:
    part.add_argument("--data", type=Path, metavar="PATH",
                      help="the dataset (default sets/PRESET)")  # fmt: skip
    part.add_argument("--workers", type=int, default=1, help="processes that load (default 1)")
    part.add_argument("--device", help="cpu, cuda, cuda:1 ... (default: a GPU if there is one)")
    part.add_argument("--threads", type=int, help="of the processor (default: all)")


def _list(part) -> None:
    _common(part, _print_list)


def _rates(part) -> None:
    part.add_argument("names", nargs="*", metavar="NAME", help="of a kind of runs (default all)")
    part.add_argument("--results", type=Path, default=Path("data/results"), metavar="DIR",
                      help="folder of the results (default data/results)")  # fmt: skip
    _training(part)
    part.set_defaults(run=_search, preset="tiny", go_on="the same command goes on from here")


def _run(part) -> None:
    part.add_argument("names", nargs="+", metavar="NAME", help="of a run, or all")
    part.add_argument("--work", type=Path, default=Path("runs"), metavar="DIR",
                      help="folder for runs under way (default runs)")  # fmt: skip
    _common(part, _make)
    _training(part)


def _table(part) -> None:
    part.add_argument("number", help="3, 4, 5, 6 or ours")
    _common(part, _print_table)


def _print_list(options) -> None:
    from fpputil.experiments.registry import experiments
    from fpputil.experiments.runs import load, training_cost, training_speed

    results, names = load(options.preset, options.results), experiments(options.preset)
    measured = training_speed(results.runs) or training_speed(load("tiny", options.results).runs)
    work = training_cost(options.preset, [name for name in names if name not in results.runs])
    for name in names:
        if run := results.runs.get(name):
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


def _data(options) -> Path:
    return options.data or Path("sets") / options.preset


def _search(options) -> None:
    from fpputil.experiments.learning_rate import search_learning_rate
    from fpputil.learning.devices import use_threads

    use_threads(options.threads)
    path = options.results / "tiny" / "rates.json"
    how = {"workers": options.workers, "device": options.device, "progress": True}
    for kind, rate in search_learning_rate(_data(options), path, options.names, **how).items():
        print(f"{kind:14} {rate:g}")


def _make(options) -> int:
    from fpputil.experiments.registry import experiments
    from fpputil.experiments.runs import make_run
    from fpputil.learning.devices import use_threads

    use_threads(options.threads)
    known = list(experiments(options.preset))
    if wrong := [name for name in options.names if name not in (*known, "all")]:
        raise ValueError(f"run {wrong[0]!r} given; the runs are all, {', '.join(known)}")
    names = known if "all" in options.names else options.names
    how = {"workers": options.workers, "device": options.device, "progress": True}
    elsewhere, failed = [], []

    def make(name, wait):
        try:
            where = (_data(options), options.work, options.results, wait)
            run = make_run(name, options.preset, *where, **how)
        except BlockingIOError as error:
            elsewhere.append(name)
            print(error)
        except FloatingPointError as error:
            failed.append(name)
            print(f"{name}: {error}")
        else:
            print(f"{name:24} MAE {run.test.measures['mae_rad']:.4f} rad")

    for name in names:
        make(name, wait=False)
    for name in list(elsewhere):  # by now others have made them, or have been stopped
        make(name, wait=True)
    return 1 if failed else 0


def _print_table(options) -> None:
    from fpputil.experiments.runs import load
    from fpputil.experiments.tables import agreement

    number = int(options.number) if options.number.isdecimal() else options.number
    results = load(options.preset, options.results)
    rows = results.rows(number)
    if not rows:
        raise ValueError(
            f"no run of table {number} is finished in {options.results / options.preset}; make "
            f"them: fpp results run all --preset {options.preset}"
        )
    if results.seeded is not results.runs:
        print("one seed each; how far another moves a measure is taken from tiny")
    print(results.table(number))
    if any(row.difference for row in rows.values()):
        print(results.differences(number))
    else:
        print("no MAE above or below SFNet's: SFNet is not made yet, or nothing beside it")
    if number == 6 and len(rows) > 2:
        print("Kendall's tau with the paper {:.2f}, p = {:.2f}".format(*agreement(rows.values())))
