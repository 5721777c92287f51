"""Thesis 4.4.1: the decision table on random cases, and the decision over time."""

import itertools

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.fmea.load import shipped
from pumplib.propagation import UNKNOWN, DecisionLogic, LogicSettings, Verdict, compile_table, propagate, verify
from pumplib.propagation.symbols import separating

SEVEN = tuple(f"G{k}" for k in range(1, 8))
FOUR = ("I", "V", "Q", "dp")


@pytest.fixture(scope="module")
def effects():
    pump = shipped("pump")
    return propagate(pump).narrow(disturbances=pump.scenario("D_B").disturbances)


@pytest.fixture(scope="module")
def table(effects):
    return compile_table(effects, FOUR, SEVEN)


def test_compiled_table(table):
    columns = ("yZn", "ymc", "yLT", "yrT", "yrH", "yrTH")
    found = {group: "".join(table.symbols(group, c) for c in columns) for group in (None, *SEVEN)}
    assert found == {
        None: "000000", "G1": "+00*0*", "G2": "0+0+0+", "G3": "0000--", "G4": "000+-0",
        "G5": "000---", "G6": "00+---", "G7": "000000",
    }  # fmt: skip
    assert table.covered == SEVEN[:6]
    assert not {"yI", "yP", "yw", "yQ", "ydp"} & set(table.informative)


@pytest.mark.parametrize("sensors", [FOUR, (*FOUR, "pin")])
@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_sound_and_complete_on_random_cases(effects, sensors, missing):
    table = compile_table(effects, sensors, SEVEN)
    found = verify.count_decision_losses(np.random.default_rng(5), table, 100_000, missing)
    assert found["cases"] == 100_000
    assert found["truth_lost"] == found["missed"] == found["not_isolated"] == found["alarms_without_fault"] == 0
    assert found["covered_faults"] > 80_000
    if not missing:
        assert found["isolated"] == found["covered_faults"]


def test_lost_truth_is_noticed(effects):
    # a table that believes in less disturbance than there is
    table = compile_table(effects, FOUR, SEVEN)
    wrong = compile_table(effects.narrow(disturbances=[]), FOUR, SEVEN)
    cases = list(verify.random_observations(np.random.default_rng(1), table, 2000))
    truth, symbols = cases[0]
    fits, free = wrong.fits(symbols)
    assert not fits[truth >= 0, truth[truth >= 0]].all()
    assert not free[truth < 0].all()


def test_random_cases_are_what_brute_force_sees():
    # small table: every observation that is drawn is possible, and every possible one is drawn
    pump = shipped("pump")
    effects = propagate(pump).narrow(disturbances=["d_unb", "d_load+"], signals=["yhf", "yrT", "yZn"])
    table = compile_table(effects, FOUR, ("G1", "G5"))
    drawn: dict[int, set] = {}
    for truth, symbols in verify.random_observations(np.random.default_rng(2), table, 40_000):
        for k in np.unique(truth):
            drawn.setdefault(int(k), set()).update(map(tuple, symbols[truth == k].tolist()))
    chosen = effects.narrow(signals=table.signals, faults=table.faults)
    for k in range(len(table.faults)):
        assert drawn[k] == verify._observations(table.must[:, k], table.may[:, k], chosen.hits)


def test_every_kind_of_verdict(table):
    quiet = dict.fromkeys(table.signals, "0")

    def verdict(**symbols):
        return table.decide([table.pattern(quiet | symbols)])[0]

    assert verdict() == Verdict(status="fault free")
    assert verdict(yQ="-", yI="+", yw="-") == Verdict(status="fault free")  # only the load
    assert str(verdict(yrH="-", yrTH="-")) == "isolated: G3"
    assert verdict(yrH="-").status == "inconsistent"  # strict: leakage would have raised yrT
    assert str(verdict(yZn="+", ymc="+", yrT="+", yrTH="+")) == "multiple: G1+G2"
    assert verdict(yst="+").status == "inconsistent"
    assert table.decide([table.pattern({"yZn": "0"})])[0].status == "no alarm"
    unknown = table.decide([table.pattern({"yrH": "-"})])[0]
    assert str(unknown) == "ambiguous: G3 or G4 or G5 or G6"
    assert unknown.alarm
    assert not unknown.certain("G3")
    assert verdict(yZn="+", ymc="+", yrT="+", yrTH="+").certain("G2")
    assert not verdict().certain("G1")


