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
    const int32_t n = set->machine.wheels, slips = known && s->open == 0 && s->standing == 0;
    for (int32_t i = 0; i < n; i += TG_LANES) {
        const int32_t k = 2 + i;
        const tg_lanes r = lanes_load(set->rolling_radius + i), d = lanes_load(s->x + k), vd = lanes_load(s->P[0] + k);
        const tg_lanes dd = lanes_of(s->P[k][k], s->P[k + 1][k + 1], s->P[k + 2][k + 2], s->P[k + 3][k + 3]);
        const tg_lanes hub = tgi_hub_of(s->x[0] - lanes_load(set->wheel_side + i) * s->yaw, lanes_load(set->wheel_ahead + i) * s->yaw);
        const tg_lanes omega = (hub + d) / r, turn = tgi_turn_variance(set, i, omega, s->x[0], s->unseen_turn);
        const tg_real vv = s->P[0][0];
        const tg_lanes wv = (vv + vd) / r, ww = (vv + 2 * vd + dd) / (r * r);
        const tgi_slip g = tgi_slip_of(omega, hub, r, set->standstill_speed);
        const tg_lanes by_radius = g.radius * error;
        const tg_lanes variance = g.wheel * (g.wheel * ww + 2 * g.ground * wv) + g.ground * g.ground * (vv + off) + turn + by_radius * by_radius;
        for (int32_t j = 0; j < TG_LANES && i + j < n; j++) {
            o[TG_OUT_WHEEL_SPEED + i + j] = known ? omega[j] : nan;
            o[TG_OUT_WHEEL_SPEED_STD + i + j] = known ? tgi_root(ww[j]) : nan;
            o[TG_OUT_SLIP + i + j] = slips ? g.slip[j] : nan;
            o[TG_OUT_SLIP_STD + i + j] = slips ? tgi_root(variance[j] < 1 ? variance[j] : 1) : nan;
            o[TG_OUT_ZERO_SLIP_RADIUS + i + j] = r[j];
            o[TG_OUT_ZERO_SLIP_RADIUS_STD + i + j] = r[j] * error;
        }
    }
}
