"""Realizations against results known from the literature or derived by hand, and every way to fail."""

from collections import Counter

import pytest
import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure import examples, pump, realization_examples
from pumplib.structure.elimination import Branch, eliminate, largest_at, nearest_to
from pumplib.structure.integrals import annihilates
from pumplib.structure.model import StructuralModel, define
from pumplib.structure.mso import mso_sets
from pumplib.structure.realization import realize
from pumplib.structure.realization_report import Outcome, RealizationError, Report

POINT = {"omega": 306.0, "Q_i": 1.6e-3, "H_p": 4.9e5, "y_w": 306.0, "y_H": 4.9e5, "y_Q": 1.6e-3, "y_T": 4.2, "J": 0.006,
         "B": 3.3e-4, "K_Q": 40.0, "a_h0": 7.2, "a_h1": 1e5, "a_h2": 8.1e10, "a_t0": 1.67e-5, "a_t1": 6.04,
         "a_t2": 2e5}  # fmt: skip
PUMP = {
    "r1": "c2 c4 m_w m_H m_Q",
    "r2": "c1 c3 c4 m_w m_T m_H m_Q d1",
    "r3": "c1 c2 c3 m_w m_T m_H d1",
    "r4": "c1 c2 c3 c4 m_T m_H m_Q d1",
}
PUBLISHED = {"three tanks": 6, "DC motor": 3, "induction motor, published signs": 9}


def pump_report(name: str, flow_acceleration: bool = True) -> Report:
    chosen = PUMP[name].split() + (["d2"] if flow_acceleration and name != "r1" else [])
    model = pump.pump_part(flow_acceleration=flow_acceleration)
    return realize(model, chosen, prefer=largest_at(POINT), name=name)


def published() -> list[tuple[StructuralModel, tuple[str, ...]]]:
    models = [examples.three_tanks(), examples.dc_motor(), examples.induction_motor()]
    return [(model, one) for model in models for one in mso_sets(model.structure())]


def check_blind(report: Report) -> None:
    """dT/dx G = 0 symbolically, for every transformation on the way."""
    for one in report.transformations:
        for T in one.integrals.functions:
            assert annihilates(T, one.fields, one.system.states)


def plant(relations: dict, pairs: dict, unknown: str, known: str, parameters: str = "") -> StructuralModel:
    return define(
        "plant",
        relations=relations,
        derivatives=pairs,
        unknown=sp.symbols(unknown, seq=True),
        known=sp.symbols(known, seq=True),
        parameters=sp.symbols(parameters, seq=True) if parameters else (),
    )


def in_plane(first: sp.Expr, second: sp.Expr, **outputs: sp.Expr) -> StructuralModel:
    """States x1, x2 with the given rates in the unknown v, both measured unless outputs are given."""
    x1, x2, y1, y2, d1, d2 = sp.symbols("x1 x2 y1 y2 x1_dot x2_dot")
    relations = {"e1": d1 - first, "e2": d2 - second} | (outputs or {"m1": y1 - x1, "m2": y2 - x2})
    return plant(relations, {"d1": (d1, x1), "d2": (d2, x2)}, "x1 x2 x1_dot x2_dot v", "y1 y2")


@pytest.mark.parametrize("form", ["velocity", "force"])
def test_satellite_gives_angular_momentum(form: str) -> None:
    model = examples.satellite(form)  # type: ignore[arg-type]
    report = realize(model)
    found = report.require()
    rho, omega, u_2, y1, y2, theta_2 = (model.symbol(n) for n in ("rho", "omega", "u_2", "y1", "y2", "theta_2"))
    (z,) = found.states
    assert sp.simplify(found.definitions[0] - rho**2 * omega) == 0
    assert sp.simplify(found.rates[0] - theta_2 * u_2 * y1) == 0
    assert sp.simplify(found.residuals[0] - (y2 - z / y1**2)) == 0
    assert len(report.transformations) == (1 if form == "velocity" else 2)
    check_blind(report)
    assert found.equivalent


