"""Thesis B.1: run lengths against published tables, between two numerical routes, and against simulation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.decide import arl, arl_integral, arl_markov, siegmund, simulate_run_lengths, steady_delay
from pumplib.errors import ParameterError


@pytest.mark.parametrize(
    ("nu", "h", "mu", "published", "half_digit"),
    [
        # Brook and Evans (1972), section 4.3, a Markov chain with few states
        (0.5, 3.0, 0.0, 117.59, 0.01),
        (0.5, 3.0, 1.5, 3.75, 0.005),
        # Vance (1986), table 1, as far as given there to two digits
        (0.0, 10.0, -0.25, 2071.51, 0.1),
        (0.0, 10.0, -0.125, 400.28, 0.01),
        (0.0, 10.0, 0.0, 124.66, 0.005),
        (0.0, 10.0, 0.25, 36.71, 0.005),
        (0.0, 10.0, 1.0, 10.75, 0.005),
        # Waldmann (1986), tables 1, 3 and 5
        (0.5, 3.0, -0.5, 1963.0, 0.5),
        (0.5, 3.0, 0.5, 17.35, 0.005),
        # the standard design (0.5, 5), one-sided
        (0.5, 5.0, 0.0, 930.9, 0.05),
    ],
)
def test_published_one_sided(nu, h, mu, published, half_digit):
    assert arl_integral(nu, h, mu).value == pytest.approx(published, abs=half_digit)


@pytest.mark.parametrize(
    ("nu", "h", "mu", "published", "half_digit"),
    [
        # Lucas and Crosier (1982), table 1, without head start
        (0.5, 4.0, 0.0, 168.0, 0.5),
        (0.5, 4.0, 0.25, 74.2, 0.05),
        (0.5, 4.0, 0.5, 26.6, 0.05),
        (0.5, 4.0, 0.75, 13.3, 0.05),
        (0.5, 4.0, 1.0, 8.38, 0.005),
        (0.5, 4.0, 2.0, 3.34, 0.005),
        (0.5, 5.0, 0.0, 465.0, 0.5),
        (0.5, 5.0, 1.0, 10.4, 0.05),
        # Waldmann (1986), table 6
        (0.6, 3.0, -0.2, 65.4, 0.1),
    ],
)
def test_published_two_sided(nu, h, mu, published, half_digit):
    assert arl(nu, h, mu).value == pytest.approx(published, abs=half_digit)


@pytest.mark.parametrize(
    ("nu", "h", "one_sided"), [(0.5, 5.0, 938.2), (0.5, 4.0, 338.1), (0.25, 8.0, 737.8), (1.0, 2.5, 760.1)]
)
def test_siegmund_published(nu, h, one_sided):
    """Siegmund (1985); 938.2 is also the textbook example for (0.5, 5)."""
    assert siegmund(nu, h) == pytest.approx(one_sided, abs=0.05)


def test_siegmund_is_continuous_at_zero_difference():
    b = 5.0 + 1.166
    assert siegmund(0.5, 5.0, 0.5) == pytest.approx(b * b, rel=1e-14)
    for edge in (1e-2 / b, -1e-2 / b):  # where the series takes over
        inside, outside = siegmund(0.5, 5.0, 0.5 + 0.999999 * edge), siegmund(0.5, 5.0, 0.5 + 1.000001 * edge)
        assert inside == pytest.approx(outside, rel=1e-7)
        direct = (math.exp(-2 * edge * b) + 2 * edge * b - 1) / (2 * edge**2)
        assert inside == pytest.approx(direct, rel=1e-7)
    assert siegmund(20.0, 200.0) == math.inf


@pytest.mark.parametrize(
    ("nu", "h", "mu"),
    [(0.5, 5, 0), (0.5, 4, 0), (0.25, 8, 0), (1, 2.5, 0), (0.5, 5, 1), (0.5, 0.3, 0), (0, 10, -0.25), (1.5, 3, 0.2)],
)
def test_two_routes_agree(nu, h, mu):
    integral, chain = arl_integral(nu, h, mu), arl_markov(nu, h, mu)
    assert integral.value == pytest.approx(chain.value, rel=1e-8)
    assert abs(integral.value - chain.value) <= integral.error + chain.error
    assert integral.error < 1e-9 * integral.value


def test_a_month_between_false_alarms_at_1_khz_is_still_exact():
    """Plain elimination loses ten digits here; the one without subtractions does not."""
    found = arl_integral(0.5, 21.6)
    assert found.value > 2.5e9
    assert found.error < 1e-10 * found.value
    # far out the run length grows by exp(2 nu) per sigma of threshold, the rate of Wald's approximation
    assert arl_integral(0.5, 22.6).value / found.value == pytest.approx(math.e, rel=1e-7)


@effort(max_examples=40, deadline=None)
@given(st.floats(0, 2), st.floats(0.2, 8), st.floats(0.01, 0.5), st.floats(-0.5, 0.5))
def test_run_length_grows_with_threshold_and_drift_and_falls_with_the_mean(nu, h, step, mu):
    here = arl_integral(nu, h, mu).value
    assert arl_integral(nu, h + step, mu).value > here > 1
    assert arl_integral(nu + step, h, mu).value > here
    assert arl_integral(nu, h, mu + step).value < here


def two_sided_chain(nu, h, mu, cells):
    """Both statistics together on a lattice: 2 nu and h fall on it, so that one x moves both by whole cells."""
    from scipy.sparse import csr_matrix, identity
    from scipy.sparse.linalg import spsolve
    from scipy.special import ndtr

    w = 2 * nu / cells
    top = round(h / w + 0.5)
    assert top * w - 0.5 * w == pytest.approx(h)
    state, rows, cols, chance = {(0, 0): 0}, [], [], []
    queue = [(0, 0)]
    while queue:
        i, j = queue.pop()
        for a in range(-top - cells, top + 1):  # the upper statistic moves by a cells, the lower by -a - cells
            up, down = max(i + a, 0), max(j - a - cells, 0)
            if up >= top or down >= top:
                continue
            key = (up, down)
            if key not in state:
                state[key] = len(state)
                queue.append(key)
            x = a * w + nu
            rows.append(state[(i, j)])
            cols.append(state[key])
            chance.append(ndtr(x + w / 2 - mu) - ndtr(x - w / 2 - mu))
    n = len(state)
    p = csr_matrix((chance, (rows, cols)), shape=(n, n))
    return float(spsolve((identity(n) - p).tocsc(), np.ones(n))[0]), sum(i > 0 and j > 0 for i, j in state)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_two_sided_identity_against_the_joint_chain(mu):
    """The rule 1/L = 1/L+ + 1/L- against a chain that knows nothing of it."""
    nu, h = 0.5, 2.5
    counts = np.array([3, 5, 7, 9])
    found = [two_sided_chain(nu, h, mu, int(c)) for c in counts]
    assert found[-1][1] > 50  # states with both statistics above zero occur
    widths = 2 * nu / counts
    limit = np.linalg.solve(widths[:, None] ** np.array([0, 2, 3, 4]), [value for value, _ in found])[0]
    assert arl(nu, h, mu).value == pytest.approx(limit, rel=1e-4)


def test_two_sided_of_a_huge_change_is_the_one_side():
    found = arl(0.5, 5.0, 10.0)
    assert found.value == pytest.approx(arl_integral(0.5, 5.0, 10.0).value, rel=1e-12)
    assert found.value == pytest.approx(arl(0.5, 5.0, -10.0).value, rel=1e-12)
    assert arl(0.5, 5.0, 1.0, sides="down").value == arl_integral(0.5, 5.0, -1.0).value


@pytest.mark.parametrize(("nu", "h", "mu", "sides"), [(0.5, 4, 0, "both"), (0.5, 4, 1, "up"), (0.25, 5, 0, "down")])
def test_simulated_run_length_is_in_its_interval(nu, h, mu, sides):
    runs = simulate_run_lengths(nu, h, mu, sides=sides, runs=8000, rng=np.random.default_rng(11))
    low, high = runs.interval(0.99)
    exact = arl(nu, h, mu, sides=sides).value
    assert low < exact < high
    assert high - low < 0.08 * exact


def test_channels_share_the_false_alarms():
    """First alarm of three independent channels: close to a third, and not below it."""
    rng = np.random.default_rng(5)
    lengths = [simulate_run_lengths(0.5, 4.0, runs=6000, rng=rng).lengths for _ in range(3)]
    first = np.min(lengths, axis=0)
    half = 2.58 * first.std() / math.sqrt(len(first))
    rule = arl(0.5, 4.0, channels=3).value
    assert rule == pytest.approx(arl(0.5, 4.0).value / 3)
    assert rule - half < first.mean() < 1.1 * rule + half


def test_late_change_is_found_sooner():
    """A statistic that has run for 60 healthy samples without alarm, then a step of 1 sigma."""
    rng = np.random.default_rng(8)
    runs, healthy, nu, h = 6000, 60, 0.5, 4.0
    x = rng.standard_normal((healthy + 200, runs))
    x[healthy:] += 1.0
    g, alive, delay = np.zeros(runs), np.ones(runs, dtype=bool), np.zeros(runs)
    for k, row in enumerate(x):
        g = np.maximum(g + row - nu, 0)
        new = alive & (g > h)
        delay[new] = k + 1 - healthy
        alive &= ~new
    assert not alive.any()
    late = delay[delay > 0]
    found = steady_delay(nu, h, 1.0)
    assert found.value == pytest.approx(late.mean(), abs=3 * late.std() / math.sqrt(len(late)))
    assert found.value < arl_integral(nu, h, 1.0).value


def test_cut_runs_give_the_interval_from_the_number_of_alarms():
    full = arl(0.5, 5.0).value
    cut = simulate_run_lengths(0.5, 5.0, runs=2000, limit=100, rng=np.random.default_rng(1))
    assert 1000 < cut.cut < 2000
    low, high = cut.interval(0.99)
    assert low < cut.mean < high
    assert cut.mean == pytest.approx(full, rel=0.15)
    none = simulate_run_lengths(1.0, 9.0, runs=10, limit=10, rng=np.random.default_rng(1))
    assert none.mean == math.inf
    assert none.interval()[1] == math.inf
    assert none.interval()[0] == pytest.approx(100 / 3.689, rel=1e-3)  # 95 % Poisson bound for no event


@pytest.mark.parametrize("function", [siegmund, arl_integral, arl_markov, steady_delay])
def test_wrong_numbers(function):
    with pytest.raises(ParameterError, match=r"\.nu = -1 sigma"):
        function(-1.0, 5.0, 0.0)
    with pytest.raises(ParameterError, match=r"\.h = 0 sigma: must be > 0"):
        function(0.5, 0.0, 0.0)
    with pytest.raises(ParameterError, match=r"\.mu = nan"):
        function(0.5, 5.0, math.nan)


def test_out_of_reach():
    with pytest.raises(ParameterError, match="beyond 1e\\+14, where double precision ends"):
        arl_integral(1.0, 30.0)
    with pytest.raises(ParameterError, match="channels = 0"):
        arl(0.5, 5.0, channels=0)
    with pytest.raises(ParameterError, match="sides = 'x'"):
        arl(0.5, 5.0, sides="x")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="Generator"):
        simulate_run_lengths(0.5, 5.0, rng=3)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="runs = 1"):
        simulate_run_lengths(0.5, 5.0, runs=1, rng=np.random.default_rng(1))
    with pytest.raises(ParameterError, match="fit_ar"):
        simulate_run_lengths(0.5, 5.0, rng=np.random.default_rng(1), model=0.5)  # type: ignore[arg-type]
