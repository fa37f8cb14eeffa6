"""The log of a run is read as it was written, and nothing else is taken for one."""

import pytest
from matplotlib.figure import Figure

from fpputil.learning.log import plot_log, read_log, write_log


def test_a_log_is_read_as_it_was_written(tmp_path):
    names = ("images", "total", "validation_mae", "validation_order_errors")
    rows = [dict(zip(names, values, strict=True))
            for values in ((16, 0.1 + 0.2, 3.0, 0.5), (32, 1e-9, 1 / 3, 0.0))]  # fmt: skip
    write_log(tmp_path, rows)
    assert read_log(tmp_path / "log.csv") == rows


def test_curves_are_drawn_in_the_units_of_their_titles():
    names = ("images", "total", "validation_mae", "validation_order_errors")
    rows = [dict(zip(names, values, strict=True)) for values in ((16, 2, 3, 0.5), (32, 1, 2, 0.25))]
    axes = Figure().subplots(1, 3)
    plot_log(axes, rows)
    drawn = {ax.get_title(): ax.lines[0].get_xydata().tolist() for ax in axes}
    assert drawn["training loss"] == [[16, 2], [32, 1]]
    assert drawn["validation MAE, rad"] == [[16, 3], [32, 2]]
    assert drawn["wrong orders, %"] == [[16, 50], [32, 25]]


@pytest.mark.parametrize(
    "text", ["", "images,total\n", "a,b\n1,2\n", "images\nmany\n", "images\n1,2\n"]
)
def test_another_table_is_no_log(tmp_path, text):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(ValueError, match=f"{tmp_path / 'log.csv'} is no log of a training run"):
        read_log(tmp_path / "log.csv")
