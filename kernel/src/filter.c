/* The filter: set-up, one step, moments. Engines and policies are in files of their own. */
#include "direct.h"
#include "factor.h"
#include "plan.h"

const int TG_PRECISION = (int)sizeof(tg_real);

size_t tg_filter_size(int32_t policy)
{
    switch (policy) {
    case TG_FIXED: return TG_FILTER_ROOM_FIXED;
    case TG_ADAPTIVE: return offsetof(tg_filter, policy.adaptive.supervisor);
    case TG_SUPERVISED: return offsetof(tg_filter, policy.adaptive) + sizeof ((tg_filter *)0)->policy.adaptive;
    case TG_BANK: return offsetof(tg_filter, policy.bank) + sizeof(tg_bank_state);
    default: return 0;
    }
}

/* Settings of physics.md 6; `walk` stays 0 and is the caller's. */
tg_tuning tg_default_tuning(void)
{
    tg_tuning t;
    memset(&t, 0, sizeof t);
    t.engine = TG_EXACT;
    t.policy = TG_FIXED;
    t.alpha = 1;
    t.beta = 2;
    t.rate = (tg_real)0.05;
    t.memory = 3;
    t.stride = 5;
    t.window = (tg_real)0.5;
    t.wheel_speed_min = (tg_real)0.5;
    t.ground_speed_min = (tg_real)0.1;
    t.scales[0] = (tg_real)0.1;
    t.scales[1] = 1;
    t.scales[2] = 10;
    t.scales[3] = 100;
    t.dwell = 5;
    t.mix_stride = 5;
    return t;
}

static int machine_is_sound(const tg_machine *m)
{
    if (m->wheels < 1 || m->wheels > TG_MAX_WHEELS) return 0;
    if (!tgi_positive(m->mass) || !tgi_positive(m->gravity) || !tgi_not_negative(m->tire_rolling_resistance)) return 0;
    for (int i = 0; i < m->wheels; i++)
        if (!tgi_positive(m->radius[i]) || !tgi_positive(m->inertia[i]) || !tgi_not_negative(m->bearing_resistance[i])) return 0;
    return 1;
}

static int tuning_is_sound(const tg_tuning *t, int n)
{
    if (t->engine != TG_EXACT && t->engine != TG_UNSCENTED) return 0;
    if (t->policy < TG_FIXED || t->policy > TG_BANK || (t->policy == TG_BANK && t->engine != TG_EXACT)) return 0;
    for (int e = 0; e < TG_TWICE(n); e++)
        if (!tgi_not_negative(t->walk[e])) return 0;
    if (!tgi_not_negative(t->huber) || !tgi_not_negative(t->rate) || !tgi_positive(t->memory) || t->stride < 1) return 0;
    if (!tgi_positive(t->window) || !tgi_positive(t->wheel_speed_min) || !tgi_positive(t->ground_speed_min)) return 0;
    if ((t->supervisor != 0 && t->supervisor != 1) || !tgi_positive(t->dwell) || t->mix_stride < 1) return 0;
    for (int b = 0; b < TG_MODES; b++)
        if (!tgi_positive(t->scales[b])) return 0;
    /* weights of the sigma points: the spread positive, neither centre weight negative */
    const tg_real spread = t->alpha * t->alpha * ((tg_real)TG_TWICE(n) + t->kappa), centre = spread - (tg_real)TG_TWICE(n);
    return tgi_positive(spread) && tgi_finite(t->beta) && centre >= 0 && centre / spread + 1 - t->alpha * t->alpha + t->beta >= 0;
}

