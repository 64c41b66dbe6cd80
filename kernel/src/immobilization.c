/* Is the vehicle about to dig itself in, stuck, or pushed by its tool? All of it is ours (R); PHYSICS 7 says what a stuck vehicle
 * looks like. */
#include "estimator.h"

#define TG_LOOK ((tg_real)0.095)      /* s between two looks for the signs of digging; rows in between are averaged */
#define TG_LONGEST_STEP ((tg_real)0.6) /* s that a look counts at most */
#define TG_NO_SCORE ((tg_real)-6)     /* the score is cut to this, and to as much above 0 */
#define TG_HIGH_SLIP 10               /* score per unit of slip above `high_slip` */
#define TG_SILENT ((tg_real)0.55)     /* s without a ground speed after which its slip is no sign by itself */
#define TG_FAST ((tg_real)0.1)        /* s, low-pass of the rim speed */
#define TG_LONGEST_LOOK ((tg_real)1.5) /* s between two measured ground speeds: after more, being stuck is judged anew */

static void add(tgi_view *sum, const tgi_view *l, tg_real weight)
{
    sum->slip += weight * l->slip;
    sum->deviation += weight * l->deviation;
    sum->leading += weight * l->leading;
    sum->trailing += weight * l->trailing;
    sum->adhesion += weight * l->adhesion;
    sum->resistance += weight * l->resistance;
    sum->rim += weight * l->rim;
    sum->travel += weight * l->travel;
}

/* Which end of the machine wheel i is at, along the travel: 1 leading, -1 trailing, 0 neither. */
static int32_t end_of(const tg_estimator *e, int32_t i)
{
    const tg_real lever = (tg_real)e->direction * e->settings.load_transfer[e->settings.wheel_axle[i]];
    return lever > 0 ? 1 : lever < 0 ? -1 : 0;
}

/* Means over the driven wheels (of none: all). */
static tgi_view look_at(const tg_estimator *e, const tg_real *o)
{
    const int32_t n = e->settings.machine.wheels;
    tgi_view l;
    memset(&l, 0, sizeof l);
    tg_real count = 0, ahead = 0, behind = 0;
    int32_t any = 0;
    for (int32_t i = 0; i < n; i++) any |= e->settings.driven[i];
    for (int32_t i = 0; i < n; i++) {
        if (any && !e->settings.driven[i]) continue;
        const tg_real deviation = o[TG_OUT_SLIP_STD + i], adhesion = o[TG_OUT_ADHESION + i];
        const int32_t end = end_of(e, i);
        l.slip += o[TG_OUT_SLIP + i];
        if (deviation == deviation) l.deviation += deviation;
        l.adhesion += adhesion;
        l.rim += e->settings.rolling_radius[i] * o[TG_OUT_WHEEL_SPEED + i];
        count += 1;
        if (end > 0) {
            l.leading += adhesion;
            ahead += 1;
        } else if (end < 0) {
            l.trailing += adhesion;
            behind += 1;
        }
    }
    l.slip /= count;
    l.deviation /= count;
    l.adhesion /= count;
    l.rim = tgi_fabs(l.rim) / count; /* on the spot, wheels turn against each other: that goes nowhere, and is not stuck */
    l.leading = ahead > 0 && behind > 0 ? l.leading / ahead : l.adhesion;
    l.trailing = ahead > 0 && behind > 0 ? l.trailing / behind : l.adhesion;
    l.resistance = o[TG_OUT_SOIL_RESISTANCE];
    l.travel = (tg_real)e->direction * o[TG_OUT_GROUND_SPEED];
    if (l.slip < (tg_real)-0.2) l.slip = (tg_real)-0.2;
    return l;
}

static void forget_motion(tgi_watch *w)
{
    tgi_signs_rest(&w->signs);
    memset(&w->sum, 0, sizeof w->sum);
    w->rows = w->watching = w->turning = 0;
    w->score = TG_NO_SCORE;
    w->seen_time = -1e9;
    w->spinning = 0;
    w->sinking = w->stuck = 0;
}

/* Seconds that something holds, and `back` times as fast back: neither a jolt nor a sample decides. */
static tg_real count_seconds(tg_real seconds, tg_real dt, int32_t holds, tg_real back, tg_real most)
{
    seconds += holds ? dt : -back * dt;
    return seconds < 0 ? 0 : seconds > most ? most : seconds;
}

