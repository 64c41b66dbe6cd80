/* Ground speed while its sensor is silent: wheel speed less the last slip, at the present adhesion (R). Without it nothing separates slip
 * from soil resistance, and the estimate of v drifts with every error of the forces. */
#include "estimator.h"

/* Mean rim speed, of this row where it measures it (row null: as believed), and mean adhesion over the load, along the travel. */
static void means(const tg_estimator *e, const tg_row *row, const tg_drive *drive, tg_real *rim, tg_real *adhesion)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real load = 0, pull = 0, speed = 0;
    for (int32_t i = 0; i < n; i++) {
        load += drive->load[i];
        pull += drive->load[i] * e->belief.x[i];
        const int32_t known = row && !isnan(row->value[TG_WHEEL_SPEED + i]) && !(row->doubt[i] > 0);
        const tg_real omega = known ? (tg_real)e->direction * row->value[TG_WHEEL_SPEED + i] : e->belief.x[n + 2 + i];
        speed += e->settings.rolling_radius[i] * omega;
    }
    *rim = speed / (tg_real)n;
    *adhesion = pull / load;
}

/* After a row whose ground speed was measured: remember slip and adhesion. */
void tgi_remember_slip(tg_estimator *e, const tg_drive *drive, tg_real dt)
{
    tgi_slip_memory *m = &e->slip_memory;
    tg_real rim, adhesion, v = e->belief.x[e->settings.machine.wheels + 1];
    means(e, NULL, drive, &rim, &adhesion);
    if (rim < 3 * e->settings.standstill_speed) return;
    tg_real slip = 1 - v / rim, gain = dt / (e->settings.tuned.slip_memory + dt);
    if (slip < (tg_real)-0.2) slip = (tg_real)-0.2;
    m->slip += gain * (slip - m->slip);
    m->adhesion += gain * (adhesion - m->adhesion);
}

/* Slip at another adhesion than the remembered one, on the same soil: along the tangent of the prototype curve. */
static tg_real slip_at(const tgi_slip_memory *m, tg_real most, tg_real adhesion)
{
    tg_real level = m->adhesion > (tg_real)0.1 ? m->adhesion : (tg_real)0.1, slip = m->slip > 0 ? m->slip : 0;
    tg_real slope = slip > 0 ? tgi_expm1(TG_STEEPNESS * slip) / (TG_STEEPNESS * level) : 1 / (TG_STEEPNESS * level);
    if (slope > most) slope = most;
    tg_real result = m->slip + slope * (adhesion - m->adhesion);
    return result < (tg_real)-0.2 ? (tg_real)-0.2 : result > (tg_real)0.8 ? (tg_real)0.8 : result;
}

/* Give the row a ground speed by dead reckoning where the sensor has been silent. Its error lasts for a while, which the variance allows
 * for: a white one would be averaged away. With an accelerometer it only corrects the speed that the accelerometer predicts. */
void tgi_reckon(tg_estimator *e, const tg_drive *drive, tg_real dt, tg_row *row, tg_real *q)
{
    const tg_tuned *const k = &e->settings.tuned;
    row->ground_variance = e->constants.variance[TG_GROUND_SPEED] + row->doubt[e->settings.machine.wheels];
    if (!isnan(row->value[TG_GROUND_SPEED])) {
        e->ground_time = row->time;
        return;
    }
    tg_real silence = (tg_real)(row->time - e->ground_time), rim, adhesion;
    if (silence < k->silence || !row->measured || !(dt > 0)) return;
    means(e, row, drive, &rim, &adhesion);
    tg_real spread = tgi_square(k->slip_spread) * (1 + silence / 5), alike = k->alike, force = k->reckoned_force * e->constants.force_walk;
    if (spread > tgi_square((tg_real)0.15)) spread = tgi_square((tg_real)0.15);
    tg_real speed = (tg_real)e->direction * rim * (1 - slip_at(&e->slip_memory, k->most_slope, adhesion));
    tg_real variance = tgi_square(rim) * spread + tgi_square((tg_real)0.01);
    if (e->slope.running) {
        tgi_slope_correct(&e->slope, speed, variance * (1 + 2 * alike / dt));
        speed = e->slope.speed;
        variance = e->slope.speed_variance;
        alike = k->carried_alike;
        force = k->carried_force * e->constants.force_walk;
    }
    row->value[TG_GROUND_SPEED] = speed;
    row->ground_variance = variance * (1 + 2 * alike / dt);
    row->reckoned = 1;
    const tg_real change = e->slope.running ? 0 : k->agility * e->settings.machine.gravity * dt; /* any acceleration up to half of that */
    q[e->settings.machine.wheels] += force * dt + tgi_square(change) / 12;
}
