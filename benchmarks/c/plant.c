/* Thesis 3.4, 3.5: the peer in C of pumplib/plant: same right-hand side, same Runge-Kutta step.
 *
 * Written by hand from the equations. Both functions take what the compiled kernels of pumplib take:
 * inputs at half steps, the state recorded at every `every`-th step. LANES is chosen at compile time.
 */
#include <math.h>
#include <stddef.h>

#ifndef LANES
#define LANES 8
#endif
#define N 7
#define NC 27

/* in the order of pumplib.plant.equations.Coefficients */
typedef struct {
    double r_s, R_r, L_m, inv_L_s, inv_L_m, z_p, k_T, a_h0, a_h1, a_h2, a_t0, a_t1, a_t2, a, K_l, inv_K_J, K_c,
        p_static, K_pipe, inv_K_p, B, K_Q, K_Q_J, inv_J, c_Q, c_q, c_H;
} coefficients;

typedef struct {
    double i_sd, i_sq, i_md, i_mq, omega, q, Q_p;
} state;

typedef struct {
    double v_d, v_q, K_v, T_load;
} input;

/* coupled: whether the reciprocal term is present; a constant 0 lets the compiler drop it */
static inline state derivatives(state x, input u, coefficients c, int coupled)
{
    state d;
    double speed = c.z_p * x.omega * c.L_m;
    double e_d = c.R_r * x.i_md + speed * x.i_mq;
    double e_q = c.R_r * x.i_mq - speed * x.i_md;
    double r = c.r_s + c.R_r;
    d.i_sd = c.inv_L_s * (u.v_d - r * x.i_sd + e_d);
    d.i_sq = c.inv_L_s * (u.v_q - r * x.i_sq + e_q);
    d.i_md = c.inv_L_m * (c.R_r * x.i_sd - e_d);
    d.i_mq = c.inv_L_m * (c.R_r * x.i_sq - e_q);

    double Q_i = x.Q_p + x.q;
    double pressure = (c.a_h1 * x.omega - c.a_h2 * fabs(Q_i)) * Q_i + c.a_h0 * x.omega * x.omega;
    double dq = c.inv_K_J * (c.a * pressure - c.K_l * x.q * fabs(x.q));
    double dQ = c.inv_K_p * (pressure - (c.p_static + (c.K_c + c.K_pipe + u.K_v) * x.Q_p * fabs(x.Q_p)));
    double T_e = c.k_T * (x.i_md * x.i_sq - x.i_mq * x.i_sd);
    double T_p = (c.a_t1 * x.omega - c.a_t2 * Q_i) * Q_i + c.a_t0 * x.omega * fabs(x.omega);
    d.omega = c.inv_J * (T_e - c.B * x.omega - T_p - u.T_load) + c.K_Q_J * (dQ + dq);
    d.q = coupled ? dq + c.c_q * d.omega : dq;
    d.Q_p = coupled ? dQ + c.c_Q * d.omega : dQ;
    return d;
}

static inline state ahead(state x, double g, state d)
{
    state y = {x.i_sd + g * d.i_sd, x.i_sq + g * d.i_sq, x.i_md + g * d.i_md, x.i_mq + g * d.i_mq,
               x.omega + g * d.omega, x.q + g * d.q, x.Q_p + g * d.Q_p};
    return y;
}

static inline state rk4_step(state x, input u0, input u1, input u2, double h, coefficients c, int coupled)
{
    double g = 0.5 * h, w = h / 6.0;
    state k1 = derivatives(x, u0, c, coupled);
    state k2 = derivatives(ahead(x, g, k1), u1, c, coupled);
    state k3 = derivatives(ahead(x, g, k2), u1, c, coupled);
    state k4 = derivatives(ahead(x, h, k3), u2, c, coupled);
    state y;
    y.i_sd = x.i_sd + w * (k1.i_sd + 2.0 * (k2.i_sd + k3.i_sd) + k4.i_sd);
    y.i_sq = x.i_sq + w * (k1.i_sq + 2.0 * (k2.i_sq + k3.i_sq) + k4.i_sq);
    y.i_md = x.i_md + w * (k1.i_md + 2.0 * (k2.i_md + k3.i_md) + k4.i_md);
    y.i_mq = x.i_mq + w * (k1.i_mq + 2.0 * (k2.i_mq + k3.i_mq) + k4.i_mq);
    y.omega = x.omega + w * (k1.omega + 2.0 * (k2.omega + k3.omega) + k4.omega);
    y.q = x.q + w * (k1.q + 2.0 * (k2.q + k3.q) + k4.q);
    y.Q_p = x.Q_p + w * (k1.Q_p + 2.0 * (k2.Q_p + k3.Q_p) + k4.Q_p);
    return y;
}

