"""Thesis 5.2.2, 5.2.3: what the stator observer computes before it starts: exact steps as polynomials, and its gain.

The step x_{k+1} = E x_k + F_0 v_k + F_1 v_{k+1} (voltage a straight line between samples) is analytic in the speed.
The matrix of (3.7) is A_0 + j omega A_1 with real A_0, A_1, so every entry of E, F_0, F_1 is a power series in
j omega with real coefficients: its real part is even in the speed, its imaginary part odd. Ten coefficients an
entry give it to rounding over the whole speed range (a test compares with the matrix exponential), at a tenth of
the operations of the closed form with its complex square root and hyperbolic functions.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Parameters, Quantity, check_value
from pumplib.motor.frames import B_V_DELTA, C_I_DELTA
from pumplib.observers.certificate import Certificate, Gain

Array = NDArray[Any]
DEGREE = 9  # of the polynomials in the speed
VERTICES, DENSE = 9, 201
RATES = (1_000.0, 50_000.0)  # Hz
_TERMS = 18  # of the exponential series at norm 1/2
_TICK = 1e-3  # s between two looks of the supervision
_NOISE = 0.1  # A, of the current beside the model; only its ratio to the spreads at a start matters


@dataclass(frozen=True, kw_only=True, slots=True)
class ObserverSettings(Parameters):
    """How quick the stator observer follows, and when it waits, restarts or doubts itself.

    The time constants are those of a constant-speed, constant-fault motor: a step of the parameter is followed to
    63 % within one of them.

    References
    ----------
    Thesis 5.2.2 (reconstructed): gain from a matrix inequality, adaptation of speed and fault.
    """

    tau_speed: Annotated[float, Quantity("s", "time constant of the speed", 1e-4, 10.0)] = 0.014
    tau_fault: Annotated[float, Quantity("s", "time constant of the fault coefficient", 1e-4, 10.0)] = 0.07
    tau_common: Annotated[float, Quantity("s", "lag of the common-mode part of the fault", 1e-3, 10.0)] = 0.05
    tau_slope: Annotated[
        float, Quantity("s", "lag of the supply's slope, which the speed follows; 0 is off", 0.0, 10.0)
    ] = 0.05
    speed_spread: Annotated[float, Quantity("rad/s", "uncertainty of the speed at a start", 0.1, 500.0)] = 30.0
    fault_spread: Annotated[float, Quantity("-", "uncertainty of the fault coefficient at a start", 1e-4, 1.0)] = 0.03
    start_voltage: Annotated[float, Quantity("V", "amplitude that the observer waits for", 0.0, 2e4, True)] = 65.0
    start_speed: Annotated[float, Quantity("rad/s", "shaft speed to start from; 0 starts at synchronism", 0.0, 5e3)] = (
        0.0
    )
    settle: Annotated[float, Quantity("s", "time after a start before an estimate is trusted", 0.0, 10.0)] = 0.3
    band_low: Annotated[float, Quantity("-", "lowest speed, share of synchronism", -1.0, 0.99)] = 0.5
    band_high: Annotated[float, Quantity("-", "highest speed, share of synchronism", 1.01, 2.0)] = 1.1
    innovation: Annotated[float, Quantity("-", "innovation that is too large, share of the current", 1e-6, 1.0)] = 0.25
    unbalance: Annotated[float, Quantity("-", "negative sequence of the voltage that is too large", 0.01, 1.0)] = 0.15
    current_sum: Annotated[float, Quantity("-", "mean of the line currents that is too large", 0.001, 1.0)] = 0.15
    lowest_frequency: Annotated[float, Quantity("Hz", "supply below it excites too little", 0.1, 100.0)] = 5.0


class Design(NamedTuple):
    """Constants of the kernel; made by `kernel_design`."""

    h: float
    inv_h: float
    speed_scale: float  # rad/s, electrical; unit of the polynomials' argument
    speed_low: float  # rad/s, electrical; limits of the estimate
    speed_high: float
    gain_mid: float  # rad/s; schedule nu = (omega - mid) inv_half
    gain_inv_half: float
    k0_i_re: float
    k0_i_im: float
    k0_m_re: float
    k0_m_im: float
    k1_i_re: float
    k1_i_im: float
    k1_m_re: float
    k1_m_im: float
    w_e: float  # filtered voltage w: w+ = w_e w + w_0 v + w_1 v+
    w_0: float
    w_1: float
    a1_i: float  # dA/domega = j [0 a1_i; 0 a1_m]
    a1_m: float
    k_T: float  # torque constant 3/2 z_p L_m'
    r_s: float
    L_s: float  # transient stator and magnetising inductance, for the start
    inv_L_m: float
    v_re: float  # stator from terminal quantities
    v_im: float
    i_re: float
    i_im: float
    q_speed: float  # (h/tau)^2
    q_fault: float
    common: float  # h/tau of the common mode
    p_speed: float  # covariances at a start, in units of the current's
    p_fault: float
    mean20: float  # weight of a sample in the 20 ms and 50 ms means
    mean50: float
    start_voltage2: float
    start_speed: float  # rad/s, electrical; 0 synchronous
    settle: float  # samples
    band_low: float
    band_high: float
    innovation2: float
    unbalance: float  # (2 |V_2|/|V_1|)^2 that is too large
    sum: float  # squared zero-sequence current over squared current that is too large
    slope: float  # weight of a tick in the slope of the supply's frequency; 0 does not follow it
    slowest: float  # rad/s
    tick: float  # samples
    patience: float  # ticks
    ref_re: float  # fault coefficient of the healthy machine
    ref_im: float


def check_rate(rate: float) -> float:
    """Check a sampling rate.

    Parameters
    ----------
    rate : float
        Hz.

    Returns
    -------
    float

    Raises
    ------
    ParameterError
        If it is no number, or outside what the observer is made for.
    """
    check_value("stator observer", "rate", rate, Quantity("Hz", "sampling rate", *RATES))
    return float(rate)


def system(motor: Motor, omega: ArrayLike) -> Array:
    """System matrix of (3.7) in the states (i', i_m).

    Parameters
    ----------
    motor : Motor
        The motor.
    omega : array_like, shape (...)
        Electrical speed z_p omega_r, rad/s.

    Returns
    -------
    complex ndarray, shape (..., 2, 2)
        1/s.

    References
    ----------
    Thesis (3.7a), (3.7c).
    """
    L_s, L_m = motor.L_s_prime, motor.L_m_prime
    e = motor.R_r_prime - 1j * np.asarray(omega, dtype=float) * L_m
    found = np.empty((*e.shape, 2, 2), dtype=complex)
    found[..., 0, 0], found[..., 0, 1] = -(motor.r_s + motor.R_r_prime) / L_s, e / L_s
    found[..., 1, 0], found[..., 1, 1] = motor.R_r_prime / L_m, -e / L_m
    return found


def step_matrices(motor: Motor, omega: ArrayLike, h: float) -> tuple[Array, Array, Array]:
    """Exact step of (3.7) for a voltage that is a straight line between two samples.

    Parameters
    ----------
    motor : Motor
        The motor.
    omega : array_like, shape (...)
        Electrical speed, rad/s.
    h : float
        Sampling interval, s.

    Returns
    -------
    E : complex ndarray, shape (..., 2, 2)
    F_0, F_1 : complex ndarray, shape (..., 2)
        x_{k+1} = E x_k + F_0 v_k + F_1 v_{k+1}.
    """
    speeds = np.asarray(omega, dtype=float)
    # the voltage and its slope as two more states
    whole = np.zeros((*speeds.shape, 4, 4), dtype=complex)
    whole[..., :2, :2] = system(motor, speeds) * h
    whole[..., 0, 2], whole[..., 2, 3] = h / motor.L_s_prime, 1.0
    # a sampling interval is short: the series converges at once, and without the threads of a library
    squarings = max(0, math.ceil(math.log2(max(np.abs(whole).sum(axis=-1).max(), 1e-9))) + 1)
    part = whole / 2**squarings
    found = np.broadcast_to(np.eye(4, dtype=complex), whole.shape)
    for n in range(_TERMS, 0, -1):
        found = np.eye(4) + part @ found / n
    for _ in range(squarings):
        found = found @ found
    return found[..., :2, :2], found[..., :2, 2] - found[..., :2, 3], found[..., :2, 3]


@cache
def step_polynomials(motor: Motor, h: float, scale: float) -> Array:
    """Coefficients of the entries of the step in powers of the speed.

    Parameters
    ----------
    motor : Motor
        The motor.
    h : float
        Sampling interval, s.
    scale : float
        Largest electrical speed, rad/s; the argument is omega/scale.

    Returns
    -------
    ndarray, shape (8, 10)
        Rows: E_ii, E_im, E_mi, E_mm, F_0i, F_0m, F_1i, F_1m. Even powers belong to the real, odd ones to the
        imaginary part. Not to be changed.
    """
    from numpy.polynomial import chebyshev

    u = chebyshev.chebpts1(DEGREE + 1)
    E, F_0, F_1 = step_matrices(motor, u * scale, h)
    values = np.concatenate([E.reshape(-1, 4), F_0, F_1], axis=1)
    fitted = chebyshev.chebfit(u, values.real + values.imag, DEGREE)  # even and odd powers do not meet
    found = np.ascontiguousarray([chebyshev.cheb2poly(column) for column in fitted.T])
    found.flags.writeable = False
    return found


def speed_range(motor: Motor) -> tuple[float, float]:
    """Electrical speeds that the observer admits, as shares of the rated frequency.

    Parameters
    ----------
    motor : Motor
        The motor; 50 Hz are assumed where it has no rated frequency.

    Returns
    -------
    low, high : float
        rad/s.
    """
    rated = 2 * math.pi * (motor.rated_frequency or 50.0)
    return 0.2 * rated, 1.25 * rated


def design_gain(
    motor: Motor, rate: float, *, decay_rate: float = 60.0, speeds: tuple[float, float] | None = None
) -> tuple[Gain, Certificate]:
    """Gain K(omega) of the observer from the delta-form matrix inequality, with its certificate.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    rate : float
        Sampling rate, Hz.
    decay_rate : float
        Rate at which the state error must decay at every speed, 1/s.
    speeds : tuple of float, optional
        Electrical speeds, rad/s; `speed_range` by default.

    Returns
    -------
    gain : Gain
        Constant over the speed: a scheduled one of smallest norm turns out to be constant too.
    certificate : Certificate
        Verified at 201 speeds.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InfeasibleError
        If no gain reaches the rate.

    References
    ----------
    Thesis 5.2.2, B.2 (reconstructed).
    """
    from pumplib.observers.lmi import observer_gain

    h = 1.0 / check_rate(rate)
    low, high = speeds or speed_range(motor)
    if not 0 <= low < high:
        raise ParameterError(f"design_gain.speeds = ({low:g}, {high:g}) rad/s: must rise from a value >= 0.")

    def delta(count: int) -> Array:
        return np.asarray((step_matrices(motor, np.linspace(low, high, count), h)[0] - np.eye(2)) / h)

    return observer_gain(
        delta(VERTICES), np.array([[1.0, 0.0]]), decay_rate=decay_rate, form="delta", h=h, dense=delta(DENSE),
        name="stator observer",
    )  # fmt: skip


def kernel_design(
    motor: Motor,
    rate: float,
    gain: Gain | None,
    settings: ObserverSettings,
    reference: complex = 0.0,
    speeds: tuple[float, float] | None = None,
) -> tuple[Design, Array]:
    """Constants of the kernel.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    rate : float
        Sampling rate, Hz.
    gain : Gain or None
        Of `design_gain`, constant or affine in nu = -1 ... 1 over `speeds`; None is no injection.
    settings : ObserverSettings
        Time constants and limits.
    reference : complex
        Fault coefficient that the healthy machine shows.
    speeds : tuple of float, optional
        Electrical speeds of the gain, rad/s; `speed_range` by default.

    Returns
    -------
    design : Design
    polynomials : ndarray, shape (8, 10)

    Raises
    ------
    ParameterError
        If an argument is wrong or the gain does not fit.
    """
    rate = check_rate(rate)
    h = 1.0 / rate
    low, high = speeds or speed_range(motor)
    K = [np.zeros((2, 1), dtype=complex)] * 2
    if gain is not None:
        if gain.K[0].shape != (2, 1) or len(gain.K) > 2:
            raise ParameterError(
                f"gain has shape {gain.K[0].shape} and {len(gain.K) - 1} slopes: the stator observer needs (2, 1) and "
                "at most one; use design_gain."
            )
        K = [np.asarray(one, dtype=complex) for one in (*gain.K, np.zeros((2, 1)))][:2]
    if min(settings.tau_speed, settings.tau_fault) < 5 * h:
        raise ParameterError(
            f"ObserverSettings.tau_speed = {settings.tau_speed:g} s, tau_fault = {settings.tau_fault:g} s at {rate:g} "
            f"Hz: must be at least five samples, {5 * h:g} s; raise them or the rate."
        )
    delta = motor.connection == "delta"
    v, i = (B_V_DELTA, 1 / C_I_DELTA) if delta else (1 + 0j, 1 + 0j)
    # the same step for one real state: L_ls dw/dt = v - r_s w
    z = motor.r_s * h / motor.L_ls
    e = math.exp(-z)
    full = -math.expm1(-z) / motor.r_s
    end = (1.0 - -math.expm1(-z) / z) / motor.r_s
    tick = max(1.0, round(_TICK * rate))
    design = Design(
        h=h,
        inv_h=rate,
        speed_scale=high,
        speed_low=low,
        speed_high=high,
        gain_mid=0.5 * (low + high),
        gain_inv_half=2.0 / (high - low),
        k0_i_re=h * K[0][0, 0].real,
        k0_i_im=h * K[0][0, 0].imag,
        k0_m_re=h * K[0][1, 0].real,
        k0_m_im=h * K[0][1, 0].imag,
        k1_i_re=h * K[1][0, 0].real,
        k1_i_im=h * K[1][0, 0].imag,
        k1_m_re=h * K[1][1, 0].real,
        k1_m_im=h * K[1][1, 0].imag,
        w_e=e,
        w_0=full - end,
        w_1=end,
        a1_i=-motor.L_m_prime / motor.L_s_prime * h,
        a1_m=h,
        k_T=1.5 * motor.z_p * motor.L_m_prime,
        r_s=motor.r_s,
        L_s=motor.L_s_prime,
        inv_L_m=1.0 / motor.L_m_prime,
        v_re=v.real,
        v_im=v.imag,
        i_re=i.real,
        i_im=i.imag,
        q_speed=(h / settings.tau_speed) ** 2,
        q_fault=(h / settings.tau_fault) ** 2,
        common=h / settings.tau_common,
        p_speed=(motor.z_p * settings.speed_spread / _NOISE) ** 2,
        p_fault=(settings.fault_spread / _NOISE) ** 2,
        mean20=-math.expm1(-h / 0.02),
        mean50=-math.expm1(-h / 0.05),
        start_voltage2=(settings.start_voltage * abs(v)) ** 2,
        start_speed=motor.z_p * settings.start_speed,
        settle=float(round(settings.settle * rate)),
        band_low=settings.band_low,
        band_high=settings.band_high,
        innovation2=settings.innovation**2,
        unbalance=4.0 * settings.unbalance**2,
        sum=settings.current_sum**2,
        slope=-math.expm1(-tick * h / settings.tau_slope) if settings.tau_slope > 0 else 0.0,
        slowest=2 * math.pi * settings.lowest_frequency,
        tick=tick,
        patience=max(1.0, round(0.02 / (tick * h))),
        ref_re=float(np.real(reference)),
        ref_im=float(np.imag(reference)),
    )
    return design, step_polynomials(motor, h, high)
