"""The figures of the measured machines show what they were given."""

import warnings
from collections.abc import Iterator

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from pumplib.errors import ParameterError
from pumplib.hydraulics.curves import PumpCurve, fit_curve, provenance, read_curves
from pumplib.machines import load_losses, load_motor
from pumplib.motor.load_points import compare_load_points, read_load_points
from pumplib.paths import DATA
from pumplib.plots import style
from pumplib.plots.ch03_real import motor_load_points, pump_curve_fits

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def _styled() -> Iterator[None]:
    with style():
        yield
    plt.close("all")


def drawn(figure: Figure) -> None:
    """Lay the figure out and draw it; warnings (missing glyphs, failed layout) are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.canvas.draw()


def texts(axes: object) -> str:
    return " ".join(text.get_text() for text in axes.texts)  # type: ignore[attr-defined]


def test_every_pump_has_its_points_and_flags_are_visible() -> None:
    curves = read_curves(DATA / "pump_curves" / "published.csv")
    flags = provenance(curves)
    figure = pump_curve_fits(curves, [fit_curve(c) for c in curves], flags)
    drawn(figure)
    assert len(figure.axes) == 20
    for k, (curve, flag) in enumerate(zip(curves, flags, strict=True)):
        head, torque = figure.axes[2 * k], figure.axes[2 * k + 1]
        assert head.get_title(loc="left").replace("\n", " ").strip() == curve.name
        np.testing.assert_allclose(head.lines[-1].get_ydata(), curve.pressure / 1e3)
        np.testing.assert_allclose(head.lines[-1].get_xdata(), curve.flow * 3600)
        np.testing.assert_allclose(torque.lines[-1].get_ydata(), curve.torque)
        assert ("not counted" in texts(head)) == (not flag.independent)
        assert (head.lines[-1].get_markerfacecolor() == "white") == (not flag.independent)


def test_several_speeds_draw_one_line_each() -> None:
    flow, power = np.linspace(0, 3e-3, 6), np.linspace(90, 190, 6)
    pressure = np.array([60.0, 54.1, 48.9, 43.2, 36.9, 30.0]) * 1e3
    curve = PumpCurve(
        name="two speeds", omega=np.repeat([200.0, 300.0], 6), flow=np.tile(flow, 2),
        pressure=np.tile(pressure, 2) * np.repeat([0.44, 1], 6), power=np.tile(power, 2) * np.repeat([0.3, 1], 6),
    )  # fmt: skip
    figure = pump_curve_fits([curve], [fit_curve(curve)], provenance([curve]))
    drawn(figure)
    assert len(figure.axes[0].lines) == 3


def test_r2_is_never_rounded_up_to_one() -> None:
    curves = read_curves(DATA / "pump_curves" / "published.csv")[3:4]
    figure = pump_curve_fits(curves, [fit_curve(c) for c in curves], provenance(curves))
    assert "0.9998" in texts(figure.axes[0])


def test_curves_and_fits_must_belong_together() -> None:
    curves = read_curves(DATA / "pump_curves" / "published.csv")
    fits = [fit_curve(c) for c in curves]
    with pytest.raises(ParameterError, match="same order"):
        pump_curve_fits(curves, fits[::-1], provenance(curves))
    with pytest.raises(ParameterError, match="0 curves"):
        pump_curve_fits([], [], [])


def test_load_points_show_measured_and_computed() -> None:
    points = read_load_points(DATA / "load_points" / "im_18k5.csv")
    comparison = compare_load_points(
        load_motor("im_18k5"), load_losses("im_18k5"), points, voltage_line_rms=400, frequency_hz=50
    )
    figure = motor_load_points(comparison)
    drawn(figure)
    speed, error, power, current, factor, efficiency = figure.axes
    np.testing.assert_allclose(speed.lines[0].get_ydata(), comparison.points.omega * 30 / np.pi)
    np.testing.assert_allclose(error.lines[0].get_ydata(), comparison.speed_error() * 30 / np.pi)
    # the no-load point has no relative error
    assert len(power.lines[0].get_xdata()) == 13
    np.testing.assert_allclose(current.lines[0].get_ydata(), points.current_line_rms)
    np.testing.assert_allclose(factor.lines[1].get_ydata(), comparison.forward.power_factor)
    assert np.all(np.isfinite(efficiency.lines[1].get_ydata()))
    # kinds differ in marker, not in colour alone
    assert len({line.get_marker() for line in speed.lines}) == 3
    for axes in figure.axes:
        assert "(" in axes.get_ylabel()