def test_momentum_of_rotor_and_liquid_needs_no_derivative_of_the_flow() -> None:
    found = pump_report("r2").require()
    J, K_Q, omega, Q, y_w, y_Q = pump.J, pump.K_Q, pump.omega, pump.Q_i, pump.y_w, pump.y_Q
    assert sp.simplify(found.definitions[0] - (J * omega - K_Q * Q)) == 0
    assert sp.simplify(found.rates[0] - (pump.y_T - pump.B * y_w - pump.torque_map(y_Q, y_w))) == 0
    assert sp.simplify(found.residuals[0] - (J * y_w - K_Q * y_Q - found.states[0])) == 0
    assert pump.y_H not in found.signals  # blind to clogging: no head in it


def test_third_residual_has_the_flow_from_the_head_and_the_larger_root() -> None:
    report = pump_report("r3")
    found = report.require()
    assert pump.y_Q not in found.signals  # blind to leakage: no flow signal in it
    flow = sp.solve(pump.head_map(pump.Q_i, pump.y_w) - pump.y_H, pump.Q_i)
    larger = max(flow, key=lambda q: float(q.subs({s: POINT[s.name] for s in q.free_symbols})))
    J, K_Q = pump.J, pump.K_Q
    assert sp.simplify(found.residuals[0] - (J * pump.y_w - K_Q * larger - found.states[0])) == 0
    assert all(branch.preferred for branch in report.branches)
    assert len(found.radicands) == 1


def test_fourth_residual_has_no_speed_signal_and_first_is_static() -> None:
    fourth, first = pump_report("r4").require(), pump_report("r1").require()
    assert pump.y_w not in fourth.signals
    assert not first.states
    assert sp.expand(first.residuals[0] - (pump.y_H - pump.head_map(pump.y_Q, pump.y_w))) == 0


@pytest.mark.parametrize("name", list(PUMP))
@pytest.mark.parametrize("flow_acceleration", [False, True])
def test_all_pump_residuals_are_realized(name: str, flow_acceleration: bool) -> None:
    report = pump_report(name, flow_acceleration)
    assert report.outcome is Outcome.OK
    check_blind(report)
    found = report.require()
    allowed = {*found.states, *found.signals, *found.parameters}
    assert all(e.free_symbols <= allowed for e in (*found.rates, *found.residuals))
    assert len(found.residuals) == 1


def test_published_models_sixteen_of_eighteen() -> None:
    outcomes: dict[str, Counter[Outcome]] = {}
    for model, chosen in published():
        report = realize(model, chosen)
        outcomes.setdefault(model.name, Counter())[report.outcome] += 1
        check_blind(report)
    assert {name: sum(one.values()) for name, one in outcomes.items()} == PUBLISHED
    assert outcomes["three tanks"] == {Outcome.OK: 6}
    assert outcomes["DC motor"] == {Outcome.OK: 3}
    # Two need the acceleration: their functions contain the measured speed.
    assert outcomes["induction motor, published signs"] == {Outcome.OK: 7, Outcome.FAIL_5: 2}


def test_three_tanks_keep_the_mass_of_two_tanks() -> None:
    model = examples.three_tanks()
    without_first_valve = next(one for one in mso_sets(model.structure()) if "e1" not in one)
    found = realize(model, without_first_valve).require()
    mass = sum(model.symbol(c) * model.symbol(p) for c, p in (("CT1", "p1"), ("CT2", "p2")))
    assert any(sp.simplify(T - mass) == 0 for T in found.definitions)


def test_speed_free_residual_of_the_induction_motor_is_quadratic() -> None:
    model = examples.induction_motor(signs="physical")
    speed_free = next(one for one in mso_sets(model.structure()) if "e15" not in one)
    found = realize(model, speed_free).require()
    b, i_a, i_b, l_a, l_b = (model.symbol(n) for n in ("b", "i_a", "i_b", "lambda_a", "lambda_b"))
    # The square of the vector i + b lambda minus that of b lambda: invariant under the turning by any speed.
    expected = i_a**2 + i_b**2 + 2 * b * (i_a * l_a + i_b * l_b)
    assert any(sp.simplify(T - expected) == 0 for T in found.definitions)


