/* Each wheel's own time (docs/decisions/0026-slow-wheel-speeds.md). A wheel's slip settles within milliseconds, so that its
 * speed changes as slowly as the vehicle's, while a torque's noise, or an old torque, integrated between two samples of the speed would make
 * it run away. So the model moves a wheel from sample to sample of its speed, by the torque of the later one; in rows between, it waits.
 * Where torques come faster than the speed, it moves with each of them, too, and its speed is steady until its next sample is overdue: so the
 * adhesion follows the torque. */
#include "estimator.h"

#define TG_FASTER ((tg_real)1.5) /* times as often as the wheel's speed is its torque measured: not by chance */
#define TG_OVERDUE ((tg_real)1.5) /* intervals without a sample: its wheel's speed does not count as steady any longer, so it waits */

/* Speed of a wheel's hub along the travel, as last believed. */
static tg_real hub(const tg_estimator *e, int32_t i)
{
    return e->belief.x[e->settings.machine.wheels + 1] - (tg_real)e->direction * e->settings.wheel_side[i] * e->yaw_rate;
}

/* What the speed moves by, mean square, in the time since its last sample: by chance, and with its hub; in a first start, what a vehicle
 * is capable of. */
static tg_real moved_since(const tg_estimator *e, int32_t i, tg_real age)
{
    const tg_hold *const h = &e->wheel[i];
    if (h->count < 2) return tgi_square(e->constants.agility[TG_WHEEL_SPEED + i] * age);
    return tgi_motion(h, e->settings.noise[TG_WHEEL_SPEED + i]) * age / h->interval + tgi_square((hub(e, i) - e->own_time[i].hub) / e->settings.rolling_radius[i]);
}

/* Give the row the wheel's speed as it was. All rows until the next sample share one error, and so count as one measurement together. */
static void keep_steady(const tg_estimator *e, int32_t i, tg_real age, tg_row *row)
{
    const tg_real noise = e->settings.noise[TG_WHEEL_SPEED + i];
    row->value[TG_WHEEL_SPEED + i] = (tg_real)e->direction * e->belief.x[e->settings.machine.wheels + 2 + i];
    row->wheel_variance[i] = (noise * noise + moved_since(e, i, age)) * e->wheel[i].interval / e->torque[i].interval;
    row->steady_wheels |= 1 << i;
}

/* After the row's inputs: by how much time each wheel moves in this row. */
void tgi_time_wheels(tg_estimator *e, tg_real dt, int32_t goes, tg_row *row)
{
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        const tg_hold *const h = &e->wheel[i], *const torque = &e->torque[i];
        tgi_own_time *const p = &e->own_time[i];
        const tg_real age = (tg_real)(row->time - h->time);
        if (p->until == e->time) p->hub = hub(e, i);
        const int32_t missing = isnan(row->value[TG_WHEEL_SPEED + i]);
        const int32_t between = goes && missing && h->interval > 0;
        const int32_t expected = age < TG_OVERDUE * h->interval;
        const int32_t steady = between && expected && torque->time == row->time && torque->interval > 0 && h->interval > TG_FASTER * torque->interval;
        const int32_t waits = between && !steady;
        e->scene.since_sample[i] = waits ? moved_since(e, i, age) : 0;
        const double from = goes ? p->until : e->time;
        if (steady) keep_steady(e, i, age, row);
        p->step = waits ? 0 : e->started ? (tg_real)(row->time - from) : 0;
        e->filter.moves[i] = dt > 0 ? p->step / dt : 1;
        if (waits) continue;
        if (torque->time > from) p->torque = from;
        p->until = row->time;
    }
}
