"""Thesis 4.3.2-4.3.5: FMEA tables for people: HTML in notebooks, CSV and LaTeX on disk.

Everywhere ``?`` after an event means that it may appear; without it, it must.
"""

import csv
import html
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from pumplib.errors import DataError, ParameterError
from pumplib.fmea.entries import OBSERVATION, Effect
from pumplib.fmea.model import System

_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "→": r"$\rightarrow$",
}  # fmt: skip
_STYLE = "text-align:left;vertical-align:top;padding:2px 8px"


@dataclass(frozen=True, kw_only=True, slots=True)
class Table:
    """Small table of texts; shows itself in a notebook.

    Parameters
    ----------
    name : str
        File name without ending.
    title : str
        Caption.
    header : tuple of str
        Column titles.
    rows : tuple of tuple of str
        Cells, one for each column.
    wide : tuple of int
        Columns that hold sentences; they are wrapped in LaTeX.

    Raises
    ------
    DataError
        If a row has another number of cells than the header, or there is no column.
    """

    name: str
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    wide: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.header:
            raise DataError(f"table {self.name!r}: has no column; give at least one.")
        for number, row in enumerate(self.rows, 1):
            if len(row) != len(self.header):
                raise DataError(
                    f"table {self.name!r}: row {number} has {len(row)} cells, the header {len(self.header)}; "
                    "give one cell a column."
                )

    def to_html(self) -> str:
        """Table as HTML.

        Returns
        -------
        str
        """

        def line(cells: Sequence[str], tag: str) -> str:
            inner = "".join(f'<{tag} style="{_STYLE}">{html.escape(cell)}</{tag}>' for cell in cells)
            return f"<tr>{inner}</tr>"

        caption = f'<caption style="text-align:left;font-weight:bold">{html.escape(self.title)}</caption>'
        body = "\n".join(line(row, "td") for row in self.rows)
        return f"<table>{caption}\n<thead>{line(self.header, 'th')}</thead>\n<tbody>\n{body}\n</tbody></table>"

    def _repr_html_(self) -> str:
        return self.to_html()

    def to_csv(self) -> str:
        """Table as comma-separated text with a header line.

        Returns
        -------
        str
        """
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(self.rows)
        return buffer.getvalue()

    def to_latex(self) -> str:
        """Table as a LaTeX ``table`` that needs no package.

        Returns
        -------
        str
        """
        # what is left of the line for columns with sentences; the others take what they need
        share = 0.75 / len(self.wide) if self.wide else 0.0
        columns = "".join(f"p{{{share:.2f}\\linewidth}}" if k in self.wide else "l" for k in range(len(self.header)))
        lines = [" & ".join(map(_escaped, row)) + r" \\" for row in (self.header, *self.rows)]
        body = [rf"\begin{{tabular}}{{{columns}}}", r"\hline", lines[0], r"\hline", *lines[1:], r"\hline"]
        return "\n".join([
            r"\begin{table}", r"\raggedright", rf"\caption{{{_escaped(self.title)}}}", *body, r"\end{tabular}",
            r"\end{table}", "",
        ])  # fmt: skip


def _escaped(text: str) -> str:
    # braces keep a cell from being read as the option or star of the line break before it
    guard = "{}" if text[:1] in ("[", "*") else ""
    return guard + "".join(_LATEX.get(c, c) for c in text)


class Tables(tuple[Table, ...]):
    """Several tables that show themselves below each other in a notebook."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return "\n".join(table.to_html() for table in self)


def export(tables: Iterable[Table], folder: str | Path) -> list[Path]:
    """Write tables as CSV and LaTeX; equal tables give equal bytes.

    Parameters
    ----------
    tables : iterable of Table
        Tables with different names.
    folder : str or Path
        Where to; made if absent.

    Returns
    -------
    list of Path
        The files, two a table.

    Raises
    ------
    ParameterError
        If two tables have the same name.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    done: dict[str, list[Path]] = {}
    for table in tables:
        if table.name in done:
            raise ParameterError(f"tables: name {table.name!r} is there twice; give each table its own name.")
        done[table.name] = [folder / f"{table.name}.csv", folder / f"{table.name}.tex"]
        for path, text in zip(done[table.name], (table.to_csv(), table.to_latex()), strict=True):
            path.write_bytes(text.encode("utf-8"))
    return [path for paths in done.values() for path in paths]


