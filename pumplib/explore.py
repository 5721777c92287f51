"""Thesis 4.4.2, 6.7: the bench by hand: a few seconds of pump life, three residuals, sliders that redraw them.

The residuals are the simplest a monitor can have, so that a reader sees what a fault does before any observer
comes in. They use measured signals, the commanded frequency and the nominal machine only, never the truth. The
speed is estimated: the current vector and the flux behind the stator resistance give torque and rotor flux, these
the slip. Each residual is zeroed on the healthy seconds before the fault, as at a commissioning at this very
operating point; what is left is noise, and what the fault does.
"""

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError, PumplibError
from pumplib.hydraulics.pressure import impeller_pressure, impeller_torque
from pumplib.machines.parameters import PumpSet
from pumplib.machines.profile import Profile
from pumplib.machines.profiles import profile_machine
from pumplib.motor.frames import PHASE_AXES
from pumplib.motor.supply import Supply
from pumplib.plots.explore import BenchPicture, Panel
from pumplib.testbench.faults import KINDS, SIZES, Fault
from pumplib.testbench.machine import source
from pumplib.testbench.run import Bench, draw_bench, play, read
from pumplib.testbench.scenario import Course, load_scenario
from pumplib.testbench.sensors import FastSignals, Sensor, SensorSet

if TYPE_CHECKING:
    import ipywidgets
    from matplotlib.figure import Figure

Array = NDArray[Any]
DURATION, ONSET = 5.0, 2.0  # s
FAULTS = ("none", *KINDS)
RANGES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"size": (0.0, 2.0), "valve": (1.25e11, 6e11), "speed_hz": (30.0, 50.0), "noise": (0.0, 5.0)}
)
"""Ranges of the parameters; valve and speed are those of the profile `pump`."""
_SCENARIOS = {"inter_turn": "stator_short_a", "ground": "stator_ground"}  # the others are called pump_<fault>
_WINDOW, _HOP = 0.2, 0.02  # s, length and distance of the windows that residuals are computed from
_SETTLED = 1.0  # s after the onset, from when on a residual's answer is read
_LEAST = {"pressure": 200.0, "torque": 2e-3, "asymmetry": 1e-3}  # Pa, N m, A: no band is narrower


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchView:
    """A few seconds on the bench as a monitor sees them.

    Parameters
    ----------
    fault : Fault or None
        What happens at `ONSET`.
    t : ndarray, shape (n,)
        Times of the signals, s.
    pressure, flow, current : ndarray, shape (n,)
        Measured pressure (Pa) and flow (m3/s), and length of the measured current vector (A).
    t_residual : ndarray, shape (m,)
        Ends of the windows of 0.2 s that the residuals are computed from, s.
    speed : ndarray, shape (m,)
        Estimated speed, rad/s.
    residuals : mapping of str to ndarray, shape (m,)
        "pressure": measured pressure minus the pump curve (3.24) at the estimated speed and the measured flow, Pa.
        "torque": estimated torque minus friction and impeller torque (3.19), N m. "asymmetry": negative sequence
        of the currents, A. All zeroed on the time before the fault.
    bands : mapping of str to float
        Three standard deviations of each residual before the fault, with a least width.
    """

    fault: Fault | None
    t: Array
    pressure: Array
    flow: Array
    current: Array
    t_residual: Array
    speed: Array
    residuals: Mapping[str, Array]
    bands: Mapping[str, float]

    def answer(self, name: str) -> float:
        """Mean of a residual once the fault has settled.

        Parameters
        ----------
        name : str
            "pressure", "torque" or "asymmetry".

        Returns
        -------
        float
            In the residual's unit.
        """
        return float(self.residuals[name][self.t_residual > ONSET + _SETTLED].mean())

    def signature(self) -> dict[str, int]:
        """Which residuals answer, and in which direction.

        Returns
        -------
        dict of str to int
            -1, 0 or 1; 0 if the answer stays within the band.
        """
        return {name: int(np.sign(a)) if abs(a := self.answer(name)) > band else 0 for name, band in self.bands.items()}

    def summary(self) -> str:
        """One line: the fault in its own unit, and the residuals that answer.

        Returns
        -------
        str
        """
        signs = {name: sign for name, sign in self.signature().items() if sign}
        told = ", ".join(f"{name} {'+' if sign > 0 else '−'}" for name, sign in signs.items()) or "none leaves its band"
        what = "healthy"
        if self.fault is not None:
            what = f"{self.fault.kind.replace('_', ' ')}, {self.fault.size:.3g} {_unit(self.fault.kind)}"
        return f"{what}; residuals: {told}"


def fault_of_size(kind: str, share: float) -> Fault | None:
    """Fault of the catalogue, relative to its size in the shipped scenarios.

    Parameters
    ----------
    kind : str
        "none" or one of `pumplib.testbench.faults.KINDS`.
    share : float
        1 is the size of the shipped scenario, 0 no fault. What the catalogue does not allow becomes its limit.

    Returns
    -------
    Fault or None

    Raises
    ------
    ParameterError
        If there is no such fault.
    """
    if kind not in FAULTS:
        raise ParameterError(f"fault {kind!r}: must be one of {', '.join(FAULTS)}.")
    if kind == "none" or share == 0:
        return None
    fault = load_scenario(_SCENARIOS.get(kind, f"pump_{kind}")).fault
    assert fault is not None
    _, _, low, high = SIZES[kind]
    return replace(fault, size=min(max(share * fault.size, low), high), onset=ONSET)


