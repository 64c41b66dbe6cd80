/* Ground speed while its sensor is silent: wheel speed less the last slip, at the present adhesion (R). Without it nothing separates slip
 * from soil resistance, and the estimate of v drifts with every error of the forces. The last slip tells less and less of the ground
 * ahead: what the vehicle usually slips, and how far from that it was while this was measured, take its place. */
#include "estimator.h"

#define TG_AGREED 5            /* s that speed, forces and wheels agree again: a drift may pass through what they agree on */
#define TG_STEADY_SLIP ((tg_real)0.04) /* SD of slips at one adhesion on the same ground */
#define TG_CALM 30             /* s without either sign against it: forces agree, so the ground is another one */
#define TG_BEYOND ((tg_real)9) /* square of the SDs beyond which that, and a slip, are no chance */

void tgi_reset_slips(tg_estimator *e)
{
    tgi_slip_memory *m = &e->slip_memory;
    m->slip = m->usual = e->settings.tuned.first_slip;
    m->adhesion = m->usual_adhesion = e->settings.prior_adhesion;
    m->apart = tgi_square(e->settings.tuned.slip_apart);
    m->way = e->settings.tuned.uneven_memory;
}

typedef struct { /* rims, along the travel */
    tg_real mean, square; /* of their speeds; a turn is taken off the mean alone, since each rim slips as it turns itself */
} rims;

/* Rim speeds, of this row where it measures them (row null: as believed), and mean adhesion over the load, along the travel. A wheel that
 * is silent itself says nothing of the ground speed, unless all are: its belief follows from the ground speed. What a turn adds to the rim
 * is taken off: the wheels that are measured may be those of one side. */
static rims means(const tg_estimator *e, const tg_row *row, const tg_drive *drive, tg_real *adhesion)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real load = 0, pull = 0;
    rims counting = {0, 0}, all = {0, 0};
    int32_t counted = 0;
    for (int32_t i = 0; i < n; i++) {
        load += drive->load[i];
        pull += drive->load[i] * e->belief.x[i];
        const int32_t known = row && !isnan(row->value[TG_WHEEL_SPEED + i]) && !(row->doubt[i] > 0);
        const tg_real omega = known ? (tg_real)e->direction * row->value[TG_WHEEL_SPEED + i] : e->belief.x[n + 2 + i];
        const int32_t counts = !tgi_rolls(e, i) && (!row || known || row->time - e->wheel[i].time <= (double)e->settings.tuned.silence);
        const tg_real rim = e->settings.rolling_radius[i] * omega, middle = rim + (tg_real)e->direction * e->settings.wheel_side[i] * e->yaw_rate;
        all.mean += middle / (tg_real)n;
        all.square += rim * rim / (tg_real)n;
        counting.mean += counts ? middle : 0;
        counting.square += counts ? rim * rim : 0;
        counted += counts;
    }
    *adhesion = pull / load;
    if (!counted) return all;
    counting.mean /= (tg_real)counted;
    counting.square /= (tg_real)counted;
    return counting;
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

/* What the vehicle usually slips at this adhesion. */
static tg_real usual_at(const tg_estimator *e, tg_real adhesion)
{
    return slip_at(&e->settings.tuned, e->slip_memory.usual, e->slip_memory.usual_adhesion, adhesion);
}

/* s that a row's ground speed stands for. */
static tg_real since_ground(const tg_estimator *e, tg_real dt)
{
    return tgi_max(dt, e->ground.interval < e->settings.gap ? e->ground.interval : e->settings.gap);
}

/* A row whose ground speed v was measured, at the rims' speeds and mean adhesion, along the travel, and the usual slip there. */
static void remember(tg_estimator *e, rims rim, tg_real v, tg_real adhesion, tg_real usual, tg_real dt)
{
    const tg_tuned *const k = &e->settings.tuned;
    tgi_slip_memory *m = &e->slip_memory;
    if (rim.mean < 3 * e->settings.standstill_speed) return;
    tg_real slip = 1 - v / rim.mean, gain = dt / (k->slip_memory + dt);
    if (slip < (tg_real)-0.2) slip = (tg_real)-0.2;
    m->slip += gain * (slip - m->slip);
    m->adhesion += gain * (adhesion - m->adhesion);
    const tg_real travelled = rim.mean * since_ground(e, dt) / e->constants.mean_radius;
    const tg_real away = (slip - usual) * rim.mean / tgi_sqrt(tgi_max(rim.square, tgi_square(rim.mean))); /* of each rim's speed */
    m->way = m->way + travelled < k->hill_memory ? m->way + travelled : k->hill_memory;
    const tg_real share = travelled < m->way ? travelled / m->way : 1, most = 2 * tgi_sqrt(m->apart); /* spinning wheels are not the rule */
    m->usual += share * (away > most ? most : away < -most ? -most : away);
    m->usual_adhesion += share * (adhesion - m->usual_adhesion);
    m->apart += share * (tgi_square(away) - m->apart);
}

