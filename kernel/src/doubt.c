/* What a single wheel's adhesion may be off by in a row, which leaves the vehicle's forces alone (R): variances beside the filter's. */
#include "estimator.h"

#define TG_PEAK ((tg_real)2.4674)   /* (pi/2)^2: of a sine at half the sampling rate, its square over the one of its means over the steps */
#define TG_LOCKING ((tg_real)0.05)  /* SD of an open differential's locking value S: its wheels have (1 +- S)/2 of the torque */
#define TG_USUAL ((tg_real)0.4)     /* what adhesion reaches on the prototype curve of the median soil (physics.md 5) */

static int32_t counted(int32_t before, tg_real one, tg_real other)
{
    if (isnan(one) || isnan(other) || (one == 0 && other == 0)) return before;
    return one != other ? 0 : before < TG_SAME ? before + 1 : TG_SAME;
}

/* Whether two wheels of an axle have one torque, what the axle's is divided into, and one speed, that of a shaft. 0 shows nothing. */
void tgi_watch_shares(tg_estimator *e, const tg_sample *sample)
{
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        const int32_t twin = e->constants.twin[i], torque = TG_DRIVE_TORQUE, speed = TG_WHEEL_SPEED;
        if (twin == i) continue;
        e->shared[i] = counted(e->shared[i], sample->value[torque + i], sample->value[torque + twin]);
        e->locked[i] = counted(e->locked[i], sample->value[speed + i], sample->value[speed + twin]);
    }
}

/* Square of half of what adhesions of two wheels of one shaft differ by in a turn: their hubs do not go alike, so their slips differ. */
static tg_real by_lock(const tg_estimator *e, int32_t i)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels;
    if (e->locked[i] != TG_SAME || e->shared[i] != TG_SAME) return 0;
    const tg_real rim = tgi_max(tgi_fabs(s->rolling_radius[i] * e->belief.x[n + 2 + i]), s->standstill_speed);
    const tg_real apart = tgi_fabs((s->wheel_side[i] - s->wheel_side[e->constants.twin[i]]) * e->yaw_rate) / (2 * rim);
    const tg_real slip = tgi_fabs(1 - e->belief.x[n + 1] / rim), less = slip - apart;
    const tg_real more = -tgi_expm1(-TG_STEEPNESS * (slip + apart)), least = less < 0 ? tgi_expm1(TG_STEEPNESS * less) : -tgi_expm1(-TG_STEEPNESS * less);
    return tgi_square(TG_USUAL * (more - least) / 2);
}

/* Variance of the lateral specific force, where neither an accelerometer nor a roll shows it: hills have no direction, so the ground is as
 * steep across the way as it is along it: as measured, else as the file states it. */
static tg_real unseen_lateral(const tg_estimator *e, double time)
{
    const tg_settings *s = &e->settings;
    const int32_t known = e->pitch.count > 0 || e->slope.running;
    if (e->lateral.seen || tgi_roll_known(e, time)) return 0;
    return tgi_square(s->machine.gravity) * (known ? e->roughness.grade : tgi_square(s->uncertainty.slope));
}

/* What the wheels' chatter is in adhesion: the force that turns a wheel's speed so far in a sample's time, over its load. The square of
 * a torque's leap that its next sample has not confirmed, times how likely it is real: the more, the more of the time over which increments
 * are known lies between two samples, and the less it exceeds what two adhesions differ by. And shares of the wheel's torque, which the
 * other side has more: by a load that side slopes shift, and by the friction of a differential. At rest brakes may hold any part of the
 * torque. */
void tgi_doubt_adhesions(tg_estimator *e, const tg_row *row, const tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_real lateral = unseen_lateral(e, row->time);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        const tg_hold *const torque = &e->torque[i];
        const tg_real square = row->chatter[i], arm = s->machine.radius[i] * drive->load[i];
        const tg_real gross = e->belief.x[i] + s->machine.tire_rolling_resistance;
        e->scene.doubt[i] = square > 0 ? TG_PEAK * square * tgi_square(s->machine.inertia[i] / (arm * e->wheel[i].interval)) : 0;
        e->scene.sides[i] = tgi_square(gross) * (e->constants.lean[i] * lateral + (e->shared[i] == TG_SAME ? tgi_square(TG_LOCKING) : 0)) + by_lock(e, i);
        if (e->standing) e->scene.doubt[i] += tgi_square(e->belief.x[i] / 2) + tgi_square(s->machine.tire_rolling_resistance);
        if (!(torque->spike > 0)) continue;
        const tg_real leap = torque->spike / tgi_square(arm), real = tgi_exp(-leap / (4 * tgi_square(s->prior_adhesion_std)));
        e->scene.doubt[i] += leap * real * torque->interval / (s->tuned.increment_memory + torque->interval);
    }
}
