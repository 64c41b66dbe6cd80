/* Adaptation of Q by the innovations (physics.md 6, the MIT rule): A = diag(a_j) descends V = tr(dS dS'), dS the difference from I of C,
 * the mean product of whitened innovations (docs/decisions/0024-whitened-innovations.md). Sensitivities to ln a_j run through the whole
 * recursion, one lane a parameter.
 *
 * Channels are used one by one, so S = T diag(variance) T' with T unit triangular from the gains. */
#include "filter.h"

#define SCALE_MIN ((tg_real)0.05)
#define SCALE_MAX 50
#define STEP_MAX ((tg_real)0.2)
#define CURVATURE_MIN ((tg_real)1e-3)

#define DP(i, j) (s->dP + pair(i, j) * stride) /* the lanes of one element of dP */

TG_INLINE int pair(int i, int j) { return i > j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i; }

/* Row a of the map's block from parameters to outputs (0: v; a: omega_a), times the parameters' lanes at `rows`. */
TG_INLINE tg_lanes along(const tg_passage *p, int a, const tg_real *const *rows, int lane, const int n)
{
    if (a > 0) return p->b[a - 1] * lanes_load(rows[a - 1] + lane);
    tg_lanes sum = -p->g * lanes_load(rows[n] + lane);
    for (int i = 0; i < n; i++) sum += p->c[i] * lanes_load(rows[i] + lane);
    return sum;
}

/* dx <- F dx, dP <- F dP F' + E. */
TG_INLINE void sensitivity_predict(tg_adaptation_state *s, const tg_filter *f, const tgi_plan *plan, const int n, const int stride)
{
    const tg_passage *const p = &plan->passage;
    const tg_real *rows[TG_MAX_WHEELS + 1];
    for (int q = 0; q <= n; q++) rows[q] = s->dx + q * stride;
    for (int a = 0; a <= n; a++) {
        tg_real *const dx = s->dx + (n + 1 + a) * stride;
        const tg_lanes own = lanes_all(a ? p->phi[a - 1] : p->keep);
        for (int l = 0; l < stride; l += TG_LANES) lanes_store(dx + l, along(p, a, rows, l, n) + own * lanes_load(dx + l));
    }
    for (int a = 0; a <= n; a++) { /* outputs by outputs, with the old outputs by parameters */
        const tg_lanes own = lanes_all(a ? p->phi[a - 1] : p->keep);
        for (int q = 0; q <= n; q++) rows[q] = DP(n + 1 + a, q);
        for (int b = 0; b <= a; b++) {
            tg_real *const dP = DP(n + 1 + a, n + 1 + b);
            const tg_lanes other = lanes_all(b ? p->phi[b - 1] : p->keep);
            for (int l = 0; l < stride; l += TG_LANES)
                lanes_store(dP + l, own * (along(p, b, rows, l, n) + other * lanes_load(dP + l)));
        }
    }
    for (int q = 0; q <= n; q++) { /* outputs by parameters */
        for (int k = 0; k <= n; k++) rows[k] = DP(k, q);
        for (int a = 0; a <= n; a++) {
            tg_real *const dP = DP(n + 1 + a, q);
            const tg_lanes own = lanes_all(a ? p->phi[a - 1] : p->keep);
            for (int l = 0; l < stride; l += TG_LANES) lanes_store(dP + l, along(p, a, rows, l, n) + own * lanes_load(dP + l));
        }
    }
    for (int b = 0; b <= n; b++) { /* the other half of outputs by outputs, with the new ones */
        for (int q = 0; q <= n; q++) rows[q] = DP(n + 1 + b, q);
        for (int a = b; a <= n; a++) {
            tg_real *const dP = DP(n + 1 + a, n + 1 + b);
            for (int l = 0; l < stride; l += TG_LANES) lanes_store(dP + l, lanes_load(dP + l) + along(p, a, rows, l, n));
        }
    }
    for (int j = 0; j < TG_TWICE(n); j++) DP(j, j)[j] += plan->gamma * s->scale[j] * f->walk[j] * p->dt;
}