def _marked(name: str, certain: bool) -> str:
    return name if certain else f"{name}?"


def _effects(effects: Iterable[Effect]) -> str:
    return ", ".join(_marked(effect.event, effect.certain) for effect in effects)


def fault_table(system: System, component: str) -> Table:
    """FMEA table of one component: its faults, what causes them and which events they raise.

    Parameters
    ----------
    system : System
        System.
    component : str
        Component.

    Returns
    -------
    Table

    Raises
    ------
    ParameterError
        If there is no such component.
    """
    title = _title(system, component)
    rows = []
    for fault in (fault for fault in system.faults if fault.component == component):
        causes = "; ".join(
            cause.text + (f" (from {', '.join(cause.started_by)})" if cause.started_by else "")
            for cause in fault.causes
        )
        rows.append((fault.id, fault.name, causes, _effects(fault.effects), fault.provenance))
    header = ("id", "fault", "causes", "local effects", "provenance")
    return Table(
        name=f"fmea_{component}_faults", title=f"{title}: faults", header=header, rows=tuple(rows), wide=(1, 2)
    )


def disturbance_table(system: System, component: str) -> Table:
    """Disturbing events of one component.

    Parameters
    ----------
    system : System
        System.
    component : str
        Component.

    Returns
    -------
    Table
    """
    rows = tuple(
        (item.id, item.name, _effects(item.effects), item.provenance)
        for item in system.disturbances
        if item.component == component
    )
    header = ("id", "disturbing event", "local effects", "provenance")
    title = f"{_title(system, component)}: disturbing events"
    return Table(name=f"fmea_{component}_disturbances", title=title, header=header, rows=rows, wide=(1,))


def link_table(system: System, component: str) -> Table:
    """Nonzeros of the propagation matrices into one component, one row for each matrix and kind.

    Parameters
    ----------
    system : System
        System.
    component : str
        Receiving component, or ``"OBS"`` for the signal events.

    Returns
    -------
    Table
    """
    title = _title(system, component)
    home = {event.id: event.component for event in system.events}
    blocks: dict[tuple[str, str, str, str], list[str]] = {}
    for edge in (edge for edge in system.edges if edge.component == component):
        key = (f"A_{{{component},{home[edge.cause]}}}", edge.kind, edge.reason, edge.provenance)
        blocks.setdefault(key, []).append(f"{edge.cause} → {_marked(edge.effect, edge.certain)}")
    rows = tuple((matrix, kind, ", ".join(links), why, where) for (matrix, kind, why, where), links in blocks.items())
    header = ("matrix", "kind", "cause → effect", "reason", "provenance")
    return Table(name=f"fmea_{component}_links", title=f"{title}: propagation", header=header, rows=rows, wide=(2, 3))


def _title(system: System, component: str) -> str:
    if component == OBSERVATION:
        return "signal events"
    for item in system.components:
        if item.id == component:
            return f"{item.section} {item.name} ({item.id})".strip()
    allowed = ", ".join([*(item.id for item in system.components), OBSERVATION])
    raise ParameterError(f"component {component!r}: not in system {system.name!r}; allowed are {allowed}.")


def component_tables(system: System, component: str) -> Tables:
    """All tables of one component that have rows: faults, disturbing events, propagation.

    Parameters
    ----------
    system : System
        System.
    component : str
        Component.

    Returns
    -------
    Tables
        A tuple.
    """
    made = (fault_table(system, component), disturbance_table(system, component), link_table(system, component))
    return Tables(table for table in made if table.rows)


def signal_table(system: System) -> Table:
    """Signals with the sensors they need.

    Parameters
    ----------
    system : System
        System.

    Returns
    -------
    Table
    """
    order = [sensor.id for sensor in system.sensors]
    rows = []
    for signal in system.signals:
        signs = " ".join(symbol.removeprefix(signal.id) for symbol in signal.symbols)
        sets = " or ".join("{" + ", ".join(sorted(needed, key=order.index)) + "}" for needed in signal.alternatives)
        rows.append((signal.id, signal.meaning, signs, sets, signal.kind, signal.condition, signal.provenance))
    header = ("signal", "meaning", "signs", "sensors", "kind", "condition", "provenance")
    return Table(name="fmea_signals", title="Signals", header=header, rows=tuple(rows), wide=(1, 5))


