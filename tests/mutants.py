"""Break the package in small ways, one at a time, and see whether its tests notice.

    python tests/mutants.py [--seed 0] [--count 80] [--modules matching/costs ...] [--jobs 1]
    python tests/mutants.py --only 12

A mutant has one operator, constant, condition, function, slice or statement changed. So many of
them are drawn evenly over the modules. Each is put into a copy of the package, and the tests that
concern its module run on it in a process of their own, up to the first that fails: a table says
which one that was, or that the mutant survived. A hang counts as killed. ``--only`` shows what one
mutant of the table changes, and what the tests say. ``EQUIVALENT`` names mutants that change
nothing a user could see, and why; they are not run.

Eighty mutants take 10 minutes. The last ones, with seed 0: 12 of 80 equivalent; of the other 68,
66 were killed. Two survived, for which there are tests now: a model of two performances, and the
name of a performance that several columns tell, in a message. Of 60 with seed 1,
4 are equivalent, 54 were killed, and one showed code that was not needed; what survived is that
refined warps are kept from running beyond the clock, which no test has made them do.
"""

import argparse
import ast
import collections
import concurrent.futures
import copy
import difflib
import itertools
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "sklearn_motionsync"
LIMIT_BYTES = 8 * 2**30
# Of processor time: the tests of a module take up to 150.
LIMIT_SECONDS = 400

# What is broken, and the tests that concern it, the fastest and most telling first; the doctests
# of a module come before them. Modules that are not named have the tests of their folder.
BROKEN = ["model/*", "recognition/*", "gate", "sequences", "matching/*", "metrics/*"]
BROKEN += ["blending", "body/blends", "body/figure", "body/sphere"]
DENSE = ["synchronizers/test_dense.py", "synchronizers/test_accuracy.py"]
METRIC = ["synchronizers/test_metric.py"]
ALONE = ["synchronizers/test_alone_or_together.py"]
KEYFRAMES = ["synchronizers/test_keyframes.py"]
SPACE = ["against_brute_force", "of_long_takes_is_thinned"]
SPACE = [f"display/test_displays.py::test_the_disparity_space_{name}" for name in SPACE]
METRICS = ["metrics/test_*.py"]
INPUT = ["test_bad_inputs.py", "test_sequences.py", "test_contract.py"]
INPUT += ["synchronizers/test_match.py"]
ANY = ["test_properties.py"]
TRELLIS = ["matching/test_trellis.py", *DENSE, *ALONE]
BLENDS = ["body/test_sphere.py", "test_blending.py"]
TESTS = {
    "blending": BLENDS,
    "body/blends": BLENDS,
    "body/figure": BLENDS,
    "body/sphere": BLENDS,
    "model/charts": ["model/test_sampling.py"],
    "model/action_model": ["model/test_[abdlp]*.py", "test_contract.py"],
    "model/judging": ["model/test_likeness.py", "model/test_[abd]*.py"],
    "model/likeness": ["model/test_likeness.py", "model/test_detector.py"],
    "model/manner": ["model/test_detector.py"],
    "model/sampling": ["model/test_sampling.py"],
    "model/stream": ["model/test_partial_fit.py", "model/test_[al]*.py"],
    "model/variation": ["model/test_variation.py", "model/test_bands.py"],
    "model/views": ["model/test_bands.py", "display/test_departing.py", "display/test_displays.py"],
    "model": ["model/test_[abd]*.py"],
    "model/classes": ["recognition/test_classifier.py"],
    "recognition/distances": ["recognition/test_distances.py", "recognition/test_classifier.py"],
    "recognition/regression": ["recognition/test_regression.py", "recognition/test_classifier.py"],
    "recognition": ["recognition/test_classifier.py", "test_contract.py"],
    "gate": INPUT,
    "sequences": INPUT,
    "matching/comparison": ["recognition/test_distances.py", "recognition/test_classifier.py"],
    "matching/consensus": ["matching/test_warps.py", *DENSE, "matching/test_median.py"],
    "matching/costs": ["matching/test_costs.py", *DENSE, "matching/test_trellis.py"],
    "matching/holdout": ["matching/test_holdout.py", *DENSE],
    "matching/refinement": ["matching/test_holdout.py", *DENSE, *ANY],
    "matching/units": ["matching/test_units.py", *ANY, *DENSE],
    "matching/filters": ["matching/test_costs.py", *DENSE, *KEYFRAMES],
    "matching/keyframes": [*KEYFRAMES, *ANY, "test_contract.py"],
    "matching/median": ["matching/test_median.py", "matching/test_median_doubt.py", *DENSE],
    "matching/narrow": TRELLIS,
    "matching/paired": ["matching/test_median_doubt.py", "matching/test_median.py"],
    "matching/factors": TRELLIS,
    "matching/rows": TRELLIS,
    "matching/running": ["matching/test_running.py", "live/test_online.py"],
    "matching/causal": ["matching/test_causal.py", "live/test_online.py"],
    "matching/trellis": TRELLIS,
    "matching/learning": ["matching/test_learning.py", *METRIC],
    "matching/matcher": [*DENSE, *SPACE, *ALONE, *METRIC],
    "matching/metric": ["matching/test_learning.py", *METRIC],
    "matching/warper": [*DENSE, *SPACE, *ALONE],
    "matching/warps": [
        "matching/test_warps.py",
        "synchronizers/test_match.py",
        *DENSE,
        *METRICS,
        *KEYFRAMES,
    ],
    "matching": DENSE,
    "metrics": METRICS,
}

