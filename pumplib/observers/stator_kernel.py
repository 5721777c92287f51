"""Thesis 5.2.3, 5.3: the loop of the stator observer: state, speed and fault coefficient, sample by sample.

A complex 2x2 system in real scalars. Each sample

1. the state (i', i_m) is moved exactly from the last sample to this one with the speed known then, the last
   innovation injected through h K, and the sensitivity of the state to the parameters moved with it;
2. the innovation e = i - i' - g_c conj(w) - g_0 w updates (omega, Re g_c, Im g_c) as two scalar measurements of a
   random walk, and the state follows the change of the parameters through its sensitivity.

The walk is normalised by the mean square of each regressor, so that every parameter has a time constant of its own
whatever the voltage. g_0 = |g_c - reference|, slowly: the common mode of a short has the sequence of the healthy
current and is not free.

One compiled function serves records and single samples, so both give the same bits.
"""

import math
from typing import Any

from pumplib.kernels import inline, kernel
from pumplib.observers.stator_design import Design

# flags of a sample
WAITING, SETTLING, INNOVATION, BAND, EXCITATION, REVERSED, UNBALANCE, SUM = 1, 2, 4, 8, 16, 32, 64, 128
COLUMNS = (
    "omega", "T_e", "g_re", "g_im", "e_re", "e_im", "e2", "flag", "omega_s", "vv_re", "vv_im", "v2", "iv_re", "iv_im",
    "ii_re", "ii_im", "i2",
)  # fmt: skip
N_COLUMNS = len(COLUMNS)
N_STATE = 66
# places in the state that the caller looks at
RUNNING, OMEGA, RESTARTS = 0, 1, 2


@inline
def even_odd(p: Any, row: int, u: float, u2: float) -> tuple[float, float]:
    """Value of one entry of the step at a speed.

    Parameters
    ----------
    p : ndarray, shape (8, 10)
        Polynomials of `pumplib.observers.stator_design.step_polynomials`.
    row : int
        Entry.
    u, u2 : float
        Speed in units of the largest, and its square.

    Returns
    -------
    re, im : float
    """
    re = p[row, 0] + u2 * (p[row, 2] + u2 * (p[row, 4] + u2 * (p[row, 6] + u2 * p[row, 8])))
    im = u * (p[row, 1] + u2 * (p[row, 3] + u2 * (p[row, 5] + u2 * (p[row, 7] + u2 * p[row, 9]))))
    return re, im


