"""Thesis 7.1-7.4: the figures of the steady-state chapter show what they are given, and the numbers behind them."""

from itertools import combinations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from pumplib.errors import DataError, ParameterError
from pumplib.machines import load_losses, load_motor
from pumplib.motor.load_points import read_load_points
from pumplib.paths import DATA
from pumplib.plots import ch07_bench as bench
from pumplib.plots import ch07_sets as sets
from pumplib.plots import ch07_study as study
from pumplib.plots.style import PAGE, save_figure
from pumplib.steady.bench_monitor import Judged, Points
from pumplib.steady.enclose import METHODS, Enclosure, set_model
from pumplib.steady.identify import identify
from pumplib.steady.motor_check import motor_check
from pumplib.steady.phasors import electrical_parameters, resistance_condition, steady_state
from pumplib.steady.relations import CHANNELS, FAULTS, pump_relations
from pumplib.steady.sets import box
from pumplib.steady.windows import HYPOTHESES, Verdict
from pumplib.testbench.faults import Fault

KNOWN = study.reference(3)
ONE = {name: column[4:5] for name, column in KNOWN.points.signals.items()}
POINT = {name: float(column[0]) for name, column in ONE.items()}
MODEL = set_model(pump_relations(KNOWN.motor), box(KNOWN.values, relative=0.02), study.statement("bench").errors)
T = np.arange(0.1, 12.0, 0.2)
SETS = Enclosure(
    outputs=("R1", "R2", "R3"),
    lo=np.stack((np.where(T > 8, -9e3, -4e3), np.full(len(T), -0.2), np.full(len(T), -0.3)), axis=1),
    hi=np.stack((np.where(T > 8, -1e3, 3e3), np.full(len(T), 0.1), np.full(len(T), 0.2)), axis=1),
    method="affine",
)
FOUND = {
    name: Verdict(
        name=name, possible=name in ("K_f", "f_c"), margin=-0.1 if name in ("K_f", "f_c") else 3.0, proven=0.0,
        size=(4e9, 6e9) if name == "K_f" else (0.01, 0.02) if name == "f_c" else None,
    )
    for name in HYPOTHESES[1:]
}  # fmt: skip
REST = (T % 4) > 2
JUDGED = Judged(
    points=Points(start=T[REST] - 1.0, t=T[REST], signals={}),
    plain=Enclosure(outputs=SETS.outputs, lo=SETS.lo[REST] - 1e3, hi=SETS.hi[REST] + 1e3, method="affine"),
    sets=Enclosure(outputs=SETS.outputs, lo=SETS.lo[REST], hi=SETS.hi[REST], method="affine"),
    window=T[REST] > 8, signs="", signs_at=None, verdicts=FOUND, tested=3, single_at=None,
)  # fmt: skip
SAID = (
    study.Said(t=3.9, tested=("none",), possible=("none",)),
    study.Said(t=11.9, tested=HYPOTHESES, possible=("K_f", "f_c")),
)
UNITS = {"K_f": 1e10, "dB": 2.5e-4, "K_l": 6e-8, "f_c": 0.025, "f_d": 0.9}


def _identified():  # type: ignore[no-untyped-def]
    known = study.reference(4)
    return identify(known.motor, known.values, known.points.signals, study.statement("bench").errors)


def _motor():  # type: ignore[no-untyped-def]
    points = read_load_points(DATA / "load_points" / "im_18k5.csv")
    return motor_check(load_motor("im_18k5"), load_losses("im_18k5"), points, voltage_line_rms=400.0, frequency_hz=50.0)


def _condition():  # type: ignore[no-untyped-def]
    return resistance_condition(electrical_parameters(KNOWN.motor), *[POINT[name] for name in CHANNELS[:4]])


