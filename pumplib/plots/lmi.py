"""Thesis B.2: figure of a common quadratic Lyapunov function: how far it reaches, its ellipses, its decay."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from pumplib.errors import ParameterError
from pumplib.observers import Bracket, Certificate
from pumplib.plots.style import COLOURS, PAGE, style


def feasibility(
    sizes: ArrayLike, brackets: Sequence[Bracket], certificate: Certificate, systems: ArrayLike, *,
    limit: float | None = None, limit_name: str = "limit", size_name: str = "size of the polytope",
    marked: float | None = None, duration: float | None = None,
) -> Figure:  # fmt: skip
    """Largest certified decay rate over the size of a polytope; ellipses of one P with greedy switching.

    The trajectories switch at every instant to the system along which the norm falls least.

    Parameters
    ----------
    sizes : array_like, shape (N,)
        Sizes of the polytope.
    brackets : sequence of Bracket, length N
        Largest decay rate of each, 1/s.
    certificate : Certificate
        Certificate of one size, real, two states, continuous form.
    systems : array_like, shape (k, 2, 2)
        Its systems, 1/s.
    limit : float, optional
        Size beyond which there is no common P, from another route.
    limit_name, size_name : str
        Names of that limit and of the axis.
    marked : float, optional
        Size that the certificate belongs to.
    duration : float, optional
        Time shown, s; by default until the certified bound has fallen by a factor of ten.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If the shapes do not fit, the systems are not real with two states, or the certificate is not of the
        continuous form.
    """
    from scipy.linalg import expm

    x, A = np.asarray(sizes, dtype=float), np.asarray(systems)
    if x.ndim != 1 or len(x) != len(brackets) or len(x) == 0:
        raise ParameterError(f"feasibility: sizes of shape {x.shape} for {len(brackets)} brackets; give one each.")
    if A.ndim != 3 or A.shape[1:] != (2, 2) or np.iscomplexobj(A) or certificate.P.shape != (2, 2):
        raise ParameterError(f"feasibility: systems of shape {A.shape}, {A.dtype}; ellipses need two real states.")
    if certificate.form != "continuous" or not certificate.decay > 0:
        raise ParameterError("feasibility: needs a certificate of the continuous form with a decay rate > 0 1/s.")
    end = np.log(10.0) / certificate.decay if duration is None else duration
    P = np.real(certificate.P)
    inverse_root = np.linalg.inv(np.linalg.cholesky(P)).T
    angles = np.linspace(0, 2 * np.pi, 181)
    circle = np.stack([np.cos(angles), np.sin(angles)])
    count = 600
    time = np.linspace(0, end, count + 1)
    steps = [expm(one * time[1]) for one in A]
    paths = []
    for angle in (0.4, 2.5, 4.6):  # at every instant the system along which the norm falls least
        e = [inverse_root @ np.array([np.cos(angle), np.sin(angle)])]
        for _ in range(count):
            after = [step @ e[-1] for step in steps]
            e.append(max(after, key=lambda one: float(one @ P @ one)))
        paths.append(np.array(e))
    shown = [COLOURS[c] for c in ("blue", "red", "purple", "orange")]
    with style():
        figure, (left, middle, right) = plt.subplots(
            1, 3, figsize=(PAGE, 2.6), gridspec_kw={"width_ratios": (1.15, 1.0, 1.15)}
        )
        low, high = np.array([one.low for one in brackets]), np.array([one.high for one in brackets])
        top = 1.12 * float(np.max(np.where(np.isfinite(high), high, low)))
        left.fill_between(x, 0, low, color=COLOURS["green"], alpha=0.25, lw=0, label="certified")
        left.fill_between(x, np.minimum(high, top), top, color=COLOURS["red"], alpha=0.18, lw=0, label="refuted")
        left.plot(x, low, color=COLOURS["black"], lw=1.0)
        if limit is not None:
            left.axvline(limit, color=COLOURS["black"], ls="--", lw=1.0, label=limit_name)
        if marked is not None:
            left.plot([marked], [certificate.decay], "o", color=COLOURS["blue"], label="shown right")
        left.set_xlabel(size_name)
        left.set_ylabel("decay rate / (1/s)")
        reach = max(x.max(), x.max() if limit is None else limit)
        left.set_xlim(x.min(), reach + 0.04 * (reach - x.min()))
        left.set_ylim(0, top)
        left.legend(loc="upper right")
        for level in (1.0, 0.75, 0.5, 0.25):
            ellipse = level * inverse_root @ circle
            middle.plot(ellipse[0], ellipse[1], color=COLOURS["grey"], lw=0.7)
        for k, path in enumerate(paths):
            middle.plot(path[:, 0], path[:, 1], color=shown[k % 4], lw=0.9)
            middle.plot(*path[0], "o", color=shown[k % 4], ms=3)
            right.plot(time, certificate.norm(path) / certificate.norm(path[0]), color=shown[k % 4], lw=0.9)
        middle.set_xlabel("$e_1$")
        middle.set_ylabel("$e_2$")
        right.plot(time, np.exp(-certificate.decay * time), color=COLOURS["black"], ls="--", label="certified bound")
        right.plot([], [], color=shown[0], lw=0.9, label="greedy switching")
        right.set_yscale("log")
        right.set_xlabel("time / s")
        right.set_ylabel("$|e|_P$ over its start / -")
        right.set_xlim(0, end)
        right.legend(loc="lower left")
        for ax, title in ((left, "How far it reaches"), (middle, "Level sets of $e^T P e$"), (right, "Decay")):
            ax.set_title(title)
    return figure
