"""Thesis 3.1-3.3.4: the schematics are complete, legible and byte-stable, and the velocity triangles close."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from pumplib.errors import ParameterError
from pumplib.hydraulics.impeller import theoretical_head
from pumplib.machines.parameters import Impeller, Liquid
from pumplib.machines.sheets import read_sheet, shipped
from pumplib.plots import ch03_schematics, ch03_sections, ch03_velocities
from pumplib.plots.ch03_velocities import blade_line, triangle_at
from pumplib.plots.style import COLUMN, PAGE, save_figure

STAGE = read_sheet(shipped()["pumps/stage_geometry"]).parts["impeller"]
assert isinstance(STAGE, Impeller)
OMEGA = 2 * math.pi * 2900 / 60
DESIGN = STAGE.K_d * OMEGA

FIGURES = {
    "ch03_pump_construction": ch03_sections.pump_construction,
    "ch03_signal_flow": ch03_schematics.signal_flow,
    "ch03_motor_circuit": ch03_schematics.motor_circuit,
    "ch03_connections": ch03_schematics.connections,
    "ch03_impeller_section": ch03_sections.impeller_section,
    "ch03_hydraulic_block": ch03_schematics.hydraulic_block,
    "ch03_velocity_triangle": lambda: ch03_velocities.velocity_triangle(STAGE, OMEGA, DESIGN),
    "ch03_control_volume": lambda: ch03_velocities.control_volume(STAGE),
    "ch03_leakage_sketch": ch03_sections.leakage_sketch,
    "ch03_hydraulic_circuit": ch03_schematics.hydraulic_circuit,
}
# the same triangle at other flows: inlet speed against, without and with rotation
FLOWS = {f"ch03_velocity_triangle at {k:g} Q_d": k for k in (0.2, 0.35, 0.5, 0.61, 0.8, 1.5)}


def legible(figure: Figure) -> list[str]:
    """Complaints about texts that are too small, overlap, leave the page or are crossed by a line."""
    FigureCanvasAgg(figure)
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    texts = [t for t in figure.findobj(Text) if t.get_text() and t.get_visible() and t.axes.axison is False]
    boxes = [(t.get_text(), t.get_window_extent(renderer)) for t in texts]
    page = figure.bbox
    found = [f"{t.get_text()!r} is smaller than 7 pt" for t in texts if t.get_fontsize() < 7]
    for text, box in boxes:
        if box.x0 < page.x0 or box.y0 < page.y0 or box.x1 > page.x1 or box.y1 > page.y1:
            found.append(f"{text!r} leaves the page")
    for (text, a), (other, b) in combinations(boxes, 2):
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 0 and min(a.y1, b.y1) - max(a.y0, b.y0) > 0:
            found.append(f"{text!r} overlaps {other!r}")
    lines = [line for line in figure.axes[0].lines if line.get_linewidth() > 0]
    for line in lines:
        ends = line.get_transform().transform(line.get_xydata())
        share = np.linspace(0, 1, 60)[:, None, None]
        x, y = np.moveaxis((1 - share) * ends[:-1] + share * ends[1:], -1, 0)
        for text, box in boxes:
            if np.any((x > box.x0 + 1.5) & (x < box.x1 - 1.5) & (y > box.y0 + 1.5) & (y < box.y1 - 1.5)):
                found.append(f"a line runs through {text!r}")
    return found


@pytest.mark.parametrize("name", FIGURES)
def test_figures_are_legible_and_fit_a_page(name: str) -> None:
    figure = FIGURES[name]()
    assert isinstance(figure, Figure)
    assert figure.get_size_inches()[0] in (COLUMN, PAGE)
    assert legible(figure) == []


@pytest.mark.parametrize("name", FLOWS)
def test_velocity_triangles_are_legible_at_any_flow(name: str) -> None:
    assert legible(ch03_velocities.velocity_triangle(STAGE, OMEGA, FLOWS[name] * DESIGN)) == []


@pytest.mark.parametrize("degrees", [30, 50, 65])
def test_motor_circuit_is_legible_at_any_rotor_angle(degrees: float) -> None:
    assert legible(ch03_schematics.motor_circuit(math.radians(degrees))) == []


@pytest.mark.parametrize("name", FIGURES)
def test_saving_is_byte_stable(name, tmp_path) -> None:
    figure = FIGURES[name]()
    first = [path.read_bytes() for path in save_figure(figure, tmp_path / "a", name)]
    assert first == [path.read_bytes() for path in save_figure(figure, tmp_path / "b", name)]
    assert first == [path.read_bytes() for path in save_figure(FIGURES[name](), tmp_path / "c", name)]


shares = st.floats(0.0, 1.0)


@given(share=shares, omega=st.floats(1.0, 600.0), Q=st.floats(1e-6, 1e-2))
def test_triangle_closes_and_flow_is_continuous(share: float, omega: float, Q: float) -> None:
    r = STAGE.r_1 + share * (STAGE.r_2 - STAGE.r_1)
    t = triangle_at(STAGE, r, omega, Q)
    size = np.abs(t.U).max() + np.abs(t.W).max()
    np.testing.assert_allclose(t.C, t.U + t.W, atol=1e-12 * size)
    assert t.C[1] * 2 * math.pi * r * STAGE.h == pytest.approx(Q, rel=1e-12)
    # W leaves along the blade, backward
    assert math.atan2(t.W[1], -t.W[0]) == pytest.approx(t.beta, rel=1e-12)


@given(omega=st.floats(10.0, 600.0), Q=st.floats(1e-5, 5e-3))
def test_triangles_give_the_theoretical_head(omega: float, Q: float) -> None:
    liquid = Liquid()
    inlet, outlet = (triangle_at(STAGE, r, omega, Q) for r in (STAGE.r_1, STAGE.r_2))
    euler = (outlet.U[0] * outlet.C[0] - inlet.U[0] * inlet.C[0]) / liquid.g
    scale = outlet.U[0] * np.abs((*outlet.C, *inlet.C)).max() / liquid.g
    assert euler == pytest.approx(theoretical_head(STAGE, liquid, omega, Q), abs=1e-12 * scale)


def test_blades_lean_against_the_rotation_at_their_angle() -> None:
    r, theta = blade_line(STAGE, 1.0, 4001)
    assert theta[0] == 1.0
    assert np.all(np.diff(theta) < 0)
    # angle between the line and the tangential direction is beta
    slope = np.diff(r) / (-0.5 * (r[1:] + r[:-1]) * np.diff(theta))
    beta = [triangle_at(STAGE, x, OMEGA, DESIGN).beta for x in 0.5 * (r[1:] + r[:-1])]
    np.testing.assert_allclose(np.arctan(slope), beta, rtol=1e-5)
    # a constant angle gives a logarithmic spiral
    spiral = Impeller(r_1=0.02, r_2=0.06, h=0.01, beta=(0.4, 0.4), sigma_s=1.0, K_s=0.0, K_f=0.0, K_d=0.0, K_n=0.0)
    assert blade_line(spiral, points=4001)[1][-1] == pytest.approx(-math.log(3) / math.tan(0.4), rel=1e-6)


def test_wrong_input_is_refused() -> None:
    with pytest.raises(ParameterError, match="between r_1"):
        triangle_at(STAGE, 2 * STAGE.r_2, OMEGA, DESIGN)
    with pytest.raises(ParameterError, match="both must be > 0"):
        ch03_velocities.velocity_triangle(STAGE, OMEGA, 0.0)
    with pytest.raises(ParameterError, match="theta"):
        ch03_schematics.motor_circuit(3.0)
