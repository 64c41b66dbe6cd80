/* Is the vehicle about to dig itself in, stuck, or pushed by its tool? All of it is ours (R); physics.md 7 says what a stuck vehicle
 * looks like. */
#include "estimator.h"

#define TG_CALM ((tg_real)0.1)         /* s, low-pass of the rim speed by which a vehicle is called stuck */
#define TG_HALF_TURN ((tg_real)3.14)   /* wheel radii: rims that went less since the vehicle stood are a start */
#define TG_SURE 2                      /* SDs of the ground speed */
#define TG_NEAREST ((tg_real)0.51)     /* of an interval: to the nearest sample, and where two are as near (5 Hz), to the earlier */
#define TG_LONGEST_LOOK ((tg_real)1.5) /* s between two measured ground speeds: after more, being stuck is judged anew */

/* Which end of the machine wheel i is at, along the travel: 1 leading, -1 trailing, 0 neither. */
static int32_t end_of(const tg_estimator *e, int32_t i)
{
    const tg_real lever = (tg_real)e->direction * e->settings.load_transfer[e->settings.wheel_axle[i]];
    return lever > 0 ? 1 : lever < 0 ? -1 : 0;
}

typedef struct { /* the worst slip (by what is sure of it), its SD, and the fastest rim of a side's driven wheels */
    tg_real slip, deviation, rim;
    int32_t count;
} side_view;

static void add_wheel(side_view *side, tg_real slip, tg_real deviation, tg_real rim)
{
    if (isnan(deviation)) deviation = 0;
    if (!side->count || slip - deviation > side->slip - side->deviation) {
        side->slip = slip;
        side->deviation = deviation;
    }
    if (!side->count || tgi_fabs(rim) > tgi_fabs(side->rim)) side->rim = rim;
    side->count++;
}

/* An SD without what the ground speed's delay makes of it, what the filter has not followed of it yet, and a `turn` that no sensor shows: the
 * first two grow as a vehicle digs in, and the warning is not to wait for that, nor to call a vehicle slow for it; a turn's sides cancel.
 * Relative to the larger speed, where a wheel slips against the travel, too: there slip itself changes less with the ground speed. */
static tg_real in_time(tg_real deviation, const tgi_scene *scene, tg_real turn, tg_real speed, tg_real rim)
{
    const tg_real relative = (tgi_square(deviation) - turn) * tgi_square(speed / rim);
    return tgi_sqrt(tgi_max(relative - (scene->late + scene->disputed + scene->astray) / tgi_square(speed), 0));
}

/* Slip by the newest measured ground speed, of an estimate by torques: that believes forces, too, and is late where slip runs away. The
 * sensor's noise, averaged over what the watch averages, is then at least the SD. An outlier is no reading. */
static void see_newest(const tg_estimator *e, const tg_row *row, tgi_view *l)
{
    const tg_real rim = tgi_max(l->fastest, e->settings.standstill_speed), pace = TG_SHORT * e->constants.pace, interval = e->ground.interval;
    const tg_real variance = (e->constants.variance[TG_GROUND_SPEED] + row->doubt[TG_GROUND_SPEED] + row->loud) / tgi_square(rim);
    const tg_real beyond = (l->travel - (tg_real)e->direction * row->value[TG_GROUND_SPEED]) / rim;
    if (tgi_weight(e->settings.tuning.huber, beyond, tgi_square(l->deviation) + variance) < 1) return;
    l->slip += beyond;
    if (l->slip > 1) l->slip = 1;
    l->deviation = tgi_max(l->deviation, tgi_sqrt(variance * (interval < pace ? interval / pace : 1)));
}

/* What the powered wheels do (of none: all). Slip and fastest rim are the worst wheel's of each side, their mean: of a diagonal that spins
 * while the other holds they are the spinning one's, in a turn the sides cancel. */
