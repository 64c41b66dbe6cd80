/* What the kernel's tests share: a check, random numbers, a random machine, and a dense Kalman filter (joint update, Joseph form, double)
 * written from physics.md 1 without the kernel's algebra. */
#ifndef CHECK_H
#define CHECK_H
#include "terragrip.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef long double wide; /* the reference must not be what limits the comparison */

#define NX TG_MAX_STATES
#define NY TG_MAX_CHANNELS
#define REAL_EPSILON (sizeof(tg_real) == 8 ? 2.2e-16 : 1.2e-7)

#define CHECK(condition, ...)                                                \
    do {                                                                     \
        if (!(condition)) {                                                  \
            fprintf(stderr, "%s:%d: failed: %s: ", __FILE__, __LINE__, #condition); \
            fprintf(stderr, __VA_ARGS__);                                    \
            fprintf(stderr, "\n");                                           \
            exit(1);                                                         \
        }                                                                    \
    } while (0)

static uint64_t check_state = 88172645463325252u;
static inline double uniform(double low, double high)
{
    check_state ^= check_state << 13;
    check_state ^= check_state >> 7;
    check_state ^= check_state << 17;
    return low + (high - low) * ((double)(check_state >> 11) / 9007199254740992.0);
}
static inline double normal(void)
{
    double sum = 0;
    for (int i = 0; i < 12; i++) sum += uniform(0, 1);
    return sum - 6;
}

static inline tg_machine random_machine(int n)
{
    tg_machine m;
    memset(&m, 0, sizeof m);
    m.wheels = n;
    m.mass = (tg_real)(uniform(20, 60) * n);
    m.gravity = (tg_real)9.81;
    m.tire_rolling_resistance = (tg_real)uniform(0, 0.05);
    for (int i = 0; i < n; i++) {
        m.radius[i] = (tg_real)uniform(0.1, 0.4);
        m.inertia[i] = (tg_real)uniform(0.05, 0.5);
        m.bearing_resistance[i] = (tg_real)uniform(0, 3);
    }
    return m;
}

static inline tg_input random_input(const tg_machine *m)
{
    tg_input u;
    memset(&u, 0, sizeof u);
    for (int i = 0; i < m->wheels; i++) {
        u.torque[i] = (tg_real)uniform(0, 30);
        u.load[i] = m->mass * m->gravity / (tg_real)m->wheels * (tg_real)uniform(0.8, 1.2);
    }
    u.drawbar = (tg_real)uniform(-50, 200);
    u.slope = (tg_real)uniform(-0.1, 0.1);
    return u;
}

/* A full, badly scaled covariance: S A A' S with S over `decades` decades. */
static inline void random_covariance(int states, double decades, tg_real *P)
{
    double A[NX][NX], s[NX];
    for (int i = 0; i < states; i++) {
        s[i] = pow(10, uniform(-decades / 2, decades / 2));
        for (int j = 0; j < states; j++) A[i][j] = normal() + (i == j ? 2 : 0);
    }
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) {
            double sum = 0;
            for (int k = 0; k < states; k++) sum += A[i][k] * A[j][k];
            P[i * states + j] = (tg_real)(s[i] * s[j] * sum / states);
        }
}

typedef struct {
    int n;
    wide x[NX], P[NX][NX];
    wide F[NX][NX], shift[NX]; /* of the last step */
    wide nu[NY], S[NY][NY], weight[NY], K[NX][NY];
    int taken[NY], count;        /* channels, in order */
    wide nis, log_likelihood;
} dense;

static inline void dense_moments(dense *d, const tg_machine *m, const tg_real *x, const tg_real *P)
{
    d->n = m->wheels;
    for (int i = 0; i < 2 * d->n + 2; i++) {
        d->x[i] = x[i];
        for (int j = 0; j < 2 * d->n + 2; j++) d->P[i][j] = P[i * (2 * d->n + 2) + j];
    }
}

/* omega, v by Runge-Kutta 4 steps from columns of the identity and from zero: the map is affine. */
static inline void dense_rates(const tg_machine *m, const tg_input *u, const wide *x, wide *rate)
{
    const int n = m->wheels;
    wide sum = 0;
    for (int i = 0; i < 2 * n + 2; i++) rate[i] = 0;
    for (int i = 0; i < n; i++) {
        const wide r = m->radius[i], load = u->load[i];
        rate[i] = ((wide)u->torque[i] - r * x[n + 1 + i] * load - r * (wide)m->tire_rolling_resistance * load -
                   r * (wide)m->bearing_resistance[i] * x[i]) / (wide)m->inertia[i];
        sum += x[n + 1 + i] * load;
    }
    rate[n] = (sum - (wide)u->drawbar) / (wide)m->mass -
              (wide)m->gravity * (x[2 * n + 1] * cosl((wide)u->slope) + sinl((wide)u->slope));
}

