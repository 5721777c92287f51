"""The bench by hand: faults show with the signs their physics gives them, and the picture follows the values."""

import io
import statistics
import time
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.image import imread

from pumplib import explore
from pumplib.errors import DataError, ParameterError
from pumplib.plots.explore import BenchPicture, Panel

# fault -> signs of the residuals of pressure, torque, negative-sequence current; None: not said here
EXPECTED = {
    "none": (0, 0, 0),
    "inter_turn": (None, 1, 1),
    "ground": (None, 1, 1),
    "clogging": (-1, 0, 0),
    "friction": (0, 1, 0),
    "leakage": (-1, 1, 0),  # more flow through the impeller than is measured: less head, more torque
    "cavitation": (-1, -1, 0),
    "dry_running": (-1, -1, 0),
    "outlet_leak": (-1, 1, 0),
    "inlet_obstruction": (None, 0, 0),  # another operating point, not another pump
    "bearing": (0, 0, 0),
    "blocked_rotor": (None, 1, None),
}


def test_every_fault_is_expected() -> None:
    assert set(EXPECTED) == set(explore.FAULTS)


@pytest.mark.parametrize("fault", explore.FAULTS)
def test_signs(fault: str) -> None:
    found = explore.bench_view(fault).signature()
    for name, sign in zip(("pressure", "torque", "asymmetry"), EXPECTED[fault], strict=True):
        assert sign is None or found[name] == sign, (name, found)


@pytest.mark.parametrize("fault", ["clogging", "friction", "leakage", "cavitation"])
@pytest.mark.parametrize(("valve", "hertz"), [(1.25e11, 30.0), (1.25e11, 50.0), (6e11, 30.0), (6e11, 50.0)])
def test_signs_hold_over_the_operating_range(fault: str, valve: float, hertz: float) -> None:
    found = explore.bench_view(fault, 1.5, valve, hertz, noise=0.5).signature()
    assert tuple(found.values()) == EXPECTED[fault]


def test_the_answer_grows_with_the_size() -> None:
    small, large = (explore.bench_view("clogging", size, noise=0.0).answer("pressure") for size in (0.5, 1.0))
    # K_f Q^2 with a flow that hardly changes; the pressure sensor counts in steps of 200 Pa
    assert large == pytest.approx(2 * small, rel=0.05, abs=200)
    view = explore.bench_view("friction", 1.0, noise=0.0)
    assert view.fault is not None
    assert view.answer("torque") == pytest.approx(view.fault.size * view.speed.mean(), rel=0.05)


def test_the_estimated_speed_is_close_to_the_true_one() -> None:
    # 45 Hz and one pole pair: 282.7 rad/s without slip; the bench turns at 276.9 rad/s
    view = explore.bench_view("none")
    assert np.all(np.abs(view.speed - 276.9) < 0.5)


@pytest.mark.parametrize(("signal", "sigma"), [("pressure", 800.0), ("flow", 4e-6)])
def test_noise_slider(signal: str, sigma: float) -> None:
    quiet, one, three = (getattr(explore.bench_view("none", noise=factor), signal) for factor in (0.0, 1.0, 3.0))
    assert np.ptp(quiet) < 0.5 * sigma  # at most the step of the converter
    assert one.std() == pytest.approx(sigma, rel=0.1)
    assert three.std() == pytest.approx(3 * sigma, rel=0.05)


def test_noise_widens_the_bands() -> None:
    one, five = (explore.bench_view("none", noise=factor).bands for factor in (1.0, 5.0))
    assert five["pressure"] == pytest.approx(5 * one["pressure"], rel=0.1)
    assert five["torque"] > one["torque"]


def test_before_the_fault_nothing_differs() -> None:
    healthy, faulty = explore.bench_view("none"), explore.bench_view("dry_running")
    before = healthy.t < explore.ONSET
    for name in ("pressure", "flow", "current"):
        assert np.array_equal(getattr(healthy, name)[before], getattr(faulty, name)[before])
    assert faulty.fault is not None
    assert faulty.fault.onset == explore.ONSET


