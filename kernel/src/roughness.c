/* Uneven ground, as the estimates themselves show it (R). Nothing on board measures how a wheel's load varies over the ground's
 * bumps: the force follows the load, and the estimate mistakes it for adhesion. Wheels at one slip share a curve, so the difference of one
 * wheel's adhesion from the others' within a few wheel radii counts as unseen load, a variance relative to the adhesion. A wheel that no
 * motor drives is at no such slip, though its torque be measured: it does not count (docs/decisions/0115). Where only one wheel is driven, its difference from its own mean. rho_s varies likewise: a wheel that climbs a bump is held back by load times gradient,
 * which no pitch sensor reads, while soil itself changes more slowly. Lengths are in wheel radii, so they scale with the machine. */
#include "estimator.h"

#define TG_SMALL_ADHESION ((tg_real)1e-4)    /* .01 squared: below it scatter is not relative */
#define TG_SMALL_RESISTANCE ((tg_real)1.6e-5) /* .004 squared */

/* Mean square of what each of `count` wheels does beyond all of them. */
static tg_real apart(const tg_real *change, int32_t count)
{
    tg_real sum = 0, square = 0;
    for (int32_t k = 0; k < count; k++) {
        sum += change[k];
        square += tgi_square(change[k]);
    }
    if (count < 2) return square;
    square -= sum * sum / (tg_real)count;
    return (square > 0 ? square : 0) / (tg_real)(count - 1);
}

/* A mean square goes on by `square`, of which at most `most` times the usual counts: a border between soils is no bump. */
static void count_square(tg_real *mean, tg_real square, tg_real least, tg_real most, tg_real gain)
{
    most *= *mean + least;
    *mean += gain * ((square < most ? square : most) - *mean);
}

/* rho_s and the slope over the whole way; rho_s is at first the prior, as if driven over the length of `uneven_memory`. */
static void watch_hills(tg_estimator *e, tg_real rho, tg_real travelled)
{
    tgi_roughness *r = &e->roughness;
    const tg_tuned *k = &e->settings.tuned;
    if (r->way == 0) {
        r->usual = e->settings.prior_resistance;
        r->way = k->uneven_memory;
    }
    r->way = r->way + travelled < k->hill_memory ? r->way + travelled : k->hill_memory;
    const tg_real gain = travelled / r->way;
    r->usual += gain * (rho - r->usual);
    if (travelled > 0) r->grade += travelled / (r->way - k->uneven_memory) * (tgi_square(e->held.slope) - r->grade);
    r->swing += gain * (tgi_square(rho - r->usual) - r->swing);
}

/* Whether the row, the estimator's next one, holds a wheel's speed. Without any, slips are predicted by the torques alone. */
static int32_t wheels_measured(const tg_estimator *e)
{
    for (int32_t i = 0; i < e->settings.machine.wheels; i++)
        if (e->wheel[i].count > 0 && e->wheel[i].time > e->time) return 1;
    return 0;
}

