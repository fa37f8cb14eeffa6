"""The command `fpp`: what the library does, from a terminal (chapters 7 to 12)."""

import errno
import os
import signal
import sys
from importlib.metadata import version
from io import TextIOWrapper

from cyclopts import App, CycloptsError, Parameter

from fpputil.cli import (
    calibrate,
    dataset,
    decode,
    evaluate,
    patterns,
    predict,
    render,
    results,
    system,
    train,
)

EPILOG = (
    "exit codes: 0 done, 1 something is wrong with what was given or found, 2 wrong usage, 130 "
    "stopped by Ctrl-C or SIGTERM"
)
WRITERS = ("patterns", "render", "decode", "calibrate", "predict")
GO_ON = dict.fromkeys(WRITERS, "nothing was written") | {
    "train": "the same command with --resume goes on from here",
    "evaluate": "no numbers were kept",
}
EXTRA = ("torch", "zarr", "numcodecs", "filelock", "safetensors")

LAST = Parameter(negative=(), allow_repeating=True)  # of an option given twice the last one counts
HOW = {"help_format": "plaintext", "default_parameter": LAST}


def _version() -> str:
    return f"fpp {version('fpputil')}"


app = App("fpp", help=__doc__, help_epilogue=EPILOG, version=_version, **HOW)
app.version_flags = ("--version",)
for command in (
    *(patterns.patterns, render.render, decode.decode, calibrate.calibrate),
    *(train.train, evaluate.evaluate, predict.predict),
):
    app.command(command, help_format="markdown")
for group in (system.app, dataset.app, results.app):
    app.command(group)


def main(argv: list[str] | None = None) -> int:
    """Run `fpp` with arguments, by default those of the process; returns the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    go_on = GO_ON.get(next(iter(argv), ""), "the same command goes on from here")
    _open_streams()
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # which cleans up, too
    try:
        command, bound, _ = app.parse_args(argv, exit_on_error=False, print_error=False)
        if command == app.help_print and not {"--help", "-h"} & set(argv):
            lists = f"fpp {' '.join([*argv, '--help'])} lists them"
            raise SystemExit(_failed(f"a command is needed; {lists}", 2))
        code = command(*bound.args, **bound.kwargs) or 0
        sys.stdout.flush()
        return code
    except CycloptsError as error:
        raise SystemExit(_failed(error, 2)) from None
    except KeyboardInterrupt:
        _say(f"\nstopped; {go_on}")
        return 130
    except BrokenPipeError:  # whoever reads the output has enough
        _throw_away(sys.stdout)
        return 1
    except OSError as error:
        if _is_deaf():
            return _failed(f"{error}, printing; files that were written are whole")
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        return _failed(f"{error}; what is finished stays, {go_on}" if full else error)
    except MemoryError as error:
        return _failed(f"memory is too small{f' ({error})' if str(error) else ''}; {go_on}")
    except (ValueError, RuntimeError, ImportError, FloatingPointError) as error:
        lacks = isinstance(error, ModuleNotFoundError) and error.name in EXTRA
        needed = "is needed and not here: pip install 'fpputil[learning]'"
        return _failed(f"{error.name} {needed}" if lacks else error)
    finally:
        signal.signal(signal.SIGTERM, before)


def _failed(what, code: int = 1) -> int:
    _say(f"fpp: {what}")
    return code


def _say(line: str) -> None:
    try:
        print(line, file=sys.stderr, flush=True)
    except OSError:  # a terminal that is gone
        _throw_away(sys.stderr)


def _throw_away(stream) -> None:
    """Send what a stream still holds, and what comes, to nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _open_streams() -> None:
    """Streams that were closed lead nowhere, lest a file that is opened next takes their place."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # which takes the least free number
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8"))
    if isinstance(sys.stdout, TextIOWrapper):  # names in letters that the terminal lacks
        sys.stdout.reconfigure(errors="backslashreplace")


def _is_deaf() -> bool:
    """Whether standard output takes not even a line more; what else comes is thrown away then."""
    try:
        print(flush=True)
    except OSError:
        _throw_away(sys.stdout)
        return True
    return False
