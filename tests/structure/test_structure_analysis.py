"""Matching, decomposition, subsets, isolability: definitions, brute force, the oracle, the pump's table."""

import functools
import itertools
import operator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import structure as oracle
from pumplib.errors import ParameterError
from pumplib.structure import examples, pump
from pumplib.structure.cascade import cascade, split_model
from pumplib.structure.dm import decompose
from pumplib.structure.graph import Structure
from pumplib.structure.isolability import isolability, isolability_of, signature
from pumplib.structure.matching import is_mso, maximum_matching, over_determined, redundancy
from pumplib.structure.mso import mso_matrix, mso_sets

MODELS = oracle.published()
SMALL = [name for name in MODELS if name != "engine"]
TABLE = {  # constraints and faults of the five subsets of the pump part
    "r1": ("c2 c4 m_w m_H m_Q", "K_f K_l f_c f_d"),
    "r2": ("c1 c3 c4 m_w m_T m_H m_Q d1", "dB K_l f_c f_d"),
    "r3": ("c1 c2 c3 m_w m_T m_H d1", "dB K_f f_c f_d"),
    "r4": ("c1 c2 c3 c4 m_T m_H m_Q d1", "dB K_f K_l f_c f_d"),
    "r5": ("c1 c2 c3 c4 m_w m_T m_Q d1", "dB K_f K_l f_c f_d"),
}


@st.composite
def incidences(draw, rows=8, columns=6):
    n, m = draw(st.integers(1, rows)), draw(st.integers(1, columns))
    return np.array(draw(st.lists(st.lists(st.booleans(), min_size=m, max_size=m), min_size=n, max_size=n)))


def brute_force(s):
    """Minimal sets with more constraints than unknowns, from the definition."""
    found = []
    for size in range(1, len(s.constraints) + 1):
        for subset in itertools.combinations(range(len(s.constraints)), size):
            if any(set(one) <= set(subset) for one in found):
                continue
            mask = 0
            for k in subset:
                mask |= s.rows[k]
            if mask.bit_count() < size:
                found.append(subset)
    return {tuple(s.constraints[k] for k in subset) for subset in found}


@given(incidences())
@settings(max_examples=150, deadline=None)
def test_subsets_are_those_of_the_definition(matrix):
    s = Structure.from_matrix("s", matrix)
    found = mso_sets(s)
    assert len(set(found)) == len(found)
    assert set(found) == brute_force(s)
    assert all(is_mso(s, subset) for subset in found)
    assert {c for subset in found for c in subset} == set(over_determined(s))


@given(incidences(12, 10))
@settings(max_examples=100, deadline=None)
def test_matching_is_a_maximum_one(matrix):
    s = Structure.from_matrix("s", matrix)
    m = maximum_matching(s)
    assert len(set(m.pairs.values())) == len(m.pairs) == m.size
    assert all(x in s.unknowns_of([c]) for c, x in m.pairs.items())
    # the rank of a matrix with generic entries is the structural rank
    generic = np.where(matrix, np.random.default_rng(1).uniform(1, 2, matrix.shape), 0)
    assert np.linalg.matrix_rank(generic) == m.size


@given(incidences(12, 12))
@settings(max_examples=100, deadline=None)
def test_decomposition_is_block_triangular(matrix):
    s = Structure.from_matrix("s", matrix)
    d = decompose(s)
    blocks = [d.over, *d.square, d.under]
    rows = [c for b in blocks for c in b.constraints]
    columns = [x for b in blocks for x in b.unknowns]
    assert sorted(rows) == sorted(s.constraints)
    assert sorted(columns) == sorted(s.unknowns)
    assert all(len(b.constraints) == len(b.unknowns) for b in d.square)
    assert len(d.over.constraints) > len(d.over.unknowns) or not d.over.constraints
    assert len(d.under.constraints) < len(d.under.unknowns) or not d.under.unknowns
    before: set[str] = set()
    for block in blocks:  # each block needs only itself and those before it
        before |= set(block.unknowns)
        assert set(s.unknowns_of(block.constraints)) <= before
    assert set(d.over.constraints) == set(over_determined(s))
    assert d.redundancy == redundancy(s.sub(d.over.constraints))
    assert sorted(c for b in d.classes for c in b.constraints) == sorted(d.over.constraints)
    for b in d.classes:  # they leave together, with one unknown less than constraints
        assert len(b.unknowns) == len(b.constraints) - 1
        for c in b.constraints:
            assert set(d.over.constraints) - set(over_determined(s, [c])) == set(b.constraints)


def test_unknowns_of_a_class_never_come_from_elsewhere():
    d = decompose(pump.pump_part().structure())
    assert [set(b.constraints) for b in d.classes] == [
        {"c1", "c3", "m_T", "d1"}, {"c2"}, {"c4", "m_Q"}, {"m_w"}, {"m_H"},
    ]  # fmt: skip
    assert d.square == ()
    assert d.redundancy == 2