def test_a_known_rate_of_the_signal_resolves_fail_5() -> None:
    model = examples.induction_motor()
    chosen = next(one for one in mso_sets(model.structure()) if realize(model, one).outcome is Outcome.FAIL_5)
    assert "y3" in realize(model, chosen).detail
    rate = sp.Symbol("y3_rate")
    report = realize(model, chosen, signal_rates={model.symbol("y3"): rate})
    assert report.ok
    assert rate in report.require().signals
    with pytest.raises(ParameterError, match="no known variable"):
        realize(model, chosen, signal_rates={sp.Symbol("x"): rate})


@pytest.mark.parametrize(
    ("model", "function"),
    [
        (realization_examples.bioreactor(), "S + k*X"),
        (realization_examples.stirred_tank(), "Theta + h*c"),
        (realization_examples.robot_arm(), "(d + b*cos(q))*w_1 + d*w_2"),
        (realization_examples.aircraft(), "v_x*cos(theta) + v_z*sin(theta)"),
    ],
    ids=lambda one: one.name if isinstance(one, StructuralModel) else "",
)
def test_nonlinear_plants_of_the_literature(model: StructuralModel, function: str) -> None:
    report = realize(model)
    check_blind(report)
    names = {s.name: s for s in (*model.unknown, *model.parameters)}
    expected = sp.sympify(function, locals=names)
    assert any(sp.simplify(T - expected) == 0 for T in report.require().definitions)


x1, x2, v = sp.symbols("x1 x2 v")


def test_fail_1_unknown_of_an_output_has_no_closed_form() -> None:
    x, y1, y2, a = sp.symbols("x y1 y2 a")
    relations = {"m1": y1 - x - a - sp.exp(a) * sp.sin(a), "m2": y2 - x}
    report = realize(define("plant", relations=relations, unknown=[x, a], known=[y1, y2]))
    assert report.outcome is Outcome.FAIL_1
    assert "m1" in report.detail
    assert report.realization is None


def test_fail_2_names_the_new_unknown_input_and_separate_takes_it() -> None:
    model = in_plane(v**2 + x1, 3 * v**2 - x2)
    report = realize(model)
    assert report.outcome is Outcome.FAIL_2
    assert "v**2" in report.remedy
    allowed = realize(model, separate=True)
    assert sp.expand(allowed.require().definitions[0] - (3 * x1 - x2)) == 0
    # Two different functions of the unknown reach both states.
    assert realize(in_plane(v**2, v**3), separate=True).outcome is Outcome.FAIL_3
    mixed = realize(in_plane(sp.sin(x1 * v), v))
    assert mixed.outcome is Outcome.FAIL_2
    assert "measure it" in mixed.remedy


def test_fail_3_heisenberg() -> None:
    x3, y1, y2, y3, w = sp.symbols("x3 y1 y2 y3 w")
    rates = sp.symbols("x1_dot x2_dot x3_dot")
    model = plant(
        {"e1": rates[0] - v, "e2": rates[1] - w, "e3": rates[2] - x1 * w + x2 * v, "m1": y1 - x1, "m2": y2 - x2,
         "m3": y3 - x3},
        {f"d{k}": (r, x) for k, (r, x) in enumerate(zip(rates, (x1, x2, x3), strict=True), 1)},
        "x1 x2 x3 x1_dot x2_dot x3_dot v w",
        "y1 y2 y3",
    )  # fmt: skip
    report = realize(model)
    assert report.outcome is Outcome.FAIL_3
    assert "brackets" in report.detail
    with pytest.raises(RealizationError, match=r"FAIL-3.*Remedy"):
        report.require()


def test_exponential_field_is_solved_by_the_differential_equation() -> None:
    report = realize(in_plane(v, sp.exp(x1) * v))
    assert report.transformations[0].integrals.method == "ordinary differential equation"
    assert sp.simplify(report.require().definitions[0] - (x2 - sp.exp(x1))) == 0


