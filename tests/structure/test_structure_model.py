"""One definition gives structure and numbers; a definition that contradicts itself is refused by name."""

import numpy as np
import pytest
import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure import examples, pump
from pumplib.structure.graph import Structure, bits
from pumplib.structure.model import Constraint, StructuralModel, define

x, x_dot, z = sp.symbols("x x_dot z")
u, y, f, a = sp.symbols("u y f a")
GOOD = {
    "relations": {"e1": x_dot + a * x - u - f, "m": sp.Eq(y, x)},
    "derivatives": {"d": (x_dot, x)},
    "unknown": [x, x_dot],
    "known": [u, y],
    "faults": [f],
    "parameters": [a],
}


def changed(**changes):
    return define("tank", **(GOOD | changes))


def test_definition_keeps_order_and_roles():
    model = changed()
    assert model.names == ("e1", "m", "d")
    assert (model.states, model.rates, model.algebraic) == ((x,), (x_dot,), ())
    assert model.derivatives == {x_dot: x}
    assert model.relations["m"] == y - x
    assert model.faults_of("e1") == (f,)
    assert model.faults_of("m") == ()
    assert model["d"].is_differential
    assert str(model["d"]) == "d: x_dot = dx/dt"
    assert "a*x" in str(model["e1"])
    assert model.symbol("u") is u


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"relations": GOOD["relations"] | {"e2": x + sp.Symbol("q")}}, ("e2", "q", "declare")),
        ({"relations": GOOD["relations"] | {"e2": y - u}}, ("e2", "no unknown")),
        ({"relations": GOOD["relations"] | {"e2": x + sp.Symbol("u", positive=True)}}, ("e2", "assumptions", "u")),
        ({"relations": GOOD["relations"] | {"e2": "x + u"}}, ("e2", "SymPy")),
        ({"relations": GOOD["relations"] | {"e2": x / sp.S.Zero}}, ("e2", "finite")),
        ({"relations": GOOD["relations"] | {"e2": sp.Derivative(sp.Function("g")(x), x) + x}}, ("e2", "x_dot")),
        ({"faults": [f, sp.Symbol("f_2")]}, ("fault f_2", "no constraint")),
        ({"unknown": [x, x_dot, z]}, ("unknown z", "no constraint")),
        ({"known": [u, y, sp.Symbol("w")]}, ("known variable w", "no constraint")),
        ({"known": [u, y, x]}, ("x is both unknown and known",)),
        ({"known": [u, y, y]}, ("y is twice among the knowns",)),
        ({"known": [u, y, sp.Symbol("x", real=True)]}, ("two symbols are named x",)),
        ({"known": [u, "y"]}, ("known 'y'", "no SymPy symbol")),
        ({"derivatives": {}}, ("e1", "x_dot", "without its differential constraint", "(x_dot, x)")),
        ({"derivatives": {"d": (x_dot, u)}}, ("d: state u", "must be an unknown")),
        ({"derivatives": {"d": (u, x)}}, ("d: rate u", "must be an unknown")),
        ({"derivatives": {"d": (x, x)}}, ("d", "same symbol x")),
        ({"derivatives": {"d": (x_dot,)}}, ("d", "(rate, state)")),
        ({"derivatives": {"d": (x_dot, x), "d2": (x_dot, x)}}, ("d2", "already the rate in d")),
        ({"derivatives": {"m": (x_dot, x)}}, ("two constraints are named m",)),
        ({"relations": {"m": y - x - f - a - u}}, ("d: rate x_dot", "no other constraint")),
    ],
)  # fmt: skip
def test_contradictions_are_refused_by_name(changes, words):
    with pytest.raises(ParameterError) as caught:
        changed(**changes)
    assert all(word in str(caught.value) for word in ("tank", *words))


def test_constraint_needs_relation_or_rate():
    for bad in (Constraint(name="e"), Constraint(name="e", relation=x, rate=x_dot, state=x)):
        with pytest.raises(ParameterError, match="constraint e"):
            StructuralModel(name="tank", constraints=(bad,), unknown=(x, x_dot))


def test_structure_with_faults_as_terms_absent_or_unknown():
    model = pump.pump_part()
    terms, absent, unknown = (model.structure(kind) for kind in ("terms", "absent", "unknown"))
    assert set(terms.unknowns_of(["c4"])) == {"Q_i", "Q_p", "H_p"}
    assert set(absent.unknowns_of(["c4"])) == {"Q_i", "Q_p"}
    assert set(unknown.unknowns_of(["c4"])) == {"Q_i", "Q_p", "H_p", "K_l"}
    for one in (terms, absent, unknown):  # where a fault enters does not depend on the reading
        assert one.faults_of(["c2"]) == ("K_f", "f_c", "f_d")
        assert one.differential == (("d1", "omega_dot", "omega"),)
    with pytest.raises(ParameterError, match="faults = 'some'"):
        model.structure("some")


