/* Is the vehicle about to dig itself in, stuck, or pushed by its tool? Looked at where the ground speed was measured, for a reckoned
 * one follows from the slip last seen. All of it is ours (R); PHYSICS 7 says what a stuck vehicle looks like. */
#include "estimator.h"

#define TG_FAST ((tg_real)0.1)  /* s, low-pass of what is looked at */
#define TG_MIDDLE ((tg_real)0.3) /* s, low-pass that slip falls below as soon as the vehicle recovers */
#define TG_SLOW 1               /* s, low-pass of what it is compared with */
#define TG_BACK 3               /* times as fast the evidence is lost without the signs as it came */
#define TG_GRIP_FAST ((tg_real)0.2)
#define TG_GRIP_MEMORY 5        /* s over which the ground's grip is remembered */
#define TG_LONGEST_LOOK ((tg_real)1.5) /* s between two looks: after more, what was seen is forgotten */
#define TG_SELDOM ((tg_real)0.15) /* s between two looks */
#define TG_STEEPNESS ((tg_real)11.36) /* k of the prototype curve mu = A (1 - exp(-k s)) (PHYSICS 5) */
#define TG_LEAST_GRIP ((tg_real)0.05) /* of 1 - exp(-k s): less slip tells nothing of the grip */
#define TG_GRIP_FLOOR ((tg_real)0.03) /* of mu: keeps the grip's ratio calm where there is little traction */
#define TG_FASTER ((tg_real)1.12) /* rim speed over its own slow mean from which it counts as a change of command */

typedef struct {
    tg_real slip, deviation, adhesion, rim, travel;
} look;

/* Mean over the driven wheels (of none: all), along the travel. */
static look look_at(const tg_estimator *e, const tg_real *o)
{
    const int32_t n = e->settings.machine.wheels;
    look l = {0, 0, 0, 0, 0};
    tg_real count = 0;
    int32_t any = 0;
    for (int32_t i = 0; i < n; i++) any |= e->settings.driven[i];
    for (int32_t i = 0; i < n; i++) {
        if (any && !e->settings.driven[i]) continue;
        const tg_real deviation = o[TG_OUT_SLIP_STD + i];
        l.slip += o[TG_OUT_SLIP + i];
        if (deviation == deviation) l.deviation += deviation;
        l.adhesion += o[TG_OUT_ADHESION + i];
        l.rim += e->settings.rolling_radius[i] * tgi_fabs(o[TG_OUT_WHEEL_SPEED + i]);
        count += 1;
    }
    l.slip /= count;
    l.deviation /= count;
    l.adhesion /= count;
    l.rim /= count;
    l.travel = (tg_real)e->direction * o[TG_OUT_GROUND_SPEED];
    if (l.slip < (tg_real)-0.2) l.slip = (tg_real)-0.2;
    return l;
}

/* SDs of slip to be sure by: where the ground speed comes seldom, no mean over many makes up for its noise. */
static tg_real confidence_at(const tg_watch_settings *s, tg_real since)
{
    return since > TG_SELDOM ? s->confidence * since / TG_SELDOM : s->confidence;
}

/* Low-pass with a plain mean at first. */
static void remember(tg_real *mean, tg_real age, tg_real dt, tg_real tau, tg_real x)
{
    if (tau > age) tau = age;
    if (dt > 0) *mean += dt / (tau + dt) * (x - *mean);
}

static void forget_motion(tgi_watch *w)
{
    w->seen = w->looks = 0;
    w->evidence = w->spinning = w->pushed = 0;
    w->sinking = w->stuck = w->pushing = 0;
}

/* Seconds that something holds, and `back` times as fast back: neither a jolt nor a sample decides. */
static tg_real count_seconds(tg_real seconds, tg_real dt, int32_t holds, tg_real back, tg_real most)
{
    seconds += holds ? dt : -back * dt;
    return seconds < 0 ? 0 : seconds > most ? most : seconds;
}

/* The wheels go on as commanded, slip rises for a while above what it was, and the ground gives less adhesion for it than before: the
 * wheels dig. Slip beyond `high_slip` needs no such comparison. After a hit on a root slip falls again: no sign from then on. */
static int32_t digs(const tg_watch_settings *s, const tgi_watch *w, tg_real doubt, tg_real least_rim)
{
    const tg_real sure = w->slip - doubt, rise = w->slip - w->slow_slip;
    const int32_t steady = w->rim < TG_FASTER * w->slow_rim + (tg_real)0.02 && w->rim > least_rim;
    const int32_t worse = sure > s->slip && w->grip < s->grip * w->grip_before;
    const int32_t rises = rise > s->rise && w->slip > w->middle_slip && sure - w->mean_slip > s->level;
    return steady && rises && (worse || sure > s->high_slip);
}

/* 1 - exp(-k s) of the prototype curve. */
static tg_real curve_at(tg_real slip)
{
    return slip > 0 ? 1 - tgi_exp(-TG_STEEPNESS * slip) : 0;
}

