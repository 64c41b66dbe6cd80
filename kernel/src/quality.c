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

typedef struct { /* speeds of rims along, over how far to the side their wheels are */
    tg_real count, side, sum, squares, products;
} rims;

static void add_rim(rims *r, tg_real side, tg_real speed)
{
    r->count++;
    r->side += side;
    r->sum += speed;
    r->squares += tgi_square(side);
    r->products += side * speed;
}

/* The rate of turn that they show. Returns 0 where they are not beside each other. */
static int32_t rate_of_turn(const rims *r, tg_real *rate)
{
    const tg_real alike = r->side * r->side / r->count;
    if (r->count < 2 || !(r->squares > alike)) return 0;
    *rate = (r->side * r->sum / r->count - r->products) / (r->squares - alike);
    return 1;
}

/* In a turn on the spot, in which the rims of the two sides go against each other: the vehicle's speed by them, and its variance. How much they
 * slip in the mean is what they show of the turn beyond its rate; sides may slip as differently as that. Returns whether there is one. */
static int32_t speed_of_rims(const tg_estimator *e, tg_real yaw, double time, tg_real *speed, tg_real *variance)
{
    const tg_settings *s = &e->settings;
    rims all = {0, 0, 0, 0, 0};
    tg_real ahead = 0, back = 0, rate;
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (tgi_rolls(e, i) || !tgi_is_recent(e, i, time)) continue;
        const tg_real rim = s->rolling_radius[i] * e->settling[i].soon;
        add_rim(&all, s->wheel_side[i], rim);
        ahead = tgi_max(ahead, rim);
        back = tgi_max(back, -rim);
    }
    if (!(ahead > s->standstill_speed && back > s->standstill_speed && rate_of_turn(&all, &rate))) return 0;
    const tg_real gone = yaw / rate < 1 ? yaw / rate : 1;
    if (!(gone > 0)) return 0;
    *speed = gone * (all.sum + all.side * rate) / all.count;
    *variance = tgi_square((ahead + back) / 2) * (tgi_square(1 - gone) + tgi_square(s->tuned.least_slip));
    return 1;
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
    /* On the spot the receiver shows but the turn and how the vehicle slides: of these the root would be a speed, always to one side. */
    tg_real by_rims, variance;
    if (tgi_fabs(across) > s->noise[TG_GROUND_SPEED] && speed_of_rims(e, yaw, row->time, &by_rims, &variance)) {
        row->value[TG_GROUND_SPEED] = by_rims;
        row->turn_variance = variance < tgi_square(there) ? variance : tgi_square(there);
        return;
    }
    row->value[TG_GROUND_SPEED] = tgi_middle_of(s, there, yaw);
    const tg_real along = tgi_max(tgi_fabs(row->value[TG_GROUND_SPEED] - s->receiver_side * yaw), s->standstill_speed);
    const tg_real by_yaw = tgi_fabs(s->receiver_side) + s->receiver_ahead * s->receiver_ahead * tgi_fabs(yaw) / along;
    row->turn_variance = tgi_square(by_yaw * s->noise[TG_YAW_RATE]) + tgi_square(s->noise[TG_GROUND_SPEED] * across / along);
}

/* A free wheel without a sensor turns as fast as its hub goes. */
static void roll_along(tg_estimator *e, tg_row *row)
{
    const tg_settings *s = &e->settings;
    const tg_real seen = row->value[TG_YAW_RATE], yaw = !isnan(seen) ? seen : row->time - e->yaw_time > 1 ? 0 : e->yaw_rate;
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!isnan(row->value[TG_WHEEL_SPEED + i])) e->rolls &= ~(1 << i);
        if (!tgi_rolls(e, i)) continue;
        const tg_lanes along = lanes_all(row->value[TG_GROUND_SPEED] - s->wheel_side[i] * yaw), across = lanes_all(s->wheel_ahead[i] * yaw);
        row->value[TG_WHEEL_SPEED + i] = tgi_hub_of(along, across)[0] / s->rolling_radius[i];
    }
}

/* A jump of the yaw rate by more than a vehicle can do, which hubs and slips would follow, is left out until the next sample confirms it,
 * or goes on beyond it: a small machine may turn faster than that. */