def bench_view(
    fault: str = "leakage",
    size: float = 1.0,
    valve: float = 2.5e11,
    speed_hz: float = 45.0,
    noise: float = 1.0,
    seed: int = 1,
) -> BenchView:
    """Let the bench run for a few seconds and compute the residuals.

    Parameters
    ----------
    fault : str
        "none" or a fault of the catalogue; it steps in at `ONSET`.
    size : float
        Relative to the fault's size in the shipped scenarios.
    valve : float
        Loss coefficient of the valve, Pa s2/m6: small is open.
    speed_hz : float
        Supply frequency, Hz.
    noise : float
        Factor of the noise of every sensor of the profile.
    seed : int
        Of the machine's sensors and of the noise; equal noise for equal seeds, so that only what is changed moves.

    Returns
    -------
    BenchView

    Raises
    ------
    ParameterError
        If a value is outside `RANGES`, or there is no such fault.
    SimulationError
        If the plant leaves the finite numbers.
    """
    for name, value in (("size", size), ("valve", valve), ("speed_hz", speed_hz), ("noise", noise)):
        low, high = RANGES[name]
        if not low <= value <= high:
            raise ParameterError(f"{name} = {value!r}: must be {low:g} to {high:g}.")
    bench = _bench(seed)
    course = Course(
        duration=DURATION,
        supply=Supply(amplitude=325.0, boost=3.0, frequency=Profile(((0.0, speed_hz),), "lines")),
        negative=0.0,
        wave=source(),
        slow={"valve": valve},
        fault=fault_of_size(fault, size),
    )
    fast = read(_noisy(bench.sensors, noise), play(bench.machine, course), np.random.default_rng(seed))
    assert fast.H is not None
    assert fast.Q is not None
    current = 2 / 3 * (fast.current @ PHASE_AXES)
    t_residual, speed, raw = _residuals(profile_machine("pump"), fast, current, speed_hz)
    before = t_residual < ONSET + 0.5 * _HOP
    residuals = {name: r - r[before].mean() for name, r in raw.items()}
    per_sample = round(fast.rate / fast.hydraulic_rate)
    return BenchView(
        fault=course.fault,
        t=np.arange(len(fast.H)) / fast.hydraulic_rate,
        pressure=fast.H,
        flow=fast.Q,
        current=np.abs(current[::per_sample]),
        t_residual=t_residual,
        speed=speed,
        residuals=residuals,
        bands={name: max(3 * float(r[before].std()), _LEAST[name]) for name, r in residuals.items()},
    )


@cache
def _bench(seed: int) -> Bench:
    return draw_bench("pump", np.random.default_rng(seed))


def _unit(kind: str) -> str:
    return SIZES[kind][1].split(", ")[-1]


def _noisy(sensors: SensorSet, factor: float) -> SensorSet:
    def louder(sensor: Sensor) -> Sensor:
        return replace(sensor, noise=factor * sensor.noise)

    assert sensors.pressure is not None
    assert sensors.flow is not None
    a, b, c = map(louder, sensors.current)
    return replace(sensors, current=(a, b, c), pressure=louder(sensors.pressure), flow=louder(sensors.flow))


def _means(x: Array, rate: float) -> Array:
    """Tapered means over the windows, which leave no ripple of twice the supply frequency."""
    n = round(_WINDOW * rate)
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    rows = np.lib.stride_tricks.sliding_window_view(x, n)[:: round(_HOP * rate)]
    means: Array = rows @ (taper / taper.sum())
    return means


def _residuals(
    machine: PumpSet, fast: FastSignals, current: Array, hertz: float
) -> tuple[Array, Array, dict[str, Array]]:
    """Times, estimated speed and residuals before zeroing."""
    motor, pump = machine.motor, machine.pump
    n, w = pump.stages, 2 * np.pi * hertz
    turn = np.exp(-1j * w / fast.rate * np.arange(len(current)))
    v = _means(2 / 3 * (fast.voltage @ PHASE_AXES) * turn, fast.rate)
    i = _means(current * turn, fast.rate)
    negative = np.abs(_means(current * turn.conj(), fast.rate))
    flux = (v - motor.r_s * i) / (1j * w)
    torque = 1.5 * motor.z_p * np.imag(flux.conj() * i)
    leakage = motor.L_s - motor.L_m**2 / motor.L_r
    rotor_flux = motor.L_r / motor.L_m * (flux - leakage * i)
    slip = motor.r_r * torque / (1.5 * motor.z_p * np.abs(rotor_flux) ** 2)
    speed = (w - slip) / motor.z_p
    assert fast.H is not None
    assert fast.Q is not None
    H, Q = _means(fast.H, fast.hydraulic_rate), _means(fast.Q, fast.hydraulic_rate)
    head = n * impeller_pressure.py_func(Q, speed, pump.a_h0, pump.a_h1, pump.a_h2)
    load = n * impeller_torque.py_func(Q, speed, pump.a_t0, pump.a_t1, pump.a_t2) + machine.friction * speed
    t = _WINDOW + _HOP * np.arange(len(H))
    return t, speed, {"pressure": H - head, "torque": torque - load, "asymmetry": negative}


