/* What a stiff chassis shifts between wheels (R; docs/decisions/0144). Loads that ground unevenness moves from wheel to wheel keep their
 * sum and both moments, so on the wheels they make a pattern that is neither equal on all, nor front against rear, nor left against right:
 * one diagonal against the other. Nothing on board measures it, and estimates mistake it for adhesion. True adhesions differ by axle and by
 * side, hardly by diagonal; so the part of that pattern that lasts longer than unevenness may be adhesion, or a load that hills shift.
 * Besides, wheels share a curve: a wheel that carries less slips more, and its slip beyond the trends, along the curve, is true adhesion.
 * Errors of the ground speed are equal on all wheels and drop out; the variance by those of the wheel speeds is known. */
#include "estimator.h"

#define TG_TRENDS 3 /* equal, along, across; in a turn also the middle against the ends */
#define TG_IN_LINE ((tg_real)1e-9) /* mean square below which a trend is none: all wheels on one axle, or on one side */
#define TG_SINGLY ((tg_real)3) /* within a third below what wheels slip one by one, less and less of a pattern is load (`shifted`) */
/* Of values on the wheels (8,) what loads can do: those on an axle that pivots are alike. Returns how many patterns that takes away. */
int32_t tgi_pivot(const tg_settings *s, tg_real *value)
{
    int32_t away = 0;
    for (int32_t k = 0; k < s->axles; k++) {
        tg_real mean = 0;
        int32_t count = 0;
        for (int32_t i = 0; i < s->machine.wheels && s->pivots[k]; i++) {
            if (s->wheel_axle[i] != k || !s->driven[i]) continue;
            mean += (value[i] - mean) / (tg_real)++count;
        }
        for (int32_t i = 0; i < s->machine.wheels && count; i++)
            if (s->wheel_axle[i] == k && s->driven[i]) value[i] = mean;
        away += count ? count - 1 : 0;
    }
    return away;
}

/* Trends over the driven wheels, orthonormal under their loads at rest (Gram and Schmidt), and what the first three leave. More wheels than
 * those leave patterns, but for what a pivot makes alike. Returns the number of trends. */
static int32_t find_trends(const tg_settings *s, tgi_constants *c)
{
    const int32_t n = s->machine.wheels;
    tg_real trends[TG_TRENDS + 1][TG_MAX_WHEELS] = {{0}}, by_trend[TG_TRENDS + 1][TG_MAX_WHEELS] = {{0}}, longest = 0;
    int32_t count = 0, kept = 0;
    for (int32_t k = 0; k < s->axles; k++) longest = tgi_max(longest, tgi_fabs(s->load_transfer[k]));
    for (int32_t a = 0; a <= TG_TRENDS; a++) {
        tg_real *const trend = trends[count], square = 0;
        for (int32_t i = 0; i < n; i++) {
            const tg_real along = longest > 0 ? s->load_transfer[s->wheel_axle[i]] / longest : 0;
            trend[i] = a == 0 ? 1 : a == 1 ? along : a == 2 ? (tg_real)c->side[i] : along * along;
        }
        tgi_pivot(s, trend);
        for (int32_t b = 0; b < count; b++) {
            tg_real share = 0;
            for (int32_t i = 0; i < n; i++) share += by_trend[b][i] * trend[i];
            for (int32_t i = 0; i < n; i++) trend[i] -= share * trends[b][i];
        }
        for (int32_t i = 0; i < n; i++) square += c->at_rest[i] * tgi_square(trend[i]);
        for (int32_t i = 0; i < n; i++) {
            trend[i] *= square > TG_IN_LINE && s->driven[i] ? 1 / tgi_sqrt(square) : 0;
            by_trend[count][i] = c->at_rest[i] * trend[i];
        }
        count += square > TG_IN_LINE;
        if (a < TG_TRENDS) kept = count;
    }
    for (int32_t j = 0; j < n; j++) {
        c->middle[j] = count > kept ? trends[kept][j] : 0;
        for (int32_t a = 0; a < 2; a++) c->trend[a][j] = kept == TG_TRENDS ? by_trend[1 + a][j] : 0;
        memset(c->beyond[j], 0, sizeof c->beyond[j]);
        c->beyond[j][j] = 1;
        tgi_pivot(s, c->beyond[j]);
        for (int32_t i = 0; i < n; i++) {
            for (int32_t a = 0; a < kept; a++) c->beyond[j][i] -= by_trend[a][j] * trends[a][i];
            c->beyond[j][i] *= c->pulls[i];
        }
    }
    return kept;
}

