/* Exact engine: the model is affine in the state, so this time-varying Kalman filter is the Bayesian answer, and the unscented filter's
 * too. The predicted columns of U are F u, of which only the outputs' rows change. Channels are used one by one, each as soon as the
 * columns that it touches are factored, so that the two chains of divisions overlap; a_x, which touches all, comes last. */
#include "factor.h"

/* One column, or the mean, over the map. */
TG_INLINE void exact_move(const tg_passage *p, const tg_real *from, tg_real *to, const int n, const int stride)
{
    tg_real v = from[n + 1] - p->g * from[n];
    for (int i = 0; i < n; i++) v += p->c[i] * from[i];
    for (int i = 0; i < stride; i += TG_LANES) lanes_store(to + i, lanes_load(from + i));
    for (int i = 0; i < n; i++) to[n + 2 + i] = p->phi[i] * from[n + 2 + i] + p->b[i] * from[i];
    to[n + 1] = v;
}

/* F U in W, weights d, prior mean. */
TG_INLINE void exact_predict(const tg_filter *f, const tgi_factors *from, const tgi_plan *plan, tg_real *W, tg_real *weight, tg_real *x, const int n, const int stride)
{
    for (int k = 0; k < TG_TWICE(n); k++) exact_move(&plan->passage, from->u + k * stride, W + k * stride, n, stride);
    for (int k = 0; k < TG_TWICE(n); k++) weight[k] = from->d[k];
    exact_move(&plan->passage, f->x, x, n, stride);
    for (int j = n + 1; j < TG_TWICE(n); j++) x[j] += plan->shift[j];
}

/* Take one channel. `along`: U'h, zero before column `first`; `coupling`: h times the gains of the channels before it. From those come the
 * innovation and its variance before any update, and from them the weight. */
TG_INLINE void exact_update(const tg_filter *f, const tgi_plan *plan, tgi_result *out, int o, const tg_real *along, const tg_real *coupling,
                          int first, tg_real residual, const int n, const int stride)
{
    const int used = out->used;
    tg_real *const gain = out->gain[used];
    tg_real spread[TG_ROWS], sum = 0, innovation = residual, variance = plan->r[o];
    for (int k = first; k < TG_TWICE(n); k++) {
        sum += out->d[k] * along[k] * along[k];
        spread[k] = sum;
    }
    for (int c = 0; c < used; c++) {
        innovation += coupling[c] * out->residual[c];
        variance += coupling[c] * coupling[c] * out->residual_variance[c];
    }
    variance += sum;
    const tg_real weight = tgi_weight(f->tuning.huber, innovation, variance);
    const tg_real r = weight < 1 ? plan->r[o] / weight : plan->r[o];
    const tg_real inverse = factor_measure(out->u, out->d, along, spread, first, TG_TWICE(n), stride, r, gain);
    for (int i = 0; i < stride; i += TG_LANES)
        lanes_store(out->x + i, lanes_load(out->x + i) + residual * lanes_load(gain + i));
    out->channel[used] = o;
    out->residual[used] = residual;
    out->residual_variance[used] = r + sum;
    out->square += residual * residual * inverse;
    out->volume *= r + sum;
    out->innovation[o] = innovation;
    out->variance[o] = variance;
    out->weight[o] = weight;
    out->used = used + 1;
}

TG_INLINE void exact_use_output(const tg_filter *f, const tgi_plan *plan, tgi_result *out, int j, const int n, const int stride)
{
    const int o = j - n - 1;
    tg_real along[TG_ROWS], coupling[TG_MAX_CHANNELS];
    if (!plan->present[o]) return;
    for (int k = j; k < TG_TWICE(n); k++) along[k] = out->u[k * stride + j];
    for (int c = 0; c < out->used; c++) coupling[c] = out->gain[c][j];
    exact_update(f, plan, out, o, along, coupling, j, plan->y[o] - out->x[j], n, stride);
}

TG_INLINE void exact_use_accelerometer(const tg_filter *f, const tgi_plan *plan, tgi_result *out, const int n, const int stride)
{
    const tg_real *const h = plan->accelerometer;
    tg_real along[TG_ROWS], coupling[TG_MAX_CHANNELS], residual = plan->y[n + 1] - plan->accelerometer_shift;
    for (int k = 0; k < TG_TWICE(n); k++) {
        along[k] = 0;
        for (int i = 0; i <= n; i++) along[k] += h[i] * out->u[k * stride + i];
    }
    for (int c = 0; c < out->used; c++) {
        coupling[c] = 0;
        for (int i = 0; i <= n; i++) coupling[c] += h[i] * out->gain[c][i];
    }
    for (int i = 0; i <= n; i++) residual -= h[i] * out->x[i];
    exact_update(f, plan, out, n + 1, along, coupling, 0, residual, n, stride);
}

void tgi_exact_step(const tg_filter *f, const tgi_factors *from, const tgi_plan *plan, tgi_result *out)
{
    tg_real W[2 * TG_MAX_STATES * TG_ROWS], weight[2 * TG_MAX_STATES];
    const int n = f->wheels, stride = f->stride, rows = TG_TWICE(n);
    exact_predict(f, from, plan, W, weight, out->x, n, stride);
    for (int i = 0; i < stride; i += TG_LANES) lanes_store(out->x_prior + i, lanes_load(out->x + i));
    for (int j = rows; j < stride; j++) out->d[j] = 0;
    out->used = 0;
    out->square = 0;
    out->volume = 1;
    tgi_gram gram = tgi_factor_begin(W, weight, rows, stride);
    for (int j = rows - 1; j > 0; j--) {
        tgi_factor_row(&gram, j, 1, plan->passage.q[j], out->u + j * stride, out->d + j);
        if (j > n && plan->count) exact_use_output(f, plan, out, j, n, stride);
    }
    tgi_factor_last(&gram, plan->passage.q[0], out->u, out->d);
    if (plan->count && plan->present[n + 1]) exact_use_accelerometer(f, plan, out, n, stride);
}
