/* The part of the ground speed's noise that does not average out (R): receivers filter, so their errors last for seconds to
 * minutes. While driving it cannot be separated from slip, but at rest the speed is 0, and the mean of what the sensor reads there,
 * beyond its white noise, is one sample of that error a stop. Before the first stops a share of the noise is assumed to be slow. Errors
 * of seconds, hills that the forces do not show and a late receiver appear while driving: neighbouring innovations are then
 * correlated, and with white noise they are not. */
#include "estimator.h"

/* At rest: `row` may hold one more reading. */
void tgi_rest_reading(tg_estimator *e, const tg_row *row)
{
    tgi_slow_speed *const s = &e->slow_speed;
    if (isnan(row->value[TG_GROUND_SPEED]) || row->doubt[TG_GROUND_SPEED] > 0) return;
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

/* Take the innovation of the row's ground speed and its variance, if it was measured (else NaN); beyond `spike` SDs it counts as that. A
 * reckoned speed, or one that may be a spike, is neighbour to none. */
void tgi_watch_innovation(tg_estimator *e, const tg_row *row, tg_real innovation, tg_real variance)
{
    tgi_slow_speed *const s = &e->slow_speed;
    const tg_tuned *const k = &e->settings.tuned;
    const tg_real most = tgi_square(k->spike) * variance;
    if (isnan(innovation)) return;
    if (row->reckoned || row->doubt[TG_GROUND_SPEED] > 0) {
        s->innovation = 0;
        return;
    }
    if (tgi_square(innovation) > most) innovation = innovation > 0 ? tgi_sqrt(most) : -tgi_sqrt(most);
    if (s->innovation != 0) {
        if (s->pairs < k->alike_memory) s->pairs += 1;
        s->alike += (s->innovation * innovation - s->alike) / s->pairs;
    }
    s->innovation = innovation;
    s->expected = variance;
}

/* m/s^2 of the ground speed, by the forces. */
static tg_real rate_of(const tg_estimator *e, const tg_drive *drive)
{
    return (tg_real)e->direction * (e->balance.value - e->settings.machine.gravity * drive->sine);
}

/* What a sensor's delay makes of the ground speed. */
tg_real tgi_late_variance(const tg_estimator *e, const tg_drive *drive)
{
    return tgi_square(e->settings.ground_speed_delay * rate_of(e, drive));
}

/* Mean product of neighbouring innovations, less what chance makes of it. */
static tg_real alike(const tg_estimator *e)
{
    const tgi_slow_speed *const s = &e->slow_speed;
    return s->alike > 0 ? tgi_max(s->alike - e->settings.tuned.alike_sure * s->expected / tgi_sqrt(s->pairs), 0) : 0;
}

/* The part of the innovations' variance by which they are alike: 0 where they are white, near 1 where the model is wrong. */
tg_real tgi_alike_share(const tg_estimator *e)
{
    const tg_real beyond = alike(e);
    return beyond > 0 ? beyond / (beyond + e->slow_speed.expected) : 0;
}

/* What the filter has not followed of a disagreement between its model and the sensor: the mean product of neighbouring innovations. Either
 * may be wrong: the model by the filter's own weight, K of the ground speed, and then all but 1 - K of it is corrected; else the sensor. At
 * 2 Hz, where forces predict the speed badly, K is near 1. */
tg_real tgi_alike_variance(const tg_estimator *e)
{
    const tg_real beyond = alike(e);
    if (!(beyond > 0)) return 0;
    const tg_real share = e->constants.variance[TG_GROUND_SPEED] / e->slow_speed.expected, less = share < 1 ? share : 1; /* 1 - K */
    return less * (1 + less * (1 - less)) * beyond;
}

/* That, and, while the speed changes, the age of a sample. */
tg_real tgi_disputed_variance(const tg_estimator *e, const tg_drive *drive)
{
    const tg_real longest = e->settings.tuned.longest_walk, interval = e->ground.interval < longest ? e->ground.interval : longest;
    const tg_real aged = tgi_square(TG_SAMPLE_AGE * interval * rate_of(e, drive));
    return aged + tgi_alike_variance(e);
}

/* Variance of the slow error. */
tg_real tgi_slow_variance(const tg_estimator *e)
{
    const tg_tuned *const k = &e->settings.tuned;
    const tg_real slow = tgi_square(k->slow_share) * e->constants.variance[TG_GROUND_SPEED];
    return (k->slow_stops * slow + e->slow_speed.squares) / (k->slow_stops + e->slow_speed.stops);
}
