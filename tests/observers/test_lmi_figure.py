"""Thesis B.2: the figure of a common Lyapunov function shows what it is given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.observers import largest_decay_rate, lyapunov_certificate
from pumplib.plots.lmi import feasibility
from pumplib.plots.style import save_figure

A = np.array([[[0, 1], [-2, -1]], [[0, 1], [-4, -1]]], dtype=float)


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def test_feasibility(tmp_path):
    certificate = lyapunov_certificate(A, decay_rate=0.1)
    sizes = [1.0, 2.0]
    brackets = [largest_decay_rate(np.stack([A[0], A[0] - [[0, 0], [k, 0]]]), rtol=0.02) for k in sizes]
    figure = feasibility(sizes, brackets, certificate, A, limit=1 + 2 * np.sqrt(2), limit_name="circle", marked=2.0)
    left, middle, right = figure.axes
    np.testing.assert_allclose(left.lines[0].get_ydata(), [one.low for one in brackets])
    ellipse = np.array(middle.lines[0].get_data()).T
    np.testing.assert_allclose(certificate.norm(ellipse), 1.0)
    bound = right.lines[3].get_ydata()
    for line in right.lines[:3]:  # even the worst switching stays below the certified bound
        assert (line.get_ydata() <= bound * (1 + 1e-9)).all()
    one, two = (save_figure(figure, tmp_path / k, "ch02_lmi_feasibility") for k in "ab")
    assert [p.read_bytes() for p in one] == [p.read_bytes() for p in two]
    with pytest.raises(ParameterError, match="2 brackets"):
        feasibility([1.0], brackets, certificate, A)
    with pytest.raises(ParameterError, match="two real states"):
        feasibility(sizes, brackets, certificate, A * (1 + 0j))
    delta = lyapunov_certificate(A, form="delta", h=0.01)
    with pytest.raises(ParameterError, match="continuous form"):
        feasibility(sizes, brackets, delta, A)
