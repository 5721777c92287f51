"""Thesis 4.2.2: theorems on hand-made systems; brute force is in pumplib.propagation.verify."""

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.propagation import (
    decodable,
    detectable,
    disjunct,
    groups_isolable,
    isolable,
    observable,
    private_rows,
    separating,
    signatures,
    touched,
    verify,
)
from pumplib.propagation.symbols import ANY, BOTH, DOWN, MINUS, PLUS, UP, ZERO


def columns(*texts):
    """Matrix from columns, "110" raises the first two end-effects."""
    return np.array([[c == "1" for c in text] for text in texts]).T


def test_brute_force_agrees():
    found = verify.count_theorem_mismatches(np.random.default_rng(11), 400)
    assert found.wrong == dict.fromkeys(found.wrong, 0)
    assert found.mismatches == 0
    assert found.systems == 400
    assert min(found.compared.values()) >= 400


def test_loops_agree():
    found = verify.count_loop_mismatches(np.random.default_rng(12), 1000)
    assert found.mismatches == 0
    assert set(found.compared.values()) == {1000}


def test_comparison_notices_a_wrong_function(monkeypatch):
    # leaving the cuts open, and calling a fault detectable that any single disturbing event hides, must be noticed
    true = verify.cut_closure
    monkeypatch.setattr(verify, "cut_closure", lambda *a, **k: true(*a, **k, inject=False))
    assert verify.count_loop_mismatches(np.random.default_rng(1), 30).mismatches > 0
    monkeypatch.setattr(verify, "detectable", lambda f, d, facets=None: np.any(f, axis=0))
    monkeypatch.setattr(verify, "isolable", lambda f, d, facets=None: ~np.eye(np.shape(f)[1], dtype=bool))
    monkeypatch.setattr(verify, "separating", lambda must, may, hits: separating(may, may, hits))
    wrong = verify.count_theorem_mismatches(np.random.default_rng(1), 30).wrong
    assert wrong["Theorem 2, detectable"] > 0
    assert wrong["Theorem 3, isolable, facets"] > 0
    assert wrong["Theorem 4, pairs"] > 0


def test_two_events_that_hide_a_fault_only_together():
    a_f, a_d = columns("11"), columns("10", "01")
    assert not detectable(a_f, a_d)[0]
    assert detectable(a_f, a_d, [[True, False], [False, True]])[0]
    assert touched(a_d, [[1, 0], [0, 1]]).tolist() == [[True, False], [False, True]]


def test_same_disturbing_event_on_both_sides_is_not_enough():
    # a = e1, b = e2, and two events that never come together: equal d always tells, d differing does not
    a_f, a_d, facets = columns("10", "01"), columns("01", "10"), [[1, 0], [0, 1]]
    for d in ([0, 0], [1, 0], [0, 1]):
        e = a_f | (a_d & np.array(d, bool)).any(axis=1)[:, None]
        assert (e[:, 0] != e[:, 1]).any()
    assert not isolable(a_f, a_d, facets)[0, 1]


def test_signatures_and_groups():
    a_f, a_d = columns("1100", "1110", "0001", "0011"), columns("0010")
    assert signatures(a_f, a_d).tolist() == [0, 0, 1, 1]
    names, apart = groups_isolable(a_f, a_d, ["a", "a", "b", "b"])
    assert names == ["a", "b"]
    assert apart.tolist() == [[False, True], [True, False]]
    assert not groups_isolable(a_f, a_d, ["a", "b", "b", "b"])[1].any()
    assert signatures(columns("0010"), a_d).tolist() == [-1]


def test_several_faults_at_once():
    a_f, none = columns("100", "010", "110"), np.zeros((3, 0), bool)
    assert private_rows(a_f, none).tolist() == [False, False, False]
    assert private_rows(columns("100", "011", "010"), none).tolist() == [True, True, False]
    assert decodable(columns("100", "011", "010"), none, ["a", "b", "b"])[1].tolist() == [True, True]
    assert disjunct(columns("100", "010", "001"), none, 2)
    assert not disjunct(a_f, none, 1)
    assert not disjunct(columns("110", "100", "010"), none, 2)


def test_ten_thousand_faults_are_classed_quickly():
    import time

    rng = np.random.default_rng(3)
    a_f, a_d = rng.random((200, 10_000)) < 0.1, rng.random((200, 30)) < 0.01
    signatures(a_f, a_d)
    start = time.perf_counter()
    number = signatures(a_f, a_d)
    assert time.perf_counter() - start < 1.0  # a search over pairs would take minutes
    assert number.max() > 9_900


def test_symbols_of_pulls():
    assert observable(0, 0) == ZERO
    assert observable(UP, UP) == PLUS
    assert observable(0, DOWN) == ZERO | MINUS
    assert observable(BOTH, BOTH) == ANY
    assert observable(UP, BOTH) == ANY  # the pull downwards may cancel
    assert observable(UP, UP, DOWN) == ANY
    assert observable(UP, UP, UP) == PLUS
    assert observable(0, 0, UP) == ZERO | PLUS


def test_a_row_that_a_disturbance_can_cancel_is_not_clean():
    # Boolean rows: x+ is raised by the fault and x- by the disturbance, so Theorem 2 calls the fault detectable
    assert detectable(columns("10"), columns("01"))[0]
    assert not separating([[UP]], [[UP]], [DOWN])[1].any()


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: detectable([[2]], [[0]]), "A_f: has entries other"),
        (lambda: detectable([1], [[0]]), "A_f: has the shape"),
        (lambda: detectable([[1]], [[0], [1]]), "A_d: has the shape"),
        (lambda: detectable([[1]], [[0]], [[1, 0]]), "facets: has the shape"),
        (lambda: detectable([[1]], [[0]], np.zeros((0, 1), bool)), "facets: none is given"),
        (lambda: groups_isolable([[1]], [[0]], ["a", "b"]), "groups has 2 entries"),
        (lambda: disjunct([[1]], [[0]], 0), "k = 0"),
        (lambda: observable(1, 2), "must: has a pull that is not in may"),
        (lambda: observable(1, 4), "may: pulls are"),
        (lambda: observable(0.5, 1), "must: pulls are"),
        (lambda: separating([[1]], [[1]], [0, 0]), "needs"),
    ],
)
def test_wrong_input_is_refused(call, text):
    with pytest.raises(ParameterError, match=text):
        call()
