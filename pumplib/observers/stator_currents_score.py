"""Thesis 5.3: a folder of labelled line currents in, detection, phase and severity scored (beyond the thesis).

File names carry the labels, as in the ITSC records: ``SC_A1_B0_C0_003.csv`` is phase A, level 1, repetition 3, and
``SC_HLT_003.csv`` a healthy record. The convention (threshold, angles, severity) was fixed on repetitions 1 and 2;
all others are unseen and counted apart, and so are the files that look mislabelled.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Quantity, check_value
from pumplib.motor.phasor import steady_currents
from pumplib.observers.stator_currents import (
    PHASES,
    Convention,
    CurrentReference,
    CurrentVerdict,
    current_reference,
    fundamental,
    score_currents,
)

Array = NDArray[Any]
CONVENTION_REPETITIONS = (1, 2)
LEVEL_SHARE = 0.1  # of the turns of a phase, per level
SUSPECTS = frozenset({"A1_002", "A1_005", "B1_005", "B2_002", "B2_005"})  # look mislabelled
_NAME = re.compile(r"SC_(?:HLT|A(\d)_B(\d)_C(\d))_(\d+)\.csv", re.ASCII)
_SCHEME = "SC_A1_B0_C0_003.csv (phase A, level 1, repetition 3) or SC_HLT_003.csv (healthy)"


@dataclass(frozen=True, kw_only=True, slots=True)
class CurrentRecord:
    """One file with its labels.

    Parameters
    ----------
    phase : str
        Labelled phase, "a", "b" or "c"; empty for a healthy record.
    level : int
        Labelled level, tenths of the turns of the phase; 0 for a healthy record.
    repetition : int
        Number of the repetition.
    currents : ndarray, shape (n, 3)
        Line currents, A.
    """

    phase: str
    level: int
    repetition: int
    currents: Array

    @property
    def name(self) -> str:
        """Short name, such as "A1_002" or "HLT_002"."""
        return f"{self.phase.upper()}{self.level}_{self.repetition:03d}" if self.phase else f"HLT_{self.repetition:03d}"

    @property
    def suspect(self) -> bool:
        """Whether the file looks mislabelled."""
        return self.name in SUSPECTS

    @property
    def unseen(self) -> bool:
        """Whether the convention was fixed without this repetition."""
        return self.repetition not in CONVENTION_REPETITIONS


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoredRecord:
    """One file and what was decided about it.

    Parameters
    ----------
    record : CurrentRecord
        The file.
    verdict : CurrentVerdict
        The decision; a healthy record that the reference was learnt from is judged by the other healthy ones.
    """

    record: CurrentRecord
    verdict: CurrentVerdict

    @property
    def said(self) -> str:
        """Phase that was said, or empty without detection."""
        return self.verdict.phase if self.verdict.detected else ""

    @property
    def size(self) -> float:
        """|d|, the detection statistic."""
        return abs(self.verdict.difference)

    @property
    def severity_error(self) -> float:
        """Severity minus the labelled share of the turns."""
        return self.verdict.severity - LEVEL_SHARE * self.record.level


@dataclass(frozen=True, kw_only=True, slots=True)
class GroupCount:
    """Counts of one group of files.

    Parameters
    ----------
    faults, found : int
        Files with a short, and those detected.
    phase_right : int
        Files with a short whose nearest sector is the labelled phase, detected or not; by chance one of three.
    diagnosed : int
        Files with a short that are detected, with the labelled phase.
    healthy, false_alarms : int
        Healthy files, and those detected.
    severity_rms : float
        Root mean square of severity minus label over the files with a short; NaN without any.
    """

    faults: int
    found: int
    phase_right: int
    diagnosed: int
    healthy: int
    false_alarms: int
    severity_rms: float

    @property
    def share_found(self) -> float:
        """Found over faults; NaN without faults."""
        return self.found / self.faults if self.faults else float("nan")


@dataclass(frozen=True, kw_only=True, slots=True)
class CurrentScore:
    """All files of a folder, decided.

    Parameters
    ----------
    reference : CurrentReference
        The healthy machine.
    learnt_from : tuple of str
        Names of the healthy records behind the reference; empty if the reference was given.
    rows : tuple of ScoredRecord
        One a file: healthy first, then by phase, level, repetition.
    """

    reference: CurrentReference
    learnt_from: tuple[str, ...]
    rows: tuple[ScoredRecord, ...]

    @property
    def repetitions(self) -> tuple[int, ...]:
        """Repetitions that are present."""
        return tuple(sorted({row.record.repetition for row in self.rows}))

    def select(self, *, suspect: bool | None = None, unseen: bool | None = None) -> tuple[ScoredRecord, ...]:
        """Rows of a group.

        Parameters
        ----------
        suspect, unseen : bool, optional
            Keep only rows of which this is true or false; both kinds by default.

        Returns
        -------
        tuple of ScoredRecord
        """
        return tuple(
            row
            for row in self.rows
            if (suspect is None or row.record.suspect == suspect) and (unseen is None or row.record.unseen == unseen)
        )

    def restrict(self, which: str) -> "CurrentScore":
        """Keep the repetitions of the convention, the unseen ones, or all.

        Parameters
        ----------
        which : str
            "all", "convention" or "unseen".

        Returns
        -------
        CurrentScore
            With the same reference.

        Raises
        ------
        ParameterError
            If the word is another one.
        DataError
            If there is no such repetition.
        """
        unseen = {"all": None, "convention": False, "unseen": True}
        if which not in unseen:
            raise ParameterError(f"restrict: which = {which!r}; use one of {', '.join(map(repr, unseen))}.")
        rows = self.select(unseen=unseen[which])
        if not rows:
            raise DataError(
                f"there is no {which} repetition: present are {', '.join(map(str, self.repetitions)) or 'none'}, the "
                f"convention was fixed on {', '.join(map(str, CONVENTION_REPETITIONS))}; add files or choose all."
            )
        return replace(self, rows=rows)

    def count(self, *, suspect: bool | None = None, unseen: bool | None = None) -> GroupCount:
        """Count what was found in a group.

        Parameters
        ----------
        suspect, unseen : bool, optional
            As in `select`.

        Returns
        -------
        GroupCount
        """
        return count_rows(self.select(suspect=suspect, unseen=unseen))

    def worst_angle(self) -> float:
        """Largest angle between a short and the centre of its labelled sector, suspect files left out.

        Returns
        -------
        float
            rad; beyond pi/3 the phase is wrong. NaN without a short.
        """
        rule = self.reference.convention
        angles = []
        for row in self.select(suspect=False):
            if row.record.phase:
                centre = rule.offset - rule.turn * row.size + 2 * math.pi / 3 * PHASES.index(row.record.phase)
                angles.append(abs(math.remainder(float(np.angle(row.verdict.difference)) - centre, 2 * math.pi)))
        return max(angles, default=float("nan"))

    def groups(self) -> dict[str, GroupCount]:
        """Counts of the groups that are to be told apart; groups without a file, or like one above, are left out.

        Returns
        -------
        dict of str to GroupCount
        """
        found: dict[str, GroupCount] = {}
        kept: list[list[int]] = []
        for when, unseen in (("convention", False), ("unseen", True), ("all repetitions", None)):
            for what, suspect in (("", False), (", suspect files", True), (", with suspect files", None)):
                rows = self.select(suspect=suspect, unseen=unseen)
                same = [id(row) for row in rows]
                if rows and same not in kept:
                    kept.append(same)
                    found[when + what] = count_rows(rows)
        return found

    def confusion(self, *, suspect: bool | None = False, unseen: bool | None = None) -> Array:
        """Labelled against decided phase.

        Parameters
        ----------
        suspect, unseen : bool, optional
            As in `select`; without the suspect files by default.

        Returns
        -------
        ndarray of int, shape (4, 4)
            Rows: labelled a, b, c, healthy. Columns: said a, b, c, nothing.
        """
        table = np.zeros((4, 4), dtype=int)
        order = {**{phase: k for k, phase in enumerate(PHASES)}, "": 3}
        for row in self.select(suspect=suspect, unseen=unseen):
            table[order[row.record.phase], order[row.said]] += 1
        return table


def count_rows(rows: Iterable[ScoredRecord]) -> GroupCount:
    """Count what was found.

    Parameters
    ----------
    rows : iterable of ScoredRecord
        Files of one group.

    Returns
    -------
    GroupCount
    """
    many = tuple(rows)
    faulty = [row for row in many if row.record.phase]
    healthy = [row for row in many if not row.record.phase]
    return GroupCount(
        faults=len(faulty),
        found=sum(row.verdict.detected for row in faulty),
        phase_right=sum(row.verdict.phase == row.record.phase for row in faulty),
        diagnosed=sum(row.said == row.record.phase for row in faulty),
        healthy=len(healthy),
        false_alarms=sum(row.verdict.detected for row in healthy),
        severity_rms=math.sqrt(np.mean([row.severity_error**2 for row in faulty])) if faulty else float("nan"),
    )


def read_currents(folder: str | Path) -> list[CurrentRecord]:
    """Read all labelled records of a folder and its subfolders.

    Parameters
    ----------
    folder : str or Path
        Folder with CSV files of three columns (phase currents a, b, c in A), labelled by their names.

    Returns
    -------
    list of CurrentRecord
        Healthy first, then by phase, level, repetition.

    Raises
    ------
    DataError
        If the folder holds no CSV file, a name does not follow the scheme or labels two phases, a file appears
        twice or is no table of three columns.
    """
    where = Path(folder).expanduser()
    paths = sorted(where.rglob("*.csv")) if where.is_dir() else []
    if not paths:
        raise DataError(f"{where}: no folder with CSV files; give one with files such as {_SCHEME}.")
    records = []
    for path in paths:
        match = _NAME.fullmatch(path.name)
        if not match:
            raise DataError(f"{path.name}: the name carries no label; call it like {_SCHEME}, or move it elsewhere.")
        levels = [int(one or 0) for one in match.groups()[:3]]
        if match[1] is not None and sum(level > 0 for level in levels) != 1:
            raise DataError(f"{path.name}: labels {levels} for a, b, c; scored are shorts of exactly one phase.")
        try:
            currents = np.loadtxt(path, delimiter=",", ndmin=2)
        except ValueError as error:
            raise DataError(f"{path.name}: not a table of numbers with commas between them: {error}") from None
        if currents.shape[1] != 3:
            raise DataError(f"{path.name}: {currents.shape[1]} columns; must be the three currents a, b, c in A.")
        level = max(levels)
        phase = PHASES[levels.index(level)] if level else ""
        records.append(CurrentRecord(phase=phase, level=level, repetition=int(match[4]), currents=currents))
    names = Counter(record.name for record in records)
    twice = [name for name, times in names.items() if times > 1]
    if twice:
        raise DataError(f"{where}: {', '.join(twice)} is there more than once; keep one file of each.")
    return sorted(records, key=lambda one: (one.phase, one.level, one.repetition))


def _learning(records: Sequence[CurrentRecord], learn: Sequence[int] | None) -> list[CurrentRecord]:
    healthy = [record for record in records if not record.phase]
    present = {record.repetition for record in healthy}
    if learn is None:
        learn = CONVENTION_REPETITIONS if present.issuperset(CONVENTION_REPETITIONS) else sorted(present)
    lacking = [str(one) for one in learn if one not in present]
    if lacking or len(set(learn)) < 2:
        raise DataError(
            f"healthy repetitions {', '.join(map(str, learn)) or 'none'} are to be learnt from, present are "
            f"{', '.join(map(str, sorted(present))) or 'none'}: needs two or more that are present, so that each can "
            "be judged by the others; or give a reference."
        )
    return [record for record in healthy if record.repetition in learn]


@contextmanager
def _about(record: CurrentRecord) -> Iterator[None]:
    """Say in an error which record it was."""
    try:
        yield
    except DataError as error:
        raise DataError(f"{record.name}: {error}") from error


def score_records(
    records: Sequence[CurrentRecord],
    rate: float = 1000.0,
    *,
    convention: Convention | None = None,
    learn: Sequence[int] | None = None,
    reference: CurrentReference | None = None,
) -> CurrentScore:
    """Decide about labelled records; the labels are used for the healthy reference and the counting only.

    Parameters
    ----------
    records : sequence of CurrentRecord
        Labelled records.
    rate : float
        Sampling rate, Hz.
    convention : Convention, optional
        How a difference is read; not together with a reference, which has one.
    learn : sequence of int, optional
        Repetitions whose healthy records the reference is learnt from; those of the convention by default, or all
        if one of them is absent.
    reference : CurrentReference, optional
        A healthy machine learnt before; no healthy record is needed then.

    Returns
    -------
    CurrentScore

    Raises
    ------
    DataError
        If fewer than two healthy records can be learnt from or a record cannot be used; the message names it.
    ParameterError
        If a reference is given together with convention or learn, or the rate is impossible.
    """
    if reference is not None and (convention is not None or learn is not None):
        raise ParameterError(
            "score_records: a reference brings its convention; give either it or convention and learn."
        )
    check_value("score_records", "rate", rate, Quantity("Hz", "sampling rate", 1.0, 1e7))
    rule = reference.convention if reference is not None else convention or Convention()
    known = [] if reference is not None else _learning(records, learn)
    for record in known:
        with _about(record):
            fundamental(record.currents, rate, rule.frequency)
    base = reference or current_reference([record.currents for record in known], rate, rule)
    rows = []
    for record in records:
        judge = base
        if any(record is one for one in known):
            judge = current_reference([one.currents for one in known if one is not record], rate, rule)
        with _about(record):
            rows.append(ScoredRecord(record=record, verdict=score_currents(judge, record.currents, rate)))
    return CurrentScore(reference=base, learnt_from=tuple(one.name for one in known), rows=tuple(rows))


def score_folder(
    folder: str | Path,
    rate: float = 1000.0,
    *,
    convention: Convention | None = None,
    learn: Sequence[int] | None = None,
    reference: CurrentReference | None = None,
) -> CurrentScore:
    """Read a folder of labelled line currents and decide about every file; further repetitions need no change.

    Parameters
    ----------
    folder : str or Path
        See `read_currents`.
    rate : float
        Sampling rate, Hz.
    convention, learn, reference
        See `score_records`.

    Returns
    -------
    CurrentScore

    Raises
    ------
    DataError
        See `read_currents` and `score_records`.
    ParameterError
        See `score_records`.
    """
    return score_records(read_currents(folder), rate, convention=convention, learn=learn, reference=reference)


def fit_convention(
    score: CurrentScore, straight: bool = True, repetitions: Sequence[int] = CONVENTION_REPETITIONS
) -> Convention:
    """Fit the convention to the repetitions it was fixed on; suspect files and others are not looked at.

    The threshold is the geometric mean of the largest deviation of a healthy record and the smallest difference of
    a short: as far from the one as from the other by ratio. Angles, each turned back by the place of its phase, are
    fitted by a line in the size of the difference; the severity by a proportion.

    Parameters
    ----------
    score : CurrentScore
        Scored records, with any convention: the differences do not depend on it.
    straight : bool
        Whether the angle may fall with the difference; otherwise it is constant.
    repetitions : sequence of int
        Repetitions to fit to.

    Returns
    -------
    Convention

    Raises
    ------
    DataError
        If a phase or the healthy machine is absent, or healthy records and shorts overlap.
    """
    rows = [row for row in score.select(suspect=False) if row.record.repetition in repetitions]
    shorts = [row for row in rows if row.record.phase]
    if {row.record.phase for row in shorts} != set(PHASES) or len(rows) == len(shorts):
        raise DataError(
            "fit_convention: needs healthy records and shorts of all three phases in repetitions "
            f"{', '.join(map(str, repetitions))}."
        )
    place = np.array([PHASES.index(row.record.phase) for row in shorts])
    d = np.array([row.verdict.difference for row in shorts]) * np.exp(-2j * np.pi / 3 * place)
    size, level = np.abs(d), np.array([row.record.level for row in shorts])
    healthy, smallest = max(row.size for row in rows if not row.record.phase), float(size.min())
    if healthy >= smallest:
        raise DataError(
            f"fit_convention: a healthy record differs by {healthy:.3g}, a short by {smallest:.3g} only; no threshold "
            "lies between."
        )
    middle = np.angle(np.sum(d / size))  # angles are taken from here, away from the cut of the circle
    angle = middle + np.angle(d * np.exp(-1j * middle))
    line = np.stack([np.ones_like(size), -size], axis=1) if straight else np.ones((len(size), 1))
    offset, *turn = np.linalg.lstsq(line, angle, rcond=None)[0]
    return replace(
        score.reference.convention,
        threshold=math.sqrt(healthy * smallest),
        offset=float(offset),
        turn=float(turn[0]) if straight else 0.0,
        share=float(LEVEL_SHARE * (level @ size) / (size @ size)),
    )


def cross_check(
    records: Sequence[CurrentRecord], rate: float = 1000.0, convention: Convention | None = None
) -> dict[str, GroupCount]:
    """Fit the convention to one of its repetitions and judge the other, suspect files left out.

    Threshold, angles and severity come from one repetition only; the healthy machine is learnt from both, because
    one record alone has no deviation.

    Parameters
    ----------
    records : sequence of CurrentRecord
        Labelled records with all repetitions of the convention; others are not looked at.
    rate : float
        Sampling rate, Hz.
    convention : Convention, optional
        Its frequency is used.

    Returns
    -------
    dict of str to GroupCount
        One entry a pair.

    Raises
    ------
    DataError
        See `score_records` and `fit_convention`.
    ParameterError
        See `score_records`.
    """
    own = [record for record in records if not record.unseen]
    first = score_records(own, rate, convention=convention, learn=CONVENTION_REPETITIONS)
    found = {}
    for one, other in permutations(CONVENTION_REPETITIONS, 2):
        rule = fit_convention(first, repetitions=(one,))
        again = score_records(own, rate, convention=rule, learn=CONVENTION_REPETITIONS)
        rows = [row for row in again.select(suspect=False) if row.record.repetition == other]
        found[f"fitted to {one}, judged on {other}"] = count_rows(rows)
    return found


def spread_within(record: CurrentRecord, rate: float = 1000.0, frequency: float = 60.0, windows: int = 4) -> float:
    """Standard deviation of I_2/I_1 between equal windows of one record.

    Parameters
    ----------
    record : CurrentRecord
        The record.
    rate : float
        Sampling rate, Hz.
    frequency : float
        Nominal frequency, Hz.
    windows : int
        Number of windows, at least 2.

    Returns
    -------
    float
        Root mean square distance from the mean of the windows, with windows - 1 degrees of freedom.

    Raises
    ------
    DataError
        If a window is too short or cannot be used.
    ParameterError
        If the number of windows, the rate or the frequency is impossible.
    """
    check_value("spread_within", "windows", windows, Quantity("-", "windows of a record", 2, 1000), whole=True)
    with _about(record):
        parts = np.array_split(record.currents, windows)
        q = np.array([fundamental(part, rate, frequency).q for part in parts])
    return float(np.sqrt(np.sum(np.abs(q - q.mean()) ** 2) / (windows - 1)))


def unbalance_gain(motor: Motor, frequency: float) -> complex:
    """Change of I_2/I_1 per V_2/V_1 of a healthy motor at no load: what is lost without voltages.

    Parameters
    ----------
    motor : Motor
        The motor.
    frequency : float
        Supply frequency, Hz.

    Returns
    -------
    complex
        Admittance to the negative sequence (slip 2) over that to the positive one (slip 0).

    Raises
    ------
    ParameterError
        If the frequency is impossible.
    """
    check_value("unbalance_gain", "frequency", frequency, Quantity("Hz", "supply frequency", 1.0, 1e3))
    omega_s = 2 * math.pi * frequency
    shaft = omega_s / motor.z_p
    one = np.ones((), dtype=complex)
    positive, _ = steady_currents(motor, one, np.asarray(omega_s), np.asarray(shaft))
    # a space vector that turns backwards is the conjugate of the negative-sequence phasor
    negative, _ = steady_currents(motor, one, np.asarray(-omega_s), np.asarray(shaft))
    return complex(np.conj(negative) / positive)
