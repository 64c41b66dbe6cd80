/* Restart the filter with its knowledge of the ground and new outputs. */
#include "factor.h"

/* The factors of the parameters' marginal, widened by q, then of fresh outputs with variances q. */
static void restart_factors(int n, int stride, const tg_real *q, tg_real *u, tg_real *d)
{
    tg_real W[2 * TG_MAX_STATES * TG_ROWS], weight[2 * TG_MAX_STATES];
    const int rows = TG_TWICE(n);
    memcpy(W, u, (size_t)(rows * stride) * sizeof *u);
    memcpy(weight, d, (size_t)rows * sizeof *d);
    tgi_gram gram = tgi_factor_begin(W, weight, rows, stride);
    for (int j = n; j > 0; j--) tgi_factor_row(&gram, j, 1, q[j], u + j * stride, d + j);
    tgi_factor_last(&gram, q[0], u, d);
    for (int j = n + 1; j < rows; j++) {
        d[j] = q[j];
        for (int i = 0; i < stride; i++) u[j * stride + i] = i == j;
    }
}

/* Forget the outputs' sensitivities: their variances are given now. */
static void restart_sensitivities(tg_filter *f)
{
    tg_adaptation_state *const s = &f->policy.adaptive.adaptation;
    const int first = f->wheels + 1;
    for (int i = first; i < f->states; i++) {
        memset(s->dx + i * f->stride, 0, (size_t)f->stride * sizeof *s->dx);
        memset(s->dP + i * (i + 1) / 2 * f->stride, 0, (size_t)((i + 1) * f->stride) * sizeof *s->dP);
    }
}

/* Adhesion, right after a restart, is `mu` in place of what the filter held for it. */
void tgi_place_adhesion(tg_filter *f, const tg_real *mu)
{
    const int n = f->wheels;
    for (int i = 0; i < n; i++) {
        f->x_prior[i] = mu[i];
        if (f->tuning.policy == TG_BANK)
            lanes_store(f->policy.bank.x[i], lanes_all(mu[i]));
        else
            f->x[i] = mu[i];
    }
}

tg_status tg_filter_restart(tg_filter *f, tg_real walk_time, const tg_real *outputs, const tg_real *variances)
{
    if (!f || !outputs || !variances) return TG_BAD_ARGUMENT;
    if (!(walk_time >= 0)) return TG_TIME_REVERSED;
    if (!tgi_finite(walk_time)) return TG_NOT_FINITE;
    const int n = f->wheels;
    for (int c = 0; c <= n; c++) {
        if (!tgi_finite(outputs[c]) || !tgi_finite(variances[c])) return TG_NOT_FINITE;
        if (!(variances[c] > 0)) return TG_NOT_POSITIVE;
    }
    tg_passage passage;
    memset(&passage, 0, sizeof passage);
    for (int j = 0; j <= n; j++) passage.q[j] = f->walk[j] * walk_time;
    for (int o = 0; o <= n; o++) passage.q[n + 1 + o] = variances[tgi_channel(n, o)];
    if (f->tuning.policy == TG_BANK)
        tgi_bank_restart(f, outputs, &passage);
    else {
        tg_real u[TG_MAX_STATES * TG_ROWS], d[TG_ROWS];
        if (tgi_factors_of(f, u, d) != TG_OK) return TG_DIVERGED;
        restart_factors(n, f->stride, passage.q, u, d);
        memcpy(f->u, u, (size_t)(f->states * f->stride) * sizeof *u);
        memcpy(f->d, d, (size_t)f->states * sizeof *d);
        f->formed = 0;
        for (int o = 0; o <= n; o++) f->x[n + 1 + o] = outputs[tgi_channel(n, o)];
        memcpy(f->x_prior, f->x, sizeof f->x);
        if (f->tuning.policy != TG_FIXED) restart_sensitivities(f);
    }
    f->passage = passage;
    f->used = 0;
    return TG_OK;
}
