/* The signs that the wheels dig themselves in (R): what changed within the vehicle's own unit of time, `pace` square roots of its length
 * over gravity, and against what is usual for it. Each sign is in points: its change over the change that counts as one point
 * (tg_watch_settings), which grows by what is not sure of the signal; the points of a row are added, and their sum, low-passed, is the
 * score that warns. Only rows whose ground speed was measured count: between them slip follows from the model. */
#include "estimator.h"

#define TG_FLOOR ((tg_real)0.1) /* adhesion that is added where two small ones are compared */

/* Exact also where intervals are longer than tau. */
static tg_real low_pass(tg_real mean, tg_real dt, tg_real tau, tg_real x)
{
    return dt > 0 ? mean - tgi_expm1(-dt / tau) * (x - mean) : mean;
}

static tg_real bounded(tg_real x, tg_real least, tg_real most)
{
    return x < least ? least : x > most ? most : x;
}

/* The unit of time, s. The length is the wheelbase; of several axles sqrt(2) times the root of their summed squared distances from the
 * middle, which is that of two; of one axle three wheel radii. */
tg_real tgi_pace(const tg_settings *s)
{
    tg_real square = 0, length = 3 * s->machine.radius[0];
    for (int32_t k = 0; k < s->axles; k++) square += tgi_square(s->load_transfer[k]);
    if (s->axles > 1 && square > 0) length = tgi_sqrt(2 / square);
    return s->watch.pace * tgi_sqrt(length / s->machine.gravity);
}

/* The change that counts as one point, where the signal has an SD: noise alone seldom makes one. */
static tg_real one_point(tg_real change, tg_real deviation) { return tgi_sqrt(tgi_square(change) + tgi_square(deviation)); }

/* Balance: of the leading wheels' adhesion against the trailing ones', within -1 and 1. A resistance that is not known says nothing. */
static void signals_of(const tg_estimator *e, const tgi_view *l, tg_real *now)
{
    const tg_real still = e->settings.standstill_speed, ahead = l->leading > 0 ? l->leading : 0, behind = l->trailing > 0 ? l->trailing : 0;
    now[TGI_SLIP] = l->slip;
    now[TGI_DEVIATION] = l->deviation;
    const tg_real both = ahead + behind + TG_FLOOR;
    now[TGI_BALANCE] = (ahead - behind) / both;
    now[TGI_BALANCE_DEVIATION] = l->adhesion_deviation * tgi_sqrt(tgi_square(2 * behind + TG_FLOOR) + tgi_square(2 * ahead + TG_FLOOR)) / tgi_square(both);
    now[TGI_RESISTANCE] = isnan(l->resistance) ? 0 : l->resistance;
    now[TGI_RESISTANCE_DEVIATION] = isnan(l->resistance_deviation) ? 0 : l->resistance_deviation;
    now[TGI_RIM] = tgi_log(l->rim + still);
    now[TGI_TRAVEL] = tgi_log((l->travel > 0 ? l->travel : 0) + still);
}

/* A view is nothing but reals. */
static void add(tgi_view *sum, const tgi_view *l, tg_real share)
{
    tg_real *const to = (tg_real *)sum;
    const tg_real *const from = (const tg_real *)l;
    for (size_t k = 0; k < sizeof *sum / sizeof *to; k++) to[k] += share * from[k];
}

/* Where a machine works at much slip, that is soon usual, and stays so over its turns and ways between. */
static void learn_usual(const tg_watch_settings *s, tg_real pace, tg_real since, tgi_digging *d)
{
    const tg_real slip = bounded(d->now[TGI_SLIP], -1, s->high_slip);
    const tg_real usual[2] = {slip, d->now[TGI_BALANCE]};
    const tg_real memory[2] = {slip > d->usual[0] ? s->soon : s->usual, s->usual};
    for (int32_t k = 0; k < 2; k++) d->usual[k] = d->age > 0 ? low_pass(d->usual[k], since, bounded(d->age, 0, memory[k] * pace), usual[k]) : usual[k];
}

/* Add a row to the interval; returns whether that ended one, whose signals then are in the means.
 * `since` becomes the time between the ends of two. */
