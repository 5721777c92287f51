"""Thesis 5.1-5.2: figures of the short-circuit model and of the observer's theory."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.machines import Motor
from pumplib.motor.short_identify import fault_coefficient, phi_z, sector_centres
from pumplib.motor.short_verify import TrajectoryCheck
from pumplib.observers.adaptive import Estimate
from pumplib.observers.adaptive_compare import Row
from pumplib.observers.adaptive_design import MotorStructure
from pumplib.observers.adaptive_study import LyapunovRun
from pumplib.observers.certificate import Certificate
from pumplib.observers.stator_design import system
from pumplib.plots.style import COLOURS, PAGE, style

Array = NDArray[Any]
PHASE_LOOK = {"a": ("blue", "o"), "b": ("red", "s"), "c": ("green", "^")}
PAIR_LOOK = {"ab": ("purple", "D"), "bc": ("orange", "v"), "ca": ("sky", "P")}
_FLOOR = 1e-16  # of drawn differences: rounding


def trajectories(check: TrajectoryCheck, names: Sequence[str], shown: int = 0) -> Figure:
    """Start-up of a shorted motor by the model and by its coils, and the differences of all machines.

    Parameters
    ----------
    check : TrajectoryCheck
        Runs of the model and of the coils.
    names : sequence of str
        One for each machine.
    shown : int
        Machine whose currents are drawn.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is not one name for each machine.
    """
    machines = check.i_f.shape[1]
    if len(names) != machines or not 0 <= shown < machines:
        raise ParameterError(f"trajectories: {len(names)} names, machine {shown} of {machines}: give one name each.")
    t = 1e3 * check.t
    with style():
        figure, grid = plt.subplots(3, 1, figsize=(PAGE, 5.4), sharex=True)
        for k, (phase, (colour, _)) in enumerate(PHASE_LOOK.items()):
            grid[0].plot(t, check.i_t_coils[:, shown, k], color=COLOURS[colour], lw=2.6, alpha=0.35)
            grid[0].plot(t, check.i_t[:, shown, k], color=COLOURS[colour], lw=0.9, label=f"$i_{phase}$")
        grid[0].set_ylabel("terminal current / A")
        grid[0].set_title(f"{names[shown]}: model (thin) on coils (wide)")
        grid[0].legend(loc="upper right", ncols=3)
        grid[1].plot(t, check.i_f_coils[:, shown], color=COLOURS["purple"], lw=2.6, alpha=0.35, label="coils")
        grid[1].plot(t, check.i_f[:, shown], color=COLOURS["purple"], lw=0.9, label="model")
        grid[1].set_ylabel("loop current / A")
        grid[1].legend(loc="upper right", ncols=2)
        peak = np.abs(check.i_t_coils).max(axis=(0, 2))
        apart = np.abs(check.i_t - check.i_t_coils).max(axis=2) / peak
        looks = [COLOURS[c] for c in ("blue", "red", "green", "purple")]
        for k, name in enumerate(names):
            grid[2].plot(
                t, np.maximum(apart[:, k], _FLOOR), color=looks[k % 4], ls="-" if k < 4 else "--", lw=0.9, label=name
            )
        grid[2].axhline(1e-8, color=COLOURS["black"], ls=":", label="bound")
        grid[2].set_yscale("log")
        grid[2].set_ylim(1e-16, 1e-6)
        grid[2].set_ylabel("difference / peak")
        grid[2].set_xlabel("time / ms")
        grid[2].set_xlim(t[0], t[-1])
        figure.align_ylabels(grid)
        figure.legend(*grid[2].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def draw_sectors(ax: Axes, motor: Motor, omega_s: float, radius: float, scale_at: float = 127.0) -> None:
    """Fill the sectors of the three phases and mark their axes on polar axes.

    Parameters
    ----------
    ax : Axes
        Polar.
    motor : Motor
        What is believed about the motor.
    omega_s : float
        Angular frequency of the supply, rad/s.
    radius : float
        Of the picture.
    scale_at : float
        Angle at which the numbers of the scale stand, degrees.
    """
    width = float(phi_z(motor.r_s, motor.L_ls, omega_s))
    centres = sector_centres(motor.r_s, motor.L_ls, omega_s)
    for (phase, (colour, _)), centre in zip(PHASE_LOOK.items(), centres, strict=True):
        ax.bar(centre, radius, width=2 * np.pi / 3, color=COLOURS[colour], alpha=0.07, lw=0)
        ax.bar(centre, radius, width=width, color=COLOURS[colour], alpha=0.22, lw=0)
        ax.text(
            centre, 0.9 * radius, f"${phase}$", ha="center", va="center", fontsize=11, color=COLOURS[colour], zorder=8
        )
    ax.set_ylim(0, radius)
    ticks = radius * np.array([0.25, 0.5, 0.75])
    ax.set_yticks(ticks, [f"{one:.3f}" for one in ticks])
    ax.set_rlabel_position(scale_at)  # type: ignore[attr-defined]
    ax.tick_params(labelsize=7)


def sectors(motor: Motor, omega_s: float, *, gamma: float = 0.02) -> Figure:
    """Fault term g_c of a short of each phase over contact resistance and leakage, and of loops between two phases.

    Parameters
    ----------
    motor : Motor
        The motor.
    omega_s : float
        Angular frequency of the supply, rad/s.
    gamma : float
        Shorted share of the turns.

    Returns
    -------
    Figure
    """
    loops = {
        "a": (1, 0, 0), "b": (0, 1, 0), "c": (0, 0, 1), "ab": (1, -1, 0), "bc": (0, 1, -1), "ca": (-1, 0, 1),
    }  # fmt: skip
    contact = np.concatenate([[0.0], np.geomspace(1e-2, 1e2, 60)]) * gamma
    handles: list[Any] = []
    with style():
        figure, axes = plt.subplots(1, 2, figsize=(PAGE, 3.9), subplot_kw={"projection": "polar"})
        for ax, names, title in (
            (axes[0], PHASE_LOOK, "one phase"),
            (axes[1], PAIR_LOOK, "tap to tap between two phases"),
        ):
            tops = []
            for name, (colour, marker) in names.items():
                shares = gamma * np.array(loops[name], dtype=float)
                for kappa, line in ((1.0, "-"), (0.5, "--"), (0.0, ":")):
                    g = fault_coefficient(
                        shares, motor.r_s, motor.L_ls, omega_s, connection=motor.connection, r_f=contact, kappa_c=kappa
                    )
                    tops.append(3 * np.abs(g).max())
                    ax.plot(np.angle(g), 3 * np.abs(g), color=COLOURS[colour], ls=line, lw=1.2)
                    ax.plot(np.angle(g[:1]), 3 * np.abs(g[:1]), marker, color=COLOURS[colour], ms=4)
                ax.plot([], [], marker, color=COLOURS[colour], label=name)
            draw_sectors(ax, motor, omega_s, 1.25 * max(tops), 160.0 if names is PHASE_LOOK else 127.0)
            ax.set_title(title, loc="center", pad=8)
            handles += ax.get_legend_handles_labels()[0]
        for kappa, line in ((1.0, "-"), (0.5, "--"), (0.0, ":")):
            handles += axes[0].plot([], [], color=COLOURS["black"], ls=line, label=rf"$\kappa_c$ = {kappa:g}")
        figure.suptitle("$3|g_c|$ / - over its angle; marks: $r_f=0$, lines run inwards as $r_f$ grows", fontsize=9)
        figure.legend(handles=handles, loc="outside lower center", ncols=9)
    return figure


def gain_over_speed(structure: MotorStructure, certificate: Certificate, motor: Motor, speeds: ArrayLike) -> Figure:
    """Structural inequality and contraction over the speed.

    Left the largest eigenvalue of the structural inequality with the scheduled gain and with that gain held, right
    the contraction that the matrix-inequality gain was verified to have.

    Parameters
    ----------
    structure : MotorStructure
        Analysis of the structural inequality.
    certificate : Certificate
        Of the gain of the filtered-regressor observer.
    motor : Motor
        What it was designed for.
    speeds : array_like, shape (N,)
        Electrical speeds of the certificate's points, rad/s.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is not one speed for each point.
    """
    omega = np.asarray(speeds, dtype=float)
    if omega.shape != certificate.rates.shape:
        raise ParameterError(
            f"gain_over_speed: {omega.size} speeds for {certificate.rates.size} points; give one each."
        )
    bare = -np.linalg.eigvals(system(motor, omega)).real.max(axis=1)
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 3.1))
        left.plot(structure.omega, structure.constant, color=COLOURS["red"], ls="--", label="held at mid speed")
        left.plot(structure.omega, structure.boundary, color=COLOURS["blue"], label="scheduled")
        left.axhline(0.0, color=COLOURS["black"], lw=0.7)
        left.set_ylabel(r"$\lambda_{max}/|\lambda_{min}|$ of the inequality / -")
        left.set_title("Structural inequality: not above zero?")
        left.set_ylim(top=1.35 * float(structure.constant.max()))
        left.set_xlim(structure.omega[0], structure.omega[-1])
        left.legend(loc="upper center", ncols=2)
        right.plot(omega, certificate.eigen_rates, color=COLOURS["green"], ls="-.", label="slowest mode, with gain")
        right.plot(omega, certificate.rates, color=COLOURS["blue"], label="certified contraction")
        right.plot(omega, bare, color=COLOURS["red"], ls="--", label="slowest mode, $K=0$")
        right.axhline(certificate.decay_rate, color=COLOURS["black"], ls=":", label="asked for")
        right.set_ylabel("rate / (1/s)")
        right.set_ylim(0, 1.4 * max(float(certificate.eigen_rates.max()), float(bare.max())))
        right.set_title("One $P$ for all speeds")
        right.legend(loc="upper center", ncols=2, fontsize=6.5, handlelength=1.8, columnspacing=1.0)
        for ax in (left, right):
            ax.set_xlabel(r"electrical speed $z_p\omega$ / (rad/s)")
        right.set_xlim(omega[0], omega[-1])
    return figure


def gain_value(rows: Sequence[tuple[Row, Row]], names: Sequence[str]) -> Figure:
    """What a gain changes: settling, noise, and the error that a wrong resistance leaves.

    Parameters
    ----------
    rows : sequence of (Row, Row)
        Nominal record and record with a wrong resistance, of each gain.
    names : sequence of str
        Of the gains.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is not one name for each gain.
    """
    if len(rows) != len(names) or not rows:
        raise ParameterError(f"gain_value: {len(names)} names for {len(rows)} gains; give one each.")
    place = np.arange(len(rows))
    with style():
        figure, axes = plt.subplots(1, 3, figsize=(PAGE, 2.9), sharey=True)
        settle = [[1e3 * one[0].speed_settling for one in rows], [1e3 * one[0].short_settling for one in rows]]
        noise = [one[0].speed_noise for one in rows]
        error = [one[1].speed_error for one in rows]
        axes[0].plot(settle[0], place, "o", color=COLOURS["blue"], label="speed, to 1 rad/s")
        axes[0].plot(settle[1], place, "s", color=COLOURS["red"], label="$g_c$, to 10 %")
        axes[0].set_xlabel("settling time / ms")
        axes[0].set_xlim(0, 1.25 * np.nanmax(np.where(np.isfinite(settle), settle, np.nan)))
        axes[0].legend(loc="upper center", bbox_to_anchor=(0.5, 1.28), fontsize=7, ncols=1)
        axes[1].semilogx(noise, place, "o", color=COLOURS["blue"])
        axes[1].set_xlabel("noise of the speed / (rad/s)")
        axes[2].plot(error, place, "o", color=COLOURS["blue"])
        axes[2].set_xlabel("speed error, $r_s$ +10 % / (rad/s)")
        axes[2].set_xlim(0, 1.25 * max(error))
        axes[0].set_yticks(place, names)
        axes[0].set_ylim(len(rows) - 0.5, -0.5)
    return figure


def unobservable(run: LyapunovRun, filtered: Estimate, x: ArrayLike, theta: float) -> Figure:
    """Heat exchanger whose known part does not show the hot side: both observers find state and parameter.

    Parameters
    ----------
    run : LyapunovRun
        Direct observer.
    filtered : Estimate
        Filtered-regressor observer.
    x : array_like, shape (N, 2)
        True temperatures at the times of the filtered-regressor observer.
    theta : float
        True heat transfer, W/K.

    Returns
    -------
    Figure
    """
    truth = np.asarray(x).real
    direct = run.estimate
    few = slice(None, None, max(1, len(direct.t) // 600))
    with style():
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(PAGE, 2.7))
        for k, (name, colour) in enumerate((("hot outlet, not measured", "red"), ("cold outlet, measured", "blue"))):
            left.plot(filtered.t, truth[:, k], color=COLOURS[colour], lw=2.6, alpha=0.35)
            left.plot(filtered.t, filtered.x[:, k].real, color=COLOURS[colour], lw=1.0, label=name)
        left.set_ylabel("temperature / K")
        left.set_title("State (wide: true)")
        left.set_ylim(top=truth.max() + 0.6 * np.ptp(truth))
        left.legend(loc="upper right", fontsize=7)
        middle.axhline(theta, color=COLOURS["black"], ls=":", label="true")
        middle.plot(filtered.t, filtered.theta[:, 0], color=COLOURS["blue"], label="filtered regressor")
        middle.plot(direct.t[few], direct.theta[few, 0], color=COLOURS["red"], ls="--", label="direct")
        middle.set_ylabel("heat transfer $UA$ / (W/K)")
        middle.set_title("Parameter")
        middle.legend(loc="lower right")
        right.plot(direct.t[few], np.maximum(run.V[few] / run.V[0], 1e-14), color=COLOURS["red"], ls="--")
        right.set_yscale("log")
        right.set_ylabel("$V/V(0)$ / -")
        right.set_title("Lyapunov function, direct")
        for ax in (left, middle, right):
            ax.set_xlabel("time / s")
            ax.set_xlim(0, filtered.t[-1])
    return figure