def test_the_smallest_sets_explain_several_faults(effects):
    table = compile_table(effects, (*FOUR, "pin"), SEVEN)
    groups = {name: table.groups.index(name) for name in table.names}
    rng = np.random.default_rng(8)
    apart = np.any(separating(table.must, table.may, table.hit)[0], axis=0)
    assert apart.any()
    for _ in range(300):
        names = rng.choice(SEVEN, 2, replace=False)
        must = np.bitwise_or.reduce(table.must[:, [groups[n] for n in names]], axis=1)
        row = np.array([0, 1, -1, rng.integers(-1, 2)], np.int8)[must]
        (verdict,) = table.decide(row[None, :])
        # truth explains it; a single group is preferred where one does, too
        ordered = tuple(sorted(names))
        assert verdict.status in ("multiple", "isolated", "ambiguous")
        if verdict.status == "multiple":
            assert ordered in verdict.candidates


def rows(table, *changes):
    quiet = dict.fromkeys(table.signals, 0)
    return np.array([table.pattern(quiet | change) for change in changes])


def test_phasors_can_cancel(table, effects):
    # the unbalance of the supply and a shorted winding drive negative-sequence currents of any angle
    assert table.symbols("G1", "yIn") == table.symbols(None, "yIn") == "*"
    quiet = dict.fromkeys(table.signals, "0")
    assert str(table.decide([table.pattern(quiet | {"yZn": "+"})])[0]) == "isolated: G1"
    balanced = compile_table(effects.narrow(disturbances=["d_load+"]), FOUR, SEVEN)
    assert balanced.symbols("G1", "yIn") == "+"


def test_hold_time(table):
    logic = DecisionLogic(table, LogicSettings(hold=2.0))
    clog = {"yrH": "-", "yrTH": "-"}
    record = logic.run(np.arange(6.0), rows(table, {}, {}, clog, clog, clog, {}))
    assert [str(record[k].verdict) for k in (1, 2, 5)] == ["fault free", "isolated: G3", "fault free"]
    assert [str(record[k].acted) for k in range(6)] == ["fault free"] * 4 + ["isolated: G3"] * 2
    first = record.first_alarm()
    assert first is not None
    assert first.t == 4.0
    assert DecisionLogic(table).run([0.0], rows(table, {})).first_alarm() is None


def test_young_alarms_make_silence_unknown(table):
    slow = [{"yrH": "-"}, {"yrH": "-"}, {"yrH": "-", "yrTH": "-"}, {"yrH": "-", "yrTH": "-"}, {"yrH": "-", "yrTH": "-"}]
    strict = DecisionLogic(table).run(np.arange(5.0), rows(table, *slow))
    assert strict[0].verdict.status == "inconsistent"
    patient = DecisionLogic(table, LogicSettings(settle=1.5)).run(np.arange(5.0), rows(table, *slow))
    assert [str(patient[k].verdict) for k in range(5)] == [
        "ambiguous: G3 or G4 or G5 or G6", "ambiguous: G3 or G4 or G5 or G6",  # yrTH is silent, yet unknown
        "ambiguous: G3 or G5 or G6", "ambiguous: G3 or G5 or G6", "isolated: G3",
    ]  # fmt: skip


def test_a_gap_does_not_make_an_alarm_young_again(table):
    logic = DecisionLogic(table, LogicSettings(settle=1.5))
    clog = {"yrH": "-", "yrTH": "-"}
    found = logic.run(np.arange(4.0), rows(table, clog, clog, {"yrH": UNKNOWN, "yrTH": "-"}, clog))
    assert str(found[3].verdict) == "isolated: G3"
    again = logic.run([4.0, 5.0], rows(table, {}, clog))  # it went and came back: young
    assert again[1].verdict.status == "ambiguous"


def test_dry_running_is_latched_at_once(table):
    logic = DecisionLogic(table, LogicSettings(settle=5.0, hold=10.0, latch=("G6",)))
    dry = {"yLT": "+"}
    found = logic.run(np.arange(4.0), rows(table, {}, dry, {}, {}))
    assert [str(found[k].acted) for k in range(4)] == ["fault free"] + ["isolated: G6"] * 3
    assert found.latched.tolist() == [False, True, True, True]
    logic.acknowledge()
    assert not logic.update(4.0, rows(table, {})[0]).latched
    assert logic.update(5.0, {"yLT": "+"}).latched
    logic.reset()
    assert logic.update(0.0, {"yLT": 0}).acted.status == "fault free"