void tgi_place_trends(const tg_settings *s, tgi_constants *c)
{
    const int32_t n = s->machine.wheels;
    tg_real whole = 0, work = 0;
    int32_t driven = 0, unpowered = 0;
    for (int32_t i = 0; i < n; i++) {
        c->inverse_radius[i] = 1 / s->rolling_radius[i];
        c->pulls[i] = s->driven[i] ? 1 : 0;
        driven += s->driven[i] != 0;
        unpowered |= s->driven[i] && !c->watched[i];
        whole += c->at_rest[i] = s->driven[i] ? s->load_share[s->wheel_axle[i]] * s->wheel_share[i] : 0;
    }
    c->work = 1;
    if (!driven) return;
    for (int32_t i = 0; i < n; i++) {
        c->at_rest[i] /= whole;
        c->watched_share[i] = c->watched[i] ? c->at_rest[i] : 0;
        work += c->watched_share[i];
    }
    for (int32_t i = 0; i < n && work > 0; i++) c->watched_share[i] /= work;
    if (work > 0) c->work = work;
    const int32_t count = find_trends(s, c);
    tg_real alike[TG_MAX_WHEELS] = {0};
    c->warps = driven - count - tgi_pivot(s, alike);
    c->slopes = count > 1 && !(unpowered && c->warps) ? count - 1 : 0; /* see hidden.c */
    c->share = 1 / (tg_real)driven;
}

/* Of adhesions or slips what no trend holds. All TG_MAX_WHEELS values are read and written, so that loops are of one length: those of
 * absent wheels need only be finite. */
void tgi_warp(const tgi_constants *restrict c, const tg_real *restrict value, tg_real *restrict warp)
{
    tg_lanes first = lanes_all(0), last = first;
    for (int j = 0; j < TG_MAX_WHEELS; j++) {
        first += lanes_load(c->beyond[j]) * value[j];
        last += lanes_load(c->beyond[j] + TG_LANES) * value[j];
    }
    lanes_store(warp, first);
    lanes_store(warp + TG_LANES, last);
}

/* How far the adhesions of one side oppose those of the other, as where a machine turns by its wheels' speeds: 0 where both push the same way,
 * 1 in a turn on the spot. */
static tg_real opposed(const tg_estimator *e)
{
    tg_real left = 0, right = 0;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) *(e->constants.side[i] < 0 ? &left : &right) += e->constants.at_rest[i] * e->belief.x[i];
    if (left * right >= 0) return 0;
    const tg_real ratio = -left / right;
    return ratio < 1 ? ratio : 1 / ratio;
}

/* Of the adhesions what no trend holds. A load shifts an adhesion by a share of itself, so where the sides oppose each other a diagonal's load
 * shows as front against rear, and what front and rear do differently as one diagonal against the other: trends are those of the adhesions
 * in each side's own direction. Wheels near the middle of a turn shear less sideways than those at the ends, and push more. */
