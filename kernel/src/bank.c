/* A bank of four exact filters over the scale of Q, mixed as interacting multiple models (Blom and Bar-Shalom 1988). One lane a mode:
 * every operation is done for all four at once. By factors, algebra as in factor.h, but row by row, since lanes are used by the modes. */
#include "bank.h"

#define PROBABILITY_MIN ((tg_real)1e-12)
#define COLUMNS_MAX (TG_MODES * (TG_MAX_STATES + 1)) /* of mixing: all modes' factors and means */

typedef struct { /* W by rows, and the weight of its columns */
    tg_lanes W[TG_MAX_STATES][COLUMNS_MAX], weight[COLUMNS_MAX];
} array;

/* Factor W diag(weight) W' + diag(noise) of `rows` rows by Gram-Schmidt. After each row `joining` more columns of W count, which are zero
 * in the rows below; or, where `noise` is given, the row's own column of the identity. */
TG_INLINE void bank_factor(array *a, int rows, int columns, int joining, const tg_lanes *noise, tg_lanes (*u)[TG_ROWS], tg_lanes *d)
{
    tg_lanes v[COLUMNS_MAX];
    for (int j = rows - 1; j >= 0; j--) {
        const tg_lanes *const own = a->W[j];
        tg_lanes even = noise ? noise[j] : lanes_all(0), odd = lanes_all(TG_TINY);
        for (int k = 0; k < columns; k++) v[k] = a->weight[k] * own[k];
        for (int k = 0; k + 2 <= columns; k += 2) {
            even += v[k] * own[k];
            odd += v[k + 1] * own[k + 1];
        }
        if (columns % 2) even += v[columns - 1] * own[columns - 1];
        d[j] = even + odd;
        const tg_lanes inverse = lanes_all(1) / d[j];
        u[j][j] = lanes_all(1);
        for (int i = 0; i < j; i++) {
            tg_lanes *const row = a->W[i];
            tg_lanes sum[4] = {lanes_all(0), lanes_all(0), lanes_all(0), lanes_all(0)};
            int k = 0;
            for (; k + 4 <= columns; k += 4)
                for (int c = 0; c < 4; c++) sum[c] += v[k + c] * row[k + c];
            for (; k < columns; k++) sum[0] += v[k] * row[k];
            const tg_lanes part = (sum[0] + sum[1] + (sum[2] + sum[3])) * inverse;
            u[j][i] = part;
            for (k = 0; k < columns; k++) row[k] -= part * own[k];
            if (noise) row[columns] = lanes_all(0) - part;
        }
        if (noise) a->weight[columns++] = noise[j];
        columns += joining;
    }
}

/* As the filter holds them. */
static void load(const tg_filter *f, tgi_modes *m)
{
    const tg_bank_state *const b = &f->policy.bank;
    for (int k = 0; k < f->states; k++) {
        m->x[k] = lanes_load(b->x[k]);
        m->d[k] = lanes_load(b->d[k]);
        for (int i = 0; i <= k; i++) m->u[k][i] = lanes_load(b->u[k][i]);
    }
}

static void store(tg_filter *f, const tgi_modes *m)
{
    tg_bank_state *const b = &f->policy.bank;
    for (int k = 0; k < f->states; k++) {
        lanes_store(b->x[k], m->x[k]);
        lanes_store(b->d[k], m->d[k]);
        for (int i = 0; i <= k; i++) lanes_store(b->u[k][i], m->u[k][i]);
    }
}

void tgi_bank_factors_of(const tg_filter *f, int mode, tg_real *u, tg_real *d)
{
    const tg_bank_state *const b = &f->policy.bank;
    for (int k = 0; k < f->states; k++) {
        d[k] = b->d[k][mode];
        for (int i = 0; i < f->stride; i++) u[k * f->stride + i] = i <= k ? b->u[k][i][mode] : 0;
    }
}

void tgi_bank_init(tg_filter *f)
{
    tg_bank_state *const b = &f->policy.bank;
    for (int k = 0; k < f->states; k++) {
        lanes_store(b->x[k], lanes_all(f->x[k]));
        lanes_store(b->d[k], lanes_all(f->d[k]));
        for (int i = 0; i <= k; i++) lanes_store(b->u[k][i], lanes_all(f->u[k * f->stride + i]));
    }
    lanes_store(b->probability, lanes_all((tg_real)1 / TG_MODES));
}

