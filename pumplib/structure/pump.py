"""Thesis 6.3-6.5, 7.1: the pump with five faults as a structural model: pump part, with its motor, and in steady state.

Reconstruction: of chapter 6 the surviving text has the symbols and the idea, not the relations. Head and torque maps
are those of section 3.3, with density and gravity absorbed in the coefficients:
f_H = a_h0 omega^2 + a_h1 omega Q - a_h2 Q^2 (Pa), f_T = a_t0 omega^2 + a_t1 omega Q - a_t2 Q^2 (N m).
Cavitation and dry running lower the head by the shares f_c, f_d and the torque by kappa_c f_c, kappa_d f_d of their
healthy values. Leakage is the quasi-static limit of the leakage path: K_l = sqrt(a/K), where K is the loss coefficient
of the path in the thesis and a its unit conversion, so a larger K_l is a larger leak. The head of c2 sees the flow
through the impeller, Q_i, not the delivered flow Q_p.
"""

from __future__ import annotations

from typing import Any, Literal

import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.model import StructuralModel, define
from pumplib.structure.mso import mso_matrix

Flow = Literal["Q_i", "Q_p"]
MEASURED = {"omega": "w", "T_e": "T"}  # variables that the motor part hands over -> suffix of their measurement

_positive: dict[str, Any] = {"positive": True}
omega, Q_i, Q_p, H_p = sp.symbols("omega Q_i Q_p H_p", **_positive)
omega_dot, Q_i_dot, T_e, T_p = sp.symbols("omega_dot Q_i_dot T_e T_p", real=True)
y_w, y_H, y_Q = sp.symbols("y_w y_H y_Q", **_positive)
y_T = sp.Symbol("y_T", real=True)
K_f, K_l, dB, f_c, f_d = sp.symbols("K_f K_l dB f_c f_d", nonnegative=True)
J, B, K_Q, kappa_c, kappa_d = sp.symbols("J B K_Q kappa_c kappa_d", **_positive)
a_h0, a_h1, a_h2, a_t0, a_t1, a_t2 = sp.symbols("a_h0 a_h1 a_h2 a_t0 a_t1 a_t2", **_positive)

FAULTS = (K_f, K_l, dB, f_c, f_d)
MAPS = (a_h0, a_h1, a_h2, a_t0, a_t1, a_t2)


def head_map(Q: Any, speed: Any) -> sp.Expr:
    """Pressure of the impeller over flow and speed.

    Parameters
    ----------
    Q : sympy.Expr
        Flow through the impeller, m3/s.
    speed : sympy.Expr
        rad/s.

    Returns
    -------
    sympy.Expr
        Pa.

    References
    ----------
    Thesis 3.3.2.
    """
    return a_h0 * speed**2 + a_h1 * speed * Q - a_h2 * Q**2


def torque_map(Q: Any, speed: Any) -> sp.Expr:
    """Torque that the impeller takes over flow and speed.

    Parameters
    ----------
    Q : sympy.Expr
        Flow through the impeller, m3/s.
    speed : sympy.Expr
        rad/s.

    Returns
    -------
    sympy.Expr
        N m.

    References
    ----------
    Thesis 3.3.2.
    """
    return a_t0 * speed**2 + a_t1 * speed * Q - a_t2 * Q**2


def _hydraulics(head_flow: Flow = "Q_i", loss_flow: Flow = "Q_i") -> dict[str, sp.Expr]:
    """Constraints c2 to c4 and the two hydraulic measurements."""
    flows = {"Q_i": Q_i, "Q_p": Q_p}
    for what, flow in (("head_flow", head_flow), ("loss_flow", loss_flow)):
        if flow not in flows:
            raise ParameterError(f"pump model: {what} = {flow!r}; must be Q_i (impeller) or Q_p (delivered).")
    return {
        "c2": H_p - head_map(flows[head_flow], omega) * (1 - f_c - f_d) + K_f * flows[loss_flow] ** 2,
        "c3": T_p - torque_map(Q_i, omega) * (1 - kappa_c * f_c - kappa_d * f_d),
        "c4": Q_i - Q_p - K_l * sp.sqrt(H_p),
        "m_H": y_H - H_p,
        "m_Q": y_Q - Q_p,
    }


