"""Thesis 3.2.1, 3.2.3, 3.2.4: steady state of the motor as a per-phase circuit, with the losses the thesis neglects.

The circuit is the phasor form of (3.7): r_s, L_ls, L_m, L_lr and r_r/s. Beyond the thesis (which assumes no iron
loss, constant resistances and no stray load) it takes `MotorLosses`: resistances at the winding temperature, a
core-loss conductance, friction torque proportional to the speed and stray-load torque proportional to the square
of the winding current. With ``losses=None`` it is (3.7) exactly.

Where the core conductance sits is a choice (argument `core_at`): ``"airgap"`` puts it across the main inductance,
as T circuits are usually drawn; ``"stator"`` puts it behind r_s, in front of the leakage. The voltage of the first is
2-3 % lower, so its core loss is about 5 % lower; that decides the shaft power at light load.

Effective (rms) values throughout; voltage and current with the suffix ``line`` are at the terminals.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.machines import Motor, MotorLosses, from_si

Array = NDArray[Any]
CoreAt = Literal["airgap", "stator"]
_GOLDEN = (math.sqrt(5) - 1) / 2
_FREQUENCY_RATIO = 3.0  # beyond three times the rated frequency an entry in rad/s is more likely than a drive


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class OperatingPoint:
    """Steady operating points of a motor; every field has the common shape of the inputs.

    Parameters
    ----------
    voltage_line_rms : ndarray
        Line-to-line voltage, V.
    current_line_rms : ndarray
        Line current, A.
    frequency_hz : ndarray
        Supply frequency, Hz.
    power_factor : ndarray
        cos phi, lagging; negative when generating.
    slip : ndarray
        1 - z_p omega / (2 pi f).
    omega : ndarray
        Shaft speed, rad/s.
    torque_em : ndarray
        Electromagnetic torque T_e, N m.
    torque_shaft : ndarray
        Torque at the shaft end, after friction and stray-load torque, N m.
    power_in, power_airgap, power_shaft : ndarray
        Electric power, power through the air gap and shaft power, W.
    loss_stator, loss_core, loss_rotor, loss_friction, loss_stray : ndarray
        The five losses, W. ``power_in`` is their sum plus ``power_shaft``.
    voltage_airgap : ndarray
        Voltage of a phase behind the stator leakage, V rms.
    flux_airgap : ndarray
        Amplitude of the flux linkage of a phase behind the stator leakage, V s.
    efficiency : ndarray
        ``power_shaft / power_in``; NaN where the machine does not take electric power.
    """

    voltage_line_rms: Array
    current_line_rms: Array
    frequency_hz: Array
    power_factor: Array
    slip: Array
    omega: Array
    torque_em: Array
    torque_shaft: Array
    power_in: Array
    power_airgap: Array
    power_shaft: Array
    loss_stator: Array
    loss_core: Array
    loss_rotor: Array
    loss_friction: Array
    loss_stray: Array
    voltage_airgap: Array
    flux_airgap: Array
    efficiency: Array

    @property
    def speed_rpm(self) -> Array:
        """Shaft speed, rpm."""
        return np.asarray(from_si(self.omega, "rpm"))


@dataclass(frozen=True, kw_only=True, slots=True)
class _Circuit:
    """The circuit's elements at working temperature, per winding, and the loss torques."""

    r_s: float
    r_r: float
    L_ls: float
    L_m: float
    L_lr: float
    core_stator: float  # core-loss conductance behind r_s, S
    core_airgap: float  # core-loss conductance across L_m, S
    friction: float  # torque per speed, N m s
    stray: float  # torque per squared winding current, N m/A2
    z_p: int
    voltage: float  # winding voltage / line voltage
    current: float  # line current / winding current


