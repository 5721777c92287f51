"""Thesis 7.3: set membership over windows of steady points (beyond the thesis): detection and isolation by hypotheses.

A window holds points declared healthy (from commissioning) and recent points. Each hypothesis says which fault, if
any, acts in the recent points: clogging K_f, friction dB, leakage K_l with one size for all of them, cavitation f_c
and dry running f_d with a size of their own in each. A hypothesis for which no parameters, biases and sizes
in their sets explain the window is refuted; the answer is the set of those that are left, with bounds of the size.

The effects of the faults on R1 and R2, none of them linearised in the measurement errors:

    K_f   R1 = -K_f Q^2
    dB    R2 = dB omega
    K_l   R1 = -(2 a_h2 Q - a_h1 omega) u - a_h2 u^2,  R2 = (a_t1 omega - 2 a_t2 Q) u - a_t2 u^2,  u = K_l sqrt(H)
    f_c   R1 = -f_c f_H,  R2 = -0.45 f_c f_T          (torque shares assumed)
    f_d   R1 = -f_d f_H,  R2 = -0.93 f_d f_T

The square of u is enclosed between chords over a few pieces of the range of K_l.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.steady.algebra import operand_function, root
from pumplib.steady.enclose import Enclosure, SetModel, set_model
from pumplib.steady.membership import Program, Rows, Sizes, shared_rows
from pumplib.steady.operating import TORQUE_SHARE_CAVITATION, TORQUE_SHARE_DRY
from pumplib.steady.phasors import torque_and_speed
from pumplib.steady.relations import Relations, head, load_torque
from pumplib.steady.sets import own_columns

Array = NDArray[Any]
HYPOTHESES = ("none", "K_f", "dB", "K_l", "f_c", "f_d")
LARGEST: Mapping[str, float] = {"K_f": 1e12, "dB": 0.1, "K_l": 2e-6, "f_c": 0.35, "f_d": 1.0}
DRY_LEVEL = 0.35  # assumed border between cavitation and dry running, share of the head
_PIECES = (0.0, 0.03, 0.1, 0.3, 1.0)  # of the range of K_l


@operand_function
def effects(  # type: ignore[no-untyped-def]
    V_rms, I_rms, omega_e, phi, H, Q,
    r_s, L_s_prime, R_r_prime, G_core, B, stray, a_h0, a_h1, a_h2, a_t0, a_t1, a_t2,
    z_p, voltage, current,
):  # fmt: skip
    """What the effects of the faults are made of; any kind of operand.

    Parameters
    ----------
    V_rms, I_rms, omega_e, phi, H, Q : float or operand
        Channels, as for `pumplib.steady.relations.residuals`.
    r_s, L_s_prime, R_r_prime, G_core, B, stray : float or operand
        Motor.
    a_h0, a_h1, a_h2, a_t0, a_t1, a_t2 : float or operand
        Pump.
    z_p, voltage, current : float
        Constants.

    Returns
    -------
    tuple
        Q^2, omega, sqrt(H) (2 a_h2 Q - a_h1 omega), sqrt(H) (a_t1 omega - 2 a_t2 Q), a_h2 H, a_t2 H, f_H, f_T.

    References
    ----------
    Thesis 4.3.3 for the faults; the form of their effects is reconstructed.
    """
    _, omega = torque_and_speed(
        voltage * V_rms, current * I_rms, omega_e, phi, r_s, L_s_prime, R_r_prime, G_core, z_p
    )  # fmt: skip
    u = root(H)
    return (
        Q**2,
        omega,
        u * (2.0 * (a_h2 * Q) - a_h1 * omega),
        u * (a_t1 * omega - 2.0 * (a_t2 * Q)),
        a_h2 * H,
        a_t2 * H,
        head(Q, omega, a_h0, a_h1, a_h2),
        load_torque(Q, omega, 0.0, a_t0, a_t1, a_t2),
    )


_EFFECTS = ("Q2", "omega", "s_H", "s_T", "b_H", "b_T", "f_H", "f_T")


@dataclass(frozen=True, kw_only=True, slots=True)
class Verdict:
    """One hypothesis.

    Parameters
    ----------
    name : str
        Of `HYPOTHESES`.
    possible : bool
        Whether it is not refuted.
    margin : float
        Smallest margin that explains the window, relative to the rows' own bounds; negative when there is room.
    proven : float
        Lower bound of the margin; the hypothesis is refuted if this is positive.
    size : tuple of float or None
        Guaranteed range of the size if the hypothesis is true; over all recent points for f_c and f_d.
    """

    name: str
    possible: bool
    margin: float
    proven: float
    size: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True, slots=True)
class WindowResult:
    """All hypotheses of one window.

    Parameters
    ----------
    verdicts : dict of str to Verdict
        By hypothesis.
    """

    verdicts: dict[str, Verdict]

    @property
    def fault(self) -> bool:
        """Whether "none" is refuted."""
        return not self.verdicts["none"].possible

    @property
    def possible(self) -> tuple[str, ...]:
        """Hypotheses that are not refuted; empty means that the model or two faults at once are to be doubted."""
        return tuple(name for name, verdict in self.verdicts.items() if verdict.possible)


class WindowTest:
    """Set membership over windows, with the healthy block evaluated once.

    Parameters
    ----------
    model : SetModel
        Relations of the pump with their sets.
    reference : mapping of str to array_like, optional
        Channels of points declared healthy.
    margin : tuple of float
        Bound of the model's own error in R1, Pa, and R2, N m; (0, 0) for a guarantee without further assumptions.
    largest : mapping of str to float, optional
        Largest sizes considered, in place of `LARGEST`.
    changing : tuple of str
        Parameters that may differ between the healthy block and the recent points, such as r_s with the winding's
        temperature; within each of the two they are constant.
    own : tuple of str
        Parameters that may differ from point to point, such as inductances that depend on the flux.

    Raises
    ------
    ParameterError
        If a margin is negative, a size unknown, or a changing or own parameter unknown or tied to another.
    DataError
        If a relation is not defined on the set at a point.

    References
    ----------
    Beyond the thesis; the set of hypotheses is that of thesis 7.4 (reconstructed).
    """

    def __init__(
        self,
        model: SetModel,
        reference: Mapping[str, ArrayLike] | None = None,
        *,
        margin: tuple[float, float] = (0.0, 0.0),
        largest: Mapping[str, float] | None = None,
        changing: tuple[str, ...] = (),
        own: tuple[str, ...] = (),
    ) -> None:
        if min(margin) < 0 or not np.isfinite(margin).all():
            raise ParameterError(f"WindowTest.margin = {margin!r} (Pa, N m): must be finite and >= 0.")
        self.largest = dict(LARGEST) | dict(largest or {})
        unknown = set(self.largest) - set(LARGEST)
        if unknown or min(self.largest.values()) <= 0:
            raise ParameterError(f"WindowTest.largest: known are {', '.join(LARGEST)}, each > 0.")
        self.model, self._margin = model, np.asarray(margin, dtype=float)
        r = model.relations
        self._effects = set_model(
            Relations(
                name="fault effects", function=effects, channels=r.channels, parameters=r.parameters,
                constants=r.constants, outputs=_EFFECTS,
            ),
            model.parameters, model.errors,
        )  # fmt: skip
        self._changing = own_columns(model.parameters, changing)
        self._own = own_columns(model.parameters, own)
        self._reference = None if reference is None else self.rows(reference, False)

    @property
    def reference(self) -> Rows | None:
        """Rows of the healthy block."""
        return self._reference

    def rows(
        self, signals: Mapping[str, ArrayLike], recent: bool = True, outputs: tuple[str, ...] = ("R1", "R2")
    ) -> Rows:
        """Points as rows of the linear programs.

        Parameters
        ----------
        signals : mapping of str to array_like, shape (n,)
            Channels, SI.
        recent : bool
            Whether they are recent points, with changing parameters of their own, or belong to the healthy block.
        outputs : tuple of str
            Residuals; R3 has the margin of R2.

        Returns
        -------
        Rows
            Point by point, in each the outputs in their order.

        Raises
        ------
        DataError
            If a channel is missing or not finite, or a relation not defined on the set.
        """
        forms = self.model.forms(signals)
        margin = np.array([self._margin[0 if name == "R1" else 1] for name in outputs])
        rows = shared_rows(
            forms, self.model.errors, self.model.relations.channels, outputs=outputs, margin=margin, own=self._own
        )
        # changing parameters have a second set of columns, for the recent points
        second = np.zeros((len(rows.c), len(self._changing)))
        k = rows.k.copy()
        if recent:
            second, k[:, self._changing] = k[:, self._changing], 0.0
        return Rows(c=rows.c, k=np.hstack((k, second)), r=rows.r)

    def test(
        self, signals: Mapping[str, ArrayLike], hypotheses: tuple[str, ...] = HYPOTHESES, sizes: bool = True
    ) -> WindowResult:
        """Test hypotheses on recent points.

        Parameters
        ----------
        signals : mapping of str to array_like, shape (n,)
            Channels of the recent points, SI; each hypothesis supposes its fault in all of them.
        hypotheses : tuple of str
            Which ones.
        sizes : bool
            Whether to bound the size of the fault under each possible hypothesis.

        Returns
        -------
        WindowResult

        Raises
        ------
        ParameterError
            If a hypothesis is unknown.
        DataError
            If a channel is missing or not finite, or a relation not defined on the set.
        """
        unknown = [name for name in hypotheses if name not in HYPOTHESES]
        if unknown:
            raise ParameterError(f"hypotheses: {', '.join(unknown)} unknown; known are {', '.join(HYPOTHESES)}.")
        recent = self.rows(signals, True)
        healthy = 0 if self._reference is None else len(self._reference.c)
        rows = recent if self._reference is None else self._reference + recent
        # with a fault that can be of any size the recent point enters by its healthy maps only
        part = self._effects.enclose(signals)
        if not np.isfinite(part.lo).all():
            raise DataError("fault effects are not defined on the set at some point: the head must be positive there.")
        return WindowResult(
            verdicts={name: self._verdict(name, rows, healthy, part, sizes) for name in hypotheses}
        )  # fmt: skip

    def _verdict(self, name: str, rows: Rows, healthy: int, part: Enclosure, sizes: bool) -> Verdict:
        found = []
        for unknowns in self._sizes(name, len(rows.c), healthy, part):
            program = Program(rows, unknowns)
            value, proven = program.margin()
            possible, bounds = proven <= 0.0, None
            if possible and unknowns is not None and sizes:
                bounds = self._bounds(program, rows.k.shape[1], unknowns)
            found.append((possible, value, proven, bounds))
        kept = [entry for entry in found if entry[0]]
        spans = [entry[3] for entry in kept if entry[3] is not None]
        best = min(found, key=lambda entry: entry[2])
        return Verdict(
            name=name,
            possible=bool(kept),
            margin=best[1],
            proven=best[2],
            size=(min(s[0] for s in spans), max(s[1] for s in spans)) if spans else None,
        )

    @staticmethod
    def _bounds(program: Program, n: int, unknowns: Sizes) -> tuple[float, float] | None:
        ends = []
        for k in range(len(unknowns.low)):
            direction = np.zeros(n + len(unknowns.low))
            direction[n + k] = 1.0
            try:
                low, high = program.extreme(direction)
            except ArithmeticError:  # feasible only to within rounding: keep the whole range
                low, high = float(unknowns.low[k]), float(unknowns.high[k])
            ends.append((max(low, float(unknowns.low[k])), min(high, float(unknowns.high[k]))))
        return min(e[0] for e in ends), max(e[1] for e in ends)

    def _sizes(self, name: str, rows: int, healthy: int, part: Enclosure) -> list[Sizes | None]:
        """Unknown sizes of a hypothesis; several alternatives where the range is cut into pieces."""
        if name == "none":
            return [None]
        n, top = len(part.lo), self.largest[name]
        mid, rad = 0.5 * (part.lo + part.hi), 0.5 * part.width * (1 + 1e-12)
        at = dict(zip(_EFFECTS, range(len(_EFFECTS)), strict=True))

        def build(d1: Array, q1: Array, d2: Array, q2: Array, low: float, high: float, each: bool) -> Sizes:
            m = n if each else 1
            d, q = np.zeros((rows, m)), np.zeros((rows, m))
            column = np.arange(n) if each else np.zeros(n, dtype=int)
            first, second = healthy + 2 * np.arange(n), healthy + 2 * np.arange(n) + 1
            d[first, column], q[first, column], d[second, column], q[second, column] = d1, q1, d2, q2
            return Sizes(d=d, q=q, low=np.full(m, low), high=np.full(m, high))

        zero = np.zeros(n)
        if name == "K_f":
            return [build(-mid[:, at["Q2"]], rad[:, at["Q2"]], zero, zero, 0.0, top, False)]
        if name == "dB":
            return [build(zero, zero, mid[:, at["omega"]], rad[:, at["omega"]], 0.0, top, False)]
        if name in ("f_c", "f_d"):
            share = TORQUE_SHARE_CAVITATION if name == "f_c" else TORQUE_SHARE_DRY
            low, high = (0.0, min(top, DRY_LEVEL)) if name == "f_c" else (DRY_LEVEL, top)
            h, t = at["f_H"], at["f_T"]
            return [build(-mid[:, h], rad[:, h], -share * mid[:, t], share * rad[:, t], low, high, True)]
        pieces: list[Sizes | None] = []
        for a, b in pairwise(_PIECES):
            # K^2 = K * K with the second factor anywhere in [low, high]
            low, high = a * top, b * top
            m_K, r_K = 0.5 * (low + high), 0.5 * (high - low)
            d, q = [], []
            for s, square in (("s_H", "b_H"), ("s_T", "b_T")):
                sign = -1.0 if s == "s_H" else 1.0
                d.append(sign * mid[:, at[s]] - mid[:, at[square]] * m_K)
                q.append(
                    rad[:, at[s]] + (np.abs(mid[:, at[square]]) + rad[:, at[square]]) * r_K + rad[:, at[square]] * m_K
                )
            pieces.append(build(d[0], q[0], d[1], q[1], low, high, False))
        return pieces
