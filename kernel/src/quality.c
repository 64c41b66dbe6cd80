/* What a raw sample is worth: calibration, impossible and held values; standstill and the direction of travel. */
#include "estimator.h"

#define TG_GROUND_AGE 1 /* s: an older ground speed says nothing of standstill */

/* A held channel repeats its last value until the next measurement. A repetition counts as a measurement only after 1.5 periods, and
 * then only of an input (constant torque is common) or of 0 (standstill): a speed that stays the same to the last bit is a silent
 * sensor. */
static int is_repetition(const tg_estimator *e, int32_t slot, tg_real raw, double time)
{
    tg_real period = e->settings.held_period[slot];
    if (!(period > 0) || raw != e->last_raw[slot]) return 0;
    int may_repeat = raw == 0 || (slot > TG_GROUND_SPEED && slot < TG_ACCELERATION_X) || slot >= TG_MASS;
    return !may_repeat || time - e->last_raw_time[slot] < 1.5 * (double)period;
}

static void drop_repetitions(tg_estimator *e, const tg_sample *sample, tg_row *row)
{
    for (int32_t k = 0; k < TG_SLOTS; k++) {
        if (isnan(row->value[k])) continue;
        if (is_repetition(e, k, sample->value[k], row->time)) {
            row->value[k] = (tg_real)NAN;
            continue;
        }
        e->last_raw[k] = sample->value[k];
        e->last_raw_time[k] = row->time;
    }
}

/* A receiver that is not where the ground speed counts measures what the turn adds to it, too: that is taken off, and what the noise of
 * both makes of it is a variance. */
static void move_to_middle(const tg_estimator *e, tg_row *row)
{
    const tg_settings *s = &e->settings;
    const tg_real there = row->value[TG_GROUND_SPEED], seen = row->value[TG_YAW_RATE];
    const tg_real yaw = !isnan(seen) ? seen : row->time - e->yaw_time > 1 ? 0 : e->yaw_rate, across = s->receiver_ahead * yaw;
    row->turn_variance = 0;
    if (yaw == 0 || isnan(there) || (across == 0 && s->receiver_side == 0)) return;
    row->value[TG_GROUND_SPEED] = tgi_middle_of(s, there, yaw);
    const tg_real along = tgi_max(tgi_fabs(row->value[TG_GROUND_SPEED] - s->receiver_side * yaw), s->standstill_speed);
    const tg_real by_yaw = tgi_fabs(s->receiver_side) + s->receiver_ahead * s->receiver_ahead * tgi_fabs(yaw) / along;
    row->turn_variance = tgi_square(by_yaw * s->noise[TG_YAW_RATE]) + tgi_square(s->noise[TG_GROUND_SPEED] * across / along);
}

/* Calibrated row with NaN for whatever is no measurement. The estimator is changed only when all numbers are finite or NaN. */
tg_status tgi_clean(tg_estimator *e, const tg_sample *sample, tg_row *row)
{
    const tg_settings *s = &e->settings;
    const tgi_constants *c = &e->constants;
    int32_t outlier = 0, measured = 0;
    for (int32_t k = 0; k < TG_SLOTS; k++) {
        const tg_real raw = sample->value[k], value = (raw - s->offset[k]) * c->inverse_gain[k];
        const int32_t known = raw == raw && c->limit[k] > 0, sound = tgi_fabs(value) <= c->limit[k];
        outlier |= known & !sound;
        row->value[k] = sound ? value : (tg_real)NAN;
    }
    for (int32_t k = 0; outlier && k < TG_SLOTS; k++)
        if (c->limit[k] > 0 && isinf(sample->value[k])) return TG_NOT_FINITE;
    row->time = sample->time;
    if (c->holds) drop_repetitions(e, sample, row);
    move_to_middle(e, row);
    for (int32_t k = TG_WHEEL_SPEED; k <= TG_GROUND_SPEED; k++) measured |= row->value[k] == row->value[k];
    row->outlier = outlier;
    row->measured = measured;
    row->reckoned = 0;
    row->held_wheels = 0;
    for (int32_t k = 0; k < TG_MAX_CHANNELS; k++) row->channel_nis[k] = (tg_real)NAN;
    memset(row->doubt, 0, sizeof row->doubt); /* until tgi_doubt_speeds, which not every method calls */
    return TG_OK;
}

/* A jump of a speed is a spike until the next sample confirms it: until then the jump itself is its uncertainty. A change that a vehicle
 * is capable of is no spike; after a gap, of most wheels together. A jump of the accelerometer, which the slope and the loads would keep,
 * is left out until then. */