static inline void run(double *restrict x, const double *restrict v_d, const double *restrict v_q,
                       const double *restrict K_v, const double *restrict T_load, double h, ptrdiff_t every,
                       const double *restrict c, ptrdiff_t rows, double *restrict out, int coupled)
{
    coefficients k = *(const coefficients *)c;
    state s = *(state *)x;
    for (ptrdiff_t row = 0, i = 0; row < rows; row++) {
        for (ptrdiff_t j = 0; j < every; j++, i += 2) {
            input u0 = {v_d[i], v_q[i], K_v[i], T_load[i]};
            input u1 = {v_d[i + 1], v_q[i + 1], K_v[i + 1], T_load[i + 1]};
            input u2 = {v_d[i + 2], v_q[i + 2], K_v[i + 2], T_load[i + 2]};
            s = rk4_step(s, u0, u1, u2, h, k, coupled);
        }
        ((state *)out)[row] = s;
    }
    *(state *)x = s;
}

/* x: 7; inputs: 2 rows every + 1; c: 26; out: rows x 7 */
void run_one(double *restrict x, const double *restrict v_d, const double *restrict v_q,
             const double *restrict K_v, const double *restrict T_load, double h, ptrdiff_t every,
             const double *restrict c, ptrdiff_t rows, double *restrict out)
{
    if (((const coefficients *)c)->c_H != 0.0)
        run(x, v_d, v_q, K_v, T_load, h, every, c, rows, out, 1);
    else
        run(x, v_d, v_q, K_v, T_load, h, every, c, rows, out, 0);
}

/* x: blocks x 7 x LANES; c: blocks x 26 x LANES; out: blocks x rows x 7 x LANES */
void run_many(double *restrict x, const double *restrict v_d, const double *restrict v_q,
              const double *restrict K_v, const double *restrict T_load, double h, ptrdiff_t every,
              const double *restrict c, ptrdiff_t rows, ptrdiff_t blocks, double *restrict out)
{
    double s[N][LANES] __attribute__((aligned(64)));
    double k[NC][LANES] __attribute__((aligned(64)));
    for (ptrdiff_t block = 0; block < blocks; block++) {
        for (int j = 0; j < N; j++)
            for (int m = 0; m < LANES; m++)
                s[j][m] = x[(block * N + j) * LANES + m];
        for (int j = 0; j < NC; j++)
            for (int m = 0; m < LANES; m++)
                k[j][m] = c[(block * NC + j) * LANES + m];
        for (ptrdiff_t row = 0, i = 0; row < rows; row++) {
            for (ptrdiff_t step = 0; step < every; step++, i += 2) {
                input u0 = {v_d[i], v_q[i], K_v[i], T_load[i]};
                input u1 = {v_d[i + 1], v_q[i + 1], K_v[i + 1], T_load[i + 1]};
                input u2 = {v_d[i + 2], v_q[i + 2], K_v[i + 2], T_load[i + 2]};
#pragma GCC ivdep
                for (int m = 0; m < LANES; m++) {
                    coefficients p = {
                        k[0][m],  k[1][m],  k[2][m],  k[3][m],  k[4][m],  k[5][m],  k[6][m],  k[7][m],  k[8][m],
                        k[9][m],  k[10][m], k[11][m], k[12][m], k[13][m], k[14][m], k[15][m], k[16][m], k[17][m],
                        k[18][m], k[19][m], k[20][m], k[21][m], k[22][m], k[23][m], k[24][m], k[25][m]};
                    state a = {s[0][m], s[1][m], s[2][m], s[3][m], s[4][m], s[5][m], s[6][m]};
                    state b = rk4_step(a, u0, u1, u2, h, p, 1);
                    s[0][m] = b.i_sd;
                    s[1][m] = b.i_sq;
                    s[2][m] = b.i_md;
                    s[3][m] = b.i_mq;
                    s[4][m] = b.omega;
                    s[5][m] = b.q;
                    s[6][m] = b.Q_p;
                }
            }
            for (int j = 0; j < N; j++)
                for (int m = 0; m < LANES; m++)
                    out[((block * rows + row) * N + j) * LANES + m] = s[j][m];
        }
        for (int j = 0; j < N; j++)
            for (int m = 0; m < LANES; m++)
                x[(block * N + j) * LANES + m] = s[j][m];
    }
}