def test_stream_batch_and_table_agree(table):
    rng = np.random.default_rng(3)
    ((_, symbols),) = list(verify.random_observations(rng, table, 600))
    symbols = np.repeat(symbols, rng.integers(1, 5, len(symbols)), axis=0)
    symbols[rng.random(symbols.shape) < 0.05] = UNKNOWN
    t = np.cumsum(rng.uniform(0.1, 1.0, len(symbols)))
    alone = DecisionLogic(table).run(t, symbols)
    assert [alone[k].acted for k in range(len(t))] == table.decide(symbols)
    for settings in (
        LogicSettings(hold=1.0),
        LogicSettings(settle=2.0),
        LogicSettings(settle=1.0, hold=1.5, latch=("G6",)),
    ):
        whole, pieces, single = (DecisionLogic(table, settings) for _ in range(3))
        record = whole.run(t, symbols)
        edges = [0, 1, 7, 200, 201, len(t)]
        parts = [pieces.run(t[a:b], symbols[a:b]) for a, b in itertools.pairwise(edges)]
        joined = [part[k] for part in parts for k in range(len(part.t))]
        streamed = [single.update(t[k], symbols[k]) for k in range(len(t))]
        assert [record[k] for k in range(len(t))] == joined == streamed


def test_the_rules_of_time_from_their_definition(table):
    rng = np.random.default_rng(4)
    ((_, symbols),) = list(verify.random_observations(rng, table, 150))
    symbols = np.repeat(symbols, 4, axis=0)
    t = np.arange(len(symbols)) * 0.5
    settle, hold = 1.2, 1.0
    record = DecisionLogic(table, LogicSettings(settle=settle, hold=hold)).run(t, symbols)
    since = [
        [t[k] for k in range(len(t)) if k == 0 or symbols[k, x] != symbols[k - 1, x]] for x in range(symbols.shape[1])
    ]
    verdicts = []
    for k in range(len(t)):
        age = [t[k] - max(start for start in since[x] if start <= t[k]) for x in range(symbols.shape[1])]
        young = any(symbols[k, x] != 0 and age[x] < settle for x in range(symbols.shape[1]))
        row = np.where(young & (symbols[k] == 0), UNKNOWN, symbols[k])
        verdicts += table.decide(row[None, :])
    assert [record[k].verdict for k in range(len(t))] == verdicts
    acted = Verdict(status="fault free")
    for k in range(len(t)):
        if all(verdicts[j] == verdicts[k] for j in range(k + 1) if t[k] - t[j] <= hold) and t[k] >= hold:
            acted = verdicts[k]
        assert record[k].acted == acted


def test_empty_blocks_are_allowed(table):
    logic = DecisionLogic(table)
    assert logic.run([], np.zeros((0, len(table.signals)), np.int8)).first_alarm() is None


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda t: t.pattern({"yX": "+"}), DataError, "signal 'yX'"),
        (lambda t: t.pattern({"yrH": "up"}), DataError, "yrH' = 'up'"),
        (lambda t: t.decide([[0]]), DataError, "one column for each"),
        (lambda t: t.decide(np.full((1, len(t.signals)), np.nan)), DataError, "whole numbers"),
        (lambda t: t.decide([t.pattern({"yZn": "-"})]), DataError, "'yZn', row 0: -1; must be 0, 1"),
        (lambda t: t.decide(np.full((1, len(t.signals)), 3)), DataError, "must be -1, 0, 1 or 2"),
        (lambda t: t.symbols("G9", "yrH"), ParameterError, "group 'G9'"),
        (lambda t: t.symbols("G1", "yX"), ParameterError, "signal 'yX'"),
        (lambda t: DecisionLogic(t, LogicSettings(latch=("G9",))), ParameterError, "'G9' is not in the table"),
        (lambda t: LogicSettings(hold=-1.0), ParameterError, "hold"),
        (lambda t: LogicSettings(settle=float("nan")), ParameterError, "settle"),
        (lambda t: DecisionLogic(t).run([1.0, 1.0], rows(t, {}, {})), DataError, "row 1: times must be finite"),
        (lambda t: DecisionLogic(t).run([np.nan], rows(t, {})), DataError, "row 0"),
        (lambda t: DecisionLogic(t).run([0.0, 1.0], rows(t, {})), DataError, "one time a row"),
    ],
)
def test_wrong_input_is_refused(table, call, error, text):
    with pytest.raises(error, match=text):
        call(table)


def test_time_does_not_go_back_between_calls(table):
    logic = DecisionLogic(table)
    logic.update(1.0, {})
    with pytest.raises(DataError, match="the one before is 1 s"):
        logic.update(0.5, {})