def _shaft(flow_acceleration: bool) -> sp.Expr:
    """Constraint c1: equation of motion of rotor and liquid."""
    return J * omega_dot - T_e + (B + dB) * omega + T_p - (K_Q * Q_i_dot if flow_acceleration else 0)


def pump_part(*, head_flow: Flow = "Q_i", loss_flow: Flow = "Q_i", flow_acceleration: bool = False) -> StructuralModel:
    """Pump with speed and motor torque known from the motor part, delivered flow and head measured.

    The load is unknown: no constraint says how the flow develops.

    Parameters
    ----------
    head_flow, loss_flow : {"Q_i", "Q_p"}
        Flow that the head map and the clogging loss of c2 see. With the delivered flow in both, every residual with
        the torque reacts to leakage; with the loss alone in the delivered flow, one that is blind to leakage is left,
        but it needs the flow measurement.
    flow_acceleration : bool
        Whether the acceleration of the liquid takes torque; its rate Q_i_dot is then one more unknown and d2 its
        differential constraint.

    Returns
    -------
    StructuralModel
        Constraints c1 to c4, m_w, m_T, m_H, m_Q, d1 (and d2).

    Raises
    ------
    ParameterError
        If a flow is another word.

    References
    ----------
    Thesis 6.4; Kallesøe, Cocquempot, Izadi-Zamanabadi, IEEE Trans. Control Systems Technology 14 (2006).
    """
    hydraulics = _hydraulics(head_flow, loss_flow)
    return define(
        "pump part",
        relations={
            "c1": _shaft(flow_acceleration),
            **{name: hydraulics[name] for name in ("c2", "c3", "c4")},
            "m_w": y_w - omega,
            "m_T": y_T - T_e,
            **{name: hydraulics[name] for name in ("m_H", "m_Q")},
        },
        derivatives={"d1": (omega_dot, omega)} | ({"d2": (Q_i_dot, Q_i)} if flow_acceleration else {}),
        unknown=[omega, omega_dot, T_e, T_p, H_p, Q_i, Q_p] + ([Q_i_dot] if flow_acceleration else []),
        known=[y_w, y_T, y_H, y_Q],
        faults=FAULTS,
        parameters=[J, B, *([K_Q] if flow_acceleration else []), kappa_c, kappa_d, *MAPS],
    )


def pump_with_motor(*, flow_acceleration: bool = False) -> StructuralModel:
    """The whole system: induction motor in stator-fixed coordinates, shaft and pump; currents, head and flow measured.

    Parameters
    ----------
    flow_acceleration : bool
        As in `pump_part`.

    Returns
    -------
    StructuralModel
        Motor constraints s_d, s_q (stator), r_d, r_q (rotor), e_T (torque), m_id, m_iq, d_id, d_iq, d_md, d_mq, and
        those of the pump without m_w and m_T. Voltages are known inputs.

    References
    ----------
    Thesis 3.2 (equations of the motor), 6.3.
    """
    i_d, i_q, i_md, i_mq = sp.symbols("i_d i_q i_md i_mq", real=True)
    rates = sp.symbols("i_d_dot i_q_dot i_md_dot i_mq_dot", real=True)
    v_d, v_q, y_id, y_iq = sp.symbols("v_d v_q y_id y_iq", real=True)
    R_s, R_r, L_s, L_m, z_p = sp.symbols("R_s R_r L_s L_m z_p", positive=True)
    cross_d = R_r * i_md + z_p * omega * L_m * i_mq
    cross_q = R_r * i_mq - z_p * omega * L_m * i_md
    hydraulics = _hydraulics()
    return define(
        "pump with motor",
        relations={
            "s_d": L_s * rates[0] - v_d + (R_s + R_r) * i_d - cross_d,
            "s_q": L_s * rates[1] - v_q + (R_s + R_r) * i_q - cross_q,
            "r_d": L_m * rates[2] - R_r * i_d + cross_d,
            "r_q": L_m * rates[3] - R_r * i_q + cross_q,
            "e_T": T_e - sp.Rational(3, 2) * z_p * L_m * (i_md * i_q - i_mq * i_d),
            "m_id": y_id - i_d,
            "m_iq": y_iq - i_q,
            "c1": _shaft(flow_acceleration),
            **hydraulics,
        },
        derivatives={
            "d_id": (rates[0], i_d),
            "d_iq": (rates[1], i_q),
            "d_md": (rates[2], i_md),
            "d_mq": (rates[3], i_mq),
            "d1": (omega_dot, omega),
        }
        | ({"d2": (Q_i_dot, Q_i)} if flow_acceleration else {}),
        unknown=[
            *(i_d, i_q, i_md, i_mq, *rates, omega, omega_dot, T_e, T_p, H_p, Q_i, Q_p),
            *([Q_i_dot] if flow_acceleration else []),
        ],
        known=[v_d, v_q, y_id, y_iq, y_H, y_Q],
        faults=FAULTS,
        parameters=[R_s, R_r, L_s, L_m, z_p, J, B, *([K_Q] if flow_acceleration else []), kappa_c, kappa_d, *MAPS],
    )


