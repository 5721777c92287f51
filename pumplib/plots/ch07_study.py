"""Thesis 7.1-7.4: numbers behind the figures of the steady-state chapter, on machines that obey its model exactly.

The relations are derived here once more, from the structural model alone: the magnetising inductance is declared
unknown, the minimal over-constrained subsets are found, and in each the motor is eliminated before the pump. What is
left has to be the residuals that are compiled by hand.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.campaign import results
from pumplib.errors import ParameterError
from pumplib.machines import Motor, Profile, load_motor, load_pump
from pumplib.machines.profiles import load_profile, profile_machine
from pumplib.steady.bench_monitor import (
    Judged,
    MonitorSettings,
    Statement,
    SteadyMonitor,
    commission,
    pump_statement,
)
from pumplib.steady.enclose import Enclosure, Method, SetModel
from pumplib.steady.operating import SteadyPoints, steady_points, v_f_voltage
from pumplib.steady.phasors import electrical_parameters, resistance_from_consistency, steady_state
from pumplib.steady.points import channels_of
from pumplib.steady.relations import CHANNELS, PARAMETERS, evaluate, parameter_values, pump_relations
from pumplib.steady.sets import MeasurementErrors
from pumplib.steady.windows import HYPOTHESES, WindowTest
from pumplib.structure.model import StructuralModel
from pumplib.testbench.data_sheets import sensor_spreads
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Run, draw_bench, run
from pumplib.testbench.scenario import load_scenario
from pumplib.testbench.slow import SlowSignals

Array = NDArray[Any]
CODES = {"clogging": "K_f", "friction": "dB", "leakage": "K_l", "cavitation": "f_c", "dry_running": "f_d", "none": ""}
"""Faults of the bench and their symbols in the relations."""
SMALL = {"K_f": (1e8, 1e11), "dB": (1e-6, 1e-2), "K_l": (1e-9, 1e-6), "f_c": (1e-4, 0.34)}
"""Sizes between which the smallest detectable one is searched; dry running begins far above it."""
SENSOR_CLASSES = ("bench", "A", "B")
_STATOR, _AIR_GAP = ("u_d", "u_q", "e_d", "e_q"), ("g_d", "g_q", "r_d", "r_q", "s", "e_T")


def statement(accuracy: str) -> Statement:
    """What is stated about the bench's machines, with another class of voltage and current probes.

    Parameters
    ----------
    accuracy : {"bench", "A", "B"}
        "bench" are the sensors of the pump profile, ideal voltage and current within 0.3 %; classes A and B allow gain
        errors of 0.5 % and 1 % of both. Gains of the three phases differ, the angle does not suffer: what is left of
        them in the positive sequence is their mean.

    Returns
    -------
    Statement

    Raises
    ------
    ParameterError
        If the class is unknown.
    """
    if accuracy not in SENSOR_CLASSES:
        raise ParameterError(f"sensor class {accuracy!r}: must be one of {', '.join(SENSOR_CLASSES)}.")
    grade: Any = None if accuracy == "bench" else accuracy
    spreads = sensor_spreads(load_profile("pump"), accuracy=grade)
    made = pump_statement(profile_machine("pump").motor, spreads)
    errors, gain = made.errors, max(map(abs, spreads["voltage"].gain_error))
    if not gain:
        return made
    noise = errors.relative["V_rms"]
    return replace(
        made,
        errors=MeasurementErrors(
            relative={**errors.relative, "V_rms": noise + gain}, absolute=errors.absolute,
            bias_share={**errors.bias_share, "V_rms": gain / (noise + gain)},
        ),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Reference:
    """Reference motor and pump with exact steady points over the bench's range.

    Parameters
    ----------
    motor : Motor
        The motor.
    values : dict of str to float
        Parameters of the relations.
    points : SteadyPoints
        Every pair of 30-50 Hz and the bench's valve range.
    """

    motor: Motor
    values: dict[str, float]
    points: SteadyPoints


@cache
def reference(pairs: int = 5) -> Reference:
    """Reference machine at a grid of operating points.

    Parameters
    ----------
    pairs : int
        Points of the frequency, and of the valve.

    Returns
    -------
    Reference
    """
    motor = load_motor("reference_1k5")
    values = parameter_values(motor, load_pump("multistage_1k5"))
    hertz, valve = grid(pairs)
    points = steady_points(motor, values, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=valve)
    return Reference(motor=motor, values=values, points=points)


def grid(pairs: int) -> tuple[Array, Array]:
    """Every pair of frequency and valve of the bench's range.

    Parameters
    ----------
    pairs : int
        Points of each.

    Returns
    -------
    hertz, valve : ndarray, shape (pairs**2,)
        Hz and Pa s2/m6.
    """
    hertz, valve = np.meshgrid(np.linspace(30.0, 50.0, pairs), np.geomspace(1.25e11, 6e11, pairs))
    return hertz.ravel(), valve.ravel()


# --- the relations, derived --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Derived:
    """A relation that follows from a minimal over-constrained subset by elimination.

    Parameters
    ----------
    name : str
        R1, R2 or R3, by the fault that it leaves out.
    constraints : tuple of str
        The subset.
    faults : tuple of str
        Faults in it.
    expression : sympy.Expr
        Zero for a healthy pump; omega and T_e stand for entries of `motor`.
    motor : dict of str to sympy.Expr
        E_d and E_q from the electrical signals, omega_slip, omega and T_e from these two.
    """

    name: str
    constraints: tuple[str, ...]
    faults: tuple[str, ...]
    expression: Any
    motor: dict[str, Any]

    def latex(self) -> str:
        """The relation, without the motor part.

        Returns
        -------
        str
        """
        import sympy as sp

        return (
            f"{self.name}:\\quad 0 = {sp.latex(sp.expand(self.expression) if self.name != 'R3' else self.expression)}"
        )


@cache
def without_main_inductance() -> StructuralModel:
    """The steady model with the magnetising inductance as one more unknown: relations from it cannot contain L_m.

    Returns
    -------
    StructuralModel
    """
    from pumplib.structure.pump import steady_state

    model = steady_state()
    L_m = next(symbol for symbol in model.parameters if symbol.name == "L_m")
    return replace(
        model,
        name="pump in steady state, L_m unknown",
        unknown=(*model.unknown, L_m),
        parameters=tuple(symbol for symbol in model.parameters if symbol is not L_m),
    )


@cache
def derived_relations() -> tuple[Derived, ...]:
    """Relations of the subsets that leave out a fault: motor eliminated first, then the pump.

    Returns
    -------
    tuple of Derived
        By name.
    """
    import sympy as sp

    from pumplib.structure.elimination import eliminate, largest_at
    from pumplib.structure.mso import mso_sets

    model = without_main_inductance()
    structure = model.structure()
    at = _symbols_at(_point())
    healthy = dict.fromkeys(model.faults, 0)
    relation = {name: expression.subs(healthy) for name, expression in model.relations.items()}
    inside = [u for u in model.unknown if u.name in structure.unknowns_of((*_STATOR, *_AIR_GAP))]
    motor: dict[str, Any] = {}
    for part, wanted in ((_STATOR, ("E_d", "E_q")), (_AIR_GAP, ("omega_slip", "omega", "T_e"))):
        own = [u for u in inside if u.name in structure.unknowns_of(part) and u.name not in motor]
        solved = eliminate([(name, relation[name]) for name in part], own, prefer=largest_at(at)).values
        motor |= {u.name: sp.simplify(solved[u]) for u in own if u.name in wanted}
    found = []
    for subset in mso_sets(structure):
        faults = structure.faults_of(subset)
        missing = {f.name for f in model.faults} - set(faults)
        if not missing:
            continue
        rest = [name for name in subset if name not in (*_STATOR, *_AIR_GAP)]
        own = [u for u in model.unknown if u not in inside and any(u in relation[n].free_symbols for n in rest)]
        ((_, left),) = eliminate([(name, relation[name]) for name in rest], own, prefer=largest_at(at)).remaining
        name = {"dB": "R1", "K_f": "R2", "K_l": "R3"}[missing.pop()]
        found.append(
            Derived(name=name, constraints=subset, faults=tuple(faults), expression=left, motor=motor)
        )  # fmt: skip
    return tuple(sorted(found, key=lambda one: one.name))


def _point() -> tuple[dict[str, float], float, float]:
    known = reference()
    k = len(known.points.omega) // 2
    values = {name: float(column[k]) for name, column in known.points.signals.items()}
    return values, float(known.points.omega[k]), float(known.points.torque_em[k])


def _symbols_at(point: tuple[dict[str, float], float, float]) -> dict[str, float]:
    """Values of the structural model's symbols at an operating point."""
    x, omega, T_e = point
    known = reference()
    e = electrical_parameters(known.motor)
    i = math.sqrt(2) * x["I_rms"]
    state = steady_state(e, *[x[name] for name in CHANNELS[:4]])
    E_d, E_q, w = float(state.E_d), float(state.E_q), x["omega_e"]
    return {
        **known.values, **{name: x[name] for name in CHANNELS[:4]}, "y_H": x["H"], "y_Q": x["Q"], "R_s": e.r_s,
        "R_r": e.R_r_prime, "L_s": e.L_s_prime, "L_m": e.L_m_prime, "z_p": e.z_p, "omega": omega, "T_e": T_e,
        "H_p": x["H"], "Q_i": x["Q"], "Q_p": x["Q"], "E_d": E_d, "E_q": E_q, "V_d": E_d + e.r_s * i,
        "V_q": E_q + w * e.L_s_prime * i, "omega_slip": w - e.z_p * omega, "I_mq": -E_d / (w * e.L_m_prime),
        "I_md": E_q / (w * e.L_m_prime), "T_p": T_e - e.B * omega,
    }  # fmt: skip


