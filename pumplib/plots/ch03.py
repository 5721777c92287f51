"""Thesis 3.2.1, 3.2.2, 3.2.4, 3.3.2, 3.3.3, 3.5: figures of simulated results of chapter 3."""

import math
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pumplib.hydraulics.impeller import real_head, theoretical_head
from pumplib.hydraulics.pressure import impeller_pressure, impeller_torque
from pumplib.machines.parameters import Impeller, Liquid, Motor, Pump
from pumplib.machines.units import RPM, from_si
from pumplib.motor.phasor import steady_torque
from pumplib.plant.balance import PowerBalance
from pumplib.plant.simulate import Trajectory
from pumplib.plant.verify import HeadComparison, PhaseComparison
from pumplib.plots.style import COLOURS, LINES, PAGE, style

Array = NDArray[Any]
_PHASE_COLOURS = ("blue", "red", "green")


def _mark(ax: Axes, events: dict[str, float], named: bool) -> None:
    """Vertical lines at the times of events, named at the top of the axes."""
    for name, time in events.items():
        ax.axvline(time, color=COLOURS["grey"], lw=0.9, ls=":")
        if named:
            ax.text(time, 1.01, name, transform=ax.get_xaxis_transform(), fontsize=7, color=COLOURS["grey"], ha="left")


def start_up(run: Trajectory, until: float) -> Figure:
    """Direct-on-line start of the motor-pump set: currents, torque, speed, pressure and flow.

    Parameters
    ----------
    run : Trajectory
        From standstill.
    until : float
        End of the time axis, s.

    Returns
    -------
    Figure
    """
    part = run.t <= until
    t = run.t[part]
    with style():
        figure, axes = plt.subplots(4, 1, figsize=(PAGE, 6.6), sharex=True)
        for k, name in enumerate("abc"):
            axes[0].plot(t, run.i_abc[part, k], color=COLOURS[_PHASE_COLOURS[k]], ls=LINES[k], label=f"phase {name}")
        axes[0].set_ylabel("terminal current / A")
        axes[0].legend(ncols=3, loc="upper right")
        axes[1].plot(t, run.T_e[part], label="motor, $T_e$", color=COLOURS["blue"])
        axes[1].plot(t, run.T_p[part], label="pump, steady part of $T_p$", color=COLOURS["red"], ls="--")
        axes[1].set_ylabel("torque / N m")
        axes[1].legend(loc="upper right")
        axes[2].plot(t, from_si(run.omega[part], "rpm"), color=COLOURS["blue"])
        axes[2].set_ylabel("speed / rpm")
        axes[3].plot(t, from_si(run.H_p[part], "bar"), color=COLOURS["blue"], label="pressure $H_p$")
        axes[3].set_ylabel("pressure / bar")
        flow = axes[3].twinx()
        flow.plot(t, from_si(run.Q_p[part], "m3/h"), color=COLOURS["red"], ls="--", label="flow $Q_p$")
        flow.set_ylabel("flow / (m³/h)")
        flow.grid(False)
        flow.spines["right"].set_visible(True)
        lines = axes[3].get_lines() + flow.get_lines()
        axes[3].legend(lines, [str(line.get_label()) for line in lines], loc="center right")
        axes[3].set_xlabel("time / s")
        axes[3].set_xlim(0, until)
    return figure


