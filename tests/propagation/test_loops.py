"""Thesis 4.2.1: ways to close loops against dense matrices, networkx and forward chaining; Theorem 1."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.errors import ParameterError
from pumplib.propagation import (
    component_cut,
    cut_closure,
    dfs_cut,
    gate_closure,
    minimum_cut,
    pack,
    plain_closure,
    reach,
    scc_closure,
    simple_sign_reach,
    strong_components,
    unpack,
)


@st.composite
def graphs(draw, most=14):
    n = draw(st.integers(1, most))
    pairs = draw(st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)), max_size=3 * n))
    a, b = np.array(pairs, int).reshape(-1, 2).T
    return n, a, b, np.random.default_rng(draw(st.integers(0, 2**32)))


def star(n, a, b):
    """Reflexive transitive closure by dense products; row: reached."""
    matrix = np.eye(n, dtype=int)
    matrix[b, a] = 1
    for _ in range(n):
        matrix = np.minimum(matrix @ matrix, 1)
    return matrix.astype(bool)


def seeds_of(n, rng, r):
    return pack(rng.integers(0, n, 2 * r), rng.integers(0, r, 2 * r), n, r)


@given(graphs())
@effort(max_examples=150, deadline=None)
def test_every_way_gives_the_least_solution(graph):
    n, a, b, rng = graph
    r = int(rng.integers(1, 130))
    seeds = seeds_of(n, rng, r)
    before = seeds.copy()
    true = star(n, a, b).astype(int) @ unpack(seeds, r).astype(int) > 0
    component = rng.integers(0, max(1, n // 3), n)
    rank = rng.permutation(n)
    ways = [
        plain_closure(n, a, b, seeds).bits,
        scc_closure(n, a, b, seeds),
        cut_closure(n, a, b, seeds).bits,
        cut_closure(n, a, b, seeds, component=component).bits,
        cut_closure(n, a, b, seeds, cut=rank[a] >= rank[b]).bits,
        cut_closure(n, a, b, seeds, cut=np.ones(len(a), bool)).bits,
    ]
    for bits in ways:
        np.testing.assert_array_equal(unpack(bits, r), true)
    np.testing.assert_array_equal(seeds, before)  # inputs are left alone


@given(graphs(), st.integers(0, 5), st.integers(1, 140))
@effort(max_examples=80, deadline=None)
def test_reach_is_the_same_from_both_sides(graph, share, r):
    n, a, b, rng = graph
    ends = np.flatnonzero(rng.random(n) < share / 5)
    event, root = rng.integers(0, n, r), rng.integers(0, r, r)
    true = (star(n, a, b).astype(int) @ unpack(pack(event, root, n, r), r).astype(int) > 0)[ends]
    np.testing.assert_array_equal(reach(n, a, b, event, root, r, ends), true)


@given(graphs())
@effort(max_examples=100, deadline=None)
def test_components_and_cuts_agree_with_networkx(graph):
    n, a, b, rng = graph
    pairs = list(zip(a.tolist(), b.tolist(), strict=True))
    peer = nx.DiGraph()
    peer.add_nodes_from(range(n))
    peer.add_edges_from(pairs)
    count, label = strong_components(n, a, b)
    parts = {frozenset(np.flatnonzero(label == k).tolist()) for k in range(count)}
    assert parts == {frozenset(one) for one in nx.strongly_connected_components(peer)}
    assert (label[a] <= label[b]).all()  # numbered along the edges
    cut = dfs_cut(n, a, b, rng.permutation(n))
    left = nx.DiGraph([pair for pair, gone in zip(pairs, cut, strict=True) if not gone])
    assert nx.is_directed_acyclic_graph(left)
    if nx.is_directed_acyclic_graph(peer):
        assert not cut.any()


@given(graphs(6))
@effort(max_examples=60, deadline=None)
def test_minimum_cut_is_the_smallest(graph):
    from itertools import combinations

    n, a, b, _ = graph
    adjacency = np.zeros((n, n), bool)
    adjacency[a, b] = True
    np.fill_diagonal(adjacency, False)
    edges = [(int(i), int(j)) for i, j in np.argwhere(adjacency)]
    found = minimum_cut(adjacency)
    assert set(found) <= set(edges)
    assert nx.is_directed_acyclic_graph(nx.DiGraph([e for e in edges if e not in found]))
    if found:  # no smaller set will do
        fewer = combinations(edges, len(found) - 1)
        assert not any(nx.is_directed_acyclic_graph(nx.DiGraph([e for e in edges if e not in some])) for some in fewer)


def chained(n, a, b, gate, start):
    """Forward chaining with counters, one case: an AND event fires when its last edge has fired."""
    waiting = np.bincount(b, minlength=n)
    up, agenda = set(), list(start)
    while agenda:
        event = agenda.pop()
        if event in up:
            continue
        up.add(event)
        for k in np.flatnonzero(a == event):
            waiting[b[k]] -= 1
            if not gate[b[k]] or waiting[b[k]] == 0:
                agenda.append(int(b[k]))
    return up


@given(graphs())
@effort(max_examples=150, deadline=None)
def test_gates_agree_with_forward_chaining_for_any_cut(graph):
    n, a, b, rng = graph
    gate = (rng.random(n) < 0.5) & (np.bincount(b, minlength=n) > 0)
    r = int(rng.integers(1, 70))
    seeds = seeds_of(n, rng, r)
    given_bits = unpack(seeds, r)
    true = np.zeros((n, r), bool)
    for case in range(r):
        true[list(chained(n, a, b, gate, np.flatnonzero(given_bits[:, case]).tolist())), case] = True
    rank = rng.permutation(n)
    for cut in (None, rank[a] >= rank[b], np.ones(len(a), bool)):
        found = gate_closure(n, a, b, gate, seeds, cut=cut)
        np.testing.assert_array_equal(unpack(found.bits, r), true)
        # one pass a copied value that rises, and one that finds nothing new
        assert found.passes <= len(set(a[found.cut].tolist())) * r + 2


def test_gates_are_more_than_the_sum_of_their_roots():
    a, b, gate = [0, 1], [2, 2], [False, False, True]
    one_by_one = gate_closure(3, a, b, gate, pack([0, 1], [0, 1], 3, 2))
    assert not unpack(one_by_one.bits, 2)[2].any()
    assert unpack(gate_closure(3, a, b, gate, pack([0, 1], [0, 0], 3, 1)).bits, 1)[2, 0]


def test_a_loop_without_root_stays_down():
    bits = scc_closure(4, [0, 1, 2], [1, 0, 3], pack([2], [0], 4, 1))
    assert unpack(bits, 1)[:, 0].tolist() == [False, False, True, True]
    gates = gate_closure(2, [0, 1], [1, 0], [True, True], pack([], [], 2, 1))
    assert not gates.bits.any()


@given(graphs())
@effort(max_examples=100, deadline=None)
def test_passes_are_bounded_by_the_cuts_on_the_way(graph):
    n, a, b, rng = graph
    rank = rng.permutation(n)
    cut = rank[a] >= rank[b]
    r = min(n, 64)
    found = cut_closure(n, a, b, pack(np.arange(r), np.arange(r), n, r), cut=cut)
    peer = nx.DiGraph()
    peer.add_nodes_from(range(n))
    for cause, effect, gone in zip(a.tolist(), b.tolist(), cut.tolist(), strict=True):
        old = peer.get_edge_data(cause, effect, {"weight": 1})["weight"]
        peer.add_edge(cause, effect, weight=min(old, int(gone)))
    most = max(max(nx.single_source_dijkstra_path_length(peer, root).values()) for root in range(r))
    assert found.passes <= most + 1 <= len(set(b[cut].tolist())) + 1


def test_one_cut_event_needs_one_injection():
    # a ring: cutting at one event and carrying over once is enough, not carrying over loses effects
    n = 6
    a, b = np.arange(n), (np.arange(n) + 1) % n
    seeds = pack(np.arange(n), np.arange(n), n, n)
    assert cut_closure(n, a, b, seeds).passes == 2
    assert unpack(cut_closure(n, a, b, seeds).bits, n).all()
    assert unpack(cut_closure(n, a, b, seeds, inject=False).bits, n).sum() == n * (n + 1) // 2


def test_components_keep_their_own_loops():
    # 0 and 1 form a loop inside a component, nothing has to be cut
    found = cut_closure(3, [0, 1, 1], [1, 0, 2], pack([0], [0], 3, 1), component=[0, 0, 1])
    assert not found.cut.any()
    assert unpack(found.bits, 1).all()
    assert component_cut(3, [0, 1, 1, 2], [1, 0, 2, 0], [0, 0, 1]).tolist() in (
        [False] * 3 + [True],
        [False, False, True, False],
    )


def test_simple_paths_have_no_self_reversal():
    # w+ -> T- -> w- is a negative loop: the closure predicts w- from w+, simple paths do not
    cause, effect, quantity = [0, 1, 2, 3], [1, 2, 3, 0], [0, 1, 0, 1]  # w+, T-, w-, T+
    assert unpack(scc_closure(4, cause, effect, pack([0], [0], 4, 1)), 1).all()
    assert simple_sign_reach(4, cause, effect, quantity)[:, 0].tolist() == [True, True, False, False]


@given(graphs(8))
@effort(max_examples=60, deadline=None)
def test_simple_paths_agree_with_networkx(graph):
    n, a, b, rng = graph
    quantity = rng.integers(0, n, n)
    peer = nx.DiGraph()
    peer.add_nodes_from(range(n))
    peer.add_edges_from(zip(a.tolist(), b.tolist(), strict=True))
    found = simple_sign_reach(n, a, b, quantity)
    for start in range(n):
        for end in range(n):
            paths = nx.all_simple_paths(peer, start, end) if start != end else [[start]]
            assert found[end, start] == any(len(set(quantity[path])) == len(path) for path in paths)


def test_long_chain_needs_no_recursion():
    n = 50_000
    bits = scc_closure(n, np.arange(n - 1), np.arange(1, n), pack([0, 7], [0, 1], n, 2))
    assert unpack(bits, 2).sum(axis=0).tolist() == [n, n - 7]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: scc_closure(2, [0], [2], pack([0], [0], 2, 1)), "effect = 2: must be 0 to 1"),
        (lambda: scc_closure(2, [-1], [1], pack([0], [0], 2, 1)), "cause = -1"),
        (lambda: scc_closure(2, [0], [1, 1], pack([0], [0], 2, 1)), "one pair an edge"),
        (lambda: scc_closure(2, [0.0], [1.0], pack([0], [0], 2, 1)), "whole numbers"),
        (lambda: scc_closure(2, [0], [1], np.zeros((2, 1))), "needs uint64"),
        (lambda: scc_closure(2, [0], [1], pack([0], [0], 3, 1)), "2 rows"),
        (lambda: scc_closure(0, [], [], pack([0], [0], 1, 1)), "at least one"),
        (lambda: pack([0], [1], 2, 1), "seed root = 1"),
        (lambda: pack([0, 1], [0], 2, 1), "one pair a seed"),
        (lambda: pack([0], [0], 2, 0), "roots = 0"),
        (lambda: cut_closure(2, [0, 1], [1, 0], pack([0], [0], 2, 1), cut=[False, False]), "a loop is left"),
        (lambda: cut_closure(2, [0, 1], [1, 0], pack([0], [0], 2, 1), cut=[False]), "cut: has the shape"),
        (lambda: cut_closure(2, [0], [1], pack([0], [0], 2, 1), component=[0]), "component has 1"),
        (lambda: cut_closure(2, [0], [1], pack([0], [0], 2, 1), cut=[2]), "other than 0 and 1"),
        (lambda: gate_closure(2, [0], [1], [True, False], pack([0], [0], 2, 1)), "all of no causes"),
        (lambda: gate_closure(1, [0], [0], [False], pack([0], [0], 1, 1), cut=[False]), "a loop is left"),
        (lambda: dfs_cut(2, [0], [1], [0, 0]), "each of the 2"),
        (lambda: minimum_cut(np.zeros((21, 21), bool)), "at most 20"),
        (lambda: simple_sign_reach(2, [0], [1], [0]), "quantity has 1"),
        (lambda: simple_sign_reach(3, [0, 1], [1, 2], [0, 1, 2], limit=1), "more than 1 steps"),
    ],
)
def test_wrong_input_is_refused(call, text):
    with pytest.raises(ParameterError, match=text):
        call()
