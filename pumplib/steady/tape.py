"""Thesis 7.3: the operations of a set of relations in order, recorded once for the compiled affine arithmetic.

Calling the relations with recording operands gives a list of elementary operations. Constants are folded, equal
operations are recorded once, and for every result it is known which of the uncertain quantities it can depend on, so
that the kernel skips the rest.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.steady.relations import Relations

Array = NDArray[Any]
ADD, SUB, MUL, SQUARE, SCALE, SHIFT, INVERSE, ROOT, COSINE, SINE, DIVIDE, ANCHOR, INNER = range(13)


class _Recorder:
    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self.rows: list[tuple[int, int, int, float]] = []
        self.known: dict[tuple[int, int, int, float], Operand] = {}
        self.pairs: list[tuple[int, int]] = []
        self.sums: dict[tuple[tuple[int, int], ...], Operand] = {}

    def add(self, op: int, a: int, b: int = 0, constant: float = 0.0) -> "Operand":
        if op in (ADD, MUL) and b < a:
            a, b = b, a
        key = (op, a, b, constant)
        if key not in self.known:
            self.known[key] = Operand(self, self.inputs + len(self.rows))
            self.rows.append(key)
        return self.known[key]

    def sum_of_products(self, pairs: tuple[tuple[int, int], ...]) -> "Operand":
        if pairs not in self.sums:
            first = len(self.pairs)
            self.pairs.extend(pairs)
            self.sums[pairs] = self.add(INNER, first, first + len(pairs))
        return self.sums[pairs]


class Operand:
    """An operand that records what is done with it.

    Parameters
    ----------
    recorder : object
        Collects the operations.
    slot : int
        Place of the value.
    """

    __slots__ = ("_recorder", "slot")
    __array_ufunc__ = None

    def __init__(self, recorder: _Recorder, slot: int) -> None:
        self._recorder, self.slot = recorder, slot

    def _two(self, op: int, other: "Operand") -> "Operand":
        return self._recorder.add(op, self.slot, other.slot)

    def __neg__(self) -> "Operand":
        return self * -1.0

    def __add__(self, other: Any) -> "Operand":
        if isinstance(other, Operand):
            return self._two(ADD, other)
        return self if other == 0 else self._recorder.add(SHIFT, self.slot, 0, float(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Operand":
        return self._two(SUB, other) if isinstance(other, Operand) else self + (-other)

    def __rsub__(self, other: Any) -> "Operand":
        return (-self) + other

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Operand):
            return self**2 if other.slot == self.slot else self._two(MUL, other)
        if other == 0:
            return 0.0
        return self if other == 1 else self._recorder.add(SCALE, self.slot, 0, float(other))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Operand):
            return self * self._recorder.add(INVERSE, other.slot)
        # a constant divisor whose reciprocal is exact (1, 2, 4 pole pairs) costs a product only
        if math.frexp(abs(other))[0] == 0.5:
            return self * (1.0 / other)
        return self._recorder.add(DIVIDE, self.slot, 0, float(other))

    def __rtruediv__(self, other: Any) -> Any:
        return self._recorder.add(INVERSE, self.slot) * other

    def __pow__(self, exponent: int) -> "Operand":
        if exponent != 2:
            raise ParameterError(f"** {exponent!r} in a relation: only squares are recorded; write products.")
        return self._recorder.add(SQUARE, self.slot)

    def inner_product(self, a: tuple[Any, ...], b: tuple[Any, ...]) -> Any:
        """Sum of products as one operation; products with a number are kept apart.

        Parameters
        ----------
        a, b : tuple of operands or float
            Factors.

        Returns
        -------
        Operand
        """
        both = [isinstance(x, Operand) and isinstance(y, Operand) for x, y in zip(a, b, strict=True)]
        pairs = tuple((x.slot, y.slot) for x, y, yes in zip(a, b, both, strict=True) if yes)
        total: Any = 0.0
        if len(pairs) > 1:
            total = self._recorder.sum_of_products(pairs)
        elif pairs:
            k = both.index(True)
            total = a[k] * b[k]
        for x, y, yes in zip(a, b, both, strict=True):
            if not yes:
                total = total + x * y
        return total

    def anchor(self) -> "Operand":
        """A number in the middle of this operand's set, as a constant.

        Returns
        -------
        Operand
        """
        return self._recorder.add(ANCHOR, self.slot)

    def sqrt(self) -> "Operand":
        """Square root.

        Returns
        -------
        Operand
        """
        return self._recorder.add(ROOT, self.slot)

    def cos(self) -> "Operand":
        """Cosine.

        Returns
        -------
        Operand
        """
        return self._recorder.add(COSINE, self.slot)

    def sin(self) -> "Operand":
        """Sine.

        Returns
        -------
        Operand
        """
        return self._recorder.add(SINE, self.slot)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Tape:
    """Recorded operations.

    Parameters
    ----------
    code : ndarray of int, shape (operations, 3)
        Operation, first and second operand (slots); the first slots are the inputs, then one an operation.
    constant : ndarray, shape (operations,)
        Constant of SCALE, SHIFT and DIVIDE.
    start : ndarray of int, shape (operations + 1,)
        Where an operation's entries of `columns` begin.
    columns : ndarray of int
        Uncertain quantities that the results of the operations depend on.
    pairs : ndarray of int, shape (k, 2)
        Slots of the factors of the sums of products; an INNER has the rows code[1] to code[2].
    factors : ndarray of int, shape (operations + 1, 2)
        Where an INNER's entries of `left` and `right` begin.
    left, right : ndarray of int
        Uncertain quantities that the first and the second factors of an INNER depend on.
    outputs : ndarray of int, shape (m,)
        Slots of the results.
    inputs : int
        Number of inputs.
    """

    code: Array
    constant: Array
    start: Array
    columns: Array
    pairs: Array
    factors: Array
    left: Array
    right: Array
    outputs: Array
    inputs: int


def record(relations: Relations, depends: Array, fixed: dict[int, float]) -> Tape:
    """Record relations.

    Parameters
    ----------
    relations : Relations
        What to record.
    depends : ndarray of bool, shape (inputs, n)
        Which uncertain quantities each input depends on; inputs are channels, then parameters.
    fixed : dict of int to float
        Inputs that are exact constants; only 0 is folded, others are read as inputs.

    Returns
    -------
    Tape
    """
    recorder = _Recorder(len(depends))
    operands: list[Any] = [
        0.0 if fixed.get(k) == 0.0 else Operand(recorder, k) for k in range(recorder.inputs)
    ]  # fmt: skip
    cut = len(relations.channels)
    results = relations(operands[:cut], operands[cut:])
    sets = [frozenset(np.flatnonzero(row).tolist()) for row in depends]
    none: frozenset[int] = frozenset()
    sides: list[tuple[frozenset[int], frozenset[int]]] = []
    for op, a, b, _ in recorder.rows:
        side = (none, none)
        if op == INNER:
            some = recorder.pairs[a:b]
            side = (none.union(*(sets[x] for x, _ in some)), none.union(*(sets[y] for _, y in some)))
            sets.append(side[0] | side[1])
        elif op == ANCHOR:
            sets.append(none)
        else:
            sets.append(sets[a] | sets[b] if op in (ADD, SUB, MUL) else sets[a])
        sides.append(side)
    columns = [sorted(one) for one in sets[recorder.inputs :]]
    return Tape(
        code=np.array([row[:3] for row in recorder.rows], dtype=np.int64),
        constant=np.array([row[3] for row in recorder.rows]),
        start=np.concatenate(([0], np.cumsum([len(c) for c in columns]))).astype(np.int64),
        columns=np.array([k for c in columns for k in c], dtype=np.int64),
        pairs=np.array(recorder.pairs, dtype=np.int64).reshape(-1, 2),
        factors=np.cumsum([(0, 0), *((len(x), len(y)) for x, y in sides)], axis=0).astype(np.int64),
        left=np.array([k for x, _ in sides for k in sorted(x)], dtype=np.int64),
        right=np.array([k for _, y in sides for k in sorted(y)], dtype=np.int64),
        outputs=np.array([r.slot for r in results], dtype=np.int64),
        inputs=recorder.inputs,
    )
