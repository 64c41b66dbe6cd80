/* Considered constants (Schmidt-Kalman, physics.md 6): what a constant that the data cannot tell does to the estimate. Columns pass through
 * the gains that the filter itself took; of a bank, through the gains' mean. */
#include "filter.h"

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
    for (int k = 0; k < n; k++) v += p->c[k] * s[k];
    for (int k = 0; k <= n; k++) prior[k] = s[k];
    prior[n + 1] = d ? v + p->dt * d->acceleration : v;
    for (int i = 0; i < n; i++) {
        const tg_real omega = p->phi[i] * s[n + 2 + i] + p->b[i] * s[i];
        prior[n + 2 + i] = d ? omega + p->psi[i] * d->wheel_acceleration[i] : omega;
    }
}

/* The gain of the c-th channel taken, in whole lanes: the filter's, or the mean over the bank's modes. */
static const tg_real *consider_gain(const tg_filter *f, int c, tg_real *mean)
{
    if (f->tuning.policy != TG_BANK) return f->gain[c];
    const tg_bank_state *const bank = &f->policy.bank;
    const tg_lanes probability = lanes_load(bank->probability);
    for (int i = 0; i < f->stride; i++) mean[i] = i < f->states ? lanes_sum(lanes_mul(probability, lanes_load(bank->gain[c][i]))) : 0;
    return mean;
}

tg_status tg_consider_step(tg_consider *c, const tg_filter *f, const tg_deviation *deviations)
{
    if (!c || !f || c->wheels != f->wheels) return TG_BAD_ARGUMENT;
    const int n = f->wheels;
    tg_real zero = 0; /* NaN, from an infinite or NaN term */
    for (int k = 0; deviations && k < c->columns; k++) {
        zero += deviations[k].acceleration * 0 + deviations[k].accelerometer * 0;
        for (int i = 0; i < n; i++) zero += deviations[k].wheel_acceleration[i] * 0;
    }
    if (zero != 0) return TG_NOT_FINITE;
    for (int k = 0; k < c->columns; k++) {
        consider_predict(&f->passage, deviations ? deviations + k : NULL, c->s[k], c->prior[k], n);
        memcpy(c->s[k], c->prior[k], sizeof c->s[k]);
    }
    for (int m = 0; m < f->taken; m++) { /* channel by channel, for each column waits for its own last gain */
        const int o = f->channel[m];
        tg_real mean[TG_ROWS];
        const tg_real *const gain = consider_gain(f, m, mean);
        for (int k = 0; k < c->columns; k++) {
            tg_real *const s = c->s[k];
            tg_real expected = o <= n ? s[n + 1 + o] : deviations ? deviations[k].accelerometer : 0;
            for (int i = 0; o > n && i <= n; i++) expected += f->accelerometer[i] * s[i];
            for (int i = 0; i < f->stride; i += TG_LANES)
                lanes_store(s + i, lanes_mul_sub(lanes_load(gain + i), lanes_all(expected), lanes_load(s + i)));
        }
    }
    return TG_OK;
}

tg_status tg_consider_columns(const tg_consider *c, tg_real *s)
{
    if (!c || !s) return TG_BAD_ARGUMENT;
    for (int k = 0; k < c->columns; k++)
        for (int e = 0; e < c->states; e++) s[k * c->states + e] = c->s[k][tgi_row(c->wheels, e)];
    return TG_OK;
}