static int32_t add_row(tg_estimator *e, double time, const tgi_view *row, tg_real *since)
{
    tgi_digging *d = &e->watch.digging;
    const tg_real pace = e->constants.pace;
    add(&d->sum, row, 1);
    d->rows += 1;
    *since = d->moving ? (tg_real)(time - d->time) : 0;
    if (d->moving && *since < (tg_real)0.95 * TG_SHORT * pace) return 0;
    tg_real now[TGI_SIGNALS];
    tgi_view mean;
    memset(&mean, 0, sizeof mean);
    add(&mean, &d->sum, 1 / d->rows);
    signals_of(e, &mean, now);
    for (int32_t k = 0; k < TGI_SIGNALS; k++) {
        d->now[k] = d->moving ? low_pass(d->now[k], *since, TG_SHORT * pace, now[k]) : now[k];
        d->mean[k] = d->moving ? low_pass(d->mean[k], *since, pace, now[k]) : now[k];
    }
    learn_usual(&e->settings.watch, pace, *since, d);
    memset(&d->sum, 0, sizeof d->sum);
    d->rows = 0;
    d->age += *since;
    d->moving = 1;
    d->time = time;
    return 1;
}

/* A rest or a gap: what the motion was is forgotten, what is usual is kept. */
void tgi_digging_rest(tgi_digging *d)
{
    memset(&d->sum, 0, sizeof d->sum);
    memset(d->points, 0, sizeof d->points);
    d->moving = d->slips = 0;
    d->rows = d->score = 0;
}

/* After a row whose ground speed was measured; returns whether it ended an interval. */
int32_t tgi_digging_update(tg_estimator *e, double time, const tgi_view *row)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_digging *d = &e->watch.digging;
    const tg_real *const now = d->now, *const mean = d->mean;
    tg_real since;
    if (!add_row(e, time, row, &since)) return 0;
    const tg_real slip = now[TGI_SLIP], deviation = now[TGI_DEVIATION], sure = slip - deviation, rise = slip - mean[TGI_SLIP];
    const tg_real rim = now[TGI_RIM] - mean[TGI_RIM], gain = now[TGI_TRAVEL] - mean[TGI_TRAVEL];
    /* Rims that gain while the vehicle loses speed spin, by no command. They slow by command and in hits, yet also of a weak drive that
     * digs in. Rims are known well where slip is not. */
    const tg_real command = tgi_max(rim + (gain < 0 ? gain : 0), -rim / 2) / s->command;
    const tg_real high = s->high_slip > 0 ? (slip - s->high_slip) / one_point(s->high_slip / s->most, deviation) : 0;
    const tg_real leading = d->usual[1] - now[TGI_BALANCE], resistance = now[TGI_RESISTANCE] - mean[TGI_RESISTANCE];
    /* No rise is surer than what it rises from: at first that is a guess. */
    const tg_real unsure = tgi_max(now[TGI_RESISTANCE_DEVIATION], mean[TGI_RESISTANCE_DEVIATION]);
    d->points[TG_SIGN_RISE] = bounded(rise / one_point(s->change, deviation), -s->most, s->most);
    d->points[TG_SIGN_HIGH] = bounded(high, 0, 2 * s->most);
    d->points[TG_SIGN_LEADING] = bounded(leading / one_point(s->change, now[TGI_BALANCE_DEVIATION]), -s->most, s->most);
    d->points[TG_SIGN_RESISTANCE] = bounded(resistance / one_point(s->resistance, unsure), -s->most, s->most);
    d->points[TG_SIGN_COMMAND] = -bounded(command, 0, 2 * s->most);
    /* A mean keeps no more than makes all points: else it holds the rims and slips of a start for three units of time. */
    const tg_real full = 2 * s->most * s->command, below = slip + s->most * one_point(s->change, deviation);
    d->mean[TGI_RIM] = tgi_max(mean[TGI_RIM], now[TGI_RIM] - full);
    d->mean[TGI_TRAVEL] = tgi_max(mean[TGI_TRAVEL], now[TGI_TRAVEL] - full);
    if (mean[TGI_SLIP] > below) d->mean[TGI_SLIP] = below;
    tg_real sum = 0;
    for (int32_t k = 0; k < TG_SIGNS; k++) sum += d->points[k];
    d->score = low_pass(d->score, since < e->constants.pace ? since : e->constants.pace, s->memory * e->constants.pace, sum);
    d->slips = sure + rise > tgi_max(s->ahead, s->beyond * d->usual[0]);
    return 1;
}

/* The signs as a row of outputs has them. */
void tgi_digging_report(const tgi_digging *d, tg_real *o)
{
    o[TG_OUT_WARNING] = d->score;
    o[TG_OUT_USUAL_SLIP] = d->usual[0];
    for (int32_t k = 0; k < TG_SIGNS; k++) o[TG_OUT_SIGN + k] = d->points[k];
}
