"""Thesis 3.3.2, 3.3.3, 3.3.5: torque and head of an impeller from its geometry.

Control volume: the water between inlet radius r_1 and outlet radius r_2 of a channel of uniform height.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Impeller, Liquid, Pump

Array = NDArray[Any]
Values = Any  # a float or an array; the result is the same kind


@dataclass(frozen=True, kw_only=True, slots=True)
class StageCoefficients:
    """Coefficients of one stage as the model uses them; head with rho g absorbed.

    Parameters
    ----------
    a_h0, a_h1, a_h2 : float
        Pa s2, Pa s2/m3, Pa s2/m6.
    a_t0, a_t1, a_t2 : float
        N m s2, N m s2/m3, N m s2/m6.
    J_Mv : float
        Moment of inertia of the liquid in the impeller, kg m2.
    K_Q : float
        Torque per rate of change of flow, N m s2/m3.
    """

    a_h0: float
    a_h1: float
    a_h2: float
    a_t0: float
    a_t1: float
    a_t2: float
    J_Mv: float
    K_Q: float


def blade_angle(impeller: Impeller, r: Values) -> Values:
    """Blade angle at a radius, linear between the given angles.

    Parameters
    ----------
    impeller : Impeller
        Geometry.
    r : ndarray
        Radii, m.

    Returns
    -------
    ndarray
        rad.
    """
    knots = np.linspace(impeller.r_1, impeller.r_2, len(impeller.beta))
    return np.interp(r, knots, impeller.beta)


def tangential_speed(impeller: Impeller, r: Values, omega: Values, Q: Values) -> Values:
    """Tangential speed of the liquid, c_x = r omega - Q cot(beta) / A_r.

    Parameters
    ----------
    impeller : Impeller
        Geometry.
    r : ndarray
        Radii, m.
    omega : ndarray
        Shaft speed, rad/s.
    Q : ndarray
        Flow through the impeller, m3/s.

    Returns
    -------
    ndarray
        m/s.

    References
    ----------
    Thesis (3.17), figure 3.7.
    """
    return r * omega - Q / (np.tan(blade_angle(impeller, r)) * 2 * np.pi * r * impeller.h)


def euler_torque(impeller: Impeller, liquid: Liquid, omega: Values, Q: Values) -> Values:
    """Steady torque on the liquid from the change of its moment of momentum, without disc friction.

    Parameters
    ----------
    impeller, liquid : Impeller, Liquid
        Geometry and liquid.
    omega : ndarray
        Shaft speed, rad/s.
    Q : ndarray
        Flow through the impeller, m3/s.

    Returns
    -------
    ndarray
        N m.

    References
    ----------
    Thesis (3.16), (3.18).
    """
    inlet = impeller.r_1 * tangential_speed(impeller, np.array(impeller.r_1), omega, Q)
    outlet = impeller.r_2 * tangential_speed(impeller, np.array(impeller.r_2), omega, Q)
    return liquid.rho * Q * (outlet - inlet)


def theoretical_head(impeller: Impeller, liquid: Liquid, omega: Values, Q: Values) -> Values:
    """Theoretical head H_e of the impeller.

    Parameters
    ----------
    impeller, liquid : Impeller, Liquid
        Geometry and liquid.
    omega : ndarray
        Shaft speed, rad/s.
    Q : ndarray
        Flow through the impeller, m3/s.

    Returns
    -------
    ndarray
        m.

    References
    ----------
    Thesis (3.22).
    """
    r_1, r_2, g = impeller.r_1, impeller.r_2, liquid.g
    return (r_2**2 - r_1**2) / g * omega**2 - _cot_over_area(impeller) / g * omega * Q


def real_head(impeller: Impeller, liquid: Liquid, omega: Values, Q: Values) -> Values:
    """Head of the stage after slip, shock and friction losses.

    Parameters
    ----------
    impeller, liquid : Impeller, Liquid
        Geometry with losses, and liquid.
    omega : ndarray
        Shaft speed, rad/s.
    Q : ndarray
        Flow through the impeller, m3/s.

    Returns
    -------
    ndarray
        m.

    References
    ----------
    Thesis (3.23).
    """
    shock = impeller.K_s * (Q - impeller.K_d * omega) ** 2
    return impeller.sigma_s * theoretical_head(impeller, liquid, omega, Q) - shock - impeller.K_f * Q**2


def _cot_over_area(impeller: Impeller) -> float:
    """r_2 cot(beta_2)/A_2 - r_1 cot(beta_1)/A_1, 1/m, with A = 2 pi r h."""
    inlet, outlet = 1 / np.tan(impeller.beta[0]), 1 / np.tan(impeller.beta[-1])
    return float((outlet - inlet) / (2 * np.pi * impeller.h))


def stage_coefficients(impeller: Impeller, liquid: Liquid) -> StageCoefficients:
    """Coefficients of (3.19)-(3.21) and (3.24) from the geometry.

    The printed list of a_h1 and a_h0 is scrambled in the surviving text; these are the coefficients that
    (3.22) and (3.23) give.

    Parameters
    ----------
    impeller, liquid : Impeller, Liquid
        Geometry with losses, and liquid.

    Returns
    -------
    StageCoefficients

    Raises
    ------
    ParameterError
        If losses are so large that the head has no positive shut-off value or does not fall with the flow.

    References
    ----------
    Thesis 3.3.2-3.3.3.
    """
    rho, weight = liquid.rho, liquid.rho * liquid.g
    r_1, r_2, h = impeller.r_1, impeller.r_2, impeller.h
    squares, cot = r_2**2 - r_1**2, _cot_over_area(impeller)
    a_h0 = impeller.sigma_s * squares / liquid.g - impeller.K_s * impeller.K_d**2
    a_h1 = 2 * impeller.K_s * impeller.K_d - impeller.sigma_s * cot / liquid.g
    a_h2 = impeller.K_s + impeller.K_f
    if a_h0 <= 0 or a_h2 <= 0:
        raise ParameterError(
            f"Impeller gives a_h0 = {a_h0:g} m s2 and a_h2 = {a_h2:g} s2/m5: both must be > 0; check K_s (s2/m5), "
            "K_f (s2/m5) and K_d (m3)."
        )
    # beta is linear between its knots: Gauss points in every interval integrate r cot(beta) to rounding
    points, weights = np.polynomial.legendre.leggauss(16)
    knots = np.linspace(r_1, r_2, len(impeller.beta))
    half = 0.5 * np.diff(knots)[:, None]
    r = knots[:-1, None] + half * (1 + points)
    K_Q = rho * float((half * weights * r / np.tan(blade_angle(impeller, r))).sum())
    return StageCoefficients(
        a_h0=weight * a_h0,
        a_h1=weight * a_h1,
        a_h2=weight * a_h2,
        a_t0=impeller.K_n,
        a_t1=rho * squares,
        a_t2=rho * cot,
        J_Mv=0.5 * np.pi * h * rho * (r_2**4 - r_1**4),
        K_Q=K_Q,
    )


def simplified(pump: Pump) -> Pump:
    """Pump for the simplified model: casing loss merged into a_h2; run it with ``leakage=False``.

    Parameters
    ----------
    pump : Pump
        Full description.

    Returns
    -------
    Pump

    References
    ----------
    Thesis 3.3.4, assumption 3.3.1.
    """
    from dataclasses import replace

    return replace(pump, a_h2=pump.a_h2 + pump.K_c / pump.stages, K_c=0.0)
