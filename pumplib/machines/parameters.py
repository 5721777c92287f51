"""Thesis 3.2.1, 3.3.2, 3.3.3, 3.3.4, 3.3.5: parameter classes of motor, impeller, pump and application.

All values are SI, all classes frozen and keyword-only. A wrong value is refused when the object is made.
Symbols are the thesis's; where the letters cannot be typed, ``L_ls`` stands for its l_ls and so on.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.machines.units import GRAVITY

_RPM_HINT = 'A larger number is probably in rpm: in a file write unit = "rpm", in Python multiply by 2*pi/60.'
_ANGLE_HINT = 'A larger number is probably in degrees: in a file write unit = "deg".'
_MM_HINT = 'A larger number is probably in mm: in a file write unit = "mm".'


@dataclass(frozen=True, kw_only=True, slots=True)
class Motor(Parameters):
    """Three-phase squirrel-cage induction motor, T-equivalent, per phase, rotor referred to the stator.

    `L_m` is the thesis's L_m = 3/2 l_m. Rated values describe the name plate and are only used for
    plausibility checks and scaling; the model needs the first eight.

    References
    ----------
    Thesis section 3.2, equations (3.1)-(3.7).
    """

    r_s: Annotated[float, Quantity("ohm", "stator resistance of a phase", 0.0, 1e3, True)]
    r_r: Annotated[float, Quantity("ohm", "rotor resistance of a phase, referred to the stator", 0.0, 1e3, True)]
    L_m: Annotated[float, Quantity("H", "main inductance 3/2 l_m", 0.0, 100.0, True)]
    L_ls: Annotated[float, Quantity("H", "stator leakage inductance", 0.0, 10.0, True)]
    L_lr: Annotated[float, Quantity("H", "rotor leakage inductance, referred to the stator", 0.0, 10.0, True)]
    z_p: Annotated[int, Quantity("-", "number of pole pairs", 1, 24)]
    connection: Annotated[Literal["Y", "delta"], Choice("connection of the stator windings", ("Y", "delta"))]
    J: Annotated[float, Quantity("kg m2", "moment of inertia of the rotor", 0.0, 1e3)]
    B: Annotated[float, Quantity("N m s", "linear friction of the rotor", 0.0, 10.0)]
    rated_power: Annotated[float, Quantity("W", "rated shaft power", 0.0, 1e7, True)] | None = None
    rated_voltage: Annotated[float, Quantity("V", "rated line-to-line voltage, rms", 0.0, 2e4, True)] | None = None
    rated_current: Annotated[float, Quantity("A", "rated line current, rms", 0.0, 1e4, True)] | None = None
    rated_frequency: Annotated[float, Quantity("Hz", "rated supply frequency", 0.0, 500.0, True)] | None = None
    rated_speed: Annotated[float, Quantity("rad/s", "rated shaft speed", 0.0, 1050.0, True, _RPM_HINT)] | None = None

    def _check_together(self) -> None:
        if max(self.L_ls, self.L_lr) / self.L_m > 0.5:
            raise ParameterError(
                f"Motor.L_ls = {self.L_ls:g} H, L_lr = {self.L_lr:g} H with L_m = {self.L_m:g} H: the leakage of an "
                "induction motor is a few per cent of L_m; check mH against H and that L_m is 3/2 l_m."
            )
        if self.rated_speed is not None and self.rated_frequency is not None:
            slip = 1 - self.z_p * self.rated_speed / (2 * math.pi * self.rated_frequency)
            if not 0 < slip < 0.3:
                raise ParameterError(
                    f"Motor.rated_speed = {self.rated_speed:g} rad/s gives a slip of {slip:.3g} at "
                    f"{self.rated_frequency:g} Hz with z_p = {self.z_p}: must lie between 0 and 0.3. "
                    "Check rpm against rad/s, and pole pairs against poles."
                )

    @property
    def L_s(self) -> float:
        """Stator self inductance, H."""
        return self.L_m + self.L_ls

    @property
    def L_r(self) -> float:
        """Rotor self inductance, H."""
        return self.L_m + self.L_lr

    @property
    def R_r_prime(self) -> float:
        """Rotor resistance of (3.7), R_r' = (L_m/L_r)^2 r_r, ohm."""
        return (self.L_m / self.L_r) ** 2 * self.r_r

    @property
    def L_s_prime(self) -> float:
        """Transient stator inductance of (3.7), L_s' = L_s - L_m^2/L_r, H."""
        # written without the difference of two large numbers
        return self.L_ls + self.L_m * self.L_lr / self.L_r

    @property
    def L_m_prime(self) -> float:
        """Magnetising inductance of (3.7), L_m' = L_m^2/L_r, H."""
        return self.L_m**2 / self.L_r


