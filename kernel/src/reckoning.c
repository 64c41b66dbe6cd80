/* Ground speed while its sensor is silent: wheel speed less the last slip, at the present adhesion (R). Without it nothing separates slip
 * from soil resistance, and the estimate of v drifts with every error of the forces. The last slip tells less and less of the ground
 * ahead: what the vehicle usually slips, and how far from that it was while this was measured, take its place. */
#include "estimator.h"

void tgi_no_slips(tg_estimator *e)
{
    tgi_slip_memory *m = &e->slip_memory;
    m->slip = m->usual = e->settings.tuned.first_slip;
    m->adhesion = m->usual_adhesion = e->settings.prior_adhesion;
    m->apart = tgi_square(e->settings.tuned.slip_apart);
    m->way = e->settings.tuned.uneven_memory;
}

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

/* Slip at another adhesion than this one, on the same soil: along the tangent of the prototype curve. */
static tg_real slip_at(const tg_tuned *k, tg_real slip, tg_real from, tg_real adhesion)
{
    const tg_real level = tgi_max(from, (tg_real)0.1), s = tgi_max(slip, 0);
    tg_real slope = s > 0 ? tgi_expm1(TG_STEEPNESS * s) / (TG_STEEPNESS * level) : 1 / (TG_STEEPNESS * level);
    if (slope > k->most_slope) slope = k->most_slope;
    const tg_real result = slip + slope * (adhesion - from);
    return result < (tg_real)-0.2 ? (tg_real)-0.2 : result > (tg_real)0.8 ? (tg_real)0.8 : result;
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
    const tg_tuned *const k = &e->settings.tuned;
    const tg_real since = tgi_max(dt, e->ground.interval < e->settings.gap ? e->ground.interval : e->settings.gap);
    const tg_real travelled = rim * since / e->constants.mean_radius, away = slip - slip_at(k, m->usual, m->usual_adhesion, adhesion);
    m->way = m->way + travelled < k->hill_memory ? m->way + travelled : k->hill_memory;
    const tg_real share = travelled < m->way ? travelled / m->way : 1, most = 2 * tgi_sqrt(m->apart); /* spinning wheels are not the rule */
    m->usual += share * (away > most ? most : away < -most ? -most : away);
    m->usual_adhesion += share * (adhesion - m->usual_adhesion);
    m->apart += share * (tgi_square(away) - m->apart);
}

/* Give the row a ground speed by dead reckoning where the sensor has been silent. Its error lasts for a while, which the variance allows
 * for: a white one would be averaged away. With an accelerometer it only corrects the speed that the accelerometer predicts. */
void tgi_reckon(tg_estimator *e, const tg_drive *drive, tg_real dt, int32_t goes, tg_row *row, tg_real *q)
{
    const tg_tuned *const k = &e->settings.tuned;
    tgi_slip_memory *const m = &e->slip_memory;
    row->ground_variance = e->constants.variance[TG_GROUND_SPEED] + row->doubt[e->settings.machine.wheels];
    e->scene.reckoned = 0;
    if (!isnan(row->value[TG_GROUND_SPEED])) {
        e->ground_time = row->time;
        m->unseen = 0;
        return;
    }
    tg_real silence = (tg_real)(row->time - e->ground_time), rim, adhesion;
    if (silence < k->silence || !row->measured || !(dt > 0)) return;
    if (e->standing && e->slope.running) tgi_slope_correct(&e->slope, 0, tgi_square(e->settings.standstill_speed) * (1 + 2 * k->alike / dt));
    if (!goes) return;
    means(e, row, drive, &rim, &adhesion);
    m->unseen += tgi_fabs(rim) * dt / e->constants.mean_radius;
    const tg_real last = slip_at(k, m->slip, m->adhesion, adhesion), usual = slip_at(k, m->usual, m->usual_adhesion, adhesion);
    const tg_real keep = tgi_exp(-m->unseen / k->uneven_memory); /* how likely it is the last slip still */
    const tg_real spread = tgi_square(k->slip_spread) + (1 - keep) * (m->apart + keep * tgi_square(last - usual));
    tg_real alike = k->alike, force = k->reckoned_force * e->constants.force_walk;
    tg_real speed = (tg_real)e->direction * rim * (1 - usual - keep * (last - usual));
    tg_real variance = tgi_square(rim) * spread + tgi_square((tg_real)0.01);
    e->scene.reckoned = variance;
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