def worst_difference(found: Sequence[Derived], rng: np.random.Generator, count: int = 200) -> dict[str, float]:
    """Largest difference of derived relations and the compiled residuals, at drawn signals and parameters.

    Parameters
    ----------
    found : sequence of Derived
        The relations.
    rng : numpy.random.Generator
        Draws operating points, and signals and parameters up to 3 % beside them, so that no residual is zero.
    count : int
        Number of draws.

    Returns
    -------
    dict of str to float
        Relative to the largest value of the residual itself.
    """
    import sympy as sp

    known = reference()
    rows = rng.integers(len(known.points.omega), size=count)
    x = {name: column[rows] * rng.uniform(0.97, 1.03, count) for name, column in known.points.signals.items()}
    x["H"] = 0.8 * x["H"]  # below the largest head of every drawn pump
    values = {name: known.values[name] * rng.uniform(0.97, 1.03) for name in PARAMETERS}
    compiled = dict(
        zip(("R1", "R2", "R3"), evaluate(pump_relations(known.motor), x, values).T, strict=True)
    )  # fmt: skip
    names = {"y_H": x["H"], "y_Q": x["Q"], "R_s": values["r_s"], "R_r": values["R_r_prime"], "L_s": values["L_s_prime"],
             "z_p": float(known.motor.z_p), **values, **{name: x[name] for name in CHANNELS[:4]}}  # fmt: skip
    out = {}
    for one in found:
        whole = one.expression
        while inside := {s: one.motor[s.name] for s in whole.free_symbols if s.name in one.motor}:
            whole = whole.xreplace(inside)
        symbols = sorted(whole.free_symbols, key=str)
        value = sp.lambdify(symbols, whole, "numpy")(*(names[s.name] for s in symbols))
        out[one.name] = float(np.abs(value - compiled[one.name]).max() / np.abs(compiled[one.name]).max())
    return out


