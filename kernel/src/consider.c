/* Considered constants (Schmidt-Kalman, physics.md 6): the effect on the estimate of a constant that the data cannot determine. Columns pass
 * through the filter's own gains; of a bank, through the gains' mean. */
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

/* Columns run in `lanes` lanes, a constant, so that what their rows share is read once and sums stay in registers. */
#define EACH(k) for (int k = 0; k < lanes * TG_LANES; k += TG_LANES)

/* Over the last step's map, with what one SD of each constant adds on the way. */
TG_INLINE void consider_predict(tg_consider *c, const tg_passage *p, const tg_deviations *d, const int n, const int lanes)
{
    const tg_lanes keep = lanes_all(p->keep), g = lanes_all(p->g), dt = lanes_all(p->dt);
    EACH(k)
    {
        const tg_lanes rho = lanes_load(c->s[n] + k);
        lanes_store(c->prior[n] + k, rho);
        lanes_store(c->s[n + 1] + k, keep * lanes_load(c->s[n + 1] + k) - g * rho);
    }
    for (int i = 0; i < n; i++) {
        const tg_lanes phi = lanes_all(p->phi[i]), psi = lanes_all(p->psi[i]), to_omega = lanes_all(p->b[i]), to_v = lanes_all(p->c[i]);
        EACH(k)
        {
            const tg_lanes mu = lanes_load(c->s[i] + k);
            tg_lanes omega = phi * lanes_load(c->s[n + 2 + i] + k) + to_omega * mu;
            if (d) omega += psi * lanes_load(d->wheel_acceleration[i] + k);
            lanes_store(c->s[n + 1] + k, lanes_load(c->s[n + 1] + k) + to_v * mu);
            lanes_store(c->prior[i] + k, mu);
            lanes_store(c->prior[n + 2 + i] + k, omega);
            lanes_store(c->s[n + 2 + i] + k, omega);
        }
    }
    EACH(k)
    {
        tg_lanes v = lanes_load(c->s[n + 1] + k);
        if (d) v += dt * lanes_load(d->acceleration + k);
        lanes_store(c->prior[n + 1] + k, v);
        lanes_store(c->s[n + 1] + k, v);
    }
}

/* Through the gains of the channels used, each after those before it; one SD shifts its residual by `shift`. */
TG_INLINE void consider_update(tg_consider *c, const tg_filter *f, const tg_real (*gain)[TG_ROWS], const tg_deviations *d, const int n, const int lanes)
{
    for (int m = 0; m < f->used; m++) {
        const int o = f->channel[m];
        tg_real shift[TG_MAX_CONSIDERED];
        EACH(k)
        {
            if (o <= n) lanes_store(shift + k, lanes_load(c->s[n + 1 + o] + k));
            else lanes_store(shift + k, d ? lanes_load(d->accelerometer + k) : lanes_all(0));
        }
        for (int i = 0; o > n && i <= n; i++) {
            const tg_lanes a = lanes_all(f->accelerometer[i]);
            EACH(k) lanes_store(shift + k, lanes_load(shift + k) + a * lanes_load(c->s[i] + k));
        }
        for (int j = 0; j < TG_TWICE(n); j++) {
            const tg_lanes share = lanes_all(gain[m][j]);
            EACH(k) lanes_store(c->s[j] + k, lanes_load(c->s[j] + k) - share * lanes_load(shift + k));
        }
    }
}

TG_INLINE void consider(tg_consider *c, const tg_filter *f, const tg_real (*gain)[TG_ROWS], const tg_deviations *d, const int lanes)
{
    consider_predict(c, &f->passage, d, f->wheels, lanes);
    consider_update(c, f, gain, d, f->wheels, lanes);
}

/* The mean gains of the modes of a bank. */
static void mean_gains(const tg_filter *f, tg_real (*mean)[TG_ROWS])
{
    const tg_bank_state *const bank = &f->policy.bank;
    const tg_lanes probability = lanes_load(bank->probability);
    for (int m = 0; m < f->used; m++)
        for (int i = 0; i < f->states; i++) mean[m][i] = lanes_sum(probability * lanes_load(bank->gain[m][i]));
}

/* Whether every number is finite. */
static int deviations_are_finite(const tg_deviations *d, int columns, int n)
{
    const tg_lanes none = lanes_all(0);
    tg_lanes zero = none; /* NaN, from an infinite or NaN term */
    for (int k = 0; k < columns; k += TG_LANES) {
        zero = zero + lanes_load(d->accelerometer + k) * none + lanes_load(d->acceleration + k) * none;
        for (int i = 0; i < n; i++) zero += lanes_load(d->wheel_acceleration[i] + k) * none;
    }
    return lanes_sum(zero) == 0;
}

tg_status tg_consider_step(tg_consider *c, const tg_filter *f, const tg_deviations *deviations)
{
    if (!c || !f || c->wheels != f->wheels) return TG_BAD_ARGUMENT;
    const int n = f->wheels, columns = c->columns, bank = f->tuning.policy == TG_BANK;
    if (deviations && !deviations_are_finite(deviations, columns, n)) return TG_NOT_FINITE;
    tg_real mean[TG_MAX_CHANNELS][TG_ROWS];
    if (bank) mean_gains(f, mean);
    const tg_real (*const gain)[TG_ROWS] = bank ? (const tg_real(*)[TG_ROWS])mean : f->gain;
    switch ((columns + TG_LANES - 1) / TG_LANES) {
    case 0: break;
    case 1: consider(c, f, gain, deviations, 1); break;
    case 2: consider(c, f, gain, deviations, 2); break;
    case 3: consider(c, f, gain, deviations, 3); break;
    default: consider(c, f, gain, deviations, TG_MAX_CONSIDERED / TG_LANES);
    }
    return TG_OK;
}

tg_status tg_consider_columns(const tg_consider *c, tg_real *s)
{
    if (!c || !s) return TG_BAD_ARGUMENT;
    for (int k = 0; k < c->columns; k++)
        for (int e = 0; e < c->states; e++) s[k * c->states + e] = c->s[tgi_row(c->wheels, e)][k];
    return TG_OK;
}
