/* The adhesion curve of each wheel and of the vehicle, from a row's estimates. */
#include "estimator.h"

/* s. Neighbouring estimates are alike over far longer, so that those in between would teach nothing new. A little under one row of 20 Hz,
 * or five of 100: else the rounding of stamps would decide which rows count. */
#define TG_CURVE_STEP ((tg_real)0.0495)

void tgi_reset_curves(tg_estimator *e)
{
    const tg_curve unknown = tg_curve_unknown();
    e->curve = unknown;
    e->curve_std = tg_curve_std(&unknown);
    for (int32_t i = 0; i < TG_MAX_WHEELS; i++) {
        e->wheel_curve[i] = unknown;
        e->wheel_curve_std[i] = e->curve_std;
    }
}

tg_status tg_estimator_new_ground(tg_estimator *e)
{
    if (!e) return TG_BAD_ARGUMENT;
    tgi_reset_curves(e);
    return TG_OK;
}

/* A wheel's pair. What an estimate's spread holds beyond the filter's variance is constant: it does not average out, but
 * for what the sides take from each other. */
static tg_pair pair_of(const tg_estimator *e, int32_t i, const tg_real *o)
{
    const int32_t stride = tgi_stride(e->settings.machine.wheels);
    const tg_real radius = e->settings.uncertainty.wheel_radius, travel = 1 - tgi_fabs(o[TG_OUT_SLIP + i]);
    const tg_real random = e->belief.P[i * stride + i] + tgi_rough_adhesion(&e->scene, o[TG_OUT_ADHESION + i]);
    const tg_real constant = tgi_square(o[TG_OUT_ADHESION_STD + i]) - random - e->scene.sides[i] - tgi_square(o[TG_OUT_ADHESION + i] * radius);
    const tg_real slip = tgi_square(o[TG_OUT_SLIP_STD + i]) - tgi_square(travel * radius);
    const tg_pair pair = {o[TG_OUT_ADHESION + i], o[TG_OUT_SLIP + i], random, slip > 0 ? slip : 0,
                          tgi_root(constant), radius};
    return pair;
}

static void learn_curves(tg_estimator *e, int32_t learn, const tg_real *load, const tg_real *o)
{
    const int32_t n = e->settings.machine.wheels;
    tgi_observation observed[TG_MAX_WHEELS];
    for (int32_t i = 0; i < n; i++) {
        if (learn) {
            const tg_pair pair = pair_of(e, i, o);
            observed[i] = tgi_observe(&pair);
        }
        tgi_curve_learn(&e->wheel_curve[i], e->curve_wait, e->curve_distance, learn ? 1 : 0, &observed[i], &load[i]);
        e->wheel_curve_std[i] = tg_curve_std(&e->wheel_curve[i]);
    }
    tgi_curve_learn(&e->curve, e->curve_wait, e->curve_distance, learn ? n : 0, observed, load);
    e->curve_std = tg_curve_std(&e->curve);
    e->curve_wait = e->curve_distance = 0;
}

/* `learn`: the row's pairs are estimates of a moving vehicle, not flagged. Without it the curve only ages by `distance`. */
void tgi_curves(tg_estimator *e, int32_t learn, tg_real dt, tg_real distance, const tg_real *load, tg_real *o)
{
    const int32_t n = e->settings.machine.wheels;
    e->curve_wait += dt;
    e->curve_distance += distance;
    if (e->curve_wait >= TG_CURVE_STEP) learn_curves(e, learn, load, o);
    o[TG_OUT_CURVE] = e->curve.a;
    o[TG_OUT_CURVE_STD] = e->curve_std;
    for (int32_t i = 0; i < n; i++) {
        o[TG_OUT_WHEEL_CURVE + i] = e->wheel_curve[i].a;
        o[TG_OUT_WHEEL_CURVE_STD + i] = e->wheel_curve_std[i];
    }
}