/* Another dt without a ground speed: how likely it is the last slip still, which was only as sure as the speeds were. */
static tg_real go_unseen(tg_estimator *e, tg_real rim, tg_real dt)
{
    tgi_slip_memory *const m = &e->slip_memory;
    m->unseen += tgi_fabs(rim) * dt / e->constants.mean_radius;
    return tgi_exp(-m->unseen / e->settings.tuned.uneven_memory) * m->apart / (m->apart + m->variance);
}

/* Variance of the slip that is remembered now, at this rim speed, by the speeds' own. */
static void doubt_slip(tg_estimator *e, tg_real rim, tg_real variance)
{
    e->slip_memory.variance = variance / tgi_square(tgi_max(tgi_fabs(rim), 3 * e->settings.standstill_speed));
}

/* Ground speed along the travel at these rims and adhesion, with the usual slip there, and its variance. */
static tg_real reckoned_at(const tg_estimator *e, rims rim, tg_real adhesion, tg_real usual, tg_real keep, tg_real *variance)
{
    const tgi_slip_memory *const m = &e->slip_memory;
    const tg_real last = slip_at(&e->settings.tuned, m->slip, m->adhesion, adhesion);
    *variance = rim.square * (1 - keep) * (m->apart + keep * tgi_square(last - usual));
    return rim.mean * (1 - usual - keep * (last - usual));
}

/* After a ground speed: its innovation, the variance of that, and the gain. What it drew the estimate by is summed over a gap's time. */
void tgi_watch_draw(tg_estimator *e, tg_real innovation, tg_real variance, tg_real gain)
{
    tgi_slip_memory *const m = &e->slip_memory;
    const tg_real since = tgi_max(e->ground.interval, (tg_real)1e-3), leak = since / (e->settings.gap + since), chance = tgi_square(gain) * variance / (2 * leak);
    m->drawn += gain * innovation - leak * m->drawn;
    const tg_real most = TG_BEYOND * tgi_max(m->draws, chance), square = tgi_square(m->drawn);
    m->unusual = square > most;
    m->draws += ((m->unusual ? most : square) - m->draws) / e->settings.tuned.alike_memory;
}

/* Whether every driven wheel's slip has surely another sign than its adhesion, of a row's estimates. */
void tgi_watch_signs(tg_estimator *e, const tg_real *o)
{
    const tg_settings *const s = &e->settings;
    const tg_real speed = tgi_square(o[TG_OUT_GROUND_SPEED_STD]) - e->scene.astray;
    e->slip_memory.contrary = 0;
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!s->driven[i]) continue;
        const tg_real rim = s->rolling_radius[i] * o[TG_OUT_WHEEL_SPEED + i], slip = o[TG_OUT_SLIP + i], mu = o[TG_OUT_ADHESION + i];
        if (!(slip * mu < 0)) return;
        const tg_real speeds = speed + tgi_square(s->rolling_radius[i] * o[TG_OUT_WHEEL_SPEED_STD + i]);
        const tg_real apart = speeds / tgi_square(tgi_max(tgi_fabs(rim), s->standstill_speed)) + tgi_square(s->uncertainty.wheel_radius);
        if (!(tgi_square(slip) > TG_BEYOND * apart && tgi_square(mu) > TG_BEYOND * tgi_square(o[TG_OUT_ADHESION_STD + i]))) return;
    }
    e->slip_memory.contrary = 1;
}

/* After a row whose ground speed was measured: remember slip and adhesion. A receiver without a fix goes on by dead reckoning, smooth and
 * wrong: what its speeds draw the estimate by then is no motion that the forces show, and the slip is not one of this adhesion. Until
 * it is one again no slip is remembered and no curve learned, and what it differs by is a variance. */
void tgi_remember_slip(tg_estimator *e, const tg_drive *drive, tg_real dt)
{
    tgi_slip_memory *const m = &e->slip_memory;
    const tg_real v = e->belief.x[e->settings.machine.wheels + 1];
    const tg_real since = since_ground(e, dt);
    tg_real adhesion, variance;
    const rims rim = means(e, NULL, drive, &adhesion);
    const tg_real keep = m->astray ? go_unseen(e, rim.mean, since) : 1;
    const tg_real usual = usual_at(e, adhesion), off = tgi_square(v - reckoned_at(e, rim, adhesion, usual, keep, &variance));
    variance += tgi_square(rim.mean) * (tgi_square(TG_STEADY_SLIP) + tgi_square(m->slip / 4)) + e->constants.variance[TG_GROUND_SPEED] + tgi_square(e->settings.standstill_speed);
    m->agreeing = off < variance && !m->contrary ? m->agreeing + since : 0;
    m->calm = m->unusual || m->contrary ? 0 : m->calm + since;
    const int32_t before = m->against > 0; /* one reading may be a spike */
    m->against = m->contrary || (m->unusual && off > TG_BEYOND * variance);
    if (m->against && before) m->astray = 1;
    else if (m->agreeing > TG_AGREED || m->calm > TG_CALM) m->astray = 0;
    if (!m->astray) {
        remember(e, rim, v, adhesion, usual, dt);
        doubt_slip(e, rim.mean, e->belief.P[(e->settings.machine.wheels + 1) * (tgi_stride(e->settings.machine.wheels) + 1)]);
    }
    e->scene.astray = m->astray ? off + variance : 0;
}

