/* Slip of wheels from their speeds and their hubs'. */
#ifndef TG_SLIP_H
#define TG_SLIP_H
#include "filter.h"

typedef struct { /* of four wheels: slip, and its change with omega, v and the relative radius */
    tg_lanes slip, wheel, ground, radius;
} tgi_slip;

/* Speed of hubs that move at `along` in the vehicle's direction and at `across` sideways; a steered wheel points along its path. */
TG_INLINE tg_lanes tgi_hub_of(tg_lanes along, tg_lanes across)
{
    const tg_lanes none = lanes_all(0), way = lanes_sqrt(along * along + across * across);
    return lanes_where((tg_choice)(across == none), along, lanes_where((tg_choice)(along < none), -way, way));
}

/* Speed of the vehicle in its own direction, from the speed `there` of its receiver, whose place goes round with it at `yaw`. */
TG_INLINE tg_real tgi_middle_of(const tg_settings *s, tg_real there, tg_real yaw)
{
    const tg_real across = s->receiver_ahead * yaw, square = there * there - across * across;
    const tg_real along = across == 0 ? tgi_fabs(there) : square > 0 ? tgi_sqrt(square) : 0;
    return (there < 0 ? -along : along) + s->receiver_side * yaw;
}

/* Slip (paper eq. 6): (rim - travel)/larger. Where wheel and vehicle both creep, the divisor is floored. */
TG_INLINE tgi_slip tgi_slip_of(tg_lanes omega, tg_lanes v, tg_lanes radius, tg_real least)
{
    const tg_lanes none = lanes_all(0), rim = radius * lanes_fabs(omega), travel = lanes_fabs(v), larger = lanes_max(rim, travel);
    const tg_lanes inverse = 1 / lanes_max(larger, lanes_all(least)), s = (rim - travel) * inverse;
    const tg_lanes moving = lanes_where((tg_choice)(larger > least), s, none); /* the divisor moves too, unless floored */
    const tg_choice drives = (tg_choice)(rim >= travel);
    const tg_lanes by_rim = inverse * (1 - lanes_where(drives, moving, none)), by_travel = -inverse * (1 + lanes_where(drives, none, moving));
    const tgi_slip result = {s, lanes_where((tg_choice)(omega < none), -radius * by_rim, radius * by_rim),
                             lanes_where((tg_choice)(v < none), -by_travel, by_travel), rim * by_rim};
    return result;
}

/* Variance of the slip of wheels i to i + 3 by a turn of which the rims show `rate`: where wheels steer it is all of that, where they skid
 * about half; while a joint bends it is the error itself. `v`: of the vehicle. */
TG_INLINE tg_lanes tgi_turn_variance(const tg_settings *s, int32_t i, tg_lanes omega, tg_real v, tg_real rate)
{
    if (rate == 0) return lanes_all(0);
    const tg_lanes hub = tgi_hub_of(tgi_middle_of(s, v, rate) - lanes_load(s->wheel_side + i) * rate, lanes_load(s->wheel_ahead + i) * rate);
    const tg_lanes radius = lanes_load(s->rolling_radius + i);
    const tg_lanes change = tgi_slip_of(omega, hub, radius, s->standstill_speed).slip - tgi_slip_of(omega, lanes_all(v), radius, s->standstill_speed).slip;
    return s->articulated ? change * change : change * change / 2;
}
#endif