# --- sets --------------------------------------------------------------------------------------------------------


def beyond_linear(model: SetModel, signals: Mapping[str, Array], output: str, steps: int = 41) -> tuple[Array, Array]:
    """How a residual leaves its first-order Taylor set on the way to the corner where that set has its upper end.

    Parameters
    ----------
    model : SetModel
        The sets.
    signals : mapping of str to ndarray, shape (1,)
        One operating point.
    output : {"R1", "R2", "R3"}
        The residual.
    steps : int
        Points between the two opposite corners.

    Returns
    -------
    way, excess : ndarray, shape (steps,)
        Position, -1 and 1 at the two corners, and residual minus its linear approximation, over the set's radius.
    """
    at = model.relations.outputs.index(output)
    x = np.stack([np.asarray(signals[name], dtype=float) for name in model.relations.channels], axis=1)[:1]
    edges = 1e-4 * np.vstack((np.eye(model.size), -np.eye(model.size)))
    moved = model.point(np.repeat(x, len(edges), axis=0), edges)[:, at]
    slope = (moved[: model.size] - moved[model.size :]) / 2e-4
    way = np.linspace(-1.0, 1.0, steps)
    value = model.point(np.repeat(x, steps, axis=0), way[:, None] * np.sign(slope))[:, at]
    middle, radius = model.point(x, np.zeros((1, model.size)))[0, at], np.abs(slope).sum()
    return way, (value - middle - way * radius) / radius