static inline void dense_move(const tg_machine *m, const tg_input *u, wide dt, wide *x)
{
    const int states = 2 * m->wheels + 2;
    wide stiff = 0;
    for (int i = 0; i < m->wheels; i++) stiff = fmaxl(stiff, (wide)m->radius[i] * (wide)m->bearing_resistance[i] / (wide)m->inertia[i]);
    const int steps = (int)fmaxl(1, ceill(stiff * dt / 0.25L));
    const wide h = dt / steps;
    for (int s = 0; s < steps; s++) {
        wide k1[NX], k2[NX], k3[NX], k4[NX], z[NX] = {0};
        dense_rates(m, u, x, k1);
        for (int i = 0; i < states; i++) z[i] = x[i] + h / 2 * k1[i];
        dense_rates(m, u, z, k2);
        for (int i = 0; i < states; i++) z[i] = x[i] + h / 2 * k2[i];
        dense_rates(m, u, z, k3);
        for (int i = 0; i < states; i++) z[i] = x[i] + h * k3[i];
        dense_rates(m, u, z, k4);
        for (int i = 0; i < states; i++) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
}

static inline void dense_predict(dense *d, const tg_machine *m, wide dt, const tg_input *before, const wide *q)
{
    const int states = 2 * d->n + 2;
    wide FP[NX][NX];
    for (int j = 0; j < states; j++) d->shift[j] = 0;
    dense_move(m, before, dt, d->shift);
    for (int j = 0; j < states; j++) {
        wide e[NX] = {0};
        e[j] = 1;
        dense_move(m, before, dt, e);
        for (int i = 0; i < states; i++) d->F[i][j] = e[i] - d->shift[i];
    }
    dense_move(m, before, dt, d->x);
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) {
            FP[i][j] = 0;
            for (int k = 0; k < states; k++) FP[i][j] += d->F[i][k] * d->P[k][j];
        }
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) {
            d->P[i][j] = i == j ? q[i] : 0;
            for (int k = 0; k < states; k++) d->P[i][j] += FP[i][k] * d->F[j][k];
        }
}

static inline void dense_rows(const dense *d, const tg_machine *m, const tg_input *now, wide H[NY][NX], wide *yhat)
{
    const int n = d->n, states = 2 * n + 2;
    memset(H, 0, sizeof(wide[NY][NX]));
    for (int c = 0; c <= n; c++) H[c][c] = 1;
    for (int i = 0; i < n; i++) H[n + 1][n + 1 + i] = (wide)now->load[i] / (wide)m->mass;
    H[n + 1][2 * n + 1] = -(wide)m->gravity * cosl((wide)now->slope);
    for (int c = 0; c < n + 2; c++) {
        yhat[c] = c == n + 1 ? -(wide)now->drawbar / (wide)m->mass : 0;
        for (int k = 0; k < states; k++) yhat[c] += H[c][k] * d->x[k];
    }
}

static inline void invert(int size, wide A[NY][NY], wide *log_determinant)
{
    wide B[NY][2 * NY];
    *log_determinant = 0;
    for (int i = 0; i < size; i++)
        for (int j = 0; j < 2 * size; j++) B[i][j] = j < size ? A[i][j] : j == size + i;
    for (int p = 0; p < size; p++) { /* positive definite: no pivoting needed */
        const wide pivot = B[p][p];
        *log_determinant += logl(pivot);
        for (int j = 0; j < 2 * size; j++) B[p][j] /= pivot;
        for (int i = 0; i < size; i++) {
            const wide factor = B[i][p];
            for (int j = 0; j < 2 * size && i != p; j++) B[i][j] -= factor * B[p][j];
        }
    }
    for (int i = 0; i < size; i++)
        for (int j = 0; j < size; j++) A[i][j] = B[i][size + j];
}

/* Joint update with the present channels; `huber` as in the kernel; `weights` by channel: used instead, where given. */
static inline wide dense_square(const dense *d, wide A[NY][NY])
{
    wide sum = 0;
    for (int a = 0; a < d->count; a++)
        for (int b = 0; b < d->count; b++) sum += d->nu[a] * A[a][b] * d->nu[b];
    return sum;
}

