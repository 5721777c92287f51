"""Thesis 5.3: commissioning: what healthy records tell about machine and sensors, and what they predict for the next.

The negative sequence of a healthy machine is not zero: the supply is unbalanced and meets an impedance that is
believed a few per cent wrong, the gains of the channels differ, the phases are a little unequal, the winding is
warmer than at commissioning. Every one of these causes has a known direction in

    y_2 = I_2/conj(V_1) = Y_2(theta) (rho - eps_v) + (eps_i - Y_2 r_s zeta) conj(y_1)

and a tolerance from a data sheet. They are the unknowns of a Gaussian model, linear around the belief; healthy
records narrow them down (Bayes, as a regression whose ridge is the tolerances), and the model gives for any other
window the fault coefficient of the healthy machine with its covariance. What is left over, measured in its own
standard deviations, is the statistic of the decision: small where little is known, large where a lot is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.observers.stator_sequences import Sequences, admittance, fault_coefficient

Array = NDArray[Any]
UNKNOWNS = ("r_s", "r_r", "L_m", "L_ls", "L_lr", "eps_v_re", "eps_v_im", "eps_i_re", "eps_i_im", "zeta_re", "zeta_im",
            "warm")  # fmt: skip
WARM = UNKNOWNS.index("warm")
_RELATIVE = UNKNOWNS[:5]


@dataclass(frozen=True, kw_only=True, slots=True)
class Tolerances(Parameters):
    """How far machine and sensors may lie from what is believed; half widths, as data sheets state them."""

    parameters: Annotated[float, Quantity("-", "tolerance of each motor parameter", 0.0, 1.0)] = 0.05
    gain: Annotated[float, Quantity("-", "gain tolerance of each channel", 0.0, 0.2)] = 0.005
    asymmetry: Annotated[float, Quantity("-", "relative difference of the phase resistances", 0.0, 0.2)] = 0.002
    warm: Annotated[float, Quantity("-", "rise of the resistances above commissioning, at most", 0.0, 1.0)] = 0.2
    noise: Annotated[float, Quantity("-", "error of g_c that no cause explains", 1e-7, 1.0)] = 2e-4
    model: Annotated[float, Quantity("-", "error of the answer to the supply's unbalance", 0.0, 1.0)] = 0.02


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Commissioning:
    """What is known about one healthy machine; `commission` makes it.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    tolerances : Tolerances
        Of machine and sensors.
    mean : ndarray, shape (12,)
        Of the unknowns `UNKNOWNS`.
    covariance : ndarray, shape (12, 12)
        Of the unknowns.
    records : int
        Healthy records seen.
    reference : complex
        Mean fault coefficient of the observer in these records; NaN without any.
    """

    motor: Motor
    tolerances: Tolerances
    mean: Array
    covariance: Array
    records: int = 0
    reference: complex = complex(np.nan, np.nan)

    def predict(self, s: Sequences) -> tuple[Array, Array]:
        """Fault coefficient that the healthy machine would show in a window.

        Parameters
        ----------
        s : Sequences
            One window or many.

        Returns
        -------
        g_c : complex ndarray, shape (...)
        covariance : ndarray, shape (..., 2, 2)
            Of its real and imaginary part, with the noise of a window.
        """
        H, noise = _directions(self.motor, s, self.tolerances)
        found = H @ self.mean
        spread = np.einsum("...ip,pq,...jq->...ij", H, self.covariance, H)
        return found[..., 0] + 1j * found[..., 1], spread + noise[..., None, None] * np.eye(2)

    def update(self, s: Sequences, *, cold: bool) -> "Commissioning":
        """Learn from a window in which the machine is known to be healthy.

        Parameters
        ----------
        s : Sequences
            One window.
        cold : bool
            Whether the winding is as cold as at commissioning. A window of the present run (False) also tells
            how warm it is now; that holds for this run only.

        Returns
        -------
        Commissioning

        Raises
        ------
        DataError
            If the window holds anything but finite numbers.
        """
        H, noise = _directions(self.motor, s, self.tolerances)
        y = fault_coefficient(self.motor, s)
        if np.ndim(y) != 0 or not np.isfinite(y):
            raise DataError("commissioning window: needs one window of finite sequences; check its record.")
        if cold:
            H = H.copy()
            H[:, WARM] = 0.0
        S = H @ self.covariance @ H.T + noise * np.eye(2)
        K = np.linalg.solve(S, H @ self.covariance).T
        keep = np.eye(len(UNKNOWNS)) - K @ H
        return replace(
            self,
            mean=self.mean + K @ (np.array([y.real, y.imag]) - H @ self.mean),
            covariance=keep @ self.covariance @ keep.T + noise * K @ K.T,
        )

    @property
    def r_s(self) -> tuple[float, float]:
        """Present stator resistance, ohm, and its standard deviation."""
        ln = np.zeros(len(UNKNOWNS))
        ln[0], ln[WARM] = 1.0, 1.0 / (1.0 + self.mean[WARM])
        value = self.motor.r_s * np.exp(self.mean[0]) * (1.0 + self.mean[WARM])
        return float(value), float(value * np.sqrt(ln @ self.covariance @ ln))


def believed(motor: Motor, tolerances: Tolerances | None = None) -> Commissioning:
    """What is known before any record: the belief and its tolerances.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    tolerances : Tolerances, optional
        Of machine and sensors.

    Returns
    -------
    Commissioning
    """
    known = tolerances or Tolerances()
    # half widths of even distributions; three channels share a gain difference, amplitude 1/3 sum eps_k a^2k
    gain = known.gain / np.sqrt(3) / np.sqrt(6)
    sigma = np.array(
        [known.parameters / np.sqrt(3)] * 5 + [gain] * 4 + [known.asymmetry / np.sqrt(3) / 2] * 2
        + [known.warm / np.sqrt(12)]
    )  # fmt: skip
    mean = np.zeros(len(UNKNOWNS))
    mean[WARM] = 0.5 * known.warm
    return Commissioning(motor=motor, tolerances=known, mean=mean, covariance=np.diag(sigma**2))


def commission(records: Sequence[Sequences], motor: Motor, tolerances: Tolerances | None = None) -> Commissioning:
    """Learn a healthy machine from one or more cold records.

    Parameters
    ----------
    records : sequence of Sequences
        One window of each record; different speeds, loads and supplies teach most.
    motor : Motor
        What is believed about the motor.
    tolerances : Tolerances, optional
        Of machine and sensors.

    Returns
    -------
    Commissioning

    Raises
    ------
    DataError
        If there is no record, or one is not finite.
    """
    if not records:
        raise DataError("commission: needs at least one healthy record; without any use believed(motor).")
    known = believed(motor, tolerances)
    for one in records:
        known = known.update(one, cold=True)
    return replace(known, records=len(records), reference=complex(np.mean([one.g_c for one in records])))


def _directions(motor: Motor, s: Sequences, known: Tolerances) -> tuple[Array, Array]:
    """Change of g_c with each unknown, (..., 2, 12), and the variance of what none explains."""
    conj_Z = motor.r_s - 1j * s.omega_s * motor.L_ls
    Y = admittance(motor, -s.omega_s, s.omega)
    size = 1e-5
    columns = [
        conj_Z * s.rho * (admittance(replace(motor, **{name: (1 + size) * getattr(motor, name)}), -s.omega_s, s.omega)
                          - Y) / size
        for name in _RELATIVE
    ]  # fmt: skip
    voltage, current = -conj_Z * Y, conj_Z * np.conj(s.y_1)
    unequal = -conj_Z * Y * motor.r_s * np.conj(s.y_1)
    columns += [voltage, 1j * voltage, current, 1j * current, unequal, 1j * unequal, columns[0] + columns[1]]
    H = np.stack(columns, axis=-1)
    noise = known.noise**2 + (known.model * np.abs(conj_Z * Y * s.rho)) ** 2
    return np.stack([H.real, H.imag], axis=-2), noise