static int32_t doubt_turn(tg_estimator *e, tg_row *row)
{
    tg_hold *const h = &e->turn;
    const tg_real jump = h->spike > 0 ? h->raw - h->calm : 0, further = row->value[TG_YAW_RATE] - h->raw;
    tgi_hold_update(e, h, row, TG_YAW_RATE, e->constants.agility[TG_GROUND_SPEED] / tgi_max(e->constants.outermost, e->constants.mean_radius));
    if (!(h->spike > 0 && h->time == row->time) || jump * further > 0) return 0;
    row->value[TG_YAW_RATE] = (tg_real)NAN;
    return 1;
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
    outlier |= doubt_turn(e, row);
    move_to_middle(e, row);
    if (e->rolls) roll_along(e, row);
    for (int32_t k = TG_WHEEL_SPEED; k <= TG_GROUND_SPEED; k++) measured |= row->value[k] == row->value[k];
    row->outlier = outlier;
    row->measured = measured;
    row->reckoned = 0;
    row->loud = 0;
    row->steady_wheels = 0;
    for (int32_t k = 0; k < TG_MAX_CHANNELS; k++) row->channel_nis[k] = (tg_real)NAN;
    memset(row->doubt, 0, sizeof row->doubt); /* until tgi_doubt_speeds, which not every method calls */
    return TG_OK;
}

/* By how much the row's speed at `slot` is farther from the estimate, along the travel. */
static tg_real beyond_estimate(const tg_estimator *e, const tg_row *row, int32_t slot, int32_t state)
{
    return (tg_real)e->direction * row->value[slot] - e->belief.x[state];
}

/* The same of the rims in the mean, as far as the row measures them. */
static tg_real rims_beyond(const tg_estimator *e, const tg_row *row)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real sum = 0, count = 0;
    for (int32_t i = 0; i < n; i++) {
        if (isnan(row->value[TG_WHEEL_SPEED + i]) || e->wheel[i].spike > 0) continue;
        sum += e->settings.rolling_radius[i] * beyond_estimate(e, row, TG_WHEEL_SPEED + i, n + 2 + i);
        count++;
    }
    return count > 0 ? sum / count : 0;
}

/* The change a second of the speed at `slot` that is no spike: what a vehicle is capable of, but of a speed that is farther from the estimate
 * than the errors of both, half of that since the last row and, of the ground's, what the rims have done explain none: then increments alone
 * decide. */
static tg_real possible_rate(const tg_estimator *e, const tg_row *row, int32_t slot)
{
    const int32_t n = e->settings.machine.wheels, ground = slot == TG_GROUND_SPEED, j = ground ? n + 1 : n + 2 + slot - TG_WHEEL_SPEED;
    const tg_real rate = e->constants.agility[slot];
    const tgi_scene *const s = &e->scene;
    const tg_real beyond = beyond_estimate(e, row, slot, j), meanwhile = tgi_square(rate / 2 * (tg_real)(row->time - e->time));
    tg_real off = tgi_square(beyond), variance = e->belief.P[j * (tgi_stride(n) + 1)] + e->constants.variance[slot];
    if (!e->seen_motion || e->standing || !(off > meanwhile)) return rate;
    if (ground) {
        const tg_real with_rims = tgi_square(beyond - rims_beyond(e, row));
        if (with_rims < off) off = with_rims;
        variance = tgi_max(variance, s->reckoned) + s->slow_speed + s->disputed + s->late + row->turn_variance;
    }
    return off > tgi_square(e->settings.tuned.spike) * variance + meanwhile ? (tg_real)TG_TINY : rate;
}

/* A jump of a speed is a spike until the next sample confirms it: until then the jump itself is its uncertainty. A change that a vehicle
 * is capable of is no spike, unless nothing explains it (possible_rate); after a gap, of most wheels together. A jump of the accelerometer,
 * which the slope and the loads would keep, is left out until then. */
void tgi_doubt_speeds(tg_estimator *e, tg_row *row)
{
    const tg_real *const rate = e->constants.agility;
    const int32_t n = e->settings.machine.wheels;
    for (int32_t i = 0; i < n; i++) tgi_hold_update(e, &e->wheel[i], row, TG_WHEEL_SPEED + i, possible_rate(e, row, TG_WHEEL_SPEED + i));
    tgi_judge_leaps(e->wheel, rate, NULL, n, n, row->time);
    tgi_hold_update(e, &e->ground, row, TG_GROUND_SPEED, possible_rate(e, row, TG_GROUND_SPEED));
    for (int32_t i = 0; i <= n; i++) {
        const tg_hold *const h = i < n ? &e->wheel[i] : &e->ground;
        const tg_real doubt = h->time == row->time ? h->spike : 0;
        row->doubt[i < n ? TG_WHEEL_SPEED + i : TG_GROUND_SPEED] = doubt;
        row->outlier |= doubt > 0;
    }
    tg_hold *const a = &e->forward;
    tgi_hold_update(e, a, row, TG_ACCELERATION_X, 0);
    if (a->spike > 0 && a->time == row->time) {
        row->value[TG_ACCELERATION_X] = (tg_real)NAN;
        row->outlier = 1;
    }
}

