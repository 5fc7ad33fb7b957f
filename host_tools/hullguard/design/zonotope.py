"""Tables of the zonotope threshold; platoon, sections 5 and 8.

With the generator as the ECU runs it, z(k+1) = Gr z + Er v, r = Fr z + Dr v, and e = T x - z,

    e(k+1) = Gr e + Bd d - Er ev + ..        r = -Fr e + Dd d + Dr ev + ..

a transform Y of few digits, e~ = Y e, makes Y Gr Y^-1 block diagonal but for what rounding leaves; Lam are its blocks in float32. Nothing
here has to be exact: what the stored numbers miss is computed from them and bounded (`growth`, `output_growth`), as shares of the sum of all
magnitudes in the set. Rows are scaled by powers of 2 so that the set is of size 1 in each block at the usual radii.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from hullguard.design import hull
from hullguard.design.arith import U32, digits, gamma32, mul, nearest32, row_sums, share32, up32
from hullguard.design.observer import SubPlant
from hullguard.design.tables import rows
from hullguard.design.zonotope_table import BOX, TRUNCATE, ZonotopeTable
from hullguard.errors import InputError
from hullguard.model.table import Array

CONDITION_MAX = 1e5  # of eigenvectors of length 1: beyond, poles count as defective
START_DIGITS = 6  # of the transform that the solver leaves: few, so that every processor starts from the same numbers
REFINEMENTS = 3  # each squares the error of the transform
U64 = 2.0**-53
HEALED = 1e-6  # of a set of size 1: what an overflow may leave behind when it is forgotten
SHARE_MAX = 0.1  # of the threshold: what rounding may add to it
LARGEST = np.log(np.finfo(np.float64).max)  # radii of either number type
NEVER = 65535


@dataclass(frozen=True)
class Modal:
    """e~ = transform e; transform G inverse is block diagonal, nearly."""

    transform: Array  # order x order
    inverse: Array  # order x order
    miss: Array  # order x order: |transform^-1 - inverse|
    block: tuple[int, ...]
    discs: bool  # blocks of two rows are pairs of poles, and bounded by a disc; everything else by an interval a row


def _solve(a: Array, b: Array) -> Array:
    """A^-1 B by elimination with pivots, in a stated order; infinite where A is singular."""
    n = len(a)
    work = np.hstack([a, b])
    for i in range(n):
        pivot = i + int(np.argmax(np.abs(work[i:, i])))
        if work[pivot, i] == 0.0:
            return np.full(b.shape, np.inf)
        work[[i, pivot]] = work[[pivot, i]]
        work[i] = work[i] / work[i, i]
        for j in range(n):
            if j != i:
                work[j] = work[j] - work[j, i] * work[i]
    return work[:, n:]


def _places(block: tuple[int, ...]) -> list[slice]:
    """Rows of each block."""
    ends = np.cumsum(block)
    return [slice(int(e) - b, int(e)) for b, e in zip(block, ends, strict=True)]


def _eigenvectors(state: Array) -> tuple[Array, tuple[int, ...]] | None:
    """Real rows Y with Y G = Lam Y, slow poles first; None where there are too few that are independent."""
    values, left = np.linalg.eig(state.T)
    if np.linalg.cond(left) > CONDITION_MAX:
        return None
    found: list[Array] = []
    block: list[int] = []
    for i in sorted(range(len(values)), key=lambda i: (-round(float(abs(values[i])), 9), -round(float(values[i].real), 9), i)):
        if values[i].imag < 0.0:
            continue  # its conjugate stands for both
        w = left[:, i]
        largest = w[int(np.argmax(np.round(np.abs(w), 9)))]
        w = w * (abs(largest) / largest)
        found += [w.real, w.imag] if values[i].imag > 0.0 else [w.real]
        block.append(2 if values[i].imag > 0.0 else 1)
    return np.array(found), tuple(block)


def _contracting(state: Array) -> Array | None:
    """Rows Y in which all of G is one block that shrinks the largest entry: Schur's form M, scaled by x > 0 with |M| x = c (x - 1) < c x."""
    M, U = scipy.linalg.schur(state)
    c = (1 + float(np.abs(np.linalg.eigvals(state)).max())) / 2
    if np.abs(np.linalg.eigvals(np.abs(M))).max() >= c:
        return None  # pairs that turn fast
    x = np.linalg.solve(np.eye(len(M)) - np.abs(M) / c, np.ones(len(M)))
    Y = U.T / x[:, None]
    return np.asarray(Y * np.sign(Y[np.arange(len(Y)), np.argmax(np.round(np.abs(Y), 9), axis=1)])[:, None])