def steady_state() -> StructuralModel:
    """The whole system in steady state: effective values and angle of the supply, head and flow are known.

    The frame turns with the supply, its d axis is on the current: the current has no q component.

    Returns
    -------
    StructuralModel
        Motor constraints u_d, u_q (voltage), e_d, e_q (voltage behind resistance and leakage reactance), g_d, g_q
        (magnetizing current), r_d, r_q (rotor), s (speed), e_T (torque); c1 to c4, m_H, m_Q of the pump at rest of the
        speed. No state.

    References
    ----------
    Thesis 7.1.
    """
    V, current, omega_e = sp.symbols("V_rms I_rms omega_e", positive=True)
    phi = sp.Symbol("phi", real=True)
    R_s, R_r, L_s, L_m, z_p = sp.symbols("R_s R_r L_s L_m z_p", positive=True)
    V_d, V_q, E_d, E_q, I_md, I_mq, slip = sp.symbols("V_d V_q E_d E_q I_md I_mq omega_slip", real=True)
    amplitude = sp.sqrt(2) * current
    return define(
        "pump in steady state",
        relations={
            "u_d": V_d - sp.sqrt(2) * V * sp.cos(phi),
            "u_q": V_q - sp.sqrt(2) * V * sp.sin(phi),
            "e_d": E_d - V_d + R_s * amplitude,
            "e_q": E_q - V_q + omega_e * L_s * amplitude,
            "g_d": E_d + omega_e * L_m * I_mq,
            "g_q": E_q - omega_e * L_m * I_md,
            "r_d": R_r * (amplitude - I_md) + slip * L_m * I_mq,
            "r_q": R_r * I_mq + slip * L_m * I_md,
            "s": z_p * omega - omega_e + slip,
            "e_T": T_e - sp.Rational(3, 2) * z_p * E_d * amplitude / omega_e,
            "c1": T_e - (B + dB) * omega - T_p,
            **_hydraulics(),
        },
        unknown=[V_d, V_q, E_d, E_q, I_md, I_mq, slip, omega, T_e, T_p, H_p, Q_i, Q_p],
        known=[V, current, phi, omega_e, y_H, y_Q],
        faults=FAULTS,
        parameters=[R_s, R_r, L_s, L_m, z_p, B, kappa_c, kappa_d, *MAPS],
    )


def mso_counts() -> tuple[int, int, int]:
    """Number of minimal over-constrained subsets of the pump part in three readings of the reconstruction.

    Returns
    -------
    tuple of int
        As modelled; without leakage; with the clogging loss of c2 in the delivered flow.
    """
    readings = (pump_part(), pump_part().healthy([K_l]), pump_part(loss_flow="Q_p"))
    first, second, third = (len(mso_matrix(model.structure())) for model in readings)
    return first, second, third
