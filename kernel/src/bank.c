/* A bank of four exact filters over the scale of Q, mixed as interacting multiple models (Blom and Bar-Shalom 1988). One lane a mode:
 * every operation is done for all four at once. Algebra as in factor.h, but row by row, since lanes are taken by the modes. */
#include "filter.h"

#define PROBABILITY_MIN ((tg_real)1e-12)
#define COLUMNS_MAX (TG_MODES * (TG_MAX_STATES + 1)) /* of mixing: all modes' factors and means */

typedef struct {
    tg_lanes x[TG_ROWS], d[TG_ROWS], u[TG_MAX_STATES][TG_ROWS]; /* u[k][i], i <= k */
} modes;

typedef struct { /* W by rows, and the weight of its columns */
    tg_lanes W[TG_MAX_STATES][COLUMNS_MAX], weight[COLUMNS_MAX];
} array;

typedef struct {
    modes state;
    tg_lanes probability;                     /* prior */
    tg_lanes gain[TG_MAX_CHANNELS][TG_ROWS];
    tg_lanes residual[TG_MAX_CHANNELS], variance[TG_MAX_CHANNELS], offset[TG_MAX_CHANNELS]; /* offset: of y expected, from the mixture's */
    tg_lanes nis, volume;
    tg_real x_prior[TG_ROWS];
    tg_real innovation[TG_MAX_CHANNELS], innovation_variance[TG_MAX_CHANNELS], weight[TG_MAX_CHANNELS];
    int32_t taken, channel[TG_MAX_CHANNELS];
} update;

TG_INLINE tg_lanes zeros(void) { return lanes_all(0); }
TG_INLINE tg_real mean(tg_lanes probability, tg_lanes a) { return lanes_sum(lanes_mul(probability, a)); }

/* Factor W diag(weight) W' + diag(noise) of `rows` rows by Gram-Schmidt. After each row `joining` more columns of W count, which are zero in
 * the rows below; or, where `noise` is given, the row's own column of the identity. */
TG_INLINE void bank_factor(array *a, int rows, int columns, int joining, const tg_lanes *noise, tg_lanes (*u)[TG_ROWS], tg_lanes *d)
{
    tg_lanes v[COLUMNS_MAX];
    for (int j = rows - 1; j >= 0; j--) {
        const tg_lanes *const own = a->W[j];
        tg_lanes even = noise ? noise[j] : zeros(), odd = lanes_all(TG_TINY);
        for (int k = 0; k < columns; k++) v[k] = lanes_mul(a->weight[k], own[k]);
        for (int k = 0; k + 2 <= columns; k += 2) {
            even = lanes_mul_add(v[k], own[k], even);
            odd = lanes_mul_add(v[k + 1], own[k + 1], odd);
        }
        if (columns % 2) even = lanes_mul_add(v[columns - 1], own[columns - 1], even);
        d[j] = lanes_add(even, odd);
        const tg_lanes inverse = lanes_div(lanes_all(1), d[j]);
        u[j][j] = lanes_all(1);
        for (int i = 0; i < j; i++) {
            tg_lanes *const row = a->W[i];
            tg_lanes sum[4] = {zeros(), zeros(), zeros(), zeros()};
            int k = 0;
            for (; k + 4 <= columns; k += 4)
                for (int c = 0; c < 4; c++) sum[c] = lanes_mul_add(v[k + c], row[k + c], sum[c]);
            for (; k < columns; k++) sum[0] = lanes_mul_add(v[k], row[k], sum[0]);
            const tg_lanes part = lanes_mul(lanes_add(lanes_add(sum[0], sum[1]), lanes_add(sum[2], sum[3])), inverse);
            u[j][i] = part;
            for (k = 0; k < columns; k++) row[k] = lanes_mul_sub(part, own[k], row[k]);
            if (noise) row[columns] = lanes_sub(zeros(), part);
        }
        if (noise) a->weight[columns++] = noise[j];
        columns += joining;
    }
}