def ends_beyond_linear(
    model: SetModel, signals: Mapping[str, Array], methods: Sequence[Method]
) -> dict[str, dict[str, tuple[float, float]]]:
    """How far the ends of rigorous sets lie beyond those of the first-order Taylor set.

    Parameters
    ----------
    model : SetModel
        The sets.
    signals : mapping of str to ndarray, shape (1,)
        One operating point.
    methods : sequence of str
        Of `pumplib.steady.enclose.METHODS`.

    Returns
    -------
    dict
        Residual to method to lower and upper end beside the linear one, over the radius of the linear set.
    """
    linear = model.enclose(signals, "linear")
    found = {method: model.enclose(signals, method) for method in methods}
    radius = 0.5 * linear.width[0]
    return {
        name: {
            method: (float((one.lo - linear.lo)[0, k] / radius[k]), float((one.hi - linear.hi)[0, k] / radius[k]))
            for method, one in found.items()
        }
        for k, name in enumerate(model.relations.outputs)
    }


def smallest_sizes(
    model: SetModel, known: Reference, pairs: int = 5, count: int = 60, method: Method = "affine"
) -> dict[str, Array]:
    """Smallest size of each fault that drives zero out of a set, at every operating point.

    Parameters
    ----------
    model : SetModel
        The sets, around the reference machine.
    known : Reference
        The machine, which is nominal and measured without error.
    pairs : int
        See `grid`.
    count : int
        Sizes that are tried, geometrically spaced within `SMALL`.
    method : str
        Of the sets.

    Returns
    -------
    dict of str to ndarray, shape (pairs**2,)
        Infinite where no size within `SMALL` is found.
    """
    hertz, valve = grid(pairs)
    found = {}
    for fault, (low, high) in SMALL.items():
        sizes = np.geomspace(low, high, count)
        shape = (count, len(hertz))
        points = steady_points(
            known.motor, known.values, V_rms=np.tile(v_f_voltage(hertz), count), frequency_hz=np.tile(hertz, count),
            valve=np.tile(valve, count), faults={fault: np.repeat(sizes, len(hertz))},
        )  # fmt: skip
        out = model.enclose(points.signals, method).alarm.any(axis=1).reshape(shape)
        found[fault] = np.where(out.any(axis=0), sizes[out.argmax(axis=0)], np.inf)
    return found