def steps(run: Trajectory, no_load: Trajectory, events: dict[str, float], synchronous: float) -> Figure:
    """Speed, torque and hydraulics after load and valve steps, beside the motor without pump.

    Parameters
    ----------
    run : Trajectory
        Motor-pump set.
    no_load : Trajectory
        The same motor without the pump.
    events : dict
        Name to time in s.
    synchronous : float
        Synchronous speed of the supply, rad/s.

    Returns
    -------
    Figure
    """
    first = min(events.values()) - 0.3
    part = run.t >= first
    t = run.t[part]
    with style():
        figure, axes = plt.subplots(4, 1, figsize=(PAGE, 6.2), sharex=True)
        axes[0].plot(t, from_si(run.omega[part], "rpm"), color=COLOURS["blue"], label="motor and pump")
        still = no_load.t >= first
        axes[0].plot(
            no_load.t[still], from_si(no_load.omega[still], "rpm"), color=COLOURS["green"], ls="--", label="no load"
        )
        axes[0].axhline(synchronous / RPM, color=COLOURS["black"], ls=":", lw=1, label="synchronous")
        axes[0].set_ylabel("speed / rpm")
        axes[0].legend(ncols=3, loc="center left", bbox_to_anchor=(0.0, 0.68))
        axes[1].plot(t, run.T_e[part], color=COLOURS["blue"], label="motor, $T_e$")
        axes[1].plot(t, run.T_p[part], color=COLOURS["red"], ls="--", label="pump, steady part of $T_p$")
        axes[1].set_ylabel("torque / N m")
        axes[1].legend(loc="upper right")
        axes[2].plot(t, from_si(run.H_p[part], "bar"), color=COLOURS["blue"])
        axes[2].set_ylabel("pressure $H_p$ / bar")
        axes[3].plot(t, from_si(run.Q_p[part], "m3/h"), color=COLOURS["blue"])
        axes[3].set_ylabel("flow $Q_p$ / (m³/h)")
        axes[3].set_xlabel("time / s")
        axes[3].set_xlim(first, run.t[-1])
        for k, ax in enumerate(axes):
            _mark(ax, events, named=k == 0)
    return figure


def power_flow(run: Trajectory, power: PowerBalance, until: float) -> Figure:
    """Where the electrical power of a start-up goes, and the pointwise error of the balance.

    Parameters
    ----------
    run : Trajectory
        The start-up.
    power : PowerBalance
        Of the same run.
    until : float
        End of the time axis, s.

    Returns
    -------
    Figure
    """
    part = run.t <= until
    t = run.t[part]
    terms = (
        ("electrical input", power.electrical, "black", "-"),
        ("stored (field, inertia, pipe)", power.stored, "grey", "--"),
        ("copper losses", power.copper_stator + power.copper_rotor, "red", "-"),
        ("impeller and casing losses", power.impeller + power.casing + power.leakage, "orange", "-."),
        ("delivered to the valve", power.application, "blue", "-"),
        ("friction and load", power.friction + power.load, "green", ":"),
        ("torque $K_Q\\,dQ_i/dt$", power.liquid, "purple", "--"),
    )
    with style():
        figure, axes = plt.subplots(2, 1, figsize=(PAGE, 4.6), sharex=True, height_ratios=(2.2, 1))
        for name, values, colour, line in terms:
            axes[0].plot(t, from_si(values[part], "kW"), color=COLOURS[colour], ls=line, label=name)
        axes[0].set_ylabel("power / kW")
        axes[0].legend(ncols=2, loc="upper right")
        scale = np.abs(power.electrical).max()
        error = np.maximum(np.abs(power.imbalance[part]) / scale, 1e-18)
        axes[1].semilogy(t, error, color=COLOURS["blue"], lw=0.7)
        axes[1].axhline(1e-9, color=COLOURS["red"], ls="--", label="limit asked for, $10^{-9}$")
        axes[1].set_ylim(1e-18, 1e-7)
        axes[1].set_ylabel("imbalance /\nlargest input")
        axes[1].legend(loc="upper right")
        axes[1].set_xlabel("time / s")
        axes[1].set_xlim(0, until)
    return figure


