"""The three residuals: zero when healthy, symbolic and compiled the same, and those of the structural analysis."""

import numpy as np
import pytest
import sympy as sp

from pumplib.errors import DataError, ParameterError
from pumplib.steady.operating import steady_points, v_f_voltage
from pumplib.steady.phasors import electrical_parameters, torque_and_speed
from pumplib.steady.relations import (
    CHANNELS,
    FAULTS,
    NEEDS,
    PARAMETERS,
    evaluate,
    flow_from_head,
    head,
    load_torque,
    residual_batch,
    residuals,
)
from pumplib.structure.mso import mso_sets
from pumplib.structure.pump import steady_state as structural_model
from tests.steady.cases import MOTOR, RELATIONS, VALUES, grid


def test_residuals_vanish_on_exact_points_with_losses_too() -> None:
    for extra in ({}, {"G_core": 2e-4, "stray": 2e-3}):
        values = VALUES | extra
        points = steady_points(MOTOR, values, V_rms=v_f_voltage([30, 40, 50]), frequency_hz=[30, 40, 50], valve=2e11)
        found = evaluate(RELATIONS, points.signals, values)
        np.testing.assert_allclose(found / [1e5, 1, 1], 0, atol=1e-11)


def test_each_residual_reacts_to_its_faults_only_and_with_the_right_sign() -> None:
    signs = {"K_f": (-1, 0, -1), "dB": (0, 1, 1), "K_l": (-1, 1, 0), "f_c": (-1, -1, -1), "f_d": (-1, -1, -1)}
    sizes = {"K_f": 1e10, "dB": 2.5e-4, "K_l": 6e-8, "f_c": 0.025, "f_d": 0.9}
    for fault, sign in signs.items():
        found = evaluate(RELATIONS, grid(3, **{fault: sizes[fault]}).signals, VALUES) / [1e5, 1, 1]
        for k, name in enumerate(("R1", "R2", "R3")):
            assert (fault in FAULTS[name]) == (sign[k] != 0)
            np.testing.assert_array_equal(np.sign(np.where(np.abs(found[:, k]) < 1e-11, 0, found[:, k])), sign[k])


def test_symbolic_and_compiled_agree_at_random_points() -> None:
    rng = np.random.default_rng(2)
    x = np.column_stack([grid(4).signals[name] for name in CHANNELS]) * rng.uniform(0.97, 1.03, (16, 6))
    x[:, 4] *= 0.7  # a head below the pump's largest for all parameters drawn
    p = np.array([VALUES[name] or 1e-3 for name in PARAMETERS]) * rng.uniform(0.9, 1.1, (16, 12))
    constants = (1.0, 1.02, 0.97)
    symbols = sp.symbols([*CHANNELS, *PARAMETERS], positive=True)
    formulas = residuals(*symbols, *constants)
    out = np.empty((16, 3))
    residual_batch(x, p, constants, out)
    for k, formula in enumerate(formulas):
        wanted = sp.lambdify(symbols, formula)(*x.T, *p.T)
        np.testing.assert_allclose(out[:, k], wanted, rtol=1e-10, atol=1e-10)


def test_structural_analysis_finds_relations_with_these_faults() -> None:
    model = structural_model()
    structure = model.structure()
    names = {"dB": "dB", "K_f": "K_f", "K_l": "K_l", "f_c": "f_c", "f_d": "f_d"}
    found = set()
    for subset in mso_sets(structure):
        touched = {f.name for c in subset for f in model.faults_of(c)}
        found.add(frozenset(touched & set(names)))
    for name, faults in FAULTS.items():
        assert frozenset(faults) in found, name


def test_residuals_are_the_constraints_of_the_structural_model() -> None:
    model = structural_model()
    s = {f.name: f for f in (*model.unknown, *model.known, *model.parameters, *model.faults)}
    e = electrical_parameters(MOTOR)
    V, I, w_e, phi, H, Q = (s[n] for n in ("V_rms", "I_rms", "omega_e", "phi", "y_H", "y_Q"))
    T_e, omega = torque_and_speed(V, I, w_e, phi, s["R_s"], s["L_s"], s["R_r"], 0, s["z_p"])
    maps = [s[n] for n in ("a_h0", "a_h1", "a_h2", "a_t0", "a_t1", "a_t2")]
    ours = residuals(V, I, w_e, phi, H, Q, s["R_s"], s["L_s"], s["R_r"], 0, s["B"], 0, *maps, s["z_p"], 1, 1)
    healthy = dict.fromkeys(model.faults, 0)
    relation = {name: expression.subs(healthy) for name, expression in model.relations.items()}
    c2 = relation["c2"].subs({s["H_p"]: H, s["Q_i"]: Q, s["omega"]: omega})
    assert sp.simplify(c2 - ours[0]) == 0
    load = sp.solve(relation["c3"], s["T_p"])[0]
    for flow, residual in ((Q, ours[1]), (flow_from_head(H, omega, *maps[:3]), ours[2])):
        c1 = relation["c1"].subs({s["T_e"]: T_e, s["T_p"]: load}).subs({s["Q_i"]: flow, s["omega"]: omega})
        point = {V: 230, I: 2.5, w_e: 314, phi: 0.7, H: 4.5e5, Q: 1.5e-3, s["z_p"]: e.z_p, s["R_s"]: 4.1}
        point |= {s["R_r"]: 2.36, s["L_s"]: 0.0237, s["B"]: VALUES["B"]} | {m: VALUES[m.name] for m in maps}
        assert float((c1 - residual).subs(point)) == pytest.approx(0, abs=1e-12)