/* Each mode starts from the mixture of all, given itself. The mixture's own mean and covariance stay. */
static void mix(const tg_filter *f, tgi_modes *m, tg_lanes *probability, array *a)
{
    static const int all = TG_MODES;
    const int rows = f->states;
    tg_lanes share[TG_MODES];
    bank_shares(f, f->clock - f->policy.bank.mixed, probability, share);
    for (int r = 0; r < rows; r++) {
        m->x[r] = bank_mix_mean(share, m->x[r], a->W[r]);
        for (int k = rows - 1; k >= r; k--) /* the last columns of U first: row r has none before its own */
            for (int i = 0; i < all; i++) a->W[r][all * (rows - k) + i] = lanes_all(lanes_at(m->u[k][r], i));
    }
    for (int i = 0; i < all; i++) {
        a->weight[i] = share[i];
        for (int k = 0; k < rows; k++) a->weight[all * (rows - k) + i] = share[i] * lanes_at(m->d[k], i);
    }
    bank_factor(a, rows, 2 * all, all, NULL, m->u, m->d);
}

/* The means in place, the factors as an array. */
TG_INLINE void bank_predict(const tgi_plan *plan, tgi_modes *m, array *a, const int n)
{
    for (int k = 0; k < TG_TWICE(n); k++) {
        tg_lanes from[TG_MAX_STATES], to[TG_MAX_STATES];
        for (int i = 0; i < TG_TWICE(n); i++) from[i] = i <= k ? m->u[k][i] : lanes_all(0);
        bank_map(&plan->passage, from, to, n);
        for (int i = 0; i < TG_TWICE(n); i++) a->W[i][k] = to[i];
        a->weight[k] = m->d[k];
    }
    bank_move(plan, m->x, n);
}

/* Prior variances of the channels, of each mode. */
TG_INLINE void bank_variances(const tgi_plan *plan, const array *a, const tg_lanes *noise, tg_lanes *S, const int n)
{
    const tg_real *const h = plan->accelerometer;
    for (int o = 0; o < n + 2; o++) {
        if (!plan->present[o]) continue;
        S[o] = lanes_all(plan->r[o]);
        if (o <= n) S[o] += noise[n + 1 + o];
        for (int i = 0; o > n && i <= n; i++) S[o] += h[i] * h[i] * noise[i];
        for (int k = 0; k < TG_TWICE(n); k++) {
            tg_lanes along = o <= n ? a->W[n + 1 + o][k] : lanes_all(0);
            for (int i = 0; o > n && i <= n; i++) along += h[i] * a->W[i][k];
            S[o] += a->weight[k] * along * along;
        }
    }
}

/* Update every mode with one channel (Bierman's update, see factor_measure). `along`: U'h, zero before column `first`. */
TG_INLINE void bank_update_channel(const tgi_plan *plan, tgi_update *out, int o, const tg_lanes *along, int first, tg_lanes residual, const int n)
{
    tgi_modes *const m = &out->state;
    tg_lanes *const K = out->gain[out->used];
    tg_lanes variance = lanes_all(plan->r[o] / out->weight[o]), inverse = lanes_all(1) / variance;
    for (int i = 0; i < TG_TWICE(n); i++) K[i] = lanes_all(0);
    for (int k = first; k < TG_TWICE(n); k++) {
        const tg_lanes v = m->d[k] * along[k], before = variance;
        const tg_lanes back = (lanes_all(0) - along[k]) * inverse;
        variance += along[k] * v;
        inverse = lanes_all(1) / variance;
        m->d[k] *= (before * inverse);
        for (int i = 0; i < k; i++) {
            const tg_lanes old = m->u[k][i];
            m->u[k][i] = old + back * K[i];
            K[i] += v * old;
        }
        K[k] = v;
    }
    for (int i = 0; i < TG_TWICE(n); i++) {
        K[i] *= inverse;
        m->x[i] += K[i] * residual;
    }
    bank_note(out, o, residual, variance, inverse);
}

TG_INLINE void bank_update(const tgi_plan *plan, tgi_update *out, const int n)
{
    const tg_real *const h = plan->accelerometer;
    tgi_modes *const m = &out->state;
    for (int o = n; o >= 0; o--) {
        const int j = n + 1 + o;
        tg_lanes along[TG_MAX_STATES];
        if (!plan->present[o]) continue;
        for (int k = j; k < TG_TWICE(n); k++) along[k] = m->u[k][j];
        bank_update_channel(plan, out, o, along, j, plan->y[o] - m->x[j], n);
    }
    if (!plan->present[n + 1]) return;
    tg_lanes along[TG_MAX_STATES];
    for (int k = 0; k < TG_TWICE(n); k++) {
        along[k] = lanes_all(0);
        for (int i = 0; i <= n && i <= k; i++) along[k] += h[i] * m->u[k][i];
    }
    bank_update_channel(plan, out, n + 1, along, 0, bank_shock(plan, m->x, n), n);
}

