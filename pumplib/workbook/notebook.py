"""Thesis, all chapters: what a notebook calls to check its parameters, record claims and save figures.

Claims and figures count only in a run of the workbook with default parameters. The runner says so
by the environment variable PUMPLIB_RUN; any other run writes to `build/scratch`.
"""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from pumplib.errors import ClaimError, NotebookSkipped, ParameterError
from pumplib.workbook.cells import read_defaults, unknown_names
from pumplib.workbook.claims import Measurement, find, judge, load_claims, measure
from pumplib.workbook.figures import load_index
from pumplib.workbook.layout import Layout, write_json
from pumplib.workbook.parameters import Parameters, Spec

if TYPE_CHECKING:
    import matplotlib.figure
    import numpy as np

RUN_VARIABLE = "PUMPLIB_RUN"


class Notebook:
    """One run of a notebook: its parameters, and where its claims and figures go.

    Attributes
    ----------
    name : str
        Name of the notebook without the ending.
    parameters : Parameters
        Checked parameters.
    is_default : bool
        Whether every parameter has the value of the committed parameters cell.
    counts : bool
        Whether claims and figures of this run count.
    folder : Path
        Where this run writes.
    """

    def __init__(
        self, name: str, parameters: Parameters, is_default: bool, counts: bool, folder: Path, layout: Layout
    ) -> None:
        self.name = name
        self.parameters = parameters
        self.is_default = is_default
        self.counts = counts
        self.folder = folder
        self._layout = layout
        self._recorded: dict[str, Measurement] = {}
        self._figures: list[str] = []

    @cached_property
    def rng(self) -> "np.random.Generator":
        """Random numbers of this run, from the parameter `seed`."""
        import numpy as np

        if "seed" not in self.parameters:
            raise ParameterError(f"notebook {self.name} has no parameter seed; add one to use random numbers")
        return np.random.default_rng(self.parameters.seed)

    @cached_property
    def _ledger(self) -> Any:
        return load_claims(self._layout.ledger)

    @cached_property
    def _index(self) -> Any:
        return load_index(self._layout.index)

    def record(self, name: str, value: Any, n: int | None = None, successes: int | None = None, note: str = "") -> None:
        """Record the measured value of a claim and print how it compares with the bound.

        Parameters
        ----------
        name : str
            Id of the claim; its source must be this notebook.
        value : number or sequence of numbers
            In the claim's unit.
        n : int, optional
            Number of runs; obligatory where the claim asks for a least number.
        successes : int, optional
            Runs that count, for the Clopper-Pearson interval.
        note : str
            One line for the table.

        Raises
        ------
        ClaimError
            If the id is unknown, belongs elsewhere or is recorded twice, or the value has the wrong form.
        """
        claim = find(self._ledger, name)
        if claim.notebook != self.name:
            raise ClaimError(f"{name}: its source is {claim.source}, not notebook {self.name}")
        # By hand a reader runs a cell again and again; that replaces the value.
        if self.counts and name in self._recorded:
            raise ClaimError(f"{name}: recorded twice in this run; keep one of them")
        value = measure(claim, value, n, successes, note)
        self._recorded[name] = value
        write_json(self.folder / "claims.json", [asdict(item) for item in self._recorded.values()])
        few = claim.n is not None and (value.n or 0) < claim.n
        verdict = f"not run (n = {value.n} of {claim.n})" if few else judge(claim, value.value)
        unit = "" if claim.unit == "-" else f" {claim.unit}"
        bound = list(claim.bound) if isinstance(claim.bound, tuple) else claim.bound
        print(f"{name}: {_short(value.value)}{unit} {claim.op} {bound}: {verdict}")

    def not_run(self, name: str, reason: str) -> None:
        """Say that a claim cannot be measured on this machine; the table shows it as "not run" with the reason.

        Parameters
        ----------
        name : str
            Id of the claim; its source must be this notebook.
        reason : str
            What is absent, and how to get it.

        Raises
        ------
        ClaimError
            If the id is unknown, belongs elsewhere or is recorded already, or no reason is given.
        """
        claim = find(self._ledger, name)
        if claim.notebook != self.name:
            raise ClaimError(f"{name}: its source is {claim.source}, not notebook {self.name}")
        if not reason.strip():
            raise ClaimError(f"{name}: say why it cannot be measured here")
        if self.counts and name in self._recorded:
            raise ClaimError(f"{name}: recorded twice in this run; keep one of them")
        self._recorded[name] = Measurement(id=claim.id, value=None, note=reason)
        write_json(self.folder / "claims.json", [asdict(item) for item in self._recorded.values()])
        print(f"{name}: NOT RUN: {reason}")

    def save(self, figure: "matplotlib.figure.Figure", figure_id: str) -> None:
        """Save a figure as SVG and PNG, and show the saved picture below the cell.

        Parameters
        ----------
        figure : matplotlib.figure.Figure
            The figure.
        figure_id : str
            Its id in `figures/index.toml`, such as `ch03_start_up`.

        Raises
        ------
        ParameterError
            If the run counts and the figure is not listed for this notebook, or it is saved twice.
        """
        from pumplib import plots

        if self.counts:
            entry = self._index.get(figure_id)
            if entry is None or entry.notebook != self.name:
                mine = [item.id for item in self._index.values() if item.notebook == self.name]
                raise ParameterError(
                    f"figure {figure_id!r} is not listed for notebook {self.name} in figures/index.toml; "
                    f"listed are {', '.join(mine) or 'none'}"
                )
            if figure_id in self._figures:
                raise ParameterError(f"figure {figure_id!r} is saved twice in this run; give each its own id")
        folder = self.folder / "figures"
        folder.mkdir(parents=True, exist_ok=True)
        _, png = plots.save_figure(figure, folder, figure_id)
        _show(png, figure)
        if figure_id not in self._figures:
            self._figures.append(figure_id)
        write_json(self.folder / "figures.json", self._figures)

    def skip(self, reason: str) -> NoReturn:
        """End the notebook here because something it needs is absent; this is not an error.

        Parameters
        ----------
        reason : str
            What is absent and how to get it.

        Raises
        ------
        NotebookSkipped
            Always.
        """
        raise NotebookSkipped(reason)