@dataclass(frozen=True, kw_only=True, slots=True)
class MotorLosses(Parameters):
    """Losses and temperatures of a motor beyond the thesis's model (thesis 3.2 neglects iron losses).

    Core loss goes with the square of the voltage of its branch (where the branch sits is a choice of the
    circuit, see `pumplib.motor.circuit`), friction torque with the speed, stray-load torque with the square of
    the phase current.
    """

    core_loss: Annotated[float, Quantity("W", "core loss at core_voltage, all phases")]
    core_voltage: Annotated[
        float, Quantity("V", "voltage of the core branch at which core_loss holds, rms", 0.0, 2e4, True)
    ]
    friction_loss: Annotated[float, Quantity("W", "friction and windage loss at loss_speed")]
    stray_loss: Annotated[float, Quantity("W", "stray-load loss at stray_current and loss_speed")]
    stray_current: Annotated[float, Quantity("A", "phase current at which stray_loss holds, rms", 0.0, 1e4, True)]
    loss_speed: Annotated[float, Quantity("rad/s", "shaft speed of the loss figures", 0.0, 1050.0, True, _RPM_HINT)]
    temperature_reference: Annotated[float, Quantity("K", "temperature of r_s and r_r in the file", 200.0, 500.0)]
    temperature: Annotated[float, Quantity("K", "winding temperature in operation", 200.0, 500.0)]
    alpha_s: Annotated[float, Quantity("1/K", "temperature coefficient of r_s at the reference", 0.0, 0.01)]
    alpha_r: Annotated[float, Quantity("1/K", "temperature coefficient of r_r at the reference", 0.0, 0.01)]


@dataclass(frozen=True, kw_only=True, slots=True)
class Liquid(Parameters):
    """Pumped liquid and gravity."""

    rho: Annotated[float, Quantity("kg/m3", "density", 300.0, 3000.0)] = 998.2
    g: Annotated[float, Quantity("m/s2", "gravity", 9.7, 9.9)] = GRAVITY


@dataclass(frozen=True, kw_only=True, slots=True)
class Impeller(Parameters):
    """Geometry and losses of one impeller.

    References
    ----------
    Thesis sections 3.3.2-3.3.3, figure 3.8, equations (3.15)-(3.24).
    """

    r_1: Annotated[float, Quantity("m", "radius of the blade inlet", 0.0, 1.5, True, _MM_HINT)]
    r_2: Annotated[float, Quantity("m", "radius of the blade outlet", 0.0, 1.5, True, _MM_HINT)]
    h: Annotated[float, Quantity("m", "height of the impeller channel", 0.0, 0.5, True, _MM_HINT)]
    beta: Annotated[
        tuple[float, ...],
        Quantity("rad", "blade angles at equally spaced radii r_1..r_2", 0.0, math.pi / 2, True, _ANGLE_HINT),
    ]
    sigma_s: Annotated[float, Quantity("-", "slip factor", 0.0, 1.0, True)]
    K_s: Annotated[float, Quantity("s2/m5", "shock loss coefficient")]
    K_f: Annotated[float, Quantity("s2/m5", "friction loss coefficient")]
    K_d: Annotated[float, Quantity("m3", "design flow per speed, Q_d = K_d omega")]
    K_n: Annotated[float, Quantity("N m s2", "disc friction coefficient")]

    def _check_together(self) -> None:
        if self.r_2 <= self.r_1:
            raise ParameterError(
                f"Impeller.r_2 = {self.r_2:g} m: must be larger than r_1 = {self.r_1:g} m (outlet outside inlet)."
            )
        if len(self.beta) < 2:
            raise ParameterError(
                f"Impeller.beta = {self.beta!r} rad: needs at least the inlet and the outlet angle, (beta_1, beta_2)."
            )