static tg_real score_of(const tg_real *signs)
{
    const tg_real score = tg_digging_score(signs);
    return score < TG_NO_SCORE ? TG_NO_SCORE : score > -TG_NO_SCORE ? -TG_NO_SCORE : score;
}

/* What slip beyond `high_slip`, less some of its SDs, adds at once, unless the ground speed is only reckoned. */
static tg_real score_of_high_slip(const tg_watch_settings *s, tg_real slip, tg_real deviation, tg_real silence)
{
    const tg_real high = slip - s->confidence * deviation - s->high_slip;
    return high > 0 && silence < TG_SILENT ? TG_HIGH_SLIP * high : 0;
}

static void watch_digging(tg_estimator *e, const tg_row *row, const tgi_view *now)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    add(&w->sum, now, 1);
    w->rows++;
    const tg_real since = w->watching ? (tg_real)(row->time - w->look_time) : 0;
    if (w->watching && since < TG_LOOK) return;
    tgi_view l;
    memset(&l, 0, sizeof l);
    add(&l, &w->sum, 1 / (tg_real)w->rows);
    memset(&w->sum, 0, sizeof w->sum);
    w->rows = 0;
    w->watching = 1;
    w->look_time = row->time;
    tgi_signs_take(&w->signs, &l, since);
    if (w->stuck || l.rim < 3 * e->settings.standstill_speed) { /* too late for a warning, or nowhere to go */
        w->score = TG_NO_SCORE;
        w->sinking = 0;
        return;
    }
    const tg_real step = since < TG_LONGEST_STEP ? since : TG_LONGEST_STEP;
    tg_real signs[TG_SIGNS];
    tgi_signs_features(&w->signs, signs);
    w->score += step / (s->memory + step) * (score_of(signs) - w->score);
    const tg_real score = w->score + score_of_high_slip(s, signs[TG_SIGN_SLIP], l.deviation, (tg_real)(row->time - w->seen_time));
    const int32_t begins = score > s->warn && w->spinning <= 0; /* of a vehicle that stands already nothing is foretold */
    w->sinking = begins || (w->sinking && score > s->warn - s->release);
}

/* Where the ground speed was measured, for a reckoned one follows from the slip last seen. */
static void watch_stuck(tg_estimator *e, const tg_row *row, const tgi_view *l)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    tg_real dt = w->turning ? (tg_real)(row->time - w->stuck_time) : 0;
    if (dt > TG_LONGEST_LOOK) {
        dt = 0;
        w->turning = w->stuck = 0;
        w->spinning = 0;
    }
    w->rim = w->turning ? w->rim + dt / (TG_FAST + dt) * (l->rim - w->rim) : l->rim;
    w->turning = 1;
    w->stuck_time = row->time;
    const int32_t turning = w->rim > 3 * e->settings.standstill_speed, held_up = turning && l->travel < s->stuck_travel * l->rim;
    w->spinning = held_up ? w->spinning + dt : 0;
    w->stuck = turning && (w->spinning >= s->stuck_duration || (w->stuck && l->travel < s->free_travel * l->rim));
    if (w->stuck) w->sinking = 0;
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

/* After a row's values were worked out; `moving`: the filter went on with it, `anew`: from a new start. */
void tgi_watch_over(tg_estimator *e, const tg_row *row, const tg_drive *drive, int32_t moving, int32_t anew, tg_real dt, const tg_real *o)
{
    tgi_watch *w = &e->watch;
    const int32_t rests = e->standing || !e->seen_motion;
    if (rests || !moving || anew || isnan(o[TG_OUT_SLIP])) forget_motion(w);
    if (rests) {
        w->pushed = 0;
        w->pushing = 0;
    }
    if (rests || !moving) return;
    judge_push(e, drive, o, dt);
    if (isnan(o[TG_OUT_SLIP])) return;
    const tgi_view l = look_at(e, o);
    if (!row->reckoned && !isnan(row->value[TG_GROUND_SPEED])) {
        w->seen_time = row->time;
        watch_stuck(e, row, &l);
    }
    watch_digging(e, row, &l);
}

int32_t tgi_watched(const tg_estimator *e)
{
    const tgi_watch *w = &e->watch;
    return w->stuck ? TG_EVENT_STUCK : w->sinking ? TG_EVENT_IMMOBILIZATION : w->pushing ? TG_EVENT_PUSH : TG_EVENT_NONE;
}