def _circuit(motor: Motor, losses: MotorLosses | None, core_at: CoreAt) -> _Circuit:
    if core_at not in ("airgap", "stator"):
        raise ParameterError(f'core_at = {core_at!r}: must be "airgap" (across L_m) or "stator" (behind r_s).')
    delta = motor.connection == "delta"
    warm_s = warm_r = 1.0
    core = stray = 0.0
    friction = motor.B
    if losses is not None:
        rise = losses.temperature - losses.temperature_reference
        warm_s, warm_r = 1 + losses.alpha_s * rise, 1 + losses.alpha_r * rise
        core = losses.core_loss / (3 * losses.core_voltage**2)
        friction += losses.friction_loss / losses.loss_speed**2
        stray = losses.stray_loss / (losses.loss_speed * losses.stray_current**2)
    return _Circuit(
        r_s=motor.r_s * warm_s,
        r_r=motor.r_r * warm_r,
        L_ls=motor.L_ls,
        L_m=motor.L_m,
        L_lr=motor.L_lr,
        core_stator=core if core_at == "stator" else 0.0,
        core_airgap=core if core_at == "airgap" else 0.0,
        friction=friction,
        stray=stray,
        z_p=motor.z_p,
        voltage=1.0 if delta else 1 / math.sqrt(3),
        current=math.sqrt(3) if delta else 1.0,
    )


def _numbers(
    name: str, value: ArrayLike, unit: str, low: float, high: float, remedy: str, open_low: bool = False
) -> Array:
    """Check an array of numbers against its limits and return it as float."""
    try:
        x = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ParameterError(f"{name} = {value!r}: must be numbers in {unit}. {remedy}") from None
    bad = ~np.isfinite(x)
    if np.any(bad):
        raise ParameterError(f"{name} = {x[bad].flat[0]} {unit} at index {_index(bad)}: must be finite. {remedy}")
    bad = (x < low) | (x > high) | ((x == low) & open_low)
    if np.any(bad):
        limit = f"{'>' if open_low else '>='} {low:g} {unit}" + (f" and <= {high:g} {unit}" if high < math.inf else "")
        raise ParameterError(f"{name} = {x[bad].flat[0]:g} {unit} at index {_index(bad)}: must be {limit}. {remedy}")
    return x


def _index(bad: Array) -> tuple[int, ...]:
    return tuple(int(k) for k in np.argwhere(bad)[0])