tg_status tg_filter_init(tg_filter *f, const tg_machine *machine, const tg_tuning *tuning, const tg_real *x0, const tg_real *P0)
{
    if (!f || !machine || !tuning || !x0 || !P0) return TG_BAD_ARGUMENT;
    if (!machine_is_sound(machine) || !tuning_is_sound(tuning, machine->wheels)) return TG_BAD_ARGUMENT;
    const int n = machine->wheels, rows = TG_TWICE(n), stride = tgi_stride(n);
    tg_real P[TG_MAX_STATES * TG_MAX_STATES], d[TG_ROWS] = {0}, u[TG_MAX_STATES * TG_ROWS] = {0};
    for (int e = 0; e < rows; e++) {
        if (!tgi_finite(x0[e])) return TG_NOT_FINITE;
        for (int k = 0; k < rows; k++) P[tgi_row(n, e) * rows + tgi_row(n, k)] = P0[e * rows + k];
    }
    const tg_status status = tgi_factorise(rows, stride, P, u, d);
    if (status != TG_OK) return status;
    memset(f, 0, tg_filter_size(tuning->policy));
    f->machine = *machine;
    f->tuning = *tuning;
    f->wheels = n;
    f->states = rows;
    f->channels = n + 2;
    f->stride = stride;
    f->inverse_mass = 1 / machine->mass;
    for (int i = 0; i < n; i++) {
        f->moves[i] = 1;
        f->inverse_inertia[i] = 1 / machine->inertia[i];
        f->arm[i] = machine->radius[i] * f->inverse_inertia[i];
        f->drag[i] = f->arm[i] * machine->bearing_resistance[i];
        if (f->drag[i] > f->stiffness) f->stiffness = f->drag[i];
    }
    f->cosine[0] = f->cosine[1] = 1; /* of slope 0 */
    for (int e = 0; e < rows; e++) {
        f->walk[tgi_row(n, e)] = tuning->walk[e];
        f->x[tgi_row(n, e)] = x0[e];
        f->x_prior[tgi_row(n, e)] = x0[e];
    }
    memcpy(f->d, d, sizeof d);
    memcpy(f->u, u, sizeof u);
    if (tuning->policy == TG_BANK) tgi_bank_init(f);
    if (tuning->policy == TG_ADAPTIVE || tuning->policy == TG_SUPERVISED) tgi_adaptation_init(f);
    if (tuning->policy == TG_SUPERVISED) tgi_supervisor_init(f);
    return TG_OK;
}

/* a_j of this step; 1 where nothing adapts. */
TG_INLINE void noise_scales(const tg_filter *f, tg_real *a, const int stride)
{
    const int adapts = f->tuning.policy != TG_FIXED;
    for (int i = 0; i < stride; i += TG_LANES) lanes_store(a + i, adapts ? lanes_load(f->policy.adaptive.adaptation.scale + i) : lanes_all(1));
}

static tg_real gamma_of(const tg_filter *f, const tgi_call *call, const tgi_plan *plan)
{
    if (f->tuning.policy == TG_FIXED) return 0;
    if (f->tuning.policy == TG_ADAPTIVE) return 1;
    return call->y ? tgi_supervise(f, plan, call->now) : f->policy.adaptive.supervisor.gamma;
}

/* Q of this step (physics.md 6): [I + gamma (A - I)] Q0 on top of the inputs' noise. */
TG_INLINE void scale_noise(const tg_filter *f, const tg_real *a, tgi_plan *plan, const int n)
{
    for (int j = 0; j < TG_TWICE(n); j++) plan->passage.q[j] += (1 + plan->gamma * (a[j] - 1)) * f->walk[j] * plan->passage.dt;
}

/* ln N of the residuals, which are independent of each other. */
static tg_real log_likelihood(const tgi_result *result)
{
    tg_real logs = 0;
    if (result->volume > TG_TINY && result->volume < 1 / TG_TINY)
        logs = tgi_log(result->volume);
    else
        for (int c = 0; c < result->used; c++) logs += tgi_log(result->residual_variance[c]);
    return -(result->square + logs + (tg_real)result->used * TG_LN_2PI) / 2;
}

TG_INLINE int result_is_finite(const tgi_result *result, const int n, const int stride)
{
    const tg_lanes none = lanes_all(0);
    tg_lanes zero[4] = {none, none, none, lanes_all(result->log_likelihood * 0)};
    for (int i = 0; i < stride; i += TG_LANES) {
        zero[0] += lanes_load(result->x + i) * none;
        zero[1] += lanes_load(result->d + i) * none;
        for (int k = i; k < TG_TWICE(n); k++) /* columns that reach this lane */
            zero[k % 4] += lanes_load(result->u + k * stride + i) * none;
    }
    return lanes_sum(zero[0] + zero[1] + (zero[2] + zero[3])) == 0;
}

/* What a step leaves besides the belief. */
TG_INLINE void commit_channels(tg_filter *f, const tgi_plan *plan, const tgi_result *result, const int n)
{
    for (int c = 0; c < result->used; c++) f->channel[c] = result->channel[c];
    for (int i = 0; plan->count && i <= n; i++) f->accelerometer[i] = plan->accelerometer[i];
}

