"""Thesis 3.3.2, 3.3.3, 3.3.4: pressure, torque and leakage of the pump as functions of speed and flow.

The one definition of the pump's equations; every simulation in the package uses it. Where a flow or the
speed can reverse in a transient, squares that dissipate carry a sign (x|x|), so that they stay losses;
for forward flow this is the thesis's equation.
"""

from pumplib.kernels import inline


@inline
def impeller_pressure(Q: float, omega: float, a_h0: float, a_h1: float, a_h2: float) -> float:
    """Pressure of the impellers, rho g H.

    Parameters
    ----------
    Q : float
        Flow through the impeller Q_i, m3/s.
    omega : float
        Shaft speed, rad/s.
    a_h0, a_h1, a_h2 : float
        Head coefficients with rho g absorbed: Pa s2, Pa s2/m3, Pa s2/m6.

    Returns
    -------
    float
        Pa.

    References
    ----------
    Thesis (3.24).
    """
    return (a_h1 * omega - a_h2 * abs(Q)) * Q + a_h0 * omega * omega


@inline
def impeller_torque(Q: float, omega: float, a_t0: float, a_t1: float, a_t2: float) -> float:
    """Steady torque of the impellers.

    Parameters
    ----------
    Q : float
        Flow through the impeller Q_i, m3/s.
    omega : float
        Shaft speed, rad/s.
    a_t0, a_t1, a_t2 : float
        Torque coefficients: N m s2, N m s2/m3, N m s2/m6.

    Returns
    -------
    float
        N m.

    References
    ----------
    Thesis (3.19).
    """
    return (a_t1 * omega - a_t2 * Q) * Q + a_t0 * omega * abs(omega)


@inline
def leakage_derivative(q: float, pressure: float, a: float, K_l: float, inv_K_J: float) -> float:
    """Rate of change of the leakage flow from the pressure to the suction side.

    Parameters
    ----------
    q : float
        Leakage flow, m3/s.
    pressure : float
        Pressure of one impeller, Pa.
    a : float
        Share of the pressure that acts on the leakage path.
    K_l : float
        Loss coefficient of the path, Pa s2/m6.
    inv_K_J : float
        1/K_J, m3/(Pa s2); zero switches the leakage dynamics off.

    Returns
    -------
    float
        m3/s2.

    References
    ----------
    Thesis (3.25) with the scaling a that 3.3.4 introduces and (3.25) drops.
    """
    return inv_K_J * (a * pressure - K_l * q * abs(q))


@inline
def casing_pressure(impeller: float, Q: float, K_c: float) -> float:
    """Pressure between the pump's flanges, after the casing loss.

    Parameters
    ----------
    impeller : float
        Pressure of the impellers, Pa.
    Q : float
        Flow through the pump Q_p, m3/s.
    K_c : float
        Casing loss coefficient, Pa s2/m6.

    Returns
    -------
    float
        H_p, Pa.

    References
    ----------
    Thesis (3.25).
    """
    return impeller - K_c * Q * abs(Q)


@inline
def flow_derivative(Q: float, impeller: float, p_static: float, K: float, inv_K_p: float) -> float:
    """Rate of change of the pump flow in casing and application.

    Parameters
    ----------
    Q : float
        Flow Q_p, m3/s.
    impeller : float
        Pressure of the impellers, Pa.
    p_static : float
        Static back pressure, Pa.
    K : float
        Loss coefficient of casing, pipe and valve together, Pa s2/m6.
    inv_K_p : float
        1/K_p, m3/(Pa s2); zero holds the flow.

    Returns
    -------
    float
        m3/s2.

    References
    ----------
    Thesis (3.25) for the casing; the application is reconstructed (thesis 3.5 is not in the surviving text).
    """
    return inv_K_p * (impeller - (p_static + K * Q * abs(Q)))