static void load(const tg_filter *f, modes *m)
{
    const tg_bank_state *const b = &f->policy.bank;
    for (int k = 0; k < f->states; k++) {
        m->x[k] = lanes_load(b->x[k]);
        m->d[k] = lanes_load(b->d[k]);
        for (int i = 0; i <= k; i++) m->u[k][i] = lanes_load(b->u[k][i]);
    }
}

static void store(tg_filter *f, const modes *m)
{
    tg_bank_state *const b = &f->policy.bank;
    for (int k = 0; k < f->states; k++) {
        lanes_store(b->x[k], m->x[k]);
        lanes_store(b->d[k], m->d[k]);
        for (int i = 0; i <= k; i++) lanes_store(b->u[k][i], m->u[k][i]);
    }
}

void tgi_bank_init(tg_filter *f)
{
    modes m;
    for (int k = 0; k < f->states; k++) {
        m.x[k] = lanes_all(f->x[k]);
        m.d[k] = lanes_all(f->d[k]);
        for (int i = 0; i <= k; i++) m.u[k][i] = lanes_all(f->u[k * f->stride + i]);
    }
    store(f, &m);
    for (int b = 0; b < TG_MODES; b++) f->policy.bank.probability[b] = (tg_real)1 / TG_MODES;
}

/* Each mode starts anew from the mixture of all, as seen from it; the probabilities move by the transition matrix. `elapsed`: s since the
 * last mixing. The mixture's own mean and covariance stay. */
static void mix(const tg_filter *f, double elapsed, modes *m, tg_lanes *probability, array *a)
{
    static const int all = TG_MODES;
    const int rows = f->states;
    const tg_real stay = tgi_exp(-(tg_real)elapsed / f->tuning.dwell), leave = (1 - stay) / (tg_real)(all - 1);
    tg_lanes share[TG_MODES], total = zeros(); /* share[i]: weight of mode i in each mode's mixture */
    for (int i = 0; i < all; i++) {
        tg_real row[TG_MODES];
        for (int j = 0; j < all; j++) row[j] = (i == j ? stay : leave) * lanes_at(*probability, i);
        share[i] = lanes_load(row);
        total = lanes_add(total, share[i]);
    }
    for (int i = 0; i < all; i++) share[i] = lanes_div(share[i], total);
    *probability = total;
    tg_lanes x[TG_MAX_STATES];
    for (int r = 0; r < rows; r++) {
        x[r] = zeros();
        for (int i = 0; i < all; i++) x[r] = lanes_mul_add(share[i], lanes_all(lanes_at(m->x[r], i)), x[r]);
        for (int i = 0; i < all; i++) a->W[r][i] = lanes_sub(lanes_all(lanes_at(m->x[r], i)), x[r]);
        for (int k = rows - 1; k >= r; k--) /* the last columns of U first: row r has none before its own */
            for (int i = 0; i < all; i++) a->W[r][all * (rows - k) + i] = lanes_all(lanes_at(m->u[k][r], i));
    }
    for (int i = 0; i < all; i++) {
        a->weight[i] = share[i];
        for (int k = 0; k < rows; k++) a->weight[all * (rows - k) + i] = lanes_mul(share[i], lanes_all(lanes_at(m->d[k], i)));
    }
    for (int r = 0; r < rows; r++) m->x[r] = x[r];
    bank_factor(a, rows, 2 * all, all, NULL, m->u, m->d);
}