def _show(png: Path, figure: "matplotlib.figure.Figure") -> None:
    """Show the file, so that what is seen is what was saved, and forget the figure."""
    from matplotlib import pyplot

    pyplot.close(figure)  # otherwise Jupyter shows it a second time
    if "IPython" in sys.modules and sys.modules["IPython"].get_ipython() is not None:
        from IPython.display import Image, display

        display(Image(png.read_bytes(), width=round(100 * figure.get_figwidth())))


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_short(item) for item in value) + "]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _empty(folder: Path) -> None:
    # A second run by hand must not show the claims of the first.
    for name in ("claims.json", "figures.json"):
        (folder / name).unlink(missing_ok=True)


def start(name: str, namespace: Mapping[str, Any] | None = None, /, **specs: Spec) -> Notebook:
    """Check the parameters of a notebook; its first code cell after the parameters calls this.

    Parameters
    ----------
    name : str
        Name of the notebook without the ending, such as "03_model".
    namespace : mapping, optional
        Where the parameters are; the caller's global names by default.
    **specs : Spec
        What each parameter accepts: `number`, `integer`, `numbers`, `names`, `choice`, `flag`, `text`, `file`.

    Returns
    -------
    Notebook
        Checked parameters, and the methods to record claims and save figures.

    Raises
    ------
    ParameterError
        If a parameter is missing, has a value that is not accepted, or is unknown to this notebook.
    """
    if namespace is None:
        namespace = sys._getframe(1).f_globals
    run = os.environ.get(RUN_VARIABLE)
    layout, of_workbook = Layout(), False
    if run:
        given = json.loads((Path(run) / "run.json").read_text(encoding="utf-8"))
        if given["notebook"] != name:
            raise ParameterError(f"notebook {given['notebook']} calls itself {name!r}; correct its first call")
        layout, of_workbook = Layout(Path(given["root"]), Path(given["package"])), given["counts"]
    allowed = ", ".join(specs) or "none"
    unknown = unknown_names(map(str, namespace.get("In", [])), specs)
    if unknown:
        raise ParameterError(f"unknown parameter {', '.join(unknown)} of notebook {name}; allowed are {allowed}")
    missing = [key for key in specs if key not in namespace]
    if missing:
        raise ParameterError(f"notebook {name}: parameter {', '.join(missing)} has no value; run the parameters cell")
    values = {key: spec.check(key, namespace[key]) for key, spec in specs.items()}
    is_default = False
    file = layout.notebook(name)
    if file.exists():
        defaults = read_defaults(file)
        if set(defaults) != set(specs):
            raise ParameterError(
                f"notebook {name}: its parameters cell has {', '.join(sorted(defaults)) or 'none'}, "
                f"but it checks {', '.join(sorted(specs)) or 'none'}; make them the same"
            )
        is_default = all(specs[key].check(key, defaults[key]) == values[key] for key in specs)
    counts = of_workbook and is_default
    folder = Path(run) if run and counts else layout.scratch / name
    folder.mkdir(parents=True, exist_ok=True)
    _empty(folder)
    if not counts:
        why = "other parameters than the defaults" if not is_default else "not a run of the workbook"
        print(f"Claims and figures of this run go to build/scratch/{name} and do not count: {why}.")
    return Notebook(name, Parameters(values), is_default, counts, folder, layout)
