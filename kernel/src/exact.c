/* Exact engine: the model is affine in the state, so this time-varying Kalman filter is the Bayesian answer, and the unscented filter's
 * too. The predicted columns of U are F u, of which only the outputs' rows change. Channels are taken one by one, each as soon as the
 * columns that it touches are factored, so that the two chains of divisions overlap; a_x, which touches all, comes last. */
#include "factor.h"

/* F U in W, weights d, prior mean. */
TG_INLINE void exact_predict(const tg_filter *f, const tgi_plan *plan, tg_real *W, tg_real *weight, tg_real *x, const int n, const int stride)
{
    const tg_passage *const p = &plan->passage;
    for (int k = 0; k <= TG_TWICE(n); k++) { /* the last round moves the mean */
        const tg_real *const u = k < TG_TWICE(n) ? f->u + k * stride : f->x;
        tg_real *const w = k < TG_TWICE(n) ? W + k * stride : x;
        tg_real v = u[n + 1] - p->g * u[n];
        for (int i = 0; i < n; i++) v += p->c[i] * u[i];
        for (int i = 0; i <= n; i++) w[i] = u[i];
        w[n + 1] = v;
        for (int i = 0; i < n; i++) w[n + 2 + i] = p->phi[i] * u[n + 2 + i] + p->b[i] * u[i];
        for (int i = TG_TWICE(n); i < stride; i++) w[i] = 0;
    }
    for (int k = 0; k < TG_TWICE(n); k++) weight[k] = f->d[k];
    for (int j = n + 1; j < TG_TWICE(n); j++) x[j] += plan->shift[j];
}

/* Innovations, their prior variances and the weights of all channels, before any is taken. */
TG_INLINE void exact_innovations(const tg_filter *f, const tgi_plan *plan, const tg_real *W, const tg_real *weight, tgi_result *out,
                                 const int n, const int stride)
{
    tg_real variance[TG_ROWS];
    const int first = (n + 1) / TG_LANES, lanes = stride / TG_LANES;
    tg_lanes sum[TG_MOST_LANES];
    for (int i = first; i < lanes; i++) sum[i] = lanes_all(0);
    for (int k = 0; k < TG_TWICE(n); k++)
        for (int i = first; i < lanes; i++) {
            const tg_lanes w = lanes_load(W + k * stride + TG_LANES * i);
            sum[i] = lanes_mul_add(lanes_mul(lanes_all(weight[k]), w), w, sum[i]);
        }
    for (int i = first; i < lanes; i++) lanes_store(variance + TG_LANES * i, sum[i]);
    for (int o = 0; o <= n; o++) {
        const int j = n + 1 + o;
        out->innovation[o] = plan->y[o] - out->x[j];
        out->variance[o] = variance[j] + plan->passage.q[j] + plan->r[o];
    }
    out->innovation[n + 1] = (tg_real)NAN;
    out->variance[n + 1] = 0;
    if (plan->present[n + 1]) {
        const tg_real *const h = plan->accelerometer;
        tg_real expected = plan->accelerometer_shift, S = plan->r[n + 1];
        for (int k = 0; k < TG_TWICE(n); k++) {
            tg_real along = 0;
            for (int i = 0; i <= n; i++) along += h[i] * W[k * stride + i];
            S += weight[k] * along * along;
        }
        for (int i = 0; i <= n; i++) {
            S += h[i] * h[i] * plan->passage.q[i];
            expected += h[i] * out->x[i];
        }
        out->innovation[n + 1] = plan->y[n + 1] - expected;
        out->variance[n + 1] = S;
    }
    for (int o = 0; o < n + 2; o++)
        out->weight[o] = plan->present[o] ? tgi_weight(f->tuning.huber, out->innovation[o], out->variance[o]) : 1;
}

/* Take one channel, whose U'h is `along`, zero before column `first`, and whose residual is `residual`. */
TG_INLINE void exact_take(const tgi_plan *plan, tgi_result *out, int o, const tg_real *along, int first, tg_real residual, const int n,
                          const int stride)
{
    tg_real *const gain = out->gain[out->taken];
    const tg_real variance =
        factor_measure(out->u, out->d, along, first, TG_TWICE(n), stride, plan->r[o] / out->weight[o], gain);
    for (int i = 0; i < stride / TG_LANES; i++)
        lanes_store(out->x + TG_LANES * i, lanes_mul_add(lanes_all(residual), lanes_load(gain + TG_LANES * i), lanes_load(out->x + TG_LANES * i)));
    out->channel[out->taken] = o;
    out->residual[out->taken] = residual;
    out->residual_variance[out->taken++] = variance;
}

TG_INLINE void exact_take_output(const tgi_plan *plan, tgi_result *out, int j, const int n, const int stride)
{
    const int o = j - n - 1;
    tg_real along[TG_ROWS];
    if (!plan->present[o]) return;
    for (int k = j; k < TG_TWICE(n); k++) along[k] = out->u[k * stride + j];
    exact_take(plan, out, o, along, j, plan->y[o] - out->x[j], n, stride);
}

TG_INLINE void exact_take_accelerometer(const tgi_plan *plan, tgi_result *out, const int n, const int stride)
{
    const tg_real *const h = plan->accelerometer;
    tg_real along[TG_ROWS], residual = plan->y[n + 1] - plan->accelerometer_shift;
    for (int k = 0; k < TG_TWICE(n); k++) {
        along[k] = 0;
        for (int i = 0; i <= n; i++) along[k] += h[i] * out->u[k * stride + i];
    }
    for (int i = 0; i <= n; i++) residual -= h[i] * out->x[i];
    exact_take(plan, out, n + 1, along, 0, residual, n, stride);
}

TG_INLINE void exact_step(const tg_filter *f, const tgi_plan *plan, tgi_result *out, const int n, const int stride)
{
    tg_real W[2 * TG_MAX_STATES * TG_ROWS], weight[2 * TG_MAX_STATES];
    const int rows = TG_TWICE(n);
    exact_predict(f, plan, W, weight, out->x, n, stride);
    for (int i = 0; i < stride; i++) out->x_prior[i] = out->x[i];
    out->taken = 0;
    if (plan->count) exact_innovations(f, plan, W, weight, out, n, stride);
    tgi_gram gram = factor_begin(W, weight, rows, stride);
#define TAKE(j, lanes)                                                                          \
    {                                                                                           \
        factor_row(&gram, j, lanes, plan->passage.q[j], out->u + (j) * stride, out->d + (j));   \
        if ((j) > n && plan->count) exact_take_output(plan, out, j, n, stride);                 \
    }
    TG_ROWS_DOWN(rows - 1, 0, stride, TAKE)
#undef TAKE
    if (plan->count && plan->present[n + 1]) exact_take_accelerometer(plan, out, n, stride);
}

void tgi_exact_step(const tg_filter *f, const tgi_plan *plan, tgi_result *out)
{
#define STEP(n, stride) exact_step(f, plan, out, n, stride)
    TG_BY_WHEELS(f->wheels, STEP)
#undef STEP
}