def smallest_in_windows(
    model: SetModel, known: Reference, *, healthy: int | None, recent: int, rng: np.random.Generator, halvings: int = 12
) -> dict[str, float]:
    """Smallest size of each fault that a window of drawn operating points of the nominal machine proves.

    Parameters
    ----------
    model : SetModel
        The sets.
    known : Reference
        The machine, which is nominal and measured without error.
    healthy : int or None
        Points declared healthy; None for a window without such a block.
    recent : int
        Recent points, all with the fault.
    rng : numpy.random.Generator
        Draws the operating points.
    halvings : int
        Steps of the bisection on a logarithmic scale.

    Returns
    -------
    dict of str to float
        Infinite where the largest size is not found.
    """
    hertz = rng.uniform(30.0, 50.0, (healthy or 0) + recent)
    valve = np.exp(rng.uniform(math.log(1.25e11), math.log(6e11), len(hertz)))

    def signals(part: slice, **faults: float) -> dict[str, Array]:
        f = hertz[part]
        return steady_points(
            known.motor, known.values, V_rms=v_f_voltage(f), frequency_hz=f, valve=valve[part], faults=faults
        ).signals

    block = None if healthy is None else signals(slice(0, healthy))
    tester, late = WindowTest(model, block), slice((healthy or 0), None)
    found = {}
    for fault, (low, high) in SMALL.items():
        if not tester.test(signals(late, **{fault: high}), ("none",)).fault:
            found[fault] = math.inf
            continue
        for _ in range(halvings):
            middle = math.sqrt(low * high)
            hit = tester.test(signals(late, **{fault: middle}), ("none",)).fault
            low, high = (low, middle) if hit else (middle, high)
        found[fault] = high
    return found


# --- the relation that is left over ------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FluxMonitor:
    """The consistency relation at steady points, solved for L_m' and, badly, for r_s.

    Parameters
    ----------
    flux : ndarray, shape (n,)
        Flux linkage behind L_s', amplitude, V s.
    L_m_prime : ndarray, shape (n,)
        H.
    r_s : ndarray, shape (n,)
        Stator resistance with the data sheet's L_m', ohm; NaN where no resistance fulfils the relation.
    believed : tuple of float
        L_m', H, and r_s, ohm, of the data sheet.
    """

    flux: Array
    L_m_prime: Array
    r_s: Array
    believed: tuple[float, float]


def flux_monitor(motor: Motor, signals: Mapping[str, Array]) -> FluxMonitor:
    """Solve the consistency relation at steady points.

    Parameters
    ----------
    motor : Motor
        Data sheet.
    signals : mapping of str to ndarray, shape (n,)
        Electrical channels of steady points, SI.

    Returns
    -------
    FluxMonitor
    """
    e = electrical_parameters(motor)
    V, I, w, phi = (np.asarray(signals[name], dtype=float) for name in CHANNELS[:4])
    found = steady_state(e, V, I, w, phi)
    with np.errstate(invalid="ignore"):
        r_s = resistance_from_consistency(e.voltage * V, e.current * I, w, phi, e.L_s_prime, e.L_m_prime)
    return FluxMonitor(flux=found.flux, L_m_prime=found.L_m_prime, r_s=np.asarray(r_s), believed=(e.L_m_prime, e.r_s))


# --- a run on the bench ------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Shown:
    """A machine of the bench, its monitor, and two further runs.

    Parameters
    ----------
    monitor : SteadyMonitor
        Commissioned on one healthy run.
    warm : float
        True change of r_s in that run against the data sheet, -.
    run, slow, judged : Run, SlowSignals, Judged
        The run with the fault, what a cheap controller sees of it, and what the monitor says.
    healthy, healthy_slow : Run, SlowSignals
        Another healthy run.
    """

    monitor: SteadyMonitor
    warm: float
    run: Run
    slow: SlowSignals
    judged: Judged
    healthy: Run
    healthy_slow: SlowSignals

    @property
    def onset(self) -> float | None:
        """Time of the fault, s; None without one."""
        return None if self.run.course.fault is None else self.run.course.fault.onset


def show(accuracy: str, fault: Fault | None, recent: int, rng: np.random.Generator) -> Shown:
    """Draw a machine, commission it on one healthy run, and let it run with a fault and once more healthy.

    Parameters
    ----------
    accuracy : {"bench", "A", "B"}
        See `statement`.
    fault : Fault or None
        The fault; its onset is drawn.
    recent : int
        Points of a window.
    rng : numpy.random.Generator
        Randomness.

    Returns
    -------
    Shown

    Raises
    ------
    ParameterError
        If the class is unknown.
    """
    stated, grade = statement(accuracy), None if accuracy == "bench" else accuracy
    settings, scenario = MonitorSettings(recent=recent), load_scenario("pump_healthy")
    bench = draw_bench("pump", rng, accuracy=grade)  # type: ignore[arg-type]
    first, done, again = (run(replace(scenario, fault=f), rng, bench) for f in (None, fault, None))
    slow = [one.slow(settings.step, settings.step) for one in (first, done, again)]
    monitor = commission(slow[0], stated, settings)
    warm = first.course.slow["r_s"]
    return Shown(
        monitor=monitor,
        warm=float(np.mean(warm.values if isinstance(warm, Profile) else warm)) - 1.0,
        run=done,
        slow=slow[1],
        judged=monitor.judge(slow[1]),
        healthy=again,
        healthy_slow=slow[2],
    )