def phase_comparison(star: PhaseComparison, delta: PhaseComparison) -> Figure:
    """Terminal current of phase a in both models and their difference, Y and delta.

    Parameters
    ----------
    star, delta : PhaseComparison
        The two connections.

    Returns
    -------
    Figure
    """
    with style():
        figure, axes = plt.subplots(2, 2, figsize=(PAGE, 3.8), sharex=True, sharey="row")
        for column, (name, result) in enumerate((("Y", star), ("delta", delta))):
            t = result.dq.t
            top, bottom = axes[0, column], axes[1, column]
            top.plot(t, result.phases.i_t[:, 0], color=COLOURS["blue"], lw=2.2, alpha=0.6, label="phase model, DOP853")
            top.plot(t, result.dq.i_abc[:, 0], color=COLOURS["black"], ls="--", lw=1, label="dq model, RK4")
            top.set_title(f"{name}: unbalance, 3rd, 5th and 7th harmonic")
            bottom.semilogy(t[1:], np.maximum(result.difference[1:], 1e-17), color=COLOURS["blue"], lw=0.8)
            bottom.axhline(1e-8, color=COLOURS["red"], ls="--", label="bound of the claim")
            bottom.set_xlabel("time / s")
        axes[0, 0].set_ylabel("current $i_{ta}$ / A")
        axes[1, 0].set_ylabel("difference /\nlargest current")
        axes[1, 0].set_ylim(1e-16, 1e-6)
        low, high = axes[0, 0].get_ylim()
        axes[0, 0].set_ylim(low, high + 0.45 * (high - low))
        axes[0, 1].legend(loc="upper right", ncols=2)
        axes[1, 1].legend(loc="upper right")
    return figure


def torque_slip(motor: Motor, v_s: float, omega_s: float) -> Figure:
    """Torque over slip with the right J and, as negative control, with the J printed after (3.6).

    Parameters
    ----------
    motor : Motor
        The motor.
    v_s : float
        Stator voltage amplitude, V.
    omega_s : float
        Angular frequency, rad/s.

    Returns
    -------
    Figure
    """
    slip = np.linspace(-1.0, 1.0, 801)
    omega = omega_s / motor.z_p * (1 - slip)
    right = steady_torque(motor, np.array(v_s), np.array(omega_s), omega)
    wrong = steady_torque(motor, np.array(v_s), np.array(omega_s), -omega)
    with style():
        figure, ax = plt.subplots(figsize=(PAGE, 2.9))
        ax.plot(slip, right, color=COLOURS["blue"], label="J = [0 −1; 1 0] (nomenclature): sign of the slip")
        ax.plot(slip, wrong, color=COLOURS["red"], ls="--", label="J = [0 1; −1 0] (after (3.6)): wrong")
        ax.axhline(0, color=COLOURS["black"], lw=0.8)
        ax.axvline(0, color=COLOURS["black"], lw=0.8)
        ax.set_xlabel("slip / 1  (negative: generator)")
        ax.set_ylabel("torque $T_e$ / N m")
        ax.legend(loc="lower right")
    return figure


def head_form(impeller: Impeller, liquid: Liquid, omega: float) -> Figure:
    """From the theoretical head of the geometry to the real head of (3.24), loss by loss.

    Parameters
    ----------
    impeller, liquid : Impeller, Liquid
        One stage.
    omega : float
        rad/s.

    Returns
    -------
    Figure
    """
    Q = np.linspace(0, 1.35 * math.sqrt(theoretical_head(impeller, liquid, omega, 0.0) / impeller.K_f) / 2.4, 200)
    H_e = theoretical_head(impeller, liquid, omega, Q)
    slipped = impeller.sigma_s * H_e
    shocked = slipped - impeller.K_s * (Q - impeller.K_d * omega) ** 2
    real = real_head(impeller, liquid, omega, Q)
    x = from_si(Q, "m3/h")
    with style():
        figure, ax = plt.subplots(figsize=(PAGE, 3.2))
        ax.plot(x, H_e, color=COLOURS["black"], ls=":", label="theoretical head $H_e$ (3.22)")
        ax.plot(x, slipped, color=COLOURS["blue"], ls="--", label="after slip, $\\sigma_s H_e$")
        ax.plot(x, shocked, color=COLOURS["green"], ls="-.", label="after shock losses $h_s$")
        ax.plot(x, real, color=COLOURS["red"], lw=1.8, label="after friction: head $H$ (3.24)")
        ax.fill_between(x, shocked, slipped, color=COLOURS["green"], alpha=0.12)
        ax.fill_between(x, real, shocked, color=COLOURS["red"], alpha=0.12)
        design = from_si(impeller.K_d * omega, "m3/h")
        ax.axvline(design, color=COLOURS["grey"], ls=":", lw=0.9)
        ax.text(design, 0.03, " design flow $K_d\\omega$", transform=ax.get_xaxis_transform(), fontsize=7.5)
        ax.set_ylim(0, None)
        ax.set_xlim(0, x[-1])
        ax.set_xlabel("flow through the impeller $Q_i$ / (m³/h)")
        ax.set_ylabel("head / m")
        ax.legend(loc="lower left")
    return figure