TG_INLINE void bank_predict(const tgi_plan *plan, const modes *m, array *a, tg_lanes *x, const int n)
{
    const tg_passage *const p = &plan->passage;
    for (int k = 0; k <= TG_TWICE(n); k++) { /* the last round moves the means */
        tg_lanes from[TG_MAX_STATES], v, to[TG_MAX_STATES];
        for (int i = 0; i < TG_TWICE(n); i++) from[i] = k == TG_TWICE(n) ? m->x[i] : i <= k ? m->u[k][i] : zeros();
        v = lanes_mul_sub(lanes_all(p->g), from[n], from[n + 1]);
        for (int i = 0; i < n; i++) v = lanes_mul_add(lanes_all(p->c[i]), from[i], v);
        for (int i = 0; i <= n; i++) to[i] = from[i];
        to[n + 1] = v;
        for (int i = 0; i < n; i++)
            to[n + 2 + i] = lanes_mul_add(lanes_all(p->b[i]), from[i], lanes_mul(lanes_all(p->phi[i]), from[n + 2 + i]));
        if (k < TG_TWICE(n)) {
            for (int i = 0; i < TG_TWICE(n); i++) a->W[i][k] = to[i];
            a->weight[k] = m->d[k];
        } else
            for (int i = 0; i < TG_TWICE(n); i++) x[i] = i > n ? lanes_add(to[i], lanes_all(plan->shift[i])) : to[i];
    }
}

/* Innovations of the mixture and their variances, and the weights: before any channel is taken. */
TG_INLINE void bank_innovations(const tg_filter *f, const tgi_plan *plan, const array *a, const tg_lanes *noise, update *out, const int n)
{
    const tg_real *const h = plan->accelerometer;
    for (int o = 0; o < n + 2; o++) {
        tg_lanes expected, S = lanes_all(plan->r[o]);
        if (!plan->present[o]) continue;
        if (o <= n) {
            const tg_lanes *const row = a->W[n + 1 + o];
            expected = out->state.x[n + 1 + o];
            S = lanes_add(S, noise[n + 1 + o]);
            for (int k = 0; k < TG_TWICE(n); k++) S = lanes_mul_add(lanes_mul(a->weight[k], row[k]), row[k], S);
        } else {
            expected = lanes_all(plan->accelerometer_shift);
            for (int i = 0; i <= n; i++) {
                expected = lanes_mul_add(lanes_all(h[i]), out->state.x[i], expected);
                S = lanes_mul_add(lanes_all(h[i] * h[i]), noise[i], S);
            }
            for (int k = 0; k < TG_TWICE(n); k++) {
                tg_lanes along = zeros();
                for (int i = 0; i <= n; i++) along = lanes_mul_add(lanes_all(h[i]), a->W[i][k], along);
                S = lanes_mul_add(lanes_mul(a->weight[k], along), along, S);
            }
        }
        const tg_real centre = mean(out->probability, expected);
        out->offset[o] = lanes_sub(expected, lanes_all(centre));
        out->innovation[o] = plan->y[o] - centre;
        out->innovation_variance[o] = mean(out->probability, lanes_mul_add(out->offset[o], out->offset[o], S));
        out->weight[o] = tgi_weight(f->tuning.huber, out->innovation[o], out->innovation_variance[o]);
    }
}

/* Take one channel in every mode (Bierman's update, see factor_measure). `along`: U'h, zero before column `first`. */
TG_INLINE void bank_take(const tgi_plan *plan, update *out, int o, const tg_lanes *along, int first, tg_lanes residual, const int n)
{
    modes *const m = &out->state;
    tg_lanes *const K = out->gain[out->taken];
    tg_lanes variance = lanes_all(plan->r[o] / out->weight[o]), inverse = lanes_div(lanes_all(1), variance);
    for (int i = 0; i < TG_TWICE(n); i++) K[i] = zeros();
    for (int k = first; k < TG_TWICE(n); k++) {
        const tg_lanes v = lanes_mul(m->d[k], along[k]), before = variance;
        const tg_lanes back = lanes_mul(lanes_sub(zeros(), along[k]), inverse);
        variance = lanes_mul_add(along[k], v, variance);
        inverse = lanes_div(lanes_all(1), variance);
        m->d[k] = lanes_mul(m->d[k], lanes_mul(before, inverse));
        for (int i = 0; i < k; i++) {
            const tg_lanes old = m->u[k][i];
            m->u[k][i] = lanes_mul_add(back, K[i], old);
            K[i] = lanes_mul_add(v, old, K[i]);
        }
        K[k] = v;
    }
    for (int i = 0; i < TG_TWICE(n); i++) {
        K[i] = lanes_mul(K[i], inverse);
        m->x[i] = lanes_mul_add(K[i], residual, m->x[i]);
    }
    out->nis = lanes_mul_add(lanes_mul(residual, residual), inverse, out->nis);
    out->volume = lanes_mul(out->volume, variance);
    out->channel[out->taken] = o;
    out->residual[out->taken] = residual;
    out->variance[out->taken++] = variance;
}

