/* The adhesion curve while driving (paper, Fig. 2): from single pairs of slip and adhesion the scale a of mu = a g(s), g the paper's
 * prototype, as a scalar Kalman filter. One pair determines the whole curve, as far as the soil has that form. (R): noise, forgetting and
 * the detection of new ground are ours. */
#include "curve.h"

/* The slips that the curve is fitted to (paper: 5 % to 60 %). Below, g is near 0 and a pair does not determine a. The lower bound applies to
 * the mean of g: applied to single slips it would select those whose error is upward. */
#define TG_LEAST_HEIGHT ((tg_real)0.2075) /* g(0.05) */
#define TG_LARGEST_SLIP ((tg_real)0.6)

#define TG_PRIOR ((tg_real)0.85)          /* middle of the paper's five soils */
#define TG_PRIOR_VARIANCE ((tg_real)0.25) /* 0.5 squared: 0 to 1.85 hold them all */
#define TG_SCATTER ((tg_real)0.08)        /* SD of adhesion about a soil's curve, as a share of it */
#define TG_LEAST_SCATTER ((tg_real)0.01)
#define TG_MEMORY ((tg_real)0.5)          /* s, over which pairs are averaged and their errors are alike */
#define TG_WANDER ((tg_real)0.004)        /* variance a gains a metre: 0.06 after one, 0.2 after ten */
#define TG_SURPRISE_MEMORY ((tg_real)1)   /* s */
#define TG_SURPRISE ((tg_real)4)          /* mean square residual, in variances, that only another ground makes */
#define TG_LARGEST_SURPRISE ((tg_real)25)

tg_curve tg_curve_unknown(void)
{
    const tg_curve c = {TG_PRIOR, TG_PRIOR_VARIANCE, 0, 0, 0, 0, -1};
    return c;
}

tg_real tg_curve_std(const tg_curve *c)
{
    return c ? tgi_sqrt(c->variance + c->constant * c->constant) : (tg_real)NAN;
}

/* e^(alpha_1 s) by its series, to 1e-12: alpha_1 s is at most 0.006. */
static tg_real slow(tg_real s)
{
    const tg_real x = TG_CURVE_SLOW * s;
    return 1 + x * (1 + x * ((tg_real)0.5 + x * ((tg_real)(1.0 / 6) + x * (tg_real)(1.0 / 24))));
}

/* g(s), paper eq. 8 with a = 1; odd in slip. */
static tg_real height_at(tg_real slip)
{
    const tg_real s = tgi_fabs(slip), g = 1 - TG_CURVE_SHARE * slow(s) - (1 - TG_CURVE_SHARE) * tgi_exp(TG_CURVE_RISE * s);
    return slip < 0 ? -g : g;
}

/* Sensitivity of g to an error of slip: its slope, or if larger, the mean slope down to two SDs less slip. At high slip g is flat, and by
 * its slope slip hardly matters; but a slip of 0.3 +- 0.13 may be near 0, as at a start. */
static tg_real sensitivity(tg_real slip, tg_real height, tg_real slope, tg_real variance)
{
    tg_real reach = 2 * tgi_sqrt(variance);
    if (!(reach > (tg_real)0.01)) return slope; /* g is straight enough, and division by nothing is none */
    if (reach > 1) reach = 1;
    const tg_real mean = (height - height_at(slip - reach)) / reach;
    return mean > slope ? mean : slope;
}

/* A pair relative to the prototype, odd in slip. `is_usable` is 0 where the pair determines nothing. */
tgi_observation tgi_observe(const tg_pair *p)
{
    tgi_observation result;
    const tg_real s = tgi_fabs(p->slip), sum = p->adhesion + p->adhesion_variance + p->slip_variance + p->adhesion_constant;
    memset(&result, 0, sizeof result);
    if (!(s <= TG_LARGEST_SLIP) || isnan(sum) || isinf(sum)) return result;
    const tg_real first = TG_CURVE_SHARE * slow(s), second = (1 - TG_CURVE_SHARE) * tgi_exp(TG_CURVE_RISE * s), g = 1 - first - second;
    result.is_usable = 1;
    result.adhesion = p->adhesion;
    result.height = p->slip < 0 ? -g : g;
    result.slope = sensitivity(s, g, -TG_CURVE_SLOW * first - TG_CURVE_RISE * second, p->slip_variance);
    result.variance = p->adhesion_variance;
    result.slip_variance = p->slip_variance;
    result.constant = p->adhesion_constant * p->adhesion_constant;
    result.radius = p->radius_error;
    result.travel = 1 - s;
    return result;
}

/* The residual mu - a g(s): its variance (a itself is uncertain: `size` is the root of E[a^2]), and by how much one SD of all constants
 * moves it. A radius error e too much lowers mu by mu e and raises slip by (1 - s) e: both lower the residual. */
typedef struct {
    tg_real adhesion, height, variance, constant;
} tgi_measurement;

static tgi_measurement measure(const tgi_observation *k, tg_real a, tg_real size)
{
    const tg_real slope = size * k->slope, radius = (tgi_fabs(k->adhesion) + tgi_fabs(slope) * k->travel) * k->radius;
    const tg_real scatter = TG_SCATTER * a * k->height;
    const tg_real variance = k->variance + slope * slope * k->slip_variance + scatter * scatter + TG_LEAST_SCATTER * TG_LEAST_SCATTER;
    const tgi_measurement m = {k->adhesion, k->height, variance, tgi_sqrt(k->constant + radius * radius)};
    return m;
}

