/* What a raw sample is worth: calibration, impossible and held values, inputs between their samples, standstill, direction. */
#include "estimator.h"

/* Beyond these a value is a defect of the log, not a measurement. */
static tg_real limit_of(int32_t slot)
{
    if (slot < TG_GROUND_SPEED) return (tg_real)1e4; /* rad/s */
    if (slot < TG_DRIVE_TORQUE) return (tg_real)1e3; /* m/s */
    if (slot < TG_ACCELERATION_X) return (tg_real)1e7; /* N m, N */
    if (slot < TG_PITCH) return (tg_real)1e3; /* m/s^2 */
    if (slot < TG_VERTICAL_LOAD) return (tg_real)1.6; /* rad */
    return (tg_real)1e8; /* N */
}

/* A held channel repeats its last value until it is measured anew. A repetition counts as a measurement only after 1.5 periods, and
 * then only of an input (constant torque is common) or of 0 (standstill): a speed that stays the same to the last bit is a silent
 * sensor. */
static int is_repetition(const tg_estimator *e, int32_t slot, tg_real raw, double time)
{
    tg_real period = e->settings.held_period[slot];
    if (!(period > 0) || raw != e->last_raw[slot]) return 0;
    int may_repeat = raw == 0 || (slot > TG_GROUND_SPEED && slot < TG_ACCELERATION_X);
    return !may_repeat || time - e->last_raw_time[slot] < 1.5 * (double)period;
}

/* Calibrated row with NaN for whatever is no measurement. The estimator is changed only when all numbers are finite or NaN. */
tg_status tgi_clean(tg_estimator *e, const tg_sample *sample, tg_row *row)
{
    const tg_settings *s = &e->settings;
    for (int32_t k = 0; k < e->slots; k++)
        if (isinf(sample->value[e->slot[k]])) return TG_NOT_FINITE;
    row->time = sample->time;
    row->outlier = row->measured = row->reckoned = 0;
    for (int32_t k = 0; k < TG_SLOTS; k++) row->value[k] = (tg_real)NAN;
    for (int32_t k = 0; k < e->slots; k++) {
        int32_t slot = e->slot[k];
        tg_real raw = sample->value[slot];
        if (isnan(raw) || is_repetition(e, slot, raw, row->time)) continue;
        e->last_raw[slot] = raw;
        e->last_raw_time[slot] = row->time;
        tg_real value = (raw - s->offset[slot]) / s->gain[slot];
        if (!(tgi_fabs(value) <= limit_of(slot))) {
            row->outlier = 1;
            continue;
        }
        row->value[slot] = value;
        row->measured |= slot <= TG_GROUND_SPEED;
    }
    return TG_OK;
}

/* First-order low-pass by the backward Euler rule over the time since the last sample; the first sample is taken whole. */
tg_real tgi_lowpass(tg_lowpass *f, tg_real x, double time, tg_real tau)
{
    if (isnan(x)) return f->value;
    tg_real dt = (tg_real)(time - f->time);
    f->value = f->seen ? f->value + dt / (tau + dt) * (x - f->value) : x;
    f->time = time;
    f->seen = 1;
    return f->value;
}

/* The input itself is filtered as a random walk in noise, with a time constant of at most TG_INPUT_LAG: between two wheel speeds a raw
 * torque's noise would shake omega more than the wheel ever does. */
static void track(tg_hold *h, tg_real x, tg_real motion, tg_real noise, tg_real interval)
{
    tg_real prior = h->variance + (motion > 0 ? motion : 0), gain = prior / (prior + noise * noise);
    const tg_real least = interval / (TG_INPUT_LAG + interval);
    if (!(gain > least)) gain = least;
    h->value += gain * (x - h->value);
    h->variance = gain * noise * noise;
}

/* Take a sample of an input (NaN: none). The mean square of its increments is kept over about 1 s; one far beyond it is a spike:
 * taken whole, but its square counts as uncertainty until the next sample, and the mean square sees it clipped. */
void tgi_hold_update(tg_hold *h, tg_real x, double time, tg_real noise)
{
    if (isnan(x)) return;
    h->spike = 0;
    if (h->count == 0) {
        h->value = x;
        h->variance = noise * noise;
    } else {
        tg_real interval = (tg_real)(time - h->time), change = tgi_square(x - h->raw);
        tg_real bound = TG_SPIKE * TG_SPIKE * (h->level + 2 * noise * noise);
        if (h->count > TG_SPIKE && change > bound) {
            h->spike = change;
            h->value = x;
            h->variance = noise * noise;
            change = bound;
        } else {
            track(h, x, h->level - 2 * noise * noise, noise, interval);
        }
        tg_real memory = interval / (1 + interval);
        if (memory * (tg_real)h->count < 1) memory = 1 / (tg_real)h->count; /* a plain mean at first */
        h->level += memory * (change - h->level);
        h->interval = interval;
    }
    h->raw = x;
    h->time = time;
    if (h->count < 100) h->count++;
}

/* Variance of a held input's error: its noise, and what it moves between samples. A straight line from one sample to the next is off
 * by a third of the squared increment in the mean square; held longer, it wanders on (R). */
tg_real tgi_hold_variance(const tg_hold *h, double time, tg_real noise)
{
    tg_real motion = h->level - 2 * noise * noise, variance = h->variance + h->spike;
    if (motion > 0 && h->interval > 0) {
        tg_real late = 3 * (tg_real)(time - h->time) / h->interval;
        variance += motion / 3 * (late > 3 ? late : 1);
    }
    return variance;
}

static int32_t recent(const tg_lowpass *f, double time, tg_real age)
{
    return f->seen && time - f->time <= (double)age;
}

/* Low-passed speeds tell standstill and the direction of travel, both with hysteresis so that noise does not flicker. A ground speed
 * that is a second old no longer counts. Returns 1 where the direction has turned. */
int32_t tgi_track_motion(tg_estimator *e, const tg_row *row)
{
    const tg_settings *s = &e->settings;
    const tg_real tau = (tg_real)0.2, age = 1;
    int32_t n = s->machine.wheels, seen = 0;
    tg_real fastest = 0, rim = 0, ground = tgi_lowpass(&e->ground_speed, row->value[TG_GROUND_SPEED], row->time, tau);
    for (int32_t i = 0; i < n; i++) {
        tg_real w = s->rolling_radius[i] * tgi_lowpass(&e->wheel_speed[i], row->value[TG_WHEEL_SPEED + i], row->time, tau);
        if (!recent(&e->wheel_speed[i], row->time, s->gap)) continue;
        seen++;
        rim += w;
        if (tgi_fabs(w) > fastest) fastest = tgi_fabs(w);
    }
    if (seen > 0) rim /= (tg_real)seen;
    if (recent(&e->ground_speed, row->time, age)) {
        seen++;
        if (tgi_fabs(ground) > fastest) fastest = tgi_fabs(ground);
    } else {
        ground = rim;
    }
    if (seen == 0) return 0;
    e->standing = fastest < (e->standing ? 2 : 1) * s->standstill_speed;

    tg_real motion = (ground + rim) / 2;
    if (e->standing || tgi_fabs(motion) < s->standstill_speed) return 0;
    int32_t direction = motion > 0 ? 1 : -1, turned = direction != e->direction;
    e->direction = direction;
    return turned;
}
