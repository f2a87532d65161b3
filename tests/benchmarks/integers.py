"""Microseconds per integer least-squares problem, against RTKLIB's C on the same problems.

Both are called from one compiled loop, so neither pays for Python; the notes say what a call from
Python takes. RTKLIB stops after 10,000 nodes, and the notes say how often it did; the row of weak
problems counts nothing else.
"""

import ctypes
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numba import njit

from fgnav.checks import FloatArray
from fgnav.integers.array.search import search_constrained
from fgnav.integers.ils import search as ils
from fgnav.integers.ils.affine import search_array
from fgnav.integers.resolvers.constrained import Constrained
from tests.benchmarks._rows import Row, row, timed
from tests.integers.arrays import L1_M, float_solution, make, sky

SIZES = {"lambda_n5": 1, "lambda_n10": 2, "lambda_n20": 4}
NAMES = (
    *SIZES,
    "lambda_n35",
    "lambda_n35_weak",
    "lambda_array_epoch",
    "constrained_batch",
    "constrained_single",
)
PROBLEMS, REPEATS, WEAK, NODES = 300, 10, 100, 10**6


def run() -> list[Row]:
    """Time ours and RTKLIB's search."""
    rng = np.random.default_rng(35)
    rtklib = _rtklib()
    rows = []
    for name, b in SIZES.items():
        problems = [baselines_problem(rng, b) for _ in range(PROBLEMS)]
        rows.append(_against(rtklib, name, problems, "free"))
    of_array = array_search(rng)
    rows += [of_array, *_epochs(of_array)]
    return [*rows, _weak(rtklib, rng)]


def array_search(rng: np.random.Generator) -> Row:
    """Return the row of 35 integers under the affine array model."""
    differences = make(rng, epochs=PROBLEMS, code_m=0.3, sine=True).differences
    problems = [float_solution(differences, k) for k in range(PROBLEMS)]
    return _against(_rtklib(), "lambda_n35", problems, "affine array model")


def baselines_problem(rng: np.random.Generator, b: int) -> tuple[FloatArray, FloatArray]:
    """Return float cycles and covariance of b unknown baselines to 6 satellites of one epoch."""
    code_m, phase_m = rng.choice([0.1, 0.3]), rng.choice([0.002, 0.003])
    e_n, elevation = sky(rng, 1, 6)
    D = e_n[0, :1] - e_n[0, 1:]
    zenith = 1.0 / np.sin(elevation[0]) ** 2
    C = np.kron(np.eye(b) + 1.0, np.diag(zenith[1:]) + zenith[0])
    A = np.kron(np.eye(b), D)
    Q = phase_m**2 * C + A @ np.linalg.inv(A.T @ np.linalg.solve(code_m**2 * C, A)) @ A.T
    Q = (Q + Q.T) / (2 * L1_M**2)
    noise = np.linalg.cholesky(Q) @ rng.normal(size=len(Q))
    return rng.integers(-200, 200, len(Q)) + noise, Q


def _rtklib() -> Any:
    spec = find_spec("pyrtklib5")
    folder = Path(str(spec.origin)).parent if spec else Path()
    function = getattr(ctypes.CDLL(str(next(folder.glob("pyrtklib5*.so")))), "lambda")
    function.argtypes = [ctypes.c_int, ctypes.c_int, *[ctypes.c_void_p] * 4]
    function.restype = ctypes.c_int
    return function


def _loops(rtklib: Any) -> tuple[Callable[..., Any], Callable[..., Any]]:
    @njit  # type: ignore[misc, unused-ignore]
    def ours(a: Any, Q: Any, integers: Any, norms: Any) -> int:
        unsolved = 0
        for k in range(len(a)):
            status, integers[k], norms[k] = ils.solve(a[k], Q[k], 2, ils.WITHOUT_LIMIT)
            unsolved += status != ils.OK
        return unsolved

    @njit  # type: ignore[misc, unused-ignore]
    def peer(a: Any, Q: Any, integers: Any, norms: Any) -> int:
        unsolved = 0
        for k in range(len(a)):
            out = (integers[k].ctypes, norms[k].ctypes)
            unsolved += rtklib(a.shape[1], 2, a[k].ctypes, Q[k].ctypes, out[0], out[1]) != 0
        return unsolved

    return ours, peer