void tgi_doubt_speeds(tg_estimator *e, tg_row *row, tg_real dt)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    tg_real rate[9] = {0};
    for (int32_t i = 0; i <= n; i++) {
        rate[i] = s->tuned.agility * s->machine.gravity / (i < n ? s->rolling_radius[i] : 1);
        tgi_hold_update(e, i < n ? &e->wheel[i] : &e->ground, row, i < n ? TG_WHEEL_SPEED + i : TG_GROUND_SPEED, 0, rate[i]);
    }
    tgi_judge_leaps(e->wheel, rate, n, n, row->time, dt);
    for (int32_t i = 0; i <= n; i++) {
        const tg_hold *const h = i < n ? &e->wheel[i] : &e->ground;
        row->doubt[i] = h->time == row->time ? h->spike : 0;
        row->outlier |= row->doubt[i] > 0;
    }
    tg_hold *const a = &e->forward;
    tgi_hold_update(e, a, row, TG_ACCELERATION_X, 0, 0);
    if (a->spike > 0 && a->time == row->time) {
        row->value[TG_ACCELERATION_X] = (tg_real)NAN;
        row->outlier = 1;
    }
}

/* A low-pass goes on by this share of what a sample is beyond it; the first sample is used as it is. */
static tg_real go_on(tg_lowpass *f, tg_real x, double time, tg_real gain)
{
    f->value = f->seen ? f->value + gain * (x - f->value) : x;
    f->time = time;
    f->seen = 1;
    return f->value;
}

/* First-order low-pass by the backward Euler rule over the time since the last sample. */
tg_real tgi_lowpass(tg_lowpass *f, tg_real x, double time, tg_real tau)
{
    const tg_real dt = (tg_real)(time - f->time);
    return isnan(x) ? f->value : go_on(f, x, time, dt / (tau + dt));
}

/* Whether the speed of wheel `place`, or that of the ground where `place` is the number of wheels, was measured lately enough to say how the
 * vehicle moves. */
int32_t tgi_is_recent(const tg_estimator *e, int32_t place, double time)
{
    const int32_t wheel = place < e->settings.machine.wheels;
    const tg_lowpass *const f = wheel ? &e->wheel_speed[place] : &e->ground_speed;
    return f->seen && time - f->time <= (wheel ? (double)e->settings.gap : TG_GROUND_AGE);
}

/* The yaw rate if no wheel slipped more than its axle's others: that of the axle where the rims of left and right differ least, since a turn
 * shows on every one, and a wheel that spins on its own. */
static tg_real turn_of_rims(const tg_estimator *e, double time)
{
    const tg_settings *s = &e->settings;
    tg_real least = 0;
    int32_t axles = 0;
    for (int32_t k = 0; k < s->axles; k++) {
        tg_real count = 0, side = 0, rim = 0, squares = 0, products = 0;
        for (int32_t i = 0; i < s->machine.wheels; i++) {
            if (s->wheel_axle[i] != k || !tgi_is_recent(e, i, time)) continue;
            const tg_real speed = s->rolling_radius[i] * e->wheel_speed[i].value;
            count++;
            side += s->wheel_side[i];
            rim += speed;
            squares += tgi_square(s->wheel_side[i]);
            products += s->wheel_side[i] * speed;
        }
        if (count < 2 || !(squares > side * side / count)) continue;
        const tg_real rate = -(products - side * rim / count) / (squares - side * side / count);
        if (axles && rate * least <= 0) return 0;
        if (!axles || tgi_fabs(rate) < tgi_fabs(least)) least = rate;
        axles++;
    }
    return least;
}

/* The yaw rate as last measured; after a second without it the vehicle is assumed to drive straight, or to turn as its rims may do. */
void tgi_track_turn(tg_estimator *e, const tg_row *row)
{
    if (!isnan(row->value[TG_YAW_RATE])) {
        e->yaw_rate = row->value[TG_YAW_RATE];
        e->yaw_time = row->time;
    } else if (row->time - e->yaw_time > 1) {
        e->yaw_rate = 0;
    }
    e->unseen_turn = row->time - e->yaw_time > 1 ? turn_of_rims(e, row->time) : 0;
}

/* Whether the ground speed contradicts standstill: while no wheel turns, for half a second, since a single jump is the sensor's. */
static int32_t moves(tg_estimator *e, tg_real ground, double time)
{
    if (tgi_fabs(ground) < 2 * e->settings.standstill_speed) e->slow_time = time;
    return !e->standing || time - e->slow_time > (double)e->settings.tuned.leap;
}

