/* The bank's step on the modes' covariances themselves, under the bound of direct.h in each of them (docs/decisions/0001): half the work of
 * factors, and mixing is a sum. Lower triangles, P[i][j] with j <= i, in the place of factors. */
#include "bank.h"
#include "direct.h"

#if TGI_DIRECT

typedef tg_lanes (*triangle)[TG_ROWS];

TG_INLINE tg_lanes at(triangle P, int i, int j) { return i >= j ? P[i][j] : P[j][i]; }

/* Moments of each mode's mixture: mean covariance, and the spread of the means. */
TG_INLINE void mix(const tg_filter *f, tgi_modes *m, tg_lanes *probability, const int n)
{
    tg_lanes share[TG_MODES], away[TG_MAX_STATES][TG_MODES], weighted[TG_MAX_STATES][TG_MODES];
    bank_shares(f, f->clock - f->policy.bank.mixed, probability, share);
    for (int r = 0; r < TG_TWICE(n); r++) {
        m->x[r] = bank_mix_mean(share, m->x[r], away[r]);
        for (int i = 0; i < TG_MODES; i++) weighted[r][i] = lanes_mul(share[i], away[r][i]);
        for (int c = 0; c <= r; c++) {
            const tg_lanes P = m->u[r][c];
            tg_lanes own = bank_zeros(), spread = bank_zeros();
            for (int i = 0; i < TG_MODES; i++) {
                own = lanes_mul_add(share[i], lanes_all(lanes_at(P, i)), own);
                spread = lanes_mul_add(weighted[r][i], away[c][i], spread);
            }
            m->u[r][c] = lanes_add(own, spread);
        }
    }
}

/* F P F' + Q, block by block. */
TG_INLINE void predict(const tg_passage *p, triangle P, const tg_lanes *noise, triangle to, const int n)
{
    const int rho = n, v = n + 1, w = n + 2;
    const tg_lanes g = lanes_all(p->g);
    tg_lanes moved[TG_MAX_STATES], c[TG_MAX_WHEELS]; /* of v' with every old state */
    for (int i = 0; i < n; i++) c[i] = lanes_all(p->c[i]);
    for (int j = 0; j < TG_TWICE(n); j++) {
        moved[j] = lanes_mul_sub(g, at(P, rho, j), at(P, v, j));
        for (int i = 0; i < n; i++) moved[j] = lanes_mul_add(c[i], at(P, i, j), moved[j]);
    }
    for (int i = 0; i <= rho; i++) {
        for (int j = 0; j <= i; j++) to[i][j] = P[i][j];
        to[v][i] = moved[i];
    }
    to[v][v] = lanes_mul_sub(g, moved[rho], moved[v]);
    for (int i = 0; i < n; i++) to[v][v] = lanes_mul_add(c[i], moved[i], to[v][v]);
    for (int i = 0; i < n; i++) {
        const tg_lanes phi = lanes_all(p->phi[i]), b = lanes_all(p->b[i]);
        for (int j = 0; j <= rho; j++) to[w + i][j] = lanes_mul_add(b, at(P, i, j), lanes_mul(phi, P[w + i][j]));
        to[w + i][v] = lanes_mul_add(b, moved[i], lanes_mul(phi, moved[w + i]));
        for (int j = 0; j <= i; j++) {
            const tg_lanes cross = lanes_mul_add(b, P[w + j][i], lanes_mul(phi, P[w + i][w + j])); /* omega_i' with the old omega_j */
            to[w + i][w + j] = lanes_mul_add(lanes_all(p->b[j]), to[w + i][j], lanes_mul(lanes_all(p->phi[j]), cross));
        }
    }
    for (int j = 0; j < TG_TWICE(n); j++) to[j][j] = lanes_add(to[j][j], noise[j]);
}

/* least = min(least, share), mode by mode. */
TG_INLINE void lessen(tg_real *least, tg_lanes share)
{
    tg_real own[TG_MODES];
    lanes_store(own, share);
    for (int m = 0; m < TG_MODES; m++) least[m] = own[m] < least[m] ? own[m] : least[m];
}