def _refined(Y: Array, state: Array, block: tuple[int, ...]) -> Array:
    """One step of Newton towards Y G = Lam Y: X with M_ii X_ij - X_ij M_jj = M_ij for M = Y G Y^-1, then (I + X) Y."""
    M = mul(mul(Y, state), _solve(Y, np.eye(len(Y))))
    X = np.zeros_like(Y)
    for a, i in enumerate(_places(block)):
        for b, j in enumerate(_places(block)):
            if a != b:
                sylvester = np.kron(M[i, i], np.eye(block[b])) - np.kron(np.eye(block[a]), M[j, j].T)
                X[i, j] = _solve(sylvester, M[i, j].reshape(-1, 1)).reshape(block[a], block[b])
    return Y + mul(X, Y)


def coordinates(state: Array) -> list[Modal]:
    """Coordinates to choose from: G block diagonal, a row a real pole and two a pair; and all in one block, for poles that are close or multiple."""
    made: list[Modal | None] = []
    found = _eigenvectors(state)
    if found is not None:
        Y, block = digits(found[0], START_DIGITS), found[1]
        for _ in range(REFINEMENTS):
            Y = _refined(Y, state, block)
        made.append(_with_inverse(Y, block, True))
    together = _contracting(state) if len(state) > 1 else None
    if together is not None:
        made.append(_with_inverse(digits(together, START_DIGITS), (len(state),), False))
    return [m for m in made if m is not None]


def _with_inverse(Y: Array, block: tuple[int, ...], discs: bool) -> Modal | None:
    """|Y^-1| <= |S| (I + |R| + |R|^2 ..) for an approximate inverse S and R = I - Y S; None where that does not converge soon."""
    s = len(Y)
    S = _solve(Y, np.eye(s))
    if not (np.all(np.isfinite(Y)) and np.all(np.isfinite(S))):
        return None
    R = np.abs(np.eye(s) - mul(Y, S)) + 4 * s * U64 * mul(np.abs(Y), np.abs(S))
    off = 2 * float(R.max()) * s
    if off > 1e-6:
        return None
    return Modal(Y, S, off * np.repeat(row_sums(np.abs(S))[:, None], s, axis=1), block, discs)


def _norm(block: Array, disc: bool) -> float:
    """How much a block of Lam can enlarge a disc (its largest singular value), or the largest entry."""
    if not disc:
        return float(row_sums(np.abs(block)).max())
    square, det = float((block**2).sum()), float(block[0, 0] * block[1, 1] - block[0, 1] * block[1, 0])
    return float(np.sqrt((square + np.sqrt(max(square**2 - 4 * det**2, 0.0))) / 2))


def _round(found: Modal) -> list[bool]:
    """Whether each block has a disc."""
    return [found.discs and b == 2 for b in found.block]


def _norms(Lam: Array, found: Modal) -> Array:
    """Norm of each block."""
    return np.array([_norm(Lam[p, p], disc) for p, disc in zip(_places(found.block), _round(found), strict=True)])


def _spread(columns: Array, found: Modal) -> Array:
    """Spread that holds each column: order x columns, a disc's radius twice."""
    out = np.abs(columns)
    for p, disc in zip(_places(found.block), _round(found), strict=True):
        if disc:
            out[p] = np.sqrt((columns[p] ** 2).sum(0))
    return out


