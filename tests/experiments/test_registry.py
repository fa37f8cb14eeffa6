"""Rows of the tables: each is a run, and differs from the others in what it says."""

from dataclasses import replace

from fpputil.experiments import registry as experiments
from fpputil.experiments.registry import methods
from fpputil.experiments.rows import ROWS, SEEDS, seeded_name


def test_every_row_is_a_run_and_sixteen_are_distinct():
    for preset in ("tiny", "small", "paper"):
        known = experiments.experiments(preset)
        rows = [name for number in (3, 4, 5, 6) for name in ROWS[number].values()]
        assert len(rows) == 19 and len(set(rows)) == 16
        for name in (*rows, *ROWS["ours"].values()):
            assert {known[seeded_name(name, s)].seed for s in SEEDS.get(name, (0,))} == set(
                SEEDS.get(name, (0,))
            )
        assert len(known) == 16 + 15 + 2 * 10
        made = [one.method for one in known.values() if not one.seed]
        assert all(made.count(method) == 1 for method in made)  # no row is another by mistake


def test_each_row_differs_from_sfnet_in_what_it_says():
    known = methods("tiny")
    sfnet = known["sfnet"]
    assert known["sfnet-b"] == replace(
        sfnet, weights=replace(sfnet.weights, consistency=0, geometric=0)
    )
    assert known["sfnet-a"] == replace(known["sfnet-b"], mixing="none")
    assert known["sfnet-1e-3-1e-5"].weights == replace(
        sfnet.weights, consistency=1e-3, geometric=1e-5
    )
    assert (sfnet.weights.consistency, sfnet.weights.geometric) == (1e-2, 1e-6)
    assert known["sfnet-3-frames"] == replace(sfnet, frames=3)
    assert known["dlalnet"].weights is None
    assert known["dlalnet-losses"].weights == replace(sfnet.weights, mean=True)