def test_fail_4_and_fail_5_and_fail_6() -> None:
    hidden = realize(in_plane(v, v * (x1**2 + x2 + sp.exp(x1 * x2))))
    assert hidden.outcome is Outcome.FAIL_4
    u, y1, y2 = sp.symbols("u y1 y2")
    d1, d2 = sp.symbols("x1_dot x2_dot")
    turning = plant({"e1": d1 - v, "e2": d2 - u * v, "m1": y1 - x1, "m2": y2 - x2}, {"d1": (d1, x1), "d2": (d2, x2)},
                    "x1 x2 x1_dot x2_dot v", "u y1 y2")  # fmt: skip
    report = realize(turning)
    assert report.outcome is Outcome.FAIL_5
    assert "u" in report.detail
    known = realize(turning, signal_rates={u: sp.Symbol("u_rate")}).require()
    assert sp.expand(known.definitions[0] - (u * x1 - x2)) == 0 or sp.expand(known.definitions[0] + u * x1 - x2) == 0
    awkward = in_plane(v, -v + x1 * x2, m1=y1 - x1 - sp.exp(x1) * sp.sin(x2), m2=y2 - x2 - sp.exp(x2) * sp.sin(x1 * x2))
    assert realize(awkward).outcome in (Outcome.FAIL_1, Outcome.FAIL_6)


def test_a_measured_signal_in_a_field_is_read_as_the_state_it_measures() -> None:
    y1, y2, d1, d2 = sp.symbols("y1 y2 x1_dot x2_dot")
    model = plant({"e1": d1 - v, "e2": d2 + 2 * x2 * v / y1, "m1": y1 - x1, "m2": y2 - x2},
                  {"d1": (d1, x1), "d2": (d2, x2)}, "x1 x2 x1_dot x2_dot v", "y1 y2")  # fmt: skip
    report = realize(model)
    assert report.transformations[0].replaced == {y1: x1}
    assert sp.simplify(report.require().definitions[0] - x1**2 * x2) == 0


def test_a_subsystem_that_is_just_determined_has_no_output() -> None:
    model = in_plane(v, -x2 * v, m1=sp.Symbol("y1") - x1, m2=sp.Symbol("y2") - x2)
    report = realize(model, ["e1", "m1", "d1"])
    assert report.outcome is Outcome.OK_NO_OUTPUT
    with pytest.raises(RealizationError, match="over-constrained"):
        report.require()


def test_branches_follow_the_caller_and_are_reported_without_one() -> None:
    x, c = sp.symbols("x c")
    equation = [("e", x**2 - 5 * x + c)]
    large = eliminate(equation, [x], prefer=nearest_to({"x": 3.0, "c": 6.0}))
    small = eliminate(equation, [x], prefer=nearest_to({"x": 2.1, "c": 6.0}))
    assert large.values[x].subs(c, 6) == 3
    assert small.values[x].subs(c, 6) == 2
    assert eliminate(equation, [x], prefer=largest_at({"c": 6.0})).values[x].subs(c, 6) == 3
    nobody = eliminate(equation, [x]).record.branches[0]
    assert isinstance(nobody, Branch)
    assert not nobody.preferred
    with pytest.raises(ParameterError, match="prefer"):
        eliminate(equation, [x], prefer=lambda unknowns, solutions: 7)


def test_blocks_of_two_and_three_are_solved() -> None:
    x, y, z = sp.symbols("x y z")
    linear = [("a", x + y + z - 6), ("b", x - y + 2 * z - 5), ("c", 2 * x + y - z - 1)]
    assert eliminate(linear, [x, y, z]).values == {x: 1, y: 2, z: 3}
    mixed = eliminate([("a", x * y - 6), ("b", x + y - 5)], [x, y], prefer=nearest_to({"x": 2.0, "y": 3.0}))
    assert mixed.values == {x: 2, y: 3}


def test_reports_read_well() -> None:
    text = pump_report("r3").text()
    for part in ("r3", "OK", "as preferred", "not valid where one of these is negative", "J*omega - K_Q*Q_i"):
        assert part in text
    assert "NO PREFERENCE" in realize(pump.pump_part(), PUMP["r3"].split()).text()
    latex = pump_report("r2").require().latex()
    assert latex.startswith(r"\begin{aligned}")
    assert latex.count(r"\\") == 2
    assert all(one.meaning and one.remedy for one in Outcome)