def _scaled(found: Modal, lin: hull.Linear, more: Array, radius: Array) -> Modal:
    """Rows scaled so that the set reaches about 1 in each at the usual radii; powers of 2 leave every other digit."""
    Lam = mul(mul(found.transform, lin.state), found.inverse)
    keep = 1 - np.minimum(np.repeat(_norms(Lam, found), found.block), 1 - 1e-6)
    each = _spread(mul(found.transform, np.hstack([lin.input * radius, more])), found).sum(1) / keep
    scale = np.array([2.0 ** -np.floor(np.log2(x)) if x > 0.0 else 1.0 for x in each])
    if not found.discs:  # one block: its rows are scaled so that it contracts
        scale[:] = scale.min()
    rows_scaled, columns_scaled = scale[:, None], 1 / scale[None, :]
    return replace(found, transform=found.transform * rows_scaled, inverse=found.inverse * columns_scaled, miss=found.miss * columns_scaled)


@dataclass(frozen=True)
class _Stored:
    """Numbers as the ECU holds them, in modal coordinates."""

    Lam: Array  # order x order, zero outside its blocks
    P: Array  # order x width
    B: Array  # order x disturbances
    Q: Array  # residuals x order, made larger by `wider`
    wider: float


def _relative(error: Array, columns: Array) -> Array:
    """Largest error of each row in parts of its column's magnitude: order."""
    magnitude = np.abs(columns).sum(0)
    used = magnitude > 0.0
    return np.asarray((error[:, used] / magnitude[used]).max(1, initial=0.0))


def _growth(lin: hull.Linear, bd: Array, found: Modal, kept: _Stored, terms: int) -> Array:
    """Share of the set's size by which a step can miss each row: tables, arithmetic of the threshold, arithmetic of the generator."""
    Y, s, width = found.transform, len(found.transform), lin.input.shape[1]
    gamma = gamma32(s + width + 2)
    aY, tiny = np.abs(Y), 4 * (s + 1) * U64
    state = np.abs(mul(Y, lin.state) - mul(kept.Lam, Y)) + tiny * (mul(aY, np.abs(lin.state)) + mul(np.abs(kept.Lam), aY))
    state = mul(state + gamma * mul(aY, np.abs(lin.state)), np.abs(found.inverse) + found.miss).max(1)
    incoming = np.abs(kept.P - mul(Y, lin.input)) + (tiny + gamma) * mul(aY, np.abs(lin.input))
    constant = np.abs(kept.B - mul(Y, bd)) + tiny * mul(aY, np.abs(bd))
    row = state + _relative(incoming, kept.P) + _relative(constant, kept.B) + (s + 4) * U32 * (1 + np.abs(kept.Lam).max())
    # Norms and sums of `terms` columns lose as many units of what they add up, which is at most |Lam| times the size.
    sums = 1.1 * terms * U32 * (1 + row_sums(np.abs(kept.Lam)).max())
    return np.asarray(1.1 * (_spread(row[:, None], found)[:, 0] + sums))


def _output_growth(lin: hull.Linear, found: Modal, kept: _Stored) -> Array:
    """The same for each residual."""
    s, width = lin.input.shape
    gamma = gamma32(s + width + 2)
    F = np.abs(lin.output)
    exact = mul(lin.output, found.inverse) * (1 + kept.wider)
    error = np.abs(kept.Q - exact) + 2 * mul(F, found.miss) + gamma * mul(F, np.abs(found.inverse) + found.miss) + (s + 4) * U32 * np.abs(kept.Q)
    return np.asarray(1.1 * error.max(1))


def _most(kept: _Stored, found: Modal) -> Array:
    """Largest entry of its block that radii of 1 can add to a row in one sample."""
    into = _spread(kept.P, found).sum(1)
    return np.repeat([into[p].max() for p in _places(found.block)], found.block)


