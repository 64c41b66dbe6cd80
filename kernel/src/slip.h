/* Slip of a wheel from its speed and its hub's. */
#ifndef TG_SLIP_H
#define TG_SLIP_H
#include "model.h"

typedef struct { /* slip, and its change with omega, v and the relative radius */
    tg_real slip, wheel, ground, radius;
} tgi_slip;

/* Speed of a hub that moves at `along` in the vehicle's direction and at `across` sideways; a steered wheel points along its path. */
TG_INLINE tg_real tgi_hub_of(tg_real along, tg_real across)
{
    if (across == 0) return along;
    const tg_real way = tgi_sqrt(along * along + across * across);
    return along < 0 ? -way : way;
}

/* Speed of the vehicle in its own direction, from the speed `there` of its receiver, whose place goes round with it at `yaw`. */
TG_INLINE tg_real tgi_middle_of(const tg_settings *s, tg_real there, tg_real yaw)
{
    const tg_real across = s->receiver_ahead * yaw, square = there * there - across * across;
    const tg_real along = across == 0 ? tgi_fabs(there) : square > 0 ? tgi_sqrt(square) : 0;
    return (there < 0 ? -along : along) + s->receiver_side * yaw;
}

/* Slip (paper eq. 6): (rim - travel)/larger. Where wheel and vehicle both creep, the divisor is floored. */
TG_INLINE tgi_slip tgi_slip_of(tg_real omega, tg_real v, tg_real radius, tg_real least)
{
    const tg_real rim = radius * tgi_fabs(omega), travel = tgi_fabs(v), larger = rim > travel ? rim : travel;
    const tg_real inverse = 1 / (larger > least ? larger : least), s = (rim - travel) * inverse;
    const tg_real moving = larger > least ? s : 0; /* the divisor moves too, unless floored */
    const tg_real by_rim = inverse * (1 - (rim >= travel ? moving : 0)), by_travel = -inverse * (1 + (rim >= travel ? 0 : moving));
    const tgi_slip result = {s, omega < 0 ? -radius * by_rim : radius * by_rim, v < 0 ? -by_travel : by_travel, rim * by_rim};
    return result;
}

/* Variance of the slip of wheel i by a turn of which the rims show `rate`: where wheels steer it is all of that, where they skid about half.
 * `v`: of the vehicle. */
TG_INLINE tg_real tgi_turn_variance(const tg_settings *s, int32_t i, tg_real omega, tg_real v, tg_real rate)
{
    if (rate == 0) return 0;
    const tg_real hub = tgi_hub_of(tgi_middle_of(s, v, rate) - s->wheel_side[i] * rate, s->wheel_ahead[i] * rate), radius = s->rolling_radius[i];
    const tg_real change = tgi_slip_of(omega, hub, radius, s->standstill_speed).slip - tgi_slip_of(omega, v, radius, s->standstill_speed).slip;
    return change * change / 2;
}

#endif
