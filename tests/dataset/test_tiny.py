"""The dataset that ships with the book: whole, and what its command makes."""

from pathlib import Path

import numpy as np
import pytest

from fpputil.dataset.generation import plan_of, see_model
from fpputil.dataset.layout import SPLITS, put, view_files
from fpputil.dataset.models import seeded_models
from fpputil.dataset.store import Store, check_files, open_store

TINY = Path(__file__).parents[2] / "data" / "tiny"


def test_every_byte_is_as_it_was_written():
    assert check_files(TINY) == []
    assert sum(f.stat().st_size for f in TINY.rglob("*") if f.is_file()) < 8e6


def test_each_split_has_views():
    store = open_store(TINY)
    assert [len(store.indices(s)) for s in SPLITS] == [64, 8, 8, 16]


@pytest.mark.parametrize("number", [0, 7, 23])
def test_the_command_in_the_book_makes_it(number, tmp_path):
    """fpp dataset generate --preset tiny --models 20 --held-out 4 --views 4 data/tiny

    Compared by value: another processor may round a last digit otherwise.
    """
    kept = open_store(TINY)
    plan = plan_of("tiny", *seeded_models(20, 4), 4, 0, 240.0)
    for key in ("settings", "system", "pitches", "models", "frames"):
        assert plan[key] == kept.manifest[key], key
    _, stacks = see_model(plan, plan["models"][number], number, None)
    put(tmp_path, view_files(plan, number, stacks))
    made = Store(tmp_path, kept.manifest)
    for index in range(4 * number, 4 * number + 4):
        a, b = kept.view(index), made.view(index)
        both = a.mask & b.mask
        assert (a.mask != b.mask).sum() <= 3
        for name in ("column", "row", "depth", "shade"):
            difference = np.abs(getattr(a, name) - getattr(b, name))[both]
            assert np.quantile(difference, 0.99) < 2e-3, name