@dataclass(frozen=True, kw_only=True, slots=True)
class Pump(Parameters):
    """Hydraulics and mechanics of a pump of `stages` equal stages.

    Head, torque, J_Mv and K_Q are those of *one* stage; stages in series share speed and flow, so they add
    (thesis 3.3.5, reconstructed). Head coefficients carry rho*g: they give pressure in Pa, as in chapters 6-8.

    References
    ----------
    Thesis equations (3.19)-(3.25).
    """

    a_h0: Annotated[float, Quantity("Pa s2", "head coefficient of omega^2, a stage", 0.0, 1e4, True)]
    a_h1: Annotated[float, Quantity("Pa s2/m3", "head coefficient of omega Q, a stage", -1e9, 1e9)]
    a_h2: Annotated[float, Quantity("Pa s2/m6", "head coefficient of -Q^2, a stage", 0.0, 1e16, True)]
    a_t0: Annotated[float, Quantity("N m s2", "torque coefficient of omega^2, a stage", 0.0, 10.0)]
    a_t1: Annotated[float, Quantity("N m s2/m3", "torque coefficient of omega Q, a stage", 0.0, 1e6)]
    a_t2: Annotated[float, Quantity("N m s2/m6", "torque coefficient of -Q^2, a stage", -1e12, 1e12)]
    J: Annotated[float, Quantity("kg m2", "moment of inertia of impellers and shaft, dry", 0.0, 1e3)]
    J_Mv: Annotated[float, Quantity("kg m2", "moment of inertia of the liquid, a stage", 0.0, 1e2)]
    K_Q: Annotated[float, Quantity("N m s2/m3", "torque per rate of change of flow, a stage", -1e6, 1e6)]
    B: Annotated[float, Quantity("N m s", "linear friction of bearings and seals", 0.0, 10.0)]
    K_c: Annotated[float, Quantity("Pa s2/m6", "casing loss coefficient, whole pump", 0.0, 1e16)]
    K_l: Annotated[float, Quantity("Pa s2/m6", "loss coefficient of the leakage path, a stage", 0.0, 1e22, True)]
    K_J: Annotated[float, Quantity("Pa s2/m3", "inertia of the leakage path, a stage", 0.0, 1e12, True)]
    a: Annotated[float, Quantity("-", "share of the impeller pressure that acts on the leakage", 0.0, 1.0)]
    stages: Annotated[int, Quantity("-", "number of stages in series", 1, 200)] = 1


@dataclass(frozen=True, kw_only=True, slots=True)
class Application(Parameters):
    """What the pump delivers into: pipe, valve and static pressure; unknown to every FDI algorithm of the thesis.

    References
    ----------
    Thesis figure 3.2; the equation is a reconstruction (thesis 3.5 is not in the surviving text).
    """

    K_p: Annotated[float, Quantity("Pa s2/m3", "inertia of the liquid in the pipe", 0.0, 1e12, True)]
    K_v: Annotated[float, Quantity("Pa s2/m6", "loss coefficient of the valve", 0.0, 1e18)]
    K_pipe: Annotated[float, Quantity("Pa s2/m6", "loss coefficient of the pipe", 0.0, 1e18)] = 0.0
    p_static: Annotated[float, Quantity("Pa", "static back pressure", -1e6, 1e8)] = 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class PumpSet(Parameters):
    """Motor, pump and application on one shaft and one pipe."""

    motor: Motor
    pump: Pump
    application: Application

    def _check_together(self) -> None:
        if self.inertia <= 0:
            raise ParameterError(
                "PumpSet: motor.J + pump.J + stages*pump.J_Mv = 0 kg m2; at least one inertia must be positive."
            )

    @property
    def inertia(self) -> float:
        """Moment of inertia on the shaft with the liquid, J + J_Mv, kg m2."""
        return self.motor.J + self.pump.J + self.pump.stages * self.pump.J_Mv

    @property
    def friction(self) -> float:
        """Linear friction on the shaft, N m s."""
        return self.motor.B + self.pump.B
