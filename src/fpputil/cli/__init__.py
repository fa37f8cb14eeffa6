"""The command `fpp`: what the library does, from a terminal (chapters 7 to 12)."""

from __future__ import annotations

import argparse
import errno
import os
import signal
import sys

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
from fpputil.signals import answered

EPILOG = """exit codes: 0 done, 1 something is wrong with what was given or found, 2 wrong usage,
130 stopped by Ctrl-C or SIGTERM"""


def main(argv: list[str] | None = None) -> int:
    """Run `fpp` with arguments, by default those of the process; returns the exit code."""
    options = _parser().parse_args(argv)
    try:
        with answered(signal.default_int_handler, signal.SIGTERM):  # which then cleans up, too
            return options.run(options) or 0
    except KeyboardInterrupt:
        print(f"\nstopped; {options.go_on}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever reads the output has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        keeps = f"; what is finished stays, {options.go_on}" if full else ""
        print(f"fpp: {error}{keeps}", file=sys.stderr)
        return 1
    except (ValueError, RuntimeError, ImportError, FloatingPointError) as error:
        print(f"fpp: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("fpp", description=__doc__, epilog=EPILOG)
    parser.set_defaults(go_on="the same command goes on from here")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for part in (
        patterns,
        render,
        decode,
        calibrate,
        system,
        dataset,
        train,
        evaluate,
        predict,
        results,
    ):
        part.add_to(commands)
    return parser