TG_INLINE void bank_update(const tgi_plan *plan, update *out, const int n)
{
    const tg_real *const h = plan->accelerometer;
    modes *const m = &out->state;
    for (int o = n; o >= 0; o--) {
        const int j = n + 1 + o;
        tg_lanes along[TG_MAX_STATES];
        if (!plan->present[o]) continue;
        for (int k = j; k < TG_TWICE(n); k++) along[k] = m->u[k][j];
        bank_take(plan, out, o, along, j, lanes_sub(lanes_all(plan->y[o]), m->x[j]), n);
    }
    if (!plan->present[n + 1]) return;
    tg_lanes along[TG_MAX_STATES], residual = lanes_all(plan->y[n + 1] - plan->accelerometer_shift);
    for (int k = 0; k < TG_TWICE(n); k++) {
        along[k] = zeros();
        for (int i = 0; i <= n && i <= k; i++) along[k] = lanes_mul_add(lanes_all(h[i]), m->u[k][i], along[k]);
    }
    for (int i = 0; i <= n; i++) residual = lanes_mul_sub(lanes_all(h[i]), m->x[i], residual);
    bank_take(plan, out, n + 1, along, 0, residual, n);
}

/* What residual c takes from residual b < c: the channel's row of H times b's gain. */
TG_INLINE tg_lanes coupling(const tgi_plan *plan, const update *out, int c, int b, const int n)
{
    tg_lanes sum = zeros();
    if (out->channel[c] <= n) return out->gain[b][n + 1 + out->channel[c]];
    for (int i = 0; i <= n; i++) sum = lanes_mul_add(lanes_all(plan->accelerometer[i]), out->gain[b][i], sum);
    return sum;
}

/* nu' S^-1 nu of the mixture: S is the modes' mean covariance of the innovations and the spread of their means. */
TG_INLINE tg_real mixture_nis(const tgi_plan *plan, const update *out, const int n)
{
    const int count = out->taken;
    tg_lanes T[TG_MAX_CHANNELS][TG_MAX_CHANNELS];
    tg_real S[TG_MAX_CHANNELS][TG_MAX_CHANNELS], nu[TG_MAX_CHANNELS], nis = 0;
    for (int c = 0; c < count; c++) {
        nu[c] = out->innovation[out->channel[c]];
        T[c][c] = lanes_all(1);
        for (int b = 0; b < c; b++) T[c][b] = coupling(plan, out, c, b, n);
        for (int b = 0; b <= c; b++) {
            tg_lanes sum = lanes_mul(out->offset[out->channel[c]], out->offset[out->channel[b]]);
            for (int k = 0; k <= b; k++) sum = lanes_mul_add(lanes_mul(T[c][k], out->variance[k]), T[b][k], sum);
            S[c][b] = mean(out->probability, sum);
        }
    }
    for (int c = 0; c < count; c++) { /* S = L D L', solved as it is factored */
        const tg_real inverse = 1 / S[c][c];
        nis += nu[c] * nu[c] * inverse;
        for (int k = c + 1; k < count; k++) {
            const tg_real part = S[k][c] * inverse;
            nu[k] -= part * nu[c];
            for (int b = c + 1; b <= k; b++) S[k][b] -= part * S[b][c];
        }
    }
    return nis;
}