/* One channel: dP <- (I - K h) dP (I - K h)', dx <- dx + dK residual - K h dx. */
TG_INLINE void sensitivity_update(tg_adaptation_state *s, const tgi_plan *plan, const tgi_result *result, int c, const int n, const int stride)
{
    const int rows = TG_TWICE(n), o = result->channel[c];
    const tg_real *const K = result->gain[c], *const h = plan->accelerometer;
    const tg_lanes ratio = lanes_all(result->residual[c] / result->residual_variance[c]);
    for (int l = 0; l < stride; l += TG_LANES) {
        tg_lanes column[TG_MAX_STATES], rest[TG_MAX_STATES], own = lanes_all(0), moved = lanes_all(0);
        for (int i = 0; i < rows; i++) {
            column[i] = lanes_all(0);
            if (o <= n)
                column[i] = lanes_load(DP(i, n + 1 + o) + l);
            else
                for (int q = 0; q <= n; q++) column[i] += h[q] * lanes_load(DP(i, q) + l);
        }
        if (o <= n) {
            own = lanes_load(DP(n + 1 + o, n + 1 + o) + l);
            moved = lanes_load(s->dx + (n + 1 + o) * stride + l);
        } else
            for (int q = 0; q <= n; q++) {
                own += h[q] * column[q];
                moved += h[q] * lanes_load(s->dx + q * stride + l);
            }
        for (int i = 0; i < rows; i++) {
            tg_real *const dx = s->dx + i * stride + l;
            rest[i] = column[i] - K[i] * own;
            lanes_store(dx, lanes_load(dx) + rest[i] * ratio - K[i] * moved);
        }
        for (int i = 0; i < rows; i++)
            for (int j = 0; j <= i; j++) {
                tg_real *const dP = DP(i, j) + l;
                const tg_lanes less = lanes_load(dP) - K[i] * rest[j];
                lanes_store(dP, less - K[j] * column[i]);
            }
    }
}

/* X <- T^-1 X T^-T over the first `count` channels used; X by lanes. */
TG_INLINE void whiten(const tgi_result *result, int count, tg_lanes X[TG_MAX_WHEELS + 1][TG_MAX_WHEELS + 1], const int n)
{
    for (int side = 0; side < 2; side++)
        for (int c = 1; c < count; c++)
            for (int b = 0; b < c; b++) {
                const tg_lanes t = lanes_all(result->gain[b][n + 1 + result->channel[c]]);
                for (int k = 0; k < count; k++) {
                    if (side == 0) X[c][k] -= t * X[b][k];
                    if (side == 1) X[k][c] -= t * X[k][b];
                }
            }
    for (int c = 0; c < count; c++)
        for (int b = 0; b < count; b++)
            X[c][b] /= tgi_sqrt(result->residual_variance[c] * result->residual_variance[b]);
}

/* A step of ln a down V; the sensitivities are those before the update. */
TG_INLINE void descend(tg_adaptation_state *s, const tg_filter *f, const tgi_result *result, const int n, const int stride)
{
    tg_lanes excess[TG_MAX_WHEELS + 1][TG_MAX_WHEELS + 1];
    for (int c = 0; c <= n; c++)
        for (int b = 0; b <= n; b++) excess[c][b] = lanes_all(s->C[result->channel[c]][result->channel[b]] - (c == b));
    for (int l = 0; l < stride; l += TG_LANES) {
        tg_lanes dS[TG_MAX_WHEELS + 1][TG_MAX_WHEELS + 1], slope = lanes_all(0), curvature = lanes_all(0);
        for (int c = 0; c <= n; c++)
            for (int b = 0; b <= n; b++) dS[c][b] = lanes_load(DP(n + 1 + result->channel[c], n + 1 + result->channel[b]) + l);
        whiten(result, n + 1, dS, n);
        for (int c = 0; c <= n; c++)
            for (int b = 0; b <= n; b++) {
                slope += excess[c][b] * dS[c][b];
                curvature += dS[c][b] * dS[c][b];
            }
        for (int j = l; j < l + TG_LANES && j < TG_TWICE(n); j++) { /* dV/d ln a = -2 slope: where C exceeds S, a grows */
            const tg_real step = f->tuning.rate * 2 * lanes_at(slope, j - l) / (2 * lanes_at(curvature, j - l) + CURVATURE_MIN);
            const tg_real a = s->scale[j] * tgi_exp(step > STEP_MAX ? STEP_MAX : step < -STEP_MAX ? -STEP_MAX : step);
            s->scale[j] = a < SCALE_MIN ? SCALE_MIN : a > SCALE_MAX ? SCALE_MAX : a;
        }
    }
}
#undef DP

