/* The ground speed's noise, lately. A receiver without its correction or its view is noisier for a while than the noise that is set, of
 * which slip's interval is made. The third difference (1, -3, 3, -1) of four samples at even steps is noise, of 20 times its variance, where
 * motion is quadratic; so is that of what they differ by from the rims, where slip is. The lesser counts
 * (docs/decisions/0177-noise-that-grows.md). */
#include "estimator.h"

#define TG_QUICK ((tg_real)0.25) /* s between samples: in longer steps neither is quadratic */
#define TG_MEMORY ((tg_real)30)  /* samples over which the mean square is low-passed */
#define TG_CLIPPED ((tg_real)9)  /* times that mean or the variance that is set: a spike is in four differences, and no noise */
#define TG_LOUD ((tg_real)4)     /* times the variance that is set: of the noise that is set the mean is 1 +- .3 */

TG_INLINE tg_real least_of(tg_real a, tg_real b) { return a < b ? a : b; }

static tg_real third_square(tg_real now, const tg_real *before) { return tgi_square(now - 3 * before[0] + 3 * before[1] - before[2]); }

static void push(tg_real *before, tg_real now)
{
    before[2] = before[1];
    before[1] = before[0];
    before[0] = now;
}

/* Variance [m^2/s^2] of the row's ground speed beyond the one that is set, 0 where it is not surely noisier; rim: the wheels' mean [m/s],
 * along the travel. */
tg_real tgi_loudness_of(tg_estimator *e, const tg_row *row, tg_real rim)
{
    tgi_loudness *const l = &e->loudness;
    const tg_real set = e->constants.variance[TG_GROUND_SPEED];
    if (isnan(row->value[TG_GROUND_SPEED])) return 0;
    const tg_real step = (tg_real)(row->time - e->ground_time), speed = (tg_real)e->direction * row->value[TG_GROUND_SPEED], gap = speed - rim;
    const tg_real least = least_of(step, least_of(l->step[0], l->step[1])), most = tgi_max(step, tgi_max(l->step[0], l->step[1]));
    if (e->standing || !(step > 0) || step > TG_QUICK) l->count = 0;
    else if (l->count > 2 && most < 2 * least) {
        const tg_real square = least_of(third_square(speed, l->speed), third_square(gap, l->gap)) / 20;
        l->power += (least_of(square, TG_CLIPPED * tgi_max(l->power, set)) - l->power) / TG_MEMORY;
    }
    l->count = least_of(l->count + 1, 3);
    push(l->speed, speed);
    push(l->gap, gap);
    l->step[1] = l->step[0];
    l->step[0] = step;
    return l->power > TG_LOUD * set ? l->power - set : 0;
}