def test_incidence_is_that_of_the_symbols():
    model = examples.induction_motor()
    found, s = model.structure().incidence().toarray(), model.structure()
    for constraint, row in zip(model.constraints, found, strict=True):
        assert {s.unknowns[k] for k in np.flatnonzero(row)} == {v.name for v in constraint.symbols & {*model.unknown}}
    entering = s.fault_incidence().toarray()
    assert entering.shape == (15, 2)
    assert entering.sum() == 2


def test_submodel_keeps_only_what_occurs():
    model = pump.pump_part()
    part = model.submodel(["m_Q", "c2", "c4", "m_w", "m_H"], name="r1")
    assert part.names == ("c2", "c4", "m_w", "m_H", "m_Q")
    assert {s.name for s in part.unknown} == {"omega", "H_p", "Q_i", "Q_p"}
    assert {s.name for s in part.known} == {"y_w", "y_H", "y_Q"}
    assert {s.name for s in part.faults} == {"K_f", "K_l", "f_c", "f_d"}
    assert part.states == ()
    with pytest.raises(ParameterError, match="no constraint 'c9'"):
        model.submodel(["c9"])
    with pytest.raises(ParameterError, match="at least one"):
        model.submodel([])


def test_known_variables():
    model = pump.steady_state().with_known(["T_e"])
    assert pump.T_e in model.known
    assert pump.T_e not in model.unknown
    assert "T_e" not in model.structure().unknowns
    with pytest.raises(ParameterError, match="no unknown"):
        model.with_known(["T_e"])
    with pytest.raises(ParameterError, match="differential constraint"):
        pump.pump_part().with_known(["omega"])


def test_healthy_model_refuses_what_is_no_fault():
    with pytest.raises(ParameterError, match="J is no fault"):
        pump.pump_part().healthy(["J"])


def operating_point(faults):
    """Steady values that satisfy all algebraic constraints of the pump part, from the flow and the speed."""
    p = {"J": 6e-3, "B": 3.3e-4, "kappa_c": 0.45, "kappa_d": 0.93}
    p |= {"a_h0": 7.2, "a_h1": 1e5, "a_h2": 8.1e10, "a_t0": 1.67e-5, "a_t1": 6.04, "a_t2": 2e5} | faults
    w, Q, rate = np.array([250.0, 306.0]), np.array([1.2e-3, 1.6e-3]), np.array([3.0, -20.0])
    share = faults.get("f_c", 0) + faults.get("f_d", 0)
    H = (p["a_h0"] * w**2 + p["a_h1"] * w * Q - p["a_h2"] * Q**2) * (1 - share) - faults.get("K_f", 0) * Q**2
    loss = p["kappa_c"] * faults.get("f_c", 0) + p["kappa_d"] * faults.get("f_d", 0)
    T = (p["a_t0"] * w**2 + p["a_t1"] * w * Q - p["a_t2"] * Q**2) * (1 - loss)
    Q_p = Q - faults.get("K_l", 0) * np.sqrt(H)
    T_e = p["J"] * rate + (p["B"] + faults.get("dB", 0)) * w + T
    unknown = {"omega": w, "omega_dot": rate, "Q_i": Q, "Q_p": Q_p, "H_p": H, "T_p": T, "T_e": T_e}
    return p | unknown | {"y_w": w, "y_H": H, "y_Q": Q_p, "y_T": T_e}


@pytest.mark.parametrize(
    "faults", [{}, {"K_f": 1e10}, {"K_l": 2.4e-7}, {"dB": 5e-4}, {"f_c": 0.1}, {"f_d": 0.9}, {"K_f": 5e9, "f_c": 0.02}]
)
def test_numbers_come_from_the_same_relations(faults):
    model, values = pump.pump_part(), operating_point(faults)
    size = {"c1": 1.0, "c2": 1e5, "c3": 1.0, "c4": 1e-3, "m_w": 1.0, "m_T": 1.0, "m_H": 1.0, "m_Q": 1.0}
    for name in model.relations:
        assert np.abs(model.function(name)(values)).max() < 1e-12 * size[name]
    # without the faults exactly those constraints are broken that a fault enters
    healthy = {k: v for k, v in values.items() if k not in faults}
    for name in model.relations:
        hit = any(s.name in faults for s in model.faults_of(name))
        assert (np.abs(model.function(name)(healthy)).min() > 1e-9 * size[name]) == hit