/* The mean of the wheels by `share`; their errors are assumed equal, so no number of wheels reduces them. */
static int32_t mean_of(const tgi_observation *observed, const tg_real *share, int32_t pairs, const tg_curve *c, tgi_measurement *mean)
{
    const tg_real size = tgi_sqrt(c->a * c->a + c->variance);
    tg_real sum = 0, sd = 0;
    memset(mean, 0, sizeof *mean);
    for (int32_t i = 0; i < pairs; i++) {
        if (!observed[i].is_usable || !(share[i] > 0)) continue;
        const tgi_measurement m = measure(&observed[i], c->a, size);
        sum += share[i];
        mean->adhesion += share[i] * m.adhesion;
        mean->height += share[i] * m.height;
        sd += share[i] * tgi_sqrt(m.variance);
        mean->constant += share[i] * m.constant;
    }
    if (!(sum > 0)) return 0;
    const tg_real inverse = 1 / sum;
    mean->adhesion *= inverse;
    mean->height *= inverse;
    mean->constant *= inverse;
    mean->variance = sd * inverse * sd * inverse;
    return 1;
}

static void wander(tg_curve *c, tg_real distance)
{
    c->variance += TG_WANDER * distance;
    if (c->variance > TG_PRIOR_VARIANCE) c->variance = TG_PRIOR_VARIANCE; /* beyond it a is simply unknown */
}

/* The mean square of residuals in their variances; 1 on one ground. */
static int32_t is_new_ground(tg_curve *c, tg_real square, tg_real dt)
{
    if (square > TG_LARGEST_SURPRISE) square = TG_LARGEST_SURPRISE;
    c->surprise += dt / (TG_SURPRISE_MEMORY + dt) * (square - c->surprise);
    return c->surprise > TG_SURPRISE;
}

/* Means over about TG_MEMORY: the product of a pair's errors in slip and in g(s) would pull a down. */
static void average(tg_curve *c, const tgi_measurement *m, tg_real dt)
{
    const tg_real elapsed = c->silence + dt, gain = c->silence < 0 ? 1 : elapsed / (TG_MEMORY + elapsed);
    c->adhesion += gain * (m->adhesion - c->adhesion);
    c->height += gain * (m->height - c->height);
    c->silence = 0;
}

static void start_anew(tg_curve *c, const tgi_measurement *m)
{
    c->variance = TG_PRIOR_VARIANCE;
    c->constant = 0;
    c->surprise = 0;
    c->adhesion = m->adhesion;
    c->height = m->height;
}

/* A row counts as the share dt/TG_MEMORY of an independent pair. The constants' column uses the same gain (Schmidt-Kalman): no
 * number of pairs reduces it. */
static void learn_pair(tg_curve *c, const tgi_measurement *m, tg_real dt)
{
    average(c, m, dt);
    if (!(tgi_fabs(c->height) >= TG_LEAST_HEIGHT)) return;
    tg_real residual = c->adhesion - c->a * c->height;
    const tg_real expected = c->height * c->height * c->variance + m->variance + m->constant * m->constant;
    if (is_new_ground(c, residual * residual / expected, dt)) {
        start_anew(c, m);
        residual = c->adhesion - c->a * c->height;
    }
    const tg_real r = dt < TG_MEMORY ? m->variance * TG_MEMORY / dt : m->variance, h = c->height;
    const tg_real gain = c->variance * h / (h * h * c->variance + r), keep = 1 - gain * h;
    c->a += gain * residual;
    c->variance *= keep;
    c->constant = keep * c->constant + tgi_fabs(gain) * m->constant;
}

void tgi_curve_learn(tg_curve *c, tg_real dt, tg_real distance, int32_t pairs, const tgi_observation *observed, const tg_real *share)
{
    tgi_measurement m;
    wander(c, distance);
    if (dt > 0 && mean_of(observed, share, pairs, c, &m)) learn_pair(c, &m, dt);
    else if (c->silence >= 0) c->silence += dt;
}

tg_status tg_curve_update(tg_curve *c, tg_real dt, tg_real distance, int32_t pairs, const tg_pair *pair, const tg_real *share)
{
    tgi_observation observed[TG_MAX_WHEELS];
    if (!c || pairs < 0 || pairs > TG_MAX_WHEELS || (pairs > 0 && (!pair || !share))) return TG_BAD_ARGUMENT;
    if (isnan(dt) || isinf(dt) || isnan(distance) || isinf(distance)) return TG_NOT_FINITE;
    if (dt < 0) return TG_TIME_REVERSED;
    for (int32_t i = 0; i < pairs; i++) {
        if (isinf(share[i]) || isinf(pair[i].adhesion) || isinf(pair[i].slip) || isinf(pair[i].adhesion_variance) || isinf(pair[i].slip_variance) ||
            isinf(pair[i].adhesion_constant) || isinf(pair[i].radius_error))
            return TG_NOT_FINITE;
        if (!(share[i] > 0)) return TG_NOT_POSITIVE;
        if (pair[i].adhesion_variance < 0 || pair[i].slip_variance < 0 || pair[i].radius_error < 0) return TG_NOT_POSITIVE;
        observed[i] = tgi_observe(&pair[i]);
    }
    tgi_curve_learn(c, dt, distance < 0 ? -distance : distance, pairs, observed, share);
    return TG_OK;
}