TG_INLINE void commit(tg_filter *f, const tgi_result *result, const int n, const int stride)
{
    for (int i = 0; i < stride; i += TG_LANES) {
        for (int k = i; k < TG_TWICE(n); k++) lanes_store(f->u + k * stride + i, lanes_load(result->u + k * stride + i));
        lanes_store(f->x + i, lanes_load(result->x + i));
        lanes_store(f->d + i, lanes_load(result->d + i));
        lanes_store(f->x_prior + i, lanes_load(result->x_prior + i));
    }
    for (int c = 0; c < result->used; c++)
        for (int i = 0; i < stride; i += TG_LANES) lanes_store(f->gain[c] + i, lanes_load(result->gain[c] + i));
    f->formed = 0;
    f->factor_steps = f->factor_steps > 0 ? f->factor_steps - 1 : TGI_FACTOR_STEPS;
}

/* What bank and single filter remember alike. */
TG_INLINE void remember(tg_filter *f, const tgi_call *call, const tgi_plan *plan, const int n)
{
    plan_copy_passage(&f->passage, &plan->passage, n);
    f->used = plan->count;
    f->clock += (double)call->dt;
    f->slope[0] = call->before->slope;
    f->cosine[0] = plan->cosine[0];
    f->sine[0] = plan->sine[0];
    if (!plan->count || !plan->present[n + 1]) return;
    f->slope[1] = call->now->slope;
    f->cosine[1] = plan->cosine[1];
    f->sine[1] = plan->sine[1];
}

TG_INLINE void report(const tgi_plan *plan, const tgi_result *result, const tg_real *scale, tg_step *out, const int n)
{
    memset(out, 0, sizeof *out);
    out->channels = result->used;
    out->nis = result->square;
    out->log_likelihood = result->log_likelihood;
    out->gamma = plan->gamma;
    for (int o = 0; o < n + 2; o++) {
        const int c = tgi_channel(n, o), present = plan->count && plan->present[o];
        out->innovation[c] = present ? result->innovation[o] : (tg_real)NAN;
        out->innovation_variance[c] = present ? result->variance[o] : 0;
        out->weight[c] = present ? result->weight[o] : 1;
    }
    for (int i = 0; i < n; i++) out->adaptation[i] = scale[n + 2 + i];
    out->adaptation[n] = scale[n + 1];
    for (int i = 0; i <= n; i++) out->adaptation[n + 1 + i] = scale[i];
}

static tg_status step_with_factors(const tg_filter *f, const tgi_plan *plan, tgi_result *result)
{
    tg_real u[TG_MAX_STATES * TG_ROWS], d[TG_ROWS];
    tgi_factors from = {f->u, f->d};
    for (int i = f->states; i < f->stride; i++) result->d[i] = 0; /* the engines write the states only, the check reads whole lanes */
    if (f->tuning.engine == TG_UNSCENTED) {
        tgi_unscented_step(f, plan, result);
        return TG_OK;
    }
    if (f->formed) {
        if (tgi_factors_of(f, u, d) != TG_OK) return TG_DIVERGED;
        from.u = u;
        from.d = d;
    }
    tgi_exact_step(f, &from, plan, result);
    return TG_OK;
}

TG_INLINE tg_status advance_one(tg_filter *f, const tgi_call *call, tgi_plan *plan, tg_step *out, const int n, const int stride)
{
    const int32_t policy = f->tuning.policy;
    tg_real scale[TG_ROWS];
    tgi_result result;
    plan->gamma = gamma_of(f, call, plan);
    noise_scales(f, scale, stride);
    scale_noise(f, scale, plan, n);
    int formed = 0;
#if TGI_DIRECT
    tgi_direct direct;
    direct.result = &result;
    formed = f->tuning.engine == TG_EXACT && n <= TG_LANES && f->factor_steps == 0 && tgi_direct_step(f, plan, &direct);
    if (formed && policy != TG_FIXED) tgi_direct_gains(&direct, result.gain, n);
#endif
    if (!formed) {
        const tg_status status = step_with_factors(f, plan, &result);
        if (status != TG_OK) return status;
    }
    result.log_likelihood = log_likelihood(&result);
    if (!formed && !result_is_finite(&result, n, stride)) return TG_DIVERGED;
    if (policy != TG_FIXED) {
        const tg_status status = tgi_adapt(f, plan, &result);
        if (status != TG_OK) return status;
    }
    if (policy == TG_SUPERVISED && call->y) tgi_supervisor_remember(f, plan, call->now);
    if (out) report(plan, &result, scale, out, n);
#if TGI_DIRECT
    if (formed) tgi_direct_commit(f, &direct);
#endif
    if (!formed) commit(f, &result, n, stride);
    commit_channels(f, plan, &result, n);
    return TG_OK;
}