static tgi_view view_of(const tg_estimator *e, const tg_row *row, int32_t measured, const tg_real *o)
{
    const tg_settings *s = &e->settings;
    tgi_view l;
    side_view side[2];
    memset(&l, 0, sizeof l);
    memset(side, 0, sizeof side);
    tg_real count = 0, ahead = 0, behind = 0, adhesion = 0, back = 0;
    for (int32_t i = 0; i < s->machine.wheels; i++) {
        if (!e->constants.watched[i]) continue;
        const int32_t end = end_of(e, i), where = e->constants.side[i];
        const tg_real rim = s->rolling_radius[i] * o[TG_OUT_WHEEL_SPEED + i], mu = o[TG_OUT_ADHESION + i];
        const tg_real size = tgi_max(tgi_fabs(rim), s->standstill_speed), larger = tgi_max(size, tgi_fabs(o[TG_OUT_GROUND_SPEED]));
        const tg_real deviation = in_time(o[TG_OUT_SLIP_STD + i], &e->scene, e->scene.turn[i], larger, size);
        if (where <= 0) add_wheel(&side[0], o[TG_OUT_SLIP + i], deviation, rim);
        if (where >= 0) add_wheel(&side[1], o[TG_OUT_SLIP + i], deviation, rim);
        l.rim += rim;
        back = tgi_max(back, -(tg_real)e->direction * rim);
        adhesion += mu;
        l.adhesion_deviation += tgi_square(o[TG_OUT_ADHESION_STD + i]) - e->scene.sides[i];
        l.leading += end > 0 ? mu : 0;
        l.trailing += end < 0 ? mu : 0;
        ahead += end > 0;
        behind += end < 0;
        count++;
    }
    const tg_real sides = (tg_real)((side[0].count > 0) + (side[1].count > 0));
    l.slip = (side[0].slip + side[1].slip) / sides;
    l.deviation = (side[0].deviation + side[1].deviation) / sides;
    /* A turn, on the spot too, steering and a joint that bends turn a wheel as far back as another on. */
    l.fastest = tgi_max(tgi_fabs(side[0].rim + side[1].rim) / sides - back, 0);
    l.rim = tgi_max(tgi_fabs(l.rim) / count - back, 0);
    l.leading = ahead > 0 && behind > 0 ? l.leading / ahead : adhesion / count;
    l.trailing = ahead > 0 && behind > 0 ? l.trailing / behind : adhesion / count;
    l.adhesion_deviation = tgi_sqrt(2 * l.adhesion_deviation) / count;
    /* Of a rise: what lasts (gains, a pull, hills) is in none, and a filter's lag shows less of it. What soil does within metres is no
     * error of its resistance, but no digging either. */
    l.resistance_deviation = tgi_sqrt(TG_NOISE_SHARE * e->belief.P[s->machine.wheels * (tgi_stride(s->machine.wheels) + 1)] + e->roughness.wander);
    l.resistance = o[TG_OUT_SOIL_RESISTANCE];
    if (e->settings.method == TG_SPEEDS) l.leading = l.trailing = l.adhesion_deviation = 0; /* no torque, no adhesion: slip and speeds speak alone */
    l.travel = (tg_real)e->direction * o[TG_OUT_GROUND_SPEED];
    l.travel_deviation = in_time(o[TG_OUT_GROUND_SPEED_STD], &e->scene, 0, 1, 1);
    if (measured && e->settings.method != TG_SPEEDS) see_newest(e, row, &l);
    if (l.slip < (tg_real)-0.2) l.slip = (tg_real)-0.2;
    return l;
}

static void forget_motion(tgi_watch *w)
{
    tgi_digging_rest(&w->digging);
    w->turning = 0;
    w->spinning = w->turned = 0;
    w->sinking = w->stuck = w->held = 0;
}

/* Seconds that something holds, and `back` times as fast back: neither a shock nor a sample decides. */
static tg_real count_seconds(tg_real seconds, tg_real dt, int32_t holds, tg_real back, tg_real most)
{
    seconds += holds ? dt : -back * dt;
    return seconds < 0 ? 0 : seconds > most ? most : seconds;
}

/* Warn where the score is high and slip surely rises far beyond its usual; go on until the score is half of that. Of rims that hardly
 * turn, or against each other, no warning is given. */
static void watch_digging(tg_estimator *e, const tg_row *row, const tgi_view *l, int32_t measured)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    if (l->rim < 3 * e->settings.standstill_speed) {
        tgi_digging_rest(&w->digging);
        w->sinking = 0;
        return;
    }
    if (!measured || !tgi_digging_update(e, row->time, l)) return;
    const int32_t begins = w->digging.score > s->warn && w->digging.slips && !w->held; /* what stands is stuck, no warning */
    w->sinking = !w->stuck && (begins || (w->sinking && 2 * w->digging.score > s->warn));
}

/* Where the ground speed was measured, for a reckoned one follows from the slip last seen. Slower than the standstill speed is standing.
 * Time counts from when the vehicle may stand, for an estimate comes after the fact; stuck is what surely does not go freely. What surely
 * goes against its rims slides, or still goes the way it came: it does not stand. Of a vehicle that was warned of it suffices that it may
 * stand; else the estimate itself says so, for a start is as slow. Of a speed that leaps the next sample tells. */
