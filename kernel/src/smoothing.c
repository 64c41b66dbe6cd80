/* Smoothing of a whole recording: records of a forward pass, then estimates from a backward one. */
#include "estimator.h"

#define TG_SCENE_LENGTH (sizeof(tgi_scene) / sizeof(tg_real))

static size_t filter_length(const tg_estimator *e)
{
    return tg_record_length(e->settings.machine.wheels, e->consider.columns);
}

size_t tg_smooth_length(const tg_estimator *e)
{
    if (e && e->settings.method == TG_SPEEDS) return tgi_speeds_length();
    return e ? filter_length(e) + TG_SCENE_LENGTH : 0;
}

size_t tg_smooth_carry(const tg_estimator *e)
{
    if (!e) return 0;
    if (e->settings.method == TG_SPEEDS) return tgi_speeds_length();
    size_t states = (size_t)e->filter.states;
    return states + states * states + (size_t)e->consider.columns * states + 1;
}

tg_status tg_estimator_record(tg_estimator *e, size_t rows, const double *time, const double *const *in, tg_real *records)
{
    if (!e || !time || !in || !records || e->settings.method == TG_ALGEBRAIC) return TG_BAD_ARGUMENT;
    tg_track track;
    tg_sample sample;
    tg_estimate estimate;
    tg_status status = tg_track_init(&track, &e->filter);
    e->track = &track;
    for (size_t row = 0; row < rows && status == TG_OK; row++) {
        tg_real *record = records + row * tg_smooth_length(e);
        sample.time = time[row];
        for (int32_t k = 0; k < TG_SLOTS; k++) sample.value[k] = in[k] ? (tg_real)in[k][row] : (tg_real)NAN;
        status = tg_estimator_update(e, &sample, &estimate);
        if (status != TG_OK) break;
        if (e->settings.method == TG_SPEEDS) {
            memcpy(record, &e->speeds, sizeof e->speeds);
            continue;
        }
        status = tg_record_take(record, &track, &e->filter, &e->consider);
        if (status == TG_OK) memcpy(record + filter_length(e), &e->scene, sizeof e->scene);
    }
    e->track = NULL;
    return status;
}

typedef struct { /* the smoothed moments, state order, and what a brake did unsaid (tgi_scene); inside the caller's carry */
    tg_real *x, *P, *s, *unsaid;
} tgi_smoothed;

static tgi_smoothed inside(const tg_estimator *e, tg_real *carry)
{
    size_t states = (size_t)e->filter.states;
    tgi_smoothed m = {carry, carry + states, carry + states + states * states, carry + tg_smooth_carry(e) - 1};
    return m;
}

/* One row back. Where nothing links the rows, or the algebra fails, the row keeps its filtered moments. */
static void step_back(const tg_estimator *e, const tg_real *here, const tg_real *next, tgi_smoothed *m)
{
    const int32_t n = e->settings.machine.wheels, columns = e->consider.columns;
    tgi_scene scene;
    scene.anew = 1;
    if (next) memcpy(&scene, next + filter_length(e), sizeof scene);
    if (scene.anew == 0 && tg_smooth_step(n, columns, here, next, m->x, m->P, m->s) == TG_OK) return;
    tg_record_moments(n, columns, here, m->x, m->P, m->s);
}

static void to_rows(const tg_estimator *e, const tgi_smoothed *m, tg_belief *b, tg_real (*S)[TG_MAX_CONSIDERED])
{
    const int32_t n = e->settings.machine.wheels, states = e->filter.states, stride = e->filter.stride;
    for (int32_t j = 0; j < states; j++) {
        const int32_t row = tgi_row(n, j);
        b->x[row] = m->x[j];
        for (int32_t k = 0; k < states; k++) b->P[row * stride + tgi_row(n, k)] = m->P[j * states + k];
        for (int32_t c = 0; c < e->consider.columns; c++) S[row][c] = m->s[c * states + j];
    }
    b->columns = e->consider.columns;
}

/* Back from a pressed brake's first sample to the one before it adhesions and rho_s are unsure alike: net traction is not. */
static void doubt_unsaid(const tg_estimator *e, const tgi_scene *scene, tg_real *unsaid, tg_belief *b)
{
    const int32_t n = e->settings.machine.wheels, stride = e->filter.stride;
    if (scene->unsaid >= 0) *unsaid = scene->unsaid;
    else if (*unsaid > 0)
        for (int32_t i = 0; i <= n; i++) {
            b->P[i * stride + i] += *unsaid;
            if (i < n) b->P[n * stride + i] += *unsaid;
        }
}

static void put(const tg_real *value, double *const *out, size_t row, int32_t last)
{
    for (int32_t k = 0; k < last; k++)
        if (out[k] && (k < TG_OUT_NIS || k > TG_OUT_DISTANCE)) out[k][row] = (double)value[k];
}

tg_status tg_estimator_smooth(const tg_estimator *e, size_t rows, const tg_real *records, const tg_real *next, tg_real *carry,
                              double *const *out)
{
    if (!e || !records || !carry || !out || e->settings.method == TG_ALGEBRAIC) return TG_BAD_ARGUMENT;
    tg_real value[TG_OUT_SLOTS];
    for (int32_t k = 0; k < TG_OUT_SLOTS; k++) value[k] = (tg_real)NAN; /* those of absent wheels stay so */
    if (e->settings.method == TG_SPEEDS) {
        for (size_t row = rows; row-- > 0;) {
            const tg_real *here = records + row * tg_smooth_length(e);
            tgi_speeds_smooth(&e->settings, here, next, carry, value);
            put(value, out, row, TG_OUT_ADHESION);
            for (int32_t k = TG_OUT_SLIP; k < TG_OUT_NET_TRACTION; k++)
                if (out[k]) out[k][row] = (double)value[k];
            next = here;
        }
        return TG_OK;
    }
    tgi_smoothed m = inside(e, carry);
    tg_belief belief;
    tg_real S[TG_MAX_STATES][TG_MAX_CONSIDERED] = {{0}}, warp[TG_MAX_WHEELS];
    for (size_t row = rows; row-- > 0;) {
        const tg_real *here = records + row * tg_smooth_length(e);
        tgi_scene scene;
        memcpy(&scene, here + filter_length(e), sizeof scene);
        step_back(e, here, next, &m);
        to_rows(e, &m, &belief, S);
        if (!next) *m.unsaid = 0;
        doubt_unsaid(e, &scene, m.unsaid, &belief);
        if (e->constants.warps) tgi_warp(&e->constants, belief.x, warp);
        tgi_traction(&e->settings, e->constants.warps ? warp : scene.warp, &belief, (const tg_real(*)[TG_MAX_CONSIDERED])S, &scene, value);
        put(value, out, row, TG_OUT_VERTICAL_LOAD);
        next = here;
    }
    return TG_OK;
}