/* P h of the accelerometer, by rows. */
TG_INLINE void jolt_column(const tgi_plan *plan, triangle P, tg_lanes *h, const int n)
{
    for (int j = 0; j < TG_TWICE(n); j++) {
        h[j] = bank_zeros();
        for (int i = 0; i <= n; i++) h[j] = lanes_mul_add(lanes_all(plan->accelerometer[i]), at(P, i, j), h[j]);
    }
}

TG_INLINE tg_lanes along_jolt(const tgi_plan *plan, const tg_lanes *h, const int n)
{
    tg_lanes sum = bank_zeros();
    for (int i = 0; i <= n; i++) sum = lanes_mul_add(lanes_all(plan->accelerometer[i]), h[i], sum);
    return sum;
}

/* One channel in every mode; h = P H', `product` = H P H'. */
TG_INLINE void take(const tgi_plan *plan, tgi_update *out, int o, const tg_lanes *h, tg_lanes product, tg_lanes residual, const int n)
{
    tgi_modes *const m = &out->state;
    tg_lanes *const K = out->gain[out->taken];
    const tg_real r = plan->r[o] / out->weight[o];
    const tg_lanes variance = lanes_add(product, lanes_all(r)), inverse = lanes_div(lanes_all(1), variance);
    for (int i = 0; i < TG_TWICE(n); i++) {
        K[i] = lanes_mul(h[i], inverse);
        m->x[i] = lanes_mul_add(K[i], residual, m->x[i]);
        for (int j = 0; j <= i; j++) m->u[i][j] = lanes_mul_sub(h[i], K[j], m->u[i][j]);
    }
    bank_note(out, o, residual, variance, inverse);
}

/* Channels in the order of the other way. `left` gets the second half of the bound: the least share R/S of those that measure a state
 * itself, times the accelerometer's, of each mode. */
TG_INLINE void take_channels(const tg_filter *f, const tgi_plan *plan, tgi_update *out, tg_real *left, const int n)
{
    const triangle P = out->state.u;
    tg_lanes S[TG_MAX_CHANNELS], h[TG_MAX_STATES];
    for (int o = 0; o <= n; o++) {
        S[o] = lanes_add(P[n + 1 + o][n + 1 + o], lanes_all(plan->r[o]));
        if (plan->present[o]) lessen(left, lanes_div(lanes_all(plan->r[o]), S[o]));
    }
    if (plan->present[n + 1]) {
        jolt_column(plan, P, h, n);
        S[n + 1] = lanes_add(along_jolt(plan, h, n), lanes_all(plan->r[n + 1]));
        lanes_store(left, lanes_mul(lanes_load(left), lanes_div(lanes_all(plan->r[n + 1]), S[n + 1])));
    }
    bank_innovations(f, plan, S, out, n);
    for (int o = n; o >= 0; o--) {
        const int own = n + 1 + o;
        if (!plan->present[o]) continue;
        for (int j = 0; j < TG_TWICE(n); j++) h[j] = at(P, own, j);
        take(plan, out, o, h, h[own], lanes_sub(lanes_all(plan->y[o]), out->state.x[own]), n);
    }
    if (!plan->present[n + 1]) return;
    jolt_column(plan, P, h, n);
    take(plan, out, n + 1, h, along_jolt(plan, h, n), bank_jolt(plan, out->state.x, n), n);
}

int tgi_bank_direct(const tg_filter *f, const tgi_plan *plan, int mixes, const tg_lanes *noise, tgi_modes *before, tgi_update *out)
{
    const int n = f->wheels;
    const triangle P = out->state.u;
    tg_real least[TG_MODES], left[TG_MODES]; /* the two halves of the bound; the first: a state's noise as a share of its variance */
    int holds = 1;
    if (mixes) mix(f, before, &out->probability, n);
    bank_move(plan, before->x, out->state.x, n);
    predict(&plan->passage, before->u, noise, P, n);
    lanes_store(least, lanes_all(1));
    lanes_store(left, lanes_all(1));
    for (int j = 0; j < TG_TWICE(n); j++) lessen(least, lanes_div(noise[j], P[j][j]));
    for (int j = 0; j < TG_TWICE(n); j++) out->x_prior[j] = bank_mean(out->probability, out->state.x[j]);
    if (plan->count) take_channels(f, plan, out, left, n);
    for (int m = 0; m < TG_MODES; m++) holds &= least[m] * left[m] >= TGI_SHARES;
    return holds;
}
#endif
