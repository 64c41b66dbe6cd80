/* The part of the ground speed's noise that does not average out (R): receivers filter, so that their errors stay alike for seconds to minutes.
 * While driving it cannot be separated from slip, but at rest the speed is 0, and the mean of what the sensor reads there, beyond its white noise, is
 * one sample of that error a stop. Before the first stops a share of the noise is assumed to be slow. */
#include "estimator.h"

/* At rest: `row` may hold one more reading. */
void tgi_rest_reading(tg_estimator *e, const tg_row *row)
{
    const int32_t n = e->settings.machine.wheels;
    tgi_slow_speed *const s = &e->slow_speed;
    if (isnan(row->value[TG_GROUND_SPEED]) || row->doubt[n] > 0) return;
    s->count += 1;
    s->mean += (row->value[TG_GROUND_SPEED] - s->mean) / s->count;
}

/* The stop is over: its mean counts the more the less of it is white noise. */
void tgi_rest_over(tg_estimator *e)
{
    tgi_slow_speed *const s = &e->slow_speed;
    const tg_tuned *const k = &e->settings.tuned;
    const tg_real noise = e->constants.variance[TG_GROUND_SPEED], slow = tgi_square(k->slow_share) * noise;
    if (s->count > 0) {
        const tg_real white = noise / s->count, weight = slow / (slow + white), square = tgi_square(s->mean) - white;
        s->squares += weight * (square > 0 ? square : 0);
        s->stops += weight;
    }
    s->count = s->mean = 0;
}

/* Variance of the slow error. */
tg_real tgi_slow_variance(const tg_estimator *e)
{
    const tg_tuned *const k = &e->settings.tuned;
    const tg_real slow = tgi_square(k->slow_share) * e->constants.variance[TG_GROUND_SPEED];
    return (k->slow_stops * slow + e->slow_speed.squares) / (k->slow_stops + e->slow_speed.stops);
}
