"""Thesis 5.2.2, B.2: gains of the adaptive observers: polytopic, structural, and the closed form of the motor.

A gain is designed over a range of the parameters and verified outside the solver; see `Certificate`. Gains come back
in the units of the parameters, ready for the observers of `adaptive`.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Motor
from pumplib.observers.adaptive import BilinearSystem
from pumplib.observers.adaptive_examples import motor_matrices, motor_short_state, motor_speed
from pumplib.observers.certificate import Certificate, Gain, InfeasibleError
from pumplib.observers.lmi import observer_gain
from pumplib.observers.lmi_structural import Structure, structural_gain

Array = NDArray[Any]
Schedule = Literal["constant", "affine"]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PolytopicGain:
    """Gain of the filtered-regressor observer with its certificate.

    Parameters
    ----------
    K : ndarray, shape (1 + m, n, p)
        K_0 + sum theta_i K_i, 1/s, in the units of the parameters.
    certificate : Certificate
        Verified on the dense grid.
    gain : Gain
        The same gain over the normalised parameter -1..1.
    """

    K: Array
    certificate: Certificate
    gain: Gain

    @property
    def margin(self) -> float:
        """Worst verified rate less the rate that was asked for, 1/s."""
        return self.certificate.decay - self.certificate.decay_rate


def delta_matrices(system: BilinearSystem, theta: ArrayLike, h: float) -> Array:
    """Delta form (exp(A h) - I)/h of the system matrix, by its power series.

    Parameters
    ----------
    system : BilinearSystem
        The system.
    theta : array_like, shape (N, m)
        Parameters.
    h : float
        Sampling interval, s.

    Returns
    -------
    ndarray, shape (N, n, n)
        1/s.
    """
    from scipy.linalg import expm

    A = system.system_matrix(theta)
    n = A.shape[-1]
    # exp of [[A h, I h], [0, 0]] holds the integral of exp(A s): no difference of nearly equal matrices
    block = np.zeros((len(A), 2 * n, 2 * n), complex)
    block[:, :n, :n], block[:, :n, n:] = A * h, np.eye(n)
    return np.asarray(A @ expm(block)[:, :n, n:])


def polytopic_gain(
    system: BilinearSystem, low: ArrayLike, high: ArrayLike, *, h: float, decay_rate: float, vertices: int = 5,
    dense: int = 201, schedule: Schedule = "constant", **options: Any,
) -> PolytopicGain:  # fmt: skip
    """Gain in delta form for a range of the one parameter that the system matrix depends on.

    Parameters
    ----------
    system : BilinearSystem
        The system; parameters in B and D need no range.
    low, high : array_like, shape (m,)
        Range of each parameter.
    h : float
        Sampling interval, s.
    decay_rate : float
        Rate asked for, 1/s.
    vertices : int
        Points at which the inequality is posed.
    dense : int
        Points at which the result is verified.
    schedule : {"constant", "affine"}
        Whether the gain may depend on the parameter.
    **options
        `kappa`, `scaling`, `solvers` of `observer_gain`.

    Returns
    -------
    PolytopicGain

    Raises
    ------
    ParameterError
        If the system matrix depends on several parameters, or a range or number is wrong.
    InfeasibleError, InaccurateError, NotVerifiedError
        See `observer_gain`.
    """
    m, n, p = len(system.names), len(system.A0), len(system.C)
    bottom, top = _range(system, low, high)
    moving = [i for i in range(m) if system.A[i].any()]
    if len(moving) > 1:
        names = ", ".join(system.names[i] for i in moving)
        raise ParameterError(
            f"{system.name}: the system matrix depends on {names}; the delta form is verified on a grid of one "
            "parameter. Pose the vertices of the box yourself and call observer_gain in continuous form."
        )
    if vertices < 2 or dense < 2 * vertices:
        raise ParameterError(
            f"{system.name}: vertices = {vertices}, dense = {dense}; give 2 or more, and far more dense."
        )
    K = np.zeros((1 + m, n, p), complex)
    if not moving:
        gain, certificate = observer_gain(
            delta_matrices(system, bottom[None], h), system.C, decay_rate=decay_rate, form="delta", h=h,
            name=system.name, **options,
        )  # fmt: skip
        K[0] = gain.K[0]
        return PolytopicGain(K=K, certificate=certificate, gain=gain)
    i = moving[0]
    middle, half = (bottom[i] + top[i]) / 2, (top[i] - bottom[i]) / 2

    def grid(points: int) -> tuple[Array, Array]:
        nu = np.linspace(-1.0, 1.0, points)
        theta = np.tile((bottom + top) / 2, (points, 1))
        theta[:, i] = middle + half * nu
        return nu, delta_matrices(system, theta, h)

    nu, posed = grid(vertices)
    nu_dense, verified = grid(dense)
    gain, certificate = observer_gain(
        posed, system.C, decay_rate=decay_rate, form="delta", h=h, nu=nu, schedule=schedule, dense=verified,
        nu_dense=nu_dense, name=system.name, **options,
    )  # fmt: skip
    K[0] = gain.K[0]
    if gain.scheduled:  # nu = (theta - middle)/half
        K[0] = gain.K[0] - middle / half * gain.K[1]
        K[1 + i] = gain.K[1] / half
    return PolytopicGain(K=K, certificate=certificate, gain=gain)


def _range(system: BilinearSystem, low: ArrayLike, high: ArrayLike) -> tuple[Array, Array]:
    m = len(system.names)
    bottom, top = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if bottom.shape != (m,) or top.shape != (m,) or not np.isfinite([bottom, top]).all() or (bottom > top).any():
        raise ParameterError(f"{system.name}: range {low!r} to {high!r}; give {m} finite numbers each, low <= high.")
    for i in range(m):
        if system.A[i].any() and bottom[i] == top[i]:
            raise ParameterError(f"{system.name}: the range of {system.names[i]} is empty; make it known instead.")
    return bottom, top


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DirectDesign:
    """Gain and parameter law of the direct observer with the Lyapunov matrix behind them.

    Parameters
    ----------
    K : ndarray, shape (n, p) or (1 + m, n, p)
        Gain, 1/s.
    F, G : ndarray, shape (m, p, n), (m, p, r)
        P A_i = C^H F_i, P B_i = C^H G_i.
    P : ndarray, shape (n, n)
        Lyapunov matrix.
    structure : Structure or None
        What the structural inequality said; None for the closed form.
    """

    K: Array
    F: Array
    G: Array
    P: Array
    structure: Structure | None = None


def structure_of(system: BilinearSystem, low: ArrayLike, high: ArrayLike, **options: Any) -> Structure:
    """Structural inequality of a system: whether the direct observer has a strict Lyapunov function.

    Parameters
    ----------
    system : BilinearSystem
        The system, without feedthrough: the theory of the direct observer has none.
    low, high : array_like, shape (m,)
        Range of each parameter.
    **options
        `decay_rate`, `schedule`, `kappa`, `scaling`, `solvers` of `structural_gain`.

    Returns
    -------
    Structure

    Raises
    ------
    ParameterError
        If the system has a feedthrough, or a range is wrong.
    InaccurateError
        If strict feasibility could not be decided.
    """
    if system.D.any():
        raise ParameterError(
            f"{system.name}: the direct observer's Lyapunov function has no place for a feedthrough D_i; make it a "
            "state, or use the filtered-regressor observer."
        )
    bottom, top = _range(system, low, high)
    m = len(system.names)
    moving = [i for i in range(m) if system.A[i].any()]
    corners = []
    for code in range(2 ** len(moving)):
        theta = bottom.copy()
        for bit, i in enumerate(moving):
            theta[i] = top[i] if code >> bit & 1 else bottom[i]
        corners.append(theta)
    drives = [system.B[i] for i in range(m) if system.B[i].any()]
    return structural_gain(
        system.system_matrix(np.array(corners)), system.C, [system.A[i] for i in moving], drives, name=system.name,
        **options,
    )  # fmt: skip


def direct_gain(system: BilinearSystem, low: ArrayLike, high: ArrayLike, **options: Any) -> DirectDesign:
    """Constant gain and law of the direct observer where the structural inequality is strictly feasible.

    Parameters
    ----------
    system : BilinearSystem
        The system.
    low, high : array_like, shape (m,)
        Range of each parameter.
    **options
        As in `structure_of`.

    Returns
    -------
    DirectDesign

    Raises
    ------
    ParameterError
        See `structure_of`.
    InfeasibleError
        If it is not strictly feasible, with the reason.
    """
    found = structure_of(system, low, high, **options)
    if found.verdict != "strict" or found.gain is None or found.P is None:
        raise InfeasibleError(found.explanation)
    m, p, n, r = len(system.names), len(system.C), len(system.A0), system.B0.shape[1]
    F, G = np.zeros((m, p, n), complex), np.zeros((m, p, r), complex)
    left, right = list(found.F), list(found.G)
    for i in range(m):
        if system.A[i].any():
            F[i] = left.pop(0)
        if system.B[i].any():
            G[i] = right.pop(0)
    return DirectDesign(K=np.asarray(found.gain.at()), F=F, G=G, P=found.P, structure=found)


def motor_boundary(motor: Motor, *, k1: float, mu: float) -> DirectDesign:
    """Direct observer of the motor's speed with the scheduled gain that reaches the boundary of the inequality.

    The structural equality leaves V = mu |e_i|^2 + |e_psi|^2 with psi_s = L_s' i' + L_m' i_m. The stator flux has no
    damping of its own, so the inequality is at best an equality in that direction, and is one only where the
    cross term vanishes: K_psi = mu conj(c(omega)) - r_s with c = (R_r' - j omega L_m')/(L_s' L_m'). That gain is
    affine in the speed and no constant gain over a range of speeds does it. Then
    dV/dt = -2 mu (alpha + k1) |e_i|^2, alpha = (r_s + R_r')/L_s' + R_r'/L_m'.

    Parameters
    ----------
    motor : Motor
        The motor.
    k1 : float
        Gain of the current, 1/s.
    mu : float
        Weight of the current error against the flux error, H^2.

    Returns
    -------
    DirectDesign
        Of `motor_speed`.

    Raises
    ------
    ParameterError
        If `mu` is not positive or `k1` makes the current error grow.
    """
    R, L_s, L_m = motor.R_r_prime, motor.L_s_prime, motor.L_m_prime
    alpha = (motor.r_s + R) / L_s + R / L_m
    if not (0 < mu < np.inf):
        raise ParameterError(f"motor_boundary: mu = {mu!r} H2; must be positive.")
    if not (-alpha < k1 < np.inf):
        raise ParameterError(f"motor_boundary: k1 = {k1!r} 1/s; must be above {-alpha:.3g} 1/s and finite.")
    K = np.zeros((2, 2, 1), complex)
    K[0, 0] = k1
    K[0, 1] = (mu * R / (L_s * L_m) - motor.r_s - L_s * k1) / L_m
    K[1, 1] = mu * 1j / L_s / L_m  # conj(c) grows with j omega/L_s'
    P = np.array([[mu + L_s**2, L_s * L_m], [L_s * L_m, L_m**2]], dtype=complex)
    # P A_1 = C^H F: the flux does not feel the speed, the current does by -j L_m'/L_s' i_m
    F = np.zeros((1, 1, 2), complex)
    F[0, 0, 1] = -1j * mu * L_m / L_s
    return DirectDesign(K=K, F=F, G=np.zeros((1, 1, 1), complex), P=P)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class MotorStructure:
    """What the structural inequality says about the motor, and how close the closed form comes.

    Parameters
    ----------
    speed, short, both : Structure
        Unknown speed; unknown short with known speed; both.
    omega : ndarray, shape (N,)
        Electrical speeds, rad/s.
    boundary : ndarray, shape (N,)
        Largest eigenvalue of the inequality with the scheduled gain, relative to the size of its smallest: zero on
        the boundary.
    constant : ndarray, shape (N,)
        The same with that gain held at the middle of the range.
    """

    speed: Structure
    short: Structure
    both: Structure
    omega: Array
    boundary: Array
    constant: Array

    @property
    def best_margin(self) -> float:
        """Best margin of the speed problem, a proven bound; strict feasibility needs it well above zero."""
        return self.speed.margin_bound


def motor_structure(
    motor: Motor, low: float, high: float, *, k1: float = 200.0, mu: float = 1e-3, points: int = 201
) -> MotorStructure:
    """Analyse the structural inequality of the motor over a range of electrical speeds.

    Parameters
    ----------
    motor : Motor
        The motor.
    low, high : float
        Electrical speeds, rad/s.
    k1, mu : float
        Of `motor_boundary`.
    points : int
        Speeds at which the closed form is evaluated.

    Returns
    -------
    MotorStructure
    """
    A0, A1, _ = motor_matrices(motor)
    design = motor_boundary(motor, k1=k1, mu=mu)
    omega = np.linspace(low, high, points)
    C = np.array([[1.0, 0.0]])

    def worst(gains: Array) -> Array:
        rate = design.P @ (A0 + omega[:, None, None] * A1 - gains @ C)
        values = np.linalg.eigvalsh(rate + np.swapaxes(rate.conj(), 1, 2))
        return np.asarray(values[:, -1] / np.abs(values[:, 0]))

    scheduled = design.K[0] + omega[:, None, None] * design.K[1]
    held = np.broadcast_to(design.K[0] + (low + high) / 2 * design.K[1], scheduled.shape)
    free = motor_short_state(motor)
    return MotorStructure(
        speed=structure_of(motor_speed(motor), [low], [high]),
        short=_short_over_speeds(motor, low, high),
        both=structure_of(free, [low, 0, 0], [high, 0, 0]),
        omega=omega,
        boundary=worst(scheduled),
        constant=worst(held),
    )


def _short_over_speeds(motor: Motor, low: float, high: float) -> Structure:
    """Unknown short, known speed anywhere in the range: the speed is a vertex, not a parameter of the law."""
    ends = [motor_short_state(motor, one) for one in (low, high)]
    return structural_gain(
        np.stack([one.A0 for one in ends]), ends[0].C, [], list(ends[0].B), name="motor, short with known speed"
    )


def excitation(regressor: ArrayLike, t: ArrayLike, window: float) -> Array:
    """Smallest eigenvalue of the mean of phi^T phi over a sliding window: positive means persistently exciting.

    Parameters
    ----------
    regressor : array_like, shape (N, p, m)
        phi; real and imaginary parts of complex outputs count as two rows.
    t : array_like, shape (N,)
        Equally spaced times, s.
    window : float
        Length of the window, s.

    Returns
    -------
    ndarray, shape (N - k,)
        Of each window of k + 1 samples, in the units of phi squared.

    Raises
    ------
    ParameterError
        If the window does not fit into the record.
    """
    phi, times = np.asarray(regressor), np.asarray(t, dtype=float)
    k = round(window / float(times[1] - times[0])) if len(times) > 1 else 0
    if phi.ndim != 3 or len(phi) != len(times) or not 1 <= k < len(times):
        raise ParameterError(
            f"excitation: regressor of shape {phi.shape}, {len(times)} times, window {window:g} s; give (N, p, m) and "
            "a window within the record."
        )
    product = np.real(np.einsum("Npi,Npj->Nij", phi.conj(), phi))
    total = np.concatenate([np.zeros((1, *product.shape[1:])), np.cumsum(product, axis=0)])
    return np.asarray(np.linalg.eigvalsh((total[k + 1 :] - total[: -k - 1]) / (k + 1))[:, 0])