/* C towards the products of the innovations, weighted and whitened by S of that step, over the outputs used; returns how many those
 * are. */
static int remember_innovations(tg_adaptation_state *s, const tg_filter *f, const tgi_plan *plan, const tgi_result *result)
{
    const int n = f->wheels;
    const tg_real share = -tgi_expm1(-plan->passage.dt / f->tuning.memory);
    tg_real left[TG_MAX_WHEELS + 1], white[TG_MAX_WHEELS + 1]; /* T^-1 of the innovations, and over its SD */
    int count = 0;
    for (; count < result->used && result->channel[count] <= n; count++) {
        const int o = result->channel[count];
        left[count] = tgi_sqrt(result->weight[o]) * result->innovation[o];
        for (int b = 0; b < count; b++) left[count] -= result->gain[b][n + 1 + o] * left[b];
        white[count] = left[count] / tgi_sqrt(result->residual_variance[count]);
    }
    for (int c = 0; c < count; c++)
        for (int b = 0; b < count; b++) {
            tg_real *const C = &s->C[result->channel[c]][result->channel[b]];
            *C += share * (white[c] * white[b] - *C);
        }
    return count;
}

TG_INLINE int is_finite(const tg_adaptation_state *s, const int n, const int stride)
{
    const int rows = TG_TWICE(n);
    tg_lanes zero = lanes_all(0);
    tg_real rest = 0;
    for (int i = 0; i < rows * stride; i += TG_LANES) zero += lanes_load(s->dx + i) * lanes_all(0);
    for (int i = 0; i < pair(rows, 0) * stride; i += TG_LANES) zero += lanes_load(s->dP + i) * lanes_all(0);
    for (int j = 0; j < rows; j++) rest += s->scale[j] * 0;
    for (int c = 0; c <= n; c++)
        for (int b = 0; b <= n; b++) rest += s->C[c][b] * 0;
    return lanes_sum(zero) + rest == 0;
}

static void copy(tg_adaptation_state *to, const tg_adaptation_state *from, int rows, int stride)
{
    memcpy(to->scale, from->scale, sizeof to->scale);
    memcpy(to->dx, from->dx, (size_t)(rows * stride) * sizeof *to->dx);
    memcpy(to->dP, from->dP, (size_t)(pair(rows, 0) * stride) * sizeof *to->dP);
    memcpy(to->C, from->C, sizeof to->C);
    to->updates = from->updates;
}

TG_INLINE int adapt(tg_adaptation_state *s, const tg_filter *f, const tgi_plan *plan, const tgi_result *result, const int n, const int stride)
{
    sensitivity_predict(s, f, plan, n, stride);
    if (result->used && remember_innovations(s, f, plan, result) == n + 1 && ++s->updates >= f->tuning.stride) {
        descend(s, f, result, n, stride);
        s->updates = 0;
    }
    for (int c = 0; c < result->used; c++) sensitivity_update(s, plan, result, c, n, stride);
    return is_finite(s, n, stride);
}

void tgi_adaptation_init(tg_filter *f)
{
    tg_adaptation_state *const s = &f->policy.adaptive.adaptation;
    for (int j = 0; j < f->states; j++) s->scale[j] = 1;
    for (int c = 0; c <= f->wheels; c++) s->C[c][c] = 1;
}

tg_status tgi_adapt(tg_filter *f, const tgi_plan *plan, const tgi_result *result)
{
    tg_adaptation_state next;
    copy(&next, &f->policy.adaptive.adaptation, f->states, f->stride);
    if (!adapt(&next, f, plan, result, f->wheels, f->stride)) return TG_DIVERGED;
    copy(&f->policy.adaptive.adaptation, &next, f->states, f->stride);
    return TG_OK;
}
