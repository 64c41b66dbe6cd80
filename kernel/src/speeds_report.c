/* The values of a row, for slip from speeds alone (speeds.c). */
#include "estimator.h"

/* The row's values from the state; the radius is considered: it shifts slip, and no sample shows it. */
void tgi_speeds_report(const tg_settings *set, const tgi_speeds *s, tg_real *o)
{
    const tg_real error = set->uncertainty.wheel_radius, nan = (tg_real)NAN;
    const int32_t known = s->begun != 0;
    const tg_real off = tgi_square(set->ground_speed_delay * s->x[1]) + s->slow; /* of the ground speed alone: the rims are measured by themselves */
    o[TG_OUT_GROUND_SPEED] = known ? s->x[0] : nan;
    o[TG_OUT_GROUND_SPEED_STD] = known ? tgi_root(s->P[0][0] + off) : nan;
    for (int32_t i = 0; i < set->machine.wheels; i++) {
        const int32_t k = 2 + i;
        const tg_real r = set->rolling_radius[i], hub = tgi_hub_of(s->x[0] - set->wheel_side[i] * s->yaw, set->wheel_ahead[i] * s->yaw);
        const tg_real omega = (hub + s->x[k]) / r, turn = tgi_turn_variance(set, i, omega, s->x[0], s->unseen_turn);
        const tg_real vv = s->P[0][0], wv = (vv + s->P[0][k]) / r, ww = (vv + 2 * s->P[0][k] + s->P[k][k]) / (r * r);
        const tgi_slip g = tgi_slip_of(omega, hub, r, set->standstill_speed);
        const tg_real variance = g.wheel * (g.wheel * ww + 2 * g.ground * wv) + g.ground * g.ground * (vv + off) + turn + tgi_square(g.radius * error);
        const int32_t slips = known && s->open == 0 && s->standing == 0;
        o[TG_OUT_WHEEL_SPEED + i] = known ? omega : nan;
        o[TG_OUT_WHEEL_SPEED_STD + i] = known ? tgi_root(ww) : nan;
        o[TG_OUT_SLIP + i] = slips ? g.slip : nan;
        o[TG_OUT_SLIP_STD + i] = slips ? tgi_root(variance < 1 ? variance : 1) : nan;
        o[TG_OUT_ZERO_SLIP_RADIUS + i] = r;
        o[TG_OUT_ZERO_SLIP_RADIUS_STD + i] = r * error;
    }
}
