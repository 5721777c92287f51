"""The figures of the measured currents show every file they were given."""

import warnings
from collections.abc import Iterator
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from pumplib.errors import ParameterError
from pumplib.motor.frames import PHASE_AXES
from pumplib.observers.stator_currents import PHASES, Convention
from pumplib.observers.stator_currents_score import CurrentRecord, CurrentScore, score_records
from pumplib.plots.ch05_currents import detection_statistic, difference_plane, phase_confusion, severity_by_level
from pumplib.plots.style import COLOURS

matplotlib.use("Agg")
RULE = Convention()


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    plt.close("all")


def record(phase: str, level: int, repetition: int) -> CurrentRecord:
    size = 0.1 * level / RULE.share
    turned = RULE.offset - RULE.turn * size + 2 * np.pi / 3 * ("abc".index(phase) if phase else 0)
    d = 0.01 * np.exp(2j * np.pi * repetition / 5) + size * np.exp(1j * turned)
    turn = np.exp(2j * np.pi * 60.0 * np.arange(200) / 1000.0)
    x = np.real(turn[:, None] * 2.8 * (PHASE_AXES.conj() + d * PHASE_AXES))
    return CurrentRecord(phase=phase, level=level, repetition=repetition, currents=x)


@pytest.fixture(scope="module")
def score() -> CurrentScore:
    records = [record("", 0, repetition) for repetition in (1, 2, 5)]
    records += [record(p, level, r) for p in PHASES for level in (1, 2, 4) for r in (1, 2, 5)]
    return score_records(records)


def drawn(figure: Figure) -> None:
    """Lay the figure out and draw it; warnings (missing glyphs, failed layout) are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.canvas.draw()


def points(axes: object, marker: str) -> list[object]:
    return [line for line in axes.lines if line.get_marker() == marker and len(line.get_xdata()) == 1]  # type: ignore


def names(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_plane_shows_every_difference_inside_its_sector(score: CurrentScore) -> None:
    figure = difference_plane(score)
    drawn(figure)
    whole, detail = figure.axes
    for phase, marker in (("a", "o"), ("b", "s"), ("c", "^"), ("", "D")):
        expected = [row.verdict.difference for row in score.rows if row.record.phase == phase]
        shown = [complex(line.get_xdata()[0], line.get_ydata()[0]) for line in points(whole, marker)]
        np.testing.assert_allclose(np.sort_complex(shown), np.sort_complex(expected))
    assert len(points(whole, "x")) == len(score.select(suspect=True)) == 5
    assert 0 < len(points(detail, "o")) < len(points(whole, "o"))
    # the coloured sector contains the records that were said to lie there
    for k, patch in enumerate(whole.patches[:3]):
        inside = [
            patch.get_path().contains_point((row.verdict.difference.real, row.verdict.difference.imag))
            for row in score.rows
            if row.said == PHASES[k]
        ]
        assert inside
        assert all(inside)
        others = [row.verdict.difference for row in score.rows if row.said not in ("", PHASES[k])]
        assert not any(patch.get_path().contains_point((d.real, d.imag)) for d in others)
    assert {"threshold", "unseen repetition", "suspect file", "healthy", "labelled phase b"} <= names(figure)


def test_unseen_files_are_open_and_absent_kinds_not_in_the_legend(score: CurrentScore) -> None:
    figure = difference_plane(score)
    faces = [to_hex(line.get_markerfacecolor()) for line in points(figure.axes[0], "^")]
    assert sorted(faces) == sorted(["#ffffff"] * 3 + [COLOURS["green"].lower()] * 6)
    few = score.restrict("convention")
    few = replace(few, rows=few.select(suspect=False))
    assert {"unseen repetition", "suspect file"}.isdisjoint(names(difference_plane(few)))


def test_statistic_has_every_file_and_both_lines(score: CurrentScore) -> None:
    figure = detection_statistic(score)
    drawn(figure)
    (ax,) = figure.axes
    shown = sorted(float(line.get_ydata()[0]) for marker in "os^D" for line in points(ax, marker))
    np.testing.assert_allclose(shown, sorted(row.size for row in score.rows))
    assert {text.get_text() for text in ax.texts} == {row.record.name for row in score.select(suspect=True)}
    assert ax.get_yscale() == "log"
    low, high = ax.get_ylim()
    assert low < shown[0] < score.reference.convention.threshold < shown[-1] < high
    assert "threshold 0.041" in names(figure)


def test_confusion_has_one_panel_a_group(score: CurrentScore) -> None:
    figure = phase_confusion(score)
    drawn(figure)
    assert [ax.get_title(loc="left").split(":")[0] for ax in figure.axes] == [
        "repetitions 1 and 2",
        "unseen repetitions",
        "suspect files",
    ]
    numbers = [sum(int(t.get_text()) for t in ax.texts if t.get_text().isdigit()) for ax in figure.axes]
    assert numbers == [len(score.select(suspect=False, unseen=u)) for u in (False, True)] + [5]
    few = score.restrict("convention")
    assert len(phase_confusion(replace(few, rows=few.select(suspect=False))).axes) == 1


def test_severity_and_angle(score: CurrentScore) -> None:
    figure = severity_by_level(score)
    drawn(figure)
    size, angle = figure.axes
    shorts = [row for row in score.rows if row.record.phase]
    shown = sorted(float(line.get_ydata()[0]) for marker in "os^" for line in points(size, marker))
    np.testing.assert_allclose(shown, sorted(100 * row.verdict.severity for row in shorts))
    assert max(abs(float(line.get_ydata()[0])) for line in points(angle, "o")) < 60
    assert "healthy" not in names(figure)


def test_a_wrong_phase_lies_outside_its_sector(score: CurrentScore) -> None:
    row = next(row for row in score.rows if row.said == "b")
    wrong = replace(row, record=replace(row.record, phase="a"))
    figure = severity_by_level(replace(score, rows=(wrong,)))
    (point,) = points(figure.axes[1], "o")
    assert 60 < abs(float(point.get_ydata()[0])) <= 180  # type: ignore[attr-defined]
    low, high = figure.axes[1].get_ylim()
    assert low < float(point.get_ydata()[0]) < high  # type: ignore[attr-defined]


def test_nothing_to_draw_is_said(score: CurrentScore) -> None:
    empty = replace(score, rows=())
    for draw in (difference_plane, detection_statistic, phase_confusion):
        with pytest.raises(ParameterError, match="no record"):
            draw(empty)
    with pytest.raises(ParameterError, match="with a short"):
        severity_by_level(replace(score, rows=tuple(row for row in score.rows if not row.record.phase)))