@pytest.mark.parametrize("fault", explore.FAULTS)
@pytest.mark.parametrize("size", [0.01, 2.0])
def test_the_ends_of_the_sliders(fault: str, size: float) -> None:
    for valve in explore.RANGES["valve"]:
        view = explore.bench_view(fault, size, valve, 30.0 if size > 1 else 50.0, 5.0)
        assert all(np.isfinite(r).all() for r in view.residuals.values())
        plt.close(explore.static_figure(view))


def test_sizes() -> None:
    assert explore.fault_of_size("friction", 0.0) is None
    assert explore.fault_of_size("none", 1.0) is None
    assert explore.fault_of_size("dry_running", 0.01).size == 0.35
    assert explore.fault_of_size("dry_running", 2.0).size == 1.0
    assert explore.fault_of_size("clogging", 0.5).size == 5e9
    with pytest.raises(ParameterError, match="must be one of none, inter_turn"):
        explore.fault_of_size("gremlin", 1.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [({"valve": 1.0}, "valve"), ({"speed_hz": 60.0}, "30 to 50"), ({"noise": float("nan")}, "noise"),
     ({"size": -1.0}, "size"), ({"fault": "x"}, "fault 'x'")],
)  # fmt: skip
def test_wrong_values(values: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        explore.bench_view(**values)


def picture(*values: object) -> bytes:
    drawn = BenchPicture(explore.DURATION)
    explore._show(drawn, explore.bench_view(*values))
    return drawn.png()


def test_a_moved_picture_is_a_new_picture() -> None:
    """Nothing of the view before is left over, whatever was shown in between."""
    drawn = BenchPicture(explore.DURATION)
    seen = []
    for values in (("leakage",), ("blocked_rotor", 2.0), ("none",), ("leakage",)):
        explore._show(drawn, explore.bench_view(*values))
        seen.append(drawn.png())
    assert seen[0] == seen[3] == picture("leakage")
    assert seen[2] == picture("none")
    assert len(set(seen)) == 3
    assert imread(io.BytesIO(seen[0])).shape == (550, 792, 4)


def test_the_picture_wants_three_signals_and_three_residuals() -> None:
    t = np.arange(3.0)
    with pytest.raises(DataError, match="three signals"):
        BenchPicture(2.0).update([Panel(title="x", t=t, y=t, span=1.0)] * 6, "", None)


def test_time_of_a_redraw(capsys: pytest.CaptureFixture[str]) -> None:
    """Reported, not asserted: the time of a busy machine says nothing about the code."""
    drawn = BenchPicture(explore.DURATION)
    times = []
    for k in range(8):
        begin = time.perf_counter()
        explore._show(drawn, explore.bench_view("leakage", 0.5 + k / 10))
        drawn.png()
        times.append(time.perf_counter() - begin)
    with capsys.disabled():
        print(f" [redraw: median {statistics.median(times[1:]):.3f} s, aim 0.3 s] ", end="")


def test_no_sliders_where_nobody_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert explore.controls() is None
    assert "JupyterLab" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "there"), [({"allow_stdin": True}, True), ({"allow_stdin": False}, False), ({}, False)]
)
def test_who_asks(monkeypatch: pytest.MonkeyPatch, content: dict, there: bool) -> None:
    kernel = SimpleNamespace(get_parent=lambda channel: {"content": content})
    shell = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=kernel))
    monkeypatch.setitem(explore.sys.modules, "IPython", shell)
    assert explore._has_frontend() is there


def test_sliders_redraw(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explore, "_has_frontend", lambda: True)
    box = explore.controls("none")
    fault, size, valve = box.children[0].children[0].children
    speed, noise, status = box.children[0].children[1].children
    image = box.children[1]
    assert image.value == picture("none")
    for slider, value in ((fault, "friction"), (size, 2.0), (valve, valve.max), (speed, 50.0), (noise, 0.0)):
        before = image.value
        slider.value = value
        assert image.value != before, slider.description
        assert status.value.startswith("redrawn in")
    valve.value = 2.5
    assert image.value == picture("friction", 2.0, 2.5e11, 50.0, 0.0)
    monkeypatch.setattr(explore, "bench_view", lambda **_: explore.fault_of_size("gremlin", 1.0))
    noise.value = 1.0
    assert "must be one of" in status.value