/* After a row's estimate, `distance` m behind the one before. `flowing`: the row continues that one. */
void tgi_watch_roughness(tg_estimator *e, int32_t flowing, tg_real distance)
{
    tgi_roughness *r = &e->roughness;
    const tg_tuned *k = &e->settings.tuned;
    const int32_t n = e->settings.machine.wheels;
    const tg_real *const mu = e->belief.x, rho = mu[n], travelled = distance / e->constants.mean_radius;
    const tg_real fresh = travelled / (k->uneven_length + travelled), gain = travelled / (k->uneven_memory + travelled);
    tg_real change[TG_MAX_WHEELS], square = 0, own = 0;
    int32_t driven = 0;
    for (int32_t i = 0; i < n; i++) {
        if (!flowing) r->adhesion[i] = mu[i];
        r->adhesion[i] += fresh * (mu[i] - r->adhesion[i]);
        if (!e->settings.driven[i] || !e->constants.watched[i]) continue;
        change[driven++] = mu[i] - r->adhesion[i];
        square += tgi_square(mu[i]);
        own += e->belief.P[i * (tgi_stride(n) + 1)];
    }
    if (driven) {
        square /= (tg_real)driven;
        own /= (tg_real)driven;
    }
    if (e->constants.warps || e->constants.slopes) {
        r->waited += travelled;
        if (e->constants.warps) tgi_watch_warp(e, flowing, fresh);
        if (e->settings.method == TG_FILTERED && (!flowing || wheels_measured(e))) {
            const tgi_slips slips = tgi_driven_slips(e);
            if (e->constants.warps) tgi_watch_slips(e, &slips, flowing, r->waited);
            if (e->constants.slopes) tgi_watch_hidden(e, &slips, flowing, r->waited);
            r->waited = 0;
        }
    }
    count_square(&r->scatter, apart(change, driven), TG_SMALL_ADHESION, k->uneven_most, gain);
    r->square += gain * (square - r->square);
    count_square(&r->own, own, TG_SMALL_ADHESION, k->uneven_most, gain);
    watch_hills(e, rho, travelled);
    if (!flowing) r->resistance = r->mean_resistance = rho;
    r->resistance += fresh * (rho - r->resistance);
    r->mean_resistance += travelled / (TG_LOAD_LENGTH + travelled) * (rho - r->mean_resistance);
    count_square(&r->wander, tgi_square(rho - r->resistance), TG_SMALL_RESISTANCE, k->uneven_most, gain);
    count_square(&r->bumps, tgi_square(rho - r->mean_resistance), TG_SMALL_RESISTANCE, k->uneven_most, gain);
    count_square(&r->own_resistance, e->belief.P[n * (tgi_stride(n) + 1)], TG_SMALL_RESISTANCE, k->uneven_most, gain);
}

/* Variance of rho_s by the gradients of bumps: its scatter within the length of unevenness, over which soil hardly changes, less the
 * estimate's own noise (docs/decisions/0115). The low-pass, as long as they are, leaves half of it. */
tg_real tgi_unseen_bumps(const tg_estimator *e)
{
    return 2 * tgi_max(e->roughness.bumps - TG_NOISE_SHARE * e->roughness.own_resistance, 0);
}

/* A mean square of adhesions over that of the wheels' own. */
tg_real tgi_relative(const tg_estimator *e, tg_real square) { return square / (e->roughness.square + TG_SMALL_ADHESION); }

/* Mean square by which the wheels' adhesions differ, less the estimates' own noise (docs/decisions/0115). */
tg_real tgi_scatter(const tg_estimator *e) { return tgi_max(e->roughness.scatter - TG_NOISE_SHARE * e->roughness.own, 0); }

/* Relative variance of a wheel's load that the loads of the model do not contain: the scatter, with what slips
 * show (hidden.c). Of a load that is correlated over TG_LOAD_LENGTH the low-pass leaves
 * length/(length + TG_LOAD_LENGTH) of the variance. */
tg_real tgi_unseen_load(const tg_estimator *e)
{
    return (1 + TG_LOAD_LENGTH / e->settings.tuned.uneven_length) * tgi_by_load(e, tgi_scatter(e));
}

/* Variance of the slope that rho_s may contain where nothing measures the slope: hills and soft soil both need thrust. The variation of
 * rho_s about its mean, now or as a rule, beyond that of one soil's resistance and the slope that the vehicle's file states. */
tg_real tgi_unseen_grade(const tg_estimator *e)
{
    const tgi_roughness *r = &e->roughness;
    const tg_settings *s = &e->settings;
    if (e->pitch.count > 0 || e->slope.running) return 0;
    const tg_real now = tgi_square(e->belief.x[s->machine.wheels] - r->usual);
    const tg_real beyond = tgi_sqrt(tgi_max(now, r->swing)) - s->tuned.soil_spread * tgi_fabs(r->usual);
    return beyond > s->uncertainty.slope ? tgi_square(beyond) - tgi_square(s->uncertainty.slope) : 0;
}