static inline void dense_update(dense *d, const tg_machine *m, const tg_input *now, const tg_real *y, const tg_real *r, wide huber,
                                const wide *weights)
{
    const int n = d->n, states = 2 * n + 2;
    wide H[NY][NX], yhat[NY], PH[NX][NY], inverse[NY][NY], R[NY], logs;
    dense_rows(d, m, now, H, yhat);
    d->count = 0;
    for (int c = 0; c < n + 2; c++)
        if (y[c] == y[c]) d->taken[d->count++] = c;
    for (int a = 0; a < d->count; a++)
        for (int i = 0; i < states; i++) {
            PH[i][a] = 0;
            for (int k = 0; k < states; k++) PH[i][a] += d->P[i][k] * H[d->taken[a]][k];
        }
    for (int a = 0; a < d->count; a++) {
        const int c = d->taken[a];
        d->nu[a] = (wide)y[c] - yhat[c];
        wide S = r[c];
        for (int k = 0; k < states; k++) S += H[c][k] * PH[k][a];
        d->weight[a] = huber > 0 && fabsl(d->nu[a]) > huber * sqrtl(S) ? huber * sqrtl(S) / fabsl(d->nu[a]) : 1;
        R[a] = r[c] / d->weight[a];
        if (weights) R[a] = r[c] / (d->weight[a] = weights[c]);
        for (int b = 0; b < d->count; b++) {
            d->S[a][b] = a == b ? R[a] : 0;
            for (int k = 0; k < states; k++) d->S[a][b] += H[c][k] * PH[k][b];
        }
    }
    memcpy(inverse, d->S, sizeof inverse);
    invert(d->count, inverse, &logs);
    d->nis = dense_square(d, inverse);
    wide IKH[NX][NX], T[NX][NX];
    for (int i = 0; i < states; i++)
        for (int k = 0; k < states; k++) IKH[i][k] = i == k;
    for (int i = 0; i < states; i++)
        for (int a = 0; a < d->count; a++) {
            d->K[i][a] = 0;
            for (int b = 0; b < d->count; b++) d->K[i][a] += PH[i][b] * inverse[b][a];
            d->x[i] += d->K[i][a] * d->nu[a];
            for (int k = 0; k < states; k++) IKH[i][k] -= d->K[i][a] * H[d->taken[a]][k];
        }
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) {
            T[i][j] = 0;
            for (int k = 0; k < states; k++) T[i][j] += IKH[i][k] * d->P[k][j];
        }
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) {
            d->P[i][j] = 0;
            for (int k = 0; k < states; k++) d->P[i][j] += T[i][k] * IKH[j][k];
            for (int a = 0; a < d->count; a++) d->P[i][j] += d->K[i][a] * R[a] * d->K[j][a];
        }
    d->log_likelihood = -(dense_square(d, inverse) + logs + d->count * 1.8378770664093454836L) / 2;
}

/* Largest difference between a filter's moments and dense ones, in SDs and in products of SDs. */
static inline double dense_distance(const tg_filter *f, const dense *d)
{
    const int states = 2 * d->n + 2;
    tg_real x[NX], P[NX * NX];
    double worst = 0;
    CHECK(tg_filter_moments(f, x, P) == TG_OK, "moments");
    for (int i = 0; i < states; i++) {
        worst = fmax(worst, (double)(fabsl((wide)x[i] - d->x[i]) / (sqrtl(d->P[i][i]) + fabsl(d->x[i]))));
        for (int j = 0; j < states; j++)
            worst = fmax(worst, (double)(fabsl((wide)P[i * states + j] - d->P[i][j]) / sqrtl(d->P[i][i] * d->P[j][j])));
    }
    return worst;
}

/* The factors are positive and finite, and so is every variance. */
static inline int factors_are_sound(const tg_filter *f, int states, int modes)
{
    tg_real U[NX * NX], D[NX], x[NX], P[NX * NX];
    for (int b = 0; b < modes; b++) {
        if (tg_filter_factors(f, b, U, D) != TG_OK) return 0;
        for (int k = 0; k < states; k++) {
            if (!(D[k] > 0) || !isfinite((double)D[k])) return 0;
            for (int e = 0; e < states; e++)
                if (!isfinite((double)U[e * states + k])) return 0;
        }
    }
    if (tg_filter_moments(f, x, P) != TG_OK) return 0;
    for (int i = 0; i < states; i++)
        if (!(P[i * states + i] > 0) || !isfinite((double)P[i * states + i]) || !isfinite((double)x[i])) return 0;
    return 1;
}
#endif