def test_square_blocks_are_solved_in_order():
    s = Structure.from_sets("s", {"e1": ["a", "b", "c"], "e2": ["b", "c"], "e3": ["c", "b"], "e4": ["a", "d"]})
    d = decompose(s)
    assert [set(b.unknowns) for b in d.square] == [{"b", "c"}, {"a"}, {"d"}]
    assert decompose(Structure.from_sets("s", {"e": ["a", "b"]})).under.unknowns == ("a", "b")


@pytest.mark.parametrize("name", SMALL)
def test_subsets_equal_the_oracle(name):
    incidence = MODELS[name].incidence().toarray()
    assert oracle.differing(incidence, mso_matrix(MODELS[name])) == 0


def test_shipped_models_equal_ours():
    """The incidence that the oracle builds from its own definitions is that of our definitions, up to the order."""
    names = {
        "three_tank": examples.three_tanks(),
        "electric_motor": examples.dc_motor(),
        "induction_motor": examples.induction_motor(),
    }
    for name, theirs in oracle.shipped().items():
        s = names[name].structure()
        order = s.index(sorted(s.constraints, key=lambda c: int(c[1:])))
        mine = s.incidence().toarray()[list(order)] != 0
        assert sorted(map(tuple, mine.T.tolist())) == sorted(map(tuple, theirs.T.tolist()))
        assert oracle.differing(theirs, mso_matrix(Structure.from_matrix(name, theirs))) == 0


def test_engine_equals_the_oracle():
    found = mso_matrix(MODELS["engine"])
    assert len(found) == oracle.ENGINE_SUBSETS
    assert oracle.differing(MODELS["engine"].incidence().toarray(), found) == 0


def test_random_systems_equal_the_oracle():
    largest = 0
    for structure, found in oracle.random_systems(7, count=6):
        assert oracle.differing(structure.incidence().toarray(), found) == 0
        largest = max(largest, len(found))
    assert largest >= oracle.LARGE


@pytest.mark.parametrize("name", ["engine", "three tanks", "DC motor", "induction motor, published signs"])
def test_isolability_equals_the_oracle(name):
    s = MODELS[name]
    mine = isolability(s)
    theirs = oracle.oracle_model(s.incidence().toarray())
    theirs.F, theirs.f = s.fault_incidence().toarray().astype(int), list(s.faults)
    expected = np.asarray(theirs.IsolabilityAnalysis()) == 0
    np.testing.assert_array_equal(mine.isolable | np.eye(len(s.faults), dtype=bool) & ~mine.detectable, expected)


@pytest.mark.parametrize("name", ["pump part", "three tanks", "DC motor", "pump with motor", "engine"])
def test_isolability_is_reached_by_all_subsets(name):
    s = MODELS[name]
    best, all_of_them = isolability(s), isolability_of(s, mso_sets(s))
    np.testing.assert_array_equal(best.isolable, all_of_them.isolable)
    np.testing.assert_array_equal(best.detectable, all_of_them.detectable)


def test_pump_part_has_the_five_subsets_of_the_table():
    s = pump.pump_part().structure()
    found = {frozenset(subset): set(s.faults_of(subset)) for subset in mso_sets(s)}
    assert found == {frozenset(c.split()): set(f.split()) for c, f in TABLE.values()}


def test_number_of_subsets_in_three_readings():
    assert pump.mso_counts() == (5, 4, 6)
    # head map and loss both in the delivered flow: five again, and every subset with the torque reacts to leakage
    both, loss = (pump.pump_part(head_flow=q, loss_flow="Q_p").structure() for q in ("Q_p", "Q_i"))
    assert len(mso_sets(both)) == 5
    assert all("K_l" in both.faults_of(subset) for subset in mso_sets(both) if "m_T" in subset)
    # the loss alone: the one that is blind to leakage needs the measured flow, which r3 does without
    blind = [set(x) for x in mso_sets(loss) if "m_T" in x and "K_l" not in loss.faults_of(x)]
    assert blind == [{*TABLE["r3"][0].split(), "m_Q"}]
    # the acceleration of the liquid adds an unknown and a constraint, and no redundancy
    more = pump.pump_part(flow_acceleration=True).structure()
    assert {frozenset(x) - {"d2"} for x in mso_sets(more)} == {frozenset(c.split()) for c, _ in TABLE.values()}


def test_three_residuals_isolate_as_well_as_all():
    s = pump.pump_part().structure()
    three = [TABLE[name][0].split() for name in ("r1", "r2", "r3")]
    np.testing.assert_array_equal(signature(s, three), [[1, 1, 0, 1, 1], [0, 1, 1, 1, 1], [1, 0, 1, 1, 1]])
    best = isolability(s)
    np.testing.assert_array_equal(isolability_of(s, three).isolable, best.isolable)
    assert best.detectable.all()
    assert best.confused == {
        "K_f": ("f_c", "f_d"), "K_l": ("f_c", "f_d"), "dB": ("f_c", "f_d"), "f_c": ("f_d",), "f_d": ("f_c",),
    }  # fmt: skip