static void warp_of_adhesions(const tg_estimator *e, tg_real *warp)
{
    const tgi_constants *c = &e->constants;
    const tg_real share = opposed(e);
    tgi_warp(c, e->belief.x, warp);
    if (!(share > 0)) return;
    tg_real value[TG_MAX_WHEELS], mirrored[TG_MAX_WHEELS], middle = 0;
    for (int i = 0; i < TG_MAX_WHEELS; i++) {
        value[i] = c->side[i] < 0 ? -e->belief.x[i] : e->belief.x[i];
        middle += c->at_rest[i] * c->middle[i] * value[i];
    }
    tgi_warp(c, value, mirrored);
    for (int i = 0; i < TG_MAX_WHEELS; i++) {
        const tg_real left = mirrored[i] - middle * c->middle[i];
        warp[i] += share * ((c->side[i] < 0 ? -left : left) - warp[i]);
    }
}

/* Slips of the driven wheels after a row's estimate. */
tgi_slips tgi_driven_slips(const tg_estimator *e)
{
    const tg_settings *s = &e->settings;
    const int32_t n = s->machine.wheels, stride = tgi_stride(n);
    const tg_real v = e->belief.x[n + 1], yaw = (tg_real)e->direction * e->yaw_rate, *const omega = e->belief.x + n + 2, *const P = e->belief.P + (n + 2) * (stride + 1);
    tgi_slips slips = {{0}, {0}, 0, v > s->standstill_speed};
    tg_real sides = 0;
    for (int32_t i = 0; i < n; i += TG_LANES) {
        const tg_lanes steered = lanes_load(s->wheel_ahead + i), ahead = v - lanes_load(s->wheel_side + i) * yaw, hub = tgi_hub_of(ahead, steered * yaw);
        const tg_lanes inverse = 1 / lanes_load(omega + i), by_radius = lanes_load(e->constants.inverse_radius + i), part = hub * inverse * by_radius;
        const tg_lanes straight = lanes_where((tg_choice)(steered != 0), part * v / ahead, v * inverse * by_radius);
        const tg_choice within = (tg_choice)(part > 0) & (tg_choice)(part < 2) & (tg_choice)(straight > 0) & (tg_choice)(straight < 2);
        for (int32_t j = 0; j < TG_LANES && i + j < n; j++) {
            if (!(e->constants.pulls[i + j] > 0)) continue;
            const tg_hold *const wheel = &e->wheel[i + j];
            slips.along[i + j] = 1 - part[j];
            slips.straight[i + j] = 1 - straight[j];
            slips.known &= within[j] && wheel->count > 0 && e->time - wheel->time <= (double)s->tuned.silence;
            slips.variance += tgi_square(straight[j] * inverse[j]) * P[(i + j) * (stride + 1)];
            sides += tgi_square(s->wheel_side[i + j]);
        }
    }
    if (s->articulated) { /* a joint that bends shows as a diagonal's slips */
        const tg_real bent = tgi_square(e->unseen_turn) - 4 * tgi_square(s->noise[TG_YAW_RATE]);
        slips.known &= sides * bent < 4 * slips.variance * v * v;
    }
    slips.variance *= e->constants.share;
    return slips;
}

/* How far the driven wheels' rims go for each metre of the vehicle. */
static tg_real rims_way(const tg_estimator *e)
{
    const int32_t n = e->settings.machine.wheels;
    tg_real way = 0;
    for (int32_t i = 0; i < n; i++) way += e->constants.pulls[i] * e->belief.x[n + 2 + i] * e->settings.rolling_radius[i];
    return way * e->constants.share / e->belief.x[n + 1];
}

/* Slip of the place on the curve where the wheels are in the mean, from the one before: on one through the origin, A s/(s + c), the mean
 * of their adhesions, which has `bend` of its secant as tangent. A wheel that spins alone moves it little, all of them take it along.
 * Free wheels, if there are any, are at 0. */
static tg_real usual_slip(const tg_estimator *e, tg_real before)
{
    const tgi_constants *c = &e->constants;
    const tg_real bend = e->settings.tuned.bend, place = tgi_max(before, e->settings.tuned.least_slip), half = place / c->work * bend / (1 - bend);
    tg_real mean = 0;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) {
        const tg_real slip = tgi_max(e->warped.wheel_slip[i], 0);
        mean += c->watched_share[i] * slip / (slip + half);
    }
    return place * mean / (1 - bend);
}

