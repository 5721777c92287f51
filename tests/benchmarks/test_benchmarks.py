"""The benchmarks compare like with like; nothing here looks at a time."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks import case, peer_c, peer_motulator, peer_scipy
from benchmarks.timing import Times, interleaved, ratio
from pumplib.plant import coefficients, simulate
from pumplib.plant.kernels import derivatives_along
from pumplib.workbook.claims import load_claims
from pumplib.workbook.collect import load_measured

needs_compiler = pytest.mark.skipif(peer_c.compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def machine():
    return case.reference_set()


@pytest.mark.parametrize("make", [peer_scipy.python_rhs, peer_scipy.compiled_rhs])
def test_scipy_right_hand_sides_equal_ours(machine, make):
    supply, rng, n = case.supply(), np.random.default_rng(7), 50
    size = np.array([30.0, 30.0, 3.0, 3.0, 300.0, 1e-5, 2e-3])
    x, t = rng.uniform(-1, 1, (n, 7)) * size, rng.uniform(0, 1, n)
    angle = 2 * np.pi * supply.rated_frequency * t
    v_d, v_q = supply.amplitude * np.cos(angle), supply.amplitude * np.sin(angle)
    expected = np.empty_like(x)
    K_v = np.full(n, machine.application.K_v)
    derivatives_along(x, v_d, v_q, K_v, np.zeros(n), coefficients(machine), expected)
    rhs = make(machine, supply)
    found = np.array([rhs(float(t[k]), x[k].copy()) for k in range(n)])
    np.testing.assert_allclose(found / np.abs(expected).max(0), expected / np.abs(expected).max(0), atol=1e-12)


def test_kernel_inputs_are_those_of_simulate(machine):
    u, x, out = case.inputs(machine, 0.01), np.zeros(7), np.empty((100, 7))
    peer_c.run_one(x, u.v_d, u.v_q, u.K_v, u.T_load, case.STEP, 1, coefficients(machine), out)
    expected = simulate(machine, case.supply(), duration=0.01, step=case.STEP).x[1:]
    assert peer_c.difference(out, expected) < 1e-13


@needs_compiler
def test_c_equals_numba_for_one_machine(machine):
    for c in (coefficients(machine), coefficients(machine, reciprocal=True)):
        one = peer_c.scalar_calls(case.inputs(machine, 0.3), c)
        for call, _ in one.values():
            call()
        for _, states in one.values():
            assert peer_c.difference(states(), one["pumplib"][1]()) < 1e-12


@needs_compiler
def test_c_equals_numba_for_many_machines(machine):
    sets = case.varied(machine, 70, np.random.default_rng(3))  # no multiple of any block width
    many = peer_c.batch_calls(case.inputs(machine, 0.05), sets, every=100)
    for call, _ in many.values():
        call()
    ours = many["pumplib"][1]()
    assert ours.shape == (5, 70, 7)
    assert np.ptp(ours[-1, :, 4]) > 1  # the machines differ
    for _, states in many.values():
        assert peer_c.difference(states(), ours) < 1e-12


@pytest.mark.skipif(peer_motulator.missing() is not None, reason=str(peer_motulator.missing()))
def test_motulator_gives_the_same_start(machine, monkeypatch):
    monkeypatch.setattr(peer_motulator, "DURATION", 0.02)
    monkeypatch.setattr(peer_motulator, "SAMPLES", 200)
    current, speed = peer_motulator.samples(peer_motulator.simulate(machine, case.supply()))
    ours = simulate(machine, case.supply(), duration=0.02, step=1e-5, every=10, flow=False, leakage=False)
    assert np.abs(current - ours.i_s).max() < 1e-5
    assert np.abs(speed - ours.omega).max() < 1e-5


def test_loosest_tolerance_meets_the_error(machine):
    rhs = peer_scipy.compiled_rhs(machine, case.supply())
    reference = simulate(machine, case.supply(), duration=1.0, step=1e-5, every=10).x
    setting = peer_scipy.loosest(rhs, "DOP853", 1e-2, reference, per_state=True)
    assert setting.per_state
    assert setting.error <= 1e-2
    looser = peer_scipy.Setting("DOP853", 3 * setting.rtol, 3 * setting.atol)
    assert peer_scipy.current_error(peer_scipy.solve(rhs, looser), reference) > 1e-2


def test_interleaved_takes_turns():
    seen: list[str] = []
    times = interleaved({"a": lambda: seen.append("a"), "b": lambda: seen.append("b")}, rounds=4)
    assert "".join(seen) == "aabb" + "abbaabba"
    assert len(times["a"].rounds) == 4
    slow, quick = Times((2.0, 4.0, 9.0)), Times((1.0, 2.0, 3.0))
    assert ratio(slow, quick) == (2.0, 2.0, 3.0)


def test_written_file_is_what_the_ledger_reads(tmp_path: Path, monkeypatch, capsys):
    def quick(rounds: int, seed: int):
        entry = {"value": 300.0, "note": f"{rounds} rounds, seed {seed}", "details": {"times": {}}}
        return {"perf.scipy": entry, "perf.c": {"reason": "no C compiler on this machine"}}

    monkeypatch.setattr(command, "MEASUREMENTS", {"scipy": (quick, ("perf.scipy", "perf.c"))})
    monkeypatch.setattr(command, "GROUPS", {"benchmarks": ("scipy",)})
    monkeypatch.setattr(command, "FOLDER", tmp_path)
    assert command.main(["--write", "--date", "2030-01-02", "--seed", "5", "--rounds", "2"]) == 0
    printed = capsys.readouterr().out
    assert "holds" in printed
    assert "not run" in printed
    content = json.loads((tmp_path / "benchmarks.json").read_text(encoding="utf-8"))
    assert set(content) == {"date", "machine", "versions", "seed", "claims", "details"}
    assert content["date"] == "2030-01-02"
    assert content["seed"] == 5
    assert set(content["claims"]) == {"perf.scipy"}
    assert set(content["details"]) == {"perf.scipy", "perf.c"}
    assert {"cpu", "cores", "os"} <= set(content["machine"])
    assert {"python", "numpy", "numba", "scipy", "motulator", "c_compiler"} <= set(content["versions"])
    measured = load_measured(tmp_path, load_claims())
    assert measured["perf.scipy"][0].value == 300.0


def test_an_error_is_shown_and_nothing_written(tmp_path: Path, monkeypatch, capsys):
    def broken(rounds: int, seed: int):
        raise RuntimeError("C and numba differ")

    monkeypatch.setattr(command, "MEASUREMENTS", {"c": (broken, ("perf.c",))})
    monkeypatch.setattr(command, "GROUPS", {"benchmarks": ("c",)})
    monkeypatch.setattr(command, "FOLDER", tmp_path)
    assert command.main(["--write"]) == 1
    assert "C and numba differ" in capsys.readouterr().out
    assert not (tmp_path / "benchmarks.json").exists()


def test_every_claim_that_is_measured_here_is_in_the_ledger():
    ledger = load_claims()
    ours = [claim for _, claims in command.MEASUREMENTS.values() for claim in claims]
    assert {ledger[name].source for name in ours} == {"measured"}
    assert {name for name in ledger if name.startswith("perf.")} <= set(ours)


def test_a_group_is_written_alone(tmp_path: Path, monkeypatch):
    def one(claim: str):
        return lambda rounds, seed: {claim: {"value": 1.0, "note": "", "details": {}}}

    monkeypatch.setattr(
        command, "MEASUREMENTS", {"c": (one("perf.c"), ("perf.c",)), "mso": (one("ch6.mso_time"), ("ch6.mso_time",))}
    )
    monkeypatch.setattr(command, "GROUPS", {"chapters": ("mso",), "benchmarks": ("c",)})
    monkeypatch.setattr(command, "FOLDER", tmp_path)
    assert command.main(["--write", "--group", "chapters"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["chapters.json"]
    assert command.main(["--write"]) == 0
    assert set(load_measured(tmp_path, load_claims())) == {"perf.c", "ch6.mso_time"}


def test_every_measurement_belongs_to_one_group():
    assert sorted(name for group in command.GROUPS.values() for name in group) == sorted(command.MEASUREMENTS)
