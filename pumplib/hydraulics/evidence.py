"""Thesis 3.3.2, 3.3.3: what measured pump curves say about the forms (3.19) and (3.24); beyond the thesis."""

from dataclasses import dataclass
from pathlib import Path

from pumplib.errors import DataError
from pumplib.hydraulics.curves import (
    Provenance,
    PumpCurve,
    PumpFit,
    explain,
    fit_curve,
    provenance,
    read_curves,
)


@dataclass(frozen=True, kw_only=True, slots=True)
class Assessment:
    """Every pump of a table with its fit, its provenance and an explanation where a form falls short.

    Parameters
    ----------
    curves : tuple of PumpCurve
        Measured curves.
    fits : tuple of PumpFit
        Their fits.
    flags : tuple of Provenance
        Whether each is evidence of its own.
    explanations : tuple of tuple of str
        What the curve's shape says about a misfit; empty where both forms fit.
    """

    curves: tuple[PumpCurve, ...]
    fits: tuple[PumpFit, ...]
    flags: tuple[Provenance, ...]
    explanations: tuple[tuple[str, ...], ...]

    @property
    def independent(self) -> tuple[bool, ...]:
        """Which pumps are neither copies nor tabulated from a polynomial."""
        return tuple(not flag.reasons for flag in self.flags)

    def share(self, least: float, *, left_out: bool = False) -> float:
        """Share of the independent pumps whose head reaches a coefficient of determination.

        Parameters
        ----------
        least : float
            Least R².
        left_out : bool
            True scores every point with a fit that did not see it (leave-one-out).

        Returns
        -------
        float

        Raises
        ------
        DataError
            If no pump of the table is independent.
        """
        counted = [
            fit.head.loo_r2 if left_out else fit.head.r2
            for fit, own in zip(self.fits, self.independent, strict=True)
            if own
        ]
        if not counted:
            raise DataError("no pump of the table is independent evidence: all are copies or tabulated polynomials.")
        return sum(r2 >= least for r2 in counted) / len(counted)

    def rows(self) -> list[dict[str, object]]:
        """Table of the pumps: goodness of head and torque form, largest residual, evidence.

        Returns
        -------
        list of dict
            One row a pump, ready for a data frame.
        """
        return [
            {
                "pump": fit.name,
                "points": len(curve.flow),
                "head R²": fit.head.r2,
                "head R², left out": fit.head.loo_r2,
                "head max. residual": fit.head.max_residual_relative,
                "torque R²": fit.torque.r2,
                "torque R², left out": fit.torque.loo_r2,
                "counted": "yes" if own else "; ".join(flag.reasons),
            }
            for curve, fit, flag, own in zip(self.curves, self.fits, self.flags, self.independent, strict=True)
        ]

    def coefficients(self) -> list[dict[str, object]]:
        """Fitted coefficients with their 95 % intervals.

        Returns
        -------
        list of dict
            One row a pump and coefficient; SI units, head with rho g absorbed.
        """
        return [
            {"pump": fit.name, "coefficient": name, "value": value, "95 % from": low, "to": high}
            for fit in self.fits
            for form in (fit.head, fit.torque)
            for name, value, (low, high) in zip(form.names, form.coefficients, form.intervals, strict=True)
        ]

    def notes(self) -> list[str]:
        """Explanations, one line a pump that falls short of a form.

        Returns
        -------
        list of str
        """
        return [f"{fit.name}: {' '.join(text)}" for fit, text in zip(self.fits, self.explanations, strict=True) if text]


def assess(path: str | Path) -> Assessment:
    """Read a table of pump curves, fit both forms, and judge what counts as evidence.

    Parameters
    ----------
    path : str or Path
        CSV file, see `read_curves`.

    Returns
    -------
    Assessment

    Raises
    ------
    DataError
        See `read_curves` and `fit_curve`.
    """
    curves = tuple(read_curves(path))
    fits = tuple(fit_curve(curve) for curve in curves)
    return Assessment(
        curves=curves,
        fits=fits,
        flags=tuple(provenance(curves)),
        explanations=tuple(explain(curve, fit) for curve, fit in zip(curves, fits, strict=True)),
    )