def test_every_constraint_of_the_structural_model_holds_on_faulty_points() -> None:
    model = structural_model()
    s = {f.name: f for f in (*model.unknown, *model.known, *model.parameters, *model.faults)}
    e = electrical_parameters(MOTOR)
    symbols = list(s.values())
    terms = {
        name: sp.lambdify(symbols, sp.Add.make_args(sp.expand(expression)), "math")
        for name, expression in model.relations.items()
    }
    for fault, size in {"none": 0.0, "K_f": 1e10, "dB": 5e-4, "K_l": 1e-7, "f_c": 0.1, "f_d": 0.6}.items():
        points = grid(2, **({} if fault == "none" else {fault: size}))
        x = {name: float(column[1]) for name, column in points.signals.items()}
        i, phi = np.sqrt(2) * x["I_rms"], x["phi"]
        V_d, V_q = np.sqrt(2) * x["V_rms"] * np.array([np.cos(phi), np.sin(phi)])
        E_d, E_q = V_d - e.r_s * i, V_q - x["omega_e"] * e.L_s_prime * i
        I_m = (E_d + 1j * E_q) / (1j * x["omega_e"] * e.L_m_prime)
        Q_i = x["Q"] + (size if fault == "K_l" else 0) * np.sqrt(x["H"])
        share = {"f_c": 0.45, "f_d": 0.93}.get(fault, 0.0)
        omega = float(points.omega[1])
        T_p = (1 - share * size) * load_torque(Q_i, omega, 0.0, *(VALUES[n] for n in PARAMETERS[9:]))
        values = {
            "V_d": V_d, "V_q": V_q, "E_d": E_d, "E_q": E_q, "I_md": I_m.real, "I_mq": I_m.imag,
            "omega_slip": x["omega_e"] - e.z_p * omega, "omega": omega, "T_e": float(points.torque_em[1]), "T_p": T_p,
            "H_p": x["H"], "Q_i": Q_i, "Q_p": x["Q"], "V_rms": x["V_rms"], "I_rms": x["I_rms"], "omega_e": x["omega_e"],
            "phi": phi, "y_H": x["H"], "y_Q": x["Q"], "R_s": e.r_s, "R_r": e.R_r_prime, "L_s": e.L_s_prime,
            "L_m": e.L_m_prime, "z_p": e.z_p, "B": VALUES["B"], "kappa_c": 0.45, "kappa_d": 0.93,
            **{n: VALUES[n] for n in PARAMETERS[6:]}, **dict.fromkeys(("K_f", "dB", "K_l", "f_c", "f_d"), 0.0),
        }  # fmt: skip
        values |= {fault: size} if fault != "none" else {}
        for name, compute in terms.items():
            parts = compute(*(values[symbol] for symbol in s))
            assert abs(sum(parts)) < 1e-9 * max(map(abs, parts)), (fault, name)


def test_flow_inverts_the_head() -> None:
    maps = [VALUES[n] for n in PARAMETERS[6:9]]
    Q = np.linspace(0.4e-3, 2e-3, 9)
    np.testing.assert_allclose(flow_from_head(head(Q, 300.0, *maps), 300.0, *maps), Q, rtol=1e-12)


def test_missing_and_bad_inputs_are_named() -> None:
    signals = dict(grid(2).signals)
    with pytest.raises(ParameterError, match="a_h1"):
        evaluate(RELATIONS, signals, {k: v for k, v in VALUES.items() if k != "a_h1"})
    with pytest.raises(DataError, match=r"Q .*missing"):
        evaluate(RELATIONS, {k: v for k, v in signals.items() if k != "Q"}, VALUES)
    with pytest.raises(DataError, match="sample 2"):
        evaluate(RELATIONS, signals | {"H": np.array([4e5, 4e5, np.nan, 4e5])}, VALUES)
    with pytest.raises(DataError, match="different lengths"):
        evaluate(RELATIONS, signals | {"H": np.ones(3)}, VALUES)
    assert set(NEEDS["R3"]) == set(CHANNELS) - {"Q"}
