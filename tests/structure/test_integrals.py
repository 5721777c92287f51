"""Involutive closures and first integrals, against fields whose answers are known in closed form."""

import pytest
import sympy as sp

from pumplib.structure.integrals import annihilates, first_integrals, involutive_closure, lie_bracket

x1, x2, x3, x4, rho, omega, a, s = sp.symbols("x1 x2 x3 x4 rho omega a s")


def test_bracket_of_the_heisenberg_fields_is_the_third_axis() -> None:
    g, h = (1, 0, -x2 / 2), (0, 1, x1 / 2)
    assert lie_bracket(g, h, (x1, x2, x3)) == (0, 0, 1)
    assert lie_bracket(h, g, (x1, x2, x3)) == (0, 0, -1)


def test_jacobi_identity() -> None:
    states = (x1, x2, x3)
    f, g, h = (x2 * x3, x1**2, 1), (x3, x1, x2**2), (1, x1 * x2, x3)
    cyclic = [lie_bracket(p, lie_bracket(q, r, states), states) for p, q, r in ((f, g, h), (g, h, f), (h, f, g))]
    assert all(sp.expand(sum(parts)) == 0 for parts in zip(*cyclic, strict=True))


def test_closure_of_heisenberg_is_everything() -> None:
    closure = involutive_closure([(1, 0, -x2), (0, 1, x1)], (x1, x2, x3))
    assert (closure.span, closure.rank, closure.involutive) == (2, 3, False)


def test_closure_ignores_dependent_and_zero_fields() -> None:
    closure = involutive_closure([(1, x2, 0), (x1, x1 * x2, 0), (0, 0, 0)], (x1, x2, x3))
    assert (closure.rank, closure.involutive) == (1, True)
    assert involutive_closure([(0, 0)], (x1, x2)).rank == 0


def test_a_field_scaled_by_a_signal_has_the_same_integrals_but_a_turning_one_has_none() -> None:
    assert involutive_closure([(s, s * x1)], (x1, x2), [s]).rank == 1
    assert involutive_closure([(1, s)], (x1, x2), [s]).rank == 2
    assert involutive_closure([(1, s)], (x1, x2)).rank == 1  # with the signal frozen


@pytest.mark.parametrize(
    ("field", "states", "expected", "method"),
    [
        ((1, -2 * omega / rho), (rho, omega), rho**2 * omega, "monomials"),
        ((1, a), (x1, x2), a * x1 - x2, "monomials"),
        ((x2, -x1), (x1, x2), x1**2 + x2**2, "monomials"),
        ((1, sp.exp(x1)), (x1, x2), x2 - sp.exp(x1), "ordinary differential equation"),
        ((x1, a * x2), (x1, x2), x2 / x1**a, "ordinary differential equation"),
    ],
)
def test_known_integrals_in_the_plane(field: tuple, states: tuple, expected: sp.Expr, method: str) -> None:
    closure = involutive_closure([field], states)
    found = first_integrals(closure.fields, states)
    assert found.method == method
    assert found.complete
    # Any function of the expected one is as good: their gradients must be parallel.
    gradients = sp.Matrix([[sp.diff(f, x) for x in states] for f in (found.functions[0], expected)])
    assert sp.simplify(gradients.det()) == 0


def test_all_integrals_of_several_fields_are_independent_and_annihilate() -> None:
    states = (x1, x2, x3, x4)
    fields = [(1, 0, x2, 0), (0, 1, x1, 2 * x2)]
    closure = involutive_closure(fields, states)
    assert closure.involutive
    found = first_integrals(closure.fields, states)
    assert found.complete
    assert len(found.functions) == 2
    assert all(annihilates(T, fields, states) for T in found.functions)
    assert sp.Matrix([[sp.diff(T, x) for x in states] for T in found.functions]).rank() == 2


def test_trigonometric_coefficients() -> None:
    states = (x1, x2, x3)
    fields = [(0, -sp.sin(x1), sp.cos(x1))]
    found = first_integrals(involutive_closure(fields, states).fields, states)
    assert found.complete
    assert found.method == "functions"
    assert any(sp.simplify(T - (x2 * sp.cos(x1) + x3 * sp.sin(x1))) == 0 for T in found.functions)


def test_integrals_without_closed_form_are_reported_as_incomplete() -> None:
    found = first_integrals([(1, x1 * x2, x2 * sp.exp(x3))], (x1, x2, x3))
    assert not found.complete
    assert found.wanted == 2


def test_a_function_that_changes_along_the_field_is_refused() -> None:
    assert annihilates(rho**2 * omega, [(1, -2 * omega / rho)], (rho, omega))
    assert not annihilates(rho * omega, [(1, -2 * omega / rho)], (rho, omega))
    assert annihilates(sp.sin(x1) ** 2 + sp.cos(x1) ** 2 + x2, [(1, 0)], (x1, x2))