RATIOS = {
    name: {method: np.outer(np.linspace(1, 1.2, 4), (1.0, 1.1, high)) for method in METHODS}
    for name, high in (("box", 1.4), ("identified", np.inf))
}
FIGURES = {
    "ch07_phasors": lambda: sets.phasors(KNOWN.motor, POINT),
    "ch07_widths": lambda: sets.widths(RATIOS),
    "ch07_no_enclosure": lambda: sets.no_enclosure(
        {name: study.beyond_linear(MODEL, ONE, name) for name in ("R1", "R2", "R3")},
        {name: {"taylor": (-0.004, 0.005), "affine": (-0.003, 0.004)} for name in ("R1", "R2", "R3")},
    ),
    "ch07_motor_sets": lambda: sets.motor_sets(_motor()),
    "ch07_flux": lambda: sets.flux_monitor(study.flux_monitor(KNOWN.motor, KNOWN.points.signals), _condition(), 0.03),
    "ch07_feasible": lambda: sets.feasible(_identified(), KNOWN.values),
    "ch07_smallest": lambda: sets.smallest(
        {"one point": {"K_f": 4e9, "dB": 4e-4}, "window": {"K_f": 5e8, "dB": np.inf}},
        ("Pa s²/m⁶", "N m s"),
        ("K_f", "dB"),
    ),
    "ch07_run": lambda: bench.sets_over_time(JUDGED, (T, SETS), changes=(4.0, 8.0), onset=7.9, said=SAID),
    "ch07_transients": lambda: bench.windows_over_time(T, SETS, JUDGED, changes=(4.0, 8.0)),
    "ch07_hypotheses": lambda: bench.hypotheses(FOUND, UNITS, ("K_f", 5e9), "that of the detection claim"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def _close():  # type: ignore[no-untyped-def]
    yield
    plt.close("all")


@pytest.mark.parametrize("name", FIGURES)
def test_figures_are_legible(name: str) -> None:
    figure = FIGURES[name]()
    FigureCanvasAgg(figure).draw()
    assert figure.get_size_inches()[0] <= PAGE
    shown = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert all(text.get_fontsize() >= 7 for text in shown if "10^" not in text.get_text())
    # everything but tick labels beyond the limits, which are not drawn
    labels = [label for ax in figure.axes for label in (ax.xaxis.label, ax.yaxis.label, ax.title, *ax.texts)]
    boxes = [label.get_window_extent() for label in labels if label.get_text()]
    assert all(b.x0 >= 0 and b.x1 <= figure.bbox.x1 and b.y0 >= 0 and b.y1 <= figure.bbox.y1 for b in boxes)
    titles = [ax.title.get_window_extent() for ax in figure.axes if ax.title.get_text()]
    assert not any(a.overlaps(b) for a, b in combinations(titles, 2))


@pytest.mark.parametrize("name", ["ch07_widths", "ch07_run", "ch07_hypotheses"])
def test_figures_have_the_same_bytes_every_time(tmp_path, name: str) -> None:  # type: ignore[no-untyped-def]
    first, second = (save_figure(FIGURES[name](), tmp_path / k, name) for k in "ab")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


def test_phasors_close() -> None:
    found = steady_state(electrical_parameters(KNOWN.motor), *[POINT[name] for name in CHANNELS[:4]])
    axes = FIGURES["ch07_phasors"]().axes
    arrows = [t for t in axes[0].texts if getattr(t, "arrow_patch", None) is not None]
    ends = [complex(*t.xy) for t in arrows]  # type: ignore[attr-defined]
    assert ends[1] == pytest.approx(complex(float(found.E_d), float(found.E_q)))
    assert ends[3] == pytest.approx(ends[1])  # V less both drops is E
    rotor = [t for t in axes[1].texts if getattr(t, "arrow_patch", None) is not None]
    i, i_m = complex(*rotor[0].xy), complex(*rotor[1].xy)  # type: ignore[attr-defined]
    assert ((i - i_m) * i_m.conjugate()).real == pytest.approx(0, abs=1e-9)


def test_widths_marks_what_has_no_end() -> None:
    left, right = FIGURES["ch07_widths"]().axes
    arrows = [sum(line.get_marker() == 6 and len(line.get_xdata()) for line in ax.lines) for ax in (left, right)]
    assert arrows == [0, len(METHODS)]
    with pytest.raises(ParameterError, match="guess"):
        sets.widths({"box": {"guess": np.ones((2, 3))}})


def _segments(ax, label: str):  # type: ignore[no-untyped-def]
    (found,) = [c for c in ax.collections if c.get_label() == label]
    return [(s[0][1], s[1][1]) for s in found.get_segments()]


def test_bands_are_coloured_by_zero() -> None:
    head = FIGURES["ch07_run"]().axes[0]
    held, out = (_segments(head, "given the healthy block" + more) for more in ("", ": zero outside"))
    assert len(held) + len(out) == REST.sum()
    assert all(lo <= 0 <= hi for lo, hi in held)
    assert not any(lo <= 0 <= hi for lo, hi in out)
    assert len(out) == (T[REST] > 8).sum()
    head = FIGURES["ch07_transients"]().axes[0]
    assert len(_segments(head, "every window, detector off: zero outside")) == (T > 8).sum()
    assert len(_segments(head, "points that the detector lets through")) == (REST & (T <= 8)).sum()
    with pytest.raises(DataError, match="must agree"):
        bench.windows_over_time(T[1:], SETS, JUDGED)


def test_strip_shows_what_was_tested() -> None:
    strip = FIGURES["ch07_run"]().axes[3]
    marks = [(line.get_xdata()[0], line.get_marker()) for line in strip.lines if line.get_linestyle() == "None"]
    assert marks.count((3.9, "s")) == 1
    assert marks.count((11.9, "s")) == 2
    assert marks.count((11.9, "x")) == len(HYPOTHESES) - 2


def test_a_machine_of_the_bench_with_better_and_worse_probes() -> None:
    for accuracy, seed in (("bench", 1), ("A", 2)):
        rng = np.random.default_rng([7, seed])
        shown = study.show(accuracy, Fault(kind="clogging", size=1e10), 6, rng)
        assert shown.monitor.settings.recent == 6
        assert shown.onset is not None
        assert not (shown.judged.alarms("window") < shown.onset).any()
        assert abs(shown.warm) < 0.1
        t, moving = study.moving_sets(shown.monitor, shown.slow)
        assert len(t) == len(moving.lo) == len(shown.slow.t) - shown.monitor.settings.samples + 1
        plain = study.plain_sets(shown.monitor, shown.judged, "affine")
        np.testing.assert_array_equal(plain.lo, shown.judged.plain.lo)
        said = study.said_over_time(shown.monitor, shown.judged)
        assert [one.t for one in said] == shown.judged.points.t.tolist()
        first = next((k for k, one in enumerate(said) if "none" not in one.possible), len(said))
        assert all(one.tested == ("none",) for one in said[:first])
        last = [one.possible for one in said if len(one.tested) > 1][:6]
        if last and "none" not in last[-1]:
            assert last[-1] == shown.judged.possible
    with pytest.raises(ParameterError, match="bench, A, B"):
        study.show("C", None, 6, np.random.default_rng(1))


def test_absent_campaigns_are_told_from_damaged_ones(tmp_path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(study.results, "RESULTS", tmp_path)
    assert study.campaign_table("steady_pump") is None
    (tmp_path / "steady_pump.json").write_text("{}", encoding="utf-8")
    with pytest.raises(DataError, match="provenance"):
        study.campaign_table("steady_pump")


def test_zonotope_and_section() -> None:
    rng = np.random.default_rng(3)
    G = rng.normal(size=(3, 3))
    corners = sets.zonotope(G[:2])
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1)
    every = (G[:2] @ signs).T
    for direction in rng.normal(size=(20, 2)):
        assert (corners @ direction).max() == pytest.approx((every @ direction).max())
    cut = sets.section(G, 0, 1)
    zeta = np.linalg.solve(G, np.column_stack((cut, np.zeros(len(cut)))).T)
    np.testing.assert_allclose(np.abs(zeta).max(axis=0), 1.0, atol=1e-12)  # corners lie on the boundary
    assert (cut @ [1.0, 0.3]).max() <= (corners @ [1.0, 0.3]).max() + 1e-12


def test_relations_derived_by_the_analysis_are_the_compiled_ones() -> None:
    found = study.derived_relations()
    assert [one.name for one in found] == ["R1", "R2", "R3"]
    for one in found:
        assert set(one.faults) == set(FAULTS[one.name])
        assert "L_m" not in {s.name for part in (one.expression, *one.motor.values()) for s in part.free_symbols}
        assert one.latex().startswith(one.name)
    apart = study.worst_difference(found, np.random.default_rng(1), 50)
    assert max(apart.values()) < 1e-12


def test_ends_of_rigorous_sets_lie_beyond_the_linear_one_as_far_as_the_residual_goes() -> None:
    ends = study.ends_beyond_linear(MODEL, ONE, ("taylor", "affine"))
    for name, by_method in ends.items():
        _, excess = study.beyond_linear(MODEL, ONE, name)
        for low, high in by_method.values():
            assert low <= min(excess[0], 0.0) <= max(excess[-1], 0.0) <= high


def test_beyond_linear_vanishes_in_the_middle_and_with_the_set() -> None:
    way, excess = study.beyond_linear(MODEL, ONE, "R2")
    assert abs(excess[len(way) // 2]) < 1e-9
    assert np.abs(excess).max() > 1e-4
    small = set_model(pump_relations(KNOWN.motor), box(KNOWN.values, relative=0.002), study.statement("bench").errors)
    assert (
        np.abs(study.beyond_linear(small, ONE, "R1")[1]).max() < np.abs(study.beyond_linear(MODEL, ONE, "R1")[1]).max()
    )


def test_smallest_sizes_shrink_with_more_knowledge() -> None:
    exact = set_model(pump_relations(KNOWN.motor), box(KNOWN.values, relative=0.005), study.statement("bench").errors)
    wide, narrow = (study.smallest_sizes(m, KNOWN, pairs=3, count=30) for m in (MODEL, exact))
    for fault in study.SMALL:
        assert np.all(narrow[fault] <= wide[fault])
    single = {fault: float(size.min()) for fault, size in wide.items()}
    rng = np.random.default_rng(2)
    window = study.smallest_in_windows(MODEL, KNOWN, healthy=8, recent=4, rng=rng, halvings=6)
    assert all(window[fault] < single[fault] for fault in study.SMALL)


def test_flux_monitor_gives_back_exact_parameters() -> None:
    found = study.flux_monitor(KNOWN.motor, KNOWN.points.signals)
    np.testing.assert_allclose(found.L_m_prime, found.believed[0], rtol=1e-9)
    np.testing.assert_allclose(found.r_s, found.believed[1], rtol=1e-7)


def test_sensor_classes() -> None:
    stated = [study.statement(name).errors for name in study.SENSOR_CLASSES]
    assert [one.relative["I_rms"] > 0.003 + k for one, k in zip(stated, (0, 0.002, 0.007), strict=True)] == [True] * 3
    assert [one.relative["V_rms"] > k for one, k in zip(stated, (0, 0.005, 0.01), strict=True)] == [True] * 3
    assert all(one.relative["V_rms"] < 0.011 for one in stated)
    with pytest.raises(ParameterError, match="bench, A, B"):
        study.statement("C")
