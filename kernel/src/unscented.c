/* Unscented engine, the paper's: 2 nx + 1 sigma points through Runge-Kutta 4 of the model, moments by their weights, sigma points redrawn
 * before the update. The factors come from the weighted deviations by Gram-Schmidt, and so does the update: factoring the covariance of
 * [x; y] with the channels' rows first gives the gains (the channels' columns) and the posterior factors (the rest). */
#include "factor.h"

/* d/dt of (v, omega_1..omega_n) at the state x in row order, inputs held, but for the bearings' drag: paper eq. 3 and 2, with a slope. It
 * is the same all over a step, since mu and rho_s stay. */
TG_INLINE void model_rates(const tg_filter *f, const tg_input *u, tg_real cosine, tg_real sine, const tg_real *x, tg_real *rate, const int n)
{
    const tg_real *const mu = x, rho = x[n];
    tg_real traction = 0;
    for (int i = 0; i < n; i++) {
        rate[1 + i] = u->torque[i] * f->inverse_inertia[i] - (mu[i] + f->machine.tire_rolling_resistance) * u->load[i] * f->arm[i];
        traction += mu[i] * u->load[i];
    }
    rate[0] = (traction - u->drawbar - rho * u->hitch_load) * tgi_inverse_mass(f, u) - f->machine.gravity * (rho * cosine + sine);
}

/* One step of the state (paper eq. 9) by Runge-Kutta 4 in equal substeps; mu and rho_s stay, so that v gains alike in every stage. */
TG_INLINE void model_move(const tg_filter *f, const tgi_plan *plan, tg_real *x, const int n)
{
    const tg_real h = plan->passage.dt / (tg_real)plan->substeps;
    tg_real rate[TG_MAX_WHEELS + 1], *const omega = x + n + 2;
    model_rates(f, plan->before, plan->cosine[0], plan->sine[0], x, rate, n);
    x[n + 1] += plan->passage.dt * rate[0];
    for (int32_t step = 0; step < plan->substeps; step++)
        for (int i = 0; i < n; i++) {
            const tg_real moved = f->moves[i] * h, k1 = rate[1 + i] - omega[i] * f->drag[i];
            const tg_real k2 = rate[1 + i] - (omega[i] + moved / 2 * k1) * f->drag[i];
            const tg_real k3 = rate[1 + i] - (omega[i] + moved / 2 * k2) * f->drag[i];
            const tg_real k4 = rate[1 + i] - (omega[i] + moved * k3) * f->drag[i];
            omega[i] += moved / 6 * (k1 + 2 * (k2 + k3) + k4);
        }
}

/* What the channels should read at x (paper eq. 9): v, omega_1..omega_n, a_x. */
TG_INLINE void model_channels(const tgi_plan *plan, const tg_real *x, tg_real *y, const int n)
{
    for (int o = 0; o <= n; o++) y[o] = x[n + 1 + o];
    y[n + 1] = plan->accelerometer_shift;
    for (int i = 0; i <= n; i++) y[n + 1] += plan->accelerometer[i] * x[i];
}

typedef struct {
    tg_real spread;      /* sigma points are sqrt(spread) factors from the mean */
    tg_real mean, other; /* weights in the mean: of the centre and of each other point */
    tg_real covariance;  /* weight of the centre in the covariance */
} weights;

TG_INLINE weights unscented_weights(const tg_tuning *t, const int n)
{
    weights w;
    const tg_real states = (tg_real)TG_TWICE(n);
    w.spread = t->alpha * t->alpha * (states + t->kappa);
    w.other = 1 / (2 * w.spread);
    w.mean = 1 - states / w.spread;
    w.covariance = w.mean + 1 - t->alpha * t->alpha + t->beta;
    return w;
}

/* Sigma points in columns `stride` apart from factors whose columns are `from` apart. */
TG_INLINE void draw(const weights *w, const tg_real *x, const tg_real *u, const tg_real *d, int from, tg_real *points, int stride, const int n)
{
    const int rows = TG_TWICE(n), lanes = from / TG_LANES;
    tg_real reach[TG_ROWS];
    for (int k = 0; k < rows; k++) reach[k] = tgi_sqrt(w->spread * d[k]);
    for (int i = 0; i < lanes; i++) lanes_store(points + TG_LANES * i, lanes_load(x + TG_LANES * i));
    for (int k = 0; k < rows; k++)
        for (int i = 0; i < lanes; i++) {
            const tg_lanes away = reach[k] * lanes_load(u + k * from + TG_LANES * i);
            const tg_lanes centre = lanes_load(x + TG_LANES * i);
            lanes_store(points + (1 + 2 * k) * stride + TG_LANES * i, centre + away);
            lanes_store(points + (2 + 2 * k) * stride + TG_LANES * i, centre - away);
        }
}

/* Replace points by their deviations from their weighted mean. */
TG_INLINE void centre(const weights *w, tg_real *points, tg_real *mean, int stride, const int n)
{
    const int count = 2 * TG_TWICE(n) + 1;
    for (int i = 0; i < stride; i += TG_LANES) {
        tg_lanes plus = lanes_all(0), minus = lanes_all(0);
        for (int k = 1; k < count; k += 2) {
            plus += lanes_load(points + k * stride + i);
            minus += lanes_load(points + (k + 1) * stride + i);
        }
        const tg_lanes m = w->other * (plus + minus) + w->mean * lanes_load(points + i);
        lanes_store(mean + i, m);
        for (int k = 0; k < count; k++) lanes_store(points + k * stride + i, lanes_load(points + k * stride + i) - m);
    }
}