@kernel
def run_observer(v: Any, i: Any, s: Any, c: Design, p: Any, every: int, out: Any) -> int:
    """Go through samples and write an estimate after every `every` of them.

    Parameters
    ----------
    v, i : ndarray, shape (n, 3)
        Terminal voltages, V, and line currents, A.
    s : ndarray, shape (66,)
        State; zeros at the very first sample. Changed.
    c : Design
        Constants.
    p : ndarray, shape (8, 10)
        Polynomials of the step.
    every : int
        Samples an output row stands for.
    out : ndarray, shape (m, 17)
        Receives `COLUMNS`: means over the row's samples; e of the last sample; flags of all.

    Returns
    -------
    int
        Rows written.
    """
    third, root = 1.0 / 3.0, 0.5773502691896258
    running, omega, restarts = s[0], s[1], s[2]
    xi_re, xi_im, xm_re, xm_im = s[3], s[4], s[5], s[6]
    w_re, w_im, g_re, g_im, g_0 = s[7], s[8], s[9], s[10], s[11]
    # sensitivities of the state to omega (a, b) and to Re g_c (d, f); to Im g_c they are j times the latter
    a_re, a_im, b_re, b_im = s[12], s[13], s[14], s[15]
    d_re, d_im, f_re, f_im = s[16], s[17], s[18], s[19]
    P_oo, P_or, P_oi, P_rr, P_ri, P_ii = s[20], s[21], s[22], s[23], s[24], s[25]
    m_o, m_g = s[26], s[27]  # mean squares of the regressors
    v_re, v_im, e_re, e_im = s[28], s[29], s[30], s[31]
    pv, rot_re, rot_im, pe, pi = s[32], s[33], s[34], s[35], s[36]
    age, counter, outside, bad, omega_s = s[37], s[38], s[39], s[40], s[41]
    q_o, q_g = s[42], s[43]
    # sums of the output row
    filled, flags = int(s[44]), int(s[45])
    n_o, n_T, n_re, n_im, n_e = s[46], s[47], s[48], s[49], s[50]
    n_vv_re, n_vv_im, n_v2, n_iv_re, n_iv_im = s[51], s[52], s[53], s[54], s[55]
    n_ii_re, n_ii_im, n_i2, state, active = s[56], s[57], s[58], int(s[59]), int(s[60])
    pv_re, pv_im, p0, py = s[61], s[62], s[63], s[64]
    slope = s[65]
    scale, half = 1.0 / c.speed_scale, 0.5
    rows = 0
    for k in range(v.shape[0]):
        # space vectors of the windings
        t_re = third * (2.0 * v[k, 0] - v[k, 1] - v[k, 2])
        t_im = root * (v[k, 1] - v[k, 2])
        u_re, u_im = c.v_re * t_re - c.v_im * t_im, c.v_re * t_im + c.v_im * t_re
        t_re = third * (2.0 * i[k, 0] - i[k, 1] - i[k, 2])
        t_im = root * (i[k, 1] - i[k, 2])
        y_re, y_im = c.i_re * t_re - c.i_im * t_im, c.i_re * t_im + c.i_im * t_re
        # filtered voltage, its amplitude and speed of rotation
        o_re, o_im = w_re, w_im
        w_re = c.w_e * o_re + c.w_0 * v_re + c.w_1 * u_re
        w_im = c.w_e * o_im + c.w_0 * v_im + c.w_1 * u_im
        uu = u_re * u_re + u_im * u_im
        pv += c.mean20 * (uu - pv)
        rot_re += c.mean20 * (w_re * o_re + w_im * o_im - rot_re)
        rot_im += c.mean20 * (w_im * o_re - w_re * o_im - rot_im)
        w2 = w_re * w_re + w_im * w_im
        yy = y_re * y_re + y_im * y_im
        y_0 = third * (i[k, 0] + i[k, 1] + i[k, 2])
        pv_re += c.mean50 * (u_re * u_re - u_im * u_im - pv_re)
        pv_im += c.mean50 * (2.0 * u_re * u_im - pv_im)
        p0 += c.mean50 * (y_0 * y_0 - p0)
        py += c.mean50 * (t_re * t_re + t_im * t_im - py)
        counter += 1.0
        if running > 0.5:
            # 1. state and sensitivities to this sample; the speed goes on with the supply
            omega = min(max(omega + c.h * slope, c.speed_low), c.speed_high)
            z = omega * scale
            z2 = z * z
            eii_re, eii_im = even_odd(p, 0, z, z2)
            eim_re, eim_im = even_odd(p, 1, z, z2)
            emi_re, emi_im = even_odd(p, 2, z, z2)
            emm_re, emm_im = even_odd(p, 3, z, z2)
            f0i_re, f0i_im = even_odd(p, 4, z, z2)
            f0m_re, f0m_im = even_odd(p, 5, z, z2)
            f1i_re, f1i_im = even_odd(p, 6, z, z2)
            f1m_re, f1m_im = even_odd(p, 7, z, z2)
            nu = (omega - c.gain_mid) * c.gain_inv_half
            ki_re, ki_im = c.k0_i_re + nu * c.k1_i_re, c.k0_i_im + nu * c.k1_i_im
            km_re, km_im = c.k0_m_re + nu * c.k1_m_re, c.k0_m_im + nu * c.k1_m_im
            old_re, old_im = xm_re, xm_im
            ni_re = (eii_re * xi_re - eii_im * xi_im) + (eim_re * xm_re - eim_im * xm_im)
            ni_im = (eii_re * xi_im + eii_im * xi_re) + (eim_re * xm_im + eim_im * xm_re)
            nm_re = (emi_re * xi_re - emi_im * xi_im) + (emm_re * xm_re - emm_im * xm_im)
            nm_im = (emi_re * xi_im + emi_im * xi_re) + (emm_re * xm_im + emm_im * xm_re)
            ni_re += (f0i_re * v_re - f0i_im * v_im) + (f1i_re * u_re - f1i_im * u_im)
            ni_im += (f0i_re * v_im + f0i_im * v_re) + (f1i_re * u_im + f1i_im * u_re)
            nm_re += (f0m_re * v_re - f0m_im * v_im) + (f1m_re * u_re - f1m_im * u_im)
            nm_im += (f0m_re * v_im + f0m_im * v_re) + (f1m_re * u_im + f1m_im * u_re)
            xi_re = ni_re + (ki_re * e_re - ki_im * e_im)
            xi_im = ni_im + (ki_re * e_im + ki_im * e_re)
            xm_re = nm_re + (km_re * e_re - km_im * e_im)
            xm_im = nm_im + (km_re * e_im + km_im * e_re)
            # E - h K C
            eii_re, eii_im = eii_re - ki_re, eii_im - ki_im
            emi_re, emi_im = emi_re - km_re, emi_im - km_im
            mid_re, mid_im = half * (old_re + xm_re), half * (old_im + xm_im)
            ni_re = (eii_re * a_re - eii_im * a_im) + (eim_re * b_re - eim_im * b_im) - c.a1_i * mid_im
            ni_im = (eii_re * a_im + eii_im * a_re) + (eim_re * b_im + eim_im * b_re) + c.a1_i * mid_re
            nm_re = (emi_re * a_re - emi_im * a_im) + (emm_re * b_re - emm_im * b_im) - c.a1_m * mid_im
            nm_im = (emi_re * a_im + emi_im * a_re) + (emm_re * b_im + emm_im * b_re) + c.a1_m * mid_re
            a_re, a_im, b_re, b_im = ni_re, ni_im, nm_re, nm_im
            # output sensitivity conj(w) of the last sample comes back through K
            ni_re = (eii_re * d_re - eii_im * d_im) + (eim_re * f_re - eim_im * f_im) - (ki_re * o_re + ki_im * o_im)
            ni_im = (eii_re * d_im + eii_im * d_re) + (eim_re * f_im + eim_im * f_re) - (ki_im * o_re - ki_re * o_im)
            nm_re = (emi_re * d_re - emi_im * d_im) + (emm_re * f_re - emm_im * f_im) - (km_re * o_re + km_im * o_im)
            nm_im = (emi_re * d_im + emi_im * d_re) + (emm_re * f_im + emm_im * f_re) - (km_im * o_re - km_re * o_im)
            d_re, d_im, f_re, f_im = ni_re, ni_im, nm_re, nm_im
            # 2. innovation and parameters
            e_re = y_re - xi_re - (g_re * w_re + g_im * w_im) - g_0 * w_re
            e_im = y_im - xi_im - (g_im * w_re - g_re * w_im) - g_0 * w_im
            ee = e_re * e_re + e_im * e_im
            h_re, h_im = d_re + w_re, d_im - w_im  # of Re g_c; of Im g_c: (-h_im, h_re)
            m_o += c.mean20 * (a_re * a_re + a_im * a_im - m_o)
            m_g += c.mean20 * (h_re * h_re + h_im * h_im - m_g)
            P_oo += q_o
            P_rr += q_g
            P_ii += q_g
            # real part of e: row (a_re, h_re, -h_im), noise 1
            r_o = P_oo * a_re + P_or * h_re - P_oi * h_im
            r_r = P_or * a_re + P_rr * h_re - P_ri * h_im
            r_i = P_oi * a_re + P_ri * h_re - P_ii * h_im
            inv = 1.0 / (1.0 + a_re * r_o + h_re * r_r - h_im * r_i)
            k_o, k_r, k_i = r_o * inv, r_r * inv, r_i * inv
            P_oo, P_or, P_oi = P_oo - k_o * r_o, P_or - k_o * r_r, P_oi - k_o * r_i
            P_rr, P_ri, P_ii = P_rr - k_r * r_r, P_ri - k_r * r_i, P_ii - k_i * r_i
            d_o, d_r, d_i = k_o * e_re, k_r * e_re, k_i * e_re
            # imaginary part: row (a_im, h_im, h_re)
            left = e_im - (a_im * d_o + h_im * d_r + h_re * d_i)
            r_o = P_oo * a_im + P_or * h_im + P_oi * h_re
            r_r = P_or * a_im + P_rr * h_im + P_ri * h_re
            r_i = P_oi * a_im + P_ri * h_im + P_ii * h_re
            inv = 1.0 / (1.0 + a_im * r_o + h_im * r_r + h_re * r_i)
            k_o, k_r, k_i = r_o * inv, r_r * inv, r_i * inv
            P_oo, P_or, P_oi = P_oo - k_o * r_o, P_or - k_o * r_r, P_oi - k_o * r_i
            P_rr, P_ri, P_ii = P_rr - k_r * r_r, P_ri - k_r * r_i, P_ii - k_i * r_i
            d_o, d_r, d_i = d_o + k_o * left, d_r + k_r * left, d_i + k_i * left
            new = min(max(omega + d_o, c.speed_low), c.speed_high)
            d_o = new - omega
            omega, g_re, g_im = new, g_re + d_r, g_im + d_i
            xi_re += a_re * d_o + d_re * d_r - d_im * d_i
            xi_im += a_im * d_o + d_im * d_r + d_re * d_i
            xm_re += b_re * d_o + f_re * d_r - f_im * d_i
            xm_im += b_im * d_o + f_im * d_r + f_re * d_i
            z = g_re - c.ref_re
            z2 = g_im - c.ref_im
            g_0 += c.common * (math.sqrt(z * z + z2 * z2) - g_0)
            # what is left after the update goes into the state
            e_re = y_re - xi_re - (g_re * w_re + g_im * w_im) - g_0 * w_re
            e_im = y_im - xi_im - (g_im * w_re - g_re * w_im) - g_0 * w_im
            pe += c.mean50 * (ee - pe)
            pi += c.mean50 * (yy - pi)
            age += 1.0
            active += 1
            n_e += ee
            n_o += omega
            n_T += c.k_T * (xi_im * xm_re - xi_re * xm_im)
            n_re += g_re
            n_im += g_im
        v_re, v_im = u_re, u_im
        # supervision, once a tick
        if counter >= c.tick:
            counter = 0.0
            turning = math.atan2(rot_im, rot_re) * c.inv_h
            if running > 0.5:
                slope += c.slope * ((turning - omega_s) * c.inv_h / c.tick - slope)
            else:
                slope = 0.0
            omega_s = turning
            alive = pv > c.start_voltage2
            state, doubt = 0, 0
            if not alive:
                state |= 1
            if omega_s < -c.slowest:
                state |= 32
            elif omega_s < c.slowest:
                state |= 16
            if pv_re * pv_re + pv_im * pv_im > c.unbalance * pv * pv:
                doubt |= 64
            if p0 > c.sum * py:
                doubt |= 128
            begin = False
            if running > 0.5:
                if state != 0:
                    running = 0.0
                    bad = 0.0
                else:
                    beyond = omega < c.band_low * omega_s or omega > c.band_high * omega_s
                    outside = outside + 1.0 if beyond else 0.0
                    large = pe > c.innovation2 * pi
                    bad = bad + 1.0 if large and age > c.settle else 0.0
                    if age <= c.settle:
                        state |= 2
                    if large:
                        state |= 4
                    if beyond:
                        state |= 8
                    # a wrong solution is left for a fresh start; the first ones come soon, to end with a run-up
                    if outside > c.patience or bad > 5.0 * c.patience:
                        begin = True
                        restarts += 1.0
            elif state == 0:
                # the means need their time before the frequency is known
                bad += 1.0
                if bad > 2.0 * c.patience:
                    begin = True
            if begin:
                running, age, outside, bad = 1.0, 0.0, 0.0, 0.0
                state |= 2 | doubt
                omega = c.start_speed if c.start_speed > 0.0 and restarts == 0.0 else omega_s
                omega = min(max(omega, c.speed_low), c.speed_high)
                # steady state of this sample: stator flux from the voltage behind the resistance
                xi_re, xi_im = y_re, y_im
                xm_re = ((u_im - c.r_s * y_im) / omega_s - c.L_s * y_re) * c.inv_L_m
                xm_im = (-(u_re - c.r_s * y_re) / omega_s - c.L_s * y_im) * c.inv_L_m
                g_re, g_im, g_0 = c.ref_re, c.ref_im, 0.0
                a_re, a_im, b_re, b_im = 0.0, 0.0, 0.0, 0.0
                d_re, d_im, f_re, f_im = 0.0, 0.0, 0.0, 0.0
                P_oo, P_rr, P_ii = c.p_speed, c.p_fault, c.p_fault
                P_or, P_oi, P_ri = 0.0, 0.0, 0.0
                m_o, m_g, q_o, q_g = 0.0, w2, 0.0, 0.0
                e_re, e_im, pe, pi = 0.0, 0.0, 0.0, yy
            elif running > 0.5:
                state |= doubt
                q_o = c.q_speed / max(m_o, 1e-12)
                q_g = c.q_fault / max(m_g, 1e-12)
                # a regressor that fades must not let its covariance grow without end
                if P_oo > c.p_speed:
                    z = math.sqrt(c.p_speed / P_oo)
                    P_oo, P_or, P_oi = P_oo * z * z, P_or * z, P_oi * z
                if P_rr > c.p_fault:
                    z = math.sqrt(c.p_fault / P_rr)
                    P_rr, P_or, P_ri = P_rr * z * z, P_or * z, P_ri * z
                if P_ii > c.p_fault:
                    z = math.sqrt(c.p_fault / P_ii)
                    P_ii, P_oi, P_ri = P_ii * z * z, P_oi * z, P_ri * z
        flags |= state if running > 0.5 else state | 1
        n_vv_re += u_re * u_re - u_im * u_im
        n_vv_im += 2.0 * u_re * u_im
        n_v2 += uu
        n_iv_re += y_re * u_re + y_im * u_im
        n_iv_im += y_im * u_re - y_re * u_im
        n_ii_re += y_re * u_re - y_im * u_im
        n_ii_im += y_re * u_im + y_im * u_re
        n_i2 += yy
        filled += 1
        if filled >= every:
            z = 1.0 / filled
            on = active == filled
            out[rows, 0] = z * n_o if on else math.nan
            out[rows, 1] = z * n_T if on else math.nan
            out[rows, 2] = z * n_re if on else math.nan
            out[rows, 3] = z * n_im if on else math.nan
            out[rows, 4] = e_re if on else math.nan
            out[rows, 5] = e_im if on else math.nan
            out[rows, 6] = z * n_e if on else math.nan
            out[rows, 7] = float(flags)
            out[rows, 8] = omega_s
            out[rows, 9] = z * n_vv_re
            out[rows, 10] = z * n_vv_im
            out[rows, 11] = z * n_v2
            out[rows, 12] = z * n_iv_re
            out[rows, 13] = z * n_iv_im
            out[rows, 14] = z * n_ii_re
            out[rows, 15] = z * n_ii_im
            out[rows, 16] = z * n_i2
            rows += 1
            filled, flags, active = 0, 0, 0
            n_o, n_T, n_re, n_im, n_e = 0.0, 0.0, 0.0, 0.0, 0.0
            n_vv_re, n_vv_im, n_v2, n_iv_re, n_iv_im = 0.0, 0.0, 0.0, 0.0, 0.0
            n_ii_re, n_ii_im, n_i2 = 0.0, 0.0, 0.0
    s[0], s[1], s[2] = running, omega, restarts
    s[3], s[4], s[5], s[6] = xi_re, xi_im, xm_re, xm_im
    s[7], s[8], s[9], s[10], s[11] = w_re, w_im, g_re, g_im, g_0
    s[12], s[13], s[14], s[15] = a_re, a_im, b_re, b_im
    s[16], s[17], s[18], s[19] = d_re, d_im, f_re, f_im
    s[20], s[21], s[22], s[23], s[24], s[25] = P_oo, P_or, P_oi, P_rr, P_ri, P_ii
    s[26], s[27] = m_o, m_g
    s[28], s[29], s[30], s[31] = v_re, v_im, e_re, e_im
    s[32], s[33], s[34], s[35], s[36] = pv, rot_re, rot_im, pe, pi
    s[37], s[38], s[39], s[40], s[41] = age, counter, outside, bad, omega_s
    s[42], s[43] = q_o, q_g
    s[44], s[45] = float(filled), float(flags)
    s[46], s[47], s[48], s[49], s[50] = n_o, n_T, n_re, n_im, n_e
    s[51], s[52], s[53], s[54], s[55] = n_vv_re, n_vv_im, n_v2, n_iv_re, n_iv_im
    s[56], s[57], s[58], s[59], s[60] = n_ii_re, n_ii_im, n_i2, float(state), float(active)
    s[61], s[62], s[63], s[64] = pv_re, pv_im, p0, py
    s[65] = slope
    return rows