/* First-order low-pass by the backward Euler rule over the time since the last sample; the first one is used as it is. */
tg_real tgi_lowpass(tg_lowpass *f, tg_real x, double time, tg_real tau)
{
    const tg_real dt = (tg_real)(time - f->time);
    if (isnan(x)) return f->value;
    f->value = f->seen ? f->value + dt / (tau + dt) * (x - f->value) : x;
    f->time = time;
    f->seen = 1;
    return f->value;
}

/* Whether this wheel's speed, or the ground's, was measured lately enough to say how the vehicle moves. */
int32_t tgi_is_recent(const tg_estimator *e, int32_t slot, double time)
{
    const tgi_settling *const p = &e->settling[slot];
    return p->seen && time - p->time <= (slot < TG_GROUND_SPEED ? (double)e->settings.gap : TG_GROUND_AGE);
}

/* The yaw rate if no wheel slipped more than its axle's others: that of the axle where the rims of left and right differ least, since a turn
 * shows on every one, and a wheel that spins on its own. Of an articulated machine, beyond the yaw rate, that of the axle where they differ
 * most: while its joint bends a sensor shows the turn of one half. */
static tg_real turn_of_rims(const tg_estimator *e, double time)
{
    const tg_settings *s = &e->settings;
    tg_real least = 0, most = 0;
    int32_t axles = 0;
    for (int32_t k = 0; k < s->axles; k++) {
        rims axle = {0, 0, 0, 0, 0};
        tg_real rate;
        for (int32_t i = 0; i < s->machine.wheels; i++) {
            if (s->wheel_axle[i] != k || tgi_rolls(e, i) || !tgi_is_recent(e, i, time)) continue;
            add_rim(&axle, s->wheel_side[i], s->rolling_radius[i] * e->settling[i].settled);
        }
        if (!rate_of_turn(&axle, &rate)) continue;
        const tg_real beyond = rate - e->yaw_rate;
        if (tgi_fabs(beyond) > tgi_fabs(most)) most = beyond;
        if (axles && rate * least <= 0) least = 0;
        else if (!axles || tgi_fabs(rate) < tgi_fabs(least)) least = rate;
        axles++;
    }
    return s->articulated ? most : least;
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
    e->unseen_turn = row->time - e->yaw_time > 1 || e->settings.articulated ? turn_of_rims(e, row->time) : 0;
}

/* The speed that its torques may have given a vehicle at rest since its last ground speed, the way of `speed`; 0 where they hardly push. */
static tg_real pushed_to(const tg_estimator *e, const tg_row *row, tg_real speed)
{
    const tg_machine *const m = &e->settings.machine;
    tg_real force = 0;
    for (int32_t i = 0; i < m->wheels; i++)
        if (e->settings.driven[i] && e->torque[i].count > 0) force += e->torque[i].calm / m->radius[i];
    const tg_real acceleration = (speed < 0 ? -force : force) / m->mass;
    const tgi_settling *const before = &e->settling[TG_GROUND_SPEED];
    if (!before->seen || !(acceleration > e->settings.watch.thrust * m->gravity)) return 0;
    return acceleration * (tg_real)(row->time - before->time);
}

/* Whether the vehicle goes against its direction of travel by this ground speed alone: no wheel did so before. */
static int32_t goes_back_alone(const tg_estimator *e, const tg_row *row, tg_real speed)
{
    const tg_settings *const s = &e->settings;
    const tg_real d = (tg_real)e->direction;
    if (!(d * speed < 0)) return 0;
    for (int32_t i = 0; i < s->machine.wheels; i++)
        if (tgi_is_recent(e, i, row->time) && d * s->rolling_radius[i] * e->settling[i].soon < -s->standstill_speed) return 0;
    return 1;
}

/* Whether the row's ground speed is a leap, at standstill or against all wheels: it counts once it has lasted, since a single one is the
 * sensor's, or where the torques explain it: a sensor may show no slow turn. */
