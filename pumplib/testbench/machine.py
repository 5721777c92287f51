"""Thesis 4.4.2, 5.3, 6.7, 7.4: the machine on the bench: a motor-pump set with what its monitor does not know."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Liquid, PumpSet
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.testbench.kernels import Source, Thermal
from pumplib.testbench.plant import Constants


@dataclass(frozen=True, kw_only=True, slots=True)
class BenchMachine(Parameters):
    """A motor-pump set and everything that makes it differ from the models of the observers.

    The defaults are all off: the plant of chapter 3. Machines of a profile are drawn by
    `pumplib.testbench.scenario.draw_machine`.
    """

    base: PumpSet
    saturation: Annotated[
        Literal["none", "main", "rotor"],
        Choice("flux that saturates: main flux, or rotor flux as in the profile pump", ("none", "main", "rotor")),
    ] = "none"
    sat_0: Annotated[float, Quantity("-", "unsaturated share of the magnetising current", 0.0, 1.0)] = 1.0
    sat_6: Annotated[float, Quantity("-", "share that grows with the sixth power of the flux", 0.0, 10.0)] = 0.0
    sat_flux: Annotated[float, Quantity("V s", "flux of the saturation law", 0.0, 100.0, True)] = 1.0
    asymmetry: Annotated[
        tuple[float, ...], Quantity("-", "relative deviations of the phase resistances a, b, c", -0.5, 0.5)
    ] = (0.0, 0.0, 0.0)
    iron_loss: Annotated[float, Quantity("W", "iron loss at loss_voltage", 0.0, 1e5)] = 0.0
    stray_loss: Annotated[float, Quantity("W", "stray and other drag loss at loss_speed", 0.0, 1e5)] = 0.0
    loss_voltage: Annotated[float, Quantity("V", "stator voltage amplitude of iron_loss", 0.0, 2e4, True)] = 325.0
    loss_speed: Annotated[float, Quantity("rad/s", "speed of stray_loss", 0.0, 1050.0, True)] = 300.0
    eccentricity: Annotated[float, Quantity("-", "permeance wave once a turn", 0.0, 0.3)] = 0.0
    slot_permeance: Annotated[float, Quantity("-", "permeance wave of the rotor slots", 0.0, 0.3)] = 0.0
    slots: Annotated[int, Quantity("-", "rotor slots", 1, 200)] = 28
    kappa_c: Annotated[float, Quantity("-", "uncoupled share of the leakage between winding sections", 0.0, 1.0)] = 1.0
    head_cubic: Annotated[float, Quantity("-", "cubic head loss, Pa s3/m9 at 250 rad/s", 0.0, 1e20)] = 0.0
    leakage_gain: Annotated[float, Quantity("-", "healthy leakage K of q = K sqrt(H), m3/s/sqrt(Pa)", 0.0, 1e-3)] = 0.0
    leakage_lag: Annotated[float, Quantity("s", "lag of that leakage; 0 takes (3.25) instead", 0.0, 10.0)] = 0.0
    valve_lag: Annotated[float, Quantity("s", "lag of the valve; 0 follows at once", 0.0, 100.0)] = 0.0
    check_valve: bool = False
    npsh_0: Annotated[float, Quantity("m", "NPSH needed at zero flow; 0 switches the trigger off", 0.0, 100.0)] = 0.0
    npsh_2: Annotated[float, Quantity("s2/m5", "growth of the needed NPSH with the squared flow", 0.0, 1e12)] = 0.0
    npsh_gain: Annotated[float, Quantity("-", "cavitation per relative lack of NPSH", 0.0, 10.0)] = 1.0
    vapour_pressure: Annotated[float, Quantity("Pa", "vapour pressure below the atmosphere", -2e5, 1e6)] = -99e3
    thermal_capacity: Annotated[float, Quantity("-", "heat capacity of the winding, J/K; 0 holds it", 0.0, 1e7)] = 0.0
    thermal_resistance: Annotated[float, Quantity("-", "winding to ambient, K/W", 0.0, 100.0, True)] = 1.0
    ambient: Annotated[float, Quantity("K", "ambient temperature", 200.0, 400.0)] = 293.15
    alpha: Annotated[float, Quantity("1/K", "temperature coefficient of the resistances", 0.0, 0.01)] = 3.93e-3

    def _check_together(self) -> None:
        if len(self.asymmetry) != 3:
            raise ParameterError(f"BenchMachine.asymmetry = {self.asymmetry!r}: give one deviation a phase, (a, b, c).")
        if self.saturation == "none" and self.sat_6 != 0.0:
            raise ParameterError('BenchMachine.sat_6 is set but saturation = "none"; choose "main" or "rotor".')


def constants(machine: BenchMachine, liquid: Liquid | None = None) -> Constants:
    """Constants of the kernel.

    Parameters
    ----------
    machine : BenchMachine
        The machine.
    liquid : Liquid, optional
        For the NPSH trigger; water if left out.

    Returns
    -------
    Constants

    References
    ----------
    Thesis 3.2-3.3 for the part that chapter 3 has.
    """
    liquid = liquid or Liquid()
    base = machine.base
    motor, pump, application = base.motor, base.pump, base.application
    n, inertia = pump.stages, base.inertia
    saturated = machine.saturation != "none"
    return Constants(
        delta=1.0 if motor.connection == "delta" else 0.0,
        r_s=motor.r_s,
        r_r=motor.r_r,
        inv_L_ls=1 / motor.L_ls,
        inv_L_lr=1 / motor.L_lr,
        inv_L_m=1 / motor.L_m,
        sat_0=machine.sat_0 if saturated else 1.0,
        sat_6=machine.sat_6 if saturated else 0.0,
        inv_sat_psi=1 / machine.sat_flux,
        sat_rotor=1.0 if machine.saturation == "rotor" else 0.0,
        z_p=float(motor.z_p),
        asym_a=machine.asymmetry[0],
        asym_b=machine.asymmetry[1],
        asym_c=machine.asymmetry[2],
        G_fe=machine.iron_loss / (1.5 * machine.loss_voltage**2),
        perm_1=machine.eccentricity,
        perm_n=machine.slot_permeance,
        slots=float(machine.slots),
        kappa_c=machine.kappa_c,
        L_ls=motor.L_ls,
        a_h0=n * pump.a_h0,
        a_h1=n * pump.a_h1,
        a_h2=n * pump.a_h2,
        a_h3=machine.head_cubic,
        a_t0=n * pump.a_t0,
        a_t1=n * pump.a_t1,
        a_t2=n * pump.a_t2,
        K_c=pump.K_c,
        leak_a=pump.a / n,
        leak_K_l=pump.K_l,
        leak_inv_K_J=1 / pump.K_J,
        leak_gain=machine.leakage_gain,
        leak_inv_lag=1 / machine.leakage_lag if machine.leakage_lag > 0 else 0.0,
        p_static=application.p_static,
        K_pipe=application.K_pipe,
        inv_K_p=1 / application.K_p,
        B=base.friction + machine.stray_loss / machine.loss_speed**2,
        K_Q_J=n * pump.K_Q / inertia,
        inv_J=1 / inertia,
        valve_inv_lag=1 / machine.valve_lag if machine.valve_lag > 0 else 0.0,
        check_valve=1.0 if machine.check_valve else 0.0,
        npsh_0=machine.npsh_0,
        npsh_2=machine.npsh_2,
        npsh_gain=machine.npsh_gain,
        p_vapour=machine.vapour_pressure,
        inv_weight=1 / (liquid.rho * liquid.g),
    )


def thermal(machine: BenchMachine) -> Thermal:
    """Thermal constants of the kernel.

    Parameters
    ----------
    machine : BenchMachine
        The machine.

    Returns
    -------
    Thermal
    """
    on = machine.thermal_capacity > 0
    return Thermal(
        inv_C=1 / machine.thermal_capacity if on else 0.0,
        inv_R=1 / machine.thermal_resistance,
        ambient=machine.ambient,
        reference=machine.ambient,
        alpha=machine.alpha if on else 0.0,
    )


def source(
    *,
    third: complex = 0.0,
    fifth: complex = 0.0,
    seventh: complex = 0.0,
    dc_link: float = 0.0,
    switching_hz: float = 0.0,
    dead_time_s: float = 0.0,
    dead_time_current: float = 0.1,
) -> Source:
    """Wave form of the supply.

    Parameters
    ----------
    third, fifth, seventh : complex
        Harmonics relative to the fundamental, with their angle.
    dc_link : float
        Voltage of the inverter's link, V; 0 for a grid.
    switching_hz, dead_time_s : float
        Switching frequency and dead time of the inverter. Measured voltages are means over a switching period;
        the currents carry the ripple of the pulses, which the leakage inductance limits.
    dead_time_current : float
        Current above which the loss is full, A.

    Returns
    -------
    Source

    Raises
    ------
    ParameterError
        If dead time and switching period do not fit.
    """
    if (dc_link > 0) != (switching_hz > 0):
        raise ParameterError(
            f"dc_link = {dc_link:g} V with switching_hz = {switching_hz:g} Hz: an inverter needs both, a grid none."
        )
    share = switching_hz * dead_time_s
    if not 0 <= share < 0.5 or dead_time_current <= 0 or not math.isfinite(dc_link):
        raise ParameterError(
            f"dead_time_s = {dead_time_s:g} s at switching_hz = {switching_hz:g} Hz: the dead time must be shorter "
            "than half a switching period, and dead_time_current > 0 A."
        )
    third, fifth, seventh = complex(third), complex(fifth), complex(seventh)
    return Source(
        h3_re=third.real,
        h3_im=third.imag,
        h5_re=fifth.real,
        h5_im=fifth.imag,
        h7_re=seventh.real,
        h7_im=seventh.imag,
        dead=dc_link * share,
        inv_dead_i=1 / dead_time_current,
        link=dc_link,
        carrier=switching_hz,
    )
