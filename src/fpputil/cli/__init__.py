"""The command `fpp`: what the library does, from a terminal (chapters 7 to 12)."""

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

LAST = Parameter(negative=(), allow_repeating=True)  # of an option given twice the last one counts
HOW = {"help_format": "plaintext", "version_flags": (), "default_parameter": LAST}

app = App("fpp", help=__doc__, help_epilogue=EPILOG, **HOW)
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
            lists = f"fpp {' '.join([*argv, '--help'])} lists them"
            raise SystemExit(_failed(f"a command is needed; {lists}", 2))
        return command(*bound.args, **bound.kwargs) or 0
    except CycloptsError as error:
        raise SystemExit(_failed(error, 2)) from None
    except KeyboardInterrupt:
        print(f"\nstopped; {go_on}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever reads the output has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        return _failed(f"{error}; what is finished stays, {go_on}" if full else error)
    except (ValueError, RuntimeError, ImportError, FloatingPointError) as error:
        lacks = isinstance(error, ModuleNotFoundError) and error.name in EXTRA
        needed = "is needed and not here: pip install 'fpputil[learning]'"
        return _failed(f"{error.name} {needed}" if lacks else error)
    finally:
        signal.signal(signal.SIGTERM, before)


def _failed(what, code: int = 1) -> int:
    print(f"fpp: {what}", file=sys.stderr)
    return code