def test_numbers_refuse_missing_values():
    model, values = pump.pump_part(), operating_point({})
    with pytest.raises(ParameterError, match="c3: no value of T_p"):
        model.function("c3")({k: v for k, v in values.items() if k != "T_p"})
    with pytest.raises(ParameterError, match="c3: T_p contains NaN"):
        model.function("c3")(values | {"T_p": np.array([1.0, np.nan])})
    with pytest.raises(ParameterError, match="d1"):
        model.function("d1")


def test_steady_state_relations_hold_for_a_motor_at_work():
    """Solved by hand with complex numbers: slip, speed and torque satisfy all ten electrical constraints."""
    R_s, R_r, L_s, L_m, z_p, w_e, slip = 4.1, 2.3, 0.023, 0.39, 1, 314.0, 9.0
    V = 230 * np.sqrt(2)
    # current in the frame of the voltage, then everything turned so that the current is real
    rotor = 1 / (1 / (1j * w_e * L_m) + slip / (w_e * R_r))
    current = V / (R_s + 1j * w_e * L_s + rotor)
    phi = -np.angle(current)
    I, E = abs(current), rotor * abs(current)
    I_m = E / (1j * w_e * L_m)
    power = abs(E) ** 2 * slip / (w_e * R_r)  # through the air gap, two thirds of it
    values = {"V_rms": 230.0, "I_rms": I / np.sqrt(2), "phi": phi, "omega_e": w_e, "R_s": R_s, "R_r": R_r, "L_s": L_s}
    values |= {"L_m": L_m, "z_p": z_p, "V_d": V * np.cos(phi), "V_q": V * np.sin(phi), "E_d": E.real, "E_q": E.imag}
    values |= {"I_md": I_m.real, "I_mq": I_m.imag, "omega_slip": slip, "omega": (w_e - slip) / z_p}
    values |= {"T_e": 1.5 * power * z_p / w_e}
    model = pump.steady_state()
    for name in ("u_d", "u_q", "e_d", "e_q", "g_d", "g_q", "r_d", "r_q", "s", "e_T"):
        assert abs(model.function(name)(values)) < 1e-10


def test_examples_and_pump_refuse_unknown_words():
    for call in (
        lambda: examples.satellite("mass"),
        lambda: examples.induction_motor(signs="other"),
        lambda: pump.pump_part(head_flow="Q"),
        lambda: pump.pump_part(loss_flow="Q"),
    ):
        with pytest.raises(ParameterError, match="must be"):
            call()


def test_signs_do_not_change_the_structure():
    first, second = (examples.induction_motor(signs=s).structure() for s in ("published", "physical"))
    assert first.rows == second.rows


def test_structure_from_facts():
    s = Structure.from_sets("s", {"e1": ["a", "b"], "e2": ["b"]}, faults={"e2": ["f"]}, unknowns=["b", "a"])
    assert s.unknowns == ("b", "a")
    assert s.rows == (3, 1)
    assert s.fault_rows == (0, 1)
    assert s.sub(["e1"], known=["b"]).unknowns == ("a",)
    assert bits(0b10110) == [1, 2, 4]
    same = Structure.from_matrix("m", s.incidence().toarray())
    assert same.rows == s.rows
    assert same.constraints == ("e1", "e2")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Structure.from_sets("s", {"e": ["a"]}, faults={"q": ["f"]}), "q, which is no constraint"),
        (lambda: Structure.from_sets("s", {"e": ["a"]}, unknowns=["b"]), "e contains a"),
        (lambda: Structure.from_matrix("s", [1, 0]), "must be a matrix"),
        (lambda: Structure.from_matrix("s", [[1.0, np.nan]]), "must be a matrix"),
        (lambda: Structure.from_matrix("s", [["a"]]), "must be a matrix"),
        (lambda: Structure(name="s", constraints=("e", "e"), unknowns=("a",), rows=(1, 1)), "e is there twice"),
        (lambda: Structure(name="s", constraints=("e",), unknowns=("a",), rows=(2,)), "e refers to more than 1"),
        (lambda: Structure(name="s", constraints=("e",), unknowns=("a",), rows=(1, 1)), "2 rows"),
        (lambda: Structure.from_matrix("s", [[1]]).sub(["e2"]), "no constraint 'e2'"),
        (lambda: Structure.from_matrix("s", [[1]]).sub(["e1"], known=["q"]), "'q' is no unknown"),
    ],
)  # fmt: skip
def test_structures_that_do_not_fit_are_refused(call, words):
    with pytest.raises(ParameterError, match=words):
        call()
