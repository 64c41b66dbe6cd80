/* Inside the bank, see bank.c: small parts of its step. One lane a mode. */
#ifndef TG_BANK_H
#define TG_BANK_H
#include "filter.h"

typedef struct { /* P = U diag(d) U' by u[k][i], i <= k */
    tg_lanes x[TG_ROWS], d[TG_ROWS], u[TG_MAX_STATES][TG_ROWS];
} tgi_modes;

typedef struct {
    tgi_modes state;
    tg_lanes probability;                     /* prior */
    tg_lanes gain[TG_MAX_CHANNELS][TG_ROWS];
    tg_lanes residual[TG_MAX_CHANNELS], variance[TG_MAX_CHANNELS], offset[TG_MAX_CHANNELS]; /* offset: of y expected, from the mixture's */
    tg_lanes nis, volume;
    tg_real x_prior[TG_ROWS];
    tg_real innovation[TG_MAX_CHANNELS], innovation_variance[TG_MAX_CHANNELS], weight[TG_MAX_CHANNELS];
    int32_t used, channel[TG_MAX_CHANNELS];
} tgi_update;

TG_INLINE tg_real bank_mean(tg_lanes probability, tg_lanes a) { return lanes_sum(probability * a); }

/* share[i]: weight of mode i in each mode's mixture, `elapsed` s after the last mixing. The probabilities move by the transition matrix. */
TG_INLINE void bank_shares(const tg_filter *f, double elapsed, tg_lanes *probability, tg_lanes *share)
{
    const tg_real stay = tgi_exp(-(tg_real)elapsed / f->tuning.dwell), leave = (1 - stay) / (tg_real)(TG_MODES - 1);
    tg_lanes total = lanes_all(0);
    for (int i = 0; i < TG_MODES; i++) {
        tg_real row[TG_MODES];
        for (int j = 0; j < TG_MODES; j++) row[j] = (i == j ? stay : leave) * lanes_at(*probability, i);
        share[i] = lanes_load(row);
        total += share[i];
    }
    for (int i = 0; i < TG_MODES; i++) share[i] /= total;
    *probability = total;
}

/* Means of the modes, mixed; away[i]: of mode i from each mixture. */
TG_INLINE tg_lanes bank_mix_mean(const tg_lanes *share, tg_lanes x, tg_lanes *away)
{
    tg_lanes mixed = lanes_all(0);
    for (int i = 0; i < TG_MODES; i++) mixed += share[i] * lanes_at(x, i);
    for (int i = 0; i < TG_MODES; i++) away[i] = lanes_at(x, i) - mixed;
    return mixed;
}

/* The affine map on one vector a mode: a column of factors, or the means; `to` may be `from`. */
TG_INLINE void bank_map(const tg_passage *p, const tg_lanes *from, tg_lanes *to, const int n)
{
    tg_lanes v = from[n + 1] - p->g * from[n];
    for (int i = 0; i < n; i++) v += p->c[i] * from[i];
    for (int i = 0; i <= n; i++) to[i] = from[i];
    to[n + 1] = v;
    for (int i = 0; i < n; i++)
        to[n + 2 + i] = p->phi[i] * from[n + 2 + i] + p->b[i] * from[i];
}

/* Means to predicted means. */
TG_INLINE void bank_move(const tgi_plan *plan, tg_lanes *x, const int n)
{
    bank_map(&plan->passage, x, x, n);
    for (int i = n + 1; i < TG_TWICE(n); i++) x[i] += plan->shift[i];
}

/* Innovations of the mixture and their variances, and the weights, before any update. S: each mode's own variances. */
TG_INLINE void bank_innovations(const tg_filter *f, const tgi_plan *plan, const tg_lanes *S, tgi_update *out, const int n)
{
    for (int o = 0; o < n + 2; o++) {
        if (!plan->present[o]) continue;
        tg_lanes expected = o <= n ? out->state.x[n + 1 + o] : lanes_all(plan->accelerometer_shift);
        for (int i = 0; o > n && i <= n; i++) expected += plan->accelerometer[i] * out->state.x[i];
        const tg_real centre = bank_mean(out->probability, expected);
        out->offset[o] = expected - centre;
        out->innovation[o] = plan->y[o] - centre;
        out->innovation_variance[o] = bank_mean(out->probability, S[o] + out->offset[o] * out->offset[o]);
        out->weight[o] = tgi_weight(f->tuning.huber, out->innovation[o], out->innovation_variance[o]);
    }
}

/* Residual of the accelerometer after the channels before it. */
TG_INLINE tg_lanes bank_shock(const tgi_plan *plan, const tg_lanes *x, const int n)
{
    tg_lanes residual = lanes_all(plan->y[n + 1] - plan->accelerometer_shift);
    for (int i = 0; i <= n; i++) residual -= plan->accelerometer[i] * x[i];
    return residual;
}

/* What a channel leaves: its residual, and the variance of that. */
TG_INLINE void bank_note(tgi_update *out, int o, tg_lanes residual, tg_lanes variance, tg_lanes inverse)
{
    out->nis += residual * residual * inverse;
    out->volume *= variance;
    out->channel[out->used] = o;
    out->residual[out->used] = residual;
    out->variance[out->used++] = variance;
}
#endif
