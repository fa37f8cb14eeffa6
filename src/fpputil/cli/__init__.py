"""The command `fpp`: what the library does, from a terminal (chapters 7 to 12)."""

from __future__ import annotations

import errno
import os
import signal
import sys

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

app = App(
    "fpp",
    help=__doc__,
    help_epilogue=EPILOG,
    help_format="plaintext",
    version_flags=(),
    default_parameter=Parameter(negative=(), allow_repeating=True),  # the last one counts
)
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
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # which cleans up, too
    try:
        command, bound, _ = app.parse_args(argv, exit_on_error=False, print_error=False)
        if command == app.help_print and not {"--help", "-h"} & set(argv):
            _wrong_usage(f"a command is needed; fpp {' '.join([*argv, '--help'])} lists them")
        return command(*bound.args, **bound.kwargs) or 0
    except CycloptsError as error:
        _wrong_usage(error)
    except KeyboardInterrupt:
        print(f"\nstopped; {go_on}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever reads the output has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        return _failed(f"{error}; what is finished stays, {go_on}" if full else error)
    except ModuleNotFoundError as error:
        if error.name not in EXTRA:
            return _failed(error)
        return _failed(f"{error.name} is needed and not here: pip install 'fpputil[learning]'")
    except (ValueError, RuntimeError, ImportError, FloatingPointError) as error:
        return _failed(error)
    finally:
        signal.signal(signal.SIGTERM, before)


def _failed(what) -> int:
    print(f"fpp: {what}", file=sys.stderr)
    return 1


def _wrong_usage(what) -> None:
    print(f"fpp: {what}", file=sys.stderr)
    raise SystemExit(2)
