"""Mutation testing: single faults in lines that compute, and whether the fast tests notice.

``make mutants`` runs this in an environment of its own, which makes the mutants; `--python` names
the interpreter that runs the tests, in a copy of the tree. Verdicts are kept, so that a run goes on
where the last one ended. Mutants that change nothing a test could see stand, with the reason, in
``equivalent.json`` beside this file.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

HERE = Path(__file__).parent
ROOT = HERE.parent
SRC = Path("src/fpputil")
USERS = {  # packages whose tests are run, a package's own first
    "optics": ("optics", "decoding", "calibration", "capture", "cli"),
    "decoding": ("decoding", "capture", "cli"),
    "calibration": ("calibration", "capture", "cli"),
    "capture": ("capture", "cli"),
}
SLOW = {"blender"}  # folders that only slow tests reach
# Left out: operators that need arguments, and those after which numbers raise at once.
SHARP = re.compile(
    r"BinaryOperator_((?!Bit)\w+_(Add|Sub|Mul|Div)|BitAnd_BitOr|BitOr_BitAnd)$"
    r"|UnaryOperator_(Delete|USub_UAdd)|ComparisonOperator(?!\w*_Is)|AddNot"
    r"|Replace(True|False|And|Or)|Break|NumberReplacer|ZeroIteration"
)
OPERATORS = [get_operator(name)() for name in operator_names() if SHARP.search(name)]
COPY = shutil.ignore_patterns(".*", "_build", "__pycache__", "sets", "runs", "chapters")


def silent(source: str) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Spans, (line, column), of annotations, decorators and messages: they compute nothing."""
    for node in ast.walk(ast.parse(source)):
        parts = [getattr(node, name, None) for name in ("annotation", "returns")]
        parts += [node] if isinstance(node, ast.Raise | ast.JoinedStr) else []
        for part in filter(None, [*parts, *getattr(node, "decorator_list", ())]):
            yield (part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)


def lines_of(path: Path) -> dict[int, list]:
    """Of each line that computes, its mutations: (column, operator, which of its occurrences)."""
    source = path.read_text(encoding="utf-8")
    nodes, hidden, lines = list(ast_nodes(get_ast(source))), list(silent(source)), {}
    for operator in OPERATORS:
        places = [start for node in nodes for start, _ in operator.mutation_positions(node)]
        for k, place in enumerate(places):
            if not any(start <= place < end for start, end in hidden):
                lines.setdefault(place[0], []).append((place[1], operator, k))
    return lines


def drawn(number: int, seed: int) -> list[tuple[Path, str, str]]:
    """Mutants (file, changed lines, mutated source), each of another line.

    A line is drawn by a hash of its text, so a change elsewhere leaves the draw as it is.
    """
    places = []
    for path in sorted(p for package in USERS for p in (ROOT / SRC / package).rglob("[!_]*.py")):
        if path.parent.name in SLOW:
            continue
        text = path.read_text(encoding="utf-8").split("\n")
        for line, mutations in lines_of(path).items():
            nth = text[: line - 1].count(text[line - 1])
            rng = random.Random(f"{seed} {path.relative_to(ROOT)} {text[line - 1]} {nth}")
            places.append((rng.random(), path, rng, mutations))
    mutants = []
    for _, path, rng, mutations in sorted(places, key=lambda place: place[0])[:number]:
        column = rng.choice(sorted({column for column, *_ in mutations}))
        _, operator, k = rng.choice([m for m in mutations if m[0] == column])
        source = path.read_text(encoding="utf-8")
        mutant = mutate_code(source, operator, k)
        diff = difflib.ndiff(source.split("\n"), mutant.split("\n"))
        changed = "  ".join(f"{d[0]} {d[1:].strip()}" for d in diff if d[0] in "+-")
        mutants.append((path.relative_to(ROOT), changed, mutant))
    return mutants


def package_of(path: Path) -> str:
    return path.relative_to(SRC).parts[0]


def tests_of(path: Path) -> list[list[str]]:
    """Arguments of pytest, the run most likely to notice first."""
    own, *users = USERS[package_of(path)]
    files = sorted((ROOT / "tests" / own).rglob("test_*.py"), key=lambda f: path.stem not in f.stem)
    own = ["--doctest-modules", str(path), *(str(f.relative_to(ROOT)) for f in files)]
    return [own, [f"tests/{user}" for user in users]] if users else [own]


def passes(python: str, tree: Path, tests: list[str], limit: float | None = None) -> bool:
    """Whether tests pass in a copy of the tree within the limit, seconds."""
    command = [python, "-m", "pytest", "-m", "not slow", "-x", "-q", *tests]
    one = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "NUMBA")}
    env = {**os.environ, **one, "PYTHONPATH": str(tree / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    run = subprocess.Popen(command, cwd=tree, env=env, start_new_session=True, **quiet)
    try:
        return run.wait(limit) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        if run.poll() is None:
            os.killpg(run.pid, signal.SIGKILL)
            run.wait()


def killed(python: str, tree: Path, path: Path, mutant: str, limits: dict[tuple, float]) -> bool:
    """Whether the tests notice the mutant; the first of a package times them without it."""
    for stage, tests in enumerate(tests_of(path)):
        key = (package_of(path), stage)
        if key not in limits:
            start = time.monotonic()
            if not passes(python, tree, tests):
                raise SystemExit(f"the tests {tests} fail without any mutant; mend them first")
            limits[key] = 60 + 4 * (time.monotonic() - start)
        whole = (tree / path).read_bytes()
        (tree / path).write_text(mutant, encoding="utf-8")
        dead = not passes(python, tree, tests, limits[key])
        (tree / path).write_bytes(whole)
        if dead:
            return True
    return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--python", default=str(ROOT / ".venv/bin/python"))
    parser.add_argument("--number", type=int, default=100, help="mutants to draw")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=USERS, nargs="+", default=list(USERS), help="packages")
    parser.add_argument("--again", action="store_true", help="run the survivors again")
    parser.add_argument("--verdicts", type=Path, default=ROOT / "_build/mutants.json")
    options = parser.parse_args()
    equivalent = json.loads((HERE / "equivalent.json").read_text(encoding="utf-8"))
    verdicts = json.loads(options.verdicts.read_text()) if options.verdicts.exists() else {}
    options.verdicts.parent.mkdir(exist_ok=True)
    limits, names = {}, {"killed": [], "survived": [], "equivalent": []}
    with tempfile.TemporaryDirectory(prefix="mutants-") as room:
        tree = shutil.copytree(ROOT, Path(room, "tree"), ignore=COPY)
        for path, changed, mutant in drawn(options.number, options.seed):
            if package_of(path) not in options.only:
                continue
            name, verdict = f"{path}  {changed}", "equivalent"
            if changed not in equivalent.get(str(path), {}):
                verdict = verdicts.get(name)
                if verdict is None or (options.again and verdict == "survived"):
                    dead = killed(options.python, tree, path, mutant, limits)
                    verdict = verdicts[name] = "killed" if dead else "survived"
                    options.verdicts.write_text(json.dumps(verdicts, indent=1), encoding="utf-8")
            names[verdict].append(name)
            print(f"{verdict:10} {name}", flush=True)
    able = len(names["killed"] + names["survived"])
    print(f"\n{len(names['killed'])} of {able} killed, {len(names['equivalent'])} equivalent")
    print("\n".join(["Survivors:", *names["survived"]] if names["survived"] else []))


if __name__ == "__main__":
    main()