@pytest.mark.parametrize(
    "model", [pump.pump_with_motor(), pump.pump_with_motor(flow_acceleration=True), pump.steady_state()]
)
def test_cascade_is_found(model):
    s = model.structure()
    split = cascade(s)
    assert split.shared == ("omega", "T_e")
    assert split.redundancy == (1, 2)
    assert s.faults_of(split.upstream) == ()
    assert set(split.downstream) >= {"c1", "c2", "c3", "c4", "m_H", "m_Q"}
    assert sorted((*split.upstream, *split.downstream)) == sorted(s.constraints)
    # downstream alone has nothing to test: it needs the shared variables
    assert redundancy(s.sub(split.downstream)) == 0
    upstream, downstream = split_model(model, split, measured=pump.MEASURED)
    assert len(mso_sets(upstream.structure())) == 1
    steady = not model.states
    found = {frozenset(x) - {"d2"} for x in mso_sets(downstream.structure())}
    assert found == {frozenset(c.split()) - ({"d1"} if steady else set()) for c, _ in TABLE.values()}
    if model.states and pump.Q_i_dot not in model.unknown:
        assert {c.name: c.relation for c in downstream.constraints} == {
            c.name: c.relation for c in pump.pump_part().constraints
        }


def splits_exist(s):
    """Whether some part with redundancy, closed under what it determines, leaves redundancy and shares an unknown."""
    n, total = len(s.constraints), redundancy(s)
    for part in range(1, 1 << n):
        inside = [k for k in range(n) if part >> k & 1]
        outside = [k for k in range(n) if not part >> k & 1]
        columns = functools.reduce(operator.or_, (s.rows[k] for k in inside))
        closed = all(s.rows[k] & ~columns for k in outside)
        if closed and 0 < len(inside) - columns.bit_count() < total and any(s.rows[k] & columns for k in outside):
            names = [s.constraints[k] for k in inside]
            if len(over_determined(s.sub(names))) == len(names):
                return True
    return False


@given(incidences(9, 7))
@settings(max_examples=200, deadline=None)
def test_split_shares_out_the_redundancy(matrix):
    s = Structure.from_matrix("s", matrix)
    if redundancy(s) < 2:
        with pytest.raises(ParameterError, match="no split"):
            cascade(s)
        return
    try:
        split = cascade(s)
    except ParameterError:
        assert not splits_exist(s)
        return
    assert sum(split.redundancy) == redundancy(s)
    assert min(split.redundancy) >= 1
    assert set(split.shared) <= set(s.unknowns_of(split.upstream)) & set(s.unknowns_of(split.downstream))
    assert set(s.unknowns_of(split.upstream)) & set(s.unknowns_of(split.downstream)) <= set(split.shared)


def test_cascade_of_two_tanks_without_pump():
    """Nothing in the search knows of pumps: a driven shaft whose speed goes into a heater."""
    s = Structure.from_sets(
        "shaft and heater",
        {
            "shaft": ["w_dot", "w"], "d_w": ["w_dot", "w"], "m_1": ["w"],
            "heat": ["w", "h_dot", "h", "q"], "d_h": ["h_dot", "h"], "m_2": ["h"], "m_3": ["q"],
        },
        faults={"heat": ["f"]},
    )  # fmt: skip
    split = cascade(s)
    assert split.upstream == ("shaft", "d_w", "m_1")
    assert split.shared == ("w",)


def test_refusals():
    with pytest.raises(ParameterError, match="limit = 100"):
        mso_matrix(MODELS["engine"], limit=100)
    with pytest.raises(ParameterError, match="limit = 0"):
        mso_matrix(MODELS["satellite, unknown velocity"], limit=0)
    with pytest.raises(ParameterError, match="no split"):
        cascade(MODELS["satellite, unknown velocity"])
    with pytest.raises(ParameterError, match="no split"):
        cascade(examples.pendulum().structure())
    with pytest.raises(ParameterError, match="no fault"):
        signature(examples.pendulum().structure(), [["e1"]])
    model = pump.pump_with_motor()
    split = cascade(model.structure())
    with pytest.raises(ParameterError, match="y_Q or m_Q is taken"):
        split_model(model, split, measured={"omega": "Q"})


def test_many_subsets_come_in_a_fixed_order():
    found = mso_matrix(MODELS["engine"], limit=oracle.ENGINE_SUBSETS)
    sizes = found.sum(axis=1)
    assert (np.diff(sizes) >= 0).all()
    same = np.flatnonzero(np.diff(sizes) == 0)
    first = (found[same] != found[same + 1]).argmax(axis=1)  # where two of a size differ first, the earlier one has it
    assert found[same, first].all()