/* A step along the curve as big as this, over what a line would make of it: one through the origin, A s/(s + c), whose tangent is `bend`
 * of its secant, has its tangent reach the asymptote at secant/(1 - bend) (docs/decisions/0163). Wheels that spin at a start slip
 * farther. */
static tg_real beyond_line(const tg_tuned *k, tg_real slip, tg_real inverse) { return tgi_max((1 - k->bend) * slip * inverse, 1); }

/* What is left of a step in slip where one wheel is far from the wheels' mean slip, for longer than unevenness lasts: it may be past the
 * peak of its curve, where slip tells nothing of the load. One for all wheels, so that thrust stays. */
static tg_real left_by_spin(const tg_estimator *e)
{
    const tgi_constants *c = &e->constants;
    const tg_tuned *k = &e->settings.tuned;
    tg_real mean = 0, far = 0;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) mean += c->watched_share[i] * e->warped.wheel_slip[i];
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) far = c->watched_share[i] > 0 ? tgi_max(far, tgi_fabs(e->warped.wheel_slip[i] - mean)) : far;
    return 1 / tgi_square(beyond_line(k, far, c->work / tgi_max(e->warped.slipping, k->least_slip)));
}

/* After a row that holds a wheel's speed, `travelled` wheel radii behind the last such row; `flowing`: it continues that one. Slips as if
 * the vehicle did not turn: what a turn does to a side is a trend, and a gyroscope's noise is none. Of a steered wheel, its longer way is
 * taken off: one axle's alone is a diagonal in a turn. */
void tgi_watch_slips(tg_estimator *e, const tgi_slips *slips, int32_t flowing, tg_real travelled)
{
    tgi_warped *w = &e->warped;
    const tgi_constants *c = &e->constants;
    const tg_real *const slip = slips->straight;
    const tg_real gain = travelled / (e->settings.tuned.uneven_memory + travelled);
    tg_real warp[TG_MAX_WHEELS], square = 0, shown = 0, pull = 0, all = 0, trend[2] = {0};
    if (!flowing || !slips->known) {
        memset(w->slip, 0, sizeof w->slip);
        memset(w->trend, 0, sizeof w->trend);
        return;
    }
    /* As noisy as a mean over slip_length, and as late. */
    const tg_real rolled = travelled * rims_way(e), soon = rolled / (e->settings.tuned.slip_length / 2 + rolled);
    const tg_real fresh = rolled / (e->settings.tuned.uneven_length + rolled); /* of the rims' distance: the vehicle covers none where wheels spin on the spot */
    tgi_warp(c, slip, warp);
    const tg_real noise = slips->variance * (tg_real)c->warps * c->share, most = e->settings.tuned.uneven_most * (w->noise + tgi_square(e->settings.tuned.small_slip));
    const tg_real weight = noise > most ? most / noise : 1; /* after a gap or a spike a row is less certain than usual */
    for (int i = 0; i < TG_MAX_WHEELS; i++) all += tgi_square(slip[i]) * c->share;
    const tg_real sure = 1 / (all + noise + tgi_square(e->settings.tuned.small_slip)); /* a spinning wheel's slip tells nothing of radii and ruts */
    w->sure = w->sure > 0 ? w->sure + gain * (sure - w->sure) : sure;
    const tg_real learned = gain * sure / w->sure;
    const tg_real counts = gain * weight * tgi_square(w->left); /* a mean square holds what is left of a step, squared */
    for (int i = 0; i < TG_MAX_WHEELS; i++) {
        const tg_real beyond = warp[i] - w->usual[i];
        w->usual[i] += learned * beyond;
        w->slip[i] += weight * soon * (beyond - w->slip[i]);
        square += tgi_square(beyond);
        shown += tgi_square(w->slip[i]);
        for (int32_t a = 0; a < 2; a++) trend[a] += c->trend[a][i] * slip[i];
        pull += c->at_rest[i] * e->belief.x[i];
        w->wheel_slip[i] += fresh * (slips->along[i] - w->wheel_slip[i]);
    }
    w->square += counts * (square * c->share - w->square);
    w->shown += counts * (shown * c->share - w->shown);
    for (int32_t a = 0; a < 2; a++) {
        const tg_real beyond = trend[a] - w->usual_trend[a];
        w->usual_trend[a] += learned * beyond;
        w->trend[a] += weight * soon * (beyond - w->trend[a]);
        w->along_across[a] += counts * (tgi_square(w->trend[a]) - w->along_across[a]);
    }
    w->noise += counts * (noise - w->noise);
    w->level += counts * (tgi_max(tgi_square(tgi_max(w->slipping, e->settings.tuned.least_slip)), square * c->share) - w->level);
    w->pulling += fresh * (pull - w->pulling);
    w->slipping = usual_slip(e, w->slipping);
    w->left = left_by_spin(e);
}