SIZE = "a size of work or memory: results do not depend on it"
# (module, what stood there, or the change as the table prints it): why nobody could tell.
EQUIVALENT = {
    (
        "gate",
        "array.dtype.itemsize > out.dtype.itemsize -> array.dtype.itemsize >= out.dtype.itemsize",
    ): "numbers of one size are never too large",
    (
        "matching/consensus",
        "(np.arange(count) + 0.5) / max(count, 1) -> (np.arange(count) + 0.5) / max(count, 0)",
    ): "divides an empty array",
    (
        "matching/comparison",
        "np.ptp(scaled, axis=1, keepdims=True) <= _STILL * size -> "
        "np.ptp(scaled, axis=1, keepdims=True) < _STILL * size",
    ): "differs where all is 0 only",
    (
        "recognition/kernel",
        "max(1.0, np.abs(self._centre).max() / self._unit) -> "
        "max(2.0, np.abs(self._centre).max() / self._unit)",
    ): "how much may be rounding",
    ("matching/filters", "_WIDE = 10"): "either filter gives the same but for rounding",
    ("matching/filters", "get_config()['working_memory'] * 2 ** 20"): SIZE,
    ("matching/filters", "get_config()['working_memory'] * 2 ** 20 / 6"): SIZE,
    ("matching/filters", "beyond > 0 -> beyond > -1"): "pads by nothing",
    ("matching/filters", "next_fast_len(sequences.shape[1] + 2 * margin, real=True)"): SIZE,
    ("matching/learning", "return 1.0 -> return 2.0"): "of both blocks, whose ratio counts",
    ("matching/keyframes", "np.zeros(len(peaks)) -> np.ones(len(peaks))"): "every way pays it",
    (
        "matching/keyframes",
        "[[True], smallest[1:] < smallest[:-1]] -> [[False], smallest[1:] < smallest[:-1]]",
    ): "the first index is 0 either way",
    ("model/departures", "(performance[0], feature[0], peak)"): "both edges of a run say the same",
    (
        "model/likeness",
        "np.abs(performances).max -> np.abs(performances).min",
    ): "how much may be rounding",
    (
        "model/likeness",
        "np.ldexp(1.0, -int(np.frexp(largest)[1])) -> np.ldexp(2.0, -int(np.frexp(largest)[1]))",
    ): "any power of two will do",
    (
        "model/manner",
        "np.square(on_clock - on_clock.mean(axis=(0, 1))) -> on_clock - on_clock.mean(axis=(0, 1))",
    ): "how little is no movement",
    ("matching/narrow", "NARROW_BYTES = (1300000, 3000000)"): SIZE,
    ("matching/narrow", "_MOST_BYTES = 15000000"): SIZE,
    ("matching/narrow", "_FEW_PAIRS = 4"): SIZE,
    ("matching/narrow", "pairs <= _FEW_PAIRS"): "both ways back find the same",
    ("matching/refinement", "np.arange(-reach, reach + 1) -> np.arange(-reach, reach)"): (
        "four standard deviations away"
    ),
    ("matching/rows", "PRODUCT_ROWS = 16"): SIZE,
    ("matching/rows", "self.n_bases == 1 -> self.n_bases != 1"): "a product a sample does, too",
    ("matching/rows", "(stop - 1) * sub -> stop * sub"): "a block longer than needed",
    ("matching/rows", "(stop - 1) * sub -> (stop - 0) * sub"): "a block longer than needed",
    ("matching/rows", "(stop - 1) * sub -> (stop + 1) * sub"): "a block longer than needed",
    ("matching/factors", "slice(0, len(self))"): "all of them, put together again",
    ("matching/consensus", "offsets[:, [0, -1]] -> offsets[:-1, [0, -1]]"): "0 but for rounding",
    ("metrics/arguments", "_ROUNDING = 1e-09 -> _ROUNDING = 2e-09"): "how much may be rounding",
    ("metrics/spread", "centred.shape[1] -> centred.shape[0]"): "how much may be rounding",
    ("matching/trellis", "TILE_PRODUCT = 1000000"): SIZE,
    ("matching/trellis", "TILE_BASES = 48"): SIZE,
    ("matching/trellis", "_SUMMED_AT_ONCE = 32"): SIZE,
    ("matching/trellis", "self._windows = {n_frames: windows} -> pass"): "computes them again",
    ("matching/trellis", "self.scale_by_step != 1 -> self.scale_by_step == 1"): "times 1",
    ("matching/trellis", "self.scale_by_step != 1 -> self.scale_by_step != 2"): "times 1",
    ("matching/trellis", "self.scale_by_step != 1 -> self.scale_by_step != 0"): "times 1",
    ("matching/trellis", "band * (n_features + 2) -> band * (n_features + 3)"): SIZE,
    ("matching/trellis", "moving.shape[1] // self.table.subframes"): SIZE,
    ("matching/warper", "DRAWN_CELLS = 4000000"): SIZE,
    ("matching/matcher", "get_config()['working_memory'] * 2 ** 20"): SIZE,
    ("matching/matcher", "get_config()['working_memory'] * 2 ** 20 // 2"): SIZE,
    ("matching/warps", "_SAMPLED_AT_ONCE = 64"): SIZE,
    (
        "metrics/measures",
        "np.diff(as_times(times)) <= 1e-09 -> np.diff(as_times(times)) < 1e-09",
    ): "no rate is that to the last bit",
    ("metrics/spread", "len(z) * (len(z) - 1)"): "cancels in the ratio",
    (
        "metrics/spread",
        "return correlation[~np.eye(len(centred), dtype=bool)].sum() / pairs -> "
        "return correlation[~np.eye(len(centred), dtype=bool)].sum()",
    ): "cancels in the ratio",
    ("sequences", "max(depths, default=0) -> max(depths, default=1)"): "2 is asked for",
    ("sequences", "max(depths, default=0) -> max(depths, default=-1)"): "2 is asked for",
}