typedef struct { /* of a low-pass: worked out once for all speeds of a row whose last samples came together */
    tg_real tau, dt, gain;
} settling;

/* First-order low-pass, exact also where samples are further apart than tau. */
static tg_real settle(tg_lowpass *f, tg_real x, double time, settling *pass)
{
    if (isnan(x)) return f->value;
    const tg_real dt = (tg_real)(time - f->time);
    if (dt != pass->dt) {
        pass->dt = dt;
        pass->gain = -tgi_expm1(-dt / pass->tau);
    }
    return go_on(f, x, time, pass->gain);
}

/* A speed, low-passed only until its noise is a quarter of the threshold of standstill, and not longer than tau. */
static tg_real soon(tg_lowpass *f, tg_real x, double time, tg_real tau, tg_real noise, tg_real threshold)
{
    if (isnan(x)) return f->value;
    const tg_real ratio = tgi_square(threshold / (4 * noise)), dt = (tg_real)(time - f->time), slow = dt / (tau + dt);
    const tg_real gain = ratio < 1 ? 2 * ratio / (1 + ratio) : 1;
    return go_on(f, x, time, tgi_max(gain, slow));
}

/* Low-passed speeds decide standstill, speeds low-passed as little as their noise allows the direction of travel, both with hysteresis
 * against noise. Returns 1 where the direction has changed. */
int32_t tgi_track_motion(tg_estimator *e, const tg_row *row)
{
    const tg_settings *s = &e->settings;
    const tg_real tau = s->tuned.settle;
    settling pass = {tau, 0, 0};
    int32_t n = s->machine.wheels, seen = 0;
    const tg_real seen_ground = row->doubt[n] > 0 ? (tg_real)NAN : row->value[TG_GROUND_SPEED];
    tg_real fastest = 0, soonest = 0, forward = 0, backward = 0, over = 0, rim = 0, ground = settle(&e->ground_speed, seen_ground, row->time, &pass);
    tg_real course = soon(&e->soon_ground, seen_ground, row->time, tau, s->noise[TG_GROUND_SPEED], s->standstill_speed);
    for (int32_t i = 0; i < n; i++) {
        const tg_real measured = row->doubt[i] > 0 ? (tg_real)NAN : row->value[TG_WHEEL_SPEED + i];
        const tg_real w = s->rolling_radius[i] * settle(&e->wheel_speed[i], measured, row->time, &pass);
        const tg_real r = s->rolling_radius[i], noise = s->noise[TG_WHEEL_SPEED + i];
        const tg_real now = r * soon(&e->soon[i], measured, row->time, tau, noise, s->standstill_speed / r);
        if (!tgi_is_recent(e, i, row->time)) continue;
        if (tgi_fabs(now) > soonest) soonest = tgi_fabs(now);
        if (now > forward) forward = now;
        if (-now > backward) backward = -now;
        seen++;
        rim += now;
        if (tgi_fabs(w) > fastest) fastest = tgi_fabs(w);
    }
    if (seen > 0) rim /= (tg_real)seen;
    if (tgi_is_recent(e, n, row->time)) {
        seen++;
        if (moves(e, ground, row->time)) over = tgi_fabs(ground);
    } else {
        course = rim;
    }
    if (seen == 0) return 0;
    const tg_real threshold = s->standstill_speed, leave = e->standing ? (tg_real)1.25 : 1; /* a ground speed at rest wanders by its noise */
    e->standing = fastest < leave * threshold && soonest < leave * threshold && over < (e->standing ? 2 : 1) * threshold + 2 * s->noise[TG_GROUND_SPEED];

    const tg_real trust = 1 / (1 + tgi_square(s->noise[TG_GROUND_SPEED] / s->standstill_speed)); /* a noisy ground speed counts less than the wheels */
    const int32_t torn =
        forward > threshold && backward > threshold && tgi_fabs(course) > threshold + 2 * s->noise[TG_GROUND_SPEED];
    /* Wheels that turn against others brake, or swing in the air. */
    tg_real motion = torn ? course : (rim + trust * course) / (1 + trust);
    if (e->standing || tgi_fabs(motion) < s->standstill_speed) return 0;
    int32_t direction = motion > 0 ? 1 : -1, turned = direction != e->direction;
    e->direction = direction;
    return turned;
}