def _against(
    rtklib: Any,
    name: str,
    problems: list[tuple[FloatArray, FloatArray]],
    model: str,
) -> Row:
    a, Q = (np.array(part) for part in zip(*problems, strict=True))
    found = np.zeros((len(a), 2, a.shape[1])), np.zeros((len(a), 2))
    theirs = np.zeros((len(a), 2, a.shape[1])), np.zeros((len(a), 2))
    ours, peer = _loops(rtklib)
    gave_up = peer(a, Q, *theirs)
    ours(a, Q, *found)
    same = np.isclose(found[1][:, 0], theirs[1][:, 0], rtol=1e-6).sum()
    ours_us, peer_us = _interleaved_us(lambda: ours(a, Q, *found), lambda: peer(a, Q, *theirs))
    z, s, n = theirs[0][0], theirs[1][0], a.shape[1]
    pointers = [x.ctypes.data for x in (a[0], Q[0], z, s)]
    call_us, ctypes_us = _interleaved_us(
        lambda: [ils.integer_least_squares(a[0], Q[0]) for _ in range(PROBLEMS)],
        lambda: [rtklib(n, 2, *pointers) for _ in range(PROBLEMS)],
    )
    note = (
        f"{model}, {len(a)} problems, same best norm in {same}, RTKLIB gave up on {gave_up}; "
        f"one call from Python {call_us:.1f}, RTKLIB through ctypes {ctypes_us:.1f}"
    )
    return row(name, ours_us, peer_us, "us", note, less=True)


def _interleaved_us(*works: Callable[[], object]) -> FloatArray:
    """Return microseconds per problem of each, the best of runs that take turns."""
    return timed(works, REPEATS).min(axis=0) / PROBLEMS * 1e6


def _weak(rtklib: Any, rng: np.random.Generator) -> Row:
    """Count the searches given up of seven baselines whose code says little of 35 integers."""
    problems = [baselines_problem(rng, 7) for _ in range(WEAK)]
    a, Q = (np.array(part) for part in zip(*problems, strict=True))
    found = np.zeros((len(a), 2, a.shape[1])), np.zeros((len(a), 2))
    ours, peer = _loops(rtklib)
    ours(a[:1], Q[:1], *found)
    start = perf_counter()
    unsolved = ours(a, Q, *found)
    each_us = (perf_counter() - start) / len(a) * 1e6
    gave_up = peer(a, Q, *found)
    note = f"searches given up of {len(a)}, seven free baselines; ours takes {each_us:.0f} us each"
    return row("lambda_n35_weak", unsolved, gave_up, "count", note, less=True)


def _epochs(peer: Row) -> list[Row]:
    """Time whole epochs of the paper's array, against RTKLIB's search of as many integers."""
    many = make(np.random.default_rng(2), epochs=PROBLEMS, code_m=0.3, sine=True).differences
    one = make(np.random.default_rng(3), epochs=1, code_m=0.3, sine=True)
    works = {
        "lambda_array_epoch": (lambda: search_array(many, joint=True), "float solution, search"),
        "constrained_batch": (lambda: search_constrained(many, NODES), "constrained search"),
        "constrained_single": (
            lambda: [Constrained()(one.differences, one.flight) for _ in range(PROBLEMS)],
            "one at a time: noise, constrained search, chance of being wrong, chi-square",
        ),
    }
    times_us = _interleaved_us(*(work for work, _ in works.values()))
    return [
        row(name, ours_us, peer["peer"], "us", f"8 antennas, 6 satellites; {what}", less=True)
        for (name, (_, what)), ours_us in zip(works.items(), times_us, strict=True)
    ]