def static_figure(view: BenchView) -> "Figure":
    """Picture of one view, for runs without sliders.

    Parameters
    ----------
    view : BenchView
        What `bench_view` returned.

    Returns
    -------
    Figure
    """
    picture = BenchPicture(DURATION, shown=True)
    _show(picture, view)
    return picture.figure


def _show(picture: BenchPicture, view: BenchView) -> None:
    picture.update(_panels(view), view.summary(), None if view.fault is None else view.fault.onset)


def _panels(view: BenchView) -> list[Panel]:
    def signal(title: str, y: Array, share: float) -> Panel:
        # lowest and highest value of every 10 ms: the eye sees no difference, and the line is drawn much faster
        parts = y.reshape(-1, 10)
        ends = np.stack((parts.min(axis=1), parts.max(axis=1)), 1).ravel()
        return Panel(title=title, t=view.t[::5], y=ends, span=share * float(np.median(y)))

    def residual(title: str, name: str, factor: float) -> Panel:
        band = factor * view.bands[name]
        return Panel(title=title, t=view.t_residual, y=factor * view.residuals[name], span=3 * band, band=band)

    return [
        signal("measured pressure / kPa", view.pressure / 1e3, 0.04),
        signal("measured flow / (m³/h)", view.flow * 3600, 0.1),
        signal("length of the current vector / A", view.current, 0.1),
        residual("residual: pressure − pump curve / kPa", "pressure", 1e-3),
        residual("residual: motor torque − load model / (N m)", "torque", 1.0),
        residual("residual: negative-sequence current / mA", "asymmetry", 1e3),
    ]


def controls(
    fault: str = "leakage",
    size: float = 1.0,
    valve: float = 2.5e11,
    speed_hz: float = 45.0,
    noise: float = 1.0,
    seed: int = 1,
) -> "ipywidgets.VBox | None":
    """Sliders that redraw the picture.

    Parameters
    ----------
    fault, size, valve, speed_hz, noise, seed : str, float, float, float, float, int
        Where the sliders start, see `bench_view`.

    Returns
    -------
    ipywidgets.VBox or None
        None where nobody can move a slider: in a run of the workbook, by papermill, or outside Jupyter.

    Raises
    ------
    ParameterError
        If a value is outside `RANGES`, or there is no such fault.
    """
    if not _has_frontend():
        print("Nobody is here to move sliders: open this notebook in JupyterLab, or change the parameters.")
        return None
    import ipywidgets as w

    wide = {"style": {"description_width": "11em"}, "layout": {"width": "27em"}}
    sliders = {
        "fault": w.Dropdown(
            options=[(name.replace("_", " "), name) for name in FAULTS], value=fault, description="fault", **wide
        ),
        "size": _slider("size", size, 0.05, "fault size", ".2f", wide),
        "valve": _slider("valve", valve, 0.05, "valve, 10¹¹ Pa s²/m⁶", ".2f", wide, 1e11),
        "speed_hz": _slider("speed_hz", speed_hz, 0.5, "speed, Hz", ".1f", wide),
        "noise": _slider("noise", noise, 0.1, "noise factor", ".1f", wide),
    }
    picture = BenchPicture(DURATION)
    image = w.Image(format="png", layout={"width": "792px", "max_width": "100%"})
    status = w.Label()

    def redraw(_: Any = None) -> None:
        begin = time.perf_counter()
        values = {name: slider.value for name, slider in sliders.items()}
        values["valve"] *= 1e11
        try:
            view = bench_view(**values, seed=seed)
        except PumplibError as error:
            status.value = str(error)
            return
        _show(picture, view)
        image.value = picture.png()
        status.value = f"redrawn in {time.perf_counter() - begin:.2f} s"

    for slider in sliders.values():
        slider.observe(redraw, names="value")
    redraw()
    columns = list(sliders.values())
    return w.VBox([w.HBox([w.VBox(columns[:3]), w.VBox([*columns[3:], status])]), image])


def _slider(name: str, value: float, step: float, text: str, form: str, wide: dict[str, Any], unit: float = 1.0) -> Any:
    import ipywidgets as w

    low, high = (end / unit for end in RANGES[name])
    return w.FloatSlider(
        value=value / unit, min=low, max=high, step=step, description=text, readout_format=form, **wide
    )


def _has_frontend() -> bool:
    """Whether the cell was sent by something that can ask its user back, which no headless runner can."""
    if "IPython" not in sys.modules:
        return False
    kernel = getattr(sys.modules["IPython"].get_ipython(), "kernel", None)
    if kernel is None:
        return False
    return bool(kernel.get_parent("shell").get("content", {}).get("allow_stdin", False))