static void watch_stuck(tg_estimator *e, const tg_row *row, const tgi_view *l)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    const tg_real still = e->settings.standstill_speed;
    tg_real dt = w->turning ? (tg_real)(row->time - w->stuck_time) : 0;
    if (dt > TG_LONGEST_LOOK) {
        dt = 0;
        w->turning = w->stuck = 0;
        w->spinning = 0;
    }
    w->rim = w->turning ? w->rim - tgi_expm1(-dt / TG_CALM) * (l->fastest - w->rim) : l->fastest;
    w->turning = 1;
    w->stuck_time = row->time;
    w->turned += dt * l->fastest;
    const tg_real hardly = tgi_max(s->stuck_travel * l->fastest, still), freely = s->free_travel * l->fastest, unsure = TG_SURE * l->travel_deviation;
    const int32_t turning = w->rim > 3 * still && l->fastest > 3 * still, begun = w->turned > TG_HALF_TURN * e->constants.mean_radius;
    const int32_t may_stand = tgi_fabs(l->travel) - unsure < hardly;
    if (may_stand && w->rim < still) w->turned = 0; /* it rests, whatever its wheels do against each other */
    w->spinning = turning ? count_seconds(w->spinning, dt, may_stand, 1, s->stuck_duration) : 0;
    w->held = turning && may_stand && (w->sinking || l->travel < hardly) && tgi_max(l->travel, 0) + unsure < freely;
    const int32_t long_enough = w->spinning + TG_NEAREST * dt >= s->stuck_duration;
    w->stuck = turning && ((w->held && long_enough && begun) || (w->stuck && tgi_fabs(l->travel) < freely));
    if (w->stuck) w->sinking = 0;
}

/* What pushes from behind: a bar under pressure, or, without a cell, a resistance that is less than none. */
static void judge_push(tg_estimator *e, const tg_drive *drive, const tg_real *o, tg_real dt)
{
    const tg_watch_settings *s = &e->settings.watch;
    tgi_watch *w = &e->watch;
    const tg_real weight = drive->mass * e->settings.machine.gravity;
    tg_real thrust = 0, least = s->push * weight;
    for (int32_t i = 0; i < e->settings.machine.wheels; i++) thrust += o[TG_OUT_ADHESION + i] * drive->load[i];
    const tg_real zero = e->settings.uncertainty.drawbar_offset;
    least = tgi_max(least, 2 * tgi_sqrt(tgi_square(e->settings.noise[TG_DRAWBAR_FORCE]) + tgi_square(zero)));
    const int32_t bar = e->drawbar.count > 0 && (tg_real)e->direction * drive->calm_drawbar < -least;
    const int32_t unexplained = o[TG_OUT_SOIL_RESISTANCE] + 2 * o[TG_OUT_SOIL_RESISTANCE_STD] < 0;
    w->pushed = count_seconds(w->pushed, dt, (bar || unexplained) && thrust > s->thrust * weight, 2, s->push_duration);
    w->pushing = w->pushed >= s->push_duration || (w->pushing && w->pushed > 0);
}

/* After a row's values were worked out; `moving`: the filter went on with it, `anew`: from a new start. Without torques there is no
 * `drive` and no push. */
void tgi_watch_over(tg_estimator *e, const tg_row *row, const tg_drive *drive, int32_t moving, int32_t anew, tg_real dt, tg_real *o)
{
    tgi_watch *w = &e->watch;
    const int32_t rests = e->standing || !e->seen_motion, slips = !isnan(o[TG_OUT_SLIP]);
    if (rests || !moving || anew || !slips) forget_motion(w);
    if (rests) {
        w->pushed = 0;
        w->pushing = 0;
    }
    if (!rests && moving && drive) judge_push(e, drive, o, dt);
    if (!rests && moving && slips) {
        const int32_t measured = !row->reckoned && !isnan(row->value[TG_GROUND_SPEED]);
        const tgi_view l = view_of(e, row, measured, o);
        if (measured && !(row->doubt[TG_GROUND_SPEED] > 0)) watch_stuck(e, row, &l);
        watch_digging(e, row, &l, measured);
    }
    tgi_digging_report(&w->digging, o);
}

int32_t tgi_watched(const tg_estimator *e)
{
    const tgi_watch *w = &e->watch;
    return w->stuck ? TG_EVENT_STUCK : w->sinking ? TG_EVENT_IMMOBILIZATION : w->pushing ? TG_EVENT_PUSH : TG_EVENT_NONE;
}