NAMES = [
    ("floor", "ceil"),
    ("min", "max"),
    ("minimum", "maximum"),
    ("argmin", "argmax"),
    ("any", "all"),
    ("zeros", "ones"),
    ("sum", "mean"),
    ("std", "var"),
]
SWAPPED = {a: b for pair in NAMES for a, b in (pair, pair[::-1])} | {"median": "mean"}
# f(x, ...) -> x
UNWRAPPED = {"abs", "sqrt", "square", "log", "float", "int", "sorted", "round", "floor", "ceil"}
UNWRAPPED |= {"minimum", "maximum", "clip"}
COMPARED = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
CALCULATED = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}


# -- what is changed ------------------------------------------------------------------------


def changed(node, **fields):
    """A copy of a node with other fields."""
    other = copy.deepcopy(node)
    for name, value in fields.items():
        setattr(other, name, value)
    return other


def replacements(node):
    """What may stand in the place of a node."""
    match node:
        case ast.Constant(value=bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(value=int() as value):
            yield from (ast.Constant(value + 1), ast.Constant(value - 1))
        case ast.Constant(value=float() as value):
            yield from map(ast.Constant, (value * 2, value / 2) if value else (1.0,))
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield node.operand
        case ast.BinOp() if type(node.op) in CALCULATED:
            yield changed(node, op=CALCULATED[type(node.op)]())
            yield node.left
        case ast.AugAssign():
            yield ast.Pass()
            if type(node.op) in CALCULATED:
                yield changed(node, op=CALCULATED[type(node.op)]())
        case ast.Compare(ops=ops):
            for i, op in enumerate(ops):
                for other in COMPARED[type(op)]:
                    yield changed(node, ops=[*ops[:i], other(), *ops[i + 1 :]])
        case ast.BoolOp(op=op, values=values):
            yield changed(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
            for i in range(len(values)):
                rest = [*values[:i], *values[i + 1 :]]
                yield changed(node, values=rest) if len(rest) > 1 else rest[0]
        case ast.If() | ast.While() | ast.IfExp():
            yield changed(node, test=ast.UnaryOp(ast.Not(), node.test))
        case ast.comprehension(ifs=[_, *_]):
            yield changed(node, ifs=[])
        case ast.Name(id="min" | "max" | "any" | "all" as name):
            yield changed(node, id=SWAPPED[name])
        case ast.Attribute(attr=name) if name in SWAPPED:
            yield changed(node, attr=SWAPPED[name])
        case ast.Call(args=[first, *_]) if called(node) in UNWRAPPED:
            yield first
        case ast.keyword(arg="axis", value=ast.Constant(value=0 | 1 as axis)):
            yield changed(node, value=ast.Constant(1 - axis))
        case ast.keyword(arg="axis", value=ast.Tuple(elts=[first, *_])):
            yield changed(node, value=first)
        case ast.Slice(lower=lower, upper=upper, step=None) if lower is None or upper is None:
            if lower is None:
                yield changed(node, lower=ast.Constant(1))
            if upper is None:
                yield changed(node, upper=ast.Constant(-1))
        case ast.Return(value=ast.BinOp(left=part) | ast.Call(args=[part, *_])):
            yield changed(node, value=part)
        case ast.Return(value=ast.Call(func=ast.Attribute(value=part))):
            yield changed(node, value=part)
        case ast.Raise() | ast.Continue() | ast.Break() | ast.Expr(value=ast.Call()):
            yield ast.Pass()
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield ast.Pass()


def called(call):
    """The last part of the name of what is called."""
    return getattr(call.func, "attr", getattr(call.func, "id", None))


def parts(node):
    """What of a node is looked at: no names of types, no decorators, no messages."""
    for name, value in ast.iter_fields(node):
        passed = name in ("annotation", "returns", "decorator_list", "exc", "op", "ops", "ctx")
        if passed or isinstance(node, (ast.JoinedStr, ast.Import, ast.ImportFrom)):
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST):
                yield part


def walk(node, above=()):
    """Every node that is looked at, with those around it, the nearest first."""
    yield node, above
    for part in parts(node):
        yield from walk(part, (node, *above))


class Mutant:
    """One change of one module.

    Attributes
    ----------
    module : str
        ``matching/costs``.
    line : int
    change : str
        What stood there and what stands there now, as the table prints it.
    """

    def __init__(self, module, tree, node, above, replacement):
        self.module, self.tree, self.node, self.replacement = module, tree, node, replacement
        self.line = next(n.lineno for n in (node, *above) if hasattr(n, "lineno"))
        self.change = self._describe(above)

    def source(self, inside=None):
        """The text of the module, or of one node of it, with the change."""
        return ast.unparse(_Replace(self.node, self.replacement).visit(inside or self.tree))

    def diff(self):
        """The lines that differ."""
        old, new = (text.splitlines() for text in (ast.unparse(self.tree), self.source()))
        return "\n".join(difflib.unified_diff(old, new, "original", "mutant", n=2, lineterm=""))

    def _describe(self, above):
        """As little around the change as tells what it is about."""
        if isinstance(self.node, (ast.If, ast.While)):
            return f"if {ast.unparse(self.node.test)} -> not"
        around = self.node
        for node in above:
            if isinstance(around, ast.stmt) or len(ast.unparse(around)) >= 16:
                break
            if hasattr(node, "body") and not isinstance(node, ast.Lambda):
                break
            around = node
        old, new = ast.unparse(around), self.source(around)
        return " ".join(f"{old} -> {new}".split())


class _Replace(ast.NodeTransformer):
    """A copy of a tree with one node replaced; the tree itself stays as it is."""

    def __init__(self, node, replacement):
        self.node, self.replacement = node, replacement

    def visit(self, node):
        if node is self.node:
            return self.replacement
        fields = {}
        for name, value in ast.iter_fields(node):
            if isinstance(value, list):
                value = [self.visit(v) if isinstance(v, ast.AST) else v for v in value]
            elif isinstance(value, ast.AST):
                value = self.visit(value)
            fields[name] = value
        return ast.copy_location(type(node)(**fields), node)


def mutants_of(module):
    """All mutants of a module, each change once."""
    tree = ast.parse((ROOT / PACKAGE / f"{module}.py").read_text(encoding="utf-8"))
    found = {}
    for node, above in walk(tree):
        for replacement in replacements(node):
            mutant = Mutant(module, tree, node, above, replacement)
            found.setdefault((mutant.line, mutant.change), mutant)
    return list(found.values())


def draw(modules, count, seed):
    """So many mutants, as many of each module as there are."""
    piles = []
    for module in modules:
        pile = mutants_of(module)
        random.Random(f"{seed} {module}").shuffle(pile)
        piles.append(pile)
    turns = itertools.chain.from_iterable(itertools.zip_longest(*piles))
    chosen = list(itertools.islice(filter(None, turns), count))
    return sorted(chosen, key=lambda mutant: (mutant.module, mutant.line))


# -- what the tests say ---------------------------------------------------------------------


def modules():
    """Names of the modules that are broken."""
    folder = ROOT / PACKAGE
    paths = [path for pattern in BROKEN for path in sorted(folder.glob(f"{pattern}.py"))]
    names = [path.relative_to(folder).with_suffix("").as_posix() for path in paths]
    return [name for name in names if not name.endswith("__init__")]


def what_is_asked(module):
    """What pytest is asked to run."""
    tests = [f"{PACKAGE}/{module}.py"]
    for name in TESTS.get(module) or TESTS[module.split("/")[0]]:
        found = sorted((ROOT / "tests").glob(name)) if "*" in name else [ROOT / "tests" / name]
        tests += [path.relative_to(ROOT).as_posix() for path in found]
    return tests


def limit():
    """Bound the memory and the time of a process, whatever else the machine does meanwhile."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_SECONDS, LIMIT_SECONDS))


def run_tests(tests, module=None, source=None):
    """What kills a module of this text, None if nothing does; and all that pytest said."""
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(folder) / "checkout"
        skipped = shutil.ignore_patterns("__pycache__")
        for name in (PACKAGE, "tests"):
            shutil.copytree(ROOT / name, copied / name, ignore=skipped)
        for name in ("conftest.py", "pyproject.toml"):
            shutil.copy(ROOT / name, copied)
        # Where tests look for real motion capture.
        (Path(folder) / "shared").symlink_to((ROOT / ".." / "shared").resolve())
        if source is not None:
            (copied / PACKAGE / f"{module}.py").write_text(source, encoding="utf-8")
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
        process = subprocess.Popen(
            [*command, "--tb=short", *tests],
            cwd=copied,
            env={**os.environ, "PYTHONPATH": str(copied)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=limit if os.name == "posix" else None,
        )
        try:
            said, _ = process.communicate(timeout=4 * LIMIT_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            return "hangs", process.communicate()[0]
    if process.returncode == 0:
        return None, said
    if process.returncode == -signal.SIGXCPU:
        return "hangs", said
    if process.returncode in (4, 5):
        raise RuntimeError(said)
    failed = re.search(r"^(?:FAILED|ERROR) (?:tests/)?(.*?)(?: - .*)?$", said, re.MULTILINE)
    return failed[1] if failed else f"ends with {process.returncode}", said


def main():
    """Print a table, a row a mutant, and what survived."""
    known = modules()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=80)
    parser.add_argument("--modules", nargs="+", choices=known, default=known, metavar="MODULE")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", type=int, metavar="N", help="show the N-th mutant")
    given = parser.parse_args()
    drawn = draw(given.modules, given.count, given.seed)
    if given.only is not None:
        mutant = drawn[given.only - 1]
        print(mutant.module, mutant.line, mutant.change, mutant.diff(), sep="\n", flush=True)
        print(run_tests(what_is_asked(mutant.module), mutant.module, mutant.source())[1])
        return

    def judge(mutant):
        for told in (mutant.change, mutant.change.split(" -> ")[0]):
            if (mutant.module, told) in EQUIVALENT:
                return f"equivalent: {EQUIVALENT[mutant.module, told]}"
        killer, _ = run_tests(what_is_asked(mutant.module), mutant.module, mutant.source())
        return f"killed: {killer}" if killer else "survived"

    # Every test once, each where it comes first.
    tests = list(dict.fromkeys(name for m in given.modules for name in what_is_asked(m)))
    killer, said = run_tests(tests)
    if killer:
        sys.exit(f"{said}\nThe package as it is fails: {killer}. No mutant can be judged.")
    begin, verdicts = time.perf_counter(), collections.Counter()
    print("| | module | line | change | verdict |\n|---|---|---|---|---|")
    with concurrent.futures.ThreadPoolExecutor(given.jobs) as jobs:
        for number, (mutant, verdict) in enumerate(
            zip(drawn, jobs.map(judge, drawn), strict=True), 1
        ):
            verdicts[verdict.split(":")[0]] += 1
            row = number, mutant.module, mutant.line, f"`{mutant.change}`", verdict
            print("|", " | ".join(map(str, row)), "|", flush=True)
    gone = EQUIVALENT.keys() - {
        (module, told)
        for module in known
        for mutant in mutants_of(module)
        for told in (mutant.change, mutant.change.split(" -> ")[0])
    }
    if gone:
        print("\nNo mutants any more, take them out of EQUIVALENT:", *sorted(gone), sep="\n")
    real = verdicts["killed"] + verdicts["survived"]
    print(
        f"\n{len(drawn)} mutants of {len(given.modules)} modules, {verdicts['equivalent']} of them "
        f"equivalent; of the other {real}, {verdicts['killed']} were killed and "
        f"{verdicts['survived']} survived ({verdicts['survived'] / max(real, 1):.1%}), "
        f"in {(time.perf_counter() - begin) / 60:.0f} minutes."
    )


if __name__ == "__main__":
    main()