static tg_status advance(tg_filter *f, const tgi_call *call, tg_step *out)
{
    tgi_plan plan;
    const int n = f->wheels;
    tg_status status = plan_step(f, call, &plan, n);
    if (status != TG_OK) return status;
    status = f->tuning.policy == TG_BANK ? tgi_bank_step(f, &plan, out) : advance_one(f, call, &plan, out, n, f->stride);
    if (status == TG_OK) remember(f, call, &plan, n);
    return status;
}

tg_status tg_filter_step(tg_filter *f, tg_real dt, const tg_input *before, const tg_input *now, const tg_real *q_input,
                         const tg_real *y, const tg_real *r, tg_step *out)
{
    if (!f || !before || !now || !y || !r) return TG_BAD_ARGUMENT;
    const tgi_call call = {dt, before, now, q_input, y, r};
    return advance(f, &call, out);
}

tg_status tg_filter_predict(tg_filter *f, tg_real dt, const tg_input *before, const tg_real *q_input)
{
    if (!f || !before) return TG_BAD_ARGUMENT;
    const tgi_call call = {dt, before, before, q_input, NULL, NULL};
    return advance(f, &call, NULL);
}

/* Row order to state order. */
static void to_state_order(int n, int stride, const tg_real *rows_x, const tg_real *rows_P, tg_real *x, tg_real *P)
{
    const int states = TG_TWICE(n);
    for (int e = 0; e < states; e++) {
        const int i = tgi_row(n, e);
        if (x) x[e] = rows_x[i];
        if (!P) continue;
        for (int k = 0; k <= e; k++) {
            const int j = tgi_row(n, k);
            P[e * states + k] = P[k * states + e] = i > j ? rows_P[i * stride + j] : rows_P[j * stride + i];
        }
    }
}

tg_status tg_filter_moments(const tg_filter *f, tg_real *x, tg_real *P)
{
    if (!f) return TG_BAD_ARGUMENT;
    tg_real rows_x[TG_ROWS], rows_P[TG_MAX_STATES * TG_ROWS];
    if (f->tuning.policy == TG_BANK) {
        tgi_bank_moments(f, rows_x, P ? rows_P : NULL);
        to_state_order(f->wheels, f->stride, rows_x, rows_P, x, P);
        return TG_OK;
    }
    if (P) tgi_covariance_of(f, rows_P);
    to_state_order(f->wheels, f->stride, f->x, rows_P, x, P);
    return TG_OK;
}

tg_status tg_filter_factors(const tg_filter *f, int32_t mode, tg_real *U, tg_real *D)
{
    if (!f || !U || !D) return TG_BAD_ARGUMENT;
    const int bank = f->tuning.policy == TG_BANK;
    if (mode < 0 || mode >= (bank ? TG_MODES : 1)) return TG_BAD_ARGUMENT;
    tg_real u[TG_MAX_STATES * TG_ROWS], d[TG_ROWS];
    if (bank) tgi_bank_factors_of(f, mode, u, d);
    else if (tgi_factors_of(f, u, d) != TG_OK) return TG_DIVERGED;
    for (int k = 0; k < f->states; k++) {
        D[k] = d[k];
        for (int e = 0; e < f->states; e++) {
            const int i = tgi_row(f->wheels, e);
            U[e * f->states + k] = i > k ? 0 : u[k * f->stride + i];
        }
    }
    return TG_OK;
}

tg_status tg_filter_sensitivity(const tg_filter *f, int32_t j, tg_real *dx, tg_real *dP)
{
    if (!f || j < 0 || j >= f->states || (f->tuning.policy != TG_ADAPTIVE && f->tuning.policy != TG_SUPERVISED)) return TG_BAD_ARGUMENT;
    const tg_adaptation_state *const s = &f->policy.adaptive.adaptation;
    const int n = f->wheels, parameter = tgi_row(n, j);
    for (int e = 0; e < f->states; e++) {
        const int i = tgi_row(n, e);
        if (dx) dx[e] = s->dx[i * f->stride + parameter];
        for (int k = 0; dP && k < f->states; k++) {
            const int l = tgi_row(n, k), pair = i > l ? i * (i + 1) / 2 + l : l * (l + 1) / 2 + i;
            dP[e * f->states + k] = s->dP[pair * f->stride + parameter];
        }
    }
    return TG_OK;
}
