"""Solvers of `Problem`: least squares if no inequality is active, Clarabel, and SciPy's nnls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.sparse import block_array, coo_array, csr_array, diags_array, vstack

from granular.grain_scale.inference.linear import least_squares
from granular.grain_scale.inference.matrices import rows_of
from granular.grain_scale.inference.problem import Problem, listed
from granular.tools.arrays import Array, IndexArray
from granular.tools.checks import one_of

ADMISSIBLE = 1e-9
"""Largest distance by which a contact may leave its cone, divided by the typical force."""
EXACT = 1e4
"""Weight of rows that must hold exactly, for a solver that is limited to least squares."""
MULTIPLIERS = 6
"""Largest number of multiplier updates that make such rows hold."""
FIRM = 1e4
"""Weight of the balance in the search for grains that cannot be in balance."""
REFUSED = 0.3
"""Grains are named if they are out of balance by this share of the worst."""
DENSE = 400_000_000
"""Largest size of the dense matrices of non-negative least squares [bytes]: about a minute."""


class InferenceError(RuntimeError):
    """There is no solution, because the constraints contradict each other or the solver failed."""


def solve(problem: Problem, solver: str = "auto") -> tuple[Array, str]:
    """Solve a problem; return its unknowns and the name of the method that solved it.

    Parameters
    ----------
    solver : {"auto", "clarabel", "nnls"}
        "auto" first solves the least squares without the inequalities, which is the solution if it
        satisfies them. Otherwise it uses Clarabel, or nnls if Clarabel is missing.

    Raises
    ------
    TypeError, ValueError
        For an unknown solver, or nnls in 3D or for packings that are too large for it.
    ImportError
        If Clarabel is needed and missing.
    InferenceError
        If no forces meet the constraints, or the solver stops before its tolerance.
    """
    one_of("solver", solver, ("auto", *SOLVERS))
    if solver != "auto":
        return SOLVERS[solver](problem), solver
    x = least_squares(problem)
    if x is not None and problem.excess(x).max() <= ADMISSIBLE:
        return x, "least squares"
    try:
        return conic(problem), "clarabel"
    except ImportError:
        if problem.dim == 3 or _dense_bytes(problem) > DENSE:
            raise
    return non_negative(problem), "nnls"


def conic(problem: Problem) -> Array:
    """Solve by the interior-point method of Clarabel, with friction cones in 3D and lines in 2D."""
    try:
        import clarabel
    except ImportError:
        raise ImportError(
            "inference with friction needs Clarabel: pip install 'granular-flow[inference]'"
        ) from None
    soft, target = problem.soft()
    hard, fixed = problem.hard()
    (m, n), h = soft.shape, hard.shape[0]
    lines, cones = _cones(problem)
    # The residuals are additional unknowns, since K'K would square the condition number of K.
    rows = [[soft, -diags_array(np.ones(m))], [-vstack([lines, cones]), None]]
    if h:
        rows.insert(1, [hard, None])
    A = block_array(rows, format="csc")
    b = np.concatenate([target, fixed, np.zeros(lines.shape[0] + cones.shape[0])])
    P = diags_array(np.repeat([2 * problem.regularization**2, 2.0], [n, m]), format="csc")
    kinds = [clarabel.ZeroConeT(m + h), clarabel.NonnegativeConeT(lines.shape[0])]
    kinds += [clarabel.SecondOrderConeT(3)] * (cones.shape[0] // 3)
    solution = clarabel.DefaultSolver(P, np.zeros(n + m), A, b, kinds, _settings()).solve()
    status = str(solution.status)
    if status not in ("Solved", "AlmostSolved"):
        if "Infeasible" in status and np.isinf(problem.weight):
            raise _refusal(problem, conic(problem.replace(weight=FIRM)))
        raise InferenceError(f"Clarabel stopped before its tolerance: {status}")
    return np.array(solution.x)[:n]


def _settings() -> Any:
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    # "Almost solved" is accepted silently, so its tolerances must be tight.
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = settings.reduced_tol_feas = 1e-8
    # Rows of the balance may be linearly dependent, and the factors are then nearly singular. This
    # needs more regularisation, whose effect the iterative refinement removes from the solution.
    settings.static_regularization_constant = 1e-7
    settings.iterative_refinement_max_iter = 50
    settings.iterative_refinement_abstol = settings.iterative_refinement_reltol = 1e-14
    return settings


def _refusal(problem: Problem, x: Array) -> InferenceError:
    """Error that names the grains which the nearest forces leave out of balance."""
    left = problem.balance @ x - problem.balance_target
    size = np.linalg.norm(left.reshape(-1, rows_of(problem.dim)), axis=1)
    return InferenceError(
        "no forces meet the constraints: with this friction and these contacts grains "
        f"{listed(np.flatnonzero(size > REFUSED * size.max()))} cannot be in balance "
        "(mu too small, a contact missing, or masses and gravity wrong)"
    )


def _cones(problem: Problem) -> tuple[csr_array, csr_array]:
    """Rows that must be >= 0, and blocks of three rows of which the first bounds the others."""
    c, n, d = len(problem.mu), problem.frame.shape[1], problem.dim
    slipping = problem.slipping
    rank = np.arange(len(slipping))
    inner = np.isfinite(problem.mu[slipping])
    plain = np.setdiff1d(np.arange(c), slipping[inner])
    lines = [_rows([(plain, 1.0)], n)]
    contact, tangent = slipping[inner], c + (d - 1) * rank[inner]
    mu = problem.mu[contact]
    if d == 2:
        lines += [_rows([(contact, mu), (tangent, sign)], n) for sign in (1.0, -1.0)]
        return vstack(lines, format="csr"), csr_array((0, n))
    first = 3 * np.arange(len(contact))
    rows = np.concatenate([first, first + 1, first + 2])
    columns = np.concatenate([contact, tangent, tangent + 1])
    values = np.concatenate([mu, np.ones(2 * len(contact))])
    return lines[0], coo_array((values, (rows, columns)), (len(rows), n)).tocsr()


def _rows(entries: list[tuple[IndexArray, Array | float]], n: int) -> csr_array:
    """Matrix with a row for each position in the lists and an entry in the column of each list."""
    count = len(entries[0][0])
    rows = np.tile(np.arange(count), len(entries))
    columns = np.concatenate([column for column, _ in entries])
    values = np.concatenate([np.broadcast_to(value, count) for _, value in entries])
    return coo_array((values, (rows, columns)), (count, n)).tocsr()


def _dense_bytes(problem: Problem) -> int:
    columns = problem.frame.shape[1] + len(problem.slipping)
    return 8 * columns * (problem.stress.shape[0] * 2 + problem.frame.shape[1])


def non_negative(problem: Problem) -> Array:
    """Solve in 2D by SciPy's non-negative least squares, with amounts >= 0 of the cones' edges."""
    if problem.dim == 3:
        raise ValueError("solver = 'nnls' must be 'auto' or 'clarabel' in 3D: cones are round")
    if _dense_bytes(problem) > DENSE:
        raise ValueError(
            f"solver = 'nnls' would take {_dense_bytes(problem) / 1e9:.1f} GB and minutes for "
            f"{len(problem.mu)} contacts: pip install 'granular-flow[inference]'"
        )
    edges = _edges(problem)
    soft, target = problem.soft()
    hard, fixed = problem.hard()
    rows, below = [EXACT * hard, soft], [target]
    if problem.regularization:
        rows.append(problem.regularization * diags_array(np.ones(soft.shape[1])))
        below.append(np.zeros(soft.shape[1]))
    matrix = (vstack(rows, format="csr") @ edges).toarray()
    # The residual of the exact rows is added to their right-hand sides, repeatedly.
    wanted = fixed.copy()
    for _ in range(MULTIPLIERS):
        right = np.concatenate([EXACT * wanted, *below])
        try:
            amounts, _ = nnls(matrix, right, maxiter=20 * matrix.shape[1])
        except RuntimeError as error:
            raise InferenceError(f"nnls: {error}") from None
        x = edges @ amounts
        off = fixed - hard @ x
        if abs(off).max(initial=0.0) < ADMISSIBLE:
            return x
        wanted += off
    if abs(off).max() > 1e-3 * max(1.0, abs(fixed).max()):
        raise _refusal(problem, x)
    return x


def _edges(problem: Problem) -> csr_array:
    """Columns that span each cone: (1, +-mu), or (1, 0) without friction; also (0, +-1) for inf."""
    c, mu = len(problem.mu), problem.mu
    slipping = problem.slipping
    tangent = c + np.arange(len(slipping))
    inner = np.isfinite(mu[slipping])
    plain = np.setdiff1d(np.arange(c), slipping[inner])
    columns = problem.frame.shape[1]
    parts = [_rows([(plain, 1.0)], columns)]
    contact = slipping[inner]
    for sign in (1.0, -1.0):
        parts.append(_rows([(contact, 1.0), (tangent[inner], sign * mu[contact])], columns))
        parts.append(_rows([(tangent[~inner], sign)], columns))
    return csr_array(vstack(parts, format="csr").T)


SOLVERS: dict[str, Callable[[Problem], Array]] = {"clarabel": conic, "nnls": non_negative}
