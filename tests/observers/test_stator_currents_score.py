"""Thesis 5.3: a folder of labelled currents is scored: made-up folders, and the ITSC records where they are present."""

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pumplib import datasets
from pumplib.errors import DataError, ParameterError
from pumplib.machines import load_motor
from pumplib.motor.frames import PHASE_AXES
from pumplib.observers.stator_currents import Convention, current_reference
from pumplib.observers.stator_currents_score import (
    SUSPECTS,
    cross_check,
    fit_convention,
    read_currents,
    score_folder,
    score_records,
    spread_within,
    unbalance_gain,
)

RATE, CURRENT, HEALTHY = 1000.0, 2.8, -0.02 + 0.01j
RULE = Convention()


def write(path: Path, d: complex, rng: np.random.Generator, noise: float = 0.02) -> None:
    """A record whose difference to the healthy one is d, on the scale of the healthy current."""
    turn = np.exp(2j * np.pi * (60.0 * np.arange(600) / RATE + rng.random()))
    grown = CURRENT * (1 + 0.8 * abs(d))
    q = HEALTHY + d * CURRENT / grown
    x = np.real(turn[:, None] * grown * (PHASE_AXES.conj() + q * PHASE_AXES))
    np.savetxt(path, x + noise * rng.standard_normal(x.shape), delimiter=",")


def short(phase: int, level: int) -> complex:
    size = 0.1 * level / RULE.share
    return size * np.exp(1j * (RULE.offset - RULE.turn * size + 2 * np.pi / 3 * phase))


def fill(folder: Path, repetitions: tuple[int, ...], levels: tuple[int, ...] = (1, 2, 3, 4)) -> Path:
    rng = np.random.default_rng(5)
    folder.mkdir(exist_ok=True)
    for repetition in repetitions:
        off = 0.01 * np.exp(2j * np.pi * repetition / 5)
        write(folder / f"SC_HLT_{repetition:03d}.csv", off, rng)
        for phase in range(3):
            for level in levels:
                at = [0, 0, 0]
                at[phase] = level
                name = f"SC_A{at[0]}_B{at[1]}_C{at[2]}_{repetition:03d}.csv"
                write(folder / name, short(phase, level) + off, rng)
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return fill(tmp_path_factory.mktemp("currents"), (1, 2, 3, 4, 5), (1, 2, 4))


@pytest.fixture(scope="module")
def scored(made):
    return score_folder(made, RATE)


def test_labels_are_read_and_sorted(made):
    records = read_currents(made)
    assert len(records) == 50
    assert [one.name for one in records[:6]] == ["HLT_001", "HLT_002", "HLT_003", "HLT_004", "HLT_005", "A1_001"]
    one = next(record for record in records if record.name == "B2_005")
    assert (one.phase, one.level, one.repetition, one.suspect, one.unseen) == ("b", 2, 5, True, True)
    assert {record.name for record in records if record.suspect} == SUSPECTS
    assert not any(record.unseen for record in records if record.repetition in (1, 2))


def test_unseen_repetitions_are_counted_apart_and_the_reference_does_not_see_them(scored):
    assert scored.learnt_from == ("HLT_001", "HLT_002")
    assert scored.repetitions == (1, 2, 3, 4, 5)
    unseen = scored.count(unseen=True)
    assert (unseen.faults, unseen.found, unseen.phase_right, unseen.diagnosed) == (27, 27, 27, 27)
    assert (unseen.healthy, unseen.false_alarms) == (3, 0)
    assert unseen.share_found == 1.0
    assert scored.count(unseen=True, suspect=False).faults == 24
    assert scored.count(unseen=False).faults == 18
    assert scored.count(suspect=True).faults == 5
    everything = scored.count()
    assert everything.faults + everything.healthy == len(scored.rows) == 50
    assert everything.severity_rms < 0.02
    assert list(scored.groups())[:3] == ["convention", "convention, suspect files", "convention, with suspect files"]
    assert scored.groups()["unseen"] == scored.count(unseen=True, suspect=False)


def test_more_repetitions_change_no_verdict(made, scored, tmp_path):
    for path in made.glob("*_00[12].csv"):
        shutil.copy(path, tmp_path)
    few = score_folder(tmp_path, RATE)
    known = {row.record.name: row.verdict for row in scored.rows}
    assert few.rows
    assert all(row.verdict == known[row.record.name] for row in few.rows)
    assert set(few.groups()) == {"convention", "convention, suspect files", "convention, with suspect files"}
    assert few.restrict("convention").rows == few.rows
    with pytest.raises(DataError, match="no unseen repetition: present are 1, 2"):
        few.restrict("unseen")
    with pytest.raises(ParameterError, match="'all', 'convention', 'unseen'"):
        few.restrict("new")
    assert math.isnan(few.restrict("convention").count(unseen=True).share_found)