/* Whether the row's ground speed is to be reckoned, after so many seconds of silence; if it is measured, the silence is over. */
static int32_t is_missing(tg_estimator *e, const tg_row *row, tg_real dt, tg_real silence)
{
    if (!isnan(row->value[TG_GROUND_SPEED])) {
        e->scene.reckoned = 0;
        e->ground_time = row->time;
        if (!e->slip_memory.astray) e->slip_memory.unseen = 0;
        return 0;
    }
    return (tg_real)(row->time - e->ground_time) >= silence && row->measured && dt > 0;
}

/* Give the row a ground speed by dead reckoning where the sensor has been silent. Its error lasts for a while, which the variance allows
 * for: a white one would be averaged away. With an accelerometer it only corrects the speed that the accelerometer predicts. */
void tgi_reckon(tg_estimator *e, const tg_drive *drive, tg_real dt, int32_t goes, tg_row *row, tg_real *q)
{
    const tg_tuned *const k = &e->settings.tuned;
    tg_real pulled;
    row->ground_variance = e->constants.variance[TG_GROUND_SPEED] + row->turn_variance + row->doubt[TG_GROUND_SPEED];
    row->loud = tgi_loudness_of(e, row, means(e, row, drive, &pulled).mean);
    row->ground_variance += row->loud;
    if (e->standing) e->slip_memory.astray = e->scene.astray = 0;
    if (!is_missing(e, row, dt, k->silence)) return;
    e->scene.astray = 0;
    if (e->standing && e->slope.running) tgi_slope_correct(&e->slope, 0, tgi_square(e->settings.standstill_speed) * (1 + 2 * k->alike / dt));
    e->scene.reckoned = 0;
    if (!goes) return;
    tg_real alike = k->alike, force = k->reckoned_force * e->constants.force_walk, adhesion, variance;
    const rims rim = means(e, row, drive, &adhesion);
    tg_real speed = (tg_real)e->direction * reckoned_at(e, rim, adhesion, usual_at(e, adhesion), go_unseen(e, rim.mean, dt), &variance);
    variance += tgi_square((tg_real)0.01);
    e->scene.reckoned = variance;
    if (e->slope.running) {
        tgi_slope_correct(&e->slope, speed, variance * (1 + 2 * alike / dt));
        e->scene.reckoned = tgi_max(variance, tgi_square(speed - e->slope.speed)); /* either may be wrong */
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

/* Rims along the travel, of this row where it measures them (row null: as believed), for speeds alone. */
static rims rims_of_speeds(const tg_estimator *e, const tg_row *row)
{
    const int32_t n = e->settings.machine.wheels;
    rims rim = {0, 0};
    for (int32_t i = 0; i < n; i++) {
        const tg_real omega = row ? row->value[TG_WHEEL_SPEED + i] : (tg_real)NAN;
        const tg_real speed = isnan(omega) ? e->speeds.x[0] + e->speeds.x[2 + i] : e->settings.rolling_radius[i] * omega;
        rim.mean += (tg_real)e->direction * speed / (tg_real)n;
        rim.square += speed * speed / (tg_real)n;
    }
    return rim;
}

/* The same for speeds alone, where the slip is that of one adhesion, and which need no help between the samples of a slow receiver. A
 * vehicle that stands has no speed. */
void tgi_reckon_speeds(tg_estimator *e, tg_real dt, tg_row *row)
{
    row->loud = tgi_loudness_of(e, row, rims_of_speeds(e, row).mean);
    row->ground_variance = e->constants.variance[TG_GROUND_SPEED] + row->turn_variance + row->loud;
    const tg_real usual = 2 * e->ground.interval, most = e->settings.gap, silence = tgi_max(e->settings.tuned.silence, usual < most ? usual : most);
    if (!is_missing(e, row, dt, silence) || e->speeds.seen[0] == 0 || e->speeds.open != 0) return;
    tg_real variance = tgi_square(e->settings.standstill_speed), speed = 0;
    if (!e->standing) {
        const rims rim = rims_of_speeds(e, row);
        const tg_real adhesion = e->settings.prior_adhesion;
        speed = (tg_real)e->direction * reckoned_at(e, rim, adhesion, usual_at(e, adhesion), go_unseen(e, rim.mean, dt), &variance);
        variance += tgi_square(TG_SAMPLE_AGE * (rim.mean - rims_of_speeds(e, NULL).mean)); /* of one instant they are not */
    }
    e->scene.reckoned = variance;
    row->value[TG_GROUND_SPEED] = speed;
    row->ground_variance = variance;
    row->reckoned = 1;
}

void tgi_remember_speeds(tg_estimator *e, const tg_row *row, tg_real dt)
{
    const rims rim = rims_of_speeds(e, row);
    const tg_real adhesion = e->settings.prior_adhesion;
    if (row->reckoned || isnan(row->value[TG_GROUND_SPEED])) return;
    remember(e, rim, (tg_real)e->direction * e->speeds.x[0], adhesion, usual_at(e, adhesion), dt);
    doubt_slip(e, rim.mean, e->speeds.P[0][0]);
}