/* Probabilities by the modes' likelihoods; returns the mixture's log-likelihood. */
static tg_real weigh(const update *out, tg_real *probability)
{
    tg_real logs[TG_MODES], largest = -TG_LARGEST, sum = 0, kept = 0;
    for (int b = 0; b < TG_MODES; b++) {
        const tg_real volume = lanes_at(out->volume, b);
        tg_real log_volume = 0;
        if (volume > TG_TINY && volume < 1 / TG_TINY)
            log_volume = tgi_log(volume);
        else
            for (int c = 0; c < out->taken; c++) log_volume += tgi_log(lanes_at(out->variance[c], b));
        logs[b] = -(lanes_at(out->nis, b) + log_volume + (tg_real)out->taken * TG_LN_2PI) / 2;
        if (logs[b] > largest) largest = logs[b];
    }
    for (int b = 0; b < TG_MODES; b++) {
        probability[b] = lanes_at(out->probability, b) * tgi_exp(logs[b] - largest);
        sum += probability[b];
    }
    for (int b = 0; b < TG_MODES; b++) {
        probability[b] /= sum;
        if (probability[b] < PROBABILITY_MIN) probability[b] = PROBABILITY_MIN;
        kept += probability[b];
    }
    for (int b = 0; b < TG_MODES; b++) probability[b] /= kept;
    return largest + tgi_log(sum);
}

static int is_finite(const update *out, int rows)
{
    tg_lanes zero = lanes_mul(out->nis, zeros());
    for (int k = 0; k < rows; k++) {
        zero = lanes_mul_add(out->state.x[k], zeros(), zero);
        zero = lanes_mul_add(out->state.d[k], zeros(), zero);
        for (int i = 0; i < k; i++) zero = lanes_mul_add(out->state.u[k][i], zeros(), zero);
    }
    return lanes_sum(zero) == 0;
}

static void report(const tg_filter *f, const tgi_plan *plan, const update *out, tg_real nis, tg_real log_likelihood, tg_step *step)
{
    memset(step, 0, sizeof *step);
    step->channels = out->taken;
    step->nis = nis;
    step->log_likelihood = log_likelihood;
    for (int o = 0; o < f->channels; o++) {
        const int c = tgi_channel(f->wheels, o), present = plan->count && plan->present[o];
        step->innovation[c] = present ? out->innovation[o] : (tg_real)NAN;
        step->innovation_variance[c] = present ? out->innovation_variance[o] : 0;
        step->weight[c] = present ? out->weight[o] : 1;
    }
    for (int e = 0; e < f->states; e++) step->adaptation[e] = 1;
    for (int b = 0; b < TG_MODES; b++) step->mode[b] = f->policy.bank.probability[b];
}

TG_INLINE tg_status bank_step(tg_filter *f, tgi_plan *plan, tg_step *step, const int n)
{
    tg_bank_state *const bank = &f->policy.bank;
    const tg_lanes scales = lanes_load(f->tuning.scales);
    const int mixes = plan->count && bank->updates + 1 >= f->tuning.mix_stride;
    modes before;
    array a;
    update out;
    tg_lanes noise[TG_MAX_STATES];
    tg_real nis = 0, log_likelihood = 0, probability[TG_MODES];
    load(f, &before);
    out.probability = lanes_load(bank->probability);
    out.taken = 0;
    out.nis = zeros();
    out.volume = lanes_all(1);
    if (mixes) mix(f, f->clock - bank->mixed, &before, &out.probability, &a);
    for (int j = 0; j < TG_TWICE(n); j++)
        noise[j] = lanes_mul_add(scales, lanes_all(f->walk[j] * plan->passage.dt), lanes_all(plan->passage.q[j]));
    bank_predict(plan, &before, &a, out.state.x, n);
    for (int j = 0; j < TG_TWICE(n); j++) out.x_prior[j] = mean(out.probability, out.state.x[j]);
    if (plan->count) bank_innovations(f, plan, &a, noise, &out, n);
    bank_factor(&a, TG_TWICE(n), TG_TWICE(n), 0, noise, out.state.u, out.state.d);
    lanes_store(probability, out.probability);
    if (plan->count) {
        bank_update(plan, &out, n);
        nis = mixture_nis(plan, &out, n);
        log_likelihood = weigh(&out, probability);
    }
    if (!is_finite(&out, f->states) || !tgi_finite(nis) || !tgi_finite(log_likelihood)) return TG_DIVERGED;
    for (int j = 0; j < TG_TWICE(n); j++) plan->passage.q[j] = mean(out.probability, noise[j]);
    store(f, &out.state);
    for (int b = 0; b < TG_MODES; b++) bank->probability[b] = probability[b];
    for (int c = 0; c < out.taken; c++) {
        f->channel[c] = out.channel[c];
        for (int i = 0; i < TG_TWICE(n); i++) lanes_store(bank->gain[c][i], out.gain[c][i]);
    }
    memcpy(f->x_prior, out.x_prior, sizeof(tg_real) * (size_t)f->states);
    for (int i = 0; out.taken && i <= n; i++) f->accelerometer[i] = plan->accelerometer[i];
    if (mixes) {
        bank->mixed = f->clock;
        bank->updates = 0;
    }
    if (plan->count && !mixes) bank->updates++;
    if (step) report(f, plan, &out, nis, log_likelihood, step);
    return TG_OK;
}