static int32_t leaps(tg_estimator *e, const tg_row *row)
{
    const tg_settings *const s = &e->settings;
    const tg_real speed = row->value[TG_GROUND_SPEED], least = 2 * (s->standstill_speed + s->noise[TG_GROUND_SPEED]);
    if (isnan(speed)) return 0;
    if (!(e->standing || goes_back_alone(e, row, speed)) || tgi_fabs(speed) < least + pushed_to(e, row, speed)) {
        e->leap_time = (double)INFINITY;
        return 0;
    }
    if (isinf(e->leap_time)) e->leap_time = row->time;
    return row->time - e->leap_time <= (double)s->tuned.leap;
}

typedef struct { /* of low-passes: worked out once for all speeds of a row whose last samples came together */
    tg_real tau, dt, exact, slow; /* shares of a sample: exact also where samples are further apart than tau; by the backward Euler rule */
} shares;

/* Take the row's speed at `slot`, if it is measured and no spike. */
static const tgi_settling *settle(tg_estimator *e, const tg_row *row, int32_t slot, shares *pass)
{
    tgi_settling *const p = &e->settling[slot];
    const tg_real x = row->value[slot], dt = (tg_real)(row->time - p->time);
    if (isnan(x) || row->doubt[slot] > 0) return p;
    if (dt != pass->dt) {
        pass->dt = dt;
        pass->exact = -tgi_expm1(-dt / pass->tau);
        pass->slow = dt / (pass->tau + dt);
    }
    p->settled = p->seen ? p->settled + pass->exact * (x - p->settled) : x;
    p->soon = p->seen ? p->soon + tgi_max(e->constants.soon[slot], pass->slow) * (x - p->soon) : x;
    p->time = row->time;
    p->seen = 1;
    return p;
}

/* Low-passed speeds decide standstill, speeds low-passed as little as their noise allows the direction of travel, both with hysteresis
 * against noise. Returns 1 where the direction has changed. */
int32_t tgi_track_motion(tg_estimator *e, const tg_row *row)
{
    const tg_settings *s = &e->settings;
    shares pass = {s->tuned.settle, 0, 0, 0};
    int32_t n = s->machine.wheels, seen = 0;
    const tgi_settling *const ground = leaps(e, row) ? &e->settling[TG_GROUND_SPEED] : settle(e, row, TG_GROUND_SPEED, &pass);
    tg_real fastest = 0, soonest = 0, forward = 0, backward = 0, over = 0, rim = 0, course = ground->soon;
    for (int32_t i = 0; i < n; i++) {
        const tgi_settling *const wheel = settle(e, row, TG_WHEEL_SPEED + i, &pass);
        const tg_real w = s->rolling_radius[i] * wheel->settled, now = s->rolling_radius[i] * wheel->soon;
        if (tgi_rolls(e, i) || !tgi_is_recent(e, i, row->time)) continue;
        if (tgi_fabs(now) > soonest) soonest = tgi_fabs(now);
        if (now > forward) forward = now;
        if (-now > backward) backward = -now;
        seen++;
        rim += now;
        if (tgi_fabs(w) > fastest) fastest = tgi_fabs(w);
    }
    if (seen > 0) rim /= (tg_real)seen;
    if (tgi_is_recent(e, TG_GROUND_SPEED, row->time)) {
        seen++;
        over = tgi_fabs(ground->settled);
    } else {
        course = rim;
    }
    if (seen == 0) return 0;
    const tg_real threshold = s->standstill_speed, leave = e->standing ? (tg_real)1.25 : 1; /* a ground speed at rest wanders by its noise */
    e->standing = fastest < leave * threshold && soonest < leave * threshold && over < (e->standing ? 2 : 1) * threshold + 2 * s->noise[TG_GROUND_SPEED];

    const tg_real trust = e->constants.trust;
    const int32_t torn =
        forward > threshold && backward > threshold && tgi_fabs(course) > threshold + 2 * s->noise[TG_GROUND_SPEED];
    /* Wheels that turn against others brake, or swing in the air. */
    tg_real motion = torn ? course : (rim + trust * course) / (1 + trust);
    if (e->standing || tgi_fabs(motion) < s->standstill_speed) return 0;
    int32_t direction = motion > 0 ? 1 : -1, turned = direction != e->direction;
    e->direction = direction;
    return turned;
}