def test_wrong_labels_are_counted_as_errors(made, tmp_path):
    """Negative control: a healthy current named a short is missed, a short of b named c is a wrong phase."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    shutil.copy(made / "SC_HLT_003.csv", tmp_path / "SC_A4_B0_C0_003.csv")
    shutil.copy(made / "SC_A0_B4_C0_003.csv", tmp_path / "SC_A0_B0_C4_003.csv")
    shutil.copy(made / "SC_A0_B4_C0_003.csv", tmp_path / "SC_HLT_004.csv")
    score = score_folder(tmp_path, RATE)
    unseen = score.count(unseen=True)
    assert (unseen.faults, unseen.found, unseen.diagnosed, unseen.false_alarms) == (27, 26, 25, 1)
    table = score.confusion(unseen=True)
    assert (table[0, 3], table[2, 1], table[3, 1], table.sum()) == (1, 1, 1, 27)
    assert np.trace(table) == 24
    assert score.restrict("unseen").worst_angle() > np.pi / 3 > score.restrict("convention").worst_angle()


def test_a_healthy_record_is_not_judged_by_itself(scored):
    first = scored.rows[0]
    others = current_reference([scored.rows[1].record.currents], RATE)
    assert first.record.name == "HLT_001"
    assert first.verdict.difference == pytest.approx(
        (first.verdict.phasors.q - others.q) * abs(first.verdict.phasors.I_1) / others.current
    )
    assert first.size == pytest.approx(scored.reference.spread, rel=0.02)
    third = scored.rows[2]
    assert third.verdict.difference == pytest.approx(
        (third.verdict.phasors.q - scored.reference.q) * abs(third.verdict.phasors.I_1) / scored.reference.current
    )


def test_reference_from_elsewhere_or_from_other_repetitions(made, scored):
    records = [one for one in read_currents(made) if one.unseen]
    alone = score_records(records, RATE)
    assert alone.learnt_from == ("HLT_003", "HLT_004", "HLT_005")
    given = score_records([one for one in records if one.phase], RATE, reference=scored.reference)
    assert given.learnt_from == ()
    assert [r.verdict for r in given.rows] == [r.verdict for r in scored.select(unseen=True) if r.record.phase]
    assert score_records(records, RATE, learn=(3, 5)).learnt_from == ("HLT_003", "HLT_005")
    with pytest.raises(DataError, match=r"repetitions 1, 2 are to be learnt from, present are 3, 4, 5"):
        score_records(records, RATE, learn=(1, 2))
    with pytest.raises(DataError, match="two or more"):
        score_records(records, RATE, learn=(3,))
    with pytest.raises(DataError, match="present are none"):
        score_records([one for one in records if one.phase], RATE)
    with pytest.raises(ParameterError, match="brings its convention"):
        score_records(records, RATE, reference=scored.reference, convention=RULE)


def test_convention_is_found_again_whatever_it_was_scored_with(made, scored):
    for score in (scored, score_folder(made, RATE, convention=replace(RULE, threshold=0.3, offset=-2.0, share=5.0))):
        found = fit_convention(score)
        assert found.offset == pytest.approx(RULE.offset, abs=0.06)
        assert found.turn == pytest.approx(RULE.turn, abs=0.2)
        assert found.share == pytest.approx(RULE.share, rel=0.02)
        healthy = [row.size for row in score.select(unseen=False) if not row.record.phase]
        shorts = [row.size for row in score.select(unseen=False, suspect=False) if row.record.phase]
        assert max(healthy) < found.threshold < min(shorts)
        assert found.threshold / max(healthy) == pytest.approx(min(shorts) / found.threshold)
    constant = fit_convention(scored, straight=False)
    assert constant.turn == 0.0
    assert RULE.offset - RULE.turn * 0.4 < constant.offset < RULE.offset
    straight, bent = (score_folder(made, RATE, convention=rule).worst_angle() for rule in (RULE, constant))
    assert straight < 0.5 * bent


def test_cross_check_judges_the_other_repetition(made):
    records = read_currents(made)
    found = cross_check(records, RATE)
    assert list(found) == ["fitted to 1, judged on 2", "fitted to 2, judged on 1"]
    first, second = found.values()
    assert (first.faults, second.faults) == (7, 9)  # two suspect files in repetition 2
    assert (first.diagnosed, second.diagnosed) == (7, 9)
    assert (first.healthy, second.healthy) == (1, 1)
    # negative control: with the phases of repetition 2 renamed, what was fitted to one is wrong for the other
    turned = [
        replace(one, phase={"a": "b", "b": "c", "c": "a", "": ""}[one.phase]) if one.repetition == 2 else one
        for one in records
    ]
    assert all(count.diagnosed == 0 for count in cross_check(turned, RATE).values())


def test_fit_needs_all_phases_and_a_gap(made, scored):
    rows = tuple(row for row in scored.rows if row.record.phase != "c")
    with pytest.raises(DataError, match="all three phases"):
        fit_convention(replace(scored, rows=rows))
    with pytest.raises(DataError, match="healthy records"):
        fit_convention(replace(scored, rows=tuple(row for row in scored.rows if row.record.phase)))
    loud = replace(scored.rows[0], verdict=replace(scored.rows[0].verdict, difference=0.2 + 0j))
    with pytest.raises(DataError, match="no threshold lies between"):
        fit_convention(replace(scored, rows=(loud, *scored.rows[1:])))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("notes.csv", "1,2,3\n", "carries no label"),
        ("SC_A1_B2_C0_001.csv", "1,2,3\n", "exactly one phase"),
        ("SC_A0_B0_C0_001.csv", "1,2,3\n", "exactly one phase"),
        ("SC_A1_B0_C0_009.csv", "1,2\n", "2 columns"),
        ("SC_A1_B0_C0_009.csv", "a,b,c\n", "not a table of numbers"),
        ("deeper/SC_HLT_001.csv", "1,2,3\n", "HLT_001 is there more than once"),
    ],
)
def test_bad_files_are_named(made, tmp_path, name, text, words):
    shutil.copy(made / "SC_HLT_001.csv", tmp_path)
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=words):
        read_currents(tmp_path)


def test_bad_folder_and_bad_record(made, tmp_path):
    with pytest.raises(DataError, match="no folder with CSV files"):
        read_currents(tmp_path)
    with pytest.raises(DataError, match="no folder with CSV files"):
        read_currents(tmp_path / "absent")
    records = read_currents(made)
    dead = replace(records[7], currents=records[7].currents * [1.0, 1.0, 0.0])
    with pytest.raises(DataError, match=rf"{dead.name}: i_c carries"):
        score_records([*records[:5], dead], RATE)
    broken = replace(records[0], currents=np.full_like(records[0].currents, np.nan))
    with pytest.raises(DataError, match="HLT_001: i_a at sample 0"):
        score_records([broken, *records[1:]], RATE)
    with pytest.raises(ParameterError, match="rate"):
        score_records(records, -1.0)


def test_spread_within_a_record(made):
    record = read_currents(made)[0]
    # per window of 150 samples each phasor has the variance 2 s^2 (2/n)/3, of which q takes the share 1/I^2
    expected = 0.02 * math.sqrt(4 / (3 * 150)) / CURRENT
    assert spread_within(record, RATE) == pytest.approx(expected, rel=0.6)
    clean = replace(record, currents=record.currents * [1.0, 1.0, 1.0])
    clean.currents[300:, 0] *= 1.06  # a change inside the record shows
    assert spread_within(clean, RATE) > 5 * spread_within(record, RATE)
    with pytest.raises(ParameterError, match="windows"):
        spread_within(record, RATE, windows=1)
    with pytest.raises(DataError, match="HLT_001: 20 samples"):
        spread_within(record, RATE, windows=30)


@pytest.mark.parametrize("name", ["reference_1k5", "im_2k2", "im_18k5"])
def test_unbalance_gain_by_the_circuit(name):
    """Impedances of the T circuit at slip 0 and 2 in phasor form, written down independently of the dq model."""
    motor = load_motor(name)
    omega = 2 * np.pi * 50.0
    rotor = motor.r_r / 2 + 1j * omega * motor.L_lr
    magnetising = 1j * omega * motor.L_m
    stator = motor.r_s + 1j * omega * motor.L_ls
    negative = stator + magnetising * rotor / (magnetising + rotor)
    assert unbalance_gain(motor, 50.0) == pytest.approx((stator + magnetising) / negative, rel=1e-9)
    assert abs(unbalance_gain(motor, 50.0)) > 5
    with pytest.raises(ParameterError, match="frequency"):
        unbalance_gain(motor, 0.0)


@pytest.fixture(scope="module")
def itsc():
    try:
        return datasets.folder("itsc")
    except DataError as error:
        pytest.skip(f"ITSC currents are absent: {error}")


def test_itsc_convention_is_that_of_the_first_repetitions(itsc):
    fitted = fit_convention(score_folder(itsc))
    assert [fitted.offset, fitted.turn, fitted.share] == pytest.approx([RULE.offset, RULE.turn, RULE.share], abs=0.01)
    assert fitted.threshold == pytest.approx(RULE.threshold, rel=0.05)


def test_itsc_with_made_up_further_repetitions(itsc, tmp_path):
    """Repetitions 003-005 made of 001 with sensor errors are scored without any change, suspect names apart."""
    rng = np.random.default_rng(40)
    for path in itsc.rglob("*_00[12].csv"):
        shutil.copy(path, tmp_path)
        if path.stem.endswith("001"):
            x = np.loadtxt(path, delimiter=",")
            for repetition in (3, 4, 5):
                gains = 1 + 0.005 * rng.standard_normal(3)
                y = x * gains + 0.03 * rng.standard_normal(x.shape)
                np.savetxt(tmp_path / path.name.replace("001", f"{repetition:03d}"), y, delimiter=",")
    score = score_folder(tmp_path)
    assert len(score.rows) == 65
    unseen = score.count(unseen=True)
    assert (unseen.faults, unseen.healthy, unseen.false_alarms) == (36, 3, 0)
    assert unseen.phase_right >= 35
    assert score.count(suspect=False).share_found == 1.0
    # the two suspect files of repetition 002 look healthy, whatever their names say
    assert {row.record.name for row in score.rows if row.record.phase and not row.said} == {"A1_002", "B2_002"}
