/* Loads that forces do not show, from slips (R; docs/decisions/0163). A wheel whose torque hardly responds to a bump changes its slip
 * instead: its force stays, and its adhesion changes with the load. Wheels share a curve, so with a wheel's adhesion and slip, each beyond
 * its usual and the other wheels', mu - g' s is the effect of load; g' is `bend` of the secant. In one row such slips are a fraction
 * of their noise. But unevenness is correlated over more than a wheel radius, and noise is not: the mean product of two stretches of
 * `slip_length`, their middles twice that apart, contains no noise, and becomes certain with distance. It is that of the trends along and
 * across (warp.c); what slips beyond all trends hide is counted there. */
#include "estimator.h"

#define TG_BEYOND_CHANCE ((tg_real)2) /* SDs */

/* Leave of a value of the driven wheels (8,) what is neither their mean nor beyond all trends. */
static void leave_trends(const tg_settings *s, const tgi_constants *c, tg_real *value)
{
    tgi_pivot(s, value);
    tg_real warp[TG_MAX_WHEELS], mean = 0;
    tgi_warp(c, value, warp);
    for (int32_t i = 0; i < TG_MAX_WHEELS; i++) {
        value[i] -= warp[i];
        mean += value[i] * c->share;
    }
    for (int32_t i = 0; i < TG_MAX_WHEELS; i++) value[i] -= c->pulls[i] * mean;
}

/* Product of two such values, a driven wheel in the mean, by the trends that are left. */
static tg_real product(const tgi_constants *c, const tg_real *a, const tg_real *b)
{
    tg_real sum = 0;
    for (int32_t i = 0; i < TG_MAX_WHEELS; i++) sum += a[i] * b[i];
    return sum / (tg_real)c->slopes;
}

/* Add the products of two stretches, `away` wheel radii between their middles: to the relative variance of adhesion by load, and to that of
 * the adhesions. The first counts as far as it is beyond chance, given loads as the adhesions show them, or greater ones as far as it is
 * itself beyond two SDs of chance; as far as it is chance, slips are taken to hide as much as the adhesions show (docs/decisions/0115). */
static void add_product(tg_estimator *e, const tgi_stretch *now, const tgi_stretch *before, tg_real away)
{
    tgi_hidden *h = &e->hidden;
    const tg_tuned *k = &e->settings.tuned;
    const tg_real slope = k->bend * tgi_max(h->pulling, 0) / tgi_max(h->slipping, k->least_slip);
    const tg_real alike = tgi_exp(-tgi_square(away / TG_LOAD_LENGTH) / 2), level = tgi_relative(e, 1), shown = level * e->roughness.scatter;
    tg_real here[TG_MAX_WHEELS], there[TG_MAX_WHEELS];
    if (!(shown > 0)) return;
    for (int32_t i = 0; i < TG_MAX_WHEELS; i++) {
        here[i] = now->adhesion[i] - slope * now->slip[i];
        there[i] = before->adhesion[i] - slope * before->slip[i];
    }
    const tg_real plain = level * product(&e->constants, now->adhesion, before->adhesion), beyond = level * product(&e->constants, here, there) - plain;
    if (h->count < k->hill_memory / k->slip_length) h->count += 1;
    h->plain += (alike * plain - h->plain) / h->count;
    h->beyond += (alike * beyond - h->beyond) / h->count;
    h->weight += (alike * alike - h->weight) / h->count;
    h->square += (tgi_square(alike * beyond) - h->square) / h->count;
    const tg_real found = tgi_square(h->beyond), chance = h->square / h->count;
    const tg_real expected = tgi_square(shown * h->weight) + tgi_max(found - tgi_square(TG_BEYOND_CHANCE) * chance, 0);
    h->load = (h->beyond / h->weight * expected + tgi_relative(e, tgi_scatter(e)) * chance) / (expected + chance);
}

/* Of adhesions whose scatter is `scatter`, the relative variance that is loads': more where slips hide loads, by all trends and the mean;
 * less, in proportion, where they follow the curve. */
tg_real tgi_by_load(const tg_estimator *e, tg_real scatter)
{
    const tgi_hidden *h = &e->hidden;
    const tg_real shown = tgi_relative(e, scatter);
    if (h->load >= 0 || !(h->plain > 0)) return shown + tgi_max(h->load, 0) * (1 - e->constants.share * (tg_real)e->constants.warps);
    return shown * tgi_max(1 + h->load * h->weight / h->plain, 0);
}

static void end_stretch(tg_estimator *e)
{
    tgi_hidden *h = &e->hidden;
    tgi_stretch *const now = &h->now, *const last = &h->last[0], *const older = &h->last[1];
    for (int32_t i = 0; i < TG_MAX_WHEELS; i++) {
        now->adhesion[i] /= now->length;
        now->slip[i] /= now->length;
    }
    leave_trends(&e->settings, &e->constants, now->adhesion);
    leave_trends(&e->settings, &e->constants, now->slip);
    const tg_real near = (now->length + last->length) / 2, far = near + (last->length + older->length) / 2, apart = 2 * e->settings.tuned.slip_length;
    const tgi_stretch *const before = near >= apart ? last : older;
    const tg_real away = near >= apart ? near : far;
    if (before->length > 0 && away < 2 * TG_LOAD_LENGTH && h->way > e->settings.tuned.uneven_length + far) add_product(e, now, before, away);
    *older = *last;
    *last = *now;
    memset(now, 0, sizeof *now);
}

/* After a row that holds a wheel's speed, `travelled` wheel radii behind the last such row; `flowing`: it goes on from that one. */
void tgi_watch_hidden(tg_estimator *e, const tgi_slips *slips, int32_t flowing, tg_real travelled)
{
    tgi_hidden *h = &e->hidden;
    const tg_real *const mu = e->belief.x, *const at_rest = e->constants.at_rest;
    const tg_real *const slip = slips->along;
    tg_real pull = 0, mean = 0;
    if (!flowing || !slips->known) {
        memset(&h->now, 0, sizeof h->now);
        memset(h->last, 0, sizeof h->last);
        h->way = 0;
        return;
    }
    const tg_real fresh = travelled / (e->settings.tuned.uneven_length + travelled);
    const tg_real gain = h->way > 0 ? tgi_max(fresh, travelled / (h->way + travelled)) : 1; /* a plain mean at first */
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        if (!(e->constants.pulls[i] > 0)) continue;
        h->slip[i] += gain * (slip[i] - h->slip[i]);
        h->adhesion[i] += gain * (mu[i] - h->adhesion[i]);
        h->now.slip[i] += travelled * (slip[i] - h->slip[i]);
        h->now.adhesion[i] += travelled * (mu[i] - h->adhesion[i]);
        pull += at_rest[i] * mu[i];
        mean += at_rest[i] * slip[i];
    }
    h->pulling += gain * (pull - h->pulling);
    h->slipping += gain * (mean - h->slipping);
    h->way += travelled;
    h->now.length += travelled;
    if (h->now.length >= e->settings.tuned.slip_length) end_stretch(e);
}