def _recover(decay: Array, into: Array, constant: Array) -> int:
    """Samples until what radii as large as a number can be have left in the set is below HEALED. `decay` holds for the generator itself."""
    fastest = np.log(np.maximum(decay, 1e-300))
    most = np.log(np.maximum(into, 1e-300)) + LARGEST - np.log(1 - decay) + np.log1p(constant)
    needed = np.ceil((most - np.log(HEALED)) / -fastest).max() + 1
    return int(min(max(needed, 1.0), NEVER))


def build(
    lin: hull.Linear,
    T: Array,
    plant: SubPlant,
    ranges: hull.Ranges,
    radius: Array,
    exact: hull.HullTables,
    signal: tuple[int, ...],
    columns: int,
    reduction: int,
    where: str,
    published: bool = False,
    derived: Array | None = None,
) -> ZonotopeTable:
    """All tables of one generator. `radius` (width and derived) is what the radii usually are, `exact` the same generator's hull.

    `signal` are the places of these radii; `derived` (n x derived signals) how those disturb the state that have a radius only.

    What depends on no data is the hull's bias, exact; only event errors are columns. With `published`, disturbances and the initial set are
    columns too, and a row of bias is what is there at once.
    """
    s = len(lin.state)
    if not 1 <= columns <= 255 or (reduction == BOX and columns < s):
        raise InputError(f"{where}: a zonotope of {columns} columns; choose {s if reduction == BOX else 1} .. 255")
    constants = _constants(lin, T, plant, ranges) if published else _Constants(np.zeros((s, 0)), (np.zeros((s, 0)),) * 2, np.zeros(s), np.zeros(0))
    if derived is not None:
        lin = replace(lin, input=np.hstack([lin.input, mul(T, derived)]), direct=np.hstack([lin.direct, np.zeros((len(lin.direct), derived.shape[1]))]))
    if reduction == TRUNCATE:
        return _truncated(lin, radius, exact, constants, signal, columns)
    made = [_table(_scaled(c, lin, constants.every, radius), lin, radius, exact, constants, signal, columns, reduction) for c in coordinates(lin.state)]
    if not made:
        raise InputError(f"{where}: its poles are too close to one another for a zonotope; move them apart, or use the exact hull")
    table, share = min(made, key=lambda x: x[1])
    if share > SHARE_MAX:
        raise InputError(f"{where}: rounding would be more than {100 * SHARE_MAX:.0f} % of its zonotope's threshold; choose poles further inside the unit circle and further apart")
    return table


def roundings(terms: int, width: int, order: int) -> int:
    """Of a number on its way into a threshold: `terms` columns and rows, the signals, the spread, then the bias."""
    return terms + width + order + 20


def _table(
    found: Modal, lin: hull.Linear, radius: Array, exact: hull.HullTables, constants: _Constants, signal: tuple[int, ...], columns: int, reduction: int
) -> tuple[ZonotopeTable, float]:
    """The tables in these coordinates, and the largest part of a threshold that rounding would be at the usual radii."""
    s, width = lin.input.shape
    Y, block = found.transform, found.block
    initial = [nearest32(mul(Y, c)) for c in constants.initial]
    terms = max(columns + width + constants.every.shape[1], initial[0].shape[1]) + s
    wider = share32(roundings(terms, width, s))
    Lam = scipy.linalg.block_diag(*[mul(mul(Y[p], lin.state), found.inverse[:, p]) for p in _places(block)])
    kept = _Stored(nearest32(Lam), nearest32(mul(Y, lin.input)), nearest32(mul(Y, constants.every)), nearest32(mul(lin.output, found.inverse) * (1 + wider)), wider)
    norm = up32(_norms(kept.Lam, found) * (1 + 4 * U32) + 1e-12)
    growth, output_growth = _growth(lin, constants.every, found, kept, terms), _output_growth(lin, found, kept)
    always = _spread(mul(np.abs(Y), constants.into_e[:, None]), found)[:, 0] + 2 * HEALED
    outer = np.abs(kept.Q)
    for p, disc in zip(_places(block), _round(found), strict=True):
        if disc:
            outer[:, p] = np.sqrt((outer[:, p] ** 2).sum(1))[:, None] * np.array([1.0, 0.0])
    bias_rest = up32(constants.at_once[None] * (1 + wider)) if len(constants.at_once) else exact.rest
    table = ZonotopeTable(
        signal=signal,
        columns=columns,
        reduction=reduction,
        block=block,
        state=tuple(float(x) for p in _places(block) for x in kept.Lam[p, p].ravel()),
        input=rows(kept.P.T),
        disturbance=rows(kept.B.T),
        rest=rows(initial[0].T),
        moving=rows(initial[1].T),
        output=rows(kept.Q),
        outer=rows(up32(outer * (1 + wider))),
        direct=rows(up32(np.abs(lin.direct) * (1 + wider + 2 * (s + width + 2) * U32))),
        bias_rest=rows(bias_rest),
        bias_moving=rows(bias_rest if len(constants.at_once) else exact.moving),
        decay=tuple(float(x) if disc else 0.0 for x, disc in zip(norm, _round(found), strict=True)),
        always=tuple(float(x) for x in up32(always)),
        growth=tuple(float(x) for x in up32(growth)),
        output_growth=tuple(float(x) for x in up32(output_growth)),
        recover=_recover(np.minimum(np.repeat(norm, block) + s * growth.max(), 1 - 1e-6), _most(kept, found), always),
        ready_rest=exact.ready_rest,
        ready_moving=exact.ready_moving,
    )
    return table, _share(table, norm, radius, exact.steady)


