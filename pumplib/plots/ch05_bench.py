"""Thesis 5.3: figures of the stator observer on the bench: traces, each phase, sweep of the size, unbalance, run-up."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines import Motor
from pumplib.observers.stator_decision import THRESHOLD
from pumplib.observers.stator_starts import Nominal, RunUp
from pumplib.observers.stator_study import StatorMachine, Tested
from pumplib.plots.ch05 import PAIR_LOOK, PHASE_LOOK, draw_sectors
from pumplib.plots.style import COLOURS, PAGE, style

Array = NDArray[Any]


def _fault(ax: Axes, onset: float | None, label: bool = False) -> None:
    if onset is not None:
        ax.axvline(onset, color=COLOURS["black"], lw=1.2, zorder=1, label="fault" if label else None)


def traces(tested: Tested, machine: StatorMachine) -> Figure:
    """Currents, speed, torque, fault coefficient and statistic of a run, with fault and alarms.

    Parameters
    ----------
    tested : Tested
        The run.
    machine : StatorMachine
        Its machine.

    Returns
    -------
    Figure
    """
    estimates, truth = tested.estimates, tested.truth
    t, good = estimates.t, estimates.trusted
    healthy, _ = machine.healthy.predict(tested.window)
    onset = tested.onset
    with style():
        figure, grid = plt.subplots(5, 1, figsize=(PAGE, 7.6), sharex=True)
        few = max(1, len(tested.signals.t) // 8000)
        for k, (phase, (colour, _)) in enumerate(PHASE_LOOK.items()):
            grid[0].plot(
                tested.signals.t[::few], tested.signals.current[::few, k], color=COLOURS[colour], lw=0.4,
                label=f"$i_{phase}$",
            )  # fmt: skip
        grid[0].set_ylabel("current / A")
        for ax, name, estimate, unit in (
            (grid[1], "omega", estimates.omega, r"speed / (rad/s)"),
            (grid[2], "T_e", estimates.T_e, "torque / (N m)"),
        ):
            ax.plot(truth.t, truth[name], color=COLOURS["grey"], lw=2.4, alpha=0.6, label="true")
            ax.plot(t, np.where(good, estimate, np.nan), color=COLOURS["blue"], lw=0.9, label="estimated")
            values = np.concatenate([truth[name], estimate[good]])
            low, high = np.quantile(values, [0.001, 0.999])
            ax.set_ylim(low - 0.1 * (high - low + 1e-9), high + 0.1 * (high - low + 1e-9))
            ax.set_ylabel(unit)
        d = np.where(good, 3 * (estimates.g_c - complex(healthy)), np.nan)
        for part, colour, word in ((np.real, "blue", "Re"), (np.imag, "red", "Im")):
            grid[3].plot(t, part(3 * tested.g_true), color=COLOURS[colour], lw=2.4, alpha=0.35)
            grid[3].plot(t, part(d), color=COLOURS[colour], lw=0.9, label=f"{word} $3(\\hat g_c-g_{{c0}})$")
        grid[3].set_ylabel("fault coefficient / -")
        grid[4].plot(tested.t, tested.statistic, color=COLOURS["blue"], label="last 0.5 s")
        grid[4].axhline(THRESHOLD, color=COLOURS["green"], ls="--", label="threshold")
        grid[4].set_ylabel("statistic / -")
        grid[4].set_ylim(0, 1.35 * max(float(tested.statistic.max()), THRESHOLD))
        grid[4].set_xlabel("time / s")
        grid[4].set_xlim(0, tested.course.duration)
        for ax in grid:
            _fault(ax, onset, label=ax is grid[4])
        for when, words, colour, ax in (
            (tested.alarm, "alarm", "red", grid[4]), (tested.fast_alarm, "fast alarm", "purple", grid[3])
        ):  # fmt: skip
            if when is not None:
                delay = "" if onset is None else f", {1e3 * (when - onset):.0f} ms" if when >= onset else ", false"
                ax.axvline(when, color=COLOURS[colour], lw=1.2, ls="-.", label=f"{words}{delay}")
        for ax in grid:
            ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        figure.align_ylabels(grid)
    return figure


def accuracy(runs: Sequence[Nominal], names: Sequence[str]) -> Figure:
    """Errors of the observer on its own model.

    Parameters
    ----------
    runs : sequence of Nominal
        Runs.
    names : sequence of str
        Of each.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is not one name for each run.
    """
    if len(runs) != len(names) or not runs:
        raise ParameterError(f"accuracy: {len(names)} names for {len(runs)} runs; give one each.")
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 2.7), sharex=True)
        for run, name, colour, line in zip(
            runs, names, ("blue", "red", "green", "purple"), ("-", "--", "-.", ":"), strict=False
        ):
            t = run.estimates.t
            left.semilogy(t, np.maximum(run.g_error, 1e-9), color=COLOURS[colour], ls=line, lw=0.9, label=name)
            right.semilogy(
                t, np.maximum(np.abs(run.speed_error), 1e-7), color=COLOURS[colour], ls=line, lw=0.9, label=name
            )
        left.set_ylabel("$3|\\hat g_c - g_c|$ / -")
        right.set_ylabel(r"$|\hat\omega-\omega|$ / (rad/s)")
        for ax in (left, right):
            _fault(ax, runs[0].onset, label=True)
            ax.set_xlabel("time / s")
            ax.set_xlim(0, runs[0].estimates.t[-1])
            ax.legend(loc="upper right")
    return figure


def identification(tests: Sequence[Tested], motor: Motor) -> Figure:
    """Differences d to the healthy machine in the plane, with the sectors of the phases; marker: true, colour: true.

    Parameters
    ----------
    tests : sequence of Tested
        Healthy and faulty tests of one machine.
    motor : Motor
        What is believed about it.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no test.
    """
    if not tests:
        raise ParameterError("identification: no test; give at least one.")
    omega_s = float(np.median([one.window.omega_s for one in tests]))
    largest = max(one.verdict.size_d for one in tests)
    with style():
        figure, ax = plt.subplots(figsize=(PAGE, 4.4), subplot_kw={"projection": "polar"})
        draw_sectors(ax, motor, omega_s, 1.2 * largest)
        looks = {"none": ("black", "x"), **PHASE_LOOK, **PAIR_LOOK}
        for name, (colour, marker) in looks.items():
            mine = [
                one for one in tests if (one.course.fault.phase if one.course.fault else "none") == name
            ]  # fmt: skip
            if not mine:
                continue
            d = np.array([one.verdict.d for one in mine])
            right = sum(one.verdict.phase == name and one.verdict.alarm for one in mine)
            said = f"{sum(not one.verdict.alarm for one in mine)}" if name == "none" else f"{right}"
            word = "healthy, no alarm" if name == "none" else f"short in {' and '.join(name)}, so said"
            ax.plot(
                np.angle(d), 3 * np.abs(d), marker, color=COLOURS[colour], ms=5.5, mec="black", mew=0.5, zorder=7,
                ls="none", label=f"{word}: {said} of {len(mine)}",
            )  # fmt: skip
        ax.set_title("$3|d|$ / - over the angle of $d=\\hat g_c-g_{c0}$", loc="center", pad=10)
        figure.legend(loc="outside right center", title="what was there, what was said", title_fontsize=8)
    return figure


def estimation(tests: Sequence[Tested], resistive: Sequence[Tested] = (), *, turns: int = 250) -> Figure:
    """Estimated over true share of the turns with its 90 % interval, and the relative error.

    Parameters
    ----------
    tests : sequence of Tested
        Tests of several sizes.
    resistive : sequence of Tested
        The same with a contact resistance.
    turns : int
        Of a phase, for the second scale.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If no test found a size.
    """

    def columns(some: Sequence[Tested]) -> tuple[Array, Array, Array, Array, Array]:
        kept = [one for one in some if one.course.fault is not None and np.isfinite(one.verdict.gamma)]
        size = np.array([one.course.fault.size for one in kept if one.course.fault is not None])
        limits = np.array([one.verdict.interval for one in kept]).reshape(-1, 2)
        return (
            100 * size, 100 * np.array([one.verdict.gamma for one in kept]), 100 * limits[:, 0], 100 * limits[:, 1],
            100 * np.array([one.known.gamma for one in kept]),
        )  # fmt: skip

    size, found, low, high, known = columns(tests)
    if not len(size):
        raise ParameterError("estimation: no test found a size; give larger faults.")
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 3.3))
        top = 1.15 * max(float(high.max()), float(size.max()))
        left.plot([0, top], [0, top], color=COLOURS["black"], lw=0.8, ls=":", label="true")
        left.errorbar(
            size, found, yerr=[np.maximum(found - low, 0), np.maximum(high - found, 0)], fmt="o", ms=4,
            color=COLOURS["blue"], capsize=2, lw=1.0, label=r"$\hat\gamma_R$, 90 % interval",
        )  # fmt: skip
        left.plot(size, known, "x", color=COLOURS["red"], label="$r_s$ known")
        if len(resistive):
            size_f, found_f, *_ = columns(resistive)
            left.plot(size_f, found_f, "^", color=COLOURS["purple"], mfc="none", label="with contact resistance")
        left.set_xlim(0, 1.08 * size.max())
        left.set_ylim(0, top)
        left.set_xlabel(r"true $\gamma$ / % of the turns")
        left.set_ylabel(r"estimated $\hat\gamma_R$ / %")
        twin = left.secondary_yaxis(
            "right", functions=(lambda y: y * turns / 100, lambda y: 100 * y / turns)
        )  # fmt: skip
        twin.set_ylabel("turns / -")
        left.legend(loc="upper left")
        right.axhline(0, color=COLOURS["black"], lw=0.7)
        right.axhspan(-10, 10, color=COLOURS["green"], alpha=0.12, lw=0, label=r"$\pm$10 %")
        right.plot(size, 100 * (found / size - 1), "o", color=COLOURS["blue"], label=r"$r_s$ not known")
        right.plot(size, 100 * (known / size - 1), "x", color=COLOURS["red"], label="$r_s$ known")
        right.set_xlabel(r"true $\gamma$ / % of the turns")
        right.set_ylabel(r"error of $\hat\gamma_R$ / %")
        right.legend(loc="upper right")
        reach = 1.5 * max(15.0, float(np.abs(100 * (found / size - 1)).max()))
        right.set_ylim(-reach, reach)
    return figure


def unbalance(pairs: Sequence[tuple[Tested, Tested]]) -> Figure:
    """Raw negative-sequence current and the observer's statistic over the unbalance of the supply.

    Parameters
    ----------
    pairs : sequence of (Tested, Tested)
        Healthy and faulty tests.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no pair.
    """
    if not pairs:
        raise ParameterError("unbalance: no test; give at least one pair.")
    level = [100 * abs(one.course.negative) for one, _ in pairs]
    fault = pairs[0][1].course.fault
    words = "healthy" if fault is None else rf"short, $\gamma$ = {100 * fault.size:g} %"
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 2.9))
        for k, (name, colour, marker) in enumerate((("healthy", "blue", "o"), (words, "red", "s"))):
            left.plot(
                level, [pair[k].raw_I2 for pair in pairs], marker + "-", color=COLOURS[colour], lw=0.8, label=name
            )
            right.plot(
                level, [pair[k].verdict.statistic for pair in pairs], marker + "-", color=COLOURS[colour], lw=0.8,
                label=name,
            )  # fmt: skip
        right.axhline(THRESHOLD, color=COLOURS["green"], ls="--", label="threshold")
        left.set_ylabel("raw $|I_2|$ / A")
        right.set_ylabel("statistic / standard deviations")
        for ax in (left, right):
            ax.set_xlabel("negative sequence of the supply / %")
            ax.set_ylim(0, 1.35 * ax.get_ylim()[1])
            ax.legend(loc="upper left", ncols=1)
    return figure


def run_up(runs: Sequence[RunUp]) -> Figure:
    """Observer switched on at standstill while the machine runs up.

    Parameters
    ----------
    runs : sequence of RunUp
        Starts.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is none.
    """
    if not runs:
        raise ParameterError("run_up: no start; give at least one.")
    with style():
        figure, grid = plt.subplots(2, len(runs), figsize=(PAGE, 4.0), sharex="col", squeeze=False)
        for k, run in enumerate(runs):
            good = run.estimates.trusted
            top, low = grid[:, k]
            top.plot(run.t, run.omega, color=COLOURS["grey"], lw=2.6, alpha=0.6, label="true")
            top.plot(run.t, run.omega_s, color=COLOURS["black"], lw=0.8, ls=":", label="synchronous")
            top.plot(run.t, run.estimates.omega, color=COLOURS["orange"], lw=0.8, label="estimate, flagged")
            top.plot(
                run.t, np.where(good, run.estimates.omega, np.nan), color=COLOURS["blue"], lw=1.1,
                label="estimate, trusted",
            )  # fmt: skip
            top.set_title(f"{run.name}: {run.restarts} restart{'s' if run.restarts != 1 else ''}")
            low.plot(run.t, 3 * np.abs(run.estimates.g_c), color=COLOURS["orange"], lw=0.8)
            low.plot(run.t, np.where(good, 3 * np.abs(run.estimates.g_c), np.nan), color=COLOURS["blue"], lw=1.1)
            low.set_yscale("log")
            low.set_ylim(1e-4, 3)
            low.set_xlabel("time / s")
            low.set_xlim(0, run.t[-1])
        grid[0, 0].set_ylabel("speed / (rad/s)")
        grid[1, 0].set_ylabel(r"$3|\hat g_c|$ / -")
        grid[0, -1].legend(loc="lower right")
        figure.align_ylabels(grid[:, 0])
    return figure