static void track(tgi_watch *w, const look *l, tg_real confidence, tg_real dt)
{
    const tg_real curve = curve_at(l->slip - confidence * l->deviation), middle = curve_at(l->slip);
    if (!w->seen) {
        w->slip = w->middle_slip = w->slow_slip = l->slip;
        w->rim = w->slow_rim = l->rim;
        w->adhesion = l->adhesion;
        w->curve = curve;
    }
    w->seen = 1;
    w->slip += dt / (TG_FAST + dt) * (l->slip - w->slip);
    w->middle_slip += dt / (TG_MIDDLE + dt) * (l->slip - w->middle_slip);
    w->slow_slip += dt / (TG_SLOW + dt) * (l->slip - w->slow_slip);
    w->rim += dt / (TG_FAST + dt) * (l->rim - w->rim);
    w->slow_rim += dt / (TG_SLOW + dt) * (l->rim - w->slow_rim);
    w->adhesion += dt / (TG_GRIP_FAST + dt) * (l->adhesion - w->adhesion);
    w->curve += dt / (TG_GRIP_FAST + dt) * (curve - w->curve);
    remember(&w->mean_slip, w->age, dt, TG_GRIP_MEMORY, l->slip);
    remember(&w->mean_adhesion, w->age, dt, TG_GRIP_MEMORY, l->adhesion);
    remember(&w->mean_curve, w->age, dt, TG_GRIP_MEMORY, middle > TG_LEAST_GRIP ? middle : TG_LEAST_GRIP);
    w->age += dt;
    const tg_real expected = w->mean_curve > 0 ? w->mean_adhesion / w->mean_curve * w->curve : w->adhesion;
    w->grip = w->adhesion + TG_GRIP_FLOOR;
    w->grip_before = (expected > 0 ? expected : 0) + TG_GRIP_FLOOR;
}

static void judge(tg_estimator *e, const look *l, tg_real dt)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    const tg_real least_rim = 3 * e->settings.standstill_speed;
    const int32_t holds = digs(s, w, confidence_at(s, dt) * l->deviation, least_rim) || (w->sinking && w->slip > s->high_slip);
    w->evidence = count_seconds(w->evidence, dt, holds, TG_BACK, 2 * s->duration);
    w->looks = !holds ? 0 : w->looks < 100 ? w->looks + 1 : 100;
    w->sinking = (w->evidence >= s->duration && w->looks >= (int32_t)s->looks) || (w->sinking && w->evidence > 0);

    const int32_t turning = w->rim > least_rim, held_up = turning && l->travel < s->stuck_travel * l->rim;
    w->spinning = held_up ? w->spinning + dt : 0;
    w->stuck = turning && (w->spinning >= s->duration || (w->stuck && l->travel < s->free_travel * l->rim));
    if (w->stuck) { /* too late for a warning, and none while it comes free */
        w->evidence = 0;
        w->sinking = 0;
    }
}

/* What pushes from behind: a bar under pressure, or, without a cell, a resistance that is less than none. */
static void judge_push(tg_estimator *e, const tg_drive *drive, const tg_real *o, tg_real dt)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    const tg_real weight = e->settings.machine.mass * e->settings.machine.gravity;
    tg_real thrust = 0, least = s->push * weight;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) thrust += o[TG_OUT_ADHESION + i] * drive->load[i];
    if (least < 2 * e->settings.noise[TG_DRAWBAR_FORCE]) least = 2 * e->settings.noise[TG_DRAWBAR_FORCE];
    const int32_t bar = e->drawbar.count > 0 && (tg_real)e->direction * drive->calm_drawbar < -least;
    const int32_t unexplained = o[TG_OUT_SOIL_RESISTANCE] + 2 * o[TG_OUT_SOIL_RESISTANCE_STD] < 0;
    w->pushed = count_seconds(w->pushed, dt, (bar || unexplained) && thrust > s->thrust * weight, 2, s->push_duration);
    w->pushing = w->pushed >= s->push_duration || (w->pushing && w->pushed > 0);
}

/* After a row's values were worked out; `moving`: the filter went on with it. */
void tgi_watch_over(tg_estimator *e, const tg_row *row, const tg_drive *drive, int32_t moving, tg_real dt, const tg_real *o)
{
    tgi_watch *w = &e->watch;
    if (e->standing || !e->seen_motion) {
        forget_motion(w);
        return;
    }
    if (!moving) return;
    judge_push(e, drive, o, dt);
    if (row->reckoned || isnan(row->value[TG_GROUND_SPEED]) || isnan(o[TG_OUT_SLIP])) {
        if (w->seen && row->time - w->time > (double)TG_LONGEST_LOOK) forget_motion(w);
        return;
    }
    const look l = look_at(e, o);
    tg_real since = w->seen ? (tg_real)(row->time - w->time) : 0;
    if (since > TG_LONGEST_LOOK) {
        forget_motion(w);
        since = 0;
    }
    track(w, &l, confidence_at(&e->settings.watch, since), since);
    judge(e, &l, since);
    w->time = row->time;
}

int32_t tgi_watched(const tg_estimator *e)
{
    const tgi_watch *w = &e->watch;
    return w->stuck ? TG_EVENT_STUCK : w->sinking ? TG_EVENT_IMMOBILIZATION : w->pushing ? TG_EVENT_PUSH : TG_EVENT_NONE;
}