/* The part of residual b < c in residual c: the channel's row of H times b's gain. */
TG_INLINE tg_lanes coupling(const tgi_plan *plan, const tgi_update *out, int c, int b, const int n)
{
    tg_lanes sum = lanes_all(0);
    if (out->channel[c] <= n) return out->gain[b][n + 1 + out->channel[c]];
    for (int i = 0; i <= n; i++) sum += plan->accelerometer[i] * out->gain[b][i];
    return sum;
}

/* nu' S^-1 nu of the mixture: S is the modes' mean covariance of the innovations and the spread of their means; S = L D L', solved as it is
 * factored. */
static tg_real mixture_nis(const tgi_plan *plan, const tgi_update *out, const int n)
{
    const int count = out->used;
    tg_lanes T[TG_MAX_CHANNELS][TG_MAX_CHANNELS];
    tg_real S[TG_MAX_CHANNELS][TG_MAX_CHANNELS], nu[TG_MAX_CHANNELS], nis = 0;
    for (int c = 0; c < count; c++) {
        nu[c] = out->innovation[out->channel[c]];
        T[c][c] = lanes_all(1);
        for (int b = 0; b < c; b++) T[c][b] = coupling(plan, out, c, b, n);
        for (int b = 0; b <= c; b++) {
            tg_lanes sum = out->offset[out->channel[c]] * out->offset[out->channel[b]];
            for (int k = 0; k <= b; k++) sum += T[c][k] * out->variance[k] * T[b][k];
            S[c][b] = bank_mean(out->probability, sum);
        }
    }
    for (int c = 0; c < count; c++) {
        const tg_real least = plan->r[out->channel[c]], inverse = 1 / (S[c][c] > least ? S[c][c] : least);
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
static tg_real weigh(const tgi_update *out, tg_real *probability)
{
    tg_real logs[TG_MODES], largest = -TG_LARGEST, sum = 0, kept = 0;
    for (int b = 0; b < TG_MODES; b++) {
        const tg_real volume = lanes_at(out->volume, b);
        tg_real log_volume = 0;
        if (volume > TG_TINY && volume < 1 / TG_TINY)
            log_volume = tgi_log(volume);
        else
            for (int c = 0; c < out->used; c++) log_volume += tgi_log(lanes_at(out->variance[c], b));
        logs[b] = -(lanes_at(out->nis, b) + log_volume + (tg_real)out->used * TG_LN_2PI) / 2;
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

static int is_finite(const tgi_update *out, int rows)
{
    tg_lanes zero = out->nis * lanes_all(0);
    for (int k = 0; k < rows; k++) {
        zero += out->state.x[k] * lanes_all(0);
        zero += out->state.d[k] * lanes_all(0);
        for (int i = 0; i < k; i++) zero += out->state.u[k][i] * lanes_all(0);
    }
    return lanes_sum(zero) == 0;
}

static void report(const tg_filter *f, const tgi_plan *plan, const tgi_update *out, tg_real nis, tg_real log_likelihood, tg_step *step)
{
    memset(step, 0, sizeof *step);
    step->channels = out->used;
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

/* The step up to the last channel. */
TG_INLINE void work_out(const tg_filter *f, const tgi_plan *plan, int mixes, const tg_lanes *noise, tgi_update *out, const int n)
{
    array a;
    tg_lanes S[TG_MAX_CHANNELS];
    load(f, &out->state);
    out->probability = lanes_load(f->policy.bank.probability);
    out->used = 0;
    out->nis = lanes_all(0);
    out->volume = lanes_all(1);
    if (mixes) mix(f, &out->state, &out->probability, &a);
    bank_predict(plan, &out->state, &a, n);
    for (int j = 0; j < TG_TWICE(n); j++) out->x_prior[j] = bank_mean(out->probability, out->state.x[j]);
    if (plan->count) {
        bank_variances(plan, &a, noise, S, n);
        bank_innovations(f, plan, S, out, n);
    }
    bank_factor(&a, TG_TWICE(n), TG_TWICE(n), 0, noise, out->state.u, out->state.d);
    if (plan->count) bank_update(plan, out, n);
}

/* What a sound step leaves. */
TG_INLINE void commit(tg_filter *f, const tgi_plan *plan, const tgi_update *out, const tg_real *probability, int mixes, const int n)
{
    tg_bank_state *const bank = &f->policy.bank;
    store(f, &out->state);
    for (int b = 0; b < TG_MODES; b++) bank->probability[b] = probability[b];
    for (int c = 0; c < out->used; c++) {
        f->channel[c] = out->channel[c];
        for (int i = 0; i < TG_TWICE(n); i++) lanes_store(bank->gain[c][i], out->gain[c][i]);
    }
    for (int i = 0; out->used && i <= n; i++) f->accelerometer[i] = plan->accelerometer[i];
    memcpy(f->x_prior, out->x_prior, sizeof(tg_real) * (size_t)f->states);
    if (mixes) {
        bank->mixed = f->clock;
        bank->updates = 0;
    } else if (plan->count)
        bank->updates++;
}

tg_status tgi_bank_step(tg_filter *f, tgi_plan *plan, tg_step *step)
{
    const int n = f->wheels;
    const tg_lanes scales = lanes_load(f->tuning.scales);
    const int mixes = plan->count && f->policy.bank.updates + 1 >= f->tuning.mix_stride;
    tgi_update out;
    tg_lanes noise[TG_MAX_STATES];
    tg_real nis = 0, log_likelihood = 0, probability[TG_MODES];
    for (int j = 0; j < TG_TWICE(n); j++)
        noise[j] = plan->passage.q[j] + scales * (f->walk[j] * plan->passage.dt);
    work_out(f, plan, mixes, noise, &out, n);
    lanes_store(probability, out.probability);
    if (plan->count) {
        nis = mixture_nis(plan, &out, n);
        log_likelihood = weigh(&out, probability);
    }
    if (!is_finite(&out, f->states)) return TG_DIVERGED;
    if (!tgi_finite(nis) || !tgi_finite(log_likelihood)) return TG_DIVERGED;
    for (int j = 0; j < TG_TWICE(n); j++) plan->passage.q[j] = bank_mean(out.probability, noise[j]);
    commit(f, plan, &out, probability, mixes, n);
    if (step) report(f, plan, &out, nis, log_likelihood, step);
    return TG_OK;
}

void tgi_bank_moments(const tg_filter *f, tg_real *x, tg_real *P)
{
    const tg_bank_state *const bank = &f->policy.bank;
    const tg_lanes probability = lanes_load(bank->probability);
    tg_lanes away[TG_MAX_STATES];
    for (int i = 0; i < f->states; i++) {
        const tg_lanes own = lanes_load(bank->x[i]);
        x[i] = bank_mean(probability, own);
        away[i] = own - x[i];
    }
    for (int i = 0; P && i < f->states; i++)
        for (int j = 0; j <= i; j++) {
            tg_lanes sum = away[i] * away[j];
            for (int k = i; k < f->states; k++)
                sum += lanes_load(bank->d[k]) * lanes_load(bank->u[k][i]) * lanes_load(bank->u[k][j]);
            P[i * f->stride + j] = bank_mean(probability, sum);
        }
}

/* Restart every mode's outputs; `passage` gets the mixture's noise. */
void tgi_bank_restart(tg_filter *f, const tg_real *outputs, tg_passage *passage)
{
    const int n = f->wheels;
    const tg_lanes scales = lanes_load(f->tuning.scales), probability = lanes_load(f->policy.bank.probability);
    tgi_modes m;
    array a;
    tg_lanes noise[TG_MAX_WHEELS + 1];
    load(f, &m);
    for (int k = 0; k < f->states; k++) {
        a.weight[k] = m.d[k];
        for (int i = 0; i <= n; i++) a.W[i][k] = i <= k ? m.u[k][i] : lanes_all(0);
    }
    for (int j = 0; j <= n; j++) {
        noise[j] = scales * passage->q[j];
        passage->q[j] = bank_mean(probability, noise[j]);
    }
    bank_factor(&a, n + 1, f->states, 0, noise, m.u, m.d);
    for (int o = 0; o <= n; o++) {
        const int j = n + 1 + o;
        m.x[j] = lanes_all(outputs[tgi_channel(n, o)]);
        m.d[j] = lanes_all(passage->q[j]);
        for (int i = 0; i <= j; i++) m.u[j][i] = lanes_all(i == j);
    }
    store(f, &m);
    for (int i = 0; i < f->states; i++) f->x_prior[i] = bank_mean(probability, m.x[i]);
}
