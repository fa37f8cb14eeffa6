"""What a cell hands to the page."""

import pytest
from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output
from myst_nb import glue

from fpputil.notebook import claim, say


def published(act) -> list[tuple]:
    """Data and metadata of what is displayed meanwhile."""
    InteractiveShell.instance()
    with capture_output() as captured:
        act()
    return [(output.data, output.metadata) for output in captured.outputs]


def test_said_as_glued():
    """The pages read it by `myst_nb`, which `say` does without for its seconds of import."""
    glued = published(lambda: glue("ch1-so-much", "it's 3 µm", display=False))
    assert glued and published(lambda: say("ch1", so_much="it's 3 µm")) == glued


def test_only_text_is_said():
    with pytest.raises(TypeError, match="rate 0.5 given"):
        say("ch1", rate=0.5)


@pytest.mark.parametrize("holds, printed", [(True, ""), (False, "Note: the text says that x;")])
def test_claims_are_quiet_while_they_hold(holds, printed, capsys):
    claim(holds, "x")
    out = capsys.readouterr().out
    assert out.startswith(printed) and bool(out) == bool(printed)
