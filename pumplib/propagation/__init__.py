"""Thesis 4.1.1, 4.2, 4.3.4, 4.3.5, 4.4.1: fault propagation, robustness, choice of sensors, decision logic."""

from pumplib.propagation.build import Effects, EventMatrices, event_matrices, propagate
from pumplib.propagation.decision import SYMBOLS, UNKNOWN, DecisionTable, Verdict, compile_table
from pumplib.propagation.gates import gate_closure
from pumplib.propagation.graph import dfs_cut, minimum_cut, pack, strong_components, unpack
from pumplib.propagation.logic import Decision, DecisionLogic, DecisionRecord, LogicSettings
from pumplib.propagation.loops import Passes, component_cut, cut_closure, plain_closure, reach, scc_closure
from pumplib.propagation.sensors import (
    Demands,
    cheapest,
    cost,
    demands,
    minimal_sets,
    minimal_sets_milp,
    reached,
    sensor_table,
    suffices,
    tolerated,
)
from pumplib.propagation.simple import simple_sign_reach
from pumplib.propagation.symbols import observable, separating
from pumplib.propagation.theorems import (
    decodable,
    detectable,
    disjunct,
    groups_isolable,
    isolable,
    private_rows,
    signatures,
    touched,
)

__all__ = [
    "SYMBOLS",
    "UNKNOWN",
    "Decision",
    "DecisionLogic",
    "DecisionRecord",
    "DecisionTable",
    "Demands",
    "Effects",
    "EventMatrices",
    "LogicSettings",
    "Passes",
    "Verdict",
    "cheapest",
    "compile_table",
    "component_cut",
    "cost",
    "cut_closure",
    "decodable",
    "demands",
    "detectable",
    "dfs_cut",
    "disjunct",
    "event_matrices",
    "gate_closure",
    "groups_isolable",
    "isolable",
    "minimal_sets",
    "minimal_sets_milp",
    "minimum_cut",
    "observable",
    "pack",
    "plain_closure",
    "private_rows",
    "propagate",
    "reach",
    "reached",
    "scc_closure",
    "sensor_table",
    "separating",
    "signatures",
    "simple_sign_reach",
    "strong_components",
    "suffices",
    "tolerated",
    "touched",
    "unpack",
]