def _same_shape(**named: Array) -> list[Array]:
    try:
        return list(np.broadcast_arrays(*named.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in named.items())
        raise ParameterError(f"shapes do not fit together: {shapes}; give scalars or arrays of one shape.") from None


def _voltage(value: ArrayLike) -> Array:
    return _numbers("voltage_line_rms", value, "V", 0.0, 2e4, "Give the line-to-line voltage as rms value in V.", True)


def _frequency(value: ArrayLike, motor: Motor) -> Array:
    high = 500.0 if motor.rated_frequency is None else _FREQUENCY_RATIO * motor.rated_frequency
    return _numbers(
        "frequency_hz", value, "Hz", 0.0, high,
        "Give the supply frequency in Hz; a larger number is probably rad/s (divide by 2 pi) or the speed in rpm.",
        True,
    )  # fmt: skip


def _point(
    c: _Circuit, V: Array, I: Array, f: Array, pf: Array, slip: Array, E: Array, losses: tuple[Array, Array, Array]
) -> OperatingPoint:
    """Collect an operating point; `losses` are stator, core and air-gap power, V and I line quantities."""
    loss_stator, loss_core, airgap = losses
    omega_s = 2 * math.pi * f / c.z_p
    omega = (1 - slip) * omega_s
    # T_e = P_airgap / synchronous speed, the torque (3.11) in steady state
    torque_em = airgap / omega_s
    friction = c.friction * omega
    stray = c.stray * (I / c.current) ** 2 * np.sign(omega)
    shaft = torque_em - friction - stray
    power_in = math.sqrt(3) * V * I * pf
    efficiency = np.full(np.shape(power_in), np.nan)
    np.divide(shaft * omega, power_in, out=efficiency, where=power_in > 0)
    return OperatingPoint(
        voltage_line_rms=V,
        current_line_rms=I,
        frequency_hz=f,
        power_factor=pf,
        slip=slip,
        omega=omega,
        torque_em=torque_em,
        torque_shaft=shaft,
        power_in=power_in,
        power_airgap=airgap,
        power_shaft=shaft * omega,
        loss_stator=loss_stator,
        loss_core=loss_core,
        loss_rotor=slip * airgap,
        loss_friction=friction * omega,
        loss_stray=stray * omega,
        voltage_airgap=E,
        flux_airgap=math.sqrt(2) * E / (2 * math.pi * f),
        efficiency=efficiency,
    )


def from_electrical(
    motor: Motor,
    losses: MotorLosses | None,
    voltage_line_rms: ArrayLike,
    current_line_rms: ArrayLike,
    frequency_hz: ArrayLike,
    power_factor: ArrayLike,
    *,
    core_at: CoreAt = "airgap",
) -> OperatingPoint:
    """Speed, torque and shaft power from electric measurements alone.

    The air-gap voltage and power follow from the measured phasors. The slip is taken from these two, not from
    the rotor current, which at light load is the small difference of two large currents and carries every error
    of L_m. The measured reactive power therefore enters through the air-gap voltage only.

    Parameters
    ----------
    motor : Motor
        The motor; resistances at the reference temperature of `losses`.
    losses : MotorLosses or None
        Losses and temperatures; None for the thesis's lossless iron.
    voltage_line_rms, current_line_rms : array_like
        Line-to-line voltage, V, and line current, A, rms. All four inputs broadcast.
    frequency_hz : array_like
        Hz.
    power_factor : array_like
        cos phi of the lagging current, -1..1; negative when generating.
    core_at : {"airgap", "stator"}
        Place of the core-loss conductance, see the module's text.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    ParameterError
        If an input is not finite, outside its limits or of another shape, or if the measured power is more
        than the air gap can transmit at the measured voltage (inputs that do not belong together).

    References
    ----------
    Thesis (3.7) and (3.11) in steady state; losses beyond the thesis.
    """
    c = _circuit(motor, losses, core_at)
    V, I, f, pf = _same_shape(
        voltage_line_rms=_voltage(voltage_line_rms),
        current_line_rms=_numbers(
            "current_line_rms", current_line_rms, "A", 0.0, 1e5, "Give the line current as rms value in A."
        ),
        frequency_hz=_frequency(frequency_hz, motor),
        power_factor=_numbers(
            "power_factor", power_factor, "-", -1.0, 1.0,
            "Give cos phi as a fraction; divide a number in percent by 100.",
        ),
    )  # fmt: skip
    omega_e = 2 * math.pi * f
    current = I / c.current * (pf - 1j * np.sqrt(1 - pf**2))
    behind_r = c.voltage * V - c.r_s * current
    E = np.abs(behind_r - 1j * omega_e * c.L_ls * (current - c.core_stator * behind_r))
    loss_stator = 3 * c.r_s * (I / c.current) ** 2
    loss_core = 3 * (c.core_stator * np.abs(behind_r) ** 2 + c.core_airgap * E**2)
    # as a difference of powers, so that the balance is exact also when measurements contradict the circuit
    P = math.sqrt(3) * V * I * pf - loss_stator - loss_core
    # P = 3 E^2 R/(R^2 + X^2) with R = r_r/s; the root with the smaller slip is the stable one
    inside = (3 * E**2) ** 2 - (2 * P * omega_e * c.L_lr) ** 2
    if np.any(inside < 0):
        k = _index(inside < 0)
        raise ParameterError(
            f"voltage {V[k]:g} V, current {I[k]:g} A, power factor {pf[k]:g} at index {k}: the air-gap power of "
            f"{P[k]:.4g} W is more than the rotor can take at {E[k]:.4g} V behind the stator leakage. The inputs do "
            "not belong to this motor: check line against phase values, connection (Y or delta) and units."
        )
    slip = 2 * c.r_r * P / (3 * E**2 + np.sqrt(inside))
    return _point(c, V, I, f, pf, slip, E, (loss_stator, loss_core, P))


def at_slip(
    motor: Motor,
    losses: MotorLosses | None,
    voltage_line_rms: ArrayLike,
    frequency_hz: ArrayLike,
    slip: ArrayLike,
    *,
    core_at: CoreAt = "airgap",
) -> OperatingPoint:
    """Operating point at a given slip.

    Parameters
    ----------
    motor : Motor
        The motor.
    losses : MotorLosses or None
        Losses and temperatures; None for the thesis's model.
    voltage_line_rms : array_like
        Line-to-line voltage, V rms. The inputs broadcast.
    frequency_hz : array_like
        Hz.
    slip : array_like
        -1..1; 1 is standstill, negative values generate.
    core_at : {"airgap", "stator"}
        Place of the core-loss conductance, see the module's text.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    ParameterError
        If an input is not finite, outside its limits or of another shape.

    References
    ----------
    Thesis (3.7) in steady state.
    """
    V, f, s = _same_shape(
        voltage_line_rms=_voltage(voltage_line_rms),
        frequency_hz=_frequency(frequency_hz, motor),
        slip=_numbers("slip", slip, "-", -1.0, 1.0, "Slip is a fraction of the synchronous speed, not rpm or percent."),
    )
    return _at_slip(_circuit(motor, losses, core_at), V, f, s)


def _at_slip(c: _Circuit, V: Array, f: Array, s: Array) -> OperatingPoint:
    w = 2 * math.pi * f
    # admittances, so that s = 0 (open rotor) needs no special case
    rotor = s / (c.r_r + 1j * s * w * c.L_lr)
    parallel = 1 / (1 / (1j * w * c.L_m) + c.core_airgap + rotor)
    leakage = 1j * w * c.L_ls
    inner = c.core_stator + 1 / (leakage + parallel)
    behind_r = c.voltage * V / (1 + c.r_s * inner)
    current = inner * behind_r
    airgap = behind_r * parallel / (leakage + parallel)
    I_winding, E = np.abs(current), np.abs(airgap)
    # cos phi is zero, not undefined, for a machine without current
    pf = np.real(current) / np.where(I_winding > 0, I_winding, 1.0)
    return _point(
        c, V, I_winding * c.current, f, pf, s, E,
        (
            3 * c.r_s * I_winding**2,
            3 * (c.core_stator * np.abs(behind_r) ** 2 + c.core_airgap * E**2),
            3 * E**2 * np.real(rotor),
        ),
    )  # fmt: skip


def _pull_out_slip(c: _Circuit, V: Array, f: Array, power: bool) -> Array:
    """Slip of the largest shaft torque (or shaft power), by golden section around the lossless closed form."""
    w = 2 * math.pi * f
    # source impedance that the rotor branch sees
    front = 1 / (1 / c.r_s + c.core_stator) + 1j * w * c.L_ls
    source = 1 / (1 / front + 1 / (1j * w * c.L_m) + c.core_airgap)
    s_e = c.r_r / np.abs(source + 1j * w * c.L_lr)
    # friction and stray load move the largest shaft torque a little off the one of T_e, to either side
    low, high = np.zeros_like(s_e), np.minimum(2 * s_e, 1.0)

    def value(s: Array) -> Array:
        point = _at_slip(c, V, f, s)
        return point.power_shaft if power else point.torque_shaft

    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    # 40 steps narrow the bracket to 4e-9 of its width, the resolution of a maximum in double precision
    for _ in range(40):
        rising = value(a) < value(b)
        low, high = np.where(rising, a, low), np.where(rising, high, b)
        a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    return 0.5 * (low + high)


def pull_out(
    motor: Motor,
    losses: MotorLosses | None,
    voltage_line_rms: ArrayLike,
    frequency_hz: ArrayLike,
    *,
    core_at: CoreAt = "airgap",
) -> OperatingPoint:
    """Operating point of the largest shaft torque, the pull-out torque.

    Parameters
    ----------
    motor : Motor
        The motor.
    losses : MotorLosses or None
        Losses and temperatures; None for the thesis's model.
    voltage_line_rms : array_like
        Line-to-line voltage, V rms.
    frequency_hz : array_like
        Hz.
    core_at : {"airgap", "stator"}
        Place of the core-loss conductance, see the module's text.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    ParameterError
        If an input is not finite, outside its limits or of another shape.
    """
    V, f = _same_shape(voltage_line_rms=_voltage(voltage_line_rms), frequency_hz=_frequency(frequency_hz, motor))
    c = _circuit(motor, losses, core_at)
    return _at_slip(c, V, f, _pull_out_slip(c, V, f, power=False))


def from_torque(
    motor: Motor,
    losses: MotorLosses | None,
    voltage_line_rms: ArrayLike,
    frequency_hz: ArrayLike,
    *,
    shaft_power_w: ArrayLike | None = None,
    shaft_torque_nm: ArrayLike | None = None,
    core_at: CoreAt = "airgap",
) -> OperatingPoint:
    """Current, speed, power factor and efficiency from the load at the shaft.

    Parameters
    ----------
    motor : Motor
        The motor.
    losses : MotorLosses or None
        Losses and temperatures; None for the thesis's model.
    voltage_line_rms : array_like
        Line-to-line voltage, V rms. The inputs broadcast.
    frequency_hz : array_like
        Hz.
    shaft_power_w, shaft_torque_nm : array_like
        Load at the shaft, W or N m, not negative; exactly one of the two.
    core_at : {"airgap", "stator"}
        Place of the core-loss conductance, see the module's text.

    Returns
    -------
    OperatingPoint
        The stable point between synchronous speed and pull-out.

    Raises
    ------
    ParameterError
        If an input is not finite, outside its limits or of another shape, if both or neither load is given,
        or if the load exceeds what the motor can carry; the message names the pull-out torque.

    References
    ----------
    Thesis (3.7) and (3.11) in steady state; losses beyond the thesis.
    """
    if (shaft_power_w is None) == (shaft_torque_nm is None):
        raise ParameterError("give either shaft_power_w or shaft_torque_nm, not both and not neither.")
    power = shaft_power_w is not None
    name, unit = ("shaft_power_w", "W") if power else ("shaft_torque_nm", "N m")
    load = shaft_power_w if power else shaft_torque_nm
    assert load is not None
    V, f, demand = _same_shape(
        voltage_line_rms=_voltage(voltage_line_rms),
        frequency_hz=_frequency(frequency_hz, motor),
        **{name: _numbers(name, load, unit, 0.0, 1e8, f"Give the load of a running motor in {unit}.")},
    )
    c = _circuit(motor, losses, core_at)
    high = _pull_out_slip(c, V, f, power)
    top = _at_slip(c, V, f, high)
    largest = top.power_shaft if power else top.torque_shaft
    if np.any(demand > largest):
        k = _index(demand > largest)
        torque = _at_slip(c, V, f, _pull_out_slip(c, V, f, power=False)).torque_shaft[k]
        raise ParameterError(
            f"{name} = {demand[k]:g} {unit} at index {k}: the motor pulls out at {torque:.4g} N m and carries at most "
            f"{largest[k]:.4g} {unit} at {V[k]:g} V and {f[k]:g} Hz. Check W against kW, voltage and connection."
        )
    # at synchronous speed the shaft gives nothing (friction only), at `high` at least the demand: a sure bracket
    low = np.zeros_like(high)
    for _ in range(70):
        middle = 0.5 * (low + high)
        point = _at_slip(c, V, f, middle)
        short = (point.power_shaft if power else point.torque_shaft) < demand
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return _at_slip(c, V, f, 0.5 * (low + high))