def affinity(pump: Pump, omegas: Array) -> Figure:
    """Pressure and torque at several speeds, and collapsed by the affinity laws.

    Parameters
    ----------
    pump : Pump
        The pump.
    omegas : ndarray, shape (k,)
        Speeds, rad/s.

    Returns
    -------
    Figure
    """
    n, top = pump.stages, float(omegas.max())
    largest = (pump.a_h1 + math.sqrt(pump.a_h1**2 + 4 * pump.a_h2 * pump.a_h0)) / (2 * pump.a_h2)
    s = np.linspace(0, 0.95 * largest, 120)
    with style():
        figure, axes = plt.subplots(2, 2, figsize=(PAGE, 4.2))
        for k, omega in enumerate(omegas):
            H = n * impeller_pressure.py_func(s * omega, omega, pump.a_h0, pump.a_h1, pump.a_h2)
            T = n * impeller_torque.py_func(s * omega, omega, pump.a_t0, pump.a_t1, pump.a_t2)
            look: dict[str, Any] = {"ls": LINES[k % 4], "label": f"{omega / RPM:.0f} rpm", "lw": 2.4 - 0.5 * k}
            axes[0, 0].plot(from_si(s * omega, "m3/h"), from_si(H, "bar"), **look)
            axes[1, 0].plot(from_si(s * omega, "m3/h"), T, **look)
            axes[0, 1].plot(from_si(s * top, "m3/h"), from_si(H * (top / omega) ** 2, "bar"), **look)
            axes[1, 1].plot(from_si(s * top, "m3/h"), T * (top / omega) ** 2, **look)
        axes[0, 0].set_title("as they are")
        axes[0, 1].set_title(f"referred to {top / RPM:.0f} rpm: $Q\\sim\\omega$; $H, T\\sim\\omega^2$")
        axes[0, 0].set_ylabel("pressure / bar")
        axes[1, 0].set_ylabel("torque / N m")
        for ax in axes[1]:
            ax.set_xlabel("flow / (m³/h)")
        axes[0, 1].legend(loc="lower left")
    return figure


def head_transient(result: HeadComparison) -> Figure:
    """Pressure in speed transients: full model, simplified model, and their relative difference.

    Parameters
    ----------
    result : HeadComparison
        From `compare_simplified`.

    Returns
    -------
    Figure
    """
    t = result.full.t
    with style():
        figure, axes = plt.subplots(3, 1, figsize=(PAGE, 4.8), sharex=True)
        axes[0].plot(t, from_si(result.full.omega, "rpm"), color=COLOURS["black"])
        axes[0].set_ylabel("speed / rpm")
        axes[1].plot(t, from_si(result.full.H_p, "bar"), color=COLOURS["blue"], label="full: leakage dynamics, $K_Q$")
        axes[1].plot(t, from_si(result.simple.H_p, "bar"), color=COLOURS["red"], ls="--", label="simplified, algebraic")
        axes[1].set_ylabel("pressure / bar")
        axes[1].legend(loc="lower center")
        axes[2].plot(t, from_si(result.error, "%"), color=COLOURS["blue"], label="against the full model of the thesis")
        axes[2].plot(
            t,
            from_si(result.error_reciprocal, "%"),
            color=COLOURS["purple"],
            ls="--",
            label="against the model with reciprocal pressure $K_Q\\,d\\omega/dt$ (ours)",
        )
        axes[2].axhline(2, color=COLOURS["red"], ls=":", label="bound 2 %")
        axes[2].set_ylabel("pressure error / %")
        axes[2].set_xlabel("time / s")
        axes[2].set_xlim(0, t[-1])
        axes[2].set_ylim(0, 2.3 * max(2.0, float(from_si(result.error_reciprocal.max(), "%"))))
        axes[2].legend(loc="upper right")
    return figure