def _truncated(lin: hull.Linear, radius: Array, exact: hull.HullTables, constants: _Constants, signal: tuple[int, ...], columns: int) -> ZonotopeTable:
    """As published: what is dropped is chosen by its length in the observer's own coordinates, and nothing is added for rounding."""
    s, none = len(lin.state), np.zeros_like(lin.state)
    table, _ = _table(Modal(np.eye(s), np.eye(s), none, (s,), False), lin, radius, exact, constants, signal, columns, TRUNCATE)
    return replace(table, always=(0.0,) * s, growth=(0.0,) * s, output_growth=(0.0,) * len(lin.output), recover=NEVER)


def _share(table: ZonotopeTable, norm: Array, radius: Array, steady: Array) -> float:
    """What the shares of the set's size and the constants add to a threshold, in parts of it; the set at its largest, at the usual radii."""
    keep = np.repeat(1 - norm, table.block)
    if np.any(keep <= 0.0):
        return np.inf
    columns = np.hstack([np.array(table.input).T * radius, np.array(table.disturbance).reshape(-1, table.order).T])
    size = float((np.abs(columns).sum(1) / keep).sum())
    growth = np.array(table.growth)
    if float((growth / keep).sum()) > SHARE_MAX:
        return np.inf  # it would feed on itself
    spread = (np.array(table.always) + growth * size) / keep
    added = np.array(table.output_growth) * size + row_sums(np.array(table.outer) * spread)
    return float((added / np.maximum(steady, 1e-300)).max())


@dataclass(frozen=True)
class _Constants:
    """What depends on no data but is in the set, as published."""

    every: Array  # order x disturbances
    initial: tuple[Array, Array]  # order x states, at rest and moving
    into_e: Array  # order: rounding of a step
    at_once: Array  # residuals; empty where it is not in the set but in the hull's bias


def _constants(lin: hull.Linear, T: Array, plant: SubPlant, ranges: hull.Ranges) -> _Constants:
    """Disturbances, the initial set and constant rounding."""
    m = plant.C.shape[0]
    Bd = mul(T, plant.Ed) - mul(lin.input[:, :m], plant.Fd)
    Dd = mul(lin.direct[:, :m], plant.Fd)
    loss = hull.rounding_of(lin, T, plant, ranges, Bd, np.zeros((len(lin.state), 0)), hull.LAGS_MAX)
    return _Constants(Bd[:, np.any(Bd != 0.0, axis=0)], (T * ranges.initial, T * ranges.state), loss.into_e, row_sums(np.abs(Dd)) + loss.into_r)
