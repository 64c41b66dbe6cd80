/* Considered constants (Schmidt-Kalman, PHYSICS 6): what a constant that the data cannot tell does to the estimate. Columns pass through
 * the gains that the filter itself took; of a bank, through the gains' mean. */
#include "filter.h"

#define TG_TOGETHER 3

size_t tg_consider_size(void) { return sizeof(tg_consider); }

tg_status tg_consider_init(tg_consider *c, const tg_filter *f, int32_t columns)
{
    if (!c || !f || columns < 0 || columns > TG_MAX_CONSIDERED) return TG_BAD_ARGUMENT;
    memset(c, 0, sizeof *c);
    c->columns = columns;
    c->wheels = f->wheels;
    c->states = f->states;
    return TG_OK;
}

/* The column over the last step's map, with what one SD of its constant adds on the way. */
TG_INLINE void consider_predict(const tg_passage *p, const tg_deviation *d, const tg_real *s, tg_real *prior, const int n)
{
    tg_real v = p->keep * s[n + 1] - p->g * s[n];
    for (int i = 0; i < n; i++) v += p->c[i] * s[i];
    for (int i = 0; i <= n; i++) prior[i] = s[i];
    prior[n + 1] = d ? v + p->dt * d->acceleration : v;
    for (int i = 0; i < n; i++) {
        const tg_real omega = p->phi[i] * s[n + 2 + i] + p->b[i] * s[i];
        prior[n + 2 + i] = d ? omega + p->psi[i] * d->wheel_acceleration[i] : omega;
    }
}

/* The gain of the c-th channel taken: the filter's, or the mean over the bank's modes. */
TG_INLINE const tg_real *consider_gain(const tg_filter *f, int c, tg_real *mean, const int n)
{
    if (f->tuning.policy != TG_BANK) return f->gain[c];
    const tg_bank_state *const bank = &f->policy.bank;
    for (int i = 0; i < TG_TWICE(n); i++) {
        mean[i] = 0;
        for (int m = 0; m < TG_MODES; m++) mean[i] += bank->probability[m] * bank->gain[c][i][m];
    }
    return mean;
}

/* A column through the gains of the channels taken. */
TG_INLINE void consider_take(const tg_filter *f, const tg_real *const *gain, const tg_deviation *d, tg_real *s, const int n)
{
    for (int m = 0; m < f->taken; m++) {
        const int o = f->channel[m];
        tg_real expected = o <= n ? s[n + 1 + o] : d ? d->accelerometer : 0;
        for (int i = 0; o > n && i <= n; i++) expected += f->accelerometer[i] * s[i];
        for (int i = 0; i < TG_TWICE(n); i++) s[i] -= gain[m][i] * expected;
    }
}

/* The same two with four wheels: `together` columns at once, in registers, since each waits for its own last gain. */
TG_INLINE void consider_four(tg_consider *c, int first, const tg_filter *f, const tg_real *const *gain, const tg_deviation *d, const int together)
{
    const tg_passage *const p = &f->passage;
    tg_lanes mu[TG_TOGETHER], omega[TG_TOGETHER];
    tg_real rho[TG_TOGETHER], v[TG_TOGETHER], expected[TG_TOGETHER];
    for (int k = 0; k < together; k++) {
        const tg_real *const s = c->s[first + k];
        tg_real *const prior = c->prior[first + k];
        mu[k] = lanes_load(s);
        rho[k] = s[4];
        v[k] = (p->keep * s[5] - p->g * rho[k]) + lanes_sum(lanes_mul(lanes_load(p->c), mu[k]));
        omega[k] = lanes_mul_add(lanes_load(p->b), mu[k], lanes_mul(lanes_load(p->phi), lanes_load(s + 6)));
        if (d) {
            omega[k] = lanes_mul_add(lanes_load(p->psi), lanes_load(d[first + k].wheel_acceleration), omega[k]);
            v[k] += p->dt * d[first + k].acceleration;
        }
        lanes_store(prior, mu[k]);
        prior[4] = rho[k];
        prior[5] = v[k];
        lanes_store(prior + 6, omega[k]);
    }
    for (int m = 0; m < f->taken; m++) {
        const int o = f->channel[m];
        const tg_real *const K = gain[m];
        const tg_lanes of_mu = lanes_load(K), of_omega = lanes_load(K + 6);
        for (int k = 0; k < together; k++) {
            if (o == 0)
                expected[k] = v[k];
            else if (o <= 4)
                expected[k] = lanes_at(omega[k], o - 1);
            else
                expected[k] = (d ? d[first + k].accelerometer : 0) + f->accelerometer[4] * rho[k] +
                              lanes_sum(lanes_mul(lanes_load(f->accelerometer), mu[k]));
        }
        for (int k = 0; k < together; k++) {
            const tg_lanes all = lanes_all(expected[k]);
            mu[k] = lanes_mul_sub(of_mu, all, mu[k]);
            rho[k] -= K[4] * expected[k];
            v[k] -= K[5] * expected[k];
            omega[k] = lanes_mul_sub(of_omega, all, omega[k]);
        }
    }
    for (int k = 0; k < together; k++) {
        tg_real *const s = c->s[first + k];
        lanes_store(s, mu[k]);
        s[4] = rho[k];
        s[5] = v[k];
        lanes_store(s + 6, omega[k]);
    }
}

TG_INLINE void consider_columns(tg_consider *c, const tg_filter *f, const tg_deviation *deviations, const int n)
{
    tg_real mean[TG_MAX_CHANNELS][TG_ROWS];
    const tg_real *gain[TG_MAX_CHANNELS];
    for (int m = 0; m < f->taken; m++) gain[m] = consider_gain(f, m, mean[m], n);
    if (n == TG_LANES) {
        int k = 0;
        for (; k + TG_TOGETHER <= c->columns; k += TG_TOGETHER) consider_four(c, k, f, gain, deviations, TG_TOGETHER);
        for (; k < c->columns; k++) consider_four(c, k, f, gain, deviations, 1);
        return;
    }
    for (int k = 0; k < c->columns; k++) {
        const tg_deviation *const d = deviations ? deviations + k : NULL;
        consider_predict(&f->passage, d, c->s[k], c->prior[k], n);
        for (int i = 0; i < TG_TWICE(n); i++) c->s[k][i] = c->prior[k][i];
        consider_take(f, gain, d, c->s[k], n);
    }
}

tg_status tg_consider_step(tg_consider *c, const tg_filter *f, const tg_deviation *deviations)
{
    if (!c || !f || c->wheels != f->wheels) return TG_BAD_ARGUMENT;
#define COLUMNS(n, stride) consider_columns(c, f, deviations, n)
    TG_BY_WHEELS(f->wheels, COLUMNS)
#undef COLUMNS
    return TG_OK;
}

tg_status tg_consider_columns(const tg_consider *c, tg_real *s)
{
    if (!c || !s) return TG_BAD_ARGUMENT;
    for (int k = 0; k < c->columns; k++)
        for (int e = 0; e < c->states; e++) s[k * c->states + e] = c->s[k][tgi_row(c->wheels, e)];
    return TG_OK;
}
