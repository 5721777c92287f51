"""Thesis 3.2.2, 3.2.3, 3.2.4: the induction motor in stator-fixed dq coordinates.

The one definition of the motor's differential equations; every simulation in the package uses it.
"""

from pumplib.kernels import inline


@inline
def current_derivatives(
    i_sd: float, i_sq: float, i_md: float, i_mq: float, omega_e: float, v_d: float, v_q: float,
    r_s: float, R_r: float, L_m: float, inv_L_s: float, inv_L_m: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Time derivatives of stator and magnetising current.

    Parameters
    ----------
    i_sd, i_sq, i_md, i_mq : float
        Stator current and magnetising current (psi_r = L_m i_m), A.
    omega_e : float
        Electrical rotor speed z_p omega_r, rad/s.
    v_d, v_q : float
        Stator voltage, V.
    r_s, R_r : float
        Stator resistance and derived rotor resistance R_r', ohm.
    L_m : float
        Derived magnetising inductance L_m', H.
    inv_L_s, inv_L_m : float
        1/L_s' and 1/L_m', 1/H.

    Returns
    -------
    tuple of float
        Derivatives in the order of the states, A/s.

    References
    ----------
    Thesis (3.7a), (3.7c) with J = [0 -1; 1 0].
    """
    # (R_r' - z_p omega J L_m') i_m, the voltage that the rotor induces
    speed = omega_e * L_m
    e_d = R_r * i_md + speed * i_mq
    e_q = R_r * i_mq - speed * i_md
    r = r_s + R_r
    return (
        inv_L_s * (v_d - r * i_sd + e_d),
        inv_L_s * (v_q - r * i_sq + e_q),
        inv_L_m * (R_r * i_sd - e_d),
        inv_L_m * (R_r * i_sq - e_q),
    )


@inline
def torque(i_sd: float, i_sq: float, i_md: float, i_mq: float, k_T: float) -> float:
    """Electromagnetic torque.

    Parameters
    ----------
    i_sd, i_sq, i_md, i_mq : float or ndarray
        Stator and magnetising current, A.
    k_T : float
        3/2 z_p L_m', N m/A2.

    Returns
    -------
    float or ndarray
        N m.

    References
    ----------
    Thesis (3.11).
    """
    return k_T * (i_md * i_sq - i_mq * i_sd)
