"""Set membership over windows: no false alarm, truth among the hypotheses, sizes bounded, gain by the healthy block."""

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.steady.enclose import set_model
from pumplib.steady.membership import Program, Rows, Sizes
from pumplib.steady.operating import steady_points, v_f_voltage
from pumplib.steady.sets import MeasurementErrors, box
from pumplib.steady.windows import HYPOTHESES, WindowTest
from tests.steady.cases import BOX, ERRORS, MOTOR, RELATIONS, VALUES, grid, machine, measured

MODEL = set_model(RELATIONS, BOX, ERRORS)
SIZES = {"K_f": 3e9, "dB": 2.5e-4, "K_l": 4e-8, "f_c": 0.012, "f_d": 0.5}


def test_margin_and_range_of_a_small_program() -> None:
    # |zeta - 2| <= 0.5 cannot hold with |zeta| <= 1: margin 1; |zeta - 0.9| <= 0.2 leaves zeta in [0.7, 1]
    value, proven = Program(Rows(c=np.array([-2.0]), k=np.array([[1.0]]), r=np.array([0.5]))).margin()
    assert value == pytest.approx(1.0, abs=1e-9)
    assert proven == pytest.approx(1.0, abs=1e-9)
    low, high = Program(Rows(c=np.array([-0.9]), k=np.array([[1.0]]), r=np.array([0.2]))).extreme(np.array([1.0]))
    assert (low, high) == pytest.approx((0.7, 1.0), abs=1e-8)
    assert low <= 0.7 <= 1.0 <= high
    # an effect s with uncertainty: |0 - s| <= 0.1 + 0.5 s allows s up to 0.2
    sizes = Sizes(d=np.array([[1.0]]), q=np.array([[0.5]]), low=np.zeros(1), high=np.full(1, 1e-3))
    program = Program(Rows(c=np.zeros(1), k=np.zeros((1, 1)), r=np.array([1e-4])), sizes)
    assert program.extreme(np.array([0.0, 1.0])) == pytest.approx((0.0, 2e-4), abs=1e-12)


def test_healthy_windows_never_alarm() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        truth, bias = machine(rng)
        tester = WindowTest(MODEL, measured(rng, 12, truth, bias))
        found = tester.test(measured(rng, 6, truth, bias), ("none",))
        assert not found.fault
        assert found.verdicts["none"].margin < 0


@pytest.mark.parametrize("fault", SIZES)
def test_the_true_fault_is_found_is_possible_and_its_size_enclosed(fault: str) -> None:
    rng = np.random.default_rng(2)
    size = SIZES[fault]
    for _ in range(3):
        truth, bias = machine(rng)
        tester = WindowTest(MODEL, measured(rng, 16, truth, bias))
        found = tester.test(measured(rng, 6, truth, bias, **{fault: size}))
        assert found.fault
        assert fault in found.possible
        span = found.verdicts[fault].size
        assert span is not None
        assert span[0] <= size <= span[1]
        if fault in ("K_f", "dB", "K_l"):
            assert span[1] - span[0] < 1.5 * size


def test_large_leakage_is_enclosed_to_second_order() -> None:
    rng = np.random.default_rng(3)
    truth, bias = machine(rng)
    tester = WindowTest(MODEL, measured(rng, 12, truth, bias))
    for size in (3e-7, 1e-6):
        found = tester.test(measured(rng, 4, truth, bias, K_l=size)).verdicts["K_l"]
        assert found.possible
        assert found.size[0] <= size <= found.size[1]


def test_the_healthy_block_finds_what_single_samples_do_not() -> None:
    rng = np.random.default_rng(4)
    alone = with_block = single = 0
    for _ in range(6):
        truth, bias = machine(rng)
        healthy, recent = measured(rng, 20, truth, bias), measured(rng, 6, truth, bias, K_f=2e9)
        single += MODEL.enclose(recent).alarm.any()
        alone += WindowTest(MODEL).test(recent, ("none",)).fault
        with_block += WindowTest(MODEL, healthy).test(recent, ("none",)).fault
    assert with_block == 6
    assert single <= alone <= 3


def test_a_margin_is_room() -> None:
    rng = np.random.default_rng(5)
    truth, bias = machine(rng)
    healthy, recent = measured(rng, 12, truth, bias), measured(rng, 4, truth, bias, dB=2e-4)
    strict, loose = (WindowTest(MODEL, healthy, margin=m).test(recent, ("none",)) for m in ((0, 0), (0.0, 0.5)))
    assert strict.fault
    assert not loose.fault


def test_a_parameter_that_changes_between_the_blocks_raises_no_alarm_if_it_is_said() -> None:
    exact = MeasurementErrors()
    model = set_model(RELATIONS, box(VALUES, relative={"r_s": 0.08}), exact)
    warm, cold = ({**VALUES, "r_s": VALUES["r_s"] * f} for f in (1.07, 0.93))
    hertz = np.array([30.0, 40.0, 50.0])
    blocks = [
        steady_points(MOTOR, v, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=2e11).signals for v in (warm, cold)
    ]
    assert WindowTest(model, blocks[0]).test(blocks[1], ("none",)).fault
    assert not WindowTest(model, blocks[0], changing=("r_s",)).test(blocks[1], ("none",)).fault
    with pytest.raises(ParameterError, match="r_x"):
        WindowTest(model, changing=("r_x",))


def test_wrong_inputs_are_refused() -> None:
    signals = grid(2).signals
    with pytest.raises(ParameterError, match="margin"):
        WindowTest(MODEL, signals, margin=(-1.0, 0.0))
    with pytest.raises(ParameterError, match="rust"):
        WindowTest(MODEL, signals).test(signals, ("rust",))
    with pytest.raises(ParameterError, match="largest"):
        WindowTest(MODEL, signals, largest={"K_f": 0.0})
    with pytest.raises(DataError, match="finite"):
        WindowTest(MODEL, signals | {"Q": np.full(4, np.nan)})
    assert len(HYPOTHESES) == 6