/* Predicted mean and factors of the predicted covariance (paper eq. 10 and 11). */
TG_INLINE void unscented_predict(const tg_filter *f, const tgi_plan *plan, const weights *w, tgi_result *out, const int n, const int stride)
{
    const int rows = TG_TWICE(n), count = 2 * rows + 1;
    tg_real W[(3 * TG_MAX_STATES + 1) * TG_ROWS], weight[3 * TG_MAX_STATES + 1];
    draw(w, f->x, f->u, f->d, stride, W, stride, n);
    for (int k = 0; k < count; k++) {
        model_move(f, plan, W + k * stride, n);
        weight[k] = k ? w->other : w->covariance;
    }
    centre(w, W, out->x_prior, stride, n);
    tgi_gram gram = tgi_factor_begin(W, weight, count, stride);
    for (int j = rows - 1; j > 0; j--)
        tgi_factor_row(&gram, j, 1, plan->passage.q[j], out->u + j * stride, out->d + j);
    tgi_factor_last(&gram, plan->passage.q[0], out->u, out->d);
}

/* Rows of the joint factor: the state, then a_x, v, omega_1..omega_n: the last comes first, as in the exact engine. */
TG_INLINE int joint_row(const int n, int o) { return o == n + 1 ? TG_TWICE(n) : TG_TWICE(n) + 1 + o; }

/* Append the channels to the points; a missing one reads 0 everywhere. */
TG_INLINE void measure(const tgi_plan *plan, tg_real *points, int stride, const int n)
{
    for (int k = 0; k < 2 * TG_TWICE(n) + 1; k++) {
        tg_real y[TG_MAX_CHANNELS], *const point = points + k * stride;
        model_channels(plan, point, y, n);
        for (int o = 0; o < n + 2; o++) point[joint_row(n, o)] = plan->present[o] ? y[o] : 0;
        for (int i = joint_row(n, n) + 1; i < stride; i++) point[i] = 0;
    }
}

/* The update (paper eq. 12 and 13) from points redrawn, channel by channel of their joint factor. */
TG_INLINE void unscented_update(const tg_filter *f, const tgi_plan *plan, const weights *w, tgi_result *out, const int n, const int stride,
                                const int joint)
{
    const int rows = TG_TWICE(n), count = 2 * rows + 1, all = rows + n + 2;
    tg_real W[(2 * TG_MAX_STATES + 1 + TG_MAX_CHANNELS) * TG_MOST_LANES * TG_LANES], weight[2 * TG_MAX_STATES + 1 + TG_MAX_CHANNELS];
    tg_real mean[TG_MOST_LANES * TG_LANES], r[TG_MAX_CHANNELS], u[TG_MAX_CHANNELS][TG_MOST_LANES * TG_LANES], d[TG_MAX_CHANNELS];
    tg_real column[TG_MOST_LANES * TG_LANES];
    draw(w, out->x_prior, out->u, out->d, stride, W, joint, n);
    measure(plan, W, joint, n);
    centre(w, W, mean, joint, n);
    for (int k = 0; k < count; k++) weight[k] = k ? w->other : w->covariance;
    for (int o = 0; o < n + 2; o++) {
        const int j = joint_row(n, o);
        out->innovation[o] = plan->y[o] - mean[j];
        out->variance[o] = plan->r[o];
        for (int k = 0; k < count; k++) out->variance[o] += weight[k] * W[k * joint + j] * W[k * joint + j];
        out->weight[o] = plan->present[o] ? tgi_weight(f->tuning.huber, out->innovation[o], out->variance[o]) : 1;
        r[j - rows] = plan->present[o] ? plan->r[o] / out->weight[o] : 1;
    }
    tgi_gram gram = tgi_factor_begin(W, weight, count, joint);
    for (int j = all - 1; j >= rows; j--)
        tgi_factor_row(&gram, j, 1, r[j - rows], u[j - rows], d + (j - rows));
    for (int j = rows - 1; j >= 0; j--) {
        if (j > 0) tgi_factor_row(&gram, j, 0, 0, column, out->d + j);
        else tgi_factor_last(&gram, 0, column, out->d);
        for (int i = 0; i < stride; i += TG_LANES) lanes_store(out->u + j * stride + i, lanes_load(column + i));
    }
    tg_real residual[TG_MAX_CHANNELS];
    for (int i = 0; i < stride; i++) out->x[i] = out->x_prior[i];
    for (int o = n; o >= -1; o--) { /* omega_n .. omega_1, v, a_x */
        const int c = o < 0 ? n + 1 : o, a = joint_row(n, c) - rows;
        if (!plan->present[c]) {
            residual[a] = 0;
            continue;
        }
        residual[a] = out->innovation[c];
        for (int b = n + 1; b > a; b--) residual[a] -= u[b][rows + a] * residual[b];
        out->channel[out->used] = c;
        out->residual[out->used] = residual[a];
        out->residual_variance[out->used] = d[a];
        out->square += residual[a] * residual[a] / d[a];
        out->volume *= d[a];
        for (int i = 0; i < stride; i++) {
            out->gain[out->used][i] = i < rows ? u[a][i] : 0;
            out->x[i] += out->gain[out->used][i] * residual[a];
        }
        out->used++;
    }
}

void tgi_unscented_step(const tg_filter *f, const tgi_plan *plan, tgi_result *out)
{
    const int n = f->wheels, stride = f->stride, joint = (TG_TWICE(n) + n + 2 + TG_LANES - 1) / TG_LANES * TG_LANES;
    const weights w = unscented_weights(&f->tuning, n);
    out->used = 0;
    out->square = 0;
    out->volume = 1;
    for (int j = TG_TWICE(n); j < stride; j++) out->d[j] = 0;
    unscented_predict(f, plan, &w, out, n, stride);
    if (plan->count)
        unscented_update(f, plan, &w, out, n, stride, joint);
    else
        for (int i = 0; i < stride; i++) out->x[i] = out->x_prior[i];
}
