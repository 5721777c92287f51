/* The loop of pumplib/observers/stator_kernel.py in C, operation by operation, for comparing times. */
#include <math.h>

enum { N_COLUMNS = 17 };

typedef struct {
    double h;
    double inv_h;
    double speed_scale;
    double speed_low;
    double speed_high;
    double gain_mid;
    double gain_inv_half;
    double k0_i_re;
    double k0_i_im;
    double k0_m_re;
    double k0_m_im;
    double k1_i_re;
    double k1_i_im;
    double k1_m_re;
    double k1_m_im;
    double w_e;
    double w_0;
    double w_1;
    double a1_i;
    double a1_m;
    double k_T;
    double r_s;
    double L_s;
    double inv_L_m;
    double v_re;
    double v_im;
    double i_re;
    double i_im;
    double q_speed;
    double q_fault;
    double common;
    double p_speed;
    double p_fault;
    double mean20;
    double mean50;
    double start_voltage2;
    double start_speed;
    double settle;
    double band_low;
    double band_high;
    double innovation2;
    double unbalance;
    double sum_;
    double slope;
    double slowest;
    double tick;
    double patience;
    double ref_re;
    double ref_im;
} Design;

static inline void even_odd(const double *p, int row, double u, double u2, double *re, double *im)
{
    const double *a = p + 10 * row;
    *re = a[0] + u2 * (a[2] + u2 * (a[4] + u2 * (a[6] + u2 * a[8])));
    *im = u * (a[1] + u2 * (a[3] + u2 * (a[5] + u2 * (a[7] + u2 * a[9]))));
}

