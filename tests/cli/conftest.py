"""The command in this process, and a dataset and weights to try it on."""

from contextlib import contextmanager

import pytest

from fpputil.cli import main


@pytest.fixture
def fpp(capsys):
    """Run `fpp` with some words: its exit code, what it printed, and its errors."""

    def run(*words):
        capsys.readouterr()
        try:
            code = main([*map(str, words)])
        except SystemExit as stop:
            code = stop.code
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def refused(fpp):
    """Run `fpp` with words that it refuses: the error, if it is one line and no traceback."""

    def run(*words, code=1):
        found, _, error = fpp(*words)
        error = error.split("\r")[-1]  # after a bar, if there is one
        lines = [line for line in error.splitlines() if line.strip()]
        assert found == code and lines[-1].startswith("fpp: "), error
        assert not any("Traceback" in line for line in lines), error
        return lines[-1]

    return run


@contextmanager
def _quick():
    """One thread; no drawing, which takes longer than a small epoch."""
    import torch
    from matplotlib.figure import Figure

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Figure, "savefig", lambda self, file, **_: file.write(b"no picture"))
        yield
    torch.set_num_threads(before)


@pytest.fixture
def quick():
    """One thread and no drawing in a test."""
    with _quick():
        yield


SMALL = (
    *("--epochs", 1, "--batch", 4, "--base", 2, "--levels", 2, "--validation-views", 2),
    *("--precision", "float32", "--threads", 1, "--workers", 0),
)


@pytest.fixture
def train(fpp, data, quick):
    """`fpp train` of a small network for an epoch."""

    def run(out, *options, method="sfnet", data=data, how=fpp):
        return how("train", method, "--data", data, "--out", out, *SMALL, *options)

    return run


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    """Ten models, one held out, a view of each."""
    from fpputil.dataset.generation import generate
    from fpputil.dataset.models import seeded_models

    out = tmp_path_factory.mktemp("cli") / "set"
    generate(out, "tiny", *seeded_models(10, 1), views=1)
    return out


@pytest.fixture(scope="session")
def weights(data, tmp_path_factory):
    """What `fpp train` leaves behind."""
    out = tmp_path_factory.mktemp("run")
    words = ["train", "sfnet", "--data", str(data), "--out", str(out), *map(str, SMALL)]
    with _quick():
        assert main(words) == 0
    return out / "weights.safetensors"
