/* What a single wheel's adhesion may be off by in a row, which leaves the vehicle's forces alone (R): variances beside the filter's. */
#include "estimator.h"

#define TG_PEAK ((tg_real)2.4674)   /* (pi/2)^2: of a sine at half the sampling rate, its square over the one of its means over the steps */
#define TG_LOCKING ((tg_real)0.05)  /* SD of an open differential's locking value S: its wheels have (1 +- S)/2 of the torque */
#define TG_SAME 8                   /* samples alike in a row: two wheels' own torques are not */

/* Whether two wheels of an axle have one torque, what the axle's is divided into. A torque of 0 shows nothing. */
void tgi_watch_shares(tg_estimator *e, const tg_sample *sample)
{
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        const int32_t twin = e->constants.twin[i];
        const tg_real one = sample->value[TG_DRIVE_TORQUE + i], other = sample->value[TG_DRIVE_TORQUE + twin];
        if (twin == i || isnan(one) || isnan(other) || (one == 0 && other == 0)) continue;
        e->shared[i] = one != other ? 0 : e->shared[i] < TG_SAME ? e->shared[i] + 1 : TG_SAME;
    }
}

/* Variance of the lateral specific force, where neither an accelerometer nor a roll shows it: hills have no direction, so the ground is as
 * steep across the way as it is along it: as measured, else as the file states it. */
static tg_real unseen_lateral(const tg_estimator *e, const tg_row *row)
{
    const tg_settings *s = &e->settings;
    const int32_t known = e->pitch.count > 0 || e->slope.running;
    if (e->lateral.seen || !isnan(row->value[TG_ROLL])) return 0;
    return tgi_square(s->machine.gravity) * (known ? e->roughness.grade : tgi_square(s->uncertainty.slope));
}

/* What the wheels' chatter is in adhesion: the force that turns a wheel's speed so far in a sample's time, over its load. The square of
 * a torque's leap that its next sample has not confirmed, times how likely it is real: the more, the more of the time over which increments
 * are known lies between two samples, and the less it exceeds what two adhesions differ by. And shares of the wheel's torque, which the
 * other side has more: by a load that side slopes shift, and by the friction of a differential. */
void tgi_doubt_adhesions(tg_estimator *e, const tg_row *row, const tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_real lateral = unseen_lateral(e, row);
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        const tg_hold *const torque = &e->torque[i];
        const tg_real square = row->chatter[i], arm = s->machine.radius[i] * drive->load[i];
        const tg_real gross = e->belief.x[i] + s->machine.tire_rolling_resistance;
        e->scene.doubt[i] = square > 0 ? TG_PEAK * square * tgi_square(s->machine.inertia[i] / (arm * e->wheel[i].interval)) : 0;
        e->scene.sides[i] = tgi_square(gross) * (e->constants.lean[i] * lateral + (e->shared[i] == TG_SAME ? tgi_square(TG_LOCKING) : 0));
        if (!(torque->spike > 0)) continue;
        const tg_real leap = torque->spike / tgi_square(arm), real = tgi_exp(-leap / (4 * tgi_square(s->prior_adhesion_std)));
        e->scene.doubt[i] += leap * real * torque->interval / (s->tuned.increment_memory + torque->interval);
    }
}