long run_observer(
    const double *restrict v, const double *restrict i, long n, double *restrict s, const Design *restrict c,
    const double *restrict p, long every, double *restrict out)
{
    double P_ii, P_oi, P_oo, P_or, P_ri, P_rr, a_im, a_re, age, b_im, b_re, bad, counter, d_i, d_im, d_o, d_r, d_re,
        e_im, e_re, ee, eii_im, eii_re, eim_im, eim_re, emi_im, emi_re, emm_im, emm_re, f0i_im, f0i_re, f0m_im,
        f0m_re, f1i_im, f1i_re, f1m_im, f1m_re, f_im, f_re, g_0, g_im, g_re, h_im, h_re, half, inv, k_i, k_o, k_r,
        ki_im, ki_re, km_im, km_re, left, m_g, m_o, mid_im, mid_re, n_T, n_e, n_i2, n_ii_im, n_ii_re, n_im, n_iv_im,
        n_iv_re, n_o, n_re, n_v2, n_vv_im, n_vv_re, new, ni_im, ni_re, nm_im, nm_re, nu, o_im, o_re, old_im, old_re,
        omega, omega_s, outside, p0, pe, pi, pv, pv_im, pv_re, py, q_g, q_o, r_i, r_o, r_r, restarts, root, rot_im,
        rot_re, running, scale, slope, t_im, t_re, third, turning, u_im, u_re, uu, v_im, v_re, w2, w_im, w_re, xi_im,
        xi_re, xm_im, xm_re, y_0, y_im, y_re, yy, z, z2;
    long active, alive, begin, beyond, doubt, filled, flags, large, on, rows, state;
    third = 1.0 / 3.0;
    root = 0.5773502691896258;
    running = s[0];
    omega = s[1];
    restarts = s[2];
    xi_re = s[3];
    xi_im = s[4];
    xm_re = s[5];
    xm_im = s[6];
    w_re = s[7];
    w_im = s[8];
    g_re = s[9];
    g_im = s[10];
    g_0 = s[11];
    a_re = s[12];
    a_im = s[13];
    b_re = s[14];
    b_im = s[15];
    d_re = s[16];
    d_im = s[17];
    f_re = s[18];
    f_im = s[19];
    P_oo = s[20];
    P_or = s[21];
    P_oi = s[22];
    P_rr = s[23];
    P_ri = s[24];
    P_ii = s[25];
    m_o = s[26];
    m_g = s[27];
    v_re = s[28];
    v_im = s[29];
    e_re = s[30];
    e_im = s[31];
    pv = s[32];
    rot_re = s[33];
    rot_im = s[34];
    pe = s[35];
    pi = s[36];
    age = s[37];
    counter = s[38];
    outside = s[39];
    bad = s[40];
    omega_s = s[41];
    q_o = s[42];
    q_g = s[43];
    filled = (long)(s[44]);
    flags = (long)(s[45]);
    n_o = s[46];
    n_T = s[47];
    n_re = s[48];
    n_im = s[49];
    n_e = s[50];
    n_vv_re = s[51];
    n_vv_im = s[52];
    n_v2 = s[53];
    n_iv_re = s[54];
    n_iv_im = s[55];
    n_ii_re = s[56];
    n_ii_im = s[57];
    n_i2 = s[58];
    state = (long)(s[59]);
    active = (long)(s[60]);
    pv_re = s[61];
    pv_im = s[62];
    p0 = s[63];
    py = s[64];
    slope = s[65];
    scale = 1.0 / c->speed_scale;
    half = 0.5;
    rows = 0;
    for (long k = 0; k < n; k++) {
        t_re = third * (2.0 * v[3*k+0] - v[3*k+1] - v[3*k+2]);
        t_im = root * (v[3*k+1] - v[3*k+2]);
        u_re = c->v_re * t_re - c->v_im * t_im;
        u_im = c->v_re * t_im + c->v_im * t_re;
        t_re = third * (2.0 * i[3*k+0] - i[3*k+1] - i[3*k+2]);
        t_im = root * (i[3*k+1] - i[3*k+2]);
        y_re = c->i_re * t_re - c->i_im * t_im;
        y_im = c->i_re * t_im + c->i_im * t_re;
        o_re = w_re;
        o_im = w_im;
        w_re = c->w_e * o_re + c->w_0 * v_re + c->w_1 * u_re;
        w_im = c->w_e * o_im + c->w_0 * v_im + c->w_1 * u_im;
        uu = u_re * u_re + u_im * u_im;
        pv += c->mean20 * (uu - pv);
        rot_re += c->mean20 * (w_re * o_re + w_im * o_im - rot_re);
        rot_im += c->mean20 * (w_im * o_re - w_re * o_im - rot_im);
        w2 = w_re * w_re + w_im * w_im;
        yy = y_re * y_re + y_im * y_im;
        y_0 = third * (i[3*k+0] + i[3*k+1] + i[3*k+2]);
        pv_re += c->mean50 * (u_re * u_re - u_im * u_im - pv_re);
        pv_im += c->mean50 * (2.0 * u_re * u_im - pv_im);
        p0 += c->mean50 * (y_0 * y_0 - p0);
        py += c->mean50 * (t_re * t_re + t_im * t_im - py);
        counter += 1.0;
        if (running > 0.5) {
            omega = fmin(fmax(omega + c->h * slope, c->speed_low), c->speed_high);
            z = omega * scale;
            z2 = z * z;
            even_odd(p, 0, z, z2, &eii_re, &eii_im);
            even_odd(p, 1, z, z2, &eim_re, &eim_im);
            even_odd(p, 2, z, z2, &emi_re, &emi_im);
            even_odd(p, 3, z, z2, &emm_re, &emm_im);
            even_odd(p, 4, z, z2, &f0i_re, &f0i_im);
            even_odd(p, 5, z, z2, &f0m_re, &f0m_im);
            even_odd(p, 6, z, z2, &f1i_re, &f1i_im);
            even_odd(p, 7, z, z2, &f1m_re, &f1m_im);
            nu = (omega - c->gain_mid) * c->gain_inv_half;
            ki_re = c->k0_i_re + nu * c->k1_i_re;
            ki_im = c->k0_i_im + nu * c->k1_i_im;
            km_re = c->k0_m_re + nu * c->k1_m_re;
            km_im = c->k0_m_im + nu * c->k1_m_im;
            old_re = xm_re;
            old_im = xm_im;
            ni_re = (eii_re * xi_re - eii_im * xi_im) + (eim_re * xm_re - eim_im * xm_im);
            ni_im = (eii_re * xi_im + eii_im * xi_re) + (eim_re * xm_im + eim_im * xm_re);
            nm_re = (emi_re * xi_re - emi_im * xi_im) + (emm_re * xm_re - emm_im * xm_im);
            nm_im = (emi_re * xi_im + emi_im * xi_re) + (emm_re * xm_im + emm_im * xm_re);
            ni_re += (f0i_re * v_re - f0i_im * v_im) + (f1i_re * u_re - f1i_im * u_im);
            ni_im += (f0i_re * v_im + f0i_im * v_re) + (f1i_re * u_im + f1i_im * u_re);
            nm_re += (f0m_re * v_re - f0m_im * v_im) + (f1m_re * u_re - f1m_im * u_im);
            nm_im += (f0m_re * v_im + f0m_im * v_re) + (f1m_re * u_im + f1m_im * u_re);
            xi_re = ni_re + (ki_re * e_re - ki_im * e_im);
            xi_im = ni_im + (ki_re * e_im + ki_im * e_re);
            xm_re = nm_re + (km_re * e_re - km_im * e_im);
            xm_im = nm_im + (km_re * e_im + km_im * e_re);
            eii_re = eii_re - ki_re;
            eii_im = eii_im - ki_im;
            emi_re = emi_re - km_re;
            emi_im = emi_im - km_im;
            mid_re = half * (old_re + xm_re);
            mid_im = half * (old_im + xm_im);
            ni_re = (eii_re * a_re - eii_im * a_im) + (eim_re * b_re - eim_im * b_im) - c->a1_i * mid_im;
            ni_im = (eii_re * a_im + eii_im * a_re) + (eim_re * b_im + eim_im * b_re) + c->a1_i * mid_re;
            nm_re = (emi_re * a_re - emi_im * a_im) + (emm_re * b_re - emm_im * b_im) - c->a1_m * mid_im;
            nm_im = (emi_re * a_im + emi_im * a_re) + (emm_re * b_im + emm_im * b_re) + c->a1_m * mid_re;
            a_re = ni_re;
            a_im = ni_im;
            b_re = nm_re;
            b_im = nm_im;
            ni_re = (eii_re * d_re - eii_im * d_im) + (eim_re * f_re - eim_im * f_im) - (ki_re * o_re + ki_im * o_im);
            ni_im = (eii_re * d_im + eii_im * d_re) + (eim_re * f_im + eim_im * f_re) - (ki_im * o_re - ki_re * o_im);
            nm_re = (emi_re * d_re - emi_im * d_im) + (emm_re * f_re - emm_im * f_im) - (km_re * o_re + km_im * o_im);
            nm_im = (emi_re * d_im + emi_im * d_re) + (emm_re * f_im + emm_im * f_re) - (km_im * o_re - km_re * o_im);
            d_re = ni_re;
            d_im = ni_im;
            f_re = nm_re;
            f_im = nm_im;
            e_re = y_re - xi_re - (g_re * w_re + g_im * w_im) - g_0 * w_re;
            e_im = y_im - xi_im - (g_im * w_re - g_re * w_im) - g_0 * w_im;
            ee = e_re * e_re + e_im * e_im;
            h_re = d_re + w_re;
            h_im = d_im - w_im;
            m_o += c->mean20 * (a_re * a_re + a_im * a_im - m_o);
            m_g += c->mean20 * (h_re * h_re + h_im * h_im - m_g);
            P_oo += q_o;
            P_rr += q_g;
            P_ii += q_g;
            r_o = P_oo * a_re + P_or * h_re - P_oi * h_im;
            r_r = P_or * a_re + P_rr * h_re - P_ri * h_im;
            r_i = P_oi * a_re + P_ri * h_re - P_ii * h_im;
            inv = 1.0 / (1.0 + a_re * r_o + h_re * r_r - h_im * r_i);
            k_o = r_o * inv;
            k_r = r_r * inv;
            k_i = r_i * inv;
            P_oo = P_oo - k_o * r_o;
            P_or = P_or - k_o * r_r;
            P_oi = P_oi - k_o * r_i;
            P_rr = P_rr - k_r * r_r;
            P_ri = P_ri - k_r * r_i;
            P_ii = P_ii - k_i * r_i;
            d_o = k_o * e_re;
            d_r = k_r * e_re;
            d_i = k_i * e_re;
            left = e_im - (a_im * d_o + h_im * d_r + h_re * d_i);
            r_o = P_oo * a_im + P_or * h_im + P_oi * h_re;
            r_r = P_or * a_im + P_rr * h_im + P_ri * h_re;
            r_i = P_oi * a_im + P_ri * h_im + P_ii * h_re;
            inv = 1.0 / (1.0 + a_im * r_o + h_im * r_r + h_re * r_i);
            k_o = r_o * inv;
            k_r = r_r * inv;
            k_i = r_i * inv;
            P_oo = P_oo - k_o * r_o;
            P_or = P_or - k_o * r_r;
            P_oi = P_oi - k_o * r_i;
            P_rr = P_rr - k_r * r_r;
            P_ri = P_ri - k_r * r_i;
            P_ii = P_ii - k_i * r_i;
            d_o = d_o + k_o * left;
            d_r = d_r + k_r * left;
            d_i = d_i + k_i * left;
            new = fmin(fmax(omega + d_o, c->speed_low), c->speed_high);
            d_o = new - omega;
            omega = new;
            g_re = g_re + d_r;
            g_im = g_im + d_i;
            xi_re += a_re * d_o + d_re * d_r - d_im * d_i;
            xi_im += a_im * d_o + d_im * d_r + d_re * d_i;
            xm_re += b_re * d_o + f_re * d_r - f_im * d_i;
            xm_im += b_im * d_o + f_im * d_r + f_re * d_i;
            z = g_re - c->ref_re;
            z2 = g_im - c->ref_im;
            g_0 += c->common * (sqrt(z * z + z2 * z2) - g_0);
            e_re = y_re - xi_re - (g_re * w_re + g_im * w_im) - g_0 * w_re;
            e_im = y_im - xi_im - (g_im * w_re - g_re * w_im) - g_0 * w_im;
            pe += c->mean50 * (ee - pe);
            pi += c->mean50 * (yy - pi);
            age += 1.0;
            active += 1;
            n_e += ee;
            n_o += omega;
            n_T += c->k_T * (xi_im * xm_re - xi_re * xm_im);
            n_re += g_re;
            n_im += g_im;
        }
        v_re = u_re;
        v_im = u_im;
        if (counter >= c->tick) {
            counter = 0.0;
            turning = atan2(rot_im, rot_re) * c->inv_h;
            if (running > 0.5) {
                slope += c->slope * ((turning - omega_s) * c->inv_h / c->tick - slope);
            } else {
                slope = 0.0;
            }
            omega_s = turning;
            alive = pv > c->start_voltage2;
            state = 0;
            doubt = 0;
            if (!alive) {
                state |= 1;
            }
            if (omega_s < -c->slowest) {
                state |= 32;
            } else if (omega_s < c->slowest) {
                state |= 16;
            }
            if (pv_re * pv_re + pv_im * pv_im > c->unbalance * pv * pv) {
                doubt |= 64;
            }
            if (p0 > c->sum_ * py) {
                doubt |= 128;
            }
            begin = 0;
            if (running > 0.5) {
                if (state != 0) {
                    running = 0.0;
                    bad = 0.0;
                } else {
                    beyond = omega < c->band_low * omega_s || omega > c->band_high * omega_s;
                    outside = (beyond) ? (outside + 1.0) : (0.0);
                    large = pe > c->innovation2 * pi;
                    bad = (large && age > c->settle) ? (bad + 1.0) : (0.0);
                    if (age <= c->settle) {
                        state |= 2;
                    }
                    if (large) {
                        state |= 4;
                    }
                    if (beyond) {
                        state |= 8;
                    }
                    if (outside > c->patience || bad > 5.0 * c->patience) {
                        begin = 1;
                        restarts += 1.0;
                    }
                }
            } else if (state == 0) {
                bad += 1.0;
                if (bad > 2.0 * c->patience) {
                    begin = 1;
                }
            }
            if (begin) {
                running = 1.0;
                age = 0.0;
                outside = 0.0;
                bad = 0.0;
                state |= 2 | doubt;
                omega = (c->start_speed > 0.0 && restarts == 0.0) ? (c->start_speed) : (omega_s);
                omega = fmin(fmax(omega, c->speed_low), c->speed_high);
                xi_re = y_re;
                xi_im = y_im;
                xm_re = ((u_im - c->r_s * y_im) / omega_s - c->L_s * y_re) * c->inv_L_m;
                xm_im = (-(u_re - c->r_s * y_re) / omega_s - c->L_s * y_im) * c->inv_L_m;
                g_re = c->ref_re;
                g_im = c->ref_im;
                g_0 = 0.0;
                a_re = 0.0;
                a_im = 0.0;
                b_re = 0.0;
                b_im = 0.0;
                d_re = 0.0;
                d_im = 0.0;
                f_re = 0.0;
                f_im = 0.0;
                P_oo = c->p_speed;
                P_rr = c->p_fault;
                P_ii = c->p_fault;
                P_or = 0.0;
                P_oi = 0.0;
                P_ri = 0.0;
                m_o = 0.0;
                m_g = w2;
                q_o = 0.0;
                q_g = 0.0;
                e_re = 0.0;
                e_im = 0.0;
                pe = 0.0;
                pi = yy;
            } else if (running > 0.5) {
                state |= doubt;
                q_o = c->q_speed / fmax(m_o, 1e-12);
                q_g = c->q_fault / fmax(m_g, 1e-12);
                if (P_oo > c->p_speed) {
                    z = sqrt(c->p_speed / P_oo);
                    P_oo = P_oo * z * z;
                    P_or = P_or * z;
                    P_oi = P_oi * z;
                }
                if (P_rr > c->p_fault) {
                    z = sqrt(c->p_fault / P_rr);
                    P_rr = P_rr * z * z;
                    P_or = P_or * z;
                    P_ri = P_ri * z;
                }
                if (P_ii > c->p_fault) {
                    z = sqrt(c->p_fault / P_ii);
                    P_ii = P_ii * z * z;
                    P_oi = P_oi * z;
                    P_ri = P_ri * z;
                }
            }
        }
        flags |= (running > 0.5) ? (state) : (state | 1);
        n_vv_re += u_re * u_re - u_im * u_im;
        n_vv_im += 2.0 * u_re * u_im;
        n_v2 += uu;
        n_iv_re += y_re * u_re + y_im * u_im;
        n_iv_im += y_im * u_re - y_re * u_im;
        n_ii_re += y_re * u_re - y_im * u_im;
        n_ii_im += y_re * u_im + y_im * u_re;
        n_i2 += yy;
        filled += 1;
        if (filled >= every) {
            z = 1.0 / filled;
            on = active == filled;
            out[N_COLUMNS*rows+0] = (on) ? (z * n_o) : (NAN);
            out[N_COLUMNS*rows+1] = (on) ? (z * n_T) : (NAN);
            out[N_COLUMNS*rows+2] = (on) ? (z * n_re) : (NAN);
            out[N_COLUMNS*rows+3] = (on) ? (z * n_im) : (NAN);
            out[N_COLUMNS*rows+4] = (on) ? (e_re) : (NAN);
            out[N_COLUMNS*rows+5] = (on) ? (e_im) : (NAN);
            out[N_COLUMNS*rows+6] = (on) ? (z * n_e) : (NAN);
            out[N_COLUMNS*rows+7] = (double)(flags);
            out[N_COLUMNS*rows+8] = omega_s;
            out[N_COLUMNS*rows+9] = z * n_vv_re;
            out[N_COLUMNS*rows+10] = z * n_vv_im;
            out[N_COLUMNS*rows+11] = z * n_v2;
            out[N_COLUMNS*rows+12] = z * n_iv_re;
            out[N_COLUMNS*rows+13] = z * n_iv_im;
            out[N_COLUMNS*rows+14] = z * n_ii_re;
            out[N_COLUMNS*rows+15] = z * n_ii_im;
            out[N_COLUMNS*rows+16] = z * n_i2;
            rows += 1;
            filled = 0;
            flags = 0;
            active = 0;
            n_o = 0.0;
            n_T = 0.0;
            n_re = 0.0;
            n_im = 0.0;
            n_e = 0.0;
            n_vv_re = 0.0;
            n_vv_im = 0.0;
            n_v2 = 0.0;
            n_iv_re = 0.0;
            n_iv_im = 0.0;
            n_ii_re = 0.0;
            n_ii_im = 0.0;
            n_i2 = 0.0;
        }
    }
    s[0] = running;
    s[1] = omega;
    s[2] = restarts;
    s[3] = xi_re;
    s[4] = xi_im;
    s[5] = xm_re;
    s[6] = xm_im;
    s[7] = w_re;
    s[8] = w_im;
    s[9] = g_re;
    s[10] = g_im;
    s[11] = g_0;
    s[12] = a_re;
    s[13] = a_im;
    s[14] = b_re;
    s[15] = b_im;
    s[16] = d_re;
    s[17] = d_im;
    s[18] = f_re;
    s[19] = f_im;
    s[20] = P_oo;
    s[21] = P_or;
    s[22] = P_oi;
    s[23] = P_rr;
    s[24] = P_ri;
    s[25] = P_ii;
    s[26] = m_o;
    s[27] = m_g;
    s[28] = v_re;
    s[29] = v_im;
    s[30] = e_re;
    s[31] = e_im;
    s[32] = pv;
    s[33] = rot_re;
    s[34] = rot_im;
    s[35] = pe;
    s[36] = pi;
    s[37] = age;
    s[38] = counter;
    s[39] = outside;
    s[40] = bad;
    s[41] = omega_s;
    s[42] = q_o;
    s[43] = q_g;
    s[44] = (double)(filled);
    s[45] = (double)(flags);
    s[46] = n_o;
    s[47] = n_T;
    s[48] = n_re;
    s[49] = n_im;
    s[50] = n_e;
    s[51] = n_vv_re;
    s[52] = n_vv_im;
    s[53] = n_v2;
    s[54] = n_iv_re;
    s[55] = n_iv_im;
    s[56] = n_ii_re;
    s[57] = n_ii_im;
    s[58] = n_i2;
    s[59] = (double)(state);
    s[60] = (double)(active);
    s[61] = pv_re;
    s[62] = pv_im;
    s[63] = p0;
    s[64] = py;
    s[65] = slope;
    return rows;
}