def moving_sets(monitor: SteadyMonitor, slow: SlowSignals, method: Method = "affine") -> tuple[Array, Enclosure]:
    """Sets from the parameter set alone for every position of the window, whether the pump is at rest or not.

    Parameters
    ----------
    monitor : SteadyMonitor
        Commissioned.
    slow : SlowSignals
        Of the run.
    method : str
        Of the sets.

    Returns
    -------
    t : ndarray, shape (n,)
        End of the windows, s.
    sets : Enclosure
        Without a margin.
    """
    n = monitor.settings.samples
    means = {
        name: np.convolve(x, np.full(n, 1.0 / n), mode="valid") for name, x in channels_of(slow).items()
    }  # fmt: skip
    whole = np.all([np.isfinite(x) for x in means.values()], axis=0)
    t = slow.t[n - 1 :] + 0.5 * monitor.settings.step
    return t[whole], monitor.model.enclose({name: x[whole] for name, x in means.items()}, method)


def plain_sets(monitor: SteadyMonitor, judged: Judged, method: Method) -> Enclosure:
    """Sets of the steady points from the parameter set alone, by a method of choice, the monitor's margin added.

    Parameters
    ----------
    monitor : SteadyMonitor
        Commissioned.
    judged : Judged
        What it said about the run.
    method : str
        Of `pumplib.steady.enclose.METHODS`.

    Returns
    -------
    Enclosure
    """
    found = monitor.model.enclose(judged.points.signals, method)
    margin = np.array([monitor.margin[0], monitor.margin[1], monitor.margin[1]])
    return replace(found, lo=found.lo - margin, hi=found.hi + margin)


@dataclass(frozen=True, kw_only=True, slots=True)
class Said:
    """What a window says at a steady point.

    Parameters
    ----------
    t : float
        s.
    tested, possible : tuple of str
        Hypotheses that were tested, and those that are not refuted.
    """

    t: float
    tested: tuple[str, ...]
    possible: tuple[str, ...]


def said_over_time(monitor: SteadyMonitor, judged: Judged) -> tuple[Said, ...]:
    """Health at every steady point, and the faults that are left after the first alarm, point by point.

    A point counts for the hypotheses if it began after the alarm, so that an abrupt fault is in all of it.

    Parameters
    ----------
    monitor : SteadyMonitor
        Commissioned.
    judged : Judged
        What it said about the run.

    Returns
    -------
    tuple of Said
    """
    points, found = judged.points, []
    first = points.t[int(np.argmax(judged.window))] if judged.window.any() else math.inf
    after: list[int] = []
    left: tuple[str, ...] = HYPOTHESES[1:]
    for k, t in enumerate(points.t):
        tested: tuple[str, ...] = ("none",)
        possible: tuple[str, ...] = () if judged.window[k] else ("none",)
        if points.start[k] >= first - 1e-9 and len(after) < monitor.settings.recent:
            after.append(k)
            left = monitor.test.test(points.take(after), left, sizes=False).possible if left else ()
            tested, possible = HYPOTHESES, (*possible, *left)
        found.append(Said(t=float(t), tested=tuple(tested), possible=tuple(possible)))
    return tuple(found)


def campaign_table(name: str) -> Any:
    """Committed table of a campaign, None if the campaign was not run; a damaged one is an error.

    Parameters
    ----------
    name : str
        Of the campaign.

    Returns
    -------
    pandas.DataFrame or None
    """
    if not (results.RESULTS / f"{name}.json").exists():
        return None
    return results.read(name).table