/* After a row's estimate; `fresh`: its weight over the length of unevenness. `flowing`: the row continues the one before; else its adhesions
 * may be anything, and what lasted before stays. */
void tgi_watch_warp(tg_estimator *e, int32_t flowing, tg_real fresh)
{
    tgi_warped *w = &e->warped;
    warp_of_adhesions(e, w->now);
    for (int i = 0; i < TG_MAX_WHEELS && flowing; i++) w->adhesion[i] += fresh * (w->now[i] - w->adhesion[i]);
}

/* How far slips beyond the trends are loads', 0 to 1: a chassis shifts those alone. What wheels meet one by one, soft spots, their own lugs, a tread
 * that yields, slips in passing, is as much along and across, of which hills and turns may add to one. Where the lesser is two thirds of what a
 * pattern beyond the trends has, all may be load; where it is as much, nothing is. A wheel without power is at no such slip. */
static tg_real shifted(const tgi_warped *w, const tgi_constants *c)
{
    const tg_real singly = c->slopes ? (tg_real)c->warps * (w->along_across[0] < w->along_across[1] ? w->along_across[0] : w->along_across[1]) : 0;
    const tg_real part = w->shown > 0 ? TG_SINGLY * (1 - singly / w->shown) : 1;
    return part < 0 ? 0 : part < 1 ? part : 1;
}

/* The part of the adhesions beyond the trends that is not load (n,): a share of what lasts, which may be a rut or a hill; and what slips
 * show. Returns the relative variance of both: that of a guess between the two, and the curve's secant less what was explained, times
 * those slips relative to the wheels' slip in the same rows (at most 1), since a load moves a small slip by little and a large one by
 * much; of both what may be load. */
tg_real tgi_lasting_warp(const tg_estimator *e, tg_real *warp)
{
    const tgi_warped *w = &e->warped;
    const tg_tuned *k = &e->settings.tuned;
    const tg_real excess = tgi_max(w->square - w->noise, 0), inverse = 1 / tgi_max(w->slipping, k->least_slip);
    const tg_real part = shifted(w, &e->constants), share = w->square > 0 ? excess / w->square : 0, explained = part * k->bend * share;
    const tg_real relative = w->level > 0 ? tgi_sqrt(excess / w->level) : 0;
    tg_real lasting = 0, farthest = 0;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) farthest = tgi_max(farthest, tgi_fabs(w->slip[i]));
    const tg_real line = explained * inverse / beyond_line(k, farthest, inverse), slope = line * tgi_max(w->pulling, 0) * w->left;
    for (int i = 0; i < TG_MAX_WHEELS; i++) {
        warp[i] = k->lasting_share * w->adhesion[i] + slope * w->slip[i];
        lasting += tgi_square(w->adhesion[i]) * e->constants.share;
    }
    const tg_real hidden = (part * k->bend_spread - explained) * relative;
    return k->lasting_share * (1 - k->lasting_share) * tgi_relative(e, lasting) + tgi_square(hidden);
}
