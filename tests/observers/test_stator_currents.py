"""Thesis 5.3: shorts from line currents alone: made-up records, and the ITSC measurements where they are present."""

import re

import numpy as np
import pytest

from pumplib import datasets
from pumplib.errors import DataError, ParameterError
from pumplib.motor.frames import PHASE_AXES
from pumplib.observers.stator_currents import (
    Convention,
    current_reference,
    detect_short,
    fundamental,
    score_currents,
)

RATE = 1000.0
SUSPECT = {"A1_002", "A1_005", "B1_005", "B2_002", "B2_005"}  # look mislabelled, scored apart
LEVELS = re.compile(r"SC_A(\d)_B(\d)_C(\d)_(\d+)\.csv")


def record(I_1, I_2, f=60.0, seconds=1.0, start=0.0, offset=(0.0, 0.0, 0.0), noise=0.0, seed=0):
    """Three currents of given sequence phasors."""
    turn = np.exp(2j * np.pi * f * (start + np.arange(round(seconds * RATE)) / RATE))
    phasors = I_1 * PHASE_AXES.conj() + I_2 * PHASE_AXES
    made = np.real(turn[:, None] * phasors) + np.array(offset)
    return made + noise * np.random.default_rng(seed).standard_normal(made.shape)


@pytest.mark.parametrize("f", [59.3, 60.0, 60.07, 60.9])
def test_fundamental_is_exact_without_noise(f):
    found = fundamental(record(3 * np.exp(1j), 0.2 * np.exp(-2j), f, offset=(0.1, -0.3, 0.2)), RATE, 60.0)
    assert found.frequency == pytest.approx(f, rel=1e-6)
    assert found.q == pytest.approx(0.2 / 3 * np.exp(-3j), rel=1e-5)
    assert abs(found.I_1) == pytest.approx(3.0, rel=1e-6)
    assert found.rest < 1e-4


def test_origin_of_time_and_harmonics_drop_out():
    plain = fundamental(record(3.0, 0.2j), RATE, 60.0)
    later = fundamental(record(3.0, 0.2j, start=0.0371), RATE, 60.0)
    assert later.q == pytest.approx(plain.q, rel=1e-5)
    harmonic = record(3.0, 0.2j) + record(0.0, 0.1, f=300.0) + record(0.08, 0.0, f=420.0)
    assert fundamental(harmonic, RATE, 60.0).q == pytest.approx(plain.q, abs=2e-5)


@pytest.mark.parametrize("k", [0, 1, 2])
@pytest.mark.parametrize("size", [0.06, 0.2, 0.4])
def test_phase_and_severity_of_made_up_shorts(k, size):
    rule = Convention()
    healthy = [record(2.8, 0.05 * np.exp(1j * a), noise=0.02, seed=3) for a in (0.0, 0.3)]
    reference = current_reference(healthy, RATE)
    angle = rule.offset - rule.turn * size + 2 * np.pi / 3 * k
    grown = 2.8 * (1 + size)
    q = reference.q + size * np.exp(1j * angle) * 2.8 / grown
    found = score_currents(reference, record(grown * np.exp(0.4j), q * grown * np.exp(0.4j), noise=0.02), RATE)
    assert found.detected
    assert found.phase == "abc"[k]
    assert found.severity == pytest.approx(rule.share * size, rel=0.05)
    assert abs(found.angle) < 0.1


def test_healthy_record_is_not_detected():
    healthy = [record(2.8, 0.05 + 0.01j * n, noise=0.02, seed=n) for n in range(3)]
    found = detect_short(healthy, record(2.8, 0.055, noise=0.02, seed=9), RATE)
    assert not found.detected
    assert current_reference(healthy, RATE).spread == pytest.approx(1.5 * 0.01 / 2.8, rel=0.2)
    assert np.isnan(current_reference(healthy[0], RATE).spread)
    assert detect_short(healthy[0], healthy[0], RATE).severity < 1e-9


def test_bad_records():
    good = record(3.0, 0.1)
    with pytest.raises(DataError, match=r"shape \(1000, 2\)"):
        fundamental(good[:, :2], RATE, 60.0)
    bad = good.copy()
    bad[4, 2] = np.nan
    with pytest.raises(DataError, match="i_c at sample 4"):
        fundamental(bad, RATE, 60.0)
    with pytest.raises(DataError, match="periods"):
        fundamental(good[:40], RATE, 60.0)
    dead = good.copy()
    dead[:, 1] = 0.3
    with pytest.raises(DataError, match="i_b carries"):
        fundamental(dead, RATE, 60.0)
    with pytest.raises(DataError, match="swapped"):
        fundamental(good[:, [0, 2, 1]], RATE, 60.0)
    with pytest.raises(DataError, match="sampling rate"):
        fundamental(good, 2 * RATE, 60.0)
    with pytest.raises(ParameterError, match="rate"):
        fundamental(good, 0.0, 60.0)
    with pytest.raises(ParameterError, match="frequency"):
        fundamental(good, RATE, 499.0)
    with pytest.raises(DataError, match="at least one"):
        current_reference([], RATE)
    with pytest.raises(ParameterError, match=r"Convention\.threshold"):
        Convention(threshold=0.0)


@pytest.fixture(scope="module")
def itsc():
    try:
        paths = datasets.files("itsc")
    except DataError as error:
        pytest.skip(f"ITSC currents are absent: {error}")
    return {path.name: np.loadtxt(path, delimiter=",") for path in paths}


def test_itsc_faults_are_found(itsc):
    """The convention was fixed on repetitions 001 and 002; further repetitions are scored where they are present."""
    reference = current_reference([x for name, x in itsc.items() if "HLT" in name], RATE)
    assert reference.spread < reference.convention.threshold
    severities: dict[int, list[float]] = {}
    right = total = 0
    for name, x in itsc.items():
        match = LEVELS.match(name)
        if not match:
            continue
        levels = [int(one) for one in match.groups()[:3]]
        k = int(np.argmax(levels))
        if f"{'ABC'[k]}{levels[k]}_{match[4]}" in SUSPECT:
            continue
        found = score_currents(reference, x, RATE)
        total += 1
        right += found.phase == "abc"[k]
        assert found.detected, name
        severities.setdefault(levels[k], []).append(found.severity)
    assert total >= 22
    assert right >= total - total // 30
    means = [np.mean(severities[level]) for level in (1, 2, 3, 4)]
    np.testing.assert_allclose(means, [0.1, 0.2, 0.3, 0.4], atol=0.035)