tg_status tgi_bank_step(tg_filter *f, tgi_plan *plan, tg_step *step)
{
    tg_status status = TG_OK;
#define STEP(n, stride) status = bank_step(f, plan, step, n)
    TG_BY_WHEELS(f->wheels, STEP)
#undef STEP
    return status;
}

void tgi_bank_moments(const tg_filter *f, tg_real *x, tg_real *P)
{
    const tg_bank_state *const bank = &f->policy.bank;
    const tg_lanes probability = lanes_load(bank->probability);
    tg_lanes away[TG_MAX_STATES];
    for (int i = 0; i < f->states; i++) {
        const tg_lanes own = lanes_load(bank->x[i]);
        x[i] = mean(probability, own);
        away[i] = lanes_sub(own, lanes_all(x[i]));
    }
    for (int i = 0; P && i < f->states; i++)
        for (int j = 0; j <= i; j++) {
            tg_lanes sum = lanes_mul(away[i], away[j]);
            for (int k = i; k < f->states; k++)
                sum = lanes_mul_add(lanes_mul(lanes_load(bank->d[k]), lanes_load(bank->u[k][i])), lanes_load(bank->u[k][j]), sum);
            P[i * f->stride + j] = mean(probability, sum);
        }
}

/* Every mode's outputs anew; `passage` gets the mixture's noise. */
void tgi_bank_restart(tg_filter *f, const tg_real *outputs, tg_passage *passage)
{
    const int n = f->wheels;
    const tg_lanes scales = lanes_load(f->tuning.scales), probability = lanes_load(f->policy.bank.probability);
    modes m;
    array a;
    tg_lanes noise[TG_MAX_WHEELS + 1];
    load(f, &m);
    for (int k = 0; k < f->states; k++) {
        a.weight[k] = m.d[k];
        for (int i = 0; i <= n; i++) a.W[i][k] = i <= k ? m.u[k][i] : zeros();
    }
    for (int j = 0; j <= n; j++) {
        noise[j] = lanes_mul(scales, lanes_all(passage->q[j]));
        passage->q[j] = mean(probability, noise[j]);
    }
    bank_factor(&a, n + 1, f->states, 0, noise, m.u, m.d);
    for (int o = 0; o <= n; o++) {
        const int j = n + 1 + o;
        m.x[j] = lanes_all(outputs[tgi_channel(n, o)]);
        m.d[j] = lanes_all(passage->q[j]);
        for (int i = 0; i <= j; i++) m.u[j][i] = lanes_all(i == j);
    }
    store(f, &m);
    for (int i = 0; i < f->states; i++) f->x_prior[i] = mean(probability, m.x[i]);
}
