"""Residual sets given a healthy block: guarantee, width, signs; parameters that differ from point to point."""

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.steady.enclose import Enclosure, set_model
from pumplib.steady.identify import identify
from pumplib.steady.residual_sets import SIGNATURES, ReferenceSets, gathered_signs, named_by_signs
from pumplib.steady.sets import box, own_columns
from pumplib.steady.windows import WindowTest
from tests.steady.cases import BOX, ERRORS, MOTOR, RELATIONS, RELATIVE, VALUES, correlated, machine, measured

LARGE = {"K_f": 3e10, "dB": 1e-3, "K_l": 3e-7, "f_c": 0.15, "f_d": 0.6}


def sets_of(rng, truth, bias, count=8, **faults):
    reference = measured(rng, 20, truth, bias)
    recent = measured(rng, count, truth, bias, **faults)
    model = set_model(RELATIONS, BOX, ERRORS)
    return ReferenceSets(WindowTest(model, reference)).enclose(recent), model.enclose(recent)


def test_zero_is_in_every_set_of_healthy_machines_and_the_block_narrows_them():
    shares = []
    for seed in range(12):
        rng = np.random.default_rng([5, seed])
        tight, wide = sets_of(rng, *machine(rng))
        assert not tight.alarm.any()
        # what the parameter set alone allows is no narrower
        assert (tight.lo >= wide.lo - 1e-6 * wide.width).all()
        assert (tight.hi <= wide.hi + 1e-6 * wide.width).all()
        shares.append(np.median(tight.width / wide.width, axis=0))
    assert np.median(shares, axis=0).max() < 0.35


@pytest.mark.parametrize("fault", list(LARGE))
def test_signs_of_large_faults_are_those_of_the_table(fault):
    rng = np.random.default_rng(31)
    sets, _ = sets_of(rng, *machine(rng), **{fault: LARGE[fault]})
    signs = gathered_signs(sets)
    assert signs == SIGNATURES[fault]
    middle = 0.5 * (sets.lo[0, 0] + sets.hi[0, 0])
    # R1 = H - f_H, so the lost share of the head is -R1 / (H - R1)
    level = 0.6 if fault == "f_d" else 0.15
    assert middle < 0 or fault == "dB"
    assert named_by_signs(signs, level) == fault


def test_a_set_is_never_narrower_than_what_one_machine_can_show():
    # the residual at the true errors is zero for every machine that explains the block: the truth itself is one of them
    rng = np.random.default_rng(8)
    truth, bias = machine(rng)
    tight, _ = sets_of(rng, truth, bias, count=30)
    assert (tight.lo < 0).all()
    assert (tight.hi > 0).all()


def test_r3_is_the_whole_line_where_the_head_is_above_the_map():
    rng = np.random.default_rng(3)
    truth, bias = machine(rng)
    reference, recent = measured(rng, 20, truth, bias), measured(rng, 2, truth, bias)
    recent["H"] = recent["H"] * np.array([1.0, 1.6])
    sets = ReferenceSets(WindowTest(set_model(RELATIONS, BOX, ERRORS), reference)).enclose(recent)
    assert np.isfinite(sets.lo[0]).all()
    assert sets.lo[1, 2] == -np.inf
    assert sets.hi[1, 2] == np.inf
    assert sets.sign[1, 0] == 1  # a head that no pump gives


def test_sets_need_a_healthy_block():
    with pytest.raises(ParameterError, match="no healthy block"):
        ReferenceSets(WindowTest(set_model(RELATIONS, BOX, ERRORS)))


def enclosure(*rows):
    """Sets from signs."""
    signs = np.array(rows, dtype=float)
    return Enclosure(outputs=("R1", "R2", "R3"), lo=signs - 0.5, hi=signs + 0.5, method="affine")


def test_signs_are_gathered_over_points_and_contradictions_named():
    assert gathered_signs(enclosure((-1, 0, 0), (0, 1, 0))) == (-1, 1, 0)
    assert gathered_signs(enclosure((0, 0, 0))) == (0, 0, 0)
    assert gathered_signs(enclosure((-1, 0, 0), (1, 0, 0))) is None


@pytest.mark.parametrize(
    ("signs", "level", "name"),
    [
        ((-1, 0, -1), 0.1, "K_f"), ((0, 1, 1), 0.0, "dB"), ((-1, 1, 0), 0.1, "K_l"), ((-1, -1, -1), 0.2, "f_c"),
        ((-1, -1, -1), 0.5, "f_d"), ((-1, -1, 0), 0.5, "f_d"), ((0, 0, -1), 0.1, "K_f"),
        ((-1, 0, 0), 0.1, ""),  # clogging or leakage
        ((0, 1, 0), 0.0, ""),  # friction or leakage
        ((1, 0, 0), 0.0, ""), ((0, 0, 0), 0.0, ""), (None, 0.0, ""),
    ],
)  # fmt: skip
def test_names(signs, level, name):
    assert named_by_signs(signs, level) == name


def test_names_refuse_a_level_that_is_no_number():
    with pytest.raises(DataError, match="lost share"):
        named_by_signs((-1, 0, -1), float("nan"))


def test_parameters_of_their_own_let_points_differ():
    rng = np.random.default_rng(12)
    truth, bias = machine(rng)
    wide = box(VALUES, relative=RELATIVE | {"R_r_prime": 0.2})
    model = set_model(RELATIONS, wide, ERRORS)
    # every second point with the rotor resistance at the other end
    ends = [measured(rng, 10, truth | {"R_r_prime": VALUES["R_r_prime"] * f}, bias) for f in (0.81, 1.19)]
    points = {name: np.concatenate([one[name] for one in ends]) for name in ends[0]}
    assert WindowTest(model).test(points, ("none",)).fault
    assert not WindowTest(model, own=("R_r_prime",)).test(points, ("none",)).fault


def test_own_parameters_are_checked():
    assert own_columns(BOX, ("r_s",)) == [0]
    assert own_columns(BOX, ("G_core",)) == []
    with pytest.raises(ParameterError, match="R_x unknown"):
        own_columns(BOX, ("R_x",))
    with pytest.raises(ParameterError, match="a_h0 are correlated with a_h1, a_h2"):
        own_columns(correlated(), ("a_h0",))
    rng = np.random.default_rng(4)
    with pytest.raises(ParameterError, match="own = a_h0"):
        identify(MOTOR, VALUES, measured(rng, 12, *machine(rng)), ERRORS, own=("a_h0",))
