"""Batches: every item once an epoch, dealt out the same to however many processes."""

import pytest
from torch.utils.data import DataLoader

from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.loaders import Batches, loader_options, spread


def test_batches_of_an_epoch():
    """Every image at most once, the rest at the end left over; other orders in other epochs."""
    batches = Batches(16, 5, seed=3)
    assert len(batches) == 3
    first = list(batches)
    assert [len(b) for b in first] == [5, 5, 5]
    assert len(set(sum(first, []))) == 15 and set(sum(first, [])) < set(range(16))
    assert list(batches) == first
    batches.epoch = 1
    assert list(batches) != first
    batches.epoch = 0
    assert list(Batches(16, 5, seed=4)) != first
    assert [sorted(b) for b in Batches(3, 8, seed=0)] == [[0, 1, 2]]
    waited = set()
    for epoch in range(60):
        batches.epoch = epoch
        waited |= set(range(16)) - set(sum(batches, []))
    assert waited == set(range(16))  # no image is left over for ever


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_processes_share_each_batch(ranks):
    whole = list(Batches(23, 8, seed=1))
    parts = [list(Batches(23, 8, 1, rank, ranks)) for rank in range(ranks)]
    for k, batch in enumerate(whole):
        shares = [p[k] for p in parts]
        assert {len(s) for s in shares} == {8 // ranks}
        assert sorted(sum(shares, [])) == sorted(batch)


@pytest.mark.parametrize("number, size, ranks", [(16, 5, 2), (3, 8, 2)])
def test_batches_that_cannot_be_shared(number, size, ranks):
    with pytest.raises(ValueError, match=f"for {ranks} processes given"):
        Batches(number, size, 0, 0, ranks)


def test_loaders(small_set):
    data = SynthFringe(small_set, "training")
    batches = Batches(len(data), 5, seed=3)
    loader = DataLoader(data, batch_sampler=batches, **loader_options(0))
    seen = [b["index"].tolist() for b in loader]
    assert seen == [data.indices[b].tolist() for b in batches]
    assert spread(data, 4) == [0, 5, 10, 15] and spread(data, 1) == [0]
    assert spread(range(6), 4) == [0, 2, 3, 5]  # 1.67 and 3.33 in between
    assert spread(data, 16) == spread(data, 99) == list(range(16))
    with pytest.raises(ValueError, match="views 0 given"):
        spread(data, 0)