def group_table(system: System) -> Table:
    """Groups of faults.

    Parameters
    ----------
    system : System
        System.

    Returns
    -------
    Table
    """
    names = {fault.id: fault.name for fault in system.faults}
    rows = tuple(
        (group.id, group.name, "; ".join(f"{fault} {names[fault]}" for fault in group.faults), group.provenance)
        for group in system.groups
    )
    header = ("group", "name", "faults", "provenance")
    return Table(name="fmea_groups", title="Groups of faults", header=header, rows=rows, wide=(2,))


def scenario_table(system: System) -> Table:
    """Scenarios of disturbing events.

    Parameters
    ----------
    system : System
        System.

    Returns
    -------
    Table
    """
    rows = tuple((item.id, item.name, ", ".join(item.disturbances), item.provenance) for item in system.scenarios)
    header = ("scenario", "name", "disturbing events", "provenance")
    return Table(name="fmea_scenarios", title="Scenarios", header=header, rows=rows, wide=(2,))


def system_tables(system: System) -> Tables:
    """All tables of a system, in the order of its components.

    Parameters
    ----------
    system : System
        System.

    Returns
    -------
    Tables
        A tuple.
    """
    made = [table for item in system.components for table in component_tables(system, item.id)]
    made += [link_table(system, OBSERVATION), signal_table(system), group_table(system), scenario_table(system)]
    return Tables(table for table in made if table.rows)


def matrix_table(
    name: str, title: str, *, rows: Sequence[str], columns: Sequence[str], possible: ArrayLike, certain: ArrayLike
) -> Table:
    """Boolean matrix such as A_f or A_d: ``1`` for must, ``1?`` for may, ``0`` for never.

    Parameters
    ----------
    name : str
        File name without ending.
    title : str
        Caption.
    rows : sequence of str, length r
        End-effects.
    columns : sequence of str, length c
        Faults or disturbing events.
    possible : array_like of bool, shape (r, c)
        May entries, those of `certain` among them.
    certain : array_like of bool, shape (r, c)
        Must entries.

    Returns
    -------
    Table

    Raises
    ------
    DataError
        If a shape does not fit the names, a value is no truth value, or a must entry is no may entry.
    """
    may, must = checked_matrix("possible", possible, rows, columns), checked_matrix("certain", certain, rows, columns)
    if np.any(must & ~may):
        row, column = (int(k[0]) for k in np.nonzero(must & ~may))
        raise DataError(
            f"certain[{rows[row]}, {columns[column]}] is set but possible is not; every must entry is a may entry."
        )
    text = np.where(must, "1", np.where(may, "1?", "0"))
    cells = tuple((str(row), *map(str, line)) for row, line in zip(rows, text.tolist(), strict=True))
    return Table(name=name, title=title, header=("event", *columns), rows=cells)


def checked_matrix(name: str, values: ArrayLike, rows: Sequence[str], columns: Sequence[str]) -> np.ndarray:
    """Truth values of the right shape, or an error.

    Parameters
    ----------
    name : str
        For messages.
    values : array_like of bool, shape (r, c)
        Truth values; 0 and 1 are taken as well.
    rows, columns : sequence of str
        Names.

    Returns
    -------
    ndarray of bool, shape (r, c)

    Raises
    ------
    DataError
        If the shape does not fit the names or a value is neither 0 nor 1.
    """
    array = np.asarray(values)
    if array.shape != (len(rows), len(columns)):
        raise DataError(
            f"{name}: shape {array.shape}, but there are {len(rows)} rows and {len(columns)} columns; "
            "give one value a cell."
        )
    if array.dtype != bool and not np.isin(array, (0, 1)).all():
        raise DataError(f"{name}: must hold truth values (0 or 1) only; found {array[~np.isin(array, (0, 1))][0]!r}.")
    return array.astype(bool)
